"""Consistency of an experiment before it is compared: units, times, limits, stalls."""
