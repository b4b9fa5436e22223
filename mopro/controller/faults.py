"""Scenarios: faults of the wire, the controller and the machine, read from one TOML file.

All randomness comes from the scenario's seed, so that a scenario can be repeated exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any

from mopro.program import AXES
from mopro.tomlfile import Document, Value, read_source
from mopro.tomlfile.schema import Reader, number, one_of, whole

DIRECTIONS = ("to_controller", "to_host", "both")
_BYTES = {"rate", "direction", "times"}
_REPLY = {"rate", "times"}
_TIME = {"at_s", "for_s"}

# kind -> the keys that it must have, those that it may have
KINDS: dict[str, tuple[set[str], set[str]]] = {
    "drop": ({"rate"}, _BYTES),
    "double": ({"rate"}, _BYTES),
    "flip": ({"rate"}, _BYTES),
    "split": ({"rate"}, _BYTES),
    "merge": ({"rate"}, _BYTES),
    "late": ({"rate", "delay_s"}, _REPLY | {"delay_s"}),
    "missing": ({"rate"}, _REPLY),
    "garbled": ({"rate"}, _REPLY),
    "echo_off": ({"at_s"}, _TIME),
    "busy": ({"at_s"}, _TIME),
    "disconnect": ({"at_s"}, _TIME),
    "reset": ({"at_s"}, _TIME),
    "limit": ({"run_s"}, {"run_s"}),
    "overheated": ({"run_s"}, {"run_s"}),
    "lost_steps": ({"run_s", "axis", "pitches"}, {"run_s", "axis", "pitches"}),
}
_NO_KIND = f"expected a kind: one of {', '.join(KINDS)}"
_KEYS: dict[str, Reader[Any]] = {
    "rate": number(0.0, 1.0),
    "delay_s": number(0.0, 3600.0),
    "at_s": number(0.0, 1e9),
    "for_s": number(0.0, 1e9),
    "run_s": number(0.0, 1e9),
    "direction": one_of(*DIRECTIONS),
    "axis": one_of(*AXES),
    "times": whole(),
    "pitches": whole(),
}


@dataclass(frozen=True)
class Fault:
    """A fault of the wire or the controller.

    `rate` is its probability for each byte or reply, `times` how often it occurs at most;
    one that lasts begins at `at_s` and ends after `for_s`. `delay_s` is for late replies.
    """

    kind: str
    rate: float = 0.0
    direction: str = "both"
    times: int = 1_000_000_000
    delay_s: float = 0.0
    at_s: float = math.inf
    for_s: float = math.inf


@dataclass(frozen=True)
class PlantFault:
    """A fault of the machine, `run_s` seconds after the start of each run.

    `axis` and `pitches` are for lost steps.
    """

    kind: str
    run_s: float
    axis: int = 1
    pitches: int = 0


@dataclass(frozen=True)
class Scenario:
    """A seed, the faults of wire and controller, and those of the machine (`plant`)."""

    seed: int = 0
    faults: Sequence[Fault] = ()
    plant: Sequence[PlantFault] = ()


def load_scenario(path: str | Path) -> Scenario:
    """The scenario in file `path`; ModelError with all findings if it is none."""
    return Document(read_source(path)).read(_scenario)


def _scenario(root: Value) -> Scenario:
    root.only({"seed", "fault"})
    seed = root.get("seed", whole(), 0)
    made = [_fault(entry) for entry in root.sections("fault")]
    faults = [fault for fault in made if isinstance(fault, Fault)]
    return Scenario(seed, faults, [f for f in made if isinstance(f, PlantFault)])


def _fault(entry: Value) -> Fault | PlantFault | None:
    before = entry.faults
    kind = entry.need("kind", one_of(*KINDS, message=_NO_KIND), _NO_KIND, "bad-value")
    if kind is None:
        return None
    needs, allows = KINDS[kind]
    entry.only(allows | {"kind"})
    for key in sorted(needs - entry.data.keys()):
        entry.report(f"a {kind} has {key}", "missing-key", at="kind")
    stated: dict[str, Any] = {
        key: entry.get(key, _KEYS[key], None) for key in sorted(allows) if key in entry
    }
    if entry.faults > before:
        return None
    return PlantFault(kind, **stated) if "run_s" in needs else Fault(kind, **stated)


@dataclass
class FaultInjector:
    """Applies a scenario to bytes and replies; `happened` counts the faults by kind."""

    scenario: Scenario
    random: Random = field(init=False)
    happened: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.random = Random(self.scenario.seed)
        self._left: dict[int, int] = {}
        self._arrange()

    def add(self, fault: Fault) -> None:
        """Have a further fault happen."""
        self.scenario = replace(self.scenario, faults=(*self.scenario.faults, fault))
        self._arrange()

    def _arrange(self) -> None:
        """Sort the scenario's faults by what they act on."""
        self._left |= {id(f): f.times for f in self.scenario.faults if id(f) not in self._left}
        self._bytes = {
            direction: [
                f
                for f in self.scenario.faults
                if "direction" in KINDS[f.kind][1] and f.direction in (direction, "both")
            ]
            for direction in DIRECTIONS[:2]
        }
        self._replies = [
            f for f in self.scenario.faults if f.kind in ("late", "missing", "garbled")
        ]

    def _occurs(self, fault: Fault) -> bool:
        if self._left[id(fault)] <= 0 or self.random.random() >= fault.rate:
            return False
        self._left[id(fault)] -= 1
        self.count(fault.kind)
        return True

    def count(self, kind: str) -> None:
        self.happened[kind] = self.happened.get(kind, 0) + 1

    def byte(self, direction: str, byte: int, line_end: int) -> list[int]:
        """The bytes that arrive for one that is sent in `direction`: none, one or two.

        `line_end` is the last byte of a line's end.
        """
        for fault in self._bytes[direction]:
            if fault.kind == "merge" and byte != line_end:
                continue
            if self._occurs(fault):
                if fault.kind in ("drop", "merge"):
                    return []
                if fault.kind == "double":
                    return [byte, byte]
                if fault.kind == "split":
                    return [line_end, byte]
                return [byte ^ (1 << self.random.randrange(8))]
        return [byte]

    def reply(self, data: bytes) -> tuple[float, bytes]:
        """The delay of a reply in seconds, and the bytes of it that are sent."""
        delay_s = 0.0
        for fault in self._replies:
            if data and self._occurs(fault):
                if fault.kind == "late":
                    delay_s += fault.delay_s
                elif fault.kind == "missing":
                    data = b""
                else:
                    data = bytes(self.random.randrange(256) for _ in data)
        return delay_s, data

    def active(self, kind: str, now_s: float) -> bool:
        """True while a lasting fault of `kind` is active."""
        return any(
            f.kind == kind and f.at_s <= now_s < f.at_s + f.for_s for f in self.scenario.faults
        )

    def resets(self, after_s: float, until_s: float) -> list[float]:
        """The times of resets after `after_s`, up to `until_s`."""
        times = sorted(f.at_s for f in self.scenario.faults if f.kind == "reset")
        return [t for t in times if after_s < t <= until_s]
