"""`mopro lsp`."""

from __future__ import annotations

import sys
from functools import partial

import click

from mopro.cli.main import EXIT_BAD_INPUT
from mopro.cli.terminal.say import say


@click.command()
def command() -> int:
    """Serve an editor over standard input and output (language server protocol).

    Needs the extra `lsp`: pip install 'mopro[lsp]'.

    Example: mopro lsp
    """
    try:
        from mopro.lsp.server import server
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise click.UsageError("this needs more: pip install 'mopro[lsp]'") from error
    import logging

    from mopro.lsp.messages import Messages, Told

    logging.getLogger().addHandler(Told(partial(say, err=True)))
    messages = Messages(sys.stdin.buffer)
    server.start_io(messages)  # type: ignore[arg-type]
    if messages.fault is not None:
        say(f"mopro: the editor sent {messages.fault} [bad-message]", err=True)
        return EXIT_BAD_INPUT
    return 0
