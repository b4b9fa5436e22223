"""The view of a run, from the envelopes of its recording, and the platen beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from mopro.effects import catalogue
from mopro.effects.resolve import active_effects
from mopro.errors import DataError
from mopro.machine import DEFAULT_LOOP_S, Machine
from mopro.markup import listing, paragraph, section, table
from mopro.motion import Schedule
from mopro.plant import plan_with_effects, switches_u
from mopro.program import AXES, Program
from mopro.recording import Header, Run
from mopro.recording.envelope import LAG, Envelopes
from mopro.recording.moves import MoveReport, Stall
from mopro.recording.run import outcome
from mopro.source import Span
from mopro.units import UNITS
from mopro.viewer.page import document
from mopro.viewer.view import Lines, Mark, Panel, Scale, Trace, Track, View

# -- the platen -------------------------------------------------------------------------------
# The platen from above, with its limit switches, as the scripts read it.


def platen_json(
    machine: Machine, schedule: Schedule, places: Mapping[int, tuple[str, str]]
) -> dict[str, Any]:
    """Platen, forcer and switches in metres from the place where the program begins.

    `places`: the track and channel that tell the position (m) of each axis.
    """
    return platen_of(machine, switches_u(schedule, machine.travel_u()), places)


def platen_of(
    machine: Machine,
    travel_u: Mapping[int, tuple[float, float]],
    places: Mapping[int, tuple[str, str]],
) -> dict[str, Any]:
    """As `platen_json`, for limit switches at `travel_u` (microsteps)."""
    travel = {
        str(axis): [low * machine.microstep_m, high * machine.microstep_m]
        for axis, (low, high) in travel_u.items()
    }
    return {
        "length": machine.platen.length_m,
        "width": machine.platen.width_m,
        "side": machine.heat.forcer_side_m,
        "travel": travel,
        "position": {
            str(axis): {"track": track, "channel": channel}
            for axis, (track, channel) in places.items()
        },
    }


# -- views ------------------------------------------------------------------------------------
# A run as a view, from the envelopes of its recording.

MOST_MOVES = 20_000
MOST_MARKS = 500

TRACK = "run"


class Found(Protocol):
    """A finding about a program."""

    @property
    def rule(self) -> str:
        """The rule's name."""
        ...

    @property
    def message(self) -> str:
        """Text of the finding."""
        ...

    @property
    def span(self) -> Span:
        """Its place in the program."""
        ...


def run_track(envelopes: Envelopes) -> Track:
    """All samples so far, in the fewest buckets that hold them; DataError if there are none."""
    if not envelopes.names:
        raise DataError("the run has no samples")
    head = envelopes.head()
    return Track(envelopes.names, envelopes.overview(), [] if head is None else [head])


def run_view(
    envelopes: Envelopes,
    run: Run,
    program: Program,
    machine: Machine,
    findings: Iterable[Found] = (),
) -> View:
    """The view of a `run` whose recording `envelopes` received.

    `findings` about the program are marked where their lines run. Raises MotionError.
    """
    track = run_track(envelopes)
    return View(
        name=f"{run.program} on {run.machine}",
        panels=run_panels(_alive(track)),
        tracks={TRACK: track},
        program=program.source.lines,
        lines=Lines(*envelopes.changes()),
        marks=list(_marks(run, findings))[:MOST_MARKS],
        moves=moves_json(run.moves),
        platen=platen_json(
            machine, schedule_of(machine, program, run.duration_s), places_of(track.names)
        ),
        phases=phases_of(_alive(track)),
    )


def run_page(header: Header, view: View, run: Run, machine: Machine) -> str:
    """The page of a run: its view, and where it comes from."""
    source = machine.source
    file = [section("Machine", [listing(source.text)], opened=False)] if source else []
    stated = {k: v for k, v in header.after(run).as_json().items() if k != "stalls"}
    rows = ([key.replace("_", " "), _stated(value)] for key, value in stated.items())
    trouble = [paragraph(run.trouble)] if run.trouble else []
    return document(
        view.name,
        [paragraph(outcome(run).removeprefix(f"{view.name}: ")), *trouble],
        [view],
        [section("Provenance", [table((), rows, "The recording")]), *file],
    )


def _stated(value: Any) -> str:
    """A value of a header in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_stated(own)}" for key, own in value.items()) or "none"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(_stated, value)) or "none"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def run_panels(alive: Sequence[str]) -> list[Panel]:
    """The panels of the channels in `alive`; those that have none are left out."""
    axes = sorted({n.split("_")[1] for n in alive if n.startswith(("command_", "position_"))})
    panels = [
        _panel("Position", "m", _of(axes, alive, ("command_{}_m", "command"),
                                    ("position_{}_m", ""))),
        _panel("Velocity", "m/s", _of(axes, alive, ("velocity_{}_m_s", ""))),
        _panel("Following error", "m", _of(axes, alive, (LAG, "")), "command − position"),
        _panel("Force", "N", _of(axes, alive, ("force_{}_N", ""))),
        _panel("Phase currents", "A", _of(axes, alive, ("phase_a_{}_A", "phase A"),
                                          ("phase_b_{}_A", "phase B"))),
        _panel("Temperature", "C", [Trace(name, "forcer") for name in alive
                                    if name == "temperature_C"]),
    ]  # fmt: skip
    return [panel for panel in panels if panel.traces]


def places_of(names: Sequence[str]) -> dict[int, tuple[str, str]]:
    """The track and channel of each axis' position, or else of its command."""
    kinds = {n: "position" if f"position_{n}_m" in names else "command" for n in AXES}
    return {axis: (TRACK, f"{kind}_{axis}_m") for axis, kind in kinds.items()}


def phases_of(alive: Sequence[str]) -> dict[str, list[str]]:
    """The names of both phase currents of each axis that has them."""
    pairs = {n: [f"phase_a_{n}_A", f"phase_b_{n}_A"] for n in "12"}
    return {n: pair for n, pair in pairs.items() if set(pair) <= set(alive)}


def moves_json(moves: Sequence[MoveReport]) -> list[dict[str, Any]]:
    """Moves folded by source line, in the order of their first; lengths in metres.

    Beyond MOST_MOVES of all, the single moves of a line are not listed.
    """
    by_line: dict[int, list[MoveReport]] = {}
    for move in moves:
        by_line.setdefault(move.line, []).append(move)
    listed = len(moves) <= MOST_MOVES
    return [_folded(line, own, listed) for line, own in by_line.items()]


def _folded(line: int, moves: Sequence[MoveReport], listed: bool) -> dict[str, Any]:
    first = moves[0]
    margins = [m.stall_margin for m in moves if m.stall_margin is not None]
    lags = [m.max_lag for m in moves if m.max_lag is not None]
    return {
        "line": line,
        "count": len(moves),
        "axes": first.axes,
        "profile": first.profile,
        "unit": first.unit,
        "metres": float(UNITS[first.unit][1]) if first.unit in UNITS else None,
        "distance": first.distance,
        "peak": max(m.peak_velocity for m in moves),
        "set": first.set_velocity,
        "duration": max(m.duration_s for m in moves),
        "margin": min(margins, default=None),
        "lag": max(lags, default=None),
        "lost": sum(m.lost_pitches for m in moves),
        "slipped": sum(m.slipped for m in moves),
        "cut": sum(not m.complete for m in moves),
        "each": [
            [m.start_s, m.duration_s, m.distance, m.stall_margin, m.max_lag, m.lost_pitches]
            for m in (moves if listed else ())
        ],
    }


def schedule_of(machine: Machine, program: Program, for_s: float | None) -> Schedule:
    """The planned motion of at most `for_s` seconds; MotionError."""
    if for_s is None and program.loops_forever:
        for_s = DEFAULT_LOOP_S
    return plan_with_effects(program, machine, active_effects(machine, catalogue()), for_s)


def _marks(run: Run, findings: Iterable[Found]) -> Iterator[Mark]:
    if run.trip:
        yield Mark("trip", _trip_words(run.trip), int(run.trip["line"]), float(run.trip["time_s"]))
    for stall in run.stalls:
        yield Mark("stall", _stall_words(stall), stall.line, stall.time_s)
    for finding in findings:
        yield Mark("lint", f"{finding.message} [{finding.rule}]", finding.span.line)


def _stall_words(stall: Stall) -> str:
    who = "the motor" if stall.axis is None else f"axis {stall.axis}"
    if not stall.lost_pitches:
        return f"{who} slipped, and fell back into its own tooth"
    return f"{who} lost {stall.lost_pitches:+d} pitches"


def _trip_words(trip: Mapping[str, Any]) -> str:
    if trip["kind"] == "limit-switch":
        return f"axis {trip['axis']} ran into its limit switch"
    return "the motor became too hot"


def _alive(track: Track) -> list[str]:
    """Channels that have a value, without those of axes that never move."""
    buckets = track.overview
    spread = {
        name: (float(np.nanmin((first, second))), float(np.nanmax((first, second))))
        for name, first, second in zip(track.names, buckets.first, buckets.second, strict=True)
        if not np.isnan(first).all()
    }
    still = {
        n for n in "12"
        if all(low == high for name, (low, high) in spread.items() if name in
               (f"position_{n}_m", f"command_{n}_m"))
    }  # fmt: skip
    if len(still) == 2:
        still = set()
    return [name for name in spread if not any(f"_{n}_" in name for n in still)]


def _of(axes: Sequence[str], alive: Sequence[str], *kinds: tuple[str, str]) -> list[Trace]:
    """A trace for each axis and each kind (channel, words) that is alive."""
    return [
        Trace(
            channel.format(n),
            f"{words} {n}" if words == "command" else " ".join(filter(None, (f"axis {n}", words))),
            color=2 * (int(n) - 1) + (place if words.startswith("phase") else 0),
            style="command" if words == "command" else "line",
        )
        for n in axes
        for place, (channel, words) in enumerate(kinds)
        if channel.format(n) in alive
    ]


def _panel(title: str, unit: str, traces: Sequence[Trace], note: str = "") -> Panel:
    return Panel(title, TRACK, Scale.of(unit), traces, note=note)
