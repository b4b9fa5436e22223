"""`python -m mopro`."""

from mopro.cli import main

main()
