"""A conversation with a controller in its dialect: sends lines, reads the answers.

Damaged lines are detected as far as the dialect allows, and repeated where that is safe.
Each answer has a time limit, and so has the whole conversation.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from random import Random
from typing import Any

from mopro.errors import LinkError
from mopro.link.dialect import Dialect
from mopro.link.template import MOST_DIGITS, BadFrame, Template
from mopro.link.transport import Port

_DEFAULT_ALLOWED_S = 120.0
_MOST_HELD = 65536
_MOST_LINES = 100_000
_QUIET_S = 0.05
_BUSY_PAUSE_S = 0.2
_SHOWN = 60
# Lines sent last, whose answers may come late.
_REMEMBERED = 64


class Refused(LinkError):
    """The controller refused a line, with its error `code` and `reason`."""

    rule = "refused"

    def __init__(self, line: str, code: int, reason: str) -> None:
        super().__init__(f"the controller refused `{line}`: {reason} (its code {code})")
        self.code, self.reason = code, reason


class Damaged(LinkError):
    """An answer that is damaged, or that did not come in time."""

    rule = "no-answer"


class Busy(Damaged):
    """The controller answered that it is busy."""

    rule = "busy"


class Session:
    """One conversation over `port`; `random` picks the first line number.

    `baud` is the line's rate where it is not the dialect's.
    """

    def __init__(
        self,
        port: Port,
        dialect: Dialect,
        random: Random | None = None,
        baud: int | None = None,
    ) -> None:
        self.port = port
        self.dialect = dialect
        self.retried = 0
        self.greeted = False
        self._until_s = port.now_s() + _DEFAULT_ALLOWED_S
        self._bound_s = math.inf
        self._random = random or Random()
        self._number = 0
        # True while line numbers may have been used that were not answered: they must not
        # be used again for other lines.
        self._unsynchronised = False
        # Count of numbers beyond the last answered one that may have been used.
        self._ahead = 0
        self._held = bytearray()
        # Lines that were sent last; whether any was given up, and whether an answer to such a
        # line has come since the last answer in time.
        self._sent: deque[str] = deque(maxlen=_REMEMBERED)
        self._given_up = self._late = False
        # When the controller did the last statement, on the port's clock, as nearly as is known.
        self.moment_s = port.now_s()
        # Bytes of the present answer so far, the echo not counted.
        self._taken = 0
        self.byte_s = dialect.line.bits_per_byte / (baud or dialect.line.baud)
        self._prompt = dialect.conversation.prompt.encode("latin-1")
        self._reply_end = dialect.line.reply_end.encode("latin-1")

    # -- time ------------------------------------------------------------------

    def give(self, seconds: float) -> None:
        """Allow `seconds` from now for all that follows, up to the bound."""
        self._until_s = min(self.port.now_s() + seconds, self._bound_s)

    def bound(self, until_s: float) -> None:
        """Let nothing last beyond `until_s` on the port's clock, whatever is given later."""
        self._bound_s = until_s
        self._until_s = min(self._until_s, until_s)

    def _wait_until_s(self, bytes_due: int) -> float:
        """The time limit (port's clock) of an answer with `bytes_due` still on the wire."""
        talk = self.dialect.conversation
        now_s = self.port.now_s()
        if now_s >= self._until_s:
            raise LinkError("the time allowed is over", "deadline")
        return min(self._until_s, now_s + talk.reply_timeout_s + bytes_due * self.byte_s)

    def pause(self, seconds: float) -> None:
        """Wait for `seconds`; bytes that come meanwhile are kept."""
        until_s = min(self.port.now_s() + seconds, self._until_s)
        while self.port.now_s() < until_s:
            self._hold(self.port.read(until_s))

    # -- opening ---------------------------------------------------------------

    def open(self) -> None:
        """Synchronise with the controller and greet it; LinkError if it does not answer so."""
        heard = b""
        tries = self.dialect.conversation.retries + 1
        while tries:
            self._wait_until_s(0)
            try:
                heard += self.recover()
                self._greet()
                return
            except Busy as busy:
                self._wait_while_busy(busy)
            except Damaged:
                heard += bytes(self._held)
                # Whatever still answers this greeting comes when nobody waits for it any more.
                self._given_up = True
                tries -= 1
        raise self._unknown_peer(heard)

    def _greet(self) -> None:
        self._unsynchronised, self._ahead = False, 0
        if self.dialect.check is None:
            self._once("status")
        else:
            self._number = self._random.randrange(self.dialect.check.numbers)
            self._put(self.dialect.check.hello, self._number)
            self._answer(self.dialect.check.hello, self._number)
        self.greeted = True

    def _unknown_peer(self, heard: bytes) -> LinkError:
        """The error for a peer that sent `heard` and is no controller of this dialect."""
        name = self.dialect.name
        self._look_for_late(heard)
        if self._late:
            return LinkError(self._too_late(), "late-answer")
        if not heard:
            message = "nothing answers: is the controller on, is this its port and its baud rate?"
            return LinkError(message, "no-answer")
        shown = heard[:_SHOWN].decode("latin-1")
        unprintable = sum(not (c.isascii() and (c.isprintable() or c in "\r\n\t")) for c in shown)
        if unprintable > len(shown) / 4:
            message = f"what comes is no text ({heard[:8].hex(' ')} ...): is the baud rate right?"
            return LinkError(message, "garbage")
        message = f"something answers, but not in the dialect {name} at this baud rate: {shown!r}"
        return LinkError(message, "other-dialect")

    def recover(self) -> bytes:
        """Bring both ends to the start of a line; returns the bytes that were on their way.

        The prompt that the attention brings is waited for as long as for any answer: on a slow
        way it came later, and was taken for the answer to the next line.
        """
        attention = self.dialect.conversation.attention.encode("latin-1")
        if attention:
            self.port.write(attention)
        heard = self._dropped()
        quiet_s = _QUIET_S + 20 * self.byte_s
        started_s = self.port.now_s()
        answers = attention and self._prompt
        patience_s = self.dialect.conversation.reply_timeout_s if answers else quiet_s
        while data := self.port.read(min(self.port.now_s() + patience_s, self._until_s)):
            self._look_for_late(data)
            heard, patience_s = heard + data, quiet_s
            elapsed_s = self.port.now_s() - started_s
            if (
                len(heard) > _MOST_HELD
                or elapsed_s > 10 * self.dialect.conversation.reply_timeout_s
            ):
                message = "the other end does not stop sending: is this the controller's port?"
                raise LinkError(message, "flood")
        return heard

    # -- asking ----------------------------------------------------------------

    def ask(self, statement: str, again: bool = True, **fields: Any) -> list[dict[str, Any]]:
        """Send a statement of the dialect; returns the fields of each reply line.

        `again` states that it may be repeated: executing it twice has no other effect.
        Raises Refused, LinkError.
        """
        tries = self.dialect.conversation.retries if again or self.dialect.check else 0
        if self._unsynchronised:
            self.open()
        while True:
            try:
                return self._once(statement, **fields)
            except Busy as busy:
                self._wait_while_busy(busy)
            except Damaged:
                self._unsynchronised = tries == 0
                if self._unsynchronised:
                    raise
                tries -= 1
                self.retried += 1
                self._rewind()

    def _wait_while_busy(self, busy: Busy) -> None:
        """Wait before a busy controller is asked again; LinkError if the time is over."""
        if self.port.now_s() + _BUSY_PAUSE_S >= self._until_s:
            raise LinkError(str(busy), "busy") from busy
        self.pause(_BUSY_PAUSE_S)

    def _once(self, statement: str, **fields: Any) -> list[dict[str, Any]]:
        line = self.dialect.statements[statement].fill(fields)
        number = self._next_number()
        sent_s = self.port.now_s()
        length = self._put(line, number)
        lines = self._answer(line, number)
        self.moment_s = self._between(sent_s, length)
        self._number, self._ahead = number, 0
        template = self.dialect.replies.get(statement)
        if template is None:
            return []
        read = [template.read(text) for text in lines]
        for text, values in zip(lines, read, strict=True):
            if values is None:
                raise Damaged(_unreadable(line, text, template))
        rows = [values for values in read if values is not None]
        _in_order(line, rows)
        return rows

    def _between(self, sent_s: float, length: int) -> float:
        """The middle of the time between the end of a line of `length` bytes and its answer.

        On a line that is faster than its rate says, of the time since `sent_s`.
        """
        answered_s = self.port.now_s()
        heard_s, began_s = sent_s + length * self.byte_s, answered_s - self._taken * self.byte_s
        if heard_s > began_s + self.byte_s:
            heard_s, began_s = sent_s, answered_s
        return (heard_s + began_s) / 2

    def _next_number(self, steps: int = 1) -> int:
        check = self.dialect.check
        return check.after(self._number, steps) if check else 0

    def _rewind(self) -> None:
        """Return to the start of a line after damage; a numbered line is then repeated."""
        if self.dialect.check is None:
            self.recover()
        else:
            self._settle()

    def _settle(self) -> None:
        """End a half line and discard what is on its way; a download under way stays."""
        self.port.write(self.dialect.line.end.encode("latin-1"))
        self.pause(_QUIET_S + 20 * self.byte_s)
        self._dropped()

    def one(self, statement: str, **fields: Any) -> dict[str, Any]:
        """`ask` for a statement that has one line of reply."""
        tries = self.dialect.conversation.retries
        while True:
            rows = self.ask(statement, **fields)
            if len(rows) == 1:
                return rows[0]
            if tries == 0:
                message = f"expected one line of reply to `{statement}`, got {len(rows)}"
                raise Damaged(message)
            tries -= 1
            self._rewind()

    def stream(self, lines: Sequence[str], done: Callable[[int], None]) -> None:
        """Send `lines` without waiting for each answer; calls `done(n)` after n answers.

        Raises Refused for the first line that is refused, with `done` at the line before.
        """
        sent = taken = tries = 0
        on_way: deque[int] = deque()
        self._unsynchronised = True
        while taken < len(lines):
            while sent < len(lines) and self._room(on_way, lines[sent]):
                self._put(lines[sent], self._next_number(sent - taken + 1))
                on_way.append(self.dialect.wrapped_length(lines[sent]))
                sent += 1
            try:
                self._answer(lines[taken], self._next_number())
            except Damaged as error:
                tries += not isinstance(error, Busy)
                if self.dialect.check is None or tries > self.dialect.conversation.retries:
                    raise
                self._go_back(error)
                sent = taken
                on_way.clear()
                continue
            self._number = self._next_number()
            on_way.popleft()
            self._ahead = len(on_way)
            taken, tries = taken + 1, 0
            done(taken)
        self._unsynchronised = False

    def _go_back(self, error: Damaged) -> None:
        """Prepare to repeat lines: no answer to the first sending may still come."""
        self.retried += 1
        if isinstance(error, Busy):
            self._wait_while_busy(error)
        self._settle()

    def _room(self, on_way: deque[int], line: str) -> bool:
        coming = self.dialect.wrapped_length(line)
        return not on_way or sum(on_way) + coming <= self.dialect.line.window

    def send_unanswered(self, statement: str) -> None:
        """Send a statement at once, without greeting first or awaiting the answer.

        With numbered lines it is sent under each number that the other end may expect now,
        and again after a new greeting, in one write; so it may be executed several times.
        Raises LinkError if the bytes cannot be sent.
        """
        body = self.dialect.statements[statement].fill({})
        check = self.dialect.check
        lines = [body]
        if check is not None:
            new = check.after(self._number, check.numbers // 2)
            lines = [
                *(check.wrap(body, self._next_number(n)) for n in range(1, self._ahead + 2)),
                check.wrap(check.hello, new),
                check.wrap(body, check.after(new)),
            ]
        self._unsynchronised = True
        begin = self.dialect.conversation.attention or self.dialect.line.end
        end = self.dialect.line.end
        self.port.write((begin + "".join(line + end for line in lines)).encode("latin-1"))

    # -- lines -----------------------------------------------------------------

    def _put(self, body: str, number: int) -> int:
        """Send a line; returns its length on the wire, in bytes."""
        check = self.dialect.check
        if check is not None:
            self._ahead = max(self._ahead, check.ahead(number, self._number))
        line = (check.wrap(body, number) if check else body) + self.dialect.line.end
        self.port.write(line.encode("latin-1"))
        self._sent.append(line.removesuffix(self.dialect.line.end))
        return len(line)

    def _answer(self, body: str, number: int) -> list[str]:
        """The reply lines to `body`, which has the line number `number`."""
        talk = self.dialect.conversation
        self._taken = 0
        due = self.dialect.line.window + 2 * len(body)
        if talk.echo:
            echo = self._line(due)
            if echo != (self.dialect.check.wrap(body, number) if self.dialect.check else body):
                raise self._other_echo(body, echo)
            self._taken = 0
        lines: list[str] = []
        refusal: dict[str, Any] | None = None
        busy = False
        while (line := self._body(number, due)) is not None:
            if talk.busy and line == talk.busy:
                busy = True
            elif (read := talk.refuse.read(line)) is not None:
                refusal = read
            elif not (talk.acknowledge and line == talk.acknowledge):
                lines.append(line)
                if len(lines) > _MOST_LINES:
                    raise LinkError("the answer has no end", "flood")
                continue
            if not talk.prompt:
                break
        if busy:
            raise Busy("the controller says that it is busy")
        if refusal is not None:
            self._number = number
            raise Refused(body, refusal.get("code", 0), str(refusal.get("text", "")))
        self._late = False
        return lines

    # -- late answers ----------------------------------------------------------

    def _other_echo(self, body: str, echo: str | None) -> Damaged:
        """The error for an `echo` that is not of the line `body`; None is a prompt."""
        if self._is_late(echo):
            self._late = True
            return Damaged(f"sent `{body}`: {self._too_late()}", "late-answer")
        came = "a prompt came first" if echo is None else f"the echo is {echo[:_SHOWN]!r}"
        return Damaged(f"sent `{body}`, but {came}")

    def _is_late(self, line: str | None) -> bool:
        """True if `line` (None: a prompt) answers one that was sent before, or is its echo."""
        if line is None or not self._given_up:
            return self._given_up
        line = line.replace(self._prompt.decode("latin-1"), "") if self._prompt else line
        if self.dialect.check is not None:
            with suppress(BadFrame):
                return self.dialect.check.unwrap(line)[0] >= 0
            return False
        status = self.dialect.replies["status"].read(line)
        states = self.dialect.states.values()
        return line in self._sent or (status is not None and status["state"] in states)

    def _look_for_late(self, data: bytes) -> None:
        """Notice an answer in bytes that nobody waits for any more."""
        lines = data.split(self._reply_end)
        self._late = self._late or any(self._is_late(line.decode("latin-1")) for line in lines)

    def _dropped(self) -> bytes:
        """The bytes that are held, which are dropped."""
        data = bytes(self._held)
        self._held.clear()
        self._look_for_late(data)
        return data

    def _too_late(self) -> str:
        limit_s = self.dialect.conversation.reply_timeout_s
        return (
            f"the controller answers later than {limit_s:g} s after a line: state a longer "
            f"reply_timeout_s in a dialect file (--dialect)"
        )

    def _body(self, number: int, due: int) -> str | None:
        """The next line that answers line `number`, unwrapped; None for a prompt."""
        check = self.dialect.check
        while (line := self._line(due)) is not None and check is not None:
            try:
                answers, body = check.unwrap(line)
            except BadFrame as error:
                raise Damaged(f"a damaged line came: {line[:_SHOWN]!r}") from error
            self._late = self._late or answers != number
            if answers == number:
                if body == check.resend:
                    raise Damaged(f"the controller missed line {number}")
                return body
        return line

    def _line(self, due: int) -> str | None:
        """The next line as it came; None for a prompt."""
        until_s = self._wait_until_s(due)
        while True:
            if self._prompt and self._held.startswith(self._prompt):
                del self._held[: len(self._prompt)]
                self._taken += len(self._prompt)
                return None
            end = self._held.find(self._reply_end)
            if end >= 0:
                line = self._held[:end].decode("latin-1")
                del self._held[: end + len(self._reply_end)]
                self._taken += end + len(self._reply_end)
                return line
            # Bytes that go on and on are no line: they do not extend the time.
            data = self.port.read(until_s) if self.port.now_s() < until_s else b""
            if not data:
                self._wait_until_s(0)
                self._given_up = True
                if self._late:
                    raise Damaged(self._too_late(), "late-answer")
                raise Damaged("the controller does not answer")
            self._hold(data)

    def _hold(self, data: bytes) -> None:
        self._held += data
        if len(self._held) > _MOST_HELD:
            raise LinkError("the other end does not stop sending", "flood")


def _unreadable(line: str, text: str, template: Template) -> str:
    """The message for a `text` that does not fit the reply `template` to `line`."""
    shown = repr(text[:_SHOWN]) + (f"... ({len(text)} characters)" if len(text) > _SHOWN else "")
    return (
        f"the answer to `{line}` makes no sense: {shown}; "
        f"expected `{template.text}`, each number of at most {MOST_DIGITS} digits"
    )


def _in_order(line: str, rows: list[dict[str, Any]]) -> None:
    """Numbered reply lines must follow one another."""
    numbers = [row["index"] for row in rows if "index" in row]
    if numbers != list(range(numbers[0], numbers[0] + len(numbers)) if numbers else []):
        raise Damaged(f"lines are missing in the answer to `{line}`")
