"""The tables of docs/untrusted.md, of bounds and of attacks, are those of the code."""

import csv
import re

import pytest

from helpers.attacks import ATTACKS, files_of
from helpers.paths import ROOT
from mopro.controller import device, station, store
from mopro.controller.serve import IDLE_S
from mopro.emulator.backend import MOST_SAMPLES
from mopro.experiment import data_file as data
from mopro.formula import entry as entries
from mopro.formula import expressions as formulas
from mopro.formula.dimension import LARGEST_EXPONENT, MOST_FACTORS
from mopro.instruments import laboratory
from mopro.language.load import MOST_BYTES as MOST_PROGRAM_BYTES
from mopro.language.load import MOST_COLUMNS, MOST_LINES
from mopro.language.parse import MOST_DIGITS as MOST_DIGITS_OF_PROGRAM
from mopro.link.template import MOST_DIGITS
from mopro.lint.stall_margins import MOST_EMULATED_S
from mopro.logs import containers, layout, log
from mopro.logs.hdf5 import LEAST_S, S_PER_MB
from mopro.lsp.language_server import MOST_BYTES as MOST_MESSAGE_BYTES
from mopro.lsp.language_server import MOST_CHARACTERS
from mopro.machine.model import FASTEST_1_S
from mopro.motion.planner import LONGEST_RUN_S, MOST_STATEMENTS
from mopro.program.lower import MOST_DWELL_MS
from mopro.recording import reading
from mopro.stated import file as rigs
from mopro.sweeps import results, varied
from mopro.tomlfile import MOST_BYTES as MOST_TOML_BYTES
from mopro.tomlfile.scan import MOST_LEVELS
from mopro.viewer import page_server

MIB = 1 << 20
BOUNDS = [
    (
        "a machine beside the motor",
        [f"{rigs.MOST_NUMBERS} numbers, {entries.MOST_EFFECTS} effects"],
    ),
    ("a machine beside the motor", [f"effects of {entries.MOST_PARAMETERS} parameters"]),
    (
        "a formula",
        [
            f"{formulas.MOST_CHARACTERS} characters",
            f"{formulas.MOST_LEVELS} levels",
            f"numbers to {formulas.LARGEST:g}",
            f"units to the power of {LARGEST_EXPONENT}",
        ],
    ),
    ("a unit", [f"exponents of {MOST_FACTORS}"]),
    ("a log (HDF5)", [f"within {LEAST_S:g} s and {S_PER_MB:g} s for each MB"]),
    ("a live page", [f"{page_server.MOST_CONNECTIONS} connections, {page_server.PATIENCE_S:g} s"]),
    ("program", [f"{MOST_PROGRAM_BYTES // MIB} MiB", f"{MOST_COLUMNS} characters a line"]),
    ("program", [f"{MOST_LINES} lines"]),
    ("program", [f"{MOST_DIGITS_OF_PROGRAM} characters a number"]),
    ("a wait", [f"{MOST_DWELL_MS} ms"]),
    ("a move", [f"{LONGEST_RUN_S / 86400:g} days"]),
    ("a run, planned", [f"{MOST_STATEMENTS} statements"]),
    ("`--for`", [f"{LONGEST_RUN_S / 86400:g} days"]),
    ("a run, recorded", [f"{LONGEST_RUN_S / 86400:g} days", f"{MOST_SAMPLES} samples"]),
    ("moves emulated by `lint`", [f"{MOST_EMULATED_S:g} s"]),
    ("TOML", [f"{MOST_TOML_BYTES // MIB} MiB", f"{MOST_LEVELS} levels"]),
    ("a machine's motion", [f"{FASTEST_1_S:g} /s"]),
    ("CSV data", [f"{data.MOST_ROWS} rows", f"{data.MOST_CHARACTERS - 1} characters"]),
    ("a log (text)", [f"{log.MOST_ROWS} rows", f"{layout.MOST_COLUMNS} columns"]),
    ("a log (text)", [f"{log.MOST_CHARACTERS} characters"]),
    (
        "a log (Parquet, NPZ, HDF5, MCAP)",
        [f"{containers.MOST_COLUMNS} columns", f"{containers.MOST_MESSAGE_BYTES} bytes"],
    ),
    ("`.DAT`", [f"{laboratory.MOST_LINES} lines"]),
    ("recording (Parquet, NPZ, CSV)", [f"{reading.MOST_ROWS} rows"]),
    ("recording (Parquet, NPZ, CSV)", [f"{reading.MOST_COLUMNS} columns"]),
    ("recording (Parquet, NPZ, CSV)", [f"{reading.MOST_VALUES} values"]),
    ("its header (Arrow metadata)", [f"{reading.MOST_HEADER_BYTES} bytes"]),
    ("a sweep", [f"{varied.MOST_POINTS} points", f"{varied.MOST_VARIED} quantities"]),
    ("a sweep", [f"{results.MOST_ROW_BYTES} bytes a row"]),
    ("a message of an editor", [f"{MOST_MESSAGE_BYTES} bytes"]),
    ("a text in an editor", [f"{MOST_CHARACTERS} characters"]),
    ("a controller's answer", [f"{MOST_DIGITS} digits"]),
    ("`serve`: towards the controller", [f"{station.MOST_INWARD} bytes"]),
    ("`serve`: from the controller", [f"{station.MOST_OUTWARD} bytes"]),
    ("`serve`: stored programs", [f"{store.MOST_PROGRAMS}, of {device.MOST_STATEMENTS}"]),
    ("`serve`: a silent client", [f"{IDLE_S:g} s"]),
]


def table(name):
    with open(ROOT / "docs" / "data" / name, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def rows():
    return {row["input"]: row["bound"] for row in table("bounds.csv")}


def test_the_page_shows_both_tables():
    text = (ROOT / "docs" / "untrusted.md").read_text("utf-8")
    for name in ("bounds.csv", "figures/attacks.csv"):
        assert f"<!-- table: data/{name} -->" in text


def test_the_table_of_attacks_is_that_of_the_bench():
    shown = {
        row["attack"]: re.findall(r"`([\w/]+\.py)`", row["tests"])
        for row in table("figures/attacks.csv")
    }
    assert shown == {attack: files_of(attack) for attack in ATTACKS}
    named = {name for names in shown.values() for name in names}
    assert len(named) > 10
    assert [name for name in named if not (ROOT / "tests" / name).is_file()] == []


@pytest.mark.parametrize("attack", ATTACKS)
def test_each_test_of_an_attack_is_there(attack):
    for name in ATTACKS[attack]:
        file, _, begins = name.partition("::")
        assert f"def {begins.partition('[')[0]}" in (ROOT / "tests" / file).read_text("utf-8")


@pytest.mark.parametrize(("name", "bounds"), BOUNDS)
def test_the_table_states_the_bound_of_the_code(rows, name, bounds):
    for bound in bounds:
        assert bound in rows[name]


def test_every_row_but_those_without_a_constant_is_compared(rows):
    compared = {name for name, _ in BOUNDS}
    assert rows.keys() - compared == {
        "`--payload`", "a quantity of a machine", "a conversation", "`serve`: clients",
    }  # fmt: skip
