"""`mopro reconcile` as a process: verdicts, files, exit codes."""

import json
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import tomllib
from fcntl import ioctl
from html.parser import HTMLParser

import jsonschema
import pytest

from helpers.commands import LIMIT_S, run_here, wait_for
from helpers.laboratory import DRAG, laboratory
from helpers.paths import PROGRAMS, ROOT

TABLE_3_2 = PROGRAMS / "thermal" / "experiment.toml"
REPAIR = ["before the repair", "after the repair"]
NUMBER, WORD = {"type": "number"}, {"type": "string"}
LIST = {"type": "array"}
NUMBER_OR_NONE = {"type": ["number", "null"]}


def record(**properties):
    return {"type": "object", "required": list(properties), "properties": properties}


# CONTRACT.md: reconcile --json.
ANSWER = record(
    verdict={"enum": ["named", "ambiguous", "none", "unexplained"]},
    effects={
        "type": "array",
        "items": record(
            name=WORD,
            indistinguishable_from={"type": "array", "items": WORD},
            parameters={
                "type": "object",
                "minProperties": 1,
                "additionalProperties": record(
                    value=NUMBER,
                    unit=WORD,
                    ci95={
                        "type": "array",
                        "items": NUMBER_OR_NONE,
                        "minItems": 2,
                        "maxItems": 2,
                    },
                ),
            },
            evidence=record(log10_bayes_factor=NUMBER, held_out={"type": "boolean"}),
        ),
    },
    where={
        "type": "array",
        "items": record(
            run=WORD,
            line={"type": "integer"},
            phase={"enum": ["accelerate", "cruise", "decelerate", "settle", "dwell", "steady"]},
            axis={"enum": [1, 2, None]},
            rms=NUMBER,
            sigma=NUMBER_OR_NONE,
        ),
    },
    gap=record(
        unit=WORD,
        before_rms=NUMBER,
        after_rms=NUMBER,
        noise_rms=NUMBER_OR_NONE,
        held_out={"type": "boolean"},
    ),
    remainder=record(significant={"type": "boolean"}, description={"type": ["string", "null"]}),
    glance=record(
        verdict=WORD,
        sentence=WORD,
        effects=LIST,
        beside=LIST,
        gap=LIST,
        cannot_tell=LIST,
        next=LIST,
    ),
    next_experiment={"type": ["string", "null"]},
)


def reconciled(folder, *args, experiment="experiment.toml"):
    """The answer of `mopro reconcile --json`, its exit code with it."""
    done = run_here(folder, "reconcile", experiment, "--json", *args)
    assert done.stdout, done.stderr
    answer = json.loads(done.stdout, parse_constant=pytest.fail)
    jsonschema.validate(answer, ANSWER)
    return {**answer, "exit": done.returncode}


class Page(HTMLParser):
    """The data, headings, captions and rows of a page; fails if tags do not match."""

    def __init__(self, text):
        super().__init__()
        self.data, self.headings, self.rows, self.captions = None, [], [], []
        self._open = []
        self.feed(text)
        assert self._open == ["html"] or not self._open

    def handle_starttag(self, tag, attributes):
        assert not {"src", "href", "style"} & dict(attributes).keys(), "a page that needs nothing"
        if tag != "meta":
            self._open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, text):
        at = self._open[-1] if self._open else ""
        if at in ("td", "th"):
            self.rows[-1].append(text)
        elif at in ("h1", "h2", "h3"):
            self.headings.append(text)
        elif at == "caption":
            self.captions.append(text)
        elif at == "script" and self.data is None:
            self.data = json.loads(text)


@pytest.fixture(scope="module")
def drag(tmp_path_factory):
    """Two runs with a drag, reconciled: the folder and the answer."""
    folder = tmp_path_factory.mktemp("drag")
    laboratory(folder, DRAG, ("fast", "slow"))
    return folder, reconciled(folder, "--out", "machine.toml", "--report", "why.html")


class TestCandidatesLeftOut:
    def test_without_the_true_effect_it_is_not_named(self, drag):
        folder, _ = drag
        answer = reconciled(folder, "--without", "viscous_drag", "--without", "trigger_delay")
        assert answer["left_out"] == ["trigger_delay", "viscous_drag"]
        said = {e["name"] for e in answer["effects"]}
        said |= {name for e in answer["effects"] for name in e["indistinguishable_from"]}
        assert not said & {"trigger_delay", "viscous_drag"}

    def test_only_the_asked_effects_are_tried(self, drag):
        folder, _ = drag
        only = ("--only", "viscous_drag", "--only", "hum", "--without", "hum")
        done = run_here(folder, "reconcile", "experiment.toml", "--report", "only.html", *only)
        assert done.returncode == 0, done.stderr
        said = "No effects were tried but viscous_drag."
        assert "Named: viscous_drag." in done.stdout
        assert said in done.stdout
        assert said in (folder / "only.html").read_text()

    def test_effects_that_the_sensor_cannot_show_leave_no_candidate(self, drag):
        folder, _ = drag
        answer = reconciled(folder, "--only", "platen_conduction")
        assert (answer["verdict"], answer["effects"], answer["exit"]) == ("unexplained", [], 1)

    def test_an_unknown_name_gets_a_suggestion(self, drag):
        done = run_here(drag[0], "reconcile", "experiment.toml", "--without", "viscous_drga")
        assert done.returncode == 2
        assert "there is no effect called 'viscous_drga'; did you mean `viscous_drag`?" in (
            done.stderr
        )

    def test_nothing_left_to_try_is_refused(self, drag):
        both = ("--only", "hum", "--without", "hum")
        done = run_here(drag[0], "reconcile", "experiment.toml", *both)
        assert (done.returncode, "leaves no effect to try" in done.stderr) == (2, True)


class TestADrag:
    def test_is_named_with_its_size(self, drag):
        _, answer = drag
        assert (answer["verdict"], answer["exit"]) == ("named", 0)
        (effect,) = answer["effects"]
        assert effect["name"] == "viscous_drag"
        b = effect["parameters"]["b"]
        assert b["unit"] == "N s/m"
        assert b["ci95"][0] < b["value"] < b["ci95"][1]
        assert b["value"] == pytest.approx(9.0, rel=0.03)
        assert effect["evidence"]["held_out"]
        assert answer["next_experiment"] is None

    def test_showed_where_the_motor_is_fast(self, drag):
        _, answer = drag
        worst = answer["where"][0]
        assert (worst["run"], worst["phase"], worst["axis"]) == ("fast.csv", "cruise", 1)
        assert worst["line"] in (4, 7), "the lines of the two moves"
        assert worst["sigma"] > 5

    def test_leaves_no_gap_but_noise_in_fitted_and_held_out_parts(self, drag):
        gap = drag[1]["gap"]
        assert gap["before_rms"] > 3 * gap["noise_rms"]
        for run in gap["runs"]:
            for figure in ("after_rms", "held_out_rms", "rerun_rms"):
                assert run[figure] == pytest.approx(run["noise_rms"], rel=0.1)

    def test_is_in_the_machine_file_which_then_agrees(self, drag):
        folder, _ = drag
        assert run_here(folder, "machine", "check", "machine.toml").returncode == 0
        text = (folder / "machine.toml").read_text()
        assert 'origin = "measured", place = "experiment.toml, 95 %: ' in text
        assert str(folder) not in text
        again = (folder / "experiment.toml").read_text().replace("chow1992", "machine.toml")
        (folder / "again.toml").write_text(again)
        after = run_here(folder, "compare", "again.toml")
        assert (after.returncode, after.stderr) == (0, "")
        assert after.stdout.splitlines()[-1] == "no disagreement"

    def test_is_shown_on_the_page(self, drag):
        folder, answer = drag
        text = (folder / "why.html").read_text()
        page = Page(text)
        assert page.headings[0] == "Named: viscous_drag."
        views = page.data["views"]
        assert [view["name"] for view in views] == ["fast.csv", "slow.csv"]
        for view in views:
            _, residual, signatures = view["panels"]
            assert residual["title"] == "laser: residual"
            assert [trace["label"] for trace in residual["traces"]] == REPAIR
            labels = [trace["label"] for trace in signatures["traces"]]
            assert labels == ["residual before the repair", "viscous_drag"]
            assert "MRI1 2.0" in view["program"]
            assert {mark["line"] for mark in view["marks"]} == {4, 7}
        # The two MRI1 of the program: their lines go all the way to the page.
        assert [row[-1] for row in page.rows if row[1:2] == ["laser"] and len(row) == 8] == (
            ["4, 7", "4, 7"]
        )
        tried = {row[0] for row in page.rows if len(row) == 4}
        others = [*answer["rejected"], *answer["below_resolution"]]
        assert {"viscous_drag", *(other["name"] for other in others)} <= tried
        assert {"payload_mass", "coulomb_friction", "sensor_gain", "hum"} <= tried
        assert len(page.captions) == text.count("<table>")
        assert len(text) < 2**20


def test_a_repaired_machine_is_tried_on_a_run_that_it_has_not_seen(drag, tmp_path):
    folder, _ = drag
    laboratory(tmp_path, DRAG, ("slow",))
    repaired = str(folder / "machine.toml")
    before = run_here(tmp_path, "compare", "experiment.toml", "--json")
    done = run_here(tmp_path, "compare", "experiment.toml", "--apply", repaired, "--json")
    assert (before.returncode, done.returncode) == (1, 0)
    (gap,) = json.loads(done.stdout)["applied"]
    assert gap["before_rms"] > 2 * gap["noise_rms"] > 1.8 * gap["after_rms"]
    (number,) = json.loads(done.stdout)["carried_over"]
    assert (number["effect"], number["carried"]) == ("viscous_drag", "carried over")
    told = run_here(tmp_path, "compare", "experiment.toml", "--apply", repaired)
    assert "before" in told.stdout
    assert "after" in told.stdout


def test_nothing_hidden_is_none_and_exits_with_0(tmp_path):
    laboratory(tmp_path, {})
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--out", "machine.toml")
    assert (done.returncode, done.stderr) == (0, "")
    assert "None: simulation and data agree within the sensors' noise." in done.stdout
    assert "[effects" not in (tmp_path / "machine.toml").read_text()


def test_a_bump_of_no_catalogue_is_unexplained_and_described(tmp_path):
    laboratory(tmp_path, {}, bump=1e-4)
    answer = reconciled(tmp_path, "--report", "why.html")
    assert (answer["verdict"], answer["effects"], answer["exit"]) == ("unexplained", [], 1)
    assert answer["remainder"]["significant"]
    assert "bump" in answer["remainder"]["description"]
    title = Page((tmp_path / "why.html").read_text()).headings[0]
    left = answer["remainder"]
    assert left["beside_drafts"] is None
    told = f"{left['description']}; the term below leaves no more than noise."
    assert title == f"Unexplained: what is left looks like {told}"


def test_what_a_coarse_sensor_cannot_tell_is_a_family_with_a_program_to_run(tmp_path):
    laboratory(tmp_path, DRAG, noise=2e-4)
    answer = reconciled(tmp_path, "--report", "why.html")
    (effect,) = answer["effects"]
    assert (answer["verdict"], answer["exit"]) == ("ambiguous", 0)
    assert "viscous_drag" in {effect["name"], *effect["indistinguishable_from"]}
    (tmp_path / "NEXT.CMD").write_text(answer["next_experiment"])
    run = run_here(tmp_path, "run", "NEXT.CMD", "--emulate", "--out", "next.csv")
    assert (run.returncode, run.stderr) == (0, "")
    assert "The next experiment" in Page((tmp_path / "why.html").read_text()).headings


def test_a_step_in_one_run_is_no_property_of_the_machine_whatever_names_are_like(tmp_path):
    laboratory(tmp_path, {"fast": {"lost_steps": {"n": 3, "move": 1, "at": 0.5}}, "slow": {}},
               ("fast", "slow"))  # fmt: skip
    odd = 'a "<b>".csv'
    (tmp_path / "fast.csv").rename(tmp_path / odd)
    file = tmp_path / "experiment.toml"
    file.write_text(file.read_text().replace('"fast.csv"', f"'{odd}'"))
    answer = reconciled(tmp_path, "--out", "machine.toml", "--report", "why.html")
    (effect,) = answer["effects"]
    assert effect["name"] == "lost_steps"
    assert effect["parameters"]["n"]["value"] == 3
    assert answer["reservations"] == [
        f"lost_steps is not in the machine file: it happened in {odd} alone."
    ]
    assert "[effects" not in (tmp_path / "machine.toml").read_text()
    page = Page((tmp_path / "why.html").read_text())
    assert [view["name"] for view in page.data["views"]] == [odd, "slow.csv"]


def test_an_effect_that_the_machine_has_is_replaced_wherever_it_stands(tmp_path):
    """Also from an experiment whose name would end a text in TOML."""
    shown = (ROOT / "mopro/machine/machines/chow1992.toml").read_text()
    own = "\n[effects]\nviscous_drag = { b = 4.0 }\nsensor_gain = { g = 0.0 }\n"
    (tmp_path / "own.toml").write_text(shown + own)
    name = 'my "own".toml'
    laboratory(tmp_path, DRAG, machine="own.toml").rename(tmp_path / name)
    answer = reconciled(tmp_path, "--out", "machine.toml", experiment=name)
    assert [effect["name"] for effect in answer["effects"]] == ["viscous_drag"]
    assert answer["effects"][0]["parameters"]["b"]["value"] == pytest.approx(9.0, rel=0.05)
    assert run_here(tmp_path, "machine", "check", "machine.toml").returncode == 0
    text = (tmp_path / "machine.toml").read_text()
    assert text.count("viscous_drag") == 1
    assert text.count("sensor_gain") == 1


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """The source's own table, reconciled: the folder and the answer."""
    folder = tmp_path_factory.mktemp("source")
    files = ("--out", "machine.toml", "--report", "why.html")
    return folder, reconciled(folder, *files, experiment=TABLE_3_2)


class TestTheSourcesTable:
    def test_what_its_author_suspected_is_named(self, source):
        folder, answer = source
        assert (answer["verdict"], answer["exit"]) == ("named", 0)
        effects = {effect["name"]: effect for effect in answer["effects"]}
        assert set(effects) == {"platen_conduction", "speed_dependent_heat"}
        assert sum(len(effect["parameters"]) for effect in effects.values()) <= 3
        gap = answer["gap"]
        assert gap["before_rms"] == pytest.approx(30.5, abs=0.1)
        assert gap["after_rms"] <= 1.6
        assert gap["held_out_rms"] <= 2.7
        page = Page((folder / "why.html").read_text())
        (view,) = page.data["views"]
        assert view["rows"]
        labels = [[trace["label"] for trace in panel["traces"]] for panel in view["panels"][1:]]
        effects = ("platen_conduction", "speed_dependent_heat")
        assert labels == [REPAIR, ["residual before the repair", *effects]]

    def test_prints_what_the_docs_show(self):
        docs = (ROOT / "docs" / "reconcile.md").read_text()
        printed = run_here(ROOT, "reconcile", TABLE_3_2.relative_to(ROOT)).stdout
        assert words_of(printed) == words_of(docs.split("```text\n")[1].split("```")[0])

    def test_writes_the_machine_file_that_the_docs_show(self, source):
        docs = (ROOT / "docs" / "reconcile.md").read_text()
        shown = tomllib.loads(docs.split("```toml\n")[1].split("```")[0])
        name, numbers = shown["effects"].popitem()
        written = tomllib.loads((source[0] / "machine.toml").read_text())["effects"][name]
        assert written.keys() == numbers.keys()
        for key, number in numbers.items():
            value = pytest.approx(number["value"], rel=1e-4)
            assert written[key] == {**number, "value": value}

    def test_the_table_loses_no_figure_in_a_narrow_terminal(self):
        narrow = shown_in(80)
        assert "…" not in narrow
        for words in ("speed_dependent_heat", "0.1423", "3.507", "4.566", "1.46 K", "30.5 K"):
            assert words in narrow
        glance = narrow[narrow.index("Named: ") :].splitlines()
        assert len(glance) > 6, "lines go on below themselves"
        assert max(map(len, glance)) <= 80


def words_of(text):
    return [line.split() for line in text.splitlines() if line.strip()]


def shown_in(columns):
    """The output in a terminal of so many columns."""
    child, terminal = pty.fork()
    if child == 0:
        arguments = [sys.executable, "-m", "mopro", "reconcile", str(TABLE_3_2)]
        while struct.unpack("HHHH", ioctl(0, termios.TIOCGWINSZ, bytes(8)))[1] != columns:
            pass
        os.execve(sys.executable, arguments, {**os.environ, "NO_COLOR": "1"})
    ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    seen = b""
    try:
        while chunk := os.read(terminal, 4096):
            seen += chunk
    except OSError:
        pass  # the other end is closed
    os.waitpid(child, 0)
    os.close(terminal)
    return seen.decode()


class TestRefused:
    def refused(self, folder, *args):
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        done = run_here(folder, "reconcile", *args)
        assert (done.returncode, done.stdout) == (2, "")
        assert "Traceback" not in done.stderr
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
        return done.stderr

    def test_an_experiment_that_is_not_there(self, tmp_path):
        message = self.refused(tmp_path, "none.toml")
        assert "none.toml:1:1: cannot be read: No such file or directory [unreadable]" in message

    def test_data_that_are_not_there(self, tmp_path):
        laboratory(tmp_path, {})
        (tmp_path / "fast.csv").unlink()
        message = self.refused(tmp_path, "experiment.toml")
        assert "experiment.toml:13:1: there is no file" in message

    @pytest.mark.parametrize("option", ["--out=no/m.toml", "--report=no/r.html"])
    def test_a_place_that_takes_no_files(self, tmp_path, option):
        laboratory(tmp_path, {})
        message = self.refused(tmp_path, "experiment.toml", option)
        assert "cannot be written: No such file or directory [unwritable-output]" in message

    def test_the_experiment_as_the_place_of_the_machine(self, tmp_path):
        laboratory(tmp_path, {})
        message = self.refused(tmp_path, "experiment.toml", "--out", "experiment.toml")
        assert "--out would overwrite experiment.toml, which EXPERIMENT reads" in message


def test_a_signal_leaves_no_half_written_file(tmp_path):
    """The work announces itself by its draft files; then the signal comes."""
    laboratory(tmp_path, DRAG, ("fast", "slow"))
    (tmp_path / "machine.toml").write_text("the one before")
    before = sorted(path.name for path in tmp_path.iterdir())
    command = [sys.executable, "-m", "mopro", "reconcile", "experiment.toml",
               "--out", "machine.toml", "--report", "why.html"]  # fmt: skip
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        wait_for(lambda: list(tmp_path.glob(".why.html.*")), process)
        process.send_signal(signal.SIGTERM)
        output, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130
    assert (output, errors.strip()) == ("", "mopro: interrupted")
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert (tmp_path / "machine.toml").read_text() == "the one before"
