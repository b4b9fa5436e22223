"""Where measured data and the simulation disagree."""
