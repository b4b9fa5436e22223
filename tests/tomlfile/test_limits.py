"""Files that are too large in any way are refused with a message, and the cost is linear."""

import time
from pathlib import Path

import pytest

from mopro.controller import load_scenario
from mopro.errors import ModelError
from mopro.experiment import load_experiment
from mopro.link import load_dialect
from mopro.lint.config import read_settings
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.source import Source
from mopro.tomlfile import MOST_BYTES

READERS = [load_machine, load_dialect, load_scenario, load_experiment, read_settings]
ABSURD = {
    "dotted": ".".join("a" * 20_000) + " = 1\n",
    "nested": "a = " + "[" * 20_000 + "]" * 20_000,
    "tables": "a = " + "{ a = " * 20_000 + "1" + "}" * 20_000,
    "digits": "a = " + "9" * 5000,
    "large": "#" * (MOST_BYTES + 1),
}


def refused(read, path):
    with pytest.raises(ModelError) as caught:
        read(path)
    (found,) = caught.value.diagnostics
    return found


@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
@pytest.mark.parametrize("text", ABSURD.values(), ids=ABSURD)
def test_every_reader_refuses_what_is_absurd(tmp_path, read, text):
    path = tmp_path / "mopro.toml"
    path.write_text(text)
    found = refused(read, path if read is read_settings else str(path))
    assert found.rule == ("bad-settings" if read is read_settings else "too-large")


@pytest.mark.parametrize("name", ["zero", *ABSURD])
def test_the_command_ends_with_2_and_a_message(mopro, tmp_path, name):
    path = Path("/dev/zero") if name == "zero" else tmp_path / "m.toml"
    if name != "zero":
        path.write_text(ABSURD[name])
    done = mopro("machine", "check", path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "[too-large]" in done.stderr
    assert "Traceback" not in done.stderr


def seconds(count):
    text = "".join(f"pich_{n} = 1\n" for n in range(count))
    begin = time.process_time()
    with pytest.raises(ModelError) as caught:
        read_machine(Source("m.toml", text))
    taken = time.process_time() - begin
    unknown = [d for d in caught.value.diagnostics if d.rule == "unknown-key"]
    assert [d.span.line for d in unknown] == list(range(1, count + 1))
    return taken


def test_unknown_keys_cost_linearly():
    """Four times the keys take four times as long, not sixteen times."""
    few = min(seconds(5000) for _ in range(3))
    many = min(seconds(20_000) for _ in range(2))
    assert many < 2.0
    assert many / few < 10


def test_a_name_that_no_file_can_have_is_refused(tmp_path):
    assert refused(load_machine, "a\0b").rule == "unknown-machine"
    path = tmp_path / "e.toml"
    for name in ("x" * 5000, "a\\u0000b"):
        path.write_text(f'machine = "{name}"\n[[sensor]]\n[[run]]\n')
        with pytest.raises(ModelError) as caught:
            load_experiment(path)
        assert "no-such-file" in {d.rule for d in caught.value.diagnostics}
        assert "\0" not in str(caught.value)
