"""Output as a person at a terminal sees it: colours, width, progress, completion, hints."""

import io
import json
import os
import pty
import re
import select
import subprocess
import sys
import termios
import threading
from types import SimpleNamespace

import pytest

from helpers.bench_of_link import SHORT, bench
from helpers.commands import LIMIT_S
from helpers.paths import PROGRAMS
from mopro.cli import progress, say
from mopro.cli.lint import command as lint_command
from mopro.cli.say import print_markdown, print_table
from mopro.emulator import Emulator
from mopro.link import SerialBackend
from mopro.machine import load_machine
from mopro.program.compile import compile as compile_text
from mopro.recording import MemorySink, read

LVDT3, TEMP1 = PROGRAMS / "LVDT3.CMD", PROGRAMS / "TEMP1.CMD"
SETUP = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
STYLE = re.compile(r"\x1b\[[0-9;]*m")


class Terminal(io.StringIO):
    def isatty(self):
        return True

    @property
    def shown(self):
        """The texts of the line of progress, one by one."""
        return [text for text in self.getvalue().split("\r\x1b[K") if text]


@pytest.fixture
def terminal(monkeypatch):
    """Standard error as a terminal of 100 columns."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("NO_COLOR", raising=False)
    made = Terminal()
    for module in (say, progress):
        monkeypatch.setattr(module, "sys", SimpleNamespace(stderr=made, stdout=sys.stdout))
    return made


def at_a_terminal(folder, *args, **settings):
    """Standard output and error of `mopro ARGS` on a pseudo-terminal of 80 columns."""
    env = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "COLUMNS", "FORCE_COLOR")}
    env |= {"TERM": "xterm", "COLUMNS": "80"} | settings
    master, slave = pty.openpty()
    seen = []

    def follow():
        while True:
            try:
                data = os.read(master, 4096)
            except OSError:
                return
            if not data:
                return
            seen.append(data)

    reader = threading.Thread(target=follow)
    reader.start()
    done = subprocess.run(
        [sys.executable, "-m", "mopro", *map(str, args)], cwd=folder, env=env, stdin=slave,
        stdout=slave, stderr=slave, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    os.close(slave)
    reader.join(LIMIT_S)
    os.close(master)
    return done.returncode, b"".join(seen).decode()


# -- colour and width ----------------------------------------------------------------


def test_findings_are_coloured_on_a_terminal_unless_no_color_is_set(tmp_path):
    code, shown = at_a_terminal(tmp_path, "lint", TEMP1)
    plain_code, plain = at_a_terminal(tmp_path, "lint", TEMP1, NO_COLOR="1")
    assert code == plain_code == 1
    assert STYLE.search(shown)
    assert "\x1b" not in plain
    assert STYLE.sub("", shown) == plain
    assert "warning: the letter O" in plain
    assert plain.rstrip().endswith("2 warnings in 1 file")


def test_a_clean_file_is_told_on_a_terminal(tmp_path):
    (tmp_path / "P.CMD").write_text("WT100\n")
    assert at_a_terminal(tmp_path, "lint", "P.CMD") == (0, "no findings in 1 file\r\n")


def test_the_table_of_moves_fits_80_columns_and_folds_loops(tmp_path):
    (tmp_path / "P.CMD").write_text(
        TEMP1.read_text("ascii")
        .replace("VELO 15.0", "VEL0 35.0")
        .replace("ACCO 0.2", "ACC0 0.0234")
    )
    args = ("run", "P.CMD", "--emulate", "--for", "40s", "--rate", "20")
    shown = at_a_terminal(tmp_path, *args, NO_COLOR="1")[1]
    lines = shown.rpartition("\x1b[K")[2].split("\r\n")
    first = next(i for i, line in enumerate(lines) if "distance" in line)
    table = lines[first : lines.index("", first)]
    assert len(table) == 3 + 3
    assert max(map(len, table)) <= 80
    assert table[3].split()[:3] == ["16", "×", "12"]


def test_text_of_others_stays_visible_in_colour(monkeypatch, capsys):
    monkeypatch.setattr(say, "has_colours", lambda stream: True)
    say.say_findings("a\x1b[2J.CMD:1:2: warning: \x1b]0;x [rule-name]\n  line\n  ^~~")
    shown = STYLE.sub("", capsys.readouterr().out)
    assert shown == "a\\x1b[2J.CMD:1:2: warning: \\x1b]0;x [rule-name]\n  line\n  ^~~\n"


def test_a_table_takes_narrow_gaps_before_it_folds(capsys):
    cells = ["a" * 20] * 3
    for width, gap in ((80, 3), (64, 1)):
        print_table(["x", "y", "z"], [cells], 9, width=width)
        assert (" " * gap).join(cells) in capsys.readouterr().out


def test_markdown_is_laid_out_on_a_terminal_only(monkeypatch, capsys):
    text = "# Score\n\n| a | b |\n|---|---|\n| 1 | 2 |\n"
    print_markdown(text)
    assert capsys.readouterr().out == text
    monkeypatch.setattr("mopro.cli.say.is_terminal", lambda stream: True)
    print_markdown(text)
    assert "|---|" not in capsys.readouterr().out


# -- progress ------------------------------------------------------------------------


def test_progress_has_speed_and_time_left(terminal, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.counted("lint", 40, "files") as tell:
        for number in range(1, 11):
            now[0] += 0.2
            tell(number)
    assert terminal.shown[-1] == "lint [#####---------------] 10 of 40 files, 5 files/s, 6 s left"
    assert len(terminal.shown) == 8
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_work_that_is_soon_done_shows_nothing(terminal):
    assert progress.each_counted([1, 2], 2, "making", "cases") == [1, 2]
    assert terminal.getvalue() == ""


def test_progress_is_for_terminals_only(monkeypatch, capsys):
    monkeypatch.setattr(progress, "_AFTER_S", 0.0)
    progress.each_counted(range(9), 9, "making", "cases")
    assert capsys.readouterr().err == ""


def test_a_message_takes_the_line_of_progress_away(terminal, capsys):
    say.say_status("at work")
    say.say("a message")
    assert terminal.getvalue() == "\r\x1b[Kat work\r\x1b[K"
    assert capsys.readouterr().out == "a message\n"


def test_a_line_of_progress_stays_in_one_line(terminal):
    say.say_status("x" * 300 + "\n\x1b[2J")
    assert terminal.shown == ["x" * 99]


def test_a_terminal_that_is_held_does_not_hold_up_the_run(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    master, slave = pty.openpty()
    termios.tcflow(slave, termios.TCOOFF)
    with open(slave, "w", encoding="utf-8") as held:
        monkeypatch.setattr(say, "sys", SimpleNamespace(stderr=held, stdout=sys.stdout))
        say.say_status("at work")
        assert select.select([master], [], [], 0) == ([], [], [])
        termios.tcflow(slave, termios.TCOON)
        say.say_status("at work")
        assert os.read(master, 99) == b"\r\x1b[Kat work"
        say.end_status()
    os.close(master)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (59, "59 s"), (185, "3:05 min"), (7800, "2:10 h")]
)
def test_durations(seconds, text):
    assert progress.duration(seconds) == text


def test_a_run_on_a_controller_shows_where_it_is(terminal):
    program, machine = compile_text(SHORT), load_machine("chow1992")
    joined = bench()
    with progress.in_motion(progress.length_unit(program, machine)) as told:
        SerialBackend(joined.session, machine).run(
            program, MemorySink(), settle_s=0.3, on_progress=told
        )
    form = (
        r"\d\.\d of 0\.\d s, line [47], axis 1 -?\d\.\d{3}, axis 2 0\.000 in, "
        r"\d+\.\d in/s, (\d s left|settling)"
    )
    assert len(terminal.shown) >= 3
    assert not [text for text in terminal.shown if not re.fullmatch(form, text)]
    assert terminal.shown[-1].endswith("settling")
    speeds = [float(re.search(r"([\d.]+) in/s", text)[1]) for text in terminal.shown]
    assert 2 < max(speeds) < 9


def test_a_simulation_shows_how_far_it_is(terminal, monkeypatch):
    monkeypatch.setattr(progress, "_AFTER_S", 0.0)
    monkeypatch.setattr(progress, "_EVERY_S", 0.0)
    with progress.simulated() as told:
        Emulator(load_machine("chow1992")).run(
            compile_text(SETUP + "WT50000\n"), MemorySink(), on_progress=told
        )
    assert re.fullmatch(
        r"simulating \[#+-*\] [\d.]+ of 50 s, [\d.e+]+ s/s, \d+ s left", terminal.shown[0]
    )


# -- lint ----------------------------------------------------------------------------


def test_lint_shows_how_far_it_is_in_a_program(terminal, monkeypatch, tmp_path):
    monkeypatch.setattr(progress, "_AFTER_S", 0.0)
    monkeypatch.setattr(progress, "_EVERY_S", 0.0)
    file = tmp_path / "P.CMD"
    file.write_text(SETUP + "MRI1 15.0\nWX1\n")
    lint_command.main([str(file)], standalone_mode=False)
    done = [int(re.search(r"(\d+) of 20 steps", text)[1]) for text in terminal.shown]
    assert done == sorted(done)
    assert (done[0], done[-1]) == (0, 20)
    assert len(set(done)) > 10


NOTED = SETUP + "MRI1 6.0\nWX1\n"


def test_notes_alone_are_no_failure_unless_strict(mopro):
    done = mopro("lint", "P.CMD", text=NOTED)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "1 note in 1 file")
    assert mopro("lint", "--strict", "P.CMD", text=NOTED).returncode == 1
    assert mopro("lint", "--strict", "P.CMD", text="WT10\n").returncode == 0


def test_the_closing_line_counts_by_severity(mopro, tmp_path):
    (tmp_path / "Q.CMD").write_text("VELO 15.0\nFOO\n")
    done = mopro("lint", "P.CMD", "Q.CMD", text=NOTED)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "1 error, 1 warning, 1 note in 2 files"
    for form in ("json", "github", "sarif"):
        assert "in 2 files" not in mopro("lint", "--format", form, "P.CMD", "Q.CMD").stdout


# -- commands and completion ---------------------------------------------------------


def test_a_mistyped_command_gets_a_suggestion(mopro):
    done = mopro("rnu")
    assert done.returncode == 2
    assert "No such command 'rnu'. Did you mean 'run'?" in done.stderr
    assert "Did you mean 'show'?" in mopro("machine", "shwo").stderr


def completed(mopro, monkeypatch, words):
    """The words that bash would offer at the end of `words`."""
    monkeypatch.setenv("_MOPRO_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - (not words.endswith(" "))))
    return {line.partition(",")[2] for line in mopro().stdout.splitlines() if "plain" in line}


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("mopro comp", {"compare", "compile", "completion"}),
        ("mopro run --machine ch", {"chow1992"}),
        ("mopro machine show ", {"chow1992"}),
        ("mopro lint --explain low", {"low-margin"}),
        ("mopro lint --select stall,low", {"stall,low-margin"}),
        ("mopro reconcile --only viscous", {"viscous_drag"}),
        ("mopro serve --dialect pl", {"plain"}),
        ("mopro measure --instrument la", {"laser"}),
        ("mopro run --set", {"--settle"}),
    ],
)
def test_names_are_completed(mopro, monkeypatch, words, offered):
    assert completed(mopro, monkeypatch, words) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_and_installed(mopro, monkeypatch, tmp_path, shell):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    script = mopro("completion", shell).stdout
    assert f"_MOPRO_COMPLETE={shell}_complete" in script
    done = mopro("completion", shell, "--install")
    (place,) = [p for p in tmp_path.rglob("*mopro*") if p.is_file()]
    assert done.stdout.startswith(f"Completion: {place}\n")
    assert place.read_text() == script
    assert mopro("completion", shell, "--install").returncode == 0
    place.write_text("mine")
    refused = mopro("completion", shell, "--install")
    assert refused.returncode == 2
    assert "was not written by mopro completion" in refused.stderr
    assert place.read_text() == "mine"
    assert mopro("completion", shell, "--install", "--force").returncode == 0


def test_a_folder_for_the_completion_that_cannot_be_made_is_told(mopro, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "file"))
    done = mopro("completion", "zsh", "--install")
    assert done.returncode == 2
    folder = tmp_path / "file" / "zsh" / "site-functions"
    assert done.stderr.startswith(f"{folder}: cannot be made: ")
    assert "[unwritable-output]" in done.stderr


# -- recordings ----------------------------------------------------------------------

RUN = ("run", "P.CMD", "--emulate", "--settle", "0")


@pytest.mark.parametrize("name", ["r.parquet", "r.csv", "r.npz"])
def test_a_file_that_is_no_recording_is_not_overwritten(mopro, tmp_path, name):
    (tmp_path / name).write_bytes(b"time_s,position_1_in\n0,0\n")
    refused = mopro(*RUN, "--out", name, text=NOTED)
    assert refused.returncode == 2
    assert f"{name} is there and is no recording of mopro" in refused.stderr
    assert (tmp_path / name).read_bytes() == b"time_s,position_1_in\n0,0\n"
    done = mopro(*RUN, "--out", name, "--force")
    assert done.stdout.endswith(f"Recording: {name}\n")
    again = mopro(*RUN, "--out", name)
    assert again.stdout.endswith(f"Recording: {name} (replaced the one before)\n")
    assert json.loads(mopro(*RUN, "--out", name, "--json").stdout)["replaced"] is True
    assert len(read(tmp_path / name)) > 100


def test_an_empty_file_is_nothing_to_lose(mopro, tmp_path):
    (tmp_path / "r.csv").touch()
    done = mopro(*RUN, "--out", "r.csv", text=NOTED)
    assert (done.returncode, done.stdout.endswith("Recording: r.csv\n")) == (0, True)


def test_nothing_is_sent_to_a_controller_before_the_recording_has_its_place(mopro, tmp_path):
    (tmp_path / "r.csv").write_text("mine")
    done = mopro("run", "P.CMD", "--port", "socket://127.0.0.1:9", "--out", "r.csv", text=NOTED)
    assert "no recording of mopro" in done.stderr
    assert "[no-port]" not in done.stderr


def test_a_program_from_standard_input_and_a_recording_to_standard_output(mopro, tmp_path):
    mopro(*RUN, "--out", "r.csv", text=NOTED)
    done = mopro("run", "-", "--emulate", "--settle", "0", "--out", "-", stdin=NOTED.encode())
    assert done.returncode == 0
    assert done.stderr == "<stdin> on chow1992: 1 move in 0.309839 s.\n"
    header, *rows = done.stdout.splitlines()
    assert rows == (tmp_path / "r.csv").read_text().splitlines()[1:]
    assert json.loads(header.removeprefix("# mopro "))["program"] == "<stdin>"
    refused = mopro(*RUN, "--out", "-", "--json")
    assert "would both write to standard output" in refused.stderr


def test_settling_is_recorded_unless_it_is_not_wanted(mopro, tmp_path):
    durations = []
    for option in (["--settle", "0"], [], ["--settle", "1s"]):
        answer = mopro("run", "P.CMD", "--emulate", "--json", *option, text=NOTED).stdout
        durations.append(json.loads(answer)["duration_s"])
        last_s = read(tmp_path / "run.parquet")["time_s"][-1]
        settled_s = {"0": 0.0, "1s": 1.0}.get(option[-1] if option else "", 0.5)
        assert last_s == pytest.approx(durations[-1] + settled_s, abs=6e-4)
    assert len(set(durations)) == 1


def test_a_recording_with_its_settling_is_data_for_compare(mopro, tmp_path):
    mopro("run", "P.CMD", "--emulate", text=NOTED)
    (tmp_path / "e.toml").write_text(
        'machine = "chow1992"\n[[sensor]]\nname = "laser"\nquantity = "position"\n'
        'column = "position_1_m"\nrate_hz = 2000.0\nnoise_rms = 1e-7\n'
        '[[run]]\nprogram = "P.CMD"\ndata = "run.parquet"\n'
    )
    done = mopro("compare", "e.toml")
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "no disagreement")


def test_a_table_of_steady_states_needs_no_rate(mopro, tmp_path):
    text = (PROGRAMS / "thermal" / "experiment.toml").read_text()
    assert "rate_hz" not in text
    assert mopro("compare", PROGRAMS / "thermal" / "experiment.toml").returncode == 1
    (tmp_path / "P.CMD").write_text(NOTED)
    (tmp_path / "d.csv").write_text("time_s,temperature_C\n0,20\n1,20\n")
    (tmp_path / "e.toml").write_text(
        text.replace('table = "table-3-2.csv"', 'program = "P.CMD"\ndata = "d.csv"')
    )
    assert "the sensor has no rate_hz" in mopro("compare", "e.toml").stderr


def test_a_stall_is_in_json_and_in_the_recording(mopro, tmp_path):
    text = "UU012500/1\nVEL1 40.0\nACC1 25.0\nMRI1 5.0\nWX1\n"
    answer = json.loads(mopro("run", "P.CMD", "--emulate", "--json", text=text).stdout)
    (stall,) = answer["stalls"]
    assert (stall["line"], stall["axis"]) == (4, 1)
    assert 0 < stall["time_s"] < answer["duration_s"]
    assert read(tmp_path / "run.parquet").header.stalls == [stall]


# -- units and hints -----------------------------------------------------------------


def test_the_unit_of_a_bare_number_is_told(mopro):
    done = mopro(*RUN, "--payload", "2", "--for", "10", text=NOTED)
    assert done.stderr.splitlines() == ["--payload 2: taken as 2 kg", "--for 10: taken as 10 s"]
    assert mopro(*RUN, "--settle", "2").stderr == "--settle 2: taken as 2 s\n"
    stated = ("--payload", "2kg", "--for", "10s", "--payload", "0", "--rate", "100")
    assert mopro(*RUN, *stated).stderr == ""


def test_who_states_a_time_is_not_told_to_state_one(mopro):
    done = mopro("run", TEMP1, "--emulate", "--for", "1min", "--rate", "20")
    assert "stopped after 60 s, as --for says" in done.stderr
    assert "change that" not in done.stderr


def test_an_acceleration_per_second_is_recognised(mopro):
    text = "UU012500/1\nVEL1 40\nACC1 250\nMRI1 5\nWX1\n"
    hint = "ACC is in in/s per millisecond: for 250 in/s² write `ACC1 0.25`"
    assert hint in mopro("run", "P.CMD", "--emulate", text=text).stderr
    assert hint in mopro("lint", "P.CMD").stdout
    heavy = ("run", "P.CMD", "--emulate", "--payload", "50kg")
    stalling = mopro(*heavy, text=text.replace("ACC1 250", "ACC1 0.5")).stderr
    assert "[stall]" in stalling
    assert "per millisecond" not in stalling
