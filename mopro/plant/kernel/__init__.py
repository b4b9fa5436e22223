"""The equation of motion of one axis and its integration, composed for a set of effects."""
