"""The language server as an editor has it: a process at the other end of a pipe."""

import sys

import pytest
import pytest_lsp
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException
from pytest_lsp import ClientServerConfig, LanguageClient, client_capabilities

import mopro
from helpers.paths import PROGRAMS

LVDT2 = (PROGRAMS / "LVDT2.CMD").read_text("ascii")
LOOP = "UU012500/1\nVEL0 40.0\nACC0 0.25\n:B1\nMRI1 15.0\nWX1\nMRI1 -15.0\nWX1\nJUMP b1\n"


@pytest_lsp.fixture(
    scope="module",
    config=ClientServerConfig(server_command=[sys.executable, "-m", "mopro", "lsp"]),
)
async def client(lsp_client: LanguageClient):
    capabilities = client_capabilities("visual-studio-code")
    await lsp_client.initialize_session(
        lsp.InitializeParams(capabilities=capabilities, root_uri="file:///nowhere")
    )
    yield
    await lsp_client.shutdown_session()


class Opened:
    """A text open in the editor."""

    def __init__(self, client, name, text):
        self.client, self.text, self.version = client, text, 1
        self.id = lsp.TextDocumentIdentifier(f"file:///nowhere/{name}.CMD")
        item = lsp.TextDocumentItem(self.id.uri, "mopro", 1, text)
        client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))

    def change(self, text):
        self.text, self.version = text, self.version + 1
        place = lsp.VersionedTextDocumentIdentifier(self.version, self.id.uri)
        whole = lsp.TextDocumentContentChangeWholeDocument(text)
        self.client.text_document_did_change(lsp.DidChangeTextDocumentParams(place, [whole]))

    async def findings(self):
        await self.client.wait_for_notification("textDocument/publishDiagnostics")
        return [(d.code, d.range.start.line) for d in self.client.diagnostics[self.id.uri]]

    def with_edits(self, edits):
        lines = [*self.text.splitlines(keepends=True), ""]
        for edit in sorted(edits, key=lambda e: (e.range.start.line, e.range.start.character))[
            ::-1
        ]:
            start, end = edit.range.start, edit.range.end
            before, after = lines[start.line][: start.character], lines[end.line][end.character :]
            lines[start.line : end.line + 1] = [before + edit.new_text + after]
        return "".join(lines)

    def with_workspace_edit(self, edit):
        return self.with_edits(edit.changes[self.id.uri])


async def test_findings_come_while_typing(client):
    text = Opened(client, "typing", "VELO 15.0\n")
    assert await text.findings() == [("letter-o-axis", 0)]
    text.change("VEL0 15.0\nWT10 x\n")
    assert await text.findings() == [("unexpected-text", 1)]
    text.change("VEL0 15.0\nWT10\n")
    assert await text.findings() == []


async def test_places_count_in_utf_16_and_stop_at_ctrl_z(client):
    text = Opened(client, "utf16", "VELO 1.0 ; \U0001f600\r\nWT10\r\n\x1aVLE")
    assert await text.findings() == [("letter-o-axis", 0), ("text-after-end", 2)]
    found, _ = client.diagnostics[text.id.uri]
    assert (found.range.start.character, found.range.end.character) == (3, 4)


async def test_a_quick_fix_leaves_a_program_that_compiles(client):
    text = Opened(client, "fix", LOOP.replace("WX1\nMRI1 -15.0", "MRI1 -15.0"))
    assert await text.findings() == [("move-on-moving-axis", 5)]
    line = lsp.Range(lsp.Position(5, 0), lsp.Position(5, 4))
    params = lsp.CodeActionParams(text.id, line, lsp.CodeActionContext([]))
    (action,) = await client.text_document_code_action_async(params)
    assert action.kind == lsp.CodeActionKind.QuickFix
    assert action.diagnostics[0].code == "move-on-moving-axis"
    assert mopro.compile(text.with_workspace_edit(action.edit)) == mopro.compile(LOOP)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (7, ["12500 microsteps of 2.032 µm per in"]),
        (16, ["100 in/s² = 2.54 m/s²", "reached peak 38.7 in/s", "0.775 s", "triangle"]),
        (22, ["triangle over 15 in", "38.7 in/s"]),
        (25, ["`WT2000` = 2 s"]),
        (20, ["a place to jump to"]),
    ],
)
async def test_hover_tells_what_a_statement_means(client, line, said):
    text = Opened(client, "hover", LVDT2)
    place = lsp.Position(line, 1)
    shown = await client.text_document_hover_async(lsp.HoverParams(text.id, place))
    assert all(words in shown.contents.value for words in said), shown.contents.value


@pytest.mark.parametrize("uri", ["file:///dev/zero", "file:///nowhere/closed.CMD", "file://[", ""])
async def test_a_text_that_is_not_open_is_not_read_from_the_disk(client, uri):
    """Of /dev/zero there was no end."""
    params = lsp.HoverParams(lsp.TextDocumentIdentifier(uri), lsp.Position(0, 0))
    with pytest.raises(JsonRpcException, match="no text is open under"):
        await client.text_document_hover_async(params)


async def test_hover_over_a_comment_says_nothing(client):
    text = Opened(client, "quiet", LVDT2)
    params = lsp.HoverParams(text.id, lsp.Position(0, 3))
    assert await client.text_document_hover_async(params) is None


async def test_labels_go_to_references_and_rename(client):
    text = Opened(client, "labels", LOOP)
    jump = lsp.Position(8, 6)
    definition = await client.text_document_definition_async(lsp.DefinitionParams(text.id, jump))
    assert definition.range.start == lsp.Position(3, 1)
    for declared, lines in ((True, [3, 8]), (False, [8])):
        params = lsp.ReferenceParams(lsp.ReferenceContext(declared), text.id, jump)
        found = await client.text_document_references_async(params)
        assert [place.range.start.line for place in found] == lines
    ready = await client.text_document_prepare_rename_async(lsp.PrepareRenameParams(text.id, jump))
    assert ready.start == lsp.Position(8, 5)
    edit = await client.text_document_rename_async(lsp.RenameParams(text.id, jump, "again"))
    renamed = text.with_workspace_edit(edit)
    assert mopro.compile(renamed).labels == {"AGAIN": 3}
    assert "B1" not in renamed.upper()


@pytest.mark.parametrize("name", ["2B", "B 1", "", "taken"])
async def test_rename_refuses_what_would_not_compile(client, name):
    text = Opened(client, "refuse", LOOP + ":TAKEN\n")
    params = lsp.RenameParams(text.id, lsp.Position(3, 1), name)
    assert await client.text_document_rename_async(params) is None


async def test_completion_offers_statements_and_labels(client):
    text = Opened(client, "complete", LOOP + "JUMP \nV\n")

    async def labels(line, column):
        params = lsp.CompletionParams(text.id, lsp.Position(line, column))
        found = await client.text_document_completion_async(params)
        return {item.label for item in found}

    assert await labels(9, 5) == {"B1"}
    assert {"VEL1 40.0", "MRI1 15.0", "GO"} <= await labels(10, 1)
    assert "SK1 -5.0" not in await labels(10, 1)
    assert await labels(4, 6) == set()


async def test_format_is_what_fmt_writes_and_waits_for_a_whole_program(client):
    text = Opened(client, "format", "  vel 1 40.0 ;x\r\n\r\n\r\nwx 1\r\n\x1a")
    options = lsp.FormattingOptions(tab_size=4, insert_spaces=True)
    params = lsp.DocumentFormattingParams(text.id, options)
    edits = await client.text_document_formatting_async(params)
    assert text.with_edits(edits) == "VEL1 40.0  ;x\r\n\r\nWX1\r\n\x1a"
    text.change("vel 1\n")
    assert await client.text_document_formatting_async(params) is None


async def test_outline_has_labels_and_moves(client):
    text = Opened(client, "outline", LOOP)
    params = lsp.DocumentSymbolParams(text.id)
    found = await client.text_document_document_symbol_async(params)
    assert [symbol.name for symbol in found] == [":B1", "MRI1 15.0", "MRI1 -15.0"]
