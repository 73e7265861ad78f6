"""The joint fit of base and effects ends at its optimum, from wherever it starts."""

from dataclasses import replace

import pytest

from rig.loop.fitting.base import fit_base, settled_pieces, start_model
from rig.loop.fitting.fit import material, refit
from rig.loop.model.equations import distinct_readings, pieces_of
from rig.loop.model.shapes import ShapeTerm
from rig.loop.signals.tracks import make_track, thin_track
from rig.loop.workers.held import Here
from sim_backend.model.compliance import Compliance
from sim_backend.model.effects import CATALOGUE
from tests.challenge.cases import LEAN
from tests.independent.campaign import Campaign
from tests.independent.terms import Effects, term
from tests.rig.loop.runs import dut, runs_of

PLAN = replace(LEAN, locked_angles=0, locked_pairs=0, backdrives=4, backdrive_pairs=0, free_runs=0, free_run_pairs=0)


def test_what_swings_faster_than_the_samples_of_the_coarse_fit_is_fitted_to_the_end() -> None:
    truth = (6e-6, 9.4, 0.04)
    hidden = term("structural-resonance", **dict(zip(("amplitude", "frequency", "damping"), truth, strict=True)))
    runs, _ = runs_of(Campaign(17, effects=Effects(others=(hidden,)), plan=PLAN, rate=100.0))
    start = start_model(dut(), dut().gear.ratio, Compliance.ARCTAN, None)
    pieces = [distinct_readings(p) for run in runs for p in pieces_of(thin_track(make_track(run, dut())), start.ratio)]
    fitted = material(Here(settled_pieces(pieces, start)))
    base = fit_base(fitted, start)
    effect = CATALOGUE["structural-resonance"]
    near, far = (
        refit(fitted, base, replace(base.model, shapes=(ShapeTerm(effect, values),)))
        for values in (truth, (3e-6, 9.15, 0.1))
    )
    assert near.model.shapes[0].values == pytest.approx(truth, rel=0.05)
    assert far.model.shapes[0].values == pytest.approx(near.model.shapes[0].values, rel=2e-3)
