"""Search of the sets of effects: which are worth a fit, and which do as well as the best."""
