"""The six programs of the source: their statements as attested, and their IR as text."""

import json

import pytest

from helpers.paths import DATA
from mopro.language import load, parse
from mopro.program import statements
from mopro.program.compile import compile_file

GOLDEN = DATA / "ir"

_LVDT = """UU012500/1 VEL2_0.00008 ACC2_0.00008 VEL1_40.0 ACC1_{acc} PARA1{para}
:B1 MRI1_15.0 WX1 WT2000 MRI1_-15.0 WX1"""
ATTESTED = {
    "LVDT1": _LVDT.format(acc="0.25", para="-"),
    "LVDT2": _LVDT.format(acc="0.1", para="-"),
    "LVDT3": _LVDT.format(acc="0.6", para="+"),
    "LVDT4": _LVDT.format(acc="0.25", para="+"),
    "TEMP1": "UU012500/1 VELO_15.0 ACCO_0.2 :B1 MRI2_15.0 WX2 MRI2_-15.0 WX2 JUMP_B1",
    "TEMP2": """UU012500/1 VELO_15.0 ACCO_0.2
        :B1 MR2_8.0 MR1_-8.0 GO WX2 WX1 MR2_-8.0 MR1_8.0 GO WX1 WX2 JUMP_B1""",
}


@pytest.mark.parametrize("name", ATTESTED)
def test_statements_are_those_of_the_listing(name, programs_folder):
    tree = parse(load(programs_folder / f"{name}.CMD"))
    written = [
        tree.source.line(s.span.line)[s.span.column - 1 : s.span.end_column - 1]
        for s in tree.statements
    ]
    assert written == [word.replace("_", " ") for word in ATTESTED[name].split()]


def test_there_are_six_and_some_have_dos_line_ends(program_files):
    assert [path.stem for path in program_files] == list(ATTESTED)
    assert any(b"\r\n" in path.read_bytes() for path in program_files)


@pytest.mark.parametrize("name", ATTESTED)
def test_ir_listing_is_the_one_checked_in(name, programs_folder):
    """Made by `mopro compile programs/NAME.CMD`; look at what changes before checking it in."""
    program = compile_file(programs_folder / f"{name}.CMD")
    assert statements.listing(program) == (GOLDEN / f"{name}.txt").read_text()


def test_loops_are_known_without_running(programs_folder):
    forever = {
        name: compile_file(programs_folder / f"{name}.CMD").loops_forever for name in ATTESTED
    }
    assert [name for name, loops in forever.items() if loops] == ["TEMP1", "TEMP2"]


def test_json_has_every_operation_with_its_place(programs_folder):
    data = json.loads(json.dumps(statements.as_json(compile_file(programs_folder / "LVDT3.CMD"))))
    assert data["program"] == "LVDT3.CMD"
    assert data["ops"][4] == {
        "op": "set_acceleration", "at": [17, 1], "axes": [1], "acceleration_uu_s2": 600,
    }  # fmt: skip
    assert data["ops"][1]["velocity_uu_s"] == "0.00008"
