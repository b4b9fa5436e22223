"""Coverage-guided fuzz of every parser, in bounded number and time; prints a table.

    pip install 'mopro[fuzz]'
    python bench/fuzz.py --inputs 10_000_000 --minutes 60

Each parser runs in a process of its own under Atheris (libFuzzer): the seeds are the files of the
repository and what mopro writes itself, the dictionary is the language of the parser. Every other
input of a text has long numbers or calls put into it, which a search guided by lines does not make.
A row for each parser:

- inputs, and those a second;
- tracebacks: inputs that raised anything but the project's own error classes;
- over 1 s: inputs that took more than a second of processor time, and the slowest (ms);
- memory: the largest resident size of the process (MB), Atheris and the corpus included;
- lines: the share of the lines in the parser's own modules that the found corpus reaches.

Inputs that fail are kept in the folder `--found`. Exits with 1 for a traceback, an input over 1 s,
a process over 300 MB, or one that ended before its time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from types import CodeType, FrameType, ModuleType

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.fuzzing.every import PARSERS
from helpers.fuzzing.parser import Parser, allowed
from helpers.paths import ROOT

_SLOW_S = 1.0
_MOST_MB = 300.0
_LEAST = 50_000  # inputs of any parser in a campaign that has as many
_HANG_S = 60
_MOST_ADDRESSES = 4 << 30
_CHANGED = 0.5  # share of the inputs with the parser's own change
_KEPT = 20  # failing inputs of one place
_COLUMNS = ("parser", "inputs", "1/s", "tracebacks", "over 1 s", "slowest ms", "MB", "lines")


# -- one parser, in a process of its own -------------------------------------------


class Watched:
    """Takes inputs, and counts what came of them until `inputs` or `seconds` are over."""

    def __init__(self, parser: Parser, chosen: argparse.Namespace, folder: Path) -> None:
        self._take = parser.make(folder)
        self._name = parser.name
        self._allowed = allowed()
        self._chosen = chosen
        self._began_s = time.monotonic()
        self._inputs = self._tracebacks = self._slow = 0
        self._slowest_s = 0.0
        self._places: dict[str, int] = {}
        self._first: dict[str, int] = {}
        self._peak_mb = _peak_mb()

    def __call__(self, data: bytes) -> None:
        began_s = time.process_time()
        self._inputs += 1
        try:
            self._take(data)
        except self._allowed:
            pass
        except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
            self._tracebacks += 1
            self._keep("traceback", _place(error), data)
        taken_s = time.process_time() - began_s
        self._slowest_s = max(self._slowest_s, taken_s)
        if taken_s > _SLOW_S:
            self._slow += 1
            self._keep("slow", f"{taken_s:.1f} s", data)
        self._look(data)

    def _look(self, data: bytes) -> None:
        if self._inputs % 64 == 0 or self._inputs >= self._chosen.inputs:
            peak_mb = _peak_mb()
            if peak_mb > max(_MOST_MB, self._peak_mb + 20):
                self._keep("memory", f"{peak_mb:.0f} MB by one of 64", data)
            self._peak_mb = peak_mb
            over_s = time.monotonic() - self._began_s
            if self._inputs >= self._chosen.inputs or over_s > self._chosen.seconds:
                self._end(over_s)

    def _keep(self, kind: str, place: str, data: bytes) -> None:
        key = f"{kind}: {place}"
        self._places[key] = self._places.get(key, 0) + 1
        self._first.setdefault(key, self._inputs)
        if self._places[key] <= _KEPT:
            folder = self._chosen.found / self._name.replace(" ", "_").replace(",", "")
            folder.mkdir(parents=True, exist_ok=True)
            name = f"{kind}-{hashlib.sha256(data).hexdigest()[:12]}"
            (folder / name).write_bytes(data)
            with open(folder / "places.txt", "a", encoding="utf-8") as file:
                file.write(f"{name}: {place}\n")

    def _end(self, over_s: float) -> None:
        told = {
            "inputs": self._inputs, "seconds": over_s, "tracebacks": self._tracebacks,
            "slow": self._slow, "slowest_s": self._slowest_s, "mb": self._peak_mb,
            "places": self._places, "first": self._first,
        }  # fmt: skip
        self._chosen.told.write_text(json.dumps(told))
        os._exit(0)  # libFuzzer would go on


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _place(error: BaseException) -> str:
    """The kind of an error, and the last line of mopro that it went through."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "/mopro/" in f.filename] or frames
    where = own[-1]
    name = where.filename.partition("/mopro/")[2] or where.filename
    return f"{type(error).__name__} at {name}:{where.lineno}"


def _fuzz(chosen: argparse.Namespace) -> None:
    """Fuzz one parser until its inputs or seconds are over; does not return."""
    import atheris

    parser = PARSERS[chosen.only]
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_ADDRESSES, _MOST_ADDRESSES))
    with atheris.instrument_imports(include=["mopro"], exclude=_others(parser)):
        for name in parser.modules:
            __import__(name)
        watched = Watched(parser, chosen, chosen.corpus.parent / "files")
    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    words = chosen.corpus.parent / "words"
    words.write_text("".join(f'"{_escaped(word)}"\n' for word in parser.words if word))
    settings = [f"-dict={words}"] if parser.words else []
    settings += [f"-max_len={parser.longest}", f"-seed={chosen.seed}", f"-timeout={_HANG_S}"]
    settings += ["-rss_limit_mb=0", "-print_pcs=0"]

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        own = Random(seed)
        if parser.change is not None and own.random() < _CHANGED:
            data = parser.change(own, data)[:most]
            if own.random() < _CHANGED:
                return data
        return atheris.Mutate(data, most)

    arguments = [sys.argv[0], str(chosen.corpus), *settings]
    atheris.Setup(arguments, watched, custom_mutator=mutate)
    atheris.Fuzz()


def _others(parser: Parser) -> list[str]:
    """The modules that do not guide the search: without counters they are faster."""
    package = ROOT / "mopro"
    parts = (path.relative_to(ROOT).with_suffix("").parts for path in package.rglob("*.py"))
    names = {".".join(part for part in own if part != "__init__") for own in parts}
    return sorted(name for name in names if not name.startswith(parser.modules))


def _escaped(word: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in word.encode("utf-8"))


# -- the lines that a corpus reaches -----------------------------------------------


def _reached(chosen: argparse.Namespace) -> None:
    """Print the share of the lines in the functions of the parser's modules, in percent."""
    parser = PARSERS[chosen.only]
    take = parser.make(chosen.corpus.parent / "files")
    for name in parser.modules:
        __import__(name)
    modules = [m for n, m in sys.modules.items() if n.startswith(parser.modules)]
    every = {line for module in modules for line in _lines(module)}
    files = {file for file, _ in every}
    seen: set[tuple[str, int]] = set()

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., object] | None:
        file = frame.f_code.co_filename
        if file not in files:
            return None
        seen.add((file, frame.f_lineno))
        return trace

    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    threading.settrace(trace)
    sys.settrace(trace)
    end_s = time.monotonic() + chosen.seconds
    for path in sorted(chosen.corpus.iterdir(), key=lambda p: p.stat().st_size):
        with suppress(Exception):
            take(path.read_bytes())
        if time.monotonic() > end_s:
            break
    sys.settrace(None)
    threading.settrace(None)  # type: ignore[arg-type]
    chosen.told.write_text(json.dumps({"lines": 100 * len(seen & every) / max(len(every), 1)}))
    os._exit(0)


def _lines(module: ModuleType) -> set[tuple[str, int]]:
    """The lines with code in the functions of a module."""
    file = module.__file__
    if not file or not file.endswith(".py"):
        return set()
    code = compile(Path(file).read_text("utf-8"), file, "exec")
    return {(file, line) for inner in _functions(code) for line in _own_lines(inner)}


def _own_lines(code: CodeType) -> set[int]:
    """The lines that a trace of the function shows: the first is that of `def`."""
    return {
        line for _, _, line in code.co_lines() if line is not None and line > code.co_firstlineno
    }


def _functions(code: CodeType) -> list[CodeType]:
    """The functions in a code; the bodies of classes are none, they run on import."""
    inner = [part for part in code.co_consts if isinstance(part, CodeType)]
    own = [part for part in inner if part.co_flags & 0x1]  # CO_OPTIMIZED
    return own + [deeper for part in inner for deeper in _functions(part)]


# -- the campaign ------------------------------------------------------------------


def _shares(names: list[str], inputs: int) -> dict[str, int]:
    """The inputs of each parser: a least number, and the rest by their shares."""
    least = min(_LEAST, inputs // len(names))
    rest = inputs - least * len(names)
    weights = {name: PARSERS[name].share - 1 for name in names}
    total = sum(weights.values()) or 1
    shares = {name: least + rest * weight // total for name, weight in weights.items()}
    return {name: min(share, PARSERS[name].most or share) for name, share in shares.items()}


def _campaign_of(name: str, inputs: int, seconds: float, chosen: argparse.Namespace) -> dict:
    """Result of one parser, as its process reports it."""
    home = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=home) as made:
        folder = Path(made)
        corpus = folder / "corpus"
        corpus.mkdir()
        (folder / "files").mkdir()
        for number, seed in enumerate(PARSERS[name].starts()):
            (corpus / f"{number:03}").write_bytes(seed)
        log, told = folder / "log", folder / "told"
        found = {
            "inputs": 0,
            "seconds": 0.0,
            "tracebacks": 0,
            "slow": 0,
            "slowest_s": 0.0,
            "mb": 0.0,
        }
        own = ["--inputs", inputs, "--seconds", seconds, "--corpus", corpus, "--told", told]
        code = _process(["--only", name, *own, "--seed", chosen.seed, "--found", chosen.found], log)
        if told.exists():
            found = json.loads(told.read_text())
            told.unlink()
        else:
            found["broken"] = f"ended with {code}: " + log.read_text(errors="replace")[-600:]
            for path in folder.glob("*-*"):
                (chosen.found / path.name).write_bytes(path.read_bytes())
        _process(["--only", name, "--reached", *own[:2], "--seconds", 15, *own[4:]], log)
        return found | (json.loads(told.read_text()) if told.exists() else {"lines": 0.0})


def _process(args: list[object], log: Path) -> int:
    command = [sys.executable, __file__, *map(str, args)]
    with open(log, "wb") as file:
        return subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, cwd=log.parent, check=False
        ).returncode


def _row(name: str, found: dict) -> str:
    rate = found["inputs"] / max(found["seconds"], 1e-9)
    cells = (
        f"{found['inputs']:,}", f"{rate:,.0f}", found["tracebacks"], found["slow"],
        f"{1e3 * found['slowest_s']:.0f}", f"{found['mb']:.0f}", f"{found['lines']:.0f} %",
    )  # fmt: skip
    return f"{name:32}" + "".join(f"{cell!s:>12}" for cell in cells)


def _failed(found: dict) -> bool:
    broken = "broken" in found or found["mb"] > _MOST_MB
    return bool(broken or found["tracebacks"] or found["slow"])


def _campaign(chosen: argparse.Namespace) -> int:
    names = [n for n in PARSERS if not chosen.parsers or any(p in n for p in chosen.parsers)]
    end_s = time.monotonic() + 60 * chosen.minutes
    print(f"{_COLUMNS[0]:32}" + "".join(f"{title:>12}" for title in _COLUMNS[1:]), flush=True)
    every: list[dict] = []
    for name, inputs in _shares(names, chosen.inputs).items():
        seconds = min(chosen.each, max(5.0, end_s - time.monotonic()))
        found = _campaign_of(name, inputs, seconds, chosen)
        every.append(found)
        print(_row(name, found), flush=True)
        for place, count in found.get("places", {}).items():
            print(f"    {count} × {place}, first at input {found['first'][place]:,}", flush=True)
        if "broken" in found:
            print(f"    {found['broken']}", flush=True)
    total = {key: sum(f[key] for f in every) for key in ("inputs", "seconds", "tracebacks", "slow")}
    total |= {key: max(f[key] for f in every) for key in ("slowest_s", "mb")}
    total["lines"] = sum(f["lines"] for f in every) / len(every)
    print(_row("all (the largest, the mean)", total))
    return int(any(map(_failed, every)))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--inputs", type=int, default=1_000_000, help="of all parsers together")
    parser.add_argument("--minutes", type=float, default=60.0, help="of all parsers together")
    parser.add_argument("--each", type=float, default=math.inf, help="seconds of one parser")
    parser.add_argument("--seed", type=int, default=1992)
    parser.add_argument("--found", type=Path, default=Path("fuzz-found"))
    parser.add_argument("parsers", nargs="*", help="those whose name has one of these in it")
    for name in ("--only", "--seconds", "--corpus", "--told"):
        kind = {"--only": str, "--seconds": float}.get(name, Path)
        parser.add_argument(name, type=kind, help=argparse.SUPPRESS)
    parser.add_argument("--reached", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    chosen.found = chosen.found.resolve()
    if chosen.only is None:
        chosen.found.mkdir(parents=True, exist_ok=True)
        return _campaign(chosen)
    (_reached if chosen.reached else _fuzz)(chosen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
