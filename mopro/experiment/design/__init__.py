"""The next experiment: the program that separates the alternatives of a verdict."""
