"""Ideal kinematics and torques of a harmonic drive, whatever member is held; Zhang, Ahmad & Liu 2014, (1)-(9).

    theta_w = (N+1) theta_c - N theta_F          (1), for speeds (2)
    T_w = T_c/(N+1) = -T_F/N                     (3)
    T_w = -(T_F - T_Fr)/N                        (9), with the friction torque T_Fr of the circular spline held

w: wave generator, c: circular spline, F: flexspline. Every configuration is (1) and (3) with one member held or two
driven: circular spline held (4)-(6), the bench; flexspline held; wave generator held; differential. What the wave
generator takes in leaves at the other two: T_w omega_w = T_c omega_c + T_F omega_F for every motion.
"""

from enum import StrEnum
from typing import NamedTuple

from sim_backend.errors import ModelError, shown
from sim_backend.model.checks import require
from sim_backend.model.limits import RATIO, require_limit

LARGEST = 1e100
"""rad, rad/s or N*m of a member that is given: beyond any, and with every ratio the others and the power are finite."""

LARGEST_DERIVED = 3.0 * RATIO.high * LARGEST
"""rad, rad/s or N*m of a member that follows from others: (1) gives up to (2N + 1) times as much, at most 3N."""


class Member(StrEnum):
    """The three members of the drive."""

    WAVE_GENERATOR = "wave-generator"
    CIRCULAR_SPLINE = "circular-spline"
    FLEXSPLINE = "flexspline"


class Members(NamedTuple):
    """One quantity of each member: angle rad, speed rad/s or torque N*m."""

    wave_generator: float
    circular_spline: float
    flexspline: float


def motion(
    ratio: float,
    *,
    wave_generator: float | None = None,
    circular_spline: float | None = None,
    flexspline: float | None = None,
) -> Members:
    """Give the angles or speeds of all three members from those of any two; (1), (2).

    A member that is held is given as 0. Raises ModelError unless exactly two are given, each within +-`LARGEST`, or
    if `ratio` is outside `limits.RATIO`.
    """
    N = _ratio(ratio)
    match _given("rad or rad/s", "(1)", wave_generator, circular_spline, flexspline):
        case None, float(c), float(f):
            return Members((N + 1.0) * c - N * f, c, f)
        case float(w), None, float(f):
            return Members(w, (w + N * f) / (N + 1.0), f)
        case float(w), float(c), None:
            return Members(w, c, ((N + 1.0) * c - w) / N)
        case _:
            raise ModelError("Equation (1) gives the third member from two: name exactly two of the three.")


def torques(
    ratio: float,
    *,
    wave_generator: float | None = None,
    circular_spline: float | None = None,
    flexspline: float | None = None,
) -> Members:
    """Give the torques of all three members from that of any one, N*m; (3).

    Raises ModelError unless exactly one is given, within +-`LARGEST`, or if `ratio` is outside `limits.RATIO`.
    """
    N = _ratio(ratio)
    match _given("N*m", "(3)", wave_generator, circular_spline, flexspline):
        case float(w), None, None:
            return Members(w, (N + 1.0) * w, -N * w)
        case None, float(c), None:
            return Members(c / (N + 1.0), c, -N * c / (N + 1.0))
        case None, None, float(f):
            return Members(-f / N, -(N + 1.0) * f / N, f)
        case _:
            raise ModelError("Equation (3) gives all torques from one: name exactly one of the three.")


def speed_ratio(ratio: float, held: Member) -> float:
    """Give the speed of the input over that of the output with one member held; negative: they turn opposed.

    Circular spline held: wave generator over flexspline, -N. Flexspline held: wave generator over circular spline,
    N+1. Wave generator held: flexspline over circular spline, (N+1)/N. Raises ModelError if `held` is no member, or
    `ratio` outside `limits.RATIO`.
    """
    N = _ratio(ratio)
    match held:
        case Member.CIRCULAR_SPLINE:
            return -N
        case Member.FLEXSPLINE:
            return N + 1.0
        case Member.WAVE_GENERATOR:
            return (N + 1.0) / N
        case _:
            raise ModelError(f"held = {shown(held)} is no member of the drive: it must be one of {', '.join(Member)}.")


def power_surplus(torque: Members, speed: Members) -> float:
    """Give T_w omega_w - T_c omega_c - T_F omega_F, W: zero for torques after (3) and speeds after (2).

    Raises ModelError for anything but numbers within +-`LARGEST_DERIVED`.
    """
    _require_members("torque", torque, "N*m")
    _require_members("speed", speed, "rad/s")
    return (
        torque.wave_generator * speed.wave_generator
        - torque.circular_spline * speed.circular_spline
        - torque.flexspline * speed.flexspline
    )


def wave_generator_torque(ratio: float, flexspline: float, friction: float) -> float:
    """Give the torque at the wave generator with the circular spline held, N*m; (9).

    flexspline: torque at the output, N*m. friction: torque T_Fr of dry friction there, N*m, signed. Raises ModelError
    if either is beyond +-`LARGEST` or `ratio` outside `limits.RATIO`.
    """
    require("flexspline", flexspline, "N*m", "equation (9)", low=-LARGEST, high=LARGEST)
    require("friction", friction, "N*m", "equation (9)", low=-LARGEST, high=LARGEST)
    return -(flexspline - friction) / _ratio(ratio)


def _ratio(ratio: float) -> float:
    require_limit("ratio", ratio, RATIO._replace(equation="equation (1)"))
    return float(ratio)


def _given(unit: str, equation: str, *values: float | None) -> tuple[float | None, ...]:
    """Give the members' values, in the order of `Members`; raise ModelError unless each is possible or not given."""
    for name, value in zip(Members._fields, values, strict=True):
        if value is not None:
            require(name, value, unit, f"equation {equation}", low=-LARGEST, high=LARGEST)
    return tuple(None if value is None else float(value) for value in values)


def _require_members(name: str, members: Members, unit: str) -> None:
    if not isinstance(members, Members):
        wanted = f"Members with a number ({unit}) for each of {', '.join(Members._fields)}"
        raise ModelError(f"{name} = {shown(members)} is not possible: it must be {wanted}; equation (3) needs it.")
    for member, value in zip(Members._fields, members, strict=True):
        require(f"{name}.{member}", value, unit, "equation (3)", low=-LARGEST_DERIVED, high=LARGEST_DERIVED)
