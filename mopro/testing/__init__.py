"""For tests, of mopro and of what is built on it: Hypothesis strategies and invariants.

Needs Hypothesis, which `mopro[test]` brings.
"""

from mopro.testing.invariants import check_profile
from mopro.testing.strategies import profiles, program_texts, programs

__all__ = ["check_profile", "profiles", "program_texts", "programs"]
