"""Experiments on machines whose equations a file states: read, compared, diagnosed, repaired."""
