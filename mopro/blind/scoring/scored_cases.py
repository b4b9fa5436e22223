"""Benchmark's cases asked about and judged: each by a process of its own, in order of number.

An ambiguous verdict is followed up: the experiment that it proposes is run on the hidden plant, and
the question is put again.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.equivalent import MARGIN, left_by_set
from mopro.blind.cases.grids import spread
from mopro.blind.cases.hidden_sizes import NoiselessRuns, Plant
from mopro.blind.cases.make import data_file, data_name, hashes, measured, run_text
from mopro.blind.cases.manifest import (
    ANSWERS,
    EXPERIMENT,
    MODEL,
    Manifest,
    is_case_number,
    is_file_name,
)
from mopro.blind.cases.stated_effects import StatedEffects
from mopro.blind.reference.motor import Nominal
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Disturbance, Foreign
from mopro.blind.scoring.judge import FollowUp, Judgement, judge, pair_key
from mopro.blind.scoring.judge_machine import judge_machine
from mopro.blind.scoring.outcome import FAILED, UNEXPLAINED, Document
from mopro.blind.scoring.verdict_source import Reply, VerdictSource, without_of
from mopro.engine.threads import in_threads
from mopro.errors import DataError
from mopro.files import make_folder
from mopro.inputs import read_bytes

FOLDER = "followed"
# Folder of the machine files that were written for the cases of the grid `machines`.
REPAIRED = "repaired"
# Recorded time of a proposed program that heats the motor in an endless loop.
_HEATING_S = 3600.0
# Keys that the answer of each case has at least.
_ANSWER_KEYS = {"files", "group", "sensor", "effects", "offsets", "instruments", "strange"}


@dataclass(frozen=True)
class CaseFolder:
    """A folder that `mopro blind make` filled: the seed, and each case's answer by its number."""

    folder: Path
    seed: int
    cases: Mapping[str, Mapping[str, Any]]
    grid: str

    @classmethod
    def read(
        cls, folder: Path, only: frozenset[str] = frozenset(), sample: int | None = None
    ) -> CaseFolder:
        """The cases with the numbers `only`, or all of them; of these `sample`, evenly spread.

        Raises DataError if answers.json cannot be used, if one of these cases is missing, or
        if a case's files differ from those that were made.
        """
        file = folder / ANSWERS
        try:
            document = json.loads(read_bytes(file))
            cases, grid = _checked(document["cases"]), str(document.get("grid", ""))
            found = cls(folder, document["seed"], cases, grid)
        except OSError as error:
            raise DataError(f"{file}: cannot be read: {error.strerror}", "unreadable") from error
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise DataError(f"{file}: not what `mopro blind make` writes", "bad-answers") from error
        if missing := sorted(only - set(found.cases)):
            raise DataError(f"{file}: there is no case {missing[0]}", "no-such-case")
        chosen = spread(sorted(only or found.cases), sample)
        found = replace(found, cases={n: found.cases[n] for n in chosen})
        for number, answer in found.cases.items():
            _check_unchanged(folder / number, answer["files"])
        return found

    @property
    def files(self) -> list[Path]:
        """All input files: answers.json and the files of each case."""
        cases = [self.folder / n / name for n, a in self.cases.items() for name in a["files"]]
        return [self.folder / ANSWERS, *cases]

    @property
    def programs(self) -> list[Path]:
        """Models of the cases' machines that are programs."""
        return [self.folder / n / MODEL for n, a in self.cases.items() if MODEL in a["files"]]

    def refuse_foreign_follow_ups(self) -> None:
        """Raise DataError if a folder for a follow-up holds files that were not made here."""
        for number in self.cases:
            Manifest.read(self.folder / FOLDER / number).refuse_foreign([""])


def _checked(cases: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """`cases` unchanged; ValueError for a missing key or a name that leaves the case's folder."""
    for number, answer in cases.items():
        if not is_case_number(number) or not all(map(is_file_name, answer["files"])):
            raise ValueError("a case's number or a file's name is not one that is made")
        if missing := _ANSWER_KEYS - answer.keys():
            raise ValueError(f"no {sorted(missing)[0]}")
    return cases


def _check_unchanged(folder: Path, files: Mapping[str, str]) -> None:
    """Raise DataError unless `folder` holds exactly `files`, given by name and SHA-256."""
    try:
        present = hashes(folder) if folder.is_dir() else {}
    except OSError as error:
        raise DataError(f"{folder}: cannot be read: {error.strerror}", "unreadable") from error
    for name in sorted({*files, *present}):
        if present.get(name) != files.get(name):
            message = f"{folder / name}: not what was made; make the cases again"
            raise DataError(message, "case-changed")


def judge_cases(cases: CaseFolder, source: VerdictSource, jobs: int) -> Iterator[Judgement]:
    """The judgement of each case in order of number, `jobs` asked at a time."""

    def judge_one(number: str) -> Judgement:
        answer = cases.cases[number]
        folder = cases.folder / number
        if cases.grid == "machines":
            make_folder(cases.folder / REPAIRED)
            out = cases.folder / REPAIRED / f"{number}.toml"
            return judge_machine(
                number, answer, source.ask(number, folder / EXPERIMENT, out=out), folder
            )
        reply = source.ask(number, folder / EXPERIMENT, without_of(answer))
        return judge(number, with_named_set(answer, reply, folder, cases.seed), reply)

    yield from in_threads(judge_one, sorted(cases.cases), jobs)


def follow_up_cases(
    cases: CaseFolder, source: VerdictSource, judgements: Iterable[Judgement], jobs: int
) -> Iterator[FollowUp]:
    """Each ambiguous case judged again with its proposed experiment added as one more run.

    A case whose effect was left out is not: of its alternatives none can be the right one.
    """
    kept = replace(source, again=False)

    def follow_up(first: Judgement) -> FollowUp:
        number = first.number
        reply = kept.ask(number, cases.folder / number / EXPERIMENT)
        second = judge(number, cases.cases[number], _ask_again(cases, source, number, reply))
        predicted = {
            pair_key(*pair["effects"]): pair["sigma"]
            for pair in reply.get("next_experiment_pairs") or []
        }
        return FollowUp(first, predicted, second)

    ambiguous = [j for j in judgements if j.verdict == "ambiguous" and cases.grid != "machines"]
    asked = [j for j in ambiguous if not without_of(cases.cases[j.number])]
    yield from in_threads(follow_up, asked, jobs)


def _ask_again(cases: CaseFolder, source: VerdictSource, number: str, reply: Reply) -> Reply:
    """The reply to the experiment with the run that `reply` proposes; failed if there is none."""
    text = reply.get("next_experiment")
    if not text:
        return {"verdict": FAILED, "stderr": "no experiment was proposed"}
    copy = cases.folder / FOLDER / number
    folder, answer = cases.folder / number, cases.cases[number]
    payload_kg = reply.get("next_experiment_payload_kg", 0.0)
    try:
        file = add_proposed_run(cases.seed, number, answer, text, folder, copy, payload_kg)
    except ValueError as error:
        return {"verdict": FAILED, "stderr": str(error)}
    return replace(source, replies=None).ask(number, file)


# -- the hidden plant of a case, built again from its answer -------------------------------------


def add_proposed_run(
    seed: int,
    number: str,
    answer: Mapping[str, Any],
    text: str,
    folder: Path,
    copy: Path,
    payload_kg: float = 0.0,
) -> Path:
    """Write a copy of the case in `folder` with the program `text` as one more run.

    Returns the experiment file in the folder `copy`. Raises ValueError for a program that
    cannot be run or makes the plant stall, DataError if `copy` holds files of an
    experiment that were not made here.
    """
    instruments = [Instrument(**i) for i in answer["instruments"]]
    hot = instruments[0].quantity == "temperature"
    run = ProgramRun(text, payload_kg, _HEATING_S if hot else None)
    generator = np.random.default_rng([seed, 4, int(number)])
    plant = hidden_plant(answer)
    foreign = Foreign(**answer["foreign"]) if answer.get("foreign") else None
    data = measured(plant, run, instruments, answer["offsets"], generator, foreign)
    if plant.stalled:
        raise ValueError("the proposed program makes the hidden plant stall")
    contents = {name: (folder / name).read_bytes() for name in answer["files"]}
    name = data_name("proposed", instruments)
    contents["proposed.CMD"] = text.encode("utf-8")
    contents[name] = data_file(name, instruments, *data)
    contents[EXPERIMENT] += ("\n" + run_text("proposed", payload_kg, instruments)).encode()
    Manifest.read(copy).replace("", contents)
    return copy / EXPERIMENT


def hidden_plant(answer: Mapping[str, Any]) -> Plant:
    """The plant with the effects and the disturbance that `answer` states."""
    effects = {e["name"]: e["parameters"] for e in answer["effects"]}
    if answer.get("stated"):
        return StatedEffects(**answer["stated"]).plant(effects)
    disturbance = Disturbance(**answer["strange"]) if answer["strange"] else None
    # Answers without a machine are older than --machine and belong to the default one.
    nominal = Nominal(**answer.get("machine", {}))
    foreign = Foreign(**answer["foreign"]) if answer.get("foreign") else None
    return ReferencePlant(effects, disturbance, nominal, foreign)


def with_named_set(answer: Document, reply: Document, folder: Path, seed: int) -> Document:
    """`answer` with what the set that `reply` names leaves of the hidden response, `named_leaves`.

    Also with the set in `equivalent_sets` if it is equivalent, as each rival by itself when the
    case was made: by the response of the reference plant without noise, chi-squared below 10 with
    the parameters of the verdict or with the best ones. Only what leaves nothing unexplained is
    tried, and is not equivalent one by one; `folder` has the case's programs.
    """
    named = {
        effect["name"]: {
            name: parameter["value"] for name, parameter in effect.get("parameters", {}).items()
        }
        for effect in reply.get("effects") or []
    }
    runs = answer.get("runs")
    single = set(named) <= set(answer.get("equivalent") or [])
    if not runs or single or reply.get("verdict") == UNEXPLAINED:
        return answer
    noiseless = NoiselessRuns(
        [_run(folder, each) for each in runs],
        [Instrument(**i) for i in answer["instruments"]],
        Nominal(**answer["machine"]),
    )
    generator = np.random.default_rng([seed, 7, int(folder.name)])
    left = left_by_set(noiseless, hidden_plant(answer), named, generator)
    if left is None:
        return answer
    equivalent = [sorted(named)] if left < MARGIN else []
    return {**answer, "equivalent_sets": equivalent, "named_leaves": left}


def _run(folder: Path, run: Mapping[str, Any]) -> ProgramRun:
    text = (folder / run["program"]).read_text(encoding="ascii")
    return ProgramRun(text, run["payload_kg"], run["until_s"])
