"""`mopro run` of programs that set registers while an axis moves: they are for the next move."""

import json

import pytest

SETUP = "UU012500/1\nVEL0 8.0\nACC0 0.25\n"
CHANGES = ["VEL1 1.0", "ACC1 0.05", "UU0100/1", "PARA1+", "VEL0 4\nWT50\nACC0 0.5"]


def moves_of(mopro, text):
    done = mopro("run", "P.CMD", "--emulate", "--json", "--out", "x.csv", text=text)
    assert done.returncode == 0, done.stderr
    names = ("profile", "distance", "unit", "set_velocity", "acceleration", "duration_s")
    return [[move[name] for name in names] for move in json.loads(done.stdout)["moves"]]


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("move", ["MRI1 2.0", "MR1 2.0\nGO"])
def test_a_move_under_way_keeps_its_plan_and_the_next_has_the_new_registers(mopro, change, move):
    after = f"{move}\nWX1\n"
    under_way = moves_of(mopro, f"{SETUP}{move}\n{change}\nWX1\n{after}")
    at_rest = moves_of(mopro, f"{SETUP}{move}\nWX1\n{change}\n{after}")
    assert under_way == at_rest
    assert under_way[0] != under_way[1]
