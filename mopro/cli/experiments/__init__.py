"""Commands on measured data: compare, reconcile, measure, noise, import, blind."""
