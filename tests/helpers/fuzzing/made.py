"""Numbers and formulas made at random, and put in the place of a word of an input.

A fuzzer that is guided by lines alone makes no run of 310 digits: the lines that it reaches are
those of one digit.
"""

from __future__ import annotations

import re
from random import Random

from mopro.formula.expressions import FUNCTIONS, MOST_CHARACTERS, SIGNALS

_DIGITS = {"": "0123456789", "0x": "0123456789abcdef", "0b": "01", "0o": "01234567"}
_ODD = ("inf", "nan", "1e999", "1e-999", "9**9**9", "0", "1e30", "1e31", "0777", "1__0", "True")
_OPERATORS = ("+", "-", "*", "/", "**", "//", "%", "<", "==", " and ", " or ", " if x else ")
_NAMES = ("x", "v", "t", "T", "u", "A", "pi", "command", "motor")
_CALLED = (*FUNCTIONS, *SIGNALS, "nothing")
_WORD = re.compile(rb"[\w.]+")
_MOST_LEVELS, _MOST_ARGUMENTS = 3, 4
# Of a formula that is made: a part of these may have as many digits as a whole one.
_SHORT = 8


def number(random: Random, longest: int = MOST_CHARACTERS) -> str:
    """A number of up to `longest` characters: long or short, of any base, with an exponent."""
    if random.random() < 0.2:
        return random.choice(_ODD)
    prefix = random.choice(("", "", "", *_DIGITS))
    count = random.randint(1, longest if random.random() < 0.4 else _SHORT)
    made = prefix + "".join(random.choices(_DIGITS[prefix], k=count))
    if prefix:
        return made
    if random.random() < 0.3:
        made = f"{made[: count // 2]}.{made[count // 2 :]}"
    if random.random() < 0.3:
        made += f"e{random.choice(('', '-', '+'))}{random.randrange(10 ** random.randint(1, 6))}"
    return made + ("j" if random.random() < 0.05 else "")


def formula(random: Random, level: int = 0) -> str:
    """A formula, most often of the language: calls of any number of arguments, in each other."""
    kind = random.randrange(5 if level < _MOST_LEVELS else 2)
    if kind == 0:
        return number(random)
    if kind == 1:
        return random.choice(_NAMES)
    if kind == 2:
        parts = [formula(random, level + 1) for _ in range(random.randint(0, _MOST_ARGUMENTS))]
        marked = (random.choice(("", "", "", "", "", "", "*", "**", "x=")) + part for part in parts)
        return f"{random.choice(_CALLED)}({', '.join(marked)})"
    if kind == 3:
        return random.choice(("-", "+", "not ")) + formula(random, level + 1)
    one, other = (formula(random, level + 1) for _ in range(2))
    return f"({one} {random.choice(_OPERATORS)} {other})"


def with_numbers(random: Random, data: bytes) -> bytes:
    """`data` with another number in the place of one of its words."""
    return _planted(random, data, number(random))


def with_formulas(random: Random, data: bytes) -> bytes:
    """`data` with a number or a formula in the place of one of its words."""
    return _planted(random, data, random.choice((number, formula))(random))


def _planted(random: Random, data: bytes, made: str) -> bytes:
    words = list(_WORD.finditer(data))
    if not words:
        return data + made.encode()
    chosen = random.choice(words)
    return data[: chosen.start()] + made.encode() + data[chosen.end() :]
