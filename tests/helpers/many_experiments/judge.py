"""Judgement of a drawn experiment: what `reconcile` and `compare` say of it, and how."""

import contextlib
import json
import re
import time
import traceback
import warnings
from dataclasses import dataclass

from helpers.commands import run_here
from helpers.many_experiments import machines
from helpers.many_experiments.axis import axis
from helpers.many_experiments.draws import Draw
from helpers.many_experiments.motor import Motor

KINDS = {
    "motor": Motor, "axis": axis, "kinematic": machines.kinematic,
    "effort": machines.effort, "thermal": machines.thermal, "python": machines.python,
}  # fmt: skip
# The motor's simulation takes longer than all others.
SHARES = ["motor"] * 2 + ["axis"] * 6 + ["kinematic"] * 5 + ["effort"] * 3 + ["thermal"] * 5 + [
    "python"
] * 2  # fmt: skip
REFUSED, FAILED = "refused", "failed"
_REFUSAL = re.compile(r"^\S.*?:\d+:\d+: .+ \[([a-z0-9-]+)\]$", re.MULTILINE)
# Words of libraries and of the interpreter, which tell a person nothing; "None: ..." is a verdict.
_FOREIGN = re.compile(
    r"Warning|Traceback|numpy|scipy|numba|\blark\b|LinAlg|\bx0\b|\bbounds\b|\barrays?\b|ndarray"
    r"|\b(nan|inf|NaN|Infinity|NoneType)\b|\bNone\b(?!: )|float64|dtype|object has no|operand"
    r"|broadcast|[Ss]ingular matrix|\blstsq\b|Error\b|infeasible|residuals are|not finite in",
)
# A cell that is `nan` is shown where it is refused; a blank line of the log stands between rules.
_EXCERPT = re.compile(r"^.*\n *\^~*$", re.MULTILINE)


class TooLong(BaseException):
    """A case that has taken its time of the processor: no handler of errors catches it."""


@dataclass(frozen=True)
class Judged:
    """A case: its verdict, or the rule that refused it, and what failed."""

    seed: tuple[int, int]
    kind: str
    outcome: str
    word: str = ""
    why: str = ""
    took_s: float = 0.0


def drawn(seed, folder):
    """Draw the experiment of a seed in `folder`: its kind and its file."""
    draw = Draw(*seed)
    kind = draw.pick(*SHARES)
    return kind, KINDS[kind](draw).write(folder)


def judged(seed, folder):
    """Reconcile the experiment of a seed in `folder`, and compare on the machine written."""
    kind, _ = drawn(seed, folder)
    begun_s = time.process_time()
    try:
        outcome, word, why = _judged(folder, kind)
    except Exception:  # noqa: BLE001 - whatever is not the project's own fails the case
        outcome, word, why = FAILED, "traceback", traceback.format_exc()
    except TooLong:
        outcome, word, why = FAILED, "too long", ""
    return Judged(seed, kind, outcome, word, why, time.process_time() - begun_s)


def _judged(folder, kind):
    allowed = ["--allow-python"] if kind == "python" else []
    out = ("--out", "repaired.toml", "--jobs", "1")
    done = _run(folder, "reconcile", "experiment.toml", "--json", *out, *allowed)
    wrong = _said(done)
    if wrong or done.returncode == 2:
        return (FAILED, *wrong) if wrong else _refusal(done, folder)
    answer, wrong = _numbers(done.stdout)
    if wrong:
        return FAILED, *wrong
    # The machine file of the experiment beside it has an own name, so that `model.py` is found.
    applied = ("--apply", "repaired.toml", *allowed)
    form = ["--json"] if len(done.stdout) % 2 else []
    again = _run(folder, "compare", "experiment.toml", *applied, *form)
    wrong = _said(again) or (form and again.returncode != 2 and _numbers(again.stdout)[1])
    if wrong or again.returncode == 2:
        return FAILED, *(wrong or ("not opened again", again.stderr))
    return answer["verdict"], "", ""


def _run(folder, *args):
    with warnings.catch_warnings():
        for kind in (RuntimeWarning, UserWarning):
            warnings.simplefilter("always", kind)
        return run_here(folder, *args)


def _said(done):
    """The fault of the exit code or of the words of a command; None if there is none."""
    if done.returncode not in (0, 1, 2):
        return "exit code", f"{done.returncode}: {done.stderr}"
    said = _EXCERPT.sub("", done.stderr) + "\n".join(_texts(done.stdout))
    found = _FOREIGN.search(said)
    return ("foreign words", f"{found[0]}: {done.stderr}{said[-2000:]}") if found else None


def _texts(stdout):
    """The sentences of an answer."""
    with contextlib.suppress(ValueError):
        answer, found = json.loads(stdout), []
        _collect(answer, found)
        return found
    return [stdout]


def _collect(data, found):
    if isinstance(data, str):
        found.append(data)
    elif isinstance(data, dict | list):
        for own in data.values() if isinstance(data, dict) else data:
            _collect(own, found)


def _numbers(stdout):
    """An answer in JSON, and what is wrong with it."""
    odd = []
    try:
        answer = json.loads(stdout, parse_constant=odd.append)
    except ValueError as error:
        return {}, ("no JSON", str(error))
    return answer, (("not finite", ", ".join(odd)) if odd else None)


def _refusal(done, folder):
    found = _REFUSAL.search(done.stderr)
    if found is None:
        of_file = re.search(r"\[([a-z0-9-]+)\]$", done.stderr.strip())
        return FAILED, f"no place {of_file[1] if of_file else ''}", done.stderr
    if (folder / "repaired.toml").exists():
        return FAILED, "refused, and written", done.stderr
    return REFUSED, found[1], done.stderr
