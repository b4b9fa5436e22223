"""Experiments on machines of another kind than the motor: read, compared, diagnosed, repaired."""
