"""The grids, one file for each."""
