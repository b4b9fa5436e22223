"""Effects between the true position and the reading of an instrument."""
