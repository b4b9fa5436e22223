"""Standard output and error: full, closed, in another encoding, and with text from outside."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from pyarrow.lib import ArrowException

from helpers.commands import LIMIT_S, SETTINGS, run_here
from helpers.paths import ROOT

ESC, RTL = "\x1b[2J", "\u202e"
PROGRAM = "UU012500/1\nVEL0 40.0\nACC0 0.25\nMRI1 0.5\nWX1\n"
MACHINE = str(ROOT / "mopro" / "machine" / "machines" / "chow1992.toml")
COMMANDS = [
    ["--help"],
    ["--version"],
    ["compile", "P.CMD"],
    ["lint", "BAD.CMD"],
    ["fmt", "--diff", "MESSY.CMD"],
    ["fmt", "-"],
    ["thesis", "3.2"],
    ["thesis", "3.2", "--json"],
    ["machine", "show"],
    ["machine", "check", MACHINE],
    ["run", "P.CMD", "--emulate", "--out", "o.csv"],
    ["run", "P.CMD", "--emulate", "--out", "o.csv", "--json"],
    ["serve"],
]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "P.CMD").write_text(PROGRAM)
    (tmp_path / "BAD.CMD").write_text("VEL0 0\n")
    (tmp_path / "MESSY.CMD").write_text("  vel0   40.0\n")
    return tmp_path


def ended(folder, *args, shell="", env=None, stdin=PROGRAM):
    command = " ".join(f'"{a}"' for a in (sys.executable, "-m", "mopro", *args))
    return subprocess.run(
        ["bash", "-c", f"exec {command} {shell}"], cwd=folder, input=stdin, capture_output=True,
        env=os.environ | SETTINGS | (env or {}), text=True, errors="replace", timeout=LIMIT_S,
        check=False,
    )  # fmt: skip


@pytest.mark.parametrize("args", COMMANDS, ids=" ".join)
def test_a_full_output_is_told_in_one_line(folder, args):
    done = ended(folder, *args, shell="> /dev/full")
    told = done.stderr.splitlines()
    assert done.returncode == 2
    expected = "mopro: the output cannot be written: No space left on device [unwritable-output]"
    assert told[-1] == expected
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("args", COMMANDS[:-1], ids=" ".join)
def test_a_closed_output_does_not_change_the_answer(folder, args):
    done = run_here(folder, *args, stdin=PROGRAM.encode())
    closed = ended(folder, *args, shell=">&-")
    assert closed.returncode == done.returncode
    assert closed.stderr == done.stderr


def test_all_streams_may_be_closed(folder):
    done = ended(folder, "run", "P.CMD", "--emulate", "--out", "o.csv", shell="<&- >&- 2>&-")
    assert done.returncode == 0
    assert (folder / "o.csv").read_text().startswith("# mopro {")


@pytest.mark.parametrize("unbuffered", ["", "1"], ids=["buffered", "unbuffered"])
def test_a_full_error_output_does_not_change_the_answer(folder, unbuffered):
    """Python flushes a buffered standard error again at exit."""
    env = {"PYTHONUNBUFFERED": unbuffered}
    done = ended(folder, "lint", "BAD.CMD", "none.CMD", shell="2> /dev/full", env=env)
    assert done.returncode == 2
    assert "bad-velocity" in done.stdout


def test_a_reader_that_has_gone_ends_the_command_quietly(folder):
    done = ended(folder, "thesis", "3.2", "--json", shell="| true; exit ${PIPESTATUS[0]}")
    assert done.stderr == ""


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    "error",
    [
        ImportError("libarrow.so.2600: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
        SystemError("<function f> returned NULL without setting an exception"),
        ArrowException("Unknown error: Failed to launch worker thread: Resource unavailable"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        caused(AttributeError("partially initialized module"), MemoryError()),
    ],
)
def test_what_libraries_make_of_too_little_memory_is_told_as_such(monkeypatch, tmp_path, error):
    def group(**_):
        raise error

    monkeypatch.setattr(sys.modules["mopro.cli.main"], "group", group)
    done = run_here(tmp_path, "ports")
    assert done.returncode == 2
    assert done.stderr == "mopro: there is not enough memory for this input [no-memory]\n"


def test_other_errors_of_libraries_are_not_taken_for_it(monkeypatch, tmp_path):
    def group(**_):
        raise RuntimeError("a fault of the program")

    monkeypatch.setattr(sys.modules["mopro.cli.main"], "group", group)
    with pytest.raises(RuntimeError, match="a fault of the program"):
        run_here(tmp_path, "ports")


def test_a_fault_of_the_program_is_no_finding(tmp_path):
    """A script that reads exit code 1 as findings must not take a traceback for one."""
    text = (
        "import sys, mopro.cli\n"
        "sys.modules['mopro.cli.main'].group = lambda **_: 1 / 0\n"
        "mopro.cli.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True,
        timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 70
    assert done.stderr.startswith("Traceback")
    assert done.stderr.endswith("ZeroDivisionError: division by zero\n")


def test_a_lack_of_memory_where_nothing_can_be_raised_is_no_traceback(capfd):
    hook = sys.modules["mopro.cli.main"]._unraisable
    lost = {"exc_traceback": None, "err_msg": None, "object": None}
    hook(SimpleNamespace(exc_type=MemoryError, exc_value=MemoryError(), **lost))
    assert capfd.readouterr().err == ""


def test_too_little_memory_is_told(mopro, monkeypatch):
    def failing(*args):
        raise MemoryError

    monkeypatch.setattr("mopro.cli.program_files.compiled_program", failing)
    done = mopro("compile", "P.CMD", text=PROGRAM)
    assert done.returncode == 2
    assert done.stderr == "mopro: there is not enough memory for this input [no-memory]\n"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
@pytest.mark.parametrize("args", [["thesis", "3.2"], ["machine", "show"], ["--help"]], ids=" ".join)
def test_an_output_that_lacks_characters_does_without_them(folder, args, encoding):
    env = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    done = ended(folder, *args, env=env)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout) > 100


# -- text from outside -------------------------------------------------------------


def clean(text):
    return all(c.isprintable() or c in "\n\t" for c in text)


def test_the_names_and_words_of_files_do_not_steer_the_terminal(mopro, tmp_path):
    odd = f"{ESC}{RTL}.CMD"
    (tmp_path / odd).write_text(f"  vel0 40.0 ; {ESC}{RTL}\nV{ESC}X\n")
    for args in (
        ["compile", odd], ["lint", odd], ["fmt", odd], ["fmt", "--diff", odd],
        ["run", odd, "--emulate"], ["run", "none" + ESC, "--emulate"], ["lint", "--explain", ESC],
        ["compare", odd], ["machine", "check", odd], ["frob" + ESC],
        ["run", odd, "--emulate", "--for", ESC],
    ):  # fmt: skip
        done = mopro(*args)
        assert done.returncode in (1, 2), args
        assert clean(done.stdout + done.stderr), args
        assert "Traceback" not in done.stderr


def test_the_difference_is_shown_without_control_characters(mopro, tmp_path):
    (tmp_path / "P.CMD").write_text(f"  vel0 40.0 ; {ESC}{RTL}\n")
    done = mopro("fmt", "--diff", "P.CMD")
    assert "\\x1b[2J\\u202e" in done.stdout
    assert clean(done.stdout)


def test_keys_and_values_of_toml_and_csv_are_shown_as_escapes(mopro, tmp_path):
    (tmp_path / "m.toml").write_text('"a\\u001b[2Jb" = 1\nname = "\\u202e"\n')
    (tmp_path / "e.toml").write_text(
        'machine = "chow1992"\n[[sensor]]\nname = "s\\u001b[31m"\nquantity = "position"\n'
        'column = "position_1_in"\nrate_hz = 2000.0\nnoise_rms = 2e-5\n'
        '[[run]]\nprogram = "P.CMD"\ndata = "d.csv"\n'
    )
    (tmp_path / "P.CMD").write_text(PROGRAM)
    (tmp_path / "d.csv").write_text(f"time_s,position_1_in\n0.0,{ESC}\n0.1,{RTL}1\n")
    for args in (["machine", "check", "m.toml"], ["compare", "e.toml"]):
        done = mopro(*args)
        assert done.returncode in (1, 2)
        assert clean(done.stdout + done.stderr)
        assert "\\x1b" in done.stderr


@pytest.mark.parametrize("form", ["text", "json", "sarif", "github"])
def test_a_file_name_that_is_not_utf8_is_reported(folder, form):
    name = b"odd\xff\x1b.CMD"
    (folder / os.fsdecode(name)).write_bytes(b"VEL0 0\n")
    done = subprocess.run(
        [sys.executable, "-m", "mopro", "lint", "--format", form, name],
        cwd=folder, env=os.environ | SETTINGS, capture_output=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert b"Traceback" not in done.stderr
    assert b"bad-velocity" in done.stdout
    assert b"\x1b" not in done.stdout


def test_markup_in_a_name_is_not_markup(mopro, tmp_path):
    text = Path(MACHINE).read_text().replace("data sheet", "[bold]data[red] sheet")
    (tmp_path / "m.toml").write_text(text)
    assert "no [bold]data[red] sheet" in mopro("machine", "show", "m.toml").stdout


def test_only_one_module_writes_to_the_terminal():
    for path in (ROOT / "mopro" / "cli").rglob("*.py"):
        if path.name != "say.py":
            assert "click.echo" not in path.read_text("utf-8"), path.name
