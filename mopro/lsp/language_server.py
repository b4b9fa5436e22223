"""The language server, and the messages of an editor within bounds."""

from __future__ import annotations

import logging
import re
from collections import deque
from collections.abc import Callable, Iterable
from functools import lru_cache
from importlib.metadata import version
from io import BufferedIOBase
from pathlib import Path
from typing import BinaryIO

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path
from pygls.workspace import PositionCodec, TextDocument

from mopro.errors import MoproError, Severity
from mopro.language import ast, until_end_of_file
from mopro.language.format import format_source
from mopro.language.parse import statement_kinds
from mopro.lint.config import find_settings
from mopro.lint.rule import Finding, Settings
from mopro.lsp.open_text import Document, hover
from mopro.source import Source, Span
from mopro.text import visible

# -- messages ---------------------------------------------------------------------------------
# The messages of an editor, cut out of its bytes within bounds.
#
# A message is a header with its length, and so many bytes. After a header that states none, or
# an absurd one, nothing says where the next message begins: the input ends there, with a reason.


MOST_BYTES = 32 << 20
_MOST_LINES = 32
_MOST_LINE = 1024
_MOST_SAID = 300
_LENGTH = re.compile(rb"content-length[ \t]*:[ \t]*([0-9]{1,10})[ \t]*", re.IGNORECASE)


class Messages(BufferedIOBase):
    """An input whose headers are checked; `fault` is why it has ended early, None if it has not."""

    def __init__(self, source: BinaryIO) -> None:
        self._source = source
        self._header: deque[bytes] = deque()
        self.fault: str | None = None

    def readline(self, size: int | None = -1) -> bytes:
        """The next line of a header, of which only the length is left; empty at the end."""
        if not self._header and self.fault is None:
            self._header += self._next_header()
        return self._header.popleft() if self._header else b""

    def read(self, size: int | None = -1) -> bytes:
        """The body of a message; empty if the input ends within it."""
        assert size is not None, "a body is read by its length"
        body = self._source.read(size)
        return body if len(body) == size else b""

    def _next_header(self) -> list[bytes]:
        length = None
        for _ in range(_MOST_LINES):
            line = self._source.readline(_MOST_LINE)
            if not line:
                return []
            if not line.strip() and length is not None:
                return self._checked(length)
            if match := _LENGTH.fullmatch(line.rstrip(b"\r\n")):
                length = int(match[1])
            elif not line.endswith(b"\n") or line.lower().startswith(b"content-length"):
                return self._refused(f"a header that cannot be read: {line[:40]!r}")
        return self._refused("a header without a length")

    def _checked(self, length: int) -> list[bytes]:
        if not 0 < length <= MOST_BYTES:
            return self._refused(f"a message of {length} bytes, expected 1 to {MOST_BYTES}")
        return [b"Content-Length: %d\r\n" % length, b"\r\n"]

    def _refused(self, fault: str) -> list[bytes]:
        self.fault = fault
        return []


class LibraryWarnings(logging.Handler):
    """Hands warnings of the protocol's library to `tell`, a line each and without tracebacks."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        words = record.getMessage().partition("\n")[0]
        error = record.exc_info[1] if record.exc_info else None
        reason = f": {type(error).__name__}: {error}".partition("\n")[0] if error else ""
        self._tell(f"mopro: {words[:_MOST_SAID]}{reason[:_MOST_SAID]}")


# -- the server -------------------------------------------------------------------------------
# The language server: what the protocol asks, answered from a `Document`.

_SEVERITIES = {
    Severity.ERROR: lsp.DiagnosticSeverity.Error,
    Severity.WARNING: lsp.DiagnosticSeverity.Warning,
    Severity.NOTE: lsp.DiagnosticSeverity.Information,
}
_SYMBOLS: dict[type[ast.Statement], lsp.SymbolKind] = {
    ast.Label: lsp.SymbolKind.Key,
    ast.Move: lsp.SymbolKind.Event,
    ast.MoveAbsolute: lsp.SymbolKind.Event,
    ast.Go: lsp.SymbolKind.Event,
}

# A longer text would keep the editor waiting at every key; `mopro lint` takes it.
MOST_CHARACTERS = 256 * 1024
_SHOWN = 200
_TOO_LONG = lsp.Diagnostic(
    range=lsp.Range(lsp.Position(0, 0), lsp.Position(0, 1)),
    message=f"the text has more than {MOST_CHARACTERS} characters and is not checked while it "
    "is edited\n`mopro lint` checks it",
    severity=lsp.DiagnosticSeverity.Warning,
    code="too-long",
    source="mopro",
)

server = LanguageServer("mopro", version("mopro"))


@lru_cache(maxsize=64)
def _document(uri: str, name: str, text: str) -> Document:
    """The open text in one version; what was worked out about it is kept with it."""
    path = to_fs_path(uri)
    settings = find_settings(Path(path).parent) if path else Settings()
    return Document(until_end_of_file(Source(name, text)), settings)


class _Text:
    """One open text, and its places in the protocol's counting.

    JsonRpcInvalidParams for a text that is not open: the workspace would read it from the disk,
    of any size.
    """

    def __init__(self, ls: LanguageServer, uri: str) -> None:
        text: TextDocument | None = ls.workspace.text_documents.get(uri)
        if text is None:
            raise JsonRpcInvalidParams(f"no text is open under {visible(uri[:_SHOWN])}")
        self._codec: PositionCodec = ls.workspace.position_codec
        # The protocol's lines end where mopro's do, but for those that only Python knows.
        self.uri = uri
        self.version = text.version
        self.too_long = len(text.source) > MOST_CHARACTERS
        source = "" if self.too_long else text.source
        self.document = _document(uri, text.filename or uri, source)
        self._lines = self.document.source.lines_with_ends

    def span(self, span: Span) -> lsp.Range:
        line = span.line - 1
        ends = (lsp.Position(line, span.column - 1), lsp.Position(line, span.end_column - 1))
        start, end = (self._codec.position_to_client_units(self._lines, place) for place in ends)
        return lsp.Range(start, end)

    def place(self, position: lsp.Position) -> tuple[int, int]:
        """Line and column, from 1."""
        found = self._codec.position_from_client_units(self._lines, position)
        return found.line + 1, found.character + 1

    def whole(self) -> lsp.Range:
        """All lines, up to a Ctrl-Z."""
        last = self._lines[-1] if self._lines else ""
        if last.endswith(("\r", "\n")) or not last:
            end = lsp.Position(len(self._lines), 0)
        else:
            end = self.span(Span(len(self._lines), 1, len(last) + 1)).end
        return lsp.Range(lsp.Position(0, 0), end)

    def name_at(self, position: lsp.Position) -> tuple[str, Span] | None:
        return self.document.name_at(*self.place(position))


def _asked(ls: LanguageServer, uri: str) -> _Text:
    """The text that a request is about; JsonRpcException, which is the answer, if there is none."""
    try:
        return _Text(ls, uri)
    except MoproError as error:
        raise JsonRpcException(error.render(), lsp.LSPErrorCodes.RequestFailed) from error


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
def did_open(ls: LanguageServer, params: lsp.DidOpenTextDocumentParams) -> None:
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
def did_change(ls: LanguageServer, params: lsp.DidChangeTextDocumentParams) -> None:
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
def did_close(ls: LanguageServer, params: lsp.DidCloseTextDocumentParams) -> None:
    gone = lsp.PublishDiagnosticsParams(params.text_document.uri, [])
    ls.text_document_publish_diagnostics(gone)


def _publish(ls: LanguageServer, uri: str) -> None:
    """Send the findings; unusable settings are told to the person instead."""
    try:
        text = _Text(ls, uri)
        found = [_diagnostic(text, finding) for finding in text.document.findings]
        if text.too_long:
            found = [_TOO_LONG]
    except MoproError as error:
        shown = lsp.ShowMessageParams(lsp.MessageType.Error, error.render())
        ls.window_show_message(shown)
        return
    ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, found, text.version))


def _diagnostic(text: _Text, finding: Finding) -> lsp.Diagnostic:
    message = f"{finding.message}\n{finding.hint}" if finding.hint else finding.message
    return lsp.Diagnostic(
        range=text.span(finding.span),
        message=message,
        severity=_SEVERITIES[finding.severity],
        code=finding.rule,
        source="mopro",
    )


@server.feature(
    lsp.TEXT_DOCUMENT_CODE_ACTION,
    lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix]),
)
def code_action(ls: LanguageServer, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    text = _asked(ls, params.text_document.uri)
    first, last = (text.place(p)[0] for p in (params.range.start, params.range.end))
    return [
        _quick_fix(text, finding)
        for finding in text.document.findings
        if finding.fix is not None and first <= finding.span.line <= last
    ]


def _quick_fix(text: _Text, finding: Finding) -> lsp.CodeAction:
    new_text = (finding.fix or "").replace("\n", text.document.source.line_end)
    edit = lsp.TextEdit(text.span(finding.span), new_text)
    return lsp.CodeAction(
        title=f"{finding.hint or 'fix'} [{finding.rule}]",
        kind=lsp.CodeActionKind.QuickFix,
        diagnostics=[_diagnostic(text, finding)],
        edit=lsp.WorkspaceEdit(changes={text.uri: [edit]}),
        is_preferred=True,
    )


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
def on_hover(ls: LanguageServer, params: lsp.HoverParams) -> lsp.Hover | None:
    text = _asked(ls, params.text_document.uri)
    line, column = text.place(params.position)
    statement = text.document.statement_at(line)
    if statement is None or not statement.span.column <= column <= statement.span.end_column:
        return None
    words = hover(text.document, line) or ""
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, words), text.span(statement.span))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
def definition(ls: LanguageServer, params: lsp.DefinitionParams) -> lsp.Location | None:
    text = _asked(ls, params.text_document.uri)
    name = text.name_at(params.position)
    span = text.document.definition_of(name[0]) if name else None
    return lsp.Location(text.uri, text.span(span)) if span else None


@server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
def references(ls: LanguageServer, params: lsp.ReferenceParams) -> list[lsp.Location]:
    text = _asked(ls, params.text_document.uri)
    name = text.name_at(params.position)
    spans: Iterable[Span] = ()
    if name is not None:
        spans = text.document.places_of(name[0], params.context.include_declaration)
    return [lsp.Location(text.uri, text.span(span)) for span in spans]


@server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
def prepare_rename(ls: LanguageServer, params: lsp.PrepareRenameParams) -> lsp.Range | None:
    text = _asked(ls, params.text_document.uri)
    name = text.name_at(params.position)
    return text.span(name[1]) if name else None


@server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
def rename(ls: LanguageServer, params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
    text = _asked(ls, params.text_document.uri)
    name = text.name_at(params.position)
    if name is None:
        return None
    refusal = text.document.why_no_name(params.new_name, name[0])
    if refusal is not None:
        ls.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Error, refusal))
        return None
    edits = [
        lsp.TextEdit(text.span(span), params.new_name) for span in text.document.places_of(name[0])
    ]
    return lsp.WorkspaceEdit(changes={text.uri: edits})


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=[" "]))
def completion(ls: LanguageServer, params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
    """Labels behind JUMP, else the statements."""
    text = _asked(ls, params.text_document.uri)
    line, column = text.place(params.position)
    before = text.document.source.line(line)[: column - 1].lstrip().upper()
    if before.startswith("JUMP "):
        labels = {span: key for key, span, defines in text.document.names if defines}
        return [
            lsp.CompletionItem(key, kind=lsp.CompletionItemKind.Reference)
            for key in labels.values()
        ]
    if not before.isalpha() and before:
        return []
    return [_statement_item(kind) for kind in statement_kinds(text.document.settings.grammar)]


def _statement_item(kind: type[ast.Statement]) -> lsp.CompletionItem:
    return lsp.CompletionItem(kind.form, detail=kind.meaning, kind=lsp.CompletionItemKind.Keyword)


@server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
def formatting(
    ls: LanguageServer, params: lsp.DocumentFormattingParams
) -> list[lsp.TextEdit] | None:
    """The canonical layout; nothing while a line cannot be read."""
    text = _asked(ls, params.text_document.uri)
    document = text.document
    try:
        tidy = format_source(document.source, document.settings.grammar)
    except MoproError:
        return None
    return [lsp.TextEdit(text.whole(), tidy.text)] if tidy != document.source else []


@server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
def outline(ls: LanguageServer, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """Labels and what moves."""
    text = _asked(ls, params.text_document.uri)
    return [
        lsp.DocumentSymbol(
            name=text.document.text_of(statement),
            kind=_SYMBOLS[type(statement)],
            range=text.span(statement.span),
            selection_range=text.span(statement.span),
            detail=statement.meaning,
        )
        for statement in text.document.tree.statements
        if type(statement) in _SYMBOLS
    ]
