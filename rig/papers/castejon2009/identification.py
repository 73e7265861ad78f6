"""Equations (17)-(19): the 15 coefficients of the pure error from a slow run."""

import math

import numpy as np
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import (
    CHOSEN_ERROR,
    SPEEDS,
    AtSpeed,
    four_speeds,
    paper_transmission,
    rpm,
    steady_run,
)
from rig.papers.item import Grid, Outcome, Row, Workbench
from sim_backend.model.fourier_error import ORDERS, FourierError, identify, whole_turns

Floats = NDArray[np.float64]

MOTOR_COUNTS, OUTPUT_COUNTS = 4 * 4096, 2**19
"""Encoders of the bench of Zhang, Ahmad & Liu 2014; this paper names none."""

A, B = slice(1, 1 + ORDERS), slice(1 + ORDERS, None)
"""a_n and b_n among the coefficients; a_0 is an encoder's zero."""


def identification(bench: Workbench) -> Outcome:
    """Identify the chosen error from runs at the paper's slow speed and at a tenth of it."""
    slow = bench.share(four_speeds)[0]
    slower = steady_run(CHOSEN_ERROR, 0.1 * SPEEDS[0])
    found, with_encoders = _identified(slow), _identified(slow, encoders=True)
    at_a_tenth = _identified(slower)
    name = rpm(slow.speed)
    rows = [Row("coefficients", 15.0, float(len(found.coefficients)), "", "a_0, a_1 to a_7, b_1 to b_7", "eq. (17)")]
    for equation, letter, part in (("eq. (18)", "a_n", A), ("eq. (19)", "b_n", B)):
        rows += [
            Row(f"largest error of {letter} at {where}", None, _worst(series, part), "rad", note, equation)
            for where, series, note in (
                (name, found, "the flexible part at this speed is taken for pure"),
                (rpm(slower.speed), at_a_tenth, "what is left of it falls with the square of the speed"),
                (
                    f"{name}, with encoders",
                    with_encoders,
                    "16384 and 2^19 counts; those of the first paper's bench",
                ),
            )
        ]
    rows.append(
        Row(
            "b_2 as printed, over b_2",
            1.0,
            _as_printed(slow) / CHOSEN_ERROR.b[1],
            "",
            "(19) is printed without 1/pi",
            "eq. (19)",
        )
    )
    names = ["a_0", *(f"a_{n}" for n in range(1, 8)), *(f"b_{n}" for n in range(1, 8))]
    columns = (CHOSEN_ERROR, found, with_encoders, at_a_tenth)
    cells = tuple(
        (name, *(f"{series.coefficients[i] * 1e6:.3f}" for series in columns)) for i, name in enumerate(names)
    )
    headings = ("coefficient [urad]", "chosen", name, f"{name}, encoders", rpm(slower.speed))
    return Outcome(tuple(rows), grids=(Grid("Eq. (17)-(19): coefficients of the pure error", headings, cells),))


def _identified(at: AtSpeed, *, encoders: bool = False) -> FourierError:
    """Identify without the constant wind-up, which only a_0 takes."""
    ratio = paper_transmission().ratio
    motor, load = at.run.motor_position, at.run.load_position
    if encoders:
        motor, load = _counted(motor, MOTOR_COUNTS), _counted(load, OUTPUT_COUNTS)
    return identify(motor, motor / ratio - load)


def _as_printed(at: AtSpeed) -> float:
    """Give b_2 (rad) as (19) is printed, as a mean over the record's turns."""
    error = at.run.motor_position / paper_transmission().ratio - at.run.load_position
    angle, value, turns = whole_turns(at.run.motor_position, error)
    return float(np.trapezoid(value * np.sin(2.0 * angle), angle)) / turns


def _counted(angle: Floats, counts: int) -> Floats:
    step = 2.0 * math.pi / counts
    return np.asarray((np.floor(angle / step) + 0.5) * step)


def _worst(found: FourierError, part: slice) -> float:
    """Give the largest error of the coefficients in a part of them."""
    return float(np.max(np.abs(np.subtract(found.coefficients[part], CHOSEN_ERROR.coefficients[part]))))
