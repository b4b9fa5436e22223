"""Predictions of an experiment's readings for given effects."""
