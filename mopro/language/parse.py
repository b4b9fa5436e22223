"""Text to tree; the only importer of lark.

Each line is parsed by itself and each distinct line only once. A fault ends its line,
not the file.
"""

from __future__ import annotations

import hashlib
import io
import re
import sys
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import NamedTuple

from lark import Lark, Token, Tree, UnexpectedCharacters, UnexpectedInput, UnexpectedToken
from lark import __version__ as lark_version

from mopro.errors import DataError, Diagnostic, SourceError
from mopro.language import ast
from mopro.language.load import until_end_of_file
from mopro.process.cachefolder import cache_folder, read_kept, with_digest
from mopro.process.garbage import garbage_left
from mopro.source import Source, Span

GRAMMARS = {"attested": "mopro.lark", "extended": "mopro_extended.lark"}

MOST_DIGITS = 30

# How messages call what may stand at a place, in the order in which they name it.
_WORDS = {
    "AXIS": "an axis digit (0 for all axes)",
    "NUMBER": "a plain decimal number",
    "WHOLE": "a whole number",
    "_SLASH": "a slash",
    "SWITCH": "+ or -",
    "NAME": "a label name",
}
_END_OF_LINE = "the end of the line"
# The blanks are those of the grammar: Python takes more characters for white space.
_BLANKS = " \t\f\v"
_WORD = re.compile(rf"[^{_BLANKS};]+")
_LETTERS = re.compile(r"[A-Za-z]*")
_WAIT_WITH_UNIT = re.compile(
    r"\s*([A-Za-z]+)\s*([0-9]+\.?[0-9]*|\.[0-9]+)\s*(ms|s|sec)?\s*(?:;.*)?", re.ASCII | re.I
)
# A wait with a fraction, if it is shorter, was meant in seconds.
_MOST_SECONDS = 60
# `MRI 5`: the number was read as the axis, and no value follows.
_AXIS_FORGOTTEN = re.compile(r"\s*[A-Za-z]+\s+([+-]?[0-9])\s*(?:;.*)?", re.ASCII)
_COMMENT_MARKS = ("#", "//", "/*", "--", "%")
_JUMPS = ("GOTO", "JMP", "BRANCH", "LOOP")
_QUOTES = "`\"'“‘«"
_AXIS_LEFT_OUT = re.compile(r"\s*[A-Za-z]+\s+[+-]?([0-9]{2}|[0-9]?\.)")


def parse(source: Source, grammar: str = "attested") -> ast.Tree:
    """The tree of `source`; SourceError with the findings of all lines.

    `grammar` is a key of `GRAMMARS`.
    """
    tree, faults = parse_what_can_be(source, grammar)
    if not tree.statements and not faults:
        hint = None if tree.source.cut is None else f"it ends at the Ctrl-Z in {tree.source.cut}"
        message = "the program has no statement"
        faults = [Diagnostic("empty-program", message, Span(1, 1, 1), hint=hint)]
    if faults:
        raise SourceError(tree.source, faults)
    return tree


def parse_what_can_be(
    source: Source, grammar: str = "attested"
) -> tuple[ast.Tree, list[Diagnostic]]:
    """The tree of the lines without a fault, which may be none, and the faults of the others."""
    reader, source = _reader(grammar), until_end_of_file(source)
    statements: list[ast.Statement] = []
    comments: list[ast.Comment] = []
    faults: list[Diagnostic] = []
    with garbage_left():
        for number, text in enumerate(source.lines, start=1):
            before, mark, after = text.partition(";")
            shape = reader.quick(before)
            if shape is not None:
                statements.append(shape.at(number))
            elif before.strip(_BLANKS):
                line = reader.by_lark(text)
                if line.fault is not None:
                    faults.append(line.fault.at(number))
                if line.statement is not None:
                    statements.append(line.statement.at(number))
                if not line.parsed:
                    continue
            if mark:
                span = Span(number, len(before) + 1, len(text) + 1)
                comments.append(ast.Comment(span, mark + after))
    return ast.Tree(source, tuple(statements), tuple(comments)), faults


def is_statement(text: str) -> bool:
    """True if `text` is a statement of either grammar, with a comment or without."""
    reader, before = _reader("extended"), text.partition(";")[0]
    if reader.quick(before) is not None:
        return True
    if _mnemonic_of(before) not in reader.mnemonics:
        return False
    return reader.by_lark(text).statement is not None


@cache
def statement_kinds(grammar: str) -> list[type[ast.Statement]]:
    """The statements of `grammar`: the alternatives of `_statement` in its file."""
    rules = _parser(grammar).rules
    names = {rule.expansion[0].name for rule in rules if rule.origin.name == "_statement"}
    return [kind for name, kind in ast.STATEMENTS.items() if name in names]


def grammar_path(file: str) -> Path:
    """The grammar file, in the installed package or in the checkout beside it."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "grammars" / file
    return installed if installed.is_file() else package.parent / "grammars" / file


class _StatementShape(NamedTuple):
    """A statement but for its line number."""

    kind: type[ast.Statement]
    column: int
    end_column: int
    operands: tuple[ast.Operand, ...]

    def at(self, line: int) -> ast.Statement:
        return self.kind(Span(line, self.column, self.end_column), *self.operands)


@dataclass(frozen=True, slots=True)
class _FaultShape:
    """A finding but for its line number."""

    rule: str
    message: str
    columns: ast.Operand
    hint: str | None = None

    def at(self, line: int) -> Diagnostic:
        return Diagnostic(self.rule, self.message, self.columns.span(line), hint=self.hint)


@dataclass(frozen=True, slots=True)
class _Line:
    """A line as lark reads it; `parsed` is false where its parts, and so a comment, are unknown."""

    statement: _StatementShape | None = None
    fault: _FaultShape | None = None
    parsed: bool = True


@cache
def _parser(grammar: str) -> Lark:
    """The parser of `grammar`, from the user's cache where it is kept there.

    Making it takes longer than all else that a short program needs. It is kept as a pickle,
    which is read only if it is this user's, whole, and was made of these very grammars by
    this version of mopro, lark and Python.
    """
    folder = cache_folder()
    if folder is None:
        return _made_parser(grammar)
    kept = folder / f"{grammar}-{_origin()}.parser"
    data = read_kept(kept)
    if data is not None:
        return Lark.load(io.BytesIO(data))
    made, pickled = _made_parser(grammar), io.BytesIO()
    made.save(pickled)
    from mopro.files import write

    with suppress(DataError):  # a full or read-only cache: made anew the next time
        write(kept, with_digest(pickled.getvalue()))
    return made


def _origin() -> str:
    """A digest of all that a kept parser depends on."""
    files = [Path(__file__), *map(grammar_path, GRAMMARS.values())]
    texts = [file.read_bytes() for file in files]
    return hashlib.sha256(repr((texts, lark_version, sys.version)).encode()).hexdigest()[:24]


def _made_parser(grammar: str) -> Lark:
    path = grammar_path(GRAMMARS[grammar])
    return Lark(
        path.read_text("ascii"),
        parser="lalr",
        start="line",
        propagate_positions=True,
        maybe_placeholders=False,
        import_paths=[str(path.parent)],
    )


class _Reader(NamedTuple):
    """Functions that read lines of one grammar and remember past ones.

    `quick` reads what stands before a comment, if it is a statement as the grammar has it; the
    others are left to `by_lark`, which takes the whole line. A statement begins with one of
    `mnemonics`, by their first two characters.
    """

    quick: Callable[[str], _StatementShape | None]
    by_lark: Callable[[str], _Line]
    mnemonics: Collection[str]


@cache
def _reader(grammar: str) -> _Reader:
    forms = _forms(grammar)
    quick, by_lark = partial(_read_quickly, forms), partial(_read_by_lark, grammar)
    remember = lru_cache(maxsize=4096)
    return _Reader(remember(quick), lru_cache(maxsize=4096)(by_lark), forms)


def _read_by_lark(grammar: str, text: str) -> _Line:
    try:
        tree = _parser(grammar).parse(text)
    except UnexpectedInput as unexpected:
        fault = _explain(text, unexpected, statement_kinds(grammar))
        return _Line(fault=fault, parsed=False)
    return _shape_of(tree)


class _Form(NamedTuple):
    """One way to write a statement: its text as a pattern, and how its operands are read.

    The first group is the statement; `operands` are the numbers of theirs.
    """

    kind: type[ast.Statement]
    pattern: re.Pattern[str]
    operands: tuple[tuple[int, Callable[[str, int], ast.Operand]], ...]

    def read(self, text: str) -> _StatementShape | None:
        """The statement of this form that `text` is; None for another, and for what is too long."""
        match = self.pattern.fullmatch(text)
        if match is None:
            return None
        places = match.regs
        operands = []
        for group, make in self.operands:
            begin, end = places[group]
            if end - begin > MOST_DIGITS:
                return None
            operands.append(make(text[begin:end], begin + 1))
        begin, end = places[1]
        return _StatementShape(self.kind, begin + 1, end + 1, tuple(operands))


def _forms(grammar: str) -> dict[str, tuple[_Form, ...]]:
    """The forms of all statements by the first two characters of their mnemonics.

    Each rule of a statement is a row of terminals, and so a pattern; a terminal takes what it can
    and gives nothing back, as lark's lexer does.
    """
    lark = _parser(grammar)
    terminals = {t.name: f"(?>{t.pattern.to_regexp()})" for t in lark.terminals}
    forms: dict[str, list[_Form]] = {}
    for rule in sorted(lark.rules, key=lambda rule: len(rule.expansion)):
        kind = ast.STATEMENTS.get(rule.origin.name)
        if kind is None:
            continue
        names = [symbol.name for symbol in rule.expansion]
        own = {f"o{place}": name for place, name in enumerate(names) if not name.startswith("_")}
        row = [
            f"(?P<o{place}>{terminals[name]})" if f"o{place}" in own else terminals[name]
            for place, name in enumerate(names)
        ]
        blank = f"(?:{terminals['_SPACE']})?"
        pattern = re.compile(f"{blank}({''.join(row)}){blank}")
        operands = ((pattern.groupindex[o], _OPERANDS[name]) for o, name in own.items())
        form = _Form(kind, pattern, tuple(operands))
        forms.setdefault(_mnemonic_of(kind.mnemonic()), []).append(form)
    return {begin: tuple(of) for begin, of in forms.items()}


def _mnemonic_of(text: str) -> str:
    """The first two characters of the mnemonic that `text` begins with, in capitals."""
    begin = text.lstrip(_BLANKS)[:2]
    return ":" if begin[:1] == ":" else begin.upper()


def _read_quickly(forms: dict[str, tuple[_Form, ...]], text: str) -> _StatementShape | None:
    for form in forms.get(_mnemonic_of(text), ()):
        shape = form.read(text)
        if shape is not None:
            return shape
    return None


def _shape_of(tree: Tree[Token]) -> _Line:
    """The statement of one line, if any, from lark's tree."""
    statement = fault = None
    for child in tree.children:
        if isinstance(child, Token):
            continue
        tokens = [token for token in child.children if isinstance(token, Token)]
        fault = fault or next((f for f in map(_overlong, tokens) if f), None)
        if fault is None:
            operands = (_OPERANDS[token.type](str(token), token.column or 1) for token in tokens)
            statement = _StatementShape(
                ast.STATEMENTS[child.data],
                child.meta.column,
                child.meta.end_column,
                tuple(operands),
            )
    return _Line(statement, fault)


def _columns(token: Token) -> ast.Operand:
    column = token.column or 1
    return ast.Operand(column, column + len(token))


def _overlong(token: Token) -> _FaultShape | None:
    if len(token) <= MOST_DIGITS:
        return None
    message = f"`{token[:8]}...` has {len(token)} characters: expected at most {MOST_DIGITS}"
    return _FaultShape("too-long", message, _columns(token))


@lru_cache(maxsize=256)
def _axis(text: str, column: int) -> ast.Axis:
    letter = text in ("O", "o")
    return ast.Axis(column, column + 1, 0 if letter else int(text), letter)


def _number(text: str, column: int) -> ast.Number:
    whole, _, decimals = text.partition(".")
    value = Fraction(int(whole + decimals), 10 ** len(decimals))
    return ast.Number(column, column + len(text), value)


def _whole(text: str, column: int) -> ast.Whole:
    return ast.Whole(column, column + len(text), int(text))


def _switch(text: str, column: int) -> ast.Switch:
    return ast.Switch(column, column + 1, text == "+")


def _name(text: str, column: int) -> ast.Name:
    return ast.Name(column, column + len(text), text)


# The operand that a terminal's text at a column is.
_OPERANDS: dict[str, Callable[[str, int], ast.Operand]] = {
    "AXIS": _axis,
    "NUMBER": _number,
    "WHOLE": _whole,
    "SWITCH": _switch,
    "NAME": _name,
}


def _explain(
    text: str, unexpected: UnexpectedInput, known: list[type[ast.Statement]]
) -> _FaultShape:
    """Lark's complaint about a line in the words of the language."""
    first = _WORD.search(text)
    assert first is not None, "a line without a word parses"
    mnemonics = {kind.mnemonic(): kind for kind in known if kind is not ast.Label}
    letters = _mnemonic_letters(first[0])
    stem = letters if letters in mnemonics else letters.removesuffix("O")
    if first[0].startswith(":"):
        kind: type[ast.Statement] = ast.Label
    elif stem in mnemonics:
        kind = mnemonics[stem]
    else:
        return _unknown_mnemonic(first, list(mnemonics))
    form = f"such a statement is written `{kind.form}`"
    slip = _slip(text, first, stem, kind)
    if slip is not None:
        return slip
    if _AXIS_LEFT_OUT.match(text) and " " in kind.form:
        columns = ast.Operand(first.start() + 1, first.end() + 1)
        message = f"expected {_WORDS['AXIS']} right after {stem}"
        return _FaultShape("missing-axis", message, columns, form)
    place = _place_of(text, unexpected)
    expected = _expected_words(unexpected)
    found = _WORD.match(text, place)
    if found is None:
        columns = ast.Operand(place + 1, place + 1)
        message = f"expected {expected}, found {_END_OF_LINE}"
        return _FaultShape("incomplete-statement", message, columns, form)
    columns = ast.Operand(place + 1, found.end() + 1)
    number = _number_spoilt_at(text, place, found.end())
    if number is not None:
        columns = ast.Operand(number.start() + 1, number.end() + 1)
        message = f"expected {_WORDS['NUMBER']}, found `{number[0]}`"
        return _FaultShape("bad-number", message, columns, form)
    rule = "bad-number" if _WORDS["NUMBER"] in expected else "unexpected-text"
    return _FaultShape(rule, f"expected {expected}, found `{found[0]}`", columns, form)


def _slip(
    text: str, first: re.Match[str], stem: str, kind: type[ast.Statement]
) -> _FaultShape | None:
    """The fault of a wait with a unit, or of a motion without its axis."""
    wait = _WAIT_WITH_UNIT.fullmatch(text)
    if kind is ast.Dwell and wait is not None and (wait[3] or Fraction(wait[2]) < _MOST_SECONDS):
        unit = wait[3] or ""
        ms = Fraction(wait[2]) * (1 if unit.lower() == "ms" else 1000)
        columns = ast.Operand(wait.start(2) + 1, max(wait.end(2), wait.end(3)) + 1)
        message = f"expected a whole number of milliseconds, found `{wait[2]}{unit}`"
        return _FaultShape("bad-number", message, columns, f"write `WT{round(ms)}`")
    number = _AXIS_FORGOTTEN.fullmatch(text)
    if "1 " in kind.form and number is not None:
        columns = ast.Operand(first.start() + 1, first.end() + 1)
        message = f"expected {_WORDS['AXIS']} right after {stem}, and then a value"
        hint = f"for axis 1 write `{stem}1 {number[1]}`"
        return _FaultShape("missing-axis", message, columns, hint)
    return None


def _other_words(word: str, rest: str) -> str | None:
    """Statement to write in place of another language's word, or of quotes around a statement."""
    if word.startswith(_COMMENT_MARKS) or word.upper() == "REM":
        return "a comment begins with `;`"
    if word.upper() in _JUMPS:
        return f"write `JUMP {rest}`" if rest else "write `JUMP` and a label"
    if word[0] in _QUOTES:
        return "write the statement without quotes"
    return None


def _unknown_mnemonic(first: re.Match[str], mnemonics: list[str]) -> _FaultShape:
    letters = _mnemonic_letters(first[0])
    columns = ast.Operand(first.start() + 1, first.end() + 1)
    near = _nearest(letters, tuple(mnemonics))
    hint = f"did you mean `{near}`?" if near else f"known are {', '.join(sorted(mnemonics))}"
    hint = _other_words(first[0], first.string[first.end() :].strip()) or hint
    if letters in (kind.mnemonic() for kind in statement_kinds("extended")):
        hint = f"{letters} is an assumed statement: it needs --grammar extended"
    message = f"`{first[0]}` begins no statement of the language"
    return _FaultShape("unknown-mnemonic", message, columns, hint)


@lru_cache(maxsize=256)
def _nearest(letters: str, mnemonics: tuple[str, ...]) -> str | None:
    from difflib import get_close_matches

    return next(iter(get_close_matches(letters, mnemonics, n=1, cutoff=0.5)), None)


def _mnemonic_letters(text: str) -> str:
    """The letters that `text` begins with, in capitals."""
    match = _LETTERS.match(text)
    return match[0].upper() if match else ""


def _place_of(text: str, unexpected: UnexpectedInput) -> int:
    """The index in `text` where the parser stopped; lark gives none at the end of input."""
    if isinstance(unexpected, UnexpectedToken) and unexpected.token.type == "$END":
        return len(text.rstrip(_BLANKS))
    return int(unexpected.pos_in_stream or 0)


def _expected_words(unexpected: UnexpectedInput) -> str:
    terminals: set[str] = set()
    if isinstance(unexpected, UnexpectedToken):
        terminals = unexpected.expected
    elif isinstance(unexpected, UnexpectedCharacters):
        terminals = unexpected.allowed
    words = [words for terminal, words in _WORDS.items() if terminal in terminals]
    if words:
        return " or ".join(words)
    return _END_OF_LINE if "COMMENT" in terminals else "a space and a value"


def _number_spoilt_at(text: str, place: int, end: int) -> re.Match[str] | None:
    """The word around `place` if it starts like a number and goes wrong at `place`."""
    for word in _WORD.finditer(text, 0, end):
        if word.start() < place < word.end() and re.match(r"[+-]?[0-9.]", word[0]):
            return word
    return None
