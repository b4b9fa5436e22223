"""An editor that sends anything is answered, or the server ends with a documented code."""

import pytest

from helpers.lsp_noise import session


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_ends_without_a_traceback(seed):
    found = session(seed, most=12)
    assert found.failures == ()
    assert found.messages >= 3
