"""Parameters of the harmonic drive and of the simulated bench, with the checks that keep them physical."""

import math
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Self

from sim_backend.errors import ModelError, shown
from sim_backend.model import limits
from sim_backend.model.checks import require
from sim_backend.model.compliance import Compliance, check_cubic, check_piecewise
from sim_backend.model.estimation import flexspline_from_catalogue, wave_generator_from_tests
from sim_backend.model.limits import require_within

DAMPING_SHARE = 0.9
"""Part of the step's stability limit that springs and dampers of a body together may use."""


class Rotation(StrEnum):
    """Whether the output turns against the wave generator or with it."""

    OPPOSED = "opposed"
    SAME = "same"


@dataclass(frozen=True, slots=True)
class HarmonicDrive:
    """Compliance and friction of one harmonic drive; Zhang, Ahmad & Liu 2014, equations (22)-(28).

    ratio: 1. K_F0 (N*m/rad at the output) and C_F (1/(N*m)): flexspline. K_w0 (N*m/rad at the motor) and
    C_w (1/(N*m)): wave generator. friction_torque: dry friction of the tooth mesh, N*m at the output;
    viscous_friction: N*m*s, seen at the motor.
    """

    ratio: float
    K_F0: float
    C_F: float
    K_w0: float
    C_w: float
    friction_torque: float
    viscous_friction: float = 0.0

    def __post_init__(self) -> None:
        require_within(limits.DRIVE, _numbers(self))

    @classmethod
    def from_catalogue(
        cls,
        ratio: float,
        K1: float,
        K2: float,
        T1: float,
        T2: float,
        hysteresis_loss: float,
        starting_torque: float,
        *,
        viscous_friction: float = 0.0,
    ) -> Self:
        """Estimate the parameters from catalogue values, Zhang (29)-(35).

        K1, K2: N*m/rad below T1 and between T1 and T2 (N*m). hysteresis_loss: rad at the output.
        starting_torque: N*m at the motor. See `estimation` for what the paper printed otherwise.
        Raises ModelError if a value is out of range or no drive has these stiffnesses.
        """
        K_F0, C_F = flexspline_from_catalogue(K1, K2, T1, T2)
        K_w0, C_w = wave_generator_from_tests(ratio, hysteresis_loss, starting_torque)
        return cls(
            ratio=ratio,
            K_F0=K_F0,
            C_F=C_F,
            K_w0=K_w0,
            C_w=C_w,
            friction_torque=ratio * starting_torque,
            viscous_friction=viscous_friction,
        )


@dataclass(frozen=True, slots=True)
class Cubic:
    """Flexspline after Zhang (10), T = a1 f + a3 f^3: a1 in N*m/rad, a3 in N*m/rad^3; a3 = 0 is a linear spring."""

    a1: float
    a3: float

    def __post_init__(self) -> None:
        check_cubic(self.a1, self.a3)


@dataclass(frozen=True, slots=True)
class Piecewise:
    """Flexspline after Zhang (11), continued as an odd law: slopes 1/K1, 1/K2 above T1, 1/K3 above T2; N*m/rad, N*m."""

    K1: float
    K2: float
    K3: float
    T1: float
    T2: float

    def __post_init__(self) -> None:
        check_piecewise(self.K1, self.K2, self.K3, self.T1, self.T2)


@dataclass(frozen=True, slots=True)
class PlantConfig:
    """Everything the simulated bench consists of. Inertias kg*m^2, damping N*m*s/rad, each at its own shaft.

    All dry and viscous friction of the base plant sits at the rim (the tooth mesh): `drive.friction_torque` and
    `drive.viscous_friction`. `rotor_friction` (N*m) and `rotor_viscous_friction` (N*m*s) come on top of it,
    and so does `output_viscous_friction` (N*m*s) at the output.
    `output_inertia` includes arm and load motor. The damping of the springs is structural: the rotor on the
    sticking rim rings at 34 Hz with a damping ratio of about 0.15. Both springs go on in a straight line above their
    stiffness caps (at 1000 N*m/rad the torsion differs by 0.4 urad rms from equation (28); a flexspline of size 17
    reaches its cap at 65 N*m, and its gear ratchets at 160). Energy is kept at any torque, but nothing ratchets.
    `flexspline`: another law of the flexspline in place of the drive's own (24).
    `torque_constant` (N*m/A) is the one that the motor's drive believes in. `encoder_counts` (1/rev): counts of the
    motor's encoder in a turn; the plant's own angles keep fractions of one, the simulated drive cuts them off.
    Gear housing and motor are one thermal node each between their heat and `ambient_temperature` (degC): heat capacity
    J/K, thermal resistance K/W. Friction and dampers warm the gear, the current the motor through `winding_resistance`
    (ohm; None: the one with which the rated torque warms it by 75 K in the end). With the default values, which are
    working values for size 17, both settle in about 20 minutes and 2000 rpm without load warm the gear by some 30 K.
    Noises are standard deviations of white noise per reading.
    """

    drive: HarmonicDrive
    rotation: Rotation = Rotation.OPPOSED
    flexspline: Cubic | Piecewise | None = None
    rotor_inertia: float = 2.2e-5
    wave_generator_inertia: float = 7.9e-6
    output_inertia: float = 5e-4
    rotor_friction: float = 0.0
    rotor_viscous_friction: float = 0.0
    output_viscous_friction: float = 0.0
    wave_generator_damping: float = 1.9e-3
    flexspline_damping: float = 0.2
    wave_generator_stiffness_cap: float = 1000.0
    flexspline_stiffness_cap: float = 8e4
    fixture_stiffness: float = 2e5
    fixture_damping: float = 1.0
    torque_constant: float = 0.321
    encoder_counts: float = 16384.0
    motor_rated_torque: float = 0.188
    load_rated_torque: float = 20.0
    motor_speed_limit: float = 600.0
    load_speed_limit: float = 10.0
    current_loop_time: float = 1e-4
    loop_period: float = 1e-4
    step: float = 2e-5
    output_torque_noise: float = 0.02
    motor_torque_noise: float = 2e-4
    load_torque_noise: float = 0.01
    motor_angle_noise: float = 2e-5
    output_angle_noise: float = 1e-6
    motor_velocity_noise: float = 1e-2
    load_velocity_noise: float = 1e-4
    temperature: float = 25.0
    motor_temperature: float = 25.0
    ambient_temperature: float = 25.0
    gear_heat_capacity: float = 300.0
    gear_thermal_resistance: float = 4.0
    motor_heat_capacity: float = 170.0
    motor_thermal_resistance: float = 6.5
    winding_resistance: float | None = None

    def __post_init__(self) -> None:
        if self.rotation != Rotation.OPPOSED:
            raise ModelError(
                f"rotation = {shown(self.rotation)}: the simulated bench turns its output against the motor only. "
                f"Use 'opposed', or mirror the motor's signals before they reach the model."
            )
        self._check_parts()
        without = ("winding_resistance",) if self.winding_resistance is None else ()
        require_within(limits.BENCH, _numbers(self, *_PARTS, *without))
        self._check_caps()
        ticks = self.loop_period / self.step
        if round(ticks) < 1 or not math.isclose(ticks, round(ticks), rel_tol=1e-9):
            raise ModelError(
                f"step = {self.step:g} s: loop_period = {self.loop_period:g} s must be a whole multiple of it, it is "
                f"{ticks:g} steps; the drive loops, which act once in a loop_period at the start of a step, need it."
            )
        self._check_step()

    def _check_parts(self) -> None:
        """Raise ModelError if drive or flexspline is something else."""
        if not isinstance(self.drive, HarmonicDrive):
            raise ModelError(f"drive = {shown(self.drive)} is not possible: a bench needs a HarmonicDrive.")
        if not isinstance(self.flexspline, Cubic | Piecewise | None):
            raise ModelError(
                f"flexspline = {shown(self.flexspline)} is not possible: it must be None (the drive's own law, Zhang "
                f"(24)), Cubic (10) or Piecewise (11)."
            )

    def _check_caps(self) -> None:
        """Raise ModelError if a spring is stiffer at rest than the stiffness up to which its law is followed."""
        K_w0, cap = self.drive.K_w0, self.wave_generator_stiffness_cap
        require("wave_generator_stiffness_cap", cap, "N*m/rad", f"K_w0 = {K_w0:g} N*m/rad of Zhang (25)", above=K_w0)
        match self.flexspline:
            case None:
                at_rest, law = self.drive.K_F0, f"K_F0 = {self.drive.K_F0:g} N*m/rad of Zhang (22)"
            case Cubic(a1):
                at_rest, law = a1, f"a1 = {a1:g} N*m/rad of Zhang (10)"
            case Piecewise(K1, K2, K3):
                at_rest = max(K1, K2, K3)
                law = f"the largest of K1, K2, K3 of Zhang (11), {at_rest:g} N*m/rad,"
        require("flexspline_stiffness_cap", self.flexspline_stiffness_cap, "N*m/rad", law, above=at_rest)

    def _check_step(self) -> None:
        """Raise ModelError if a body swings too fast on its springs, or is damped too strongly, for the step."""
        on_flange = self.flexspline_stiffness_cap + self.fixture_stiffness
        self._check_body("motor", self.motor_inertia, self.wave_generator_stiffness_cap, _ON_MOTOR)
        self._check_body("output", self.output_inertia, on_flange, _ON_OUTPUT)

    def _check_body(self, body: str, inertia: float, stiffness: float, dampers: tuple[str, ...]) -> None:
        """Raise ModelError if the step is too long for an inertia with all that can act on it at once."""
        on_springs, damped = _longest_steps(inertia, stiffness, self._sum_of(dampers))
        if self.step <= min(on_springs, damped):
            return
        if on_springs <= damped:
            cause, remedy = f"on its springs of {stiffness:g} N*m/rad", "lower stiffness caps"
            rule = "h^2 K/J <= 1 (stable up to 4)"
        else:
            rule = f"h d/J + h^2 K/(4 J) <= {DAMPING_SHARE:g} (stable up to 1)"
            named = ", ".join(f"{name} = {getattr(self, name):g}" for name in dampers if getattr(self, name) > 0.0)
            cause, remedy = f"with its dampers ({named} N*m*s/rad)", "less damping"
        raise ModelError(
            f"step = {self.step:g} s is too long for the {body} inertia of {inertia:g} kg*m^2 {cause}: "
            f"at most {min(on_springs, damped):.4g} s; velocity Verlet needs {rule}. Use a shorter step "
            f"(loop_period must stay a whole multiple), a larger {body} inertia or {remedy}."
        )

    def _sum_of(self, dampers: tuple[str, ...]) -> float:
        """Give the damping (N*m*s/rad) of these together."""
        return float(sum(getattr(self, name) for name in dampers))

    @property
    def law(self) -> Compliance:
        """The flexspline's law by its name."""
        match self.flexspline:
            case None:
                return Compliance.ARCTAN
            case Cubic():
                return Compliance.CUBIC
            case Piecewise():
                return Compliance.PIECEWISE

    @property
    def stiffness_at_rest(self) -> float:
        """The flexspline's stiffness without torque, N*m/rad, after its own law."""
        match self.flexspline:
            case None:
                return self.drive.K_F0
            case Cubic(a1):
                return a1
            case Piecewise(K1):
                return K1

    @property
    def largest_stiffness(self) -> float:
        """The largest stiffness that the flexspline reaches at whatever torque, N*m/rad, after its own law."""
        match self.flexspline:
            case None:
                return self.flexspline_stiffness_cap
            case Cubic(a1, a3):
                return self.flexspline_stiffness_cap if a3 > 0.0 else a1
            case Piecewise(K1, K2, K3):
                return max(K1, K2, K3)

    @property
    def stiffness_for_step(self) -> float:
        """The largest stiffness that a flexspline may have on the output for the step, N*m/rad, beside the fixture."""
        on_flange = _largest_stiffness(self.step, self.output_inertia, self._sum_of(_ON_OUTPUT))
        return on_flange - self.fixture_stiffness

    @property
    def motor_inertia(self) -> float:
        """Rotor and wave generator together, kg*m^2."""
        return self.rotor_inertia + self.wave_generator_inertia


_PARTS = ("drive", "rotation", "flexspline")
"""What of a bench is no number."""

_ON_MOTOR = ("rotor_viscous_friction", "wave_generator_damping")
_ON_OUTPUT = ("output_viscous_friction", "flexspline_damping", "fixture_damping")
"""Dampers that can act on a body at once."""


def _longest_steps(inertia: float, stiffness: float, damping: float) -> tuple[float, float]:
    """Give the longest steps (s) that an inertia (kg*m^2) allows: for its springs (N*m/rad), and for its dampers too.

    With w = h^2 K/J and z = h d/J (d: N*m*s/rad) a step h is stable up to z + w/4 = 1: a damper takes
    the speed extrapolated to the end of the step. Asked is w <= 1 and z + w/4 <= DAMPING_SHARE.
    """
    # the root of z + w/4 = DAMPING_SHARE, in the form that takes no difference
    rate, square = damping / inertia, stiffness / inertia
    damped = 2.0 * DAMPING_SHARE / (rate + math.sqrt(rate**2 + square * DAMPING_SHARE))
    return math.sqrt(inertia / stiffness), damped


def _largest_stiffness(step: float, inertia: float, damping: float) -> float:
    """Give the stiffness (N*m/rad) for which `step` is the shorter of `_longest_steps`: the same rule, solved for K."""
    return min(1.0, 4.0 * (DAMPING_SHARE - step * damping / inertia)) * inertia / step**2


def _numbers(parameters: HarmonicDrive | PlantConfig, *without: str) -> dict[str, object]:
    """Give the parameters that must be numbers, by name."""
    return {f.name: getattr(parameters, f.name) for f in fields(parameters) if f.name not in without}
