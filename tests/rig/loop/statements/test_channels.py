"""Whether a residual follows a recorded signal: p-values that hold for signals as slow as one likes."""

from dataclasses import replace

import numpy as np
import pytest

from rig.loop.model.equations import Equation, pieces_of
from rig.loop.signals.tracks import make_track
from rig.loop.statements.channels import correlations
from rig.loop.statements.residuals import Residual
from tests.rig.loop.runs import dut, turning_run

PIECE = next(p for p in pieces_of(make_track(turning_run("r", 0), dut()), 100.0) if p.equation is Equation.TORSION)


def walk(rng, drift=0.0):
    """Give a random walk over the run, rad; `drift`: standard deviation of a further slope."""
    n = PIECE.track.size
    return 1e-6 * np.cumsum(rng.standard_normal(n)) + drift * rng.standard_normal() * np.linspace(-1.0, 1.0, n)


def residuals(rng, runs, of=lambda rng: (walk(rng), walk(rng))):
    """Give residuals of `runs` runs with the signals `one` and `other`; `of` gives what is left and `one`."""
    found = []
    for _ in range(runs):
        left, one = of(rng)
        track = replace(PIECE.track, auxiliary={"one": one, "other": walk(rng)})
        found.append(Residual(replace(PIECE, track=track), track.time[PIECE.index], left[PIECE.index]))
    return found


@pytest.mark.parametrize("runs", [4, 12])
@pytest.mark.parametrize("drift", [0.0, 1e-3])
def test_independent_random_walks_and_drifts_are_found_related_no_more_often_than_said(runs, drift):
    rng = np.random.default_rng(1)
    both = [residuals(rng, runs, lambda rng: (walk(rng, drift), walk(rng, drift))) for _ in range(400)]
    chances = np.array([correlations(made, ())["one"].p_value for made in both])
    # 20 of 400 are expected, with a standard deviation of 4.4; unequal runs make the test say less, never more
    assert 4 <= np.sum(chances < 0.05) <= 33


def test_a_signal_that_the_residual_follows_is_told_from_one_that_it_does_not():
    def of(rng):
        one = walk(rng)
        return one + walk(rng), one

    found = correlations(residuals(np.random.default_rng(2), 16, of), ())
    assert found["one"].p_value < 1e-2 < 5e-2 < found["other"].p_value
    assert found["one"].value > 0.3


def test_of_two_runs_nothing_is_said_of_chance_and_what_terms_use_is_left_out():
    found = correlations(residuals(np.random.default_rng(3), 2), ("other",))
    assert set(found) == {"one"}
    assert found["one"].p_value is None
    assert found["one"].runs == 2
