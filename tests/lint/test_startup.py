"""Text rules, and what the bounds decide, need no numpy; nor does a clean start."""

import subprocess
import sys

import pytest

from helpers.paths import PROGRAMS

PROGRAM = PROGRAMS / "LVDT3.CMD"
RUN = """
import sys
sys.argv = ["mopro", *{words!r}]
from mopro.cli import main
try:
    main()
except SystemExit:
    print(*sys.modules, file=sys.stderr)
"""


def modules(*words):
    code = RUN.format(words=[*words, str(PROGRAM)])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


@pytest.mark.parametrize("words", [("lint",), ("lint", "--select", "unused-label"), ("fmt",)])
def test_no_heavy_module_is_loaded(words):
    loaded = modules(*words)
    assert "mopro.language.parse" in loaded
    assert not loaded & {"numpy", "numba", "rich", "difflib", "json", "pygls", "matplotlib"}


def test_what_only_writing_needs_is_not_loaded():
    modules("lint")  # keeps the parser, which is written
    assert not modules("lint") & {"mopro.files", "mopro.cli.outputs"}


def test_text_rules_load_no_motion_and_no_machine():
    loaded = modules("lint", "--select", "unused-label,letter-o-axis")
    assert "mopro.machine" not in loaded
    assert "mopro.emulator" not in loaded
