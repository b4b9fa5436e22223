"""Runner of the benchmark: asks `mopro reconcile` about each case and judges its verdicts.

Each case is a process of its own. Verdicts are kept as verdict.json beside the experiment,
so that an interrupted run continues where it was. An ambiguous verdict is followed up: the
experiment that it proposes is run on the reference plant, and the question is put again.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.grids import spread
from mopro.blind.making.equivalent import MARGIN, left_by_set
from mopro.blind.making.machine_case import UNSEEN
from mopro.blind.making.make import hashes
from mopro.blind.making.manifest import (
    ANSWERS,
    EXPERIMENT,
    MODEL,
    Manifest,
    is_case_number,
    is_file_name,
)
from mopro.blind.making.sizes import NoiselessRuns
from mopro.blind.reference.motor import Nominal
from mopro.blind.reference.plant import ProgramRun
from mopro.blind.reference.sensors import Instrument
from mopro.blind.scoring.follow import FOLDER, add_proposed_run, hidden_plant
from mopro.blind.scoring.judge import Judgement, judge
from mopro.blind.scoring.judge_machine import judge_machine
from mopro.blind.scoring.outcome import FAILED, UNEXPLAINED, Document
from mopro.blind.scoring.score import FollowUp, pair_key
from mopro.engine.threads import in_threads
from mopro.errors import DataError
from mopro.files import make_folder, write
from mopro.inputs import read_bytes
from mopro.process.jobs import run_module


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
    sets = [sorted(named)] if left < MARGIN else []
    return {**answer, "equivalent_sets": sets, "named_leaves": left}


def _run(folder: Path, told: Mapping[str, Any]) -> ProgramRun:
    text = (folder / told["program"]).read_text(encoding="ascii")
    return ProgramRun(text, told["payload_kg"], told["until_s"])


VERDICT = "verdict.json"
# Folder of the machine files that were written for the cases of the grid `machines`.
REPAIRED = "repaired"
_STDERR_KEPT = 2000  # characters of a process's messages that go into its verdict
# Keys that the answer of each case has at least.
_ANSWER_KEYS = {"files", "group", "sensor", "effects", "offsets", "instruments", "strange"}

Reply = dict[str, Any]


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


@dataclass(frozen=True)
class VerdictSource:
    """Source of verdicts: `mopro reconcile`, or a folder of recorded replies (`NNN.json`).

    A verdict is kept beside its experiment and reused as long as the experiment's files stay
    the same, unless `again` is set. A process that gives no verdict within `patience_s` has
    failed; failures are not kept. With `allow_python` a model that is a
    program is run. `simulations`: how many each process may do at once.
    """

    again: bool = False
    patience_s: float = 600.0
    allow_python: bool = False
    replies: Path | None = None
    simulations: int = 1

    def ask(
        self, number: str, experiment: Path, without: Sequence[str] = (), out: Path | None = None
    ) -> Reply:
        """The reply to one experiment, with `seconds`; DataError for a bad recorded reply.

        Effects in `without` are left out of the candidates. With `out` the repaired machine is
        written there and tried: `applied` and `unseen` have its gaps of the experiment's runs and
        of those of unseen.toml.
        """
        if self.replies is not None:
            return _read_reply(self.replies / f"{number}.json")
        file = experiment.with_name(VERDICT)
        files = hashes(experiment.parent)
        known = None if self.again else _read_kept(file)
        asked = {"files": files, "without": list(without)}
        if known is not None and asked == {"files": known["files"], "without": without_of(known)}:
            return known
        if out is not None:
            out.unlink(missing_ok=True)
        reply = {**self._reconciled(experiment, without, out), **asked}
        if out is not None and out.is_file():
            reply["applied"] = self._applied(experiment, out)
            reply["unseen"] = self._applied(experiment.with_name(UNSEEN), out)
        if reply["verdict"] != FAILED:
            write(file, (json.dumps(reply, indent=1) + "\n").encode())
        return reply

    def _applied(self, experiment: Path, machine: Path) -> list[Any]:
        """Gaps of each run before and after the repair, as `mopro compare --apply` gives them."""
        words = ["compare", str(experiment), "--apply", str(machine), "--json"]
        words += ["--allow-python"] if self.allow_python else []
        try:
            done = run_module("mopro", words, self.patience_s)
            return list(json.loads(done.stdout)["applied"])
        except (subprocess.TimeoutExpired, ValueError, KeyError):
            return []

    def _reconciled(
        self, experiment: Path, without: Sequence[str], out: Path | None = None
    ) -> Reply:
        """The JSON that `mopro reconcile` prints, with its time (s), exit code and messages."""
        start = time.perf_counter()
        words = ["reconcile", "--jobs", str(self.simulations), str(experiment), "--json"]
        words += [part for name in without for part in ("--without", name)]
        words += [] if out is None else ["--out", str(out)]
        words += ["--allow-python"] if self.allow_python else []
        try:
            done = run_module("mopro", words, self.patience_s)
        except subprocess.TimeoutExpired:
            return {"verdict": FAILED, "stderr": f"no answer within {self.patience_s:g} s"}
        try:
            reply = json.loads(done.stdout)
        except ValueError:
            reply = {}
        if not isinstance(reply, dict) or "verdict" not in reply:
            reply = {"verdict": FAILED}
        messages = done.stderr.decode("utf-8", "replace")[-_STDERR_KEPT:]
        seconds = time.perf_counter() - start
        return {**reply, "seconds": seconds, "exit_code": done.returncode, "stderr": messages}


def _read_kept(path: Path) -> Reply | None:
    """A verdict that `ask` has kept; None if there is none or it is damaged."""
    try:
        reply = _read_reply(path)
    except DataError:
        return None
    effects = reply.get("effects")
    if not isinstance(effects, list) or not all(
        isinstance(e, dict) and "name" in e for e in effects
    ):
        return None
    types = {"verdict": str, "files": dict, "seconds": float, "exit_code": int, "stderr": str}
    usable = all(isinstance(reply.get(key), kind) for key, kind in types.items())
    return reply if usable else None


def _read_reply(path: Path) -> Reply:
    try:
        reply = json.loads(read_bytes(path))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}", "unreadable") from error
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no JSON: {error}", "bad-reply") from error
    if not isinstance(reply, dict):
        raise DataError(f"{path}: expected what `mopro reconcile --json` prints", "bad-reply")
    return reply


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


def without_of(document: Mapping[str, Any]) -> list[str]:
    """The effects that a question leaves out, from a case's answer or a kept verdict."""
    return list(document.get("without") or [])


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
