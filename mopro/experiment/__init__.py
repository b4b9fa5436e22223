"""Experiments: measured data beside the program and the machine that they came from."""
