"""Contradictions between the device file and the data, found before anything is fitted.

A wrong ratio, rotation or sign would otherwise come out as a large, structured residual with a made-up cause.
"""

from collections.abc import Sequence

import numpy as np

from drivers.errors import DataError
from drivers.signals import BY_NAME
from rig.config.dut import Dut
from rig.log.run import ProcedureName, Run
from rig.loop.signals.tracks import Track

RATIO_TOLERANCE = 0.01
"""Relative; torsion and errors of both encoders change the slope over a turn by far less."""

LEAST_TRAVEL = 6.0
"""rad at the motor over which a ratio can be measured."""

WRONG_SIGN = -0.5
"""Correlation of torque and torsion below which a sign is wrong, not noisy."""


LARGEST = {"rad": 1e8, "rad/s": 1e6, "N*m": 1e7, "A": 1e6, "degC": 1e5, "V": 1e6}
"""Magnitudes by unit that no bench reaches; beyond them a unit or a column is wrong."""


def check_magnitudes(runs: Sequence[Run]) -> None:
    """Raise DataError for the first contract signal that is physically impossible."""
    for run in runs:
        for name, values in run.signals.items():
            signal = BY_NAME.get(name)
            bound = LARGEST.get(signal.unit) if signal is not None else None
            if signal is None or bound is None:
                continue
            away = np.flatnonzero(np.abs(np.nan_to_num(values)) > bound)
            if away.size:
                raise DataError(
                    str(run.file),
                    f"{name} reaches {float(values[away[0]]):.6g} {signal.unit} at {run.time[away[0]]:.6g} s, which no "
                    f"bench does",
                    column=name,
                    value=float(values[away[0]]),
                    expected=f"at most {bound:g} {signal.unit}",
                    hint="Check the unit and the scale of the column, in the mapping or in the header.",
                )


def measured_slope(tracks: Sequence[Track]) -> float | None:
    """Give d(motor_position)/d(output_position) of all turning runs (opposed: negative), None if none turns."""
    numerator = denominator = 0.0
    for track in tracks:
        if track.motor_position is None or track.output_position is None or not track.usable.any():
            continue
        motor, output = track.motor_position[track.usable], track.output_position[track.usable]
        if np.ptp(motor) < LEAST_TRAVEL or np.ptp(output) == 0.0:
            continue
        motor = motor - motor.mean()
        numerator += float(motor @ motor)
        denominator += float(motor @ (output - output.mean()))
    return numerator / denominator if denominator else None


def check_gear(tracks: Sequence[Track], dut: Dut) -> float | None:
    """Give the ratio to use: the device file's, or the measured one, or None. Raises DataError where they disagree."""
    slope = measured_slope(tracks)
    given = dut.gear.ratio
    if slope is None:
        return given
    if slope > 0:
        found = "same" if dut.gear.rotation.value == "opposed" else "opposed"
        raise DataError(
            f"device '{dut.name}'",
            f"rotation = '{dut.gear.rotation}', but the encoders say '{found}'",
            column="gear.rotation",
            value=dut.gear.rotation.value,
            expected=f"rotation '{found}', or the other sign of one encoder",
            hint="Correct the device file, or the sign of the channel in the bench file or mapping.",
        )
    if given is not None and abs(-slope / given - 1.0) > RATIO_TOLERANCE:
        raise DataError(
            f"device '{dut.name}'",
            f"ratio = {given:g}, but the motor turns {-slope:.4g} times for one turn of the output",
            column="gear.ratio",
            value=given,
            expected=f"a ratio within {100 * RATIO_TOLERANCE:.0f} % of {-slope:.4g}",
            hint="Correct the ratio, or the counts per revolution of one encoder.",
        )
    return given if given is not None else -slope


def check_signs(tracks: Sequence[Track], ratio: float | None) -> None:
    """Raise DataError where a torque has the wrong sign: it must wind the drive up, and drive what it turns."""
    for track in tracks:
        _check_torsion(track, ratio)
        _check_power(track, ratio)


def _check_torsion(track: Track, ratio: float | None) -> None:
    swept = track.procedure in (ProcedureName.LOCKED_OUTPUT, ProcedureName.BACKDRIVE) and not track.moves
    if not swept or ratio is None or track.motor_position is None or track.output_position is None:
        return
    torsion = track.output_position + track.motor_position / ratio
    for name, torque in (("output_torque", track.T), ("motor_torque", track.M)):
        if torque is None or np.ptp(torque[track.usable]) == 0.0 or np.ptp(torsion[track.usable]) == 0.0:
            continue
        correlation = float(np.corrcoef(torque[track.usable], torsion[track.usable])[0, 1])
        if correlation < WRONG_SIGN:
            raise DataError(
                track.name,
                f"{name} and torsion fall together with correlation {correlation:.2f}",
                column=name,
                value=round(correlation, 3),
                expected="a positive torque gives a positive torsion",
                hint=f"Set sign = -1 for {name} in the bench file or mapping, or correct the rotation.",
            )


def _check_power(track: Track, ratio: float | None) -> None:
    if track.procedure is not ProcedureName.FREE_RUN or track.M is None or not track.steady.any():
        return
    use = track.usable & track.steady
    load = 0.0 if track.T is None or ratio is None else track.T[use] / ratio
    friction = (track.M[use] - load) * np.sign(track.speed[use])
    if friction.size and float(friction.mean()) < -3.0 * float(friction.std()) / np.sqrt(10.0):
        raise DataError(
            track.name,
            f"motor_torque brakes the shaft it turns: {float(friction.mean()):.3g} N*m along the motion",
            column="motor_torque",
            value=float(friction.mean()),
            expected="a torque along the motion (friction takes power)",
            hint="Set sign = -1 for motor_torque in the bench file or mapping.",
        )
