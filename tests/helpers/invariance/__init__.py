"""Changed copies of an experiment that leave its physics as it is, and answers compared."""
