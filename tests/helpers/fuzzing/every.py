"""All parsers, by name."""

from helpers.fuzzing.lines import LINES
from helpers.fuzzing.parser import Parser
from helpers.fuzzing.tables import TABLES
from helpers.fuzzing.texts import TEXTS

PARSERS: dict[str, Parser] = {parser.name: parser for parser in (*TEXTS, *TABLES, *LINES)}
