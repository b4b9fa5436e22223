"""Least squares over a box, where each evaluation of the residual costs a simulation.

Knows numpy and scipy alone.
"""

from mopro.leastsquares.descent import Descent
from mopro.leastsquares.jacobian import gauss_newton_step

__all__ = ["Descent", "gauss_newton_step"]
