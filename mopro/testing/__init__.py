"""Hypothesis strategies and invariants for tests of mopro and of packages built on it.

Needs Hypothesis, which `mopro[test]` installs.
"""

from mopro.testing.invariants import check_profile
from mopro.testing.strategies import profiles, program_texts, programs

__all__ = ["check_profile", "profiles", "program_texts", "programs"]
