"""The controller's end of the protocol: bytes to statements, replies to bytes, by the dialect."""

from __future__ import annotations

from typing import Any

from mopro.controller.device import Device, Refusal
from mopro.link.dialect import Dialect
from mopro.link.template import BadFrame

_REMEMBERED = 256
_UNKNOWN, _NOT_GREETED, _TOO_LONG = 1, 9, 7


class Protocol:
    """Reads bytes one by one and answers lines; a scenario may switch `echo` and `busy`.

    `client` tells who is at the other end, where that can be known.
    """

    def __init__(self, dialect: Dialect, device: Device) -> None:
        self.echo = dialect.conversation.echo
        self.busy = False
        self.client = 0
        self._greetings = 0
        self._dialect = dialect
        self._device = device
        self._end = dialect.line.end.encode("latin-1")
        self._attention = dialect.conversation.attention.encode("latin-1")
        self._longest = dialect.wrapped_length("") + dialect.line.longest
        self._line = bytearray()
        self._expected: int | None = None
        self._answers: dict[int, str] = {}

    def restart(self) -> None:
        """Forget the conversation, as after a reset."""
        self._line.clear()
        self._expected = None
        self._answers.clear()

    def feed(self, byte: int, now_s: float) -> tuple[bytes, bytes]:
        """Echo and reply (bytes) to one byte that arrives at `now_s`."""
        self._line.append(byte)
        if self._attention and self._line.endswith(self._attention):
            self._line.clear()
            self._device.abandon_download()
            return b"", self._bytes([]) if self._dialect.conversation.prompt else b""
        if not self._line.endswith(self._end):
            if len(self._line) > 2 * self._longest:
                del self._line[: -self._longest - 1]
            return self._echo(bytes([byte])), b""
        line = bytes(self._line[: -len(self._end)]).decode("latin-1")
        self._line.clear()
        end = self._dialect.line.reply_end.encode("latin-1") if len(self._end) == 1 else self._end
        return self._echo(end), self._reply(line, now_s)

    def _echo(self, data: bytes) -> bytes:
        return data if self.echo else b""

    def _bytes(self, lines: list[str]) -> bytes:
        text = "".join(line + self._dialect.line.reply_end for line in lines)
        prompt = self._dialect.conversation.prompt
        return (text + prompt).encode("latin-1", "replace")

    def _reply(self, line: str, now_s: float) -> bytes:
        if self._dialect.check is None:
            return self._bytes(self._answered(line, now_s) if line else [])
        return self._numbered(line, now_s) if line else b""

    def _numbered(self, line: str, now_s: float) -> bytes:
        """Reply to a line in its frame, which is executed once however often it comes."""
        check = self._dialect.check
        assert check is not None, "only for a dialect with a check"
        try:
            number, body = check.unwrap(line)
        except BadFrame:
            return b"" if self._expected is None else self._framed(self._expected, [check.resend])
        if body == check.hello:
            self._greetings += 1
            self._answers.clear()
            self._expected = number
        elif self._expected is None:
            refusal = self._refusal(Refusal(_NOT_GREETED, "expected a greeting first"))
            return self._framed(number, [refusal])
        assert self._expected is not None, "greeted"
        ahead = check.ahead(number, self._expected)
        # Only who knows the number that is due is in this conversation.
        if ahead > 0:
            return self._framed(self._expected, [check.resend])
        if ahead < 0:
            return self._answers.get(number, "").encode("latin-1")
        self._speak(now_s)
        lines = self._answered(body, now_s) if body != check.hello else self._acknowledged([])
        answer = self._framed(number, lines)
        if not (self.busy and body != check.hello):
            self._expected = check.after(number)
            self._answers[number] = answer.decode("latin-1")
            self._answers.pop(check.after(number, -_REMEMBERED), None)
        return answer

    def _speak(self, now_s: float) -> None:
        """Have the device hear whose line has come: a greeting begins a conversation of its own."""
        self._device.speaker = (self.client, self._greetings)
        self._device.hear(now_s)

    def _framed(self, number: int, lines: list[str]) -> bytes:
        check = self._dialect.check
        assert check is not None, "only for a dialect with a check"
        return self._bytes([check.wrap(line, number) for line in lines])

    def _acknowledged(self, lines: list[str]) -> list[str]:
        acknowledge = self._dialect.conversation.acknowledge
        return [*lines, acknowledge] if acknowledge else lines

    def _refusal(self, refusal: Refusal) -> str:
        fields = {"code": refusal.code, "text": refusal.reason}
        return self._dialect.conversation.refuse.fill(fields)

    def _answered(self, line: str, now_s: float) -> list[str]:
        """The reply lines to one line, acknowledged or refused."""
        if self.busy:
            return [self._dialect.conversation.busy]
        try:
            return self._acknowledged(self._done(line, now_s))
        except Refusal as refusal:
            return [self._refusal(refusal)]

    def _done(self, line: str, now_s: float) -> list[str]:
        if len(line) > self._dialect.line.longest:
            raise Refusal(_TOO_LONG, "the line is too long")
        if self._device.downloading and line != self._dialect.statements["end"].text:
            self._device.move_on(now_s)
            self._device.take(line)
            return []
        for name, template in self._dialect.statements.items():
            fields = template.read(line)
            if fields is not None:
                self._speak(now_s)
                rows = self._device.do(name, fields, now_s)
                return [self._row(name, row) for row in rows]
        raise Refusal(_UNKNOWN, "not a statement of this controller")

    def _row(self, name: str, row: dict[str, Any]) -> str:
        if "state" in row:
            row = {**row, "state": self._dialect.word_of(row["state"])}
        return self._dialect.replies[name].fill(row)
