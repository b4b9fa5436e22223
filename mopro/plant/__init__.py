"""One machine in motion: the equation of motion, heat, platen, trips and what a sensor sees."""
