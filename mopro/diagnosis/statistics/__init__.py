"""Statistics of a fit: noise, evidence, held-out parts, and tests of what is left."""
