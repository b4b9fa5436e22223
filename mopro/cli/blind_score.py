"""The scoring of `mopro blind`: reconcile as real processes, their replies kept."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mopro.benchmark.follow import FOLDER, proposed
from mopro.benchmark.judge import FAILED, Judgement, judge
from mopro.benchmark.made import ANSWERS, Made, is_case, is_name
from mopro.benchmark.make import hashes
from mopro.benchmark.score import Followed, pair
from mopro.errors import DataError
from mopro.files import write

VERDICT = "verdict.json"
_SHOWN = 2000
# What the answer of a case says at least.
_ANSWER = {"files", "group", "sensor", "effects", "offsets", "instruments", "strange"}

Reply = dict[str, Any]


@dataclass(frozen=True)
class Ground:
    """A folder of cases and its answers."""

    folder: Path
    seed: int
    cases: Mapping[str, Mapping[str, Any]]

    @classmethod
    def read(cls, folder: Path, only: frozenset[str] = frozenset()) -> Ground:
        """The cases of these numbers, or all.

        DataError where there is none such, or where a case is no longer what was made.
        """
        file = folder / ANSWERS
        try:
            document = json.loads(file.read_text(encoding="utf-8"))
            ground = cls(folder, document["seed"], _checked(document["cases"]))
        except OSError as error:
            raise DataError(f"{file}: cannot be read: {error.strerror}", "unreadable") from error
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise DataError(f"{file}: not what `mopro blind make` writes", "bad-answers") from error
        if missing := sorted(only - set(ground.cases)):
            raise DataError(f"{file}: there is no case {missing[0]}", "no-such-case")
        if only:
            ground = replace(ground, cases={n: ground.cases[n] for n in only})
        for number, answer in ground.cases.items():
            _check(folder / number, answer["files"])
        return ground

    @property
    def files(self) -> list[Path]:
        """Every file that is read."""
        cases = [self.folder / n / name for n, a in self.cases.items() for name in a["files"]]
        return [self.folder / ANSWERS, *cases]

    def refuse_other_copies(self) -> None:
        """DataError if what follows an answer up would lie among files of other origin."""
        for number in self.cases:
            Made.read(self.folder / FOLDER / number).refuse_others([""])


def _checked(cases: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """`cases` as answers have them, none of which leads out of its folder; else ValueError."""
    for number, answer in cases.items():
        if not is_case(number) or not all(map(is_name, answer["files"])):
            raise ValueError("a case's number or a file's name is not one that is made")
        if missing := _ANSWER - answer.keys():
            raise ValueError(f"no {sorted(missing)[0]}")
    return cases


def _check(folder: Path, files: Mapping[str, str]) -> None:
    found = hashes(folder) if folder.is_dir() else {}
    for name in sorted({*files, *found}):
        if found.get(name) != files.get(name):
            message = f"{folder / name}: not what was made; make the cases again"
            raise DataError(message, "case-changed")


@dataclass(frozen=True)
class Asker:
    """Whom to ask: `mopro reconcile`, or a folder of replies (`NNN.json`).

    Replies are kept beside the experiments and taken from there the next time, unless
    `again` or the experiment's files are others. What gives no verdict within `patience_s`
    has failed, and is asked anew the next time.
    """

    again: bool = False
    patience_s: float = 600.0
    replies: Path | None = None

    def ask(self, number: str, experiment: Path) -> Reply:
        """The reply to one experiment, with `seconds`."""
        if self.replies is not None:
            return _read(self.replies / f"{number}.json")
        kept = experiment.with_name(VERDICT)
        files = hashes(experiment.parent)
        known = None if self.again else _kept(kept)
        if known is not None and known["files"] == files:
            return known
        reply = {**_reconcile(experiment, self.patience_s), "files": files}
        if reply["verdict"] != FAILED:
            write(kept, (json.dumps(reply, indent=1) + "\n").encode())
        return reply


def _reconcile(experiment: Path, patience_s: float) -> Reply:
    start = time.perf_counter()
    command = [sys.executable, "-m", "mopro", "reconcile", str(experiment), "--json"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=patience_s
        )
    except subprocess.TimeoutExpired:
        return {"verdict": FAILED, "stderr": f"no answer within {patience_s:g} s"}
    try:
        reply = json.loads(done.stdout)
    except ValueError:
        reply = {}
    if not isinstance(reply, dict) or "verdict" not in reply:
        reply = {"verdict": FAILED}
    seconds, said = time.perf_counter() - start, done.stderr[-_SHOWN:]
    return {**reply, "seconds": seconds, "exit_code": done.returncode, "stderr": said}


def _kept(path: Path) -> Reply | None:
    """A verdict as `ask` keeps it; None where there is none, or none that can be used."""
    try:
        reply = _read(path)
    except DataError:
        return None
    effects = reply.get("effects")
    if not isinstance(effects, list) or not all(
        isinstance(e, dict) and "name" in e for e in effects
    ):
        return None
    shapes = {"verdict": str, "files": dict, "seconds": float, "exit_code": int, "stderr": str}
    usable = all(isinstance(reply.get(key), kind) for key, kind in shapes.items())
    return reply if usable else None


def _read(path: Path) -> Reply:
    try:
        reply = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}", "unreadable") from error
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no JSON: {error}", "bad-reply") from error
    if not isinstance(reply, dict):
        raise DataError(f"{path}: expected what `mopro reconcile --json` prints", "bad-reply")
    return reply


def judged(ground: Ground, asker: Asker, jobs: int) -> Iterator[Judgement]:
    """Every case asked and judged, `jobs` at a time."""

    def one(number: str) -> Judgement:
        reply = asker.ask(number, ground.folder / number / "experiment.toml")
        return judge(number, ground.cases[number], reply)

    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(one, sorted(ground.cases))


def followed(
    ground: Ground, asker: Asker, cases: Iterable[Judgement], jobs: int
) -> Iterator[Followed]:
    """The proposed experiment run where the answer was ambiguous, and the question put again."""
    known = replace(asker, again=False)

    def one(case: Judgement) -> Followed:
        reply = known.ask(case.number, ground.folder / case.number / "experiment.toml")
        second = judge(case.number, ground.cases[case.number], _second(ground, asker, case, reply))
        promised = {
            pair(*told["effects"]): told["sigma"]
            for told in reply.get("next_experiment_pairs") or []
        }
        return Followed(case, promised, second)

    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(one, [case for case in cases if case.verdict == "ambiguous"])


def _second(ground: Ground, asker: Asker, case: Judgement, reply: Reply) -> Reply:
    text, number = reply.get("next_experiment"), case.number
    if not text:
        return {"verdict": FAILED, "stderr": "no experiment was proposed"}
    copy = ground.folder / FOLDER / number
    folder, answer = ground.folder / number, ground.cases[number]
    payload_kg = reply.get("next_experiment_payload_kg", 0.0)
    try:
        file = proposed(ground.seed, number, answer, text, folder, copy, payload_kg)
    except ValueError as error:
        return {"verdict": FAILED, "stderr": str(error)}
    return replace(asker, replies=None).ask(number, file)
