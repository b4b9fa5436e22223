"""Every reading of an experiment as a model with given effects predicts it."""
