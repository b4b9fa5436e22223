"""Comparison of measured data with the simulation, place by place."""
