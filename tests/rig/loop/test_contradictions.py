"""What a device file or a sidecar says against what the logs show: refused with both, and never where effects do it."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DataError
from rig.log.run import Run
from rig.loop.signals.checks import check_gear
from rig.loop.signals.tracks import make_track
from tests.rig.loop.runs import Floats, dut, turning_run


def gear_of(text: str, *runs: Run) -> float | None:
    """Check the ratio of a device file against runs."""
    device = dut(f'name = "x"\n[gear]\n{text}\n')
    return check_gear([make_track(run, device) for run in runs], device)


def with_output(run: Run, error: Floats) -> Run:
    """Give the run with an error (n,) rad in its output angle."""
    return replace(run, signals={**run.signals, "output_position": run.signals["output_position"] + error})


# -- ratio


@pytest.mark.parametrize("given", [101.0, 100.5, 99.0])
@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_a_ratio_that_is_slightly_wrong_is_refused_with_the_measured_one(given: float, speed: float) -> None:
    with pytest.raises(DataError, match=rf"ratio = {given:g}, but the motor turns 100(\.\d+)? times"):
        gear_of(f"ratio = {given}", turning_run("a", 1, speed))


def test_a_rounded_ratio_is_refused_over_a_long_way() -> None:
    with pytest.raises(DataError, match=r"ratio = 57\.3, but the motor turns 57\.285\d times"):
        gear_of("ratio = 57.3", turning_run("a", 1, 80.0, ratio=401 / 7))


@pytest.mark.parametrize("speed", [0.8, 3.0, 20.0])
@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6])
def test_a_right_ratio_stands_whatever_the_gear_and_the_encoders_do(speed: float, phase: float) -> None:
    run = turning_run("a", 1, speed)
    motor, output = run.signals["motor_position"], run.signals["output_position"]
    noise = np.random.default_rng(1).standard_normal(run.time.size)
    for error in (
        2e-4 * np.sin(2.0 * motor + phase),
        2e-5 * np.sin(motor + phase),
        2e-3 * np.sin(output + phase),
        3e-4 * np.sign(np.gradient(motor)) + 2e-4 * np.sin(output + phase),
        1e-3 * noise,
        2e-4 * run.time / run.time[-1],
    ):
        assert gear_of("ratio = 100", with_output(run, error)) == 100.0
