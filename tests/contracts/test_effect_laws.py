"""What every registered effect must fulfil as a law over signals; a new entry is covered without being named."""

import inspect
import math
import re
from dataclasses import fields

import numpy as np
import pytest

from drivers.signals import BY_NAME
from sim_backend.model.arrays import evaluate
from sim_backend.model.compliance import flexspline_torsion
from sim_backend.model.effects import CATALOGUE, DERIVED_SIGNALS, ActiveEffect, Effect, Energy, Enters, Parameter, Shape
from tests.slopes import evaluate_slope

Floats = np.ndarray
Signals = dict[str, Floats]

PROCEDURES = {"starting-torque", "locked-output", "backdrive", "free-run"}
CONDITIONS = {"", " (loaded)", " (fast)", " (warming up)"}
UNITS = {Enters.TORSION: "rad", Enters.MOTOR_BALANCE: "N*m", Enters.OUTPUT_BALANCE: "N*m", Enters.FRICTION: "N*m"}
UNIT_WORDS = {"1", "rad", "N", "m", "s", "A", "K", "degC", "kg", "Hz", "rev", "counts"}
CURVES = ("sine", "nested", "two frequencies")
PERIOD = 100.0
CYCLES = 5
SAMPLES = 40000
NEGLIGIBLE = 1e-4
"""Part of the work that passes through an effect in a cycle; trapezoids over 40000 samples leave 2e-5."""
NEGLIGIBLE_WITH_A_GAP = 3e-3
"""The same where an effect remembers: within the step in which a gap closes its slope has two values."""

ALL = tuple(CATALOGUE.values())
REMEMBERING = [effect for effect in ALL if effect.memory]
REACTING = [effect for effect in ALL if effect.slope is not None]
ADDED = [effect for effect in ALL if effect.amplitudes]
WORKING = [effect for effect in ALL if effect.energy is not Energy.NONE and effect.enters is not Enters.FRICTION]


def over(effects):
    return pytest.mark.parametrize("effect", effects, ids=[effect.id for effect in effects])


def typical(effect: Effect, **changed: float) -> tuple[float, ...]:
    """Typical values with a phase that puts no sample on a symmetry of the effect."""
    values = {p.name: 0.3 if p.name == "phase" else p.typical for p in effect.parameters}
    return tuple((values | changed).values())


def scaled(effect: Effect, factor: float) -> tuple[float, ...]:
    amplitudes = {p.name: factor * p.typical for p in effect.parameters if p.name in effect.amplitudes}
    return typical(effect, **amplitudes)


def curve(name: str, turn: Floats) -> Floats:
    """A closed curve within +-1 over one turn (rad): one reversal each way, nested ones, or uneven ones."""
    if name == "sine":
        return np.sin(turn)
    if name == "nested":
        return 0.6 * np.sin(turn) + 0.4 * np.sin(5.0 * turn)
    return 0.6 * np.sin(2.0 * turn) + 0.4 * np.sin(3.0 * turn + 0.7)


def path(name: str, time: Floats, period: float, mirrored: float = 1.0) -> Signals:
    """All signals of a bench that goes round and round: each on the same curve, at its own lag and size.

    mirrored: sign of everything but the output torque.
    """
    step, turn = time[1] - time[0], 2.0 * np.pi * time / period
    motor_position = mirrored * curve(name, turn - 0.8)
    output_position = mirrored * 0.5 * curve(name, turn - 0.4)
    output_torque = 16.0 * curve(name, turn)
    motor_velocity = np.gradient(motor_position, step)
    return {
        "time": time,
        "motor_position": motor_position,
        "motor_velocity": motor_velocity,
        "motor_acceleration": np.gradient(motor_velocity, step),
        "motor_torque": mirrored * 0.17 * curve(name, turn - 1.1),
        "motor_current": mirrored * 0.5 * curve(name, turn - 1.1),
        "output_position": output_position,
        "output_velocity": np.gradient(output_position, step),
        "output_torque": output_torque,
        "temperature": 30.0 + mirrored * 10.0 * curve(name, turn - 2.0),
        "motor_temperature": 40.0 + mirrored * 10.0 * curve(name, turn - 2.0),
        "locked": np.ones_like(time),
        "flexspline_torsion": flexspline_torsion(output_torque, 8336.0, 0.0449),
        "base_friction": 0.012 + 1e-4 * np.abs(motor_velocity),
    }


def some_path(samples: int = 2000) -> Signals:
    return path("two frequencies", np.arange(samples) * 5e-3, 4.0)


@over(ALL)
def test_the_entry_is_complete(effect: Effect):
    optional = {"slope", "linear", "memory", "reads"} | ({"amplitudes"} if effect.enters is Enters.BASE else set())
    for item in fields(Effect):
        if item.name not in optional:
            assert getattr(effect, item.name), f"{effect.id}: {item.name} is empty"
    assert CATALOGUE[effect.id] is effect
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", effect.id)
    assert inspect.getmodule(effect.function).__name__.endswith(f".{effect.id.replace('-', '_')}")
    assert set(effect.shows) <= {f"{name}{condition}" for name in PROCEDURES for condition in CONDITIONS}


@over(ALL)
def test_the_equation_names_every_parameter_that_is_estimated(effect: Effect):
    for parameter in effect.parameters:
        if not parameter.known:
            assert re.search(rf"\b{parameter.name}\b", effect.equation), parameter.name


@over(ALL)
def test_what_it_can_be_taken_for_is_in_the_catalogue_and_can_be_taken_for_it(effect: Effect):
    assert effect.id not in effect.confusable
    assert len(set(effect.confusable)) == len(effect.confusable)
    for other in effect.confusable:
        assert effect.id in CATALOGUE[other].confusable, other


@over(ALL)
def test_units_and_ranges_are_sane(effect: Effect):
    names = [p.name for p in effect.parameters]
    assert len(set(names)) == len(names)
    for p in effect.parameters:
        usual_low, usual_high = p.usual
        assert p.low <= usual_low <= p.typical <= usual_high <= p.high, p.name
        assert usual_low < usual_high
        assert p.low < p.high
        assert all(math.isfinite(value) for value in (p.low, p.typical, p.high))
        assert set(re.findall(r"[A-Za-z]+|1", re.sub(r"\^\d", "", p.unit))) <= UNIT_WORDS, p.unit
    by_name = {p.name: p for p in effect.parameters}
    for name in effect.amplitudes:
        assert by_name[name].low <= 0.0 < by_name[name].typical
        assert not by_name[name].known
    if effect.enters is Enters.READING:
        assert effect.unit == BY_NAME[effect.reads].unit
    else:
        assert not effect.reads
        assert effect.unit == UNITS.get(effect.enters, effect.unit)


@over(ALL)
def test_only_a_reading_has_no_part_in_the_energy(effect: Effect):
    assert (effect.energy is Energy.NONE) == (effect.enters is Enters.READING)


@over(ALL)
def test_it_depends_on_signals_of_the_bench(effect: Effect):
    assert effect.signals
    assert set(effect.signals) <= {"time", *BY_NAME, *DERIVED_SIGNALS}
    assert not {"motor_acceleration"} & set(effect.signals) or effect.enters is Enters.BASE
    assert effect.variable in {"time", *BY_NAME}


@over(ALL)
def test_its_function_takes_the_parameters_of_the_entry(effect: Effect):
    expected = [*effect.signals, *(["step", "memory"] if effect.memory else []), *(p.name for p in effect.parameters)]
    assert list(inspect.signature(effect.function).parameters) == expected
    if effect.slope is not None:
        assert inspect.signature(effect.slope) == inspect.signature(effect.function)


def out_of_range(p: Parameter) -> tuple[float, ...]:
    return (p.high + abs(p.high) + 1.0, p.low - abs(p.low) - 1.0, math.nan, math.inf)


@over(ALL)
def test_a_value_outside_its_physical_range_is_refused(effect: Effect):
    ActiveEffect(effect, typical(effect))
    for p in effect.parameters:
        for value in out_of_range(p):
            with pytest.raises(ValueError, match=f"{effect.id}: {p.name} = ") as error:
                ActiveEffect(effect, typical(effect, **{p.name: value}))
            unit = "" if p.unit == "1" else f" {p.unit}"
            for part in (f"{value!r}{unit}", f"at least {p.low:g} and at most {p.high:g}{unit}; ", effect.equation):
                assert part in str(error.value)


@over(ADDED)
def test_without_amplitude_it_adds_exactly_nothing(effect: Effect):
    signals = some_path()
    assert np.all(evaluate(effect, signals, scaled(effect, 0.0), step=5e-3) == 0.0)
    assert np.any(evaluate(effect, signals, typical(effect), step=5e-3) != 0.0) or effect.shape is Shape.EVENT
    if effect.slope is not None:
        assert np.all(evaluate_slope(effect, signals, scaled(effect, 0.0), step=5e-3) == 0.0)


@over(ADDED)
def test_it_is_linear_in_the_amplitudes_or_says_that_it_is_not(effect: Effect):
    signals = path("two frequencies", np.arange(20000) * 5e-3, 4.0)
    one = evaluate(effect, signals, typical(effect), step=5e-3)
    size = float(np.max(np.abs(one)))
    assert size > 0.0
    twice = evaluate(effect, signals, scaled(effect, 2.0), step=5e-3)
    if not effect.linear:
        assert np.max(np.abs(twice - 2.0 * one)) > 1e-6 * size
        return
    # products of a few rounded numbers: some units in the last place
    for factor in (0.25, 2.0, -3.0):
        more = evaluate(effect, signals, scaled(effect, factor), step=5e-3)
        assert np.max(np.abs(more - factor * one)) <= 1e-14 * size
    alone = np.zeros_like(one)
    for name in effect.amplitudes:
        others = {other: 0.0 for other in effect.amplitudes if other != name}
        alone += evaluate(effect, signals, typical(effect, **others), step=5e-3)
    assert np.max(np.abs(alone - one)) <= 1e-14 * size


@over(ALL)
def test_compiled_and_plain_give_the_same(effect: Effect):
    signals = some_path()
    for evaluated in (evaluate, *((evaluate_slope,) if effect.slope is not None else ())):
        compiled, plain = (
            evaluated(effect, signals, typical(effect), step=5e-3, compiled=which) for which in (True, False)
        )
        # elementary functions of two libraries differ in the last place
        assert np.max(np.abs(compiled - plain)) <= 1e-15 * np.max(np.abs(plain))


@over(ALL)
def test_at_rest_it_stays_as_it_started(effect: Effect):
    still = {name: np.full(500, values[700]) for name, values in some_path().items()}
    value = evaluate(effect, still, typical(effect), step=0.02)
    assert np.ptp(value) <= 1e-15 * np.max(np.abs(value))


@over(REMEMBERING)
def test_a_run_in_two_parts_is_a_run_in_one(effect: Effect):
    signals, memory, values = some_path(), np.zeros(effect.memory), typical(effect)
    parts = [
        evaluate(effect, {name: column[cut] for name, column in signals.items()}, values, step=5e-3, memory=memory)
        for cut in (slice(0, 777), slice(777, None))
    ]
    assert np.array_equal(np.concatenate(parts), evaluate(effect, signals, values, step=5e-3))


@over(REMEMBERING)
def test_what_remembers_needs_a_step_and_its_own_memory(effect: Effect):
    signals, values = some_path(10), typical(effect)
    for step in (None, 0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=f"{effect.id} remembers and needs the step"):
            evaluate(effect, signals, values, step=step)
    with pytest.raises(ValueError, match=f"{effect.id}: memory has the shape"):
        evaluate(effect, signals, values, step=1.0, memory=np.zeros(effect.memory + 1))


@over(REMEMBERING)
def test_its_error_falls_with_the_square_of_the_step(effect: Effect):
    duration, coarsest, finer = 40.0, 4.1e-3, 64
    exact, errors = None, []
    for division in (finer, 1, 4):
        step = coarsest / division
        time = np.arange(round(duration / step) + 1) * step
        value = evaluate(effect, path("two frequencies", time, math.sqrt(13.0)), typical(effect), step=step)[::division]
        if exact is None:
            exact = value
            assert np.any(exact != 0.0)
        else:
            errors.append(float(np.sqrt(np.mean((value - exact) ** 2))))
    coarse, fine = errors
    # exactly second order gives 16; where a turning point or a delay falls between the samples is luck (the period is
    # no multiple of the step, so that every case occurs). Events know no step.
    assert coarse <= 1e-13 * np.max(np.abs(exact)) or 10.0 < coarse / fine < 25.0, (coarse, fine)


@over([effect for effect in ALL if effect.enters is Enters.TORSION])
def test_its_slope_is_that_of_its_coenergy(effect: Effect):
    """Derivative by the motor angle of the addition's integral over the output torque, per N*m of output torque.

    Taken at a fixed memory and in the direction in which the motor moves: a gap has ends.
    """
    if effect.slope is None:
        assert "motor_position" not in effect.signals, "it depends on the motor angle and must react on the motor"
        return
    rng = np.random.default_rng(3)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    memory, values, h = np.zeros(effect.memory), typical(effect), 1e-8
    angle, seen = 0.0, []

    def coenergy(at: dict[str, float]) -> float:
        total = 0.0
        for node, weight in zip(nodes, weights, strict=True):
            now = at | {"output_torque": 0.5 * at["output_torque"] * (1.0 + node)}
            scratch = (1e-3, memory.copy()) if effect.memory else ()
            total += 0.5 * at["output_torque"] * weight * effect.function(*signals_of(now), *scratch, *values)
        return total

    def signals_of(at: dict[str, float]) -> list[float]:
        return [at[name] for name in effect.signals]

    for _ in range(200):
        move = rng.uniform(-2e-3, 2e-3)
        angle += move
        torque = rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 16.0)
        at = {"motor_position": angle, "output_torque": torque}
        ahead = math.copysign(h, move)
        arguments = (*signals_of(at), *((1e-3, memory) if effect.memory else ()), *values)
        effect.function(*arguments)
        before = memory.copy()
        slope = effect.slope(*arguments)
        assert np.array_equal(memory, before)
        near, far, here = (coenergy(at | {"motor_position": angle + k * ahead}) for k in (1, 2, 0))
        # one-sided difference of second order: (order h)^2 relative, and rounding 1e-16 / h of the addition
        derivative = (4.0 * near - far - 3.0 * here) / (2.0 * ahead * torque)
        assert slope == pytest.approx(derivative, rel=1e-6, abs=1e-10)
        seen.append(slope)
    assert np.ptp(seen) > 0.0


def work(effect: Effect, signals: Signals, step: float) -> tuple[float, float]:
    """Work that the effect takes in the last cycle, and all that passes through it, J."""
    value = evaluate(effect, signals, typical(effect), step=step)
    last = slice(-SAMPLES - 1, None)

    def integral(torque: Floats, angle: Floats) -> tuple[float, float]:
        pieces = 0.5 * (torque[last][1:] + torque[last][:-1]) * np.diff(angle[last])
        return float(np.sum(pieces)), float(np.sum(np.abs(pieces)))

    if effect.enters is Enters.TORSION:
        # what takes the wave generator's torque lies in series with it, at the motor's shaft
        in_series = effect.signals == ("motor_torque",)
        taken, gross = integral(signals["motor_torque" if in_series else "output_torque"], value)
        if effect.slope is not None:
            reaction = signals["output_torque"] * evaluate_slope(effect, signals, typical(effect), step=step)
            given, more = integral(reaction, signals["motor_position"])
            return taken - given, gross + more
        return taken, gross
    if effect.enters is Enters.BASE and effect.variable in ("output_torque", "motor_torque"):
        return integral(signals[effect.variable], value)
    shaft = "output_position" if effect.enters is Enters.OUTPUT_BALANCE else "motor_position"
    return integral(value, signals[shaft])


@over(WORKING)
def test_over_closed_cycles_it_takes_energy_as_its_class_says(effect: Effect):
    time = np.arange(CYCLES * SAMPLES + 1) * (PERIOD / SAMPLES)
    shares = []
    for name in CURVES:
        for mirrored in (1.0, -1.0):
            taken, gross = work(effect, path(name, time, PERIOD, mirrored), PERIOD / SAMPLES)
            assert gross > 0.0
            shares.append(taken / gross)
    # the corners of a play and of a gap fall between samples
    cornered = effect.memory or effect.signals == ("motor_torque",)
    negligible = NEGLIGIBLE_WITH_A_GAP if cornered else NEGLIGIBLE
    if effect.energy is Energy.CONSERVATIVE:
        assert np.max(np.abs(shares)) < negligible, shares
    elif effect.energy is Energy.DISSIPATIVE:
        assert min(shares) > negligible, shares
    else:
        assert min(shares) < -negligible, f"it never puts energy in: {shares}"


@over([effect for effect in ALL if effect.enters is Enters.FRICTION])
def test_typical_friction_never_drives(effect: Effect):
    assert effect.energy is Energy.DISSIPATIVE
    for name in CURVES:
        signals = path(name, np.arange(20000) * 5e-3, 4.0)
        level = signals["base_friction"] + evaluate(effect, signals, typical(effect), step=5e-3)
        assert np.min(level) >= 0.0
