"""Whatever acts on the quasi-static bench: springs, mesh and motor obey their laws, each as it would be read in a book.

The laws are checked on the results, signal by signal; how the bench found them plays no part.
"""

import numpy as np
import pytest

from tests.independent import bench, laws
from tests.independent import effects as fx
from tests.independent.balance import stribeck_friction
from tests.independent.draws import DRAWN

DRIVE = laws.shd_17_100()
RATE = 200.0
NOTHING = fx.Effects()
MECHANICAL = sorted(
    {"kinematic-error", "cogging", "gravity-load"} | (set(DRAWN) & {*fx.TORSION, *fx.FRICTION, *fx.TORQUE})
)
SWEEP = np.interp(np.arange(9001) / RATE, [0, 1, 9, 14, 25, 30, 40, 45], [0, 0, 1, 1, -1, -1, 0.6, 0])
AROUND = bench.Conditions(np.arange(9001) / RATE, 22.0 + 15.0 * -np.expm1(-np.arange(9001) / RATE / 20.0))


def drawn(effect: str) -> fx.Effects:
    return fx.draw(effect, np.random.default_rng(5))


def through_wave_generator(signals: bench.Signals, effects: fx.Effects) -> np.ndarray:
    """Give the torque in the wave generator from the motor's."""
    position, _, torque, _ = signals
    T = in_flexspline(signals, effects)
    seen = {"motor_position": position, "motor_torque": torque, "output_torque": T}
    taken = fx.total(["cogging", "torque-ripple"], effects, seen, position.shape)
    return torque - taken + T * fx.total_slope(effects, seen, position.shape)


def in_flexspline(signals: bench.Signals, effects: fx.Effects) -> np.ndarray:
    held = fx.total(["gravity-load"], effects, {"output_position": signals[1]}, signals[1].shape)
    return signals[3] - held


def angles(signals: bench.Signals, effects: fx.Effects, around: bench.Conditions, locked: float) -> np.ndarray:
    """Give what the effects behind the mesh add to the torsion."""
    T = in_flexspline(signals, effects)
    seen = {
        "time": around.time,
        "temperature": around.temperature,
        "motor_position": signals[0],
        "output_torque": T,
        "locked": np.full(T.shape, locked),
        "flexspline_torsion": laws.flexspline_torsion(T, DRIVE.K_F0, DRIVE.C_F),
    }
    return fx.total([name for name in fx.TORSION if name != "backlash"], effects, seen, T.shape)


def level(signals: bench.Signals, effects: fx.Effects, base: float, velocity, around: bench.Conditions) -> np.ndarray:
    T = in_flexspline(signals, effects)
    seen = {
        "temperature": around.temperature,
        "motor_position": signals[0],
        "motor_velocity": velocity,
        "output_torque": T,
        "base_friction": base + DRIVE.b * np.abs(velocity),
    }
    return base + fx.total(fx.FRICTION, effects, seen, T.shape)


def assert_springs(signals: bench.Signals, effects: fx.Effects, around: bench.Conditions, locked: float) -> None:
    through = through_wave_generator(signals, effects)
    gap = fx.total(["backlash"], effects, {"motor_torque": through}, through.shape)
    expected = laws.total_torsion(in_flexspline(signals, effects), through, DRIVE) + gap
    expected = expected + angles(signals, effects, around, locked)
    torsion = signals[1] + signals[0] / DRIVE.ratio
    assert np.max(np.abs(torsion - expected)) < 1e-11


def assert_mesh(signals: bench.Signals, effects: fx.Effects, around: bench.Conditions, locked: float, level) -> None:
    """The gear side of the flexspline stands still inside the friction and slides only the way the torques push it."""
    T = in_flexspline(signals, effects)
    pushing = T - DRIVE.ratio * through_wave_generator(signals, effects)
    radius = DRIVE.ratio * level
    assert np.all(np.abs(pushing) <= radius + 1e-6)
    gear = signals[1] - laws.flexspline_torsion(T, DRIVE.K_F0, DRIVE.C_F) - angles(signals, effects, around, locked)
    slid = np.diff(gear)
    inside = np.abs(pushing[1:]) < radius[1:] - 1e-3
    assert inside.mean() > 0.05
    assert np.max(np.abs(slid[inside])) < 1e-10
    # T pulls the gear side towards the output, the wave generator pushes it back: it goes where it is pushed
    moving = np.abs(slid) > 1e-9
    assert moving.mean() > 0.3
    assert np.all(np.sign(slid[moving]) == np.sign(pushing[1:][moving]))


@pytest.mark.parametrize("effect", MECHANICAL)
def test_a_locked_sweep_obeys_springs_and_mesh(effect: str):
    effects = drawn(effect)
    signals = bench.locked_output(0.15 * SWEEP, 0.7, DRIVE, effects, AROUND)
    assert_springs(signals, effects, AROUND, 1.0)
    if effect == "stribeck-friction":  # a locked motor is slow against the Stribeck velocity
        size = effects.of(effect)[0]["amplitude"]
        speed = np.max(np.abs(np.gradient(signals[0], AROUND.time)))
        assert size - stribeck_friction(speed, **effects.of(effect)[0]) < 0.02 * size
        return
    assert_mesh(signals, effects, AROUND, 1.0, level(signals, effects, DRIVE.T_fs, np.zeros(SWEEP.shape), AROUND))


@pytest.mark.parametrize("effect", MECHANICAL)
def test_a_backdriven_sweep_obeys_springs_and_friction(effect: str):
    effects = drawn(effect)
    signals = bench.backdrive(14.0 * SWEEP, 0.7, DRIVE, effects, AROUND)
    assert_springs(signals, effects, AROUND, 0.0)
    at_rest = np.zeros(SWEEP.shape)
    most = DRIVE.ratio * level(signals, effects, DRIVE.T_fb / DRIVE.ratio, at_rest, AROUND)
    pushing = in_flexspline(signals, effects) - DRIVE.ratio * through_wave_generator(signals, effects)
    assert np.all(np.abs(pushing) <= most + 1e-9)
    assert np.max(np.abs(pushing) - most) > -1e-9
    assert not np.ptp(signals[0])


def turning() -> tuple[np.ndarray, np.ndarray, bench.Conditions, np.ndarray]:
    """Turn at 6 rad/s both ways and at 40 rad/s, against three loads: position, speed, conditions, load."""
    time = np.arange(8001) / RATE
    velocity = np.interp(
        time, [0, 1, 1.2, 15, 15.2, 16, 16.2, 30, 30.2, 31, 31.2, 40], [0, 0, 6, 6, 0, 0, -6, -6, 0, 0, 40, 40]
    )
    position = 0.3 + np.concatenate([[0.0], np.cumsum(velocity[1:] + velocity[:-1]) / 2.0 / RATE])
    load = np.interp(time, [5, 6, 10, 11, 20, 21, 25, 26], [0, 8, 8, 0, 0, -8, -8, 0])
    return position, velocity, bench.Conditions(time, 20.0 + time / 2.0), load


@pytest.mark.parametrize("effect", MECHANICAL)
def test_a_loaded_free_run_costs_load_and_friction(effect: str):
    effects = drawn(effect)
    position, velocity, around, load = turning()
    signals = bench.free_run(position, velocity, DRIVE, effects, around, load)
    assert_springs(signals, effects, around, 0.0) if effect != "inertia" else None
    at_speed = (np.abs(np.gradient(velocity)) == 0.0) & (np.abs(velocity) > 1.0)
    at_speed[1:] &= np.cumsum(np.abs(velocity))[1:] > 0.1 * RATE
    friction = through_wave_generator(signals, effects) - in_flexspline(signals, effects) / DRIVE.ratio
    expected = np.sign(velocity) * level(signals, effects, DRIVE.T_c, velocity, around) + DRIVE.b * velocity
    settled = at_speed & np.roll(at_speed, 20)
    assert settled.mean() > 0.7
    assert friction[settled] == pytest.approx(expected[settled], abs=1e-12)
    assert np.array_equal(signals[3], load)


def cycle(effects: fx.Effects, rate: float) -> tuple[float, float]:
    """Give what a closed locked cycle takes at the motor and what its mesh dissipates, J; the second of two cycles."""
    samples = 8000
    torque = 0.15 * np.interp(np.arange(9 * samples // 4 + 1) * 4 / samples, [0, 1, 3, 5, 7, 9], [0, 1, -1, 1, -1, 1])
    around = bench.Conditions(np.arange(torque.size) / rate, np.full(torque.shape, 25.0))
    signals = bench.locked_output(torque, 0.7, DRIVE, effects, around)
    T = in_flexspline(signals, effects)
    pushing = T - DRIVE.ratio * through_wave_generator(signals, effects)
    gear = signals[1] - laws.flexspline_torsion(T, DRIVE.K_F0, DRIVE.C_F) - angles(signals, effects, around, 1.0)
    last = slice(-samples - 1, None)
    return float(np.trapezoid(torque[last], signals[0][last])), float(np.trapezoid(pushing[last], gear[last]))


@pytest.mark.parametrize(
    "effect",
    [
        "kinematic-error",
        "cogging",
        "gravity-load",
        "soft-windup",
        "backlash",
        "stiffness-modulation",
        "fixture-compliance",
        "position-dependent-friction",
        "load-dependent-friction",
    ],
)
def test_work_of_a_locked_cycle_goes_into_the_mesh_alone(effect: str):
    """Whatever is elastic gives back what it took, with its reaction on the motor; friction acts in the mesh."""
    put_in, rubbed = cycle(drawn(effect), RATE)
    assert rubbed > 5e-3
    assert put_in == pytest.approx(rubbed, rel=1e-3)


@pytest.mark.parametrize(("effect", "rate"), [("maxwell-slip", RATE), ("creep", 40.0)])
def test_what_remembers_takes_work_beside_the_mesh(effect: str, rate: float):
    put_in, rubbed = cycle(drawn(effect), rate)
    assert put_in > 1.02 * rubbed


def test_maxwell_slip_takes_the_area_of_its_loop():
    put_in, rubbed = cycle(fx.Effects(others=(fx.term("maxwell-slip", amplitude=6e-6, radius=4.0),)), RATE)
    assert put_in - rubbed == pytest.approx(4.0 * 4.0 * (15.0 - 1.2 - 4.0) * 6e-6, rel=5e-3)


def test_a_held_torque_creeps():
    """25 s at 10 N*m with 5 s: the motor turns on by N kappa T/K_F0."""
    creep = fx.Effects(others=(fx.term("creep", amplitude=0.04, time_constant=5.0, stiffness=8336.0),))
    torque = np.interp(np.arange(6001) / RATE, [0.0, 1.0, 30.0], [0.0, 0.112, 0.112])
    position, _, _, output_torque = bench.locked_output(torque, 0.0, DRIVE, creep)
    assert output_torque[-1] == pytest.approx(10.0, abs=1e-6)
    assert position[-1] - position[201] == pytest.approx(100.0 * 0.04 * 10.0 / 8336.0, rel=0.1)


def test_a_gap_is_crossed_without_torque():
    """The motor of a locked drive turns through the gap when its torque changes sign, and nothing else changes."""
    gap = fx.Effects(others=(fx.term("backlash", amplitude=8e-3, contact=1e-3, ratio=100.0),))
    with_gap, without = (bench.locked_output(0.15 * SWEEP, 0.0, DRIVE, these) for these in (gap, NOTHING))
    assert with_gap[3] == pytest.approx(without[3], abs=1e-9)
    turned = with_gap[0] - without[0]
    assert turned == pytest.approx(8e-3 * np.clip(0.15 * SWEEP / 1e-3, -1.0, 1.0), abs=1e-9)


def test_a_gap_is_lost_at_the_reversal_of_a_free_run():
    gap = fx.Effects(others=(fx.term("backlash", amplitude=8e-3, contact=1e-3, ratio=100.0),))
    position, velocity, around, _ = turning()
    torsion = bench.free_run(position, velocity, DRIVE, gap, around)[1] + position / 100.0
    forward, backward = (torsion[np.searchsorted(around.time, t)] for t in (10.0, 25.0))
    plain = bench.free_run(position, velocity, DRIVE, NOTHING, around)[1] + position / 100.0
    without = [plain[np.searchsorted(around.time, t)] for t in (10.0, 25.0)]
    assert (forward - backward) - (without[0] - without[1]) == pytest.approx(2.0 * 8e-3 / 100.0, abs=1e-12)


def test_friction_that_grows_with_the_load_bends_the_two_branches_apart():
    """T + mu|T| = N M - r up, T - mu|T| = N M + r down: slopes 1/(1+mu) and 1/(1-mu) of T on N M."""
    effects = fx.Effects(others=(fx.term("load-dependent-friction", amplitude=0.2, ratio=100.0),))
    _, _, torque, T = bench.locked_output(0.15 * SWEEP, 0.0, DRIVE, effects)
    up, down = slice(1200, 1700), slice(3400, 4200)
    assert T[up] == pytest.approx((100.0 * torque[up] - 1.2) / 1.2, abs=1e-8)
    falling = T[down][(T[down] > 0.5) & (np.diff(T, prepend=0.0)[down] < -1e-6)]
    driving = torque[down][(T[down] > 0.5) & (np.diff(T, prepend=0.0)[down] < -1e-6)]
    assert falling.size > 100
    assert falling == pytest.approx((100.0 * driving + 1.2) / 0.8, abs=1e-8)


def test_a_starting_torque_includes_the_static_share_of_the_friction():
    effects = fx.Effects(others=(fx.term("stribeck-friction", amplitude=6e-3, velocity=8.0, exponent=1.0),))
    ramp = 4e-3 * np.arange(3000) / RATE
    for these, breakaway in ((NOTHING, 0.012), (effects, 0.018)):
        position, _, torque, _ = bench.starting_torque(ramp, 1.0 / RATE, 0.0, 0.5, DRIVE, these)
        assert torque[np.argmax(position > 0.03)] == pytest.approx(breakaway, abs=7e-4)


def test_a_hot_drive_turns_with_a_share_of_its_whole_friction():
    """(T_c + b omega) exp(-kappa dT), though the oil loses more than the dry level has: 93 rad/s, 28 K at 0.06/K."""
    thin = fx.Effects(others=(fx.term("temperature-dependent-friction", amplitude=0.06, reference=20.0),))
    velocity = np.full(2000, 93.0)
    position = np.cumsum(velocity) / RATE
    around = bench.Conditions(np.arange(2000) / RATE, np.full(2000, 48.0))
    torque = bench.free_run(position, velocity, DRIVE, thin, around)[2]
    assert torque[-1] == pytest.approx((0.012 + 1e-4 * 93.0) * np.exp(-0.06 * 28.0), rel=1e-12)


def test_inertia_costs_torque_only_while_the_speed_changes():
    position, velocity, around, _ = turning()
    heavy = fx.Effects(others=(fx.term("inertia", J=2e-4),))
    more = (
        bench.free_run(position, velocity, DRIVE, heavy, around)[2]
        - bench.free_run(position, velocity, DRIVE, NOTHING, around)[2]
    )
    assert more == pytest.approx(2e-4 * np.gradient(velocity, around.time), abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_many_effects_together_obey_the_laws(seed: int):
    rng = np.random.default_rng(seed)
    together = NOTHING
    for effect in rng.permutation([name for name in MECHANICAL if name != "stribeck-friction"])[:6]:
        together = together + fx.draw(str(effect), rng)
    signals = bench.locked_output(0.15 * SWEEP, 0.7, DRIVE, together, AROUND)
    assert_springs(signals, together, AROUND, 1.0)
    assert_mesh(signals, together, AROUND, 1.0, level(signals, together, DRIVE.T_fs, np.zeros(SWEEP.shape), AROUND))
