"""The example of the docs does what the docs say."""

import subprocess
import sys

from helpers.paths import ROOT


def test_the_example_prints_what_the_docs_say():
    text = (ROOT / "docs" / "diagnosis.md").read_text()
    code, after = text.split("```python\n")[1].split("```", 1)
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert f"prints `{shown.strip()}`" in after
