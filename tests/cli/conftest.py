"""Commands as a person runs them: real processes, each in a folder of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SETUP = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"


@pytest.fixture
def mopro(tmp_path):
    """Run `mopro ARGS`; gives the finished process. `text` becomes the file P.CMD."""

    def run(*args, text=None, timeout=120):
        if text is not None:
            (tmp_path / "P.CMD").write_bytes(text if isinstance(text, bytes) else text.encode())
        environment = {**os.environ, "COLUMNS": "160", "NO_COLOR": "1"}
        return subprocess.run(
            [sys.executable, "-m", "mopro", *map(str, args)], cwd=tmp_path, env=environment,
            capture_output=True, text=True, timeout=timeout, check=False,
        )  # fmt: skip

    return run


@pytest.fixture
def files(tmp_path):
    """The names in the folder that commands run in."""
    return lambda: sorted(path.name for path in Path(tmp_path).iterdir())
