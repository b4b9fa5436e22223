"""Residuals of a model against data, and least-squares fits of sets of effects."""
