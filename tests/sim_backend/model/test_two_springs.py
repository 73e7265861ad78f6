"""The two-spring analogue: the moving mass against the play operator, its slopes, its energy."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_backend.errors import ModelError, shown
from sim_backend.model.limits import DRIVE as DRIVE_LIMITS
from sim_backend.model.parameters import HarmonicDrive
from sim_backend.model.two_springs import INERTIA, LIMITS, STEP, TwoSprings, analogue_of, moving, quasi_static

DRIVE = HarmonicDrive.from_catalogue(100.0, 8.4e3, 9.4e3, 3.9, 12.0, 1.8e-4, 0.012)
SPRINGS = analogue_of(DRIVE, 3e-5)


def triangle(peak: float, cycles: float, samples: int) -> np.ndarray:
    return peak * np.interp(np.linspace(0.0, cycles, samples) % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def test_the_analogue_of_the_papers_drive_has_its_stiffnesses_and_friction():
    assert (SPRINGS.K_a, SPRINGS.K_b) == pytest.approx((1.333e4, 8336.0), rel=1e-3)
    assert SPRINGS.friction == pytest.approx(1.2)
    assert SPRINGS.mass == pytest.approx(0.3)


def test_a_slow_mass_follows_the_play_operator():
    force = triangle(16.0, 1.25, 200_001)
    slow, fast = (np.max(np.abs(moving(force, time / force.size, SPRINGS).F_b - quasi_static(force, SPRINGS).F_b))
                  for time in (200.0, 20.0))  # fmt: skip
    # the mass trails by damping times speed: force rate * c / K_b
    rate = 16.0 * 5.0 / 20.0
    assert fast == pytest.approx(SPRINGS.damping * rate / SPRINGS.K_b, rel=0.05)
    assert slow == pytest.approx(0.1 * fast, rel=0.05)


def test_until_the_friction_is_overcome_only_spring_a_deforms():
    force = np.linspace(0.0, 16.0, 1601)
    path = quasi_static(force, SPRINGS)
    sticking = force <= 1.2
    assert np.all(path.F_b[sticking] == 0.0)
    slope = np.gradient(path.displacement, force)
    assert slope[force < 1.19] == pytest.approx(1.0 / SPRINGS.K_a, rel=1e-9)
    assert slope[force > 1.21] == pytest.approx(1.0 / SPRINGS.K_a + 1.0 / SPRINGS.K_b, rel=1e-9)
    assert path.F_b[-1] == pytest.approx(16.0 - 1.2)


def test_after_a_reversal_the_force_must_change_by_twice_the_friction():
    force = np.concatenate([np.linspace(0.0, 10.0, 1001), np.linspace(10.0, 0.0, 1001)])
    path = quasi_static(force, SPRINGS)
    back = slice(1001, None)
    held = force[back] > 10.0 - 2.0 * 1.2 + 1e-9
    assert np.all(path.F_b[back][held] == pytest.approx(8.8))
    assert path.F_b[back][~held][-1] == pytest.approx(1.2)


def test_a_cycle_loses_what_friction_takes_and_nothing_without_it():
    force = triangle(16.0, 2.0, 40_001)
    last = slice(20_000, None)
    lost = np.trapezoid(force[last], quasi_static(force, SPRINGS).displacement[last])
    # the mass goes to and fro between +-(16 - 1.2)/K_b against 1.2
    assert lost == pytest.approx(1.2 * 4.0 * 14.8 / SPRINGS.K_b, rel=1e-3)
    free = quasi_static(force, replace(SPRINGS, friction=0.0))
    assert abs(np.trapezoid(force[last], free.displacement[last])) < 1e-6 * lost


def test_the_moving_mass_converges_with_the_step_at_first_order():
    # a step of force on the frictionless mass: x = F/K (1 - (1 + w t) e^(-w t)) with critical damping
    free = replace(SPRINGS, friction=0.0)
    w = math.sqrt(free.K_b / free.mass)
    errors = []
    for samples in (1000, 2000, 4000):
        step = 0.05 / samples
        time = step * np.arange(1, samples + 1)
        exact = 1.0 - (1.0 + w * time) * np.exp(-w * time)
        errors.append(np.max(np.abs(moving(np.ones(samples), step, free).F_b - exact)))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


def test_friction_holds_the_mass_wherever_the_rest_of_the_force_is_less():
    force = np.concatenate([np.full(20_000, 3.0), np.full(20_000, 2.0)])
    path = moving(force, 1e-5, SPRINGS)
    assert path.F_b[19_999] == path.F_b[-1]  # 3 - 1.2 = 1.8 is within 1.2 of 2
    assert path.F_b[-1] == pytest.approx(1.8, rel=1e-3)


@pytest.mark.parametrize(("name", "value"), [("K_a", 0.0), ("mass", -1.0), ("friction", -1.0), ("damping", math.nan)])
def test_an_analogue_that_cannot_be_is_refused(name, value):
    with pytest.raises(ModelError, match=f"^{name} = .* N|^{name} = .* kg"):
        replace(TwoSprings(1.0, 1.0, 1.0, 1.0), **{name: value})


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, 1e300, 10**400, None, "1", 1j])
def test_a_step_that_cannot_be_is_refused(step):
    with pytest.raises(ModelError, match=r"^step = "):
        moving(np.ones(3), step, SPRINGS)


def test_a_force_that_is_no_number_is_refused_by_name():
    for path in (lambda force: quasi_static(force, SPRINGS), lambda force: moving(force, 1e-5, SPRINGS)):
        with pytest.raises(ModelError, match=r"^force\[1\] = nan N or N\*m is not possible: .*finite"):
            path(np.array([0.0, math.nan]))


ABSURD = [None, "1", 1j, True, [1.0], {}, 10**400, -1.0, 5e-324, 1e308]


@pytest.mark.parametrize("value", ABSURD)
@pytest.mark.parametrize("name", LIMITS)
def test_what_no_spring_mass_or_friction_can_be_is_refused_with_range_and_equation(name, value):
    unit, low, high, equation = LIMITS[name]
    if value == 5e-324 and low == 0.0:  # a friction or damping as good as none
        assert getattr(replace(SPRINGS, **{name: value}), name) == value
        return
    with pytest.raises(ModelError) as refused:
        replace(SPRINGS, **{name: value})
    told = str(refused.value)
    assert told.startswith(f"{name} = {shown(value)} ")
    assert f"{low:g}" in told
    assert f"{high:g} {unit}; {equation} needs it." in told


@pytest.mark.parametrize("inertia", ABSURD)
def test_an_inertia_without_an_analogue_is_refused_by_name(inertia):
    with pytest.raises(ModelError, match=r"^motor_inertia = .* 2000 kg\*m\^2; m = N\^2 \(J_m \+ J_wg\) needs it"):
        analogue_of(DRIVE, inertia)


@pytest.mark.parametrize("drive", [None, 1.0, SPRINGS])
def test_an_analogue_is_that_of_a_drive_only(drive):
    with pytest.raises(ModelError, match=r"^drive = .* must be a HarmonicDrive"):
        analogue_of(drive, 3e-5)


@pytest.mark.filterwarnings("error")
def test_every_drive_has_an_analogue_and_every_analogue_a_path():
    for ratio, K_F0, K_w0, friction, inertia in itertools.product(
        *((DRIVE_LIMITS[name].low, DRIVE_LIMITS[name].high) for name in ("ratio", "K_F0", "K_w0", "friction_torque")),
        (INERTIA.low, INERTIA.high),
    ):
        springs = analogue_of(HarmonicDrive(ratio, K_F0, 0.045, K_w0, 80.0, friction), inertia)
        for step in (STEP.low, 1e-5, STEP.high):
            path = moving(np.array([1e24, -1e24, 0.0, 1.0]), step, springs)
            assert np.all(np.isfinite(path.displacement))
            assert np.all(np.isfinite(path.F_b))


@pytest.mark.parametrize("force", [None, "1", 1.0, [[1.0]], [1.0, None], [10**400], [1e300]])
def test_a_force_that_is_no_series_of_numbers_is_refused_by_name(force):
    for path in (lambda: quasi_static(force, SPRINGS), lambda: moving(force, 1e-5, SPRINGS)):
        with pytest.raises(ModelError, match=r"^force"):
            path()
