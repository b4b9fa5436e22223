"""Pages of the docs, executed: their commands, snippets and files, in the order of the page.

A fenced block is told by its language and the options after it:

    ```sh            commands (mopro, cd, cp, mkdir), each ending with 0, or with `exit=1`
    ```python        executed; names stay for the blocks after it
    ```toml file=x   (any language) written to the file x; `mode=append` adds to it
    ```text          what the block before printed: these lines in this order, numbers to 5 %,
                     `...` for any words
    ```sh not-run="a serial port"   a mark: shown, and not executed
"""

import contextlib
import io
import json
import math
import re
import shlex
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

import mopro
from helpers.commands import run_here
from helpers.paths import ROOT

_FENCE = re.compile(r"^```([\w+-]*)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NEEDED = ("programs", "docs/data")
_MARK = "not-run"
_TOLERANCE = 0.05


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, options, text, and the line of the page it begins at."""

    language: str
    options: dict[str, str]
    text: str
    line: int

    @property
    def marked(self):
        """True for a block that is shown only."""
        return _MARK in self.options


def blocks_of(page, expanded=str):
    """The fenced blocks of the Markdown in file `page`, in order, with what is generated in it."""
    text = expanded(page.read_text("utf-8"))
    found = []
    for match in _FENCE.finditer(text):
        words = [word.partition("=") for word in shlex.split(match[2])]
        options = {key: value for key, _, value in words}
        found.append(Block(match[1], options, match[3], text[: match.start()].count("\n") + 1))
    return found


def _alike(shown, said):
    """True if the words are the same, numbers to 5 %; `...` stands for any words."""
    if not shown or not said:
        return not said if shown in ([], ["..."]) else False
    if shown[0] == "...":
        return any(_alike(shown[1:], said[start:]) for start in range(len(said) + 1))
    return _same(shown[0], said[0]) and _alike(shown[1:], said[1:])


def _same(shown, said):
    if shown == said:
        return True
    try:
        return math.isclose(float(shown), float(said), rel_tol=_TOLERANCE)
    except ValueError:
        return False


class Reader:
    """A person who follows a page in a folder of their own, which has what the checkout has."""

    def __init__(self, folder):
        self.folder = self.here = Path(folder)
        self.names = {}
        self.said = ""
        self.executed = 0
        for part in _NEEDED:
            shutil.copytree(ROOT / part, self.folder / part)

    def follow(self, blocks):
        """Execute `blocks`; AssertionError, with the line of the page, where one fails."""
        for block in blocks:
            if block.marked:
                self.said = None
                continue
            act = getattr(self, f"_{block.language}", None)
            assert act or "file" in block.options, f"line {block.line}: unknown {block.language}"
            if "file" in block.options:
                mode = "a" if block.options.get("mode") == "append" else "w"
                with open(self.here / block.options["file"], mode, encoding="utf-8") as file:
                    file.write(block.text)
            else:
                act(block)
            self.executed += 1

    def _sh(self, block):
        self.said = ""
        text = block.text.replace("\\\n", " ")
        codes = block.options.get("exit", "0").split(",")
        commands = [
            words for line in text.splitlines() if (words := shlex.split(line, comments=True))
        ]
        for number, words in enumerate(commands):
            code = int(codes[min(number, len(codes) - 1)])
            self._command(words, code, block.line)

    def _command(self, words, code, line):
        name, *arguments = [part for word in words for part in self._expanded(word)]
        if name == "mopro":
            done = run_here(self.here, *arguments)
            told = f"page line {line}: {shlex.join(words)}\n{done.stdout}{done.stderr}"
            assert done.returncode == code, f"{told}\nended with {done.returncode}, not {code}"
            self.said += done.stdout + done.stderr
        elif name == "cd":
            self.here = (self.here / arguments[0]).resolve()
            assert self.here.is_relative_to(self.folder.resolve()), (
                f"line {line}: leaves the folder"
            )
        elif name == "mkdir":
            (self.here / arguments[-1]).mkdir(parents=True)
        elif name == "cp":
            shutil.copy(self.here / arguments[0], self.here / arguments[1])
        else:
            raise AssertionError(f"line {line}: {name} is no command that a page may use")

    def _expanded(self, word):
        if "*" not in word:
            return [word]
        return sorted(str(path.relative_to(self.here)) for path in self.here.glob(word)) or [word]

    def _python(self, block):
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.chdir(self.here):
            exec(compile(block.text, f"<page line {block.line}>", "exec"), self.names)
        self.said = said.getvalue()

    def _text(self, block):
        if self.said is None:
            return
        lines = iter(self.said.splitlines())
        for line in block.text.splitlines():
            if line.strip(" ─"):
                found = any(_alike(line.split(), said.split()) for said in lines)
                assert found, f"page line {block.line}: not said, or not in this order: {line}"

    def _toml(self, block):
        tomllib.loads(block.text)

    def _csv(self, block):
        assert len({row.count(",") for row in block.text.splitlines()}) == 1

    def _json(self, block):
        json.loads(block.text)

    def _yaml(self, block):
        import yaml

        yaml.safe_load(block.text)

    def _CMD(self, block):
        mopro.compile(block.text)
