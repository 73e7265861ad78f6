"""What a plant's effects may be on this plant: narrower than their own ranges, which hold for every drive.

An effect may assume no other ratio, torque constant or motor encoder than the bench has; together they must leave the
flexspline a compliance; what goes with the motor's angle must not pass too fast for the step; and the motor's drive,
which regulates what it reads, must be able to reach the torque that it reads.
"""

import math
from collections.abc import Iterator, Sequence

from sim_backend.errors import ModelError
from sim_backend.model.effects import ActiveEffect
from sim_backend.model.parameters import PlantConfig
from sim_backend.model.series import LEAST_COMPLIANCE
from sim_backend.model.step_bounds import MOST_MISSED, highest_order, most_amplitude

STIFFNESS_APART = 2.0
"""Factor by which the stiffness that an effect is given may differ from that of the drive's flexspline at rest."""

MOST_CONSTANT_ERROR = 0.5
"""Largest sum of errors of the torque constant. The drive reads with the torque of the tick before, so that its torque
settles by this factor in every tick, and not at all from 1 on."""

MOST_SATURATION = 1.0 / 3.0
"""Largest amplitude * motor_current^2: where k_t i (1 - amplitude i^2) has its largest torque."""


def check_effects(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError if the plant of `config` cannot have these effects."""
    _check_known(effects, config)
    _check_compliance(effects, config)
    _check_order(effects, config)
    _check_error(effects, config)
    _check_torque_constant(effects, config)


def _check_known(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError if an effect was given another ratio, torque constant, count or stiffness than the bench has.

    The stiffness may differ by a factor of STIFFNESS_APART: what is fitted often is not what a catalogue says.
    """
    own = {
        "ratio": config.drive.ratio,
        "torque_constant": config.torque_constant,
        "encoder_counts": config.encoder_counts,
    }
    at_rest = config.stiffness_at_rest
    for active in effects:
        for parameter, value in zip(active.effect.parameters, active.values, strict=True):
            name = parameter.name
            if parameter.known and name == "stiffness" and abs(math.log(value / at_rest)) > math.log(STIFFNESS_APART):
                raise ModelError(
                    f"{active.effect.id}: stiffness = {value!r} {parameter.unit} contradicts the drive, which has "
                    f"{at_rest:.6g} {parameter.unit} at rest: between {at_rest / STIFFNESS_APART:.6g} and "
                    f"{at_rest * STIFFNESS_APART:.6g} {parameter.unit}; {active.effect.equation} needs it."
                )
            if parameter.known and name in own and not math.isclose(value, own[name], rel_tol=1e-9):
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                raise ModelError(
                    f"{active.effect.id}: {name} = {value!r}{unit} contradicts the bench, which has "
                    f"{own[name]!r}{unit}; {active.effect.equation} needs the same."
                )


def _check_compliance(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError unless warming and modulation leave a compliance that the step can take at whatever torque.

    A jolt bends the flexspline up to its largest stiffness K. Of 1/K, times what warming leaves, less all modulations,
    there must remain LEAST_COMPLIANCE of 1/K, or more where the step needs it: with none left the flexspline would push
    where it is pulled.
    """
    stiffness = config.largest_stiffness
    least = max(LEAST_COMPLIANCE / stiffness, 1.0 / config.stiffness_for_step)
    warming = list(_of(effects, "temperature-dependent-stiffness"))
    left = {
        temperature: 1.0 + sum(values["amplitude"] * (temperature - values["reference"]) for _, values in warming)
        for temperature in (config.temperature, config.ambient_temperature)
    }
    temperature, share = min(left.items(), key=lambda item: item[1])
    if warming and share <= least * stiffness:
        active, values = min(warming, key=lambda item: item[1]["amplitude"] * (temperature - item[1]["reference"]))
        raise ModelError(
            f"{active.effect.id}: amplitude = {values['amplitude']!r} 1/K with reference = {values['reference']:g} "
            f"degC leaves {share:.4g} of the flexspline's compliance at {temperature:g} degC; it must be above "
            f"{least * stiffness:.4g}, which step = {config.step:g} s and the solution need at {stiffness:.6g} "
            f"N*m/rad, the largest stiffness that a jolt reaches; {active.effect.equation} needs it."
        )
    most = max(share / stiffness - least, 0.0)
    total = 0.0
    for active, values in _of(effects, "stiffness-modulation"):
        total += values["amplitude"]
        if total > most:
            raise ModelError(
                f"{active.effect.id}: amplitude = {values['amplitude']!r} rad/(N*m) is not possible: all such "
                f"amplitudes together must be at most {most:.4g} rad/(N*m) here (1/K_F = {1.0 / stiffness:.4g} "
                f"rad/(N*m) at the largest stiffness that a jolt reaches, of which warming leaves {share:.4g} and step "
                f"= {config.step:g} s needs {least:.4g}), or the flexspline would push where it is pulled; "
                f"{active.effect.equation} needs it. Make it smaller, or flexspline_stiffness_cap lower."
            )


def _check_order(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError if an angle that goes with the motor passes by more than half a period in a step."""
    most = highest_order(config)
    for name in ("kinematic-error", "stiffness-modulation"):
        for active, values in _of(effects, name):
            order = values["order"]
            if values["amplitude"] > 0.0 and order > most:
                raise ModelError(
                    f"{name}: order = {order!r} 1/rev is not possible: it must be at most {most:.4g} 1/rev, where "
                    f"order * w * step = pi at motor_speed_limit w = {config.motor_speed_limit:g} rad/s and step = "
                    f"{config.step:g} s, or less than two steps see a period of it; {active.effect.equation} needs it. "
                    f"Use a step of at most {config.step * most / order:.4g} s (loop_period must stay a whole "
                    f"multiple) or a lower order."
                )


def _check_error(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError if kinematic errors shake the flexspline faster than the step keeps the energy of.

    Amplitudes of one order add up, and so do the powers of different orders: squares of parts of what each may have.
    """
    amplitudes: dict[float, float] = {}
    for active, values in _of(effects, "kinematic-error"):
        order, amplitude = values["order"], values["amplitude"]
        amplitudes[order] = amplitudes.get(order, 0.0) + amplitude
        used = sum((amplitudes[other] / most_amplitude(other, config)) ** 2 for other in amplitudes)
        if used > 1.0:
            raise ModelError(
                f"{active.effect.id}: amplitude = {amplitude!r} rad is not possible at order = {order!r} 1/rev: it "
                f"must be at most {most_amplitude(order, config):.4g} rad here, and less beside others (all together "
                f"use {used:.4g} times what there is). At up to motor_speed_limit w = {config.motor_speed_limit:g} "
                f"rad/s it shakes the flexspline, and of the power for that step h = {config.step:g} s misses "
                f"(order w h)^2/12, which may be {MOST_MISSED:g} of all power put in; {active.effect.equation} needs "
                f"it. Use a shorter step (loop_period must stay a whole multiple), a smaller amplitude or a lower "
                f"order."
            )


def _check_torque_constant(effects: Sequence[ActiveEffect], config: PlantConfig) -> None:
    """Raise ModelError where the current that the drive believes in gives no torque that it can regulate."""
    total = 0.0
    for active, values in _of(effects, "torque-constant-error"):
        total += values["amplitude"]
        if abs(total) > MOST_CONSTANT_ERROR:
            raise ModelError(
                f"{active.effect.id}: amplitude = {values['amplitude']!r} is not possible in the plant: all such "
                f"amplitudes together must be within {-MOST_CONSTANT_ERROR:g} to {MOST_CONSTANT_ERROR:g} (usual are "
                f"0.01 to 0.1), or the drive that regulates what it reads does not settle; {active.effect.equation} "
                f"needs it."
            )
    current = config.motor_rated_torque / config.torque_constant
    most = MOST_SATURATION / current**2
    total = 0.0
    for active, values in _of(effects, "torque-constant-saturation"):
        total += values["amplitude"]
        if total > most:
            raise ModelError(
                f"{active.effect.id}: amplitude = {values['amplitude']!r} 1/A^2 is not possible in the plant: it must "
                f"be at most 1/(3 i^2) = {most:.4g} 1/A^2 at the rated current i = {current:.4g} A, or the torque "
                f"falls with the current; {active.effect.equation} needs it."
            )


def _of(effects: Sequence[ActiveEffect], effect: str) -> Iterator[tuple[ActiveEffect, dict[str, float]]]:
    """Give the active effects of this id, with their values by name."""
    for active in effects:
        if active.effect.id == effect:
            yield active, {p.name: value for p, value in zip(active.effect.parameters, active.values, strict=True)}
