"""Time of a flash against the least that its line allows.

    python bench/link_throughput.py [--statements 2000] [--baud 9600 115200] [--wall]

The line's limit is the time in which the bytes of the busier direction can cross it, for
each of the passes that follow one another (up, back, back once more); the bytes are those
that went over the wire. In simulated time by default; with --wall over a real
pseudo-terminal, against `mopro serve` as a process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

from mopro.controller import LoopbackPort, Station
from mopro.emulator import Emulator
from mopro.link import Port, SerialPort, Session, builtin_dialects, load_dialect
from mopro.link.flash import allowed_s, upload, verify
from mopro.machine import load_machine
from mopro.program import Program
from mopro.program.compile import compile as compile_text

BAUDS = (9600, 115200)


@dataclass
class CountedPort:
    """Counts the bytes each way."""

    port: Port
    out: int = 0
    back: int = 0

    def now_s(self) -> float:
        return self.port.now_s()

    def write(self, data: bytes) -> None:
        self.out += len(data)
        self.port.write(data)

    def read(self, until_s: float) -> bytes:
        data = self.port.read(until_s)
        self.back += len(data)
        return data

    def close(self) -> None:
        self.port.close()

    def mark(self) -> tuple[float, int, int]:
        return self.now_s(), self.out, self.back


def program_of(statements: int) -> Program:
    """Settings, and then strokes there and back until the count is reached."""
    lines = ["UU012500/1", "VEL0 40.0", "ACC0 0.25"]
    lines += [
        f"MRI1 {'-' * (n % 4 > 1)}{1 + n % 7}.5" if n % 2 == 0 else "WX1"
        for n in range(statements - len(lines))
    ]
    return compile_text("\n".join(lines) + "\n", "long.CMD")


@contextmanager
def connected(dialect: str, baud: int, wall: bool) -> Iterator[CountedPort]:
    language = load_dialect(dialect)
    if not wall:
        yield CountedPort(
            LoopbackPort(Station(language, Emulator(load_machine("chow1992")), baud=baud))
        )
        return
    command = [sys.executable, "-m", "mopro", "serve", "--dialect", dialect, "--baud", str(baud)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None, "asked for"
        port = CountedPort(SerialPort(server.stdout.readline().strip(), language.line, baud))
        yield port
        port.close()
        server.terminate()


def measure(dialect: str, baud: int, program: Program, wall: bool) -> tuple[float, float, float]:
    """Seconds for the whole flash, at best, and for the program's own bytes once."""
    with connected(dialect, baud, wall) as port:
        session = Session(port, load_dialect(dialect), baud=baud)
        session.open()
        session.give(allowed_s(session, program))
        marks = [port.mark()]
        scratch, main = session.dialect.names.scratch, session.dialect.names.main
        upload(
            session, program, scratch, lambda n: marks.__setitem__(slice(1, None), [port.mark()])
        )
        marks.append(port.mark())
        session.ask("commit", scratch=scratch, name=main)
        verify(session, program, main)
        marks.append(port.mark())
    passes = [max(b[1] - a[1], b[2] - a[2]) * session.byte_s for a, b in pairwise(marks)]
    text = sum(len(line) + 1 for line in program.source.lines)
    return marks[-1][0] - marks[0][0], sum(passes), text * session.byte_s


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--statements", type=int, default=2000)
    parser.add_argument("--wall", action="store_true")
    parser.add_argument("--baud", type=int, nargs="+", default=BAUDS)
    chosen = parser.parse_args()
    program = program_of(chosen.statements)
    clock = "wall time over a pty" if chosen.wall else "simulated time"
    print(f"flash of {len(program.ops)} statements, {clock}")
    print("dialect    baud   flash (s)   line's limit (s)   share of limit   bare text once (s)")
    for dialect in builtin_dialects():
        for baud in chosen.baud:
            took_s, limit_s, text_s = measure(dialect, baud, program, chosen.wall)
            share = f"{limit_s / took_s:.1%}"
            print(f"{dialect:8} {baud:6} {took_s:11.3f} {limit_s:18.3f} {share:>16} {text_s:20.3f}")


if __name__ == "__main__":
    main()
