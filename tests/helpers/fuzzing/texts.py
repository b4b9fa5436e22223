"""Parsers of texts that people write: programs, TOML files, formulas, options."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from helpers.fuzzing.made import with_formulas, with_numbers
from helpers.fuzzing.parser import Parser, Take, files, in_file

_WORDS = (
    "UU012500/1",
    "UU1 10",
    "VEL0 10.0",
    "VELO",
    "VEL1 -",
    "ACC0 0.2",
    "PARA0+",
    "PARA1-",
    "MRI1 ",
    "MRI2 -0.5",
    "MR1 1",
    "MR2 -1",
    "GO",
    "WX0",
    "WX1",
    "WT100",
    ":A",
    "JUMP A",
    "MC1 5.0",
    "HM2",
    "MA1 2",
    "SK1 3",
    "; mopro: allow stall",
    "\x1a",
    "\r\n",
    "\r",
    "\f",
    "\u202e",
    "99999999999",
    "1e9",
    "0.0000000001",
    "+",
    ".",
    "\ufeff",
)
_TOML = (
    "[[effect]]",
    "[effects.",
    "[axis]",
    "[drive]",
    "[platen]",
    "[heat]",
    "extends = ",
    '"chow1992"',
    "name = ",
    "kind = ",
    '"axis"',
    '"thermal"',
    '"kinematic"',
    '"python"',
    "value = ",
    "unit = ",
    "origin = ",
    "formula = ",
    "enters = ",
    "range = [",
    "start = ",
    "machine = ",
    "[[run]]",
    "[[sensor]]",
    "program = ",
    "data = ",
    "column = ",
    '"""',
    "'''",
    "\\u0000",
    "0x7fffffff",
    "1979-05-27T07:32:00Z",
    "inf",
    "nan",
    "1e400",
    "true",
    "{",
    "}",
    "[",
    "]",
    "a.b.c",
    "= []",
    "= {}",
    "= 0",
    "= -1",
    '= ""',
    "[mopro]",
    "[tool.mopro]",
    "\u202e",
    "[base]",
    "[nodes]",
)
_FORMULA = (
    "sin(",
    "min(",
    "lag(x, 1)",
    "delayed(x, t)",
    "**",
    "//",
    " if x else ",
    " and ",
    "not ",
    "< ",
    "==",
    "kelvin(T)",
    "1e308",
    "0x",
    "1_0",
    "lambda",
    "x.y",
    "x[0]",
    "(",
    ")",
    "pi",
    "'",
    "{",
    "side(v)",
    "since_change(x)",
    "presliding(x, 1)",
    "play(x, 0)",
    "first(x)",
    "rate(x)",
    "1j",
)
_UNITS = ("m/s", "kg", "lbf", "W/(m K)", "1/K", "N s2/m2", "%/K", "mm", "arcsec", "^2", "/(", "m3")


# -- programs ----------------------------------------------------------------------


def _program(grammar: str) -> Take:
    from mopro.errors import SourceError
    from mopro.language import parse, source_from_bytes
    from mopro.language.format import format_source
    from mopro.program import lower
    from mopro.program.statements import canonical, resume

    def take(data: bytes) -> None:
        source = source_from_bytes(data, "fuzz.CMD")
        tidy = format_source(source, grammar)
        if format_source(tidy, grammar).text != tidy.text:
            raise AssertionError("the layout of a laid-out program changes")
        try:
            program = lower(parse(source, grammar))
        except SourceError as error:
            error.render()
            raise
        canonical(program)
        resume(program, len(source.lines) // 2)

    return take


def _linted(_: Path) -> Take:
    from helpers.lint_fuzz import check_input

    return partial(check_input, number=1)  # without the machine, whose emulation is no parsing


def _planned(_: Path) -> Take:
    from mopro.motion import plan
    from mopro.program.compile import compile as compile_text

    return lambda data: plan(compile_text(data.decode("latin-1"), grammar="extended"), 10.0)


def _programs() -> list[bytes]:
    """The repository's programs without the comments that they begin with."""
    found = files("programs/*.CMD", "programs/experiments/*.CMD", "tests/data/**/*.CMD")
    return [re.sub(rb"(?m)^;.*\r?\n", b"", data) for data in found]


# -- TOML --------------------------------------------------------------------------


def _source(data: bytes) -> object:
    from mopro.source import Source

    return Source("fuzz.toml", data.decode("utf-8", "replace").replace("\r", "\n"))


def _document(_: Path) -> Take:
    from mopro.tomlfile import Document

    def take(data: bytes) -> None:
        document = Document(_source(data))
        document.root.only(["name"])
        document.read(lambda root: root)

    return take


def _machine(folder: Path) -> Take:
    from mopro.effects import catalogue_of
    from mopro.effects.resolve import active_effects
    from mopro.machine import load_machine
    from mopro.stated.file import kind_of, load_stated

    def read(path: Path) -> None:
        if kind_of(path) is not None:
            load_stated(path)
            return
        machine = load_machine(str(path))
        machine.quantities()
        active_effects(machine, catalogue_of(machine))

    return in_file(folder, "fuzz.toml", read)


def _experiment(folder: Path) -> Take:
    from mopro.experiment.opened import experiment_file
    from mopro.experiment.sawyer.entries import read_sawyer
    from mopro.experiment.sawyer.runs import read_runs

    _beside(folder, "time_s,position_1_mm,temperature_C,x")

    def read(path: Path) -> None:
        read_runs(read_sawyer(experiment_file(path).document))

    return in_file(folder, "fuzz.toml", read)


def _stated_experiment(folder: Path) -> Take:
    from mopro.experiment.opened import experiment_file
    from mopro.experiment.stated.entries import read_stated_entries
    from mopro.experiment.stated.read import read_stated_experiment

    _beside(folder, "time_s,u,T_C,x_C")

    def read(path: Path) -> None:
        read_stated_experiment(read_stated_entries(experiment_file(path).document))

    return in_file(folder, "fuzz.toml", read)


def _beside(folder: Path, columns: str) -> None:
    """Write the files that the seeds of experiments name."""
    from helpers.paths import ROOT

    (folder / "machine.toml").write_bytes((ROOT / "examples/heater/machine.toml").read_bytes())
    rows = "".join(f"{n * 0.1:.1f},{n % 7},{20 + n * 0.01},{n * 0.1}\n" for n in range(40))
    (folder / "data.csv").write_text(f"{columns}\n{rows}")
    (folder / "LVDT3.CMD").write_bytes((ROOT / "programs/LVDT3.CMD").read_bytes())


def _instrument(folder: Path) -> Take:
    from mopro.experiment.sawyer.entries import instrument

    return in_file(folder, "fuzz.toml", lambda path: instrument(str(path), 1))


def _dialect(folder: Path) -> Take:
    from mopro.link.dialect import load_dialect

    return in_file(folder, "fuzz.toml", lambda path: load_dialect(str(path)))


def _scenario(folder: Path) -> Take:
    from mopro.controller import load_scenario

    return in_file(folder, "fuzz.toml", load_scenario)


def _settings(folder: Path) -> Take:
    from mopro.lint.config import find_settings

    return in_file(folder, "mopro.toml", lambda path: find_settings(path.parent))


def _effects(folder: Path) -> Take:
    from mopro.blind.cases.stated_effects import StatedEffects

    def read(path: Path) -> None:
        stated = StatedEffects.read(str(path), "chow1992")
        assert stated.machine.formulas

    return in_file(folder, "fuzz.toml", read)


def _catalogue(_: Path) -> Take:
    from mopro.errors import ModelError
    from mopro.formula.entry import read_effect
    from mopro.stated.file import HOSTS
    from mopro.tomlfile import Document, Value

    units = dict.fromkeys(("x", "force", "power", "foreign", "time"), "m")

    def effects(host: object, root: Value) -> list[object]:
        return [
            entry.need("name", lambda _, e=entry: read_effect(e, host, units, own=False), "no name")
            for entry in root.sections("effect")
        ]

    def take(data: bytes) -> None:
        document = Document(_source(data))
        for host in HOSTS.values():
            with suppress(ModelError):
                document.read(partial(effects, host))

    return take


_EFFECT = b"""
[[effect]]
name = "ripple"
enters = "force"
formula = "A * sin(2 * pi * x / L + p)"
A = { unit = "N", range = [0.01, 1.0] }
L = { unit = "m", range = [1e-4, 1e-2], role = "shape" }
p = { unit = "rad", range = [0, 6.3], role = "shape" }
"""
_SCENARIO = b'seed = 7\n[[fault]]\nkind = "flip"\nrate = 0.001\ndirection = "to_host"\ntimes = 3\n'
_LOST = b'[[fault]]\nkind = "lost_steps"\nrun_s = 0.4\naxis = 1\npitches = 2\n'
_SETTINGS = b'machine = "chow1992"\npayload = "5 lb"\nselect = ["stall"]\nlow-margin = "20 %"'
_TRAVEL = b'\nstart = { 1 = "2 in" }\ntravel = { 1 = "30 in", 2 = "10 in" }\ngrammar = "extended"\n'
_SAWYER = b"""machine = "chow1992"
[[sensor]]
name = "laser"
quantity = "position"
axis = 1
column = "position_1_mm"
rate_hz = 10.0
noise_rms = 0.01
[[run]]
program = "LVDT3.CMD"
data = "data.csv"
payload = "5 lb"
"""
_HEATER = b"""machine = "machine.toml"
[inputs]
duty = { formula = "u / 7", unit = "1", hold = true }
ambient = { formula = "21 + 0 * t", unit = "C" }
[[sensor]]
name = "block1"
quantity = "temperature"
column = "T_C"
noise_rms = "unknown"
zero = 0
[[sensor]]
name = "block2"
quantity = "temperature"
column = "x_C"
noise_rms = 0.1
[[run]]
data = "data.csv"
part = [0, 0.8]
use = "u < 6 and since_change(u) > 0.05"
"""
_SENSOR = b"""name = "mine"
quantity = "position"
column = "position_1_mm"
rate_hz = 1e3
noise_rms = 0.1
"""


def _tomls() -> list[bytes]:
    return files("mopro/**/*.toml", "examples/**/*.toml", "programs/**/*.toml")


# -- formulas, units, options ------------------------------------------------------


def _formula(_: Path) -> Take:
    import numpy as np

    from mopro.formula import FormulaError, parse
    from mopro.formula.bytecode import FIXED, Assembler
    from mopro.formula.closures import closure_of
    from mopro.formula.dimension import dimension_in, dimension_of_unit
    from mopro.formula.evaluate import evaluate
    from mopro.formula.expressions import check_names, substituted

    time_s = np.linspace(0.0, 1.0, 5)
    names = {"x": np.sin(time_s), "v": time_s * 0 + 1e300, "T": time_s - 1, "t": time_s}
    dimensions = {
        "x": dimension_of_unit("m"),
        "v": dimension_of_unit("m/s"),
        "T": dimension_of_unit("C"),
        "t": dimension_of_unit("s"),
    }
    slots = {name: place for place, name in enumerate(names)}
    # Compiled once, which takes a second and is no parsing.
    evaluate(parse("presliding(x, 1)"), names, time_s)

    def take(data: bytes) -> None:
        try:
            formula = parse(data.decode("utf-8", "replace"))
            check_names(formula, names)
            evaluate(formula, names, time_s)
            dimension_in(formula, dimensions)
            if not formula.of_signals:
                assembler = Assembler([FIXED] * len(names))
                assembler.program([assembler.value(formula, slots)])
                closure_of(formula, list(names), (1.0,) * len(names))
            evaluate(substituted(formula, {"x": formula}), names, time_s)
        except FormulaError:
            return

    return take


def _unit(_: Path) -> Take:
    from mopro.formula.dimension import UnitError, dimension_of_unit, factor_of, product, words

    def take(data: bytes) -> None:
        text = data.decode("utf-8", "replace")
        try:
            words(dimension_of_unit(text))
            factor_of(text)
            dimension_of_unit(product(text, "m/s"))
        except UnitError:
            return

    return take


def _quantity(_: Path) -> Take:
    from mopro.units import UNITS, is_number_without_unit, parse_quantity

    kinds = [(kind, unit) for unit, (kind, _) in UNITS.items()]

    def take(data: bytes) -> None:
        text = data[1:].decode("utf-8", "replace")
        is_number_without_unit(text)
        kind, unit = kinds[(data[0] if data else 0) % len(kinds)]
        try:
            parse_quantity(text, kind, unit)
        except ValueError:
            return

    return take


def _options(_: Path) -> Take:
    from mopro.cli.main import COMMANDS, group

    commands = [group.get_command(None, name) for name in COMMANDS]

    def take(data: bytes) -> None:
        which, *rest = data.split(b"\n")
        command = commands[sum(which) % len(commands)]
        args = [part.decode("utf-8", "surrogateescape") for part in rest if b"\0" not in part]
        command.make_context("mopro", args).close()

    return take


def _option_words() -> tuple[str, ...]:
    return (
        "--for",
        "--payload",
        "--rate",
        "--deadline",
        "--velocities",
        "--start",
        "--travel",
        "--idle",
        "5 lb",
        "2 min",
        "1e400",
        "-1",
        "nan",
        "0",
        "10,20",
        "1=2in",
        "--seed",
        "--out",
        "a.csv",
        "-",
        "P.CMD",
        "--grammar",
        "extended",
        "--port",
        "--help",
        "--select",
        "--json",
        "--baud",
        "1 = ",
    )


def _shown(_: Path) -> Take:
    from mopro.cli.say import _painted
    from mopro.text import plain, visible

    def take(data: bytes) -> None:
        text = visible(data.decode("utf-8", "surrogateescape"))
        if any(not (c.isprintable() or c in "\n\t") for c in text):
            raise AssertionError("something that is not shown has passed")
        plain(text)
        for line in text.split("\n"):
            _painted(line)

    return take


_OPTIONS = [
    b"x\nP.CMD\n--emulate\n--for\n10 s\n--payload\n5lb\n--rate\n1kHz",
    b"y\n--velocities\n10,20\n--rate\n15",
    b"z\n--idle\n60s\n--listen\npty\n--speed\n2",
    b"w\nP.CMD\n--start\n1=2in\n--travel\n1=30in\n--select\nstall",
    b"v\n--seed\n1\n--out\na.csv",
]

_TEXTS = (
    Parser(
        "program, attested",
        ("mopro.language", "mopro.program", "mopro.source"),
        lambda _: _program("attested"),
        _programs,
        _WORDS,
        6,
        600,
    ),
    Parser(
        "program, extended",
        ("mopro.language", "mopro.program", "mopro.source"),
        lambda _: _program("extended"),
        _programs,
        _WORDS,
        6,
        600,
    ),
    Parser("program, linted", ("mopro.lint",), _linted, _programs, _WORDS, 1, 300),
    Parser("program, planned", ("mopro.motion",), _planned, _programs, _WORDS, 2, 300),
    Parser("TOML", ("mopro.tomlfile",), _document, _tomls, _TOML, 12, 1024),
    Parser(
        "machine file",
        ("mopro.machine.file", "mopro.stated.file", "mopro.effects.resolve"),
        _machine,
        _tomls,
        _TOML,
        1,
        4096,
        change=with_formulas,
    ),
    Parser(
        "experiment file",
        ("mopro.experiment.sawyer.entries", "mopro.experiment.sawyer.runs"),
        _experiment,
        lambda: [_SAWYER, *_tomls()],
        _TOML,
        1,
        change=with_formulas,
    ),
    Parser(
        "experiment file, other kinds",
        ("mopro.experiment.stated.entries",),
        _stated_experiment,
        lambda: [_HEATER, *_tomls()],
        _TOML,
        1,
        change=with_formulas,
    ),
    Parser(
        "instrument file",
        ("mopro.experiment.sawyer.entries",),
        _instrument,
        lambda: [_SENSOR, *_tomls()],
        _TOML,
        2,
        1024,
    ),
    Parser(
        "dialect file",
        ("mopro.link.dialect", "mopro.link.template"),
        _dialect,
        lambda: files("mopro/link/dialects/*.toml"),
        _TOML,
        1,
        4096,
    ),
    Parser(
        "fault scenario",
        ("mopro.controller.faults",),
        _scenario,
        lambda: [_SCENARIO, _LOST, _SCENARIO + _LOST],
        _TOML,
        4,
        1024,
    ),
    Parser(
        "settings of lint",
        ("mopro.lint.config",),
        _settings,
        lambda: [_SETTINGS + _TRAVEL, _SETTINGS],
        _TOML,
        4,
        1024,
    ),
    Parser(
        "effects as formulas",
        ("mopro.formula.entry", "mopro.machine.formulas"),
        _effects,
        lambda: [_EFFECT],
        _TOML + _FORMULA,
        2,
        1024,
        change=with_formulas,
    ),
    Parser(
        "catalogue of effects",
        ("mopro.formula.entry",),
        _catalogue,
        lambda: [_EFFECT, *files("mopro/stated/catalogue/*.toml")],
        _TOML + _FORMULA,
        1,
        change=with_formulas,
    ),
    Parser(
        "formula",
        # Without `signals`: numba cannot compile what is instrumented.
        ("mopro.formula.expressions", "mopro.formula.evaluate", "mopro.formula.dimension"),
        _formula,
        lambda: [b"A * sin(x)", b"lag(x, 1) + min(v, T)", b"x if v > 0 else -x ** 2"],
        _FORMULA,
        12,
        600,  # above the bound of a formula
        change=with_formulas,
    ),
    Parser(
        "unit",
        ("mopro.formula.dimension",),
        _unit,
        lambda: [b"N s/m", b"W/(m K)", b"1/K", b"m^2/s", b"%"],
        _UNITS,
        30,
        60,
    ),
    Parser(
        "quantity with a unit",
        ("mopro.units",),
        _quantity,
        lambda: [b"\x101.5 kg", b"\x202 min", b"\x30.5", b"\x40-3e5 in"],
        _UNITS,
        100,
        60,
    ),
    Parser(
        "options of every command",
        ("mopro.cli.options",),
        _options,
        lambda: _OPTIONS,
        _option_words(),
        2,
        200,
    ),
    Parser(
        "text for the terminal",
        ("mopro.text", "mopro.cli.say"),
        _shown,
        lambda: [b"a.CMD:1:2: warning: odd [stall]\n  WT\n  ^~", b"\x1b[31m\xe2\x80\xae$x$"],
        (":1:1: ", " [a]", "\x1b]0;", "\u202e"),
        20,
        400,
    ),
)

TEXTS = tuple(replace(parser, change=parser.change or with_numbers) for parser in _TEXTS)
