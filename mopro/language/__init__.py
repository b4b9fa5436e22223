"""The command language: bytes to `Source`, `Source` to a tree of statements."""

from mopro.language.load import load, source_from_bytes, until_end_of_file
from mopro.language.parse import parse

__all__ = ["load", "parse", "source_from_bytes", "until_end_of_file"]
