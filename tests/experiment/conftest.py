"""A laboratory for each test."""

import os
import subprocess
import sys

import pytest
from laboratory import Lab


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path)


@pytest.fixture
def mopro_command(tmp_path):
    """Run `mopro ARGS` as a process in the laboratory; gives the finished process."""

    def run(*args):
        environment = {**os.environ, "COLUMNS": "160", "NO_COLOR": "1"}
        return subprocess.run(
            [sys.executable, "-m", "mopro", *map(str, args)], cwd=tmp_path, env=environment,
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip

    return run
