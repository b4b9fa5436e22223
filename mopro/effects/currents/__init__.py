"""The drive's phase currents, in units of the set current I.

The nominal setpoints are i_a = cos θ, i_b = sin θ with θ = k x_c.
"""
