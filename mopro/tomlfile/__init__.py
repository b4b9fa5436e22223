"""TOML files: read within limits, checked by a schema, each finding at its place.

`Document` parses a text and knows the place of every key; `schema` says what a key may
hold. Machine files, experiments, dialects, fault scenarios and settings are read by it.
"""

from mopro.tomlfile.document import (
    MOST_BYTES,
    Document,
    Refused,
    Unreadable,
    Value,
    read_named,
    read_source,
    read_text,
)
from mopro.tomlfile.shown import shown

__all__ = [
    "MOST_BYTES",
    "Document",
    "Refused",
    "Unreadable",
    "Value",
    "read_named",
    "read_source",
    "read_text",
    "shown",
]
