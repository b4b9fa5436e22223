"""`mopro lsp`."""

from __future__ import annotations

import click


@click.command()
def command() -> None:
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
    server.start_io()
