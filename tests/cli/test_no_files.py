"""Pipes, folders, sockets and devices where a file is expected: told at once, never waited for."""

import os
import signal
import socket

import pytest

# What stands for 'the command waits for ever'; nothing here takes a tenth of it.
PATIENCE_S = 60


def fifo(path):
    os.mkfifo(path)


def link_to_fifo(path):
    os.mkfifo(path.with_name("a pipe"))
    path.symlink_to("a pipe")


def folder(path):
    path.mkdir()


def bound_socket(path):
    here = os.open(".", os.O_RDONLY)
    os.chdir(path.parent)  # a socket's path may have a hundred characters
    try:
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(path.name)
    finally:
        os.fchdir(here)
        os.close(here)


def endless_device(path):
    path.symlink_to("/dev/zero")


def dangling(path):
    path.symlink_to("nowhere")


def circle(path):
    path.symlink_to(path.name)


KINDS = {
    fifo: "is a pipe", link_to_fifo: "is a pipe", folder: "is a folder",
    endless_device: "is a device", bound_socket: "is a socket",
    dangling: "no file", circle: "no file",
}  # fmt: skip

PROGRAM = 'data = "d.csv"\nprogram = "P.CMD"'
MOTOR = """
machine = "{machine}"
[[sensor]]
name = "s"
quantity = "position"
axis = 1
column = "y"
rate_hz = 1.0
noise_rms = 0.1
[[run]]
{run}
"""
RIG = """
machine = "{machine}"
[[sensor]]
name = "y"
quantity = "position"
column = "y_mm"
unit = "mm"
noise_rms = 0.1
[[run]]
{run}
"""

# Files that name another one, `x`, by each key that does.
NAMED = {
    "machine": MOTOR.format(machine="x", run=PROGRAM),
    "program": MOTOR.format(machine="chow1992", run='program = "x"\ndata = "d.csv"'),
    "data": MOTOR.format(machine="chow1992", run='program = "P.CMD"\ndata = "x"'),
    "table": MOTOR.format(machine="chow1992", run='table = "x"'),
    "data of a rig": RIG.format(machine="kinematic", run='data = "x"'),
}


@pytest.fixture
def ground(tmp_path):
    (tmp_path / "P.CMD").write_text("WT1\n")
    (tmp_path / "d.csv").write_text("time_s,y\n0,0\n1,0\n")
    return tmp_path


@pytest.fixture(autouse=True)
def impatient():
    """Whoever waits is interrupted, and the test fails."""

    def give_up(*_):
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(PATIENCE_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
@pytest.mark.parametrize("key", NAMED)
def test_a_file_names_a_regular_file(mopro, ground, make, key):
    make(ground / "x")
    (ground / "e.toml").write_text(NAMED[key])
    done = mopro("compare", "e.toml")
    assert done.returncode == 2
    assert KINDS[make] in done.stderr
    assert "e.toml:" in done.stderr
    assert "[no-such-file]" in done.stderr


# Commands to which `x` is named, and whether they read it from its beginning to its end.
COMMANDS = {
    "noise x": False, "noise x.h5": False, "noise x.parquet": False, "noise x.npz": False,
    "noise x.mcap": False, "noise x.csv": False, "import x --as out": False,
    "import x.h5 --as out": False,
    "compile x": True, "lint x": True, "fmt --check x": True, "run x --emulate": True,
    "run P.CMD --emulate --machine x": True, "compare x": True, "reconcile x": True,
    "machine check x": True, "machine show x": True, "lint P.CMD --machine x": True,
    "limits --machine x": True, "sweep x --vary VEL1=1": True,
    "sweep P.CMD --vary VEL1=1 --machine x": True, "measure P.CMD --out o.csv --instrument x": True,
    "measure P.CMD --out o.csv --machine x": True, "serve --faults x": True,
    "serve --dialect x": True, "serve --machine x": True,
    "link-test --port loop:// --dialect x": True,
    "flash P.CMD --port loop:// --dialect x": True,
    "blind make --seed 1 --grid smoke --cases 008 --out o --machine x": True,
    "blind make --seed 1 --grid smoke --cases 008 --out o --effects x": True,
    "compare e.toml --apply x": True,
}  # fmt: skip


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_tells_what_is_no_file(mopro, ground, make, words):
    (ground / "e.toml").write_text(MOTOR.format(machine="chow1992", run=PROGRAM))
    (name,) = (word for word in words.split() if word.partition(".")[0] == "x")
    make(ground / name)
    done = mopro(*words.split())
    assert done.returncode == 2, done.stdout
    assert name in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("words", ["compile {}", "run P.CMD --emulate --machine {}"])
def test_a_command_reads_what_comes_out_of_a_pipe(mopro, ground, words):
    """As the shell's `<(...)` names it."""
    mopro("machine", "new", "m.toml", "--from", "chow1992")
    file = ground / ("m.toml" if "--machine" in words else "P.CMD")
    taking, giving = os.pipe()
    try:
        os.write(giving, file.read_bytes())
        os.close(giving)
        done = mopro(*words.format(f"/dev/fd/{taking}").split())
    finally:
        os.close(taking)
    assert done.returncode == 0, done.stderr
