"""Where measured logs are found: the folder named by HARMONIC_RIG_DATA, or `shared/data` beside the checkout."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("HARMONIC_RIG_DATA", ROOT.parent / "shared" / "data"))
JOINT = DATA / "kuka_iiwa_joint4"
MAP = DATA / "motor_cogging_map" / "hold_sweep.csv"
EXAMPLES = ROOT / "docs" / "examples"

needs_joint = pytest.mark.skipif(not JOINT.exists(), reason=f"no measured joint logs: {JOINT} (HARMONIC_RIG_DATA)")
needs_map = pytest.mark.skipif(not MAP.exists(), reason=f"no measured cogging map: {MAP} (HARMONIC_RIG_DATA)")
