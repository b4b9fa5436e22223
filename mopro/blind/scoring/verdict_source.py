"""Verdicts asked for: `mopro reconcile` in a process of its own, or recorded replies.

Verdicts are kept as verdict.json beside the experiment, so that an interrupted run continues where
it was.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mopro.blind.cases.machine_case import UNSEEN
from mopro.blind.cases.make import hashes
from mopro.blind.scoring.outcome import FAILED
from mopro.errors import DataError
from mopro.files import write
from mopro.inputs import read_bytes
from mopro.process.jobs import run_module

VERDICT = "verdict.json"
_STDERR_KEPT = 2000  # characters of a process's messages that go into its verdict

Reply = dict[str, Any]


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


def without_of(document: Mapping[str, Any]) -> list[str]:
    """The effects that a question leaves out, from a case's answer or a kept verdict."""
    return list(document.get("without") or [])
