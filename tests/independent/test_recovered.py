"""What acts in a campaign is found again in its logs, by plain least squares with the base and the shapes known.

It says that the generator lets an effect act with the size and sign which the second formula has, through encoders,
noise and unknown zeros; whether the shape would be found without knowing it is not asked here.
"""

import numpy as np
import pytest

from tests.independent import effects as fx
from tests.independent import laws
from tests.independent.campaign import STANDARD, Campaign, Plan, Recording

DRIVE = laws.shd_17_100()
PLAN = Plan(
    locked_angles=4,
    locked_pairs=0,
    backdrives=2,
    backdrive_pairs=0,
    free_runs=2,
    free_run_pairs=0,
    output_turns=0.5,
    sine_share=0.0,
    torque_rates=(4.0, 2.0, 8.0),
    peaks=STANDARD.peaks,
    holds=(0.0, 25.0),
    further_legs=((2.0, 4.0, 20.0), (7.0, 11.0, 10.0)),
    loaded_free_runs=1,
    loads=STANDARD.loads,
    room=STANDARD.room,
    warm_up=STANDARD.warm_up,
)
RATE = 100.0


def recordings(effects: fx.Effects) -> tuple[Recording, ...]:
    return Campaign(17, effects, plan=PLAN, rate=RATE).recordings()


def unit(effect: str, effects: fx.Effects) -> fx.Effects:
    """Give the effect with the same shape and amplitude 1."""
    (parameters,) = effects.of(effect)
    if effect == "kinematic-error":
        return fx.Effects(kinematic_error=(fx.Line(parameters["order"], 1.0, parameters["phase"]),))
    return fx.Effects(others=(fx.term(effect, **{**parameters, "amplitude": 1.0}),))


def found_over_true(
    effect: str, effects: fx.Effects, column: list[np.ndarray], residual: list[np.ndarray]
) -> tuple[float, float]:
    """Give amplitude found over true, each run with its own zero, and the rms left over the rms before."""
    a = np.concatenate([values - values.mean() for values in column])
    y = np.concatenate([values - values.mean() for values in residual])
    amplitude = float(a @ y / (a @ a))
    return amplitude / effects.of(effect)[0]["amplitude"], float(np.std(y - amplitude * a) / np.std(y))


@pytest.mark.parametrize("effect", sorted(fx.TORSION))
def test_an_effect_in_the_torsion_is_found_with_its_size(effect: str):
    effects = fx.draw(effect, np.random.default_rng(8))
    column, residual = [], []
    for run in recordings(effects):
        seen = {
            "time": run.time,
            **run.columns,
            "flexspline_torsion": laws.flexspline_torsion(run.columns["output_torque"], DRIVE.K_F0, DRIVE.C_F),
            "locked": np.full(run.time.shape, float(run.procedure == "locked-output")),
        }
        column.append(fx.total([effect], unit(effect, effects), seen, run.time.shape))
        base = laws.total_torsion(run.columns["output_torque"], run.columns["motor_torque"], DRIVE)
        residual.append(run.columns["output_position"] + run.columns["motor_position"] / DRIVE.ratio - base)
    size, left = found_over_true(effect, effects, column, residual)
    # counts and noise leave 3.7 urad on 40 000 samples; what is within them of the regressor costs a per cent or two
    assert size == pytest.approx(1.0, abs=0.05)
    assert left < 0.6


@pytest.mark.parametrize("effect", sorted(fx.FRICTION))
def test_an_effect_in_the_friction_is_found_in_the_torque_of_turning(effect: str):
    effects = fx.draw(effect, np.random.default_rng(8))
    column, residual = [], []
    for run in recordings(effects):
        if run.procedure != "free-run":
            continue
        velocity = np.gradient(run.truth.motor_position, run.time)
        turning = (np.abs(np.gradient(velocity)) < 1e-9) & (np.abs(velocity) > 1.0)
        turning &= np.roll(turning, 20)
        seen = {
            **run.columns,
            "motor_velocity": velocity,
            "base_friction": DRIVE.T_c + DRIVE.b * np.abs(velocity),
        }
        same_shape = effects if effect == "temperature-dependent-friction" else unit(effect, effects)
        column.append((np.sign(velocity) * fx.total([effect], same_shape, seen, run.time.shape))[turning])
        base = DRIVE.T_c * np.sign(velocity) + DRIVE.b * velocity + run.columns["output_torque"] / DRIVE.ratio
        residual.append((run.columns["motor_torque"] - base)[turning])
    size, left = found_over_true(effect, effects, column, residual)
    if effect == "temperature-dependent-friction":  # not linear in its amplitude: the column has the true one
        size *= effects.of(effect)[0]["amplitude"]
    assert size == pytest.approx(1.0, abs=0.02)
    assert left < 0.5


@pytest.mark.parametrize(
    "effect", sorted({*fx.OUTPUT_TORQUE, *fx.OUTPUT_ANGLE, *fx.MOTOR_TORQUE, "motor-encoder-eccentricity"})
)
def test_an_error_of_an_instrument_is_the_difference_between_log_and_truth(effect: str):
    """Against the true signals the second formula explains the reading down to counts and noise."""
    # a parked encoder may stand anywhere between two counts: half a count at most
    noise = {"motor_position": 1.9e-4, "output_position": 3.6e-6, "motor_torque": 2.1e-4, "output_torque": 0.0205}
    place = {"output_torque": fx.OUTPUT_TORQUE, "output_position": fx.OUTPUT_ANGLE, "motor_torque": fx.MOTOR_TORQUE}
    name = next((name for name, ids in place.items() if effect in ids), "motor_position")
    effects = fx.draw(effect, np.random.default_rng(8))
    explained = []
    for run in recordings(effects):
        truth = {
            key: getattr(run.truth, key) + run.zeros.get(key, 0.0)
            for key in ("motor_position", "output_position", "motor_torque", "output_torque", "temperature")
        }
        # where the drive commands the torque it knows the current that it sends
        current = run.columns["motor_current"]
        seen = {**truth, "time": run.time, "motor_current": current}
        error = fx.total([effect], effects, seen, run.time.shape)
        left = run.columns[name] - truth[name] - error
        explained.append(np.std(error) > noise[name] or np.max(np.abs(error)) > noise[name])
        assert np.sqrt(np.mean((left - left.mean()) ** 2)) < noise[name]
        if name in ("motor_torque", "output_torque"):
            assert np.mean(left) == pytest.approx(0.0, abs=6.0 * noise[name] / np.sqrt(run.time.size))
    assert any(explained)
