"""The virtual controller by itself: storage, states, scenarios, the line's rate."""

import os
from pathlib import Path

import pytest

import mopro
from helpers.bench_of_link import OLD, SHORT, bench
from mopro.controller import (
    FolderStore,
    LoopbackPort,
    MemoryStore,
    Scenario,
    Station,
    load_scenario,
)
from mopro.controller.device import Refusal
from mopro.controller.faults import KINDS, Fault, FaultInjector
from mopro.controller.running import Motion
from mopro.emulator import Emulator
from mopro.errors import ModelError
from mopro.link import load_dialect
from mopro.machine import load_machine

MACHINE = load_machine("chow1992")


def station(dialect="plain", scenario=None, baud=None, store=None):
    return Station(load_dialect(dialect), Emulator(MACHINE), store, scenario, baud)


def test_a_person_at_a_terminal_sees_echo_prompt_and_refusals():
    port = LoopbackPort(station())
    port.write(b"DL A\rVEL1 1.0\rVLE1\rEP\rLS A\rNONSENSE\r")
    said = b""
    while data := port.read(port.now_s() + 1.0):
        said += data
    assert b"DL A\r\n> VEL1 1.0\r\n> VLE1\r\n? 5 " in said
    assert said.endswith(
        b"LS A\r\nVEL1 1.0\r\n> NONSENSE\r\n? 1 not a statement of this controller\r\n> "
    )


@pytest.mark.parametrize("baud", [300, 9600, 115200])
def test_bytes_take_their_time_on_the_line(baud):
    port = LoopbackPort(station(baud=baud))
    port.write(b"\r" * 50)
    heard = 0
    while data := port.read(port.now_s() + 1.0):
        heard += len(data)
        last_s = port.now_s()
    # Each line end comes back as CR, LF and the prompt, after the first has gone there.
    assert heard == 50 * 4
    assert last_s == pytest.approx((1 + heard) * 10 / baud, rel=1e-6)


def test_programs_outlive_the_process_and_are_whole_files(tmp_path):
    first = bench(store=FolderStore(tmp_path))
    for name in ("ONE", "TWO"):
        first.session.ask("begin", name=name)
        first.session.stream(SHORT.splitlines(), lambda n: None)
        first.session.ask("end")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ONE.CMD", "TWO.CMD"]
    assert (tmp_path / "ONE.CMD").read_text() == SHORT
    assert FolderStore(tmp_path).read("TWO") == SHORT.splitlines()


def test_a_download_that_is_not_ended_changes_nothing():
    store = MemoryStore()
    store.write("MAIN", OLD.splitlines())
    joined = bench("plain", store=store)
    joined.session.ask("begin", name="MAIN")
    joined.session.stream(SHORT.splitlines()[:3], lambda n: None)
    joined.session.recover()
    assert store.read("MAIN") == OLD.splitlines()
    assert joined.session.ask("list", name="MAIN") == [{"text": line} for line in OLD.splitlines()]


def test_a_program_without_sense_is_refused_at_its_end():
    device = station().device
    device.do("begin", {"name": "X"}, 0.0)
    device.take("JUMP NOWHERE")
    with pytest.raises(Refusal, match="statement 1: no line defines the label NOWHERE"):
        device.do("end", {}, 0.0)
    assert device.do("list", {"name": "X"}, 0.0) == []


@pytest.mark.parametrize("statement", ["begin", "commit", "run"])
def test_a_running_program_is_not_disturbed(statement):
    device = station(store=(store := MemoryStore())).device
    store.write("MAIN", SHORT.splitlines())
    device.do("run", {"name": "MAIN"}, 0.0)
    fields = {"name": "MAIN"} | ({"scratch": "MAIN"} if statement == "commit" else {})
    with pytest.raises(Refusal, match="running"):
        device.do(statement, fields, 0.1)
    assert device.do("status", {}, 0.1)[0] == {"state": "running", "statement": 4, "completed": 0}


def test_statements_completed_are_told_as_time_goes_on():
    device = station(store=(store := MemoryStore())).device
    store.write("MAIN", SHORT.splitlines())
    device.do("run", {"name": "MAIN"}, 0.0)
    first_s = 2.0 / 8.0 + 8.0 / 250
    told = [device.do("status", {}, t)[0] for t in (first_s + 0.01, first_s + 0.1, 5.0)]
    assert [(row["statement"], row["completed"]) for row in told] == [(6, 4), (7, 6), (0, 7)]
    assert told[-1]["state"] == "done"


def test_an_endless_loop_is_planned_as_far_as_it_is_looked_at():
    program = mopro.compile(
        "UU012500/1\nVEL1 4.0\nACC1 0.25\n:A\nMRI1 1.0\nWX1\nMRI1 -1.0\nWX1\nJUMP A\n"
    )
    motion = Motion(Emulator(MACHINE), program, MACHINE.travel_u())
    cycle_s = 2 * (1.0 / 4.0 + 4.0 / 250)
    motion.look_ahead(1000.0)
    assert motion.end_s > 1000.0
    assert motion.command_u(1, 1500 * cycle_s + cycle_s / 4) == pytest.approx(6250, abs=2)


def test_a_stop_far_ahead_of_the_plants_time_is_the_same_as_one_asked_in_steps():
    program = mopro.compile(SHORT.replace("2.0", "12.0"))
    rests = []
    for steps in (1, 40):
        motion = Motion(Emulator(MACHINE), program, MACHINE.travel_u())
        for n in range(1, steps + 1):
            motion.advance(0.4 * n / steps)
        motion.stop(0.4)
        motion.advance(motion.end_s + 1.0)
        assert motion.calm()
        motion.finish()
        rests.append((motion.seen_u[1], motion.account(1, 5)[0][1].max_lag_m))
    assert rests[0] == rests[1]


def test_a_scenario_plays_again_as_it_did():
    faults = [Fault("flip", rate=0.1), Fault("missing", rate=0.2), Fault("drop", rate=0.05)]

    def played():
        injector = FaultInjector(Scenario(7, faults))
        wire = [injector.byte("to_host", n % 128, 10) for n in range(500)]
        return wire, [injector.reply(b"OK") for _ in range(50)], injector.happened

    assert played() == played()
    assert set(played()[2]) == {"flip", "missing", "drop"}


def test_a_scenario_file_holds_wire_and_plant(tmp_path):
    file = tmp_path / "bad-day.toml"
    file.write_text(
        'seed = 3\n[[fault]]\nkind = "flip"\nrate = 0.01\ndirection = "to_host"\n'
        '[[fault]]\nkind = "lost_steps"\nrun_s = 0.4\naxis = 2\npitches = -1\n'
    )
    scenario = load_scenario(file)
    assert scenario.seed == 3
    assert [(f.kind, f.rate, f.direction) for f in scenario.faults] == [("flip", 0.01, "to_host")]
    assert [(f.kind, f.axis, f.pitches) for f in scenario.plant] == [("lost_steps", 2, -1)]


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ('[[fault]]\nkind = "flip"\nrate = 0.1\n[[fault]]\nkind = "flop"\n', 5, "one of drop"),
        ('[[fault]]\nkind = "flip"\n[[fault]]\nkind = "late"\nrate = 1\n', 2, "a flip has rate"),
        ('[[fault]]\nkind = "drop"\nrate = 0.1\n[[fault]]\nkind = "flip"\nrate = 2\n', 6, "0 to 1"),
        ('[[fault]]\nkind = "reset"\nat_s = 1\naxis = 1\n', 4, "unknown key axis"),
        ("seed = 1.5\n", 1, "whole number"),
        ("seed = \n", 1, ""),
    ],
)
def test_a_fault_in_a_scenario_file_has_its_line(tmp_path, text, line, says):
    file = tmp_path / "s.toml"
    file.write_text(text)
    with pytest.raises(ModelError) as caught:
        load_scenario(file)
    assert any(f.span.line == line and says in f.message for f in caught.value.diagnostics)


def test_every_kind_of_fault_can_be_stated(tmp_path):
    values = {"rate": 0.1, "delay_s": 1.0, "at_s": 1.0, "for_s": 1.0, "run_s": 1.0, "axis": 1}
    values |= {"pitches": 1, "times": 2, "direction": "both"}
    lines = []
    for kind, (_, keys) in KINDS.items():
        lines += ["[[fault]]", f'kind = "{kind}"']
        lines += [f"{k} = {values[k]!r}".replace("'", '"') for k in sorted(keys)]
    file = tmp_path / "all.toml"
    file.write_text("\n".join(lines))
    scenario = load_scenario(file)
    assert len(scenario.faults) + len(scenario.plant) == len(KINDS)


def test_an_ok_comes_only_after_the_program_is_on_the_disk(tmp_path, monkeypatch):
    done = []
    real_fsync, real_rename = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda h: done.append("flush") or real_fsync(h))
    monkeypatch.setattr(Path, "replace", lambda *a: done.append("rename") or real_rename(*a))
    port = LoopbackPort(station(store=FolderStore(tmp_path / "new" / "programs.d")))
    assert done == ["flush", "flush"], "the new folders"
    port.write(b"DL A\rVEL1 1.0\rEP\r")
    said = b""
    while data := port.read(port.now_s() + 1.0):
        said += data
    assert b"?" not in said
    assert done[2:] == ["flush", "rename", "flush"]


def test_a_program_that_cannot_be_kept_is_refused(tmp_path):
    (tmp_path / "A.CMD").symlink_to("/dev/full")
    port = LoopbackPort(station(store=FolderStore(tmp_path)))
    port.write(b"DL A\rVEL1 1.0\rEP\rDL B\rVEL1 1.0\rEP\r")
    said = b""
    while data := port.read(port.now_s() + 1.0):
        said += data
    assert b"? 8 the program cannot be kept" in said
    assert FolderStore(tmp_path).read("B") == ["VEL1 1.0"]


def test_a_heartbeat_belongs_to_who_started_the_run():
    """Another client's lines do not keep an orphaned run alive, nor does a new conversation."""
    for change in ("client", "greeting"):
        joined = bench()
        session, station = joined.session, joined.station
        station.store.write("SCRATCH", ["WT60000"])
        session.ask("heartbeat", milliseconds=1000)
        session.ask("run", name="SCRATCH")
        for _ in range(4):
            session.pause(0.4)
            assert session.one("status")["state"] == "RUN"
        if change == "client":
            station.meet(2)
        else:
            session.open()
        for _ in range(4):
            session.pause(0.4)
            state = session.one("status")["state"]
        assert state == "QUIET"


def test_frames_of_one_who_does_not_know_the_number_keep_no_run_alive():
    joined = bench()
    session, station = joined.session, joined.station
    station.store.write("SCRATCH", ["WT60000"])
    session.ask("heartbeat", milliseconds=1000)
    session.ask("run", name="SCRATCH")
    check = session.dialect.check
    now_s = session.port.now_s()
    for nth in range(40):
        number = (session._number + 50 + nth) % check.numbers
        station.hear((check.wrap("SR", number) + "\r").encode(), now_s + 0.1 * nth)
        station.say(now_s + 0.1 * nth)
    station.device.move_on(now_s + 4.0)
    assert station.device.state in ("silent", "stopping")
