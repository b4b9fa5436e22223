"""Editors that send anything to `mopro lsp`: damaged, large, misplaced and half messages.

    python bench/lsp_noise.py --sessions 300

Each session is a process of its own, fed from a seed. Prints how the sessions ended and what the
server said, and exits with 1 for a traceback on standard error, an exit code other than 0 and 2, a
process of more than 300 MB, or a session without the answer to `initialize`.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.lsp_noise import session


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--sessions", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    with ThreadPoolExecutor(chosen.jobs) as pool:
        done = list(pool.map(session, range(chosen.seed, chosen.seed + chosen.sessions)))
    said = sum((found.said for found in done), Counter())
    codes = Counter(found.code for found in done)
    print(f"sessions               {len(done):8}")
    print(f"messages               {sum(found.messages for found in done):8}")
    for kind in ("results", "errors", "notices"):
        print(f"  answered by {kind:10} {said[kind]:7}")
    for code, count in sorted(codes.items()):
        print(f"  ended with code {code}     {count:8}")
    print(f"largest process, MB    {max(found.mb for found in done):8.0f}")
    print(f"longest session, s     {max(found.seconds for found in done):8.1f}")
    failed = [found for found in done if found.failures]
    print(f"failures               {len(failed):8}")
    for found in failed[:12]:
        print(f"  seed {found.seed}: {', '.join(found.failures)}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
