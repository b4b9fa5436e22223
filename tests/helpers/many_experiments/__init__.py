"""Valid small experiments of every kind of machine, drawn by a seed, and their judge."""
