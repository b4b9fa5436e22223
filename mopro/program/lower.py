"""Tree to IR, with every finding about meaning that needs no motion to see."""

from __future__ import annotations

from functools import singledispatchmethod

from mopro.errors import Diagnostic, Severity, SourceError
from mopro.language import ast
from mopro.process.garbage import garbage_left
from mopro.program import ir
from mopro.source import Span
from mopro.units import MS_PER_S

ALL_AXES = 0
MOST_DWELL_MS = 10**9
# Names of labels compared with those that no line defines: a second or two.
_MOST_COMPARED = 200_000


def lower(tree: ast.Tree) -> ir.Program:
    """The program that `tree` means; SourceError with all findings if it means none."""
    ops, found = examine(tree)
    if any(d.severity is Severity.ERROR for d in found):
        raise SourceError(tree.source, found)
    return ir.Program(ops, tree.source, tuple(found))


def examine(tree: ast.Tree) -> tuple[tuple[ir.Op, ...], list[Diagnostic]]:
    """The operations of `tree`, a program if no finding is an error, and the findings."""
    lowering = _Lowering(tree)
    with garbage_left():
        ops = tuple(map(lowering.op, tree.statements))
    return ops, lowering.found


class _Lowering:
    """Goes through the statements once and gathers findings."""

    def __init__(self, tree: ast.Tree) -> None:
        self.found: list[Diagnostic] = []
        if tree.source.cut is not None:
            self._report(
                "text-after-end",
                "the program ends at this Ctrl-Z (0x1A), and what stands behind it is not read",
                tree.source.cut,
                hint="take the Ctrl-Z out if that belongs to it: files that DOS joined have it",
                warning=True,
            )
        self._defined: dict[str, ast.Label] = {}
        self._compared = 0
        self._labels = {s.name.key for s in tree.statements if isinstance(s, ast.Label)}

    def _report(
        self, rule: str, message: str, span: Span, hint: str | None = None, warning: bool = False
    ) -> None:
        severity = Severity.WARNING if warning else Severity.ERROR
        self.found.append(Diagnostic(rule, message, span, severity, hint))

    def _axes(self, statement: ast.Statement, axis: ast.Axis) -> tuple[int, ...]:
        span = axis.span(statement.span.line)
        if axis.letter_o:
            self._report(
                "letter-o-axis",
                "the letter O stands where an axis digit belongs: read as 0, all axes",
                span,
                hint="write the digit 0",
                warning=True,
            )
        if axis.number == ALL_AXES:
            return ir.AXES
        if axis.number not in ir.AXES:
            known = " and ".join(map(str, ir.AXES))
            message = f"there is no axis {axis.number}: expected {known}, or 0 for all axes"
            self._report("no-such-axis", message, span)
        return (axis.number,)

    def _nearest_label(self, key: str) -> str | None:
        """The label most like `key`; None if none is, or after `_MOST_COMPARED` comparisons."""
        self._compared += len(self._labels)
        if self._compared > _MOST_COMPARED:
            return None
        from difflib import get_close_matches

        return next(iter(get_close_matches(key, self._labels, n=1)), None)

    def _positive(self, statement: ast.Statement, number: ast.Number, what: str, rule: str) -> None:
        if number.value <= 0:
            span = number.span(statement.span.line)
            self._report(rule, f"{what} must be greater than 0", span)

    @singledispatchmethod
    def op(self, statement: ast.Statement) -> ir.Op:
        raise TypeError(f"no operation for {type(statement).__name__}")

    @op.register
    def _(self, s: ast.Units) -> ir.Op:
        for part, name in ((s.numerator, "numerator"), (s.denominator, "denominator")):
            if part.value == 0:
                message = f"the {name} of the user unit must not be 0"
                self._report("zero-units", message, part.span(s.span.line))
        axes = self._axes(s, s.axis)
        return ir.SetUnits(s.span, axes, s.numerator.value, s.denominator.value)

    @op.register
    def _(self, s: ast.Velocity) -> ir.Op:
        self._positive(s, s.value, "the velocity", "bad-velocity")
        return ir.SetVelocity(s.span, self._axes(s, s.axis), s.value.value)

    @op.register
    def _(self, s: ast.Acceleration) -> ir.Op:
        self._positive(s, s.value, "the acceleration", "bad-acceleration")
        return ir.SetAcceleration(s.span, self._axes(s, s.axis), s.value.value * MS_PER_S)

    @op.register
    def _(self, s: ast.Profile) -> ir.Op:
        return ir.SetProfile(s.span, self._axes(s, s.axis), s.switch.on)

    @op.register(ast.Move)
    @op.register(ast.MoveAbsolute)
    def _(self, s: ast.Move | ast.MoveAbsolute) -> ir.Op:
        absolute = isinstance(s, ast.MoveAbsolute)
        return ir.Move(s.span, self._axes(s, s.axis), s.value.value, absolute)

    @op.register(ast.Target)
    @op.register(ast.TargetAbsolute)
    def _(self, s: ast.Target | ast.TargetAbsolute) -> ir.Op:
        absolute = isinstance(s, ast.TargetAbsolute)
        return ir.SetTarget(s.span, self._axes(s, s.axis), s.value.value, absolute)

    @op.register
    def _(self, s: ast.Go) -> ir.Op:
        return ir.Go(s.span)

    @op.register
    def _(self, s: ast.WaitAxis) -> ir.Op:
        return ir.WaitAxis(s.span, self._axes(s, s.axis))

    @op.register
    def _(self, s: ast.Dwell) -> ir.Op:
        if s.milliseconds.value > MOST_DWELL_MS:
            message = f"a wait may be at most {MOST_DWELL_MS} ms"
            self._report("bad-wait", message, s.milliseconds.span(s.span.line))
        return ir.Dwell(s.span, s.milliseconds.value)

    @op.register
    def _(self, s: ast.Label) -> ir.Op:
        first = self._defined.setdefault(s.name.key, s)
        if first is not s:
            message = f"label {s.name.text} is already defined in line {first.span.line}"
            self._report("duplicate-label", message, s.name.span(s.span.line))
        return ir.Label(s.span, s.name.key)

    @op.register
    def _(self, s: ast.Jump) -> ir.Op:
        if s.name.key not in self._labels:
            near = self._nearest_label(s.name.key)
            hint = f"did you mean `{near}`?" if near else f"define it: `:{s.name.text}`"
            message = f"no line defines the label {s.name.text}"
            self._report("unknown-label", message, s.name.span(s.span.line), hint)
        return ir.Jump(s.span, s.name.key)

    @op.register
    def _(self, s: ast.Continuous) -> ir.Op:
        return ir.Continuous(s.span, self._axes(s, s.axis), s.value.value)

    @op.register
    def _(self, s: ast.Seek) -> ir.Op:
        if s.value.value == 0:
            span = s.value.span(s.span.line)
            self._report("bad-velocity", "the velocity of a seek must not be 0", span)
        return ir.Seek(s.span, self._axes(s, s.axis), s.value.value)

    @op.register
    def _(self, s: ast.Stop) -> ir.Op:
        return ir.Stop(s.span, self._axes(s, s.axis))

    @op.register
    def _(self, s: ast.Home) -> ir.Op:
        return ir.Home(s.span, self._axes(s, s.axis))

    @op.register
    def _(self, s: ast.ZeroPosition) -> ir.Op:
        return ir.ZeroPosition(s.span, self._axes(s, s.axis))
