"""The corners of a torque that follows no straight lines."""

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.loop.signals.kinks import kinks

Floats = NDArray[np.float64]
PERIOD = 0.01
TIME = np.arange(0.0, 60.0, PERIOD)
STARTS, PEAK, RATE = 5.003, 12.0, 4.0


def sine() -> Floats:
    """Two periods of a sine out of a dwell and into one."""
    w = RATE / PEAK
    after = np.clip(TIME - STARTS, 0.0, 4.0 * np.pi / w)
    return np.asarray(PEAK * np.sin(w * after))


@pytest.mark.parametrize("seed", range(3))
def test_a_sine_between_dwells_has_a_corner_at_either_end_and_no_other(seed: int) -> None:
    found = kinks(sine() + 0.02 * np.random.default_rng(seed).standard_normal(TIME.size), PERIOD)
    assert found is not None
    slopes = np.diff(found) / PERIOD
    ends = STARTS + 4.0 * np.pi * PEAK / RATE
    before, between, after = slopes[TIME[1:] < 4.9], slopes[(TIME[1:] > 5.1) & (TIME[1:] < ends - 0.1)], slopes[-1]
    # what noise leaves of a slope over a quarter of a second: five standard deviations
    unsure = 5.0 * 0.02 * np.sqrt(24.0 / 25**3) / PERIOD
    assert np.all(before == 0.0)
    assert np.ptp(between) < 1e-9
    assert between[0] == pytest.approx(RATE, abs=unsure)
    assert after == pytest.approx(0.0, abs=1.5 * unsure)
    place = 20.0 - found[TIME.searchsorted(20.0)] / between[0]
    assert place == pytest.approx(STARTS, abs=0.01)


def test_noise_alone_and_a_smooth_torque_have_none() -> None:
    noise = 0.02 * np.random.default_rng(4).standard_normal(TIME.size)
    assert kinks(noise, PERIOD) is None
    assert kinks(PEAK * np.sin(0.3 * TIME) + noise, PERIOD) is None
    assert kinks(noise[:50], PERIOD) is None
