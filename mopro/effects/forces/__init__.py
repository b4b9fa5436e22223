"""Effects in the equation of motion: forces on the forcer, and its constants."""
