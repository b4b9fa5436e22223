"""A parser to be fuzzed, its seeds, and changes of an input at random."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from helpers.paths import ROOT

Take = Callable[[bytes], object]
Change = Callable[[Random, bytes], bytes]


@dataclass(frozen=True)
class Parser:
    """`make` gives, for a folder of its own, the function that takes an input.

    That function returns or raises what `allowed` has; anything else is a finding. `modules`
    are those whose lines count as its coverage. `share` is its part of a campaign's inputs;
    `most` bounds those of a parser that has to start a process for each. `change` puts what no
    search guided by lines would make, such as long numbers, into an input.
    """

    name: str
    modules: tuple[str, ...]
    make: Callable[[Path], Take]
    seeds: Callable[[], Iterable[bytes]]
    words: tuple[str, ...] = ()
    share: int = 1
    longest: int = 2048
    most: int | None = None
    change: Change | None = None

    def starts(self) -> list[bytes]:
        """The seeds, cut to the longest input."""
        return [seed[: self.longest] for seed in self.seeds()]

    def varied(self, random: Random, data: bytes) -> bytes:
        """`data` changed at random, every other time by the parser's own change first."""
        if self.change is not None and random.random() < 0.5:
            data = self.change(random, data)
        return changed(random, data, self.words, self.longest)


def allowed() -> tuple[type[BaseException], ...]:
    """Errors that a parser may raise: the project's, and those of the command line."""
    import click

    from mopro.errors import MoproError

    # A MemoryError ends a command with `no-memory`; the campaign tells memory by itself.
    return MoproError, click.ClickException, click.exceptions.Exit, click.Abort, MemoryError


def files(*patterns: str) -> list[bytes]:
    """The contents of the repository's files that match one of `patterns`."""
    found = (path for pattern in patterns for path in sorted(ROOT.glob(pattern)))
    return [path.read_bytes() for path in found if path.is_file()]


def in_file(folder: Path, name: str, read: Callable[[Path], object]) -> Take:
    """The function that writes its input to the file `name` and has it read."""
    path = folder / name

    def take(data: bytes) -> None:
        path.write_bytes(data)
        read(path)

    return take


def changed(random: Random, data: bytes, words: tuple[str, ...], longest: int) -> bytes:
    """`data` with one to four random changes: bytes, words, pieces doubled or left out."""
    own = bytearray(data)
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(own) + 1)
        kind = random.randrange(5)
        if kind == 0 and own:
            own[at % len(own)] ^= 1 << random.randrange(8)
        elif kind == 1:
            own[at:at] = random.randbytes(random.randrange(1, 5))
        elif kind == 2 and words:
            own[at : at + random.randrange(4)] = random.choice(words).encode()
        elif kind == 3:
            del own[at : at + random.randrange(1, 20)]
        else:
            own[at:at] = own[: random.randrange(60)]
    return bytes(own[:longest])
