"""Steps of least squares, within ranges and without."""

import numpy as np
import pytest

from mopro.engine.fits.jacobian import bounded_step, gauss_newton_step

# Two columns that share a third of their length: of the residual -3 each, the steps are 2.25.
COLUMNS = np.array([[1.0, 0.0], [1.0 / 3, np.sqrt(8) / 3]]).T
RESIDUAL = np.array([-3.0, -3.0 * np.sqrt(2) / 2])


def test_a_step_within_the_ranges_is_that_of_gauss_and_newton():
    step = bounded_step(COLUMNS, RESIDUAL, np.array([[-9.0, -np.inf], [9.0, np.inf]]))
    assert step == pytest.approx([2.25, 2.25])
    assert (step == gauss_newton_step(COLUMNS, RESIDUAL)).all()


def test_where_a_range_ends_the_other_parameter_makes_up_for_what_is_missing():
    """The first stops at 1.5, which leaves -3 + 1.5 / 3 along the second column."""
    step = bounded_step(COLUMNS, RESIDUAL, np.array([[-9.0, -np.inf], [1.5, np.inf]]))
    assert step == pytest.approx([1.5, 2.5])


def test_a_parameter_beyond_its_range_by_rounding_stays():
    step = bounded_step(COLUMNS, RESIDUAL, np.array([[-9.0, -9.0], [-1e-16, 9.0]]))
    assert step == pytest.approx([0.0, 3.0])
