"""Experiments on a Sawyer motor: read, checked, predicted, diagnosed, repaired, continued."""
