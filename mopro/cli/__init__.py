"""The command line: arguments in, words and exit codes out; the only place that exits."""

from mopro.cli.main import main

__all__ = ["main"]
