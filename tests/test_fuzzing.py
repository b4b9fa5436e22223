"""Every parser with its seeds and some changes of them: the project's own errors, nothing else."""

from random import Random

import pytest

from helpers.fuzzing.every import PARSERS
from helpers.fuzzing.parser import allowed

_SEEDS, _CHANGES = 3, 12


@pytest.mark.parametrize("name", PARSERS)
def test_a_parser_raises_only_what_is_for_a_person(tmp_path, name):
    parser, random = PARSERS[name], Random(name)
    take, seeds = parser.make(tmp_path), parser.starts()[:_SEEDS]
    changes = min(_CHANGES, (parser.most or 10_000) // 500)
    inputs = [*seeds, *(parser.varied(random, s) for s in seeds * changes)]
    taken = 0
    for data in inputs:
        try:
            take(data)
        except allowed():
            pass
        taken += 1
    assert taken == len(inputs) > 0
