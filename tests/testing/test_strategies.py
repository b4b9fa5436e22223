"""The strategies generate the cases that they are for."""

import pytest
from hypothesis import Phase, find, settings

import mopro
from mopro.motion import Shape
from mopro.testing import profiles, program_texts

QUICK = settings(phases=[Phase.generate], max_examples=500, derandomize=True, database=None)


@pytest.mark.parametrize("shape", Shape)
def test_profiles_are_of_every_shape(shape):
    assert find(profiles(), lambda p: p.shape is shape, settings=QUICK).distance > 0


@pytest.mark.parametrize("oddity", ["\r\n", ";", "\t", "vel", "VELO"])
def test_texts_have_the_oddities_of_dos_files_and_compile(oddity):
    text = find(program_texts(), lambda text: oddity in text, settings=QUICK)
    assert mopro.compile(text).ops
