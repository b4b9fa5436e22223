"""Paths of the repository's files."""

from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
ROOT = TESTS.parent
DATA = TESTS / "data"
PROGRAMS = ROOT / "programs"
