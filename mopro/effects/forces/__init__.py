"""Forces on the forcer, and the constants of its equation of motion."""
