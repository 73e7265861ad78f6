"""Pure kinematic error as a Fourier series of the motor angle, and its identification from a slow run.

    theta_p = a_0/2 + sum_n [a_n cos(n theta_m) + b_n sin(n theta_m)]                      (17)
    a_n, b_n = (1/pi) integral over a turn of dtheta(theta_m) (cos, sin)(n theta_m)        (18), (19) with its 1/pi

dtheta = theta_m/N - theta_l (4): what the output lacks, rad at the output. Source: Castejon, Garcia-Prada & Lara 2009.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError, ParameterError, shown
from sim_backend.model.checks import is_series, require, require_all

Floats = NDArray[np.float64]

ORDERS = 7
"""With a_0 the 15 coefficients of the paper."""

TURN = 2.0 * math.pi

LEAST_SAMPLES = 4
"""Samples per cycle of the highest order, below which its integral means nothing."""

MOST_ORDERS = 100_000
"""Far more than any record tells apart."""

LARGEST_COEFFICIENT = 1e100
"""rad; its square is still a number."""

LARGEST_ANGLE, LARGEST_ERROR = 1e12, 1e50
"""rad, of a record; its integral is still a coefficient."""


@dataclass(frozen=True, slots=True)
class FourierError:
    """Coefficients of (17), rad: a_0, (a_1 ... a_k), (b_1 ... b_k).

    Raises ModelError unless there are as many a_n as b_n, all numbers within +-`LARGEST_COEFFICIENT`.
    """

    a0: float
    a: tuple[float, ...]
    b: tuple[float, ...]

    def __post_init__(self) -> None:
        for name, values in (("a", self.a), ("b", self.b)):
            if not is_series(values):
                raise ModelError(
                    f"{name} = {shown(values)} is not possible: it must be a tuple with a number (rad) for each order "
                    f"from 1 on; (17) needs it."
                )
        if len(self.a) != len(self.b):
            raise ModelError(f"{len(self.a)} a_n and {len(self.b)} b_n were given; (17) needs as many of each.")
        orders = range(1, len(self.a) + 1)
        names = ("a_0", *(f"a_{n}" for n in orders), *(f"b_{n}" for n in orders))
        for name, value in zip(names, self.coefficients, strict=True):
            require(name, value, "rad", "(17)", low=-LARGEST_COEFFICIENT, high=LARGEST_COEFFICIENT)
        object.__setattr__(self, "a0", float(self.a0))
        object.__setattr__(self, "a", tuple(map(float, self.a)))  # also of a list or an array
        object.__setattr__(self, "b", tuple(map(float, self.b)))

    @property
    def coefficients(self) -> tuple[float, ...]:
        """a_0, a_1 ... a_k, b_1 ... b_k in one row."""
        return (self.a0, *self.a, *self.b)

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitude of each order from 1 on, rad."""
        return tuple(map(math.hypot, self.a, self.b))


def pure_error(motor_position: Floats, series: FourierError) -> Floats:
    """Give theta_p (17) at every motor angle (rad), rad at the output, shape as given."""
    phases = np.multiply.outer(np.asarray(motor_position, dtype=np.float64), np.arange(1, len(series.a) + 1))
    return np.asarray(0.5 * series.a0 + np.cos(phases) @ np.array(series.a) + np.sin(phases) @ np.array(series.b))


def pure_error_slope(motor_position: Floats, series: FourierError) -> Floats:
    """Give dtheta_p/dtheta_m at every motor angle (rad), 1, shape as given."""
    orders = np.arange(1, len(series.a) + 1)
    phases = np.multiply.outer(np.asarray(motor_position, dtype=np.float64), orders)
    return np.asarray(np.cos(phases) @ (orders * np.array(series.b)) - np.sin(phases) @ (orders * np.array(series.a)))


def identify(motor_position: Floats, error: Floats, orders: int = ORDERS) -> FourierError:
    """Give the coefficients (17)-(19) of `error` (rad) over as many whole turns as the record holds.

    motor_position: rad, shape (n,), in order of time; neither evenly spaced nor free of jitter: the integral runs along
    the path, and an angle that is passed three times counts once. Trapezoidal rule: the error falls with the square of
    the spacing, and faster where it is even. Raises ModelError if the record is shorter than a turn or too coarse, a
    value is beyond +-`LARGEST_ANGLE` or +-`LARGEST_ERROR`, or `orders` is no whole number from 1 to `MOST_ORDERS`.
    """
    require_all("motor_position", motor_position, "rad", "(18), (19)", low=-LARGEST_ANGLE, high=LARGEST_ANGLE)
    require_all("error", error, "rad", "(18), (19)", low=-LARGEST_ERROR, high=LARGEST_ERROR)
    orders = _count_of_orders(orders)
    angle, value = np.asarray(motor_position, dtype=np.float64), np.asarray(error, dtype=np.float64)
    if angle.ndim != 1 or angle.shape != value.shape:
        raise ModelError(f"motor_position {angle.shape} and error {value.shape} must be two series of one length.")
    angle, value, turns = whole_turns(angle, value)
    step = np.diff(angle)
    if np.max(np.abs(step)) > TURN / (LEAST_SAMPLES * orders):
        raise ModelError(
            f"motor_position: its largest step is {np.max(np.abs(step)):.3g} rad; (18) and (19) need at most "
            f"{TURN / (LEAST_SAMPLES * orders):.3g} rad for order {orders}."
        )
    weight = np.zeros_like(angle)
    weight[:-1] += 0.5 * step
    weight[1:] += 0.5 * step
    weighted = value * weight / (math.pi * turns)
    phases = np.multiply.outer(np.arange(1, orders + 1), angle)
    a, b = np.cos(phases) @ weighted, np.sin(phases) @ weighted
    return FourierError(float(np.sum(weighted)), tuple(a.tolist()), tuple(b.tolist()))


def _count_of_orders(orders: int) -> int:
    """Give the count; raise ParameterError unless it is a whole number from 1 to `MOST_ORDERS`, ModelError for none."""
    require("orders", orders, "", "(17)", low=1.0, high=MOST_ORDERS)
    if not float(orders).is_integer():
        rule = f"must be a whole number, at least 1 and at most {MOST_ORDERS:.6g}; (17) needs it"
        raise ParameterError("orders", orders, "", rule)
    return int(orders)


def whole_turns(angle: Floats, value: Floats) -> tuple[Floats, Floats, int]:
    """Cut a record after its last whole turn, interpolating the end; gives angle, value and turns (negative backwards).

    Raises ModelError if it holds no whole turn.
    """
    travel = float(angle[-1] - angle[0]) if angle.size else 0.0
    turns = math.floor(abs(travel) / TURN + 1e-9)
    if turns == 0:
        raise ModelError(
            f"motor_position: travel of {travel:.4g} rad is less than a whole turn; (18) and (19) need one."
        )
    if travel < 0.0:
        turns = -turns
    end = float(angle[0]) + TURN * turns
    beyond = (angle >= end) if turns > 0 else (angle <= end)
    if not np.any(beyond):  # the last sample closes the turn but for rounding
        return angle, value, turns
    last = int(np.argmax(beyond))
    share = (end - angle[last - 1]) / (angle[last] - angle[last - 1])
    closing = value[last - 1] + share * (value[last] - value[last - 1])
    return np.append(angle[:last], end), np.append(value[:last], closing), turns
