"""Figures drawn as matplotlib draws by itself, whatever the settings of user or folder say."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def library_style() -> Iterator[None]:
    """Have matplotlib draw by its own defaults in the block; the settings around it stay.

    A text keeps the settings under which it was made, so figures are made and saved in such blocks.
    """
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield
