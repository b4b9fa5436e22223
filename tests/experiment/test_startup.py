"""What a diagnosis loads before it begins."""

import subprocess
import sys


def test_a_diagnosis_does_not_load_what_takes_a_third_of_a_second():
    script = (
        "import sys, mopro.cli.reconcile, mopro.experiment.opened; "
        "print(*({'scipy.stats', 'scipy.signal'} & sys.modules.keys()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60
    )
    assert not done.stdout.split()
