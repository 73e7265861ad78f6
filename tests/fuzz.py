"""The property tests over and over with new random examples, for a given time: `python -m tests.fuzz SECONDS`.

Stops at the first failure with its smallest example; Hypothesis keeps that one and tries it first from then on.
"""

import subprocess
import sys
from pathlib import Path

from drivers.clock import RealClock

HERE = Path(__file__).parent
LONGEST = 600.0
"""s for the first round."""
NO_ROUND = 1
"""Exit code if not even one round was finished."""


def main(seconds: float) -> int:
    files = sorted(str(p) for p in HERE.rglob("test_*.py") if "from hypothesis" in p.read_text(encoding="utf-8"))
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "hypothesis", "--hypothesis-profile=fuzz", *files]
    clock = RealClock()
    rounds = 0
    while (left := seconds - clock.now()) > 0:
        try:
            # the first round is always finished: a cut one says nothing
            done = subprocess.run(command, cwd=HERE.parent, timeout=left if rounds else LONGEST, check=False)
        except subprocess.TimeoutExpired:
            break
        if done.returncode:
            return done.returncode
        rounds += 1
    print(f"{seconds:g} s without a failure: {rounds} whole rounds over {len(files)} files")
    return 0 if rounds else NO_ROUND


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1])))
