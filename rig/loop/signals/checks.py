"""Contradictions between the device file and the data, found before anything is fitted.

A wrong ratio, rotation or sign would otherwise come out as a large, structured residual with a made-up cause.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from drivers.errors import DataError
from drivers.signals import BY_NAME
from rig.config.dut import Dut
from rig.log.run import SWEEPS, ProcedureName, Run
from rig.loop.signals.living import ANGLES
from rig.loop.signals.missing import unheld
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.signals.tracks import Track
from rig.terminal import counted

Floats = NDArray[np.float64]

SLOPE_DOUBT = 10.0
"""Times what a line leaves of the legs (rad, rms) by which such structure may lift its far end over its near one: twice
what one wave as long as a leg does."""

UNSEEN = 3e-3
"""rad at the output by which what a leg does not show as structure (an eccentric disc or a load over less than a turn,
a drift) may lift the far end; over less than 1 rad in proportion."""

LEAST_TRAVEL = 6.0
"""rad at the motor over which a ratio can be measured."""

OTHER_RATIO, FEWEST_TURNING = 0.2, 3
"""Relative distance of one run's ratio from the others' median that is another scale, and runs that tell a median."""

ANOTHER_GEAR, SURE_OF_RATIO = 0.05, 0.01
"""Relative difference of two runs' ratios beyond which they are of different gears, and the doubt each may have."""

OTHER_COMPLIANCE = 10.0
"""Factor between the winding of one sweep and that of most others beyond which a unit or the lock is wrong."""

LEAST_SWEEP = 5.0
"""Standard deviations of its noise that a torque moves through at least, to say how far it winds the drive."""

LETS_GO = {ProcedureName.LOCKED_OUTPUT: "motor_position", ProcedureName.BACKDRIVE: "output_position"}
"""The angle that follows the torque in a sweep."""

DEGREES = 180.0 / np.pi

LEAST_JUMP, JUMP, STEPS_AROUND, GAP = 0.1, 10.0, 9, 0.3
"""rad of a jump at least, times the way at the median speed of the steps around it, of how many; and s that are a gap,
not a step."""

NEARLY_WHOLE = 1e-5
"""Relative distance of a measured ratio from a whole number, below which it is that number: teeth are counted."""

LEAST_IN_LEGS = 0.01
"""Share of the squared travel that legs of constant speed must hold, so that the ratio is measured in them."""

GROSS = 1.4
"""Factor between the two torques beyond which the device file or a scale is wrong: no effect of a gear comes near."""

GROSS_IN_A_RUN = 2.0
"""The same of one run, while the sweeps together show none: friction that depends on the load reaches 1.24."""

CLIMB = 0.03
"""Share of its range by which a torque must rise or fall within a step of a sweep, so that the gear slips in it."""

FEWEST_CLIMBS = 8

STEPS = 100
"""Steps that a sweep is cut into; fewer climbs in all of them tell nothing."""

WRONG_SIGN = -0.5
"""Correlation of torque and torsion below which a sign is wrong, not noisy."""


LARGEST = {"rad": 1e8, "rad/s": 1e6, "N*m": 1e7, "A": 1e6, "degC": 250.0, "V": 1e6}
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
                    hint="Check the unit and the scale of the column, in the mapping or in the header."
                    + (" It may be in kelvin." if signal.unit == "degC" else ""),
                )


def measured_slope(tracks: Sequence[Track]) -> float | None:
    """Give d(motor_position)/d(output_position) of all turning runs (opposed: negative), None if none turns.

    Each stretch that turns one way has a constant of its own: the torsion of one direction is not that of the other.
    """
    power, common, _, _ = _turning_products(tracks)
    return float(power / common) if common else None


def slope_doubt(tracks: Sequence[Track], stiffness: float | None) -> float:
    """Give the relative doubt that kinematic errors, eccentric discs, loads and noise leave in `measured_slope`.

    `stiffness`: N*m/rad of the catalogue, through which a load that changes while turning twists the output.
    """
    power, common, output, count = _turning_products(tracks)
    if not common:
        return 0.0
    travel = float(np.sqrt(12.0 * output / count))
    left = float(np.sqrt(max(output - common**2 / power, 0.0) / count))
    loads = [track.T[track.steady] for track in tracks if track.moves and track.T is not None and track.steady.any()]
    twist = max(float(np.ptp(load)) for load in loads) / stiffness if loads and stiffness is not None else 0.0
    return (SLOPE_DOUBT * left + UNSEEN * min(1.0, travel) + twist) / travel


def _turning_products(tracks: Sequence[Track]) -> Floats:
    """Give the sums of motor squared, motor times output, output squared (rad^2) and of samples of what turns."""
    whole, legs = np.zeros(4), np.zeros(4)
    for track in tracks:
        if track.motor_position is None or track.output_position is None or not track.usable.any():
            continue
        motor, output = track.motor_position[track.usable], track.output_position[track.usable]
        if np.ptp(motor) < LEAST_TRAVEL or np.ptp(output) == 0.0:
            continue
        whole += _products(motor, output)
        # outside legs too many samples are on the way from one torsion to the other
        speed = np.where(track.usable, track.speed, 0.0)
        edges = np.flatnonzero(np.diff(speed, prepend=0.0, append=0.0))
        for start, stop in itertools.pairwise(edges.tolist()):
            if speed[start] != 0.0:
                legs += _products(track.motor_position[start:stop], track.output_position[start:stop])
    return legs if legs[1] != 0.0 and legs[0] > LEAST_IN_LEGS * whole[0] else whole


def _products(motor: Floats, output: Floats) -> Floats:
    """Give the sums of motor squared, of motor times output and of output squared, each about its mean; and of ones."""
    motor, output = motor - motor.mean(), output - output.mean()
    return np.array([motor @ motor, motor @ output, output @ output, motor.size])


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
    doubt = slope_doubt(tracks, dut.gear.K1)
    if given is not None and abs(-slope / given - 1.0) > doubt:
        raise DataError(
            f"device '{dut.name}'",
            f"ratio = {given:g}, but the motor turns {-slope:.6g} times for one turn of the output",
            column="gear.ratio",
            value=given,
            expected=f"a ratio within {100 * doubt:.2g} % of {-slope:.6g}",
            hint="Correct the ratio, or the counts per revolution of one encoder.",
        )
    if given is not None:
        return given
    whole = max(round(-slope), 1)
    return float(whole) if abs(-slope / whole - 1.0) < NEARLY_WHOLE else -slope


def check_each_ratio(tracks: Sequence[Track]) -> None:
    """Raise DataError for a run whose encoders say another ratio than those of most others: a unit, a sign, a swap."""
    slopes = {track.name: slope for track in tracks if (slope := measured_slope([track])) is not None}
    if len(slopes) < FEWEST_TURNING:
        return
    usual = float(np.median(list(slopes.values())))
    for name, slope in slopes.items():
        factor = slope / usual
        if abs(factor - 1.0) < OTHER_RATIO:
            continue
        raise DataError(
            name,
            f"the motor turns {-slope:.6g} times for one turn of the output, in most runs {-usual:.6g} times",
            column="motor_position, output_position",
            value=-slope,
            expected=f"a ratio within {100 * OTHER_RATIO:.0f} % of the other runs'",
            hint=f"{_why_ratio(factor, usual)} Correct the column's unit or sign in the mapping, or leave the run out.",
        )
    _check_one_gear(tracks, slopes)


def _check_one_gear(tracks: Sequence[Track], slopes: Mapping[str, float]) -> None:
    """Raise DataError where runs say ratios that are too near for a wrong unit and too far apart for one gear."""
    sure = [t.name for t in tracks if t.name in slopes and slope_doubt([t], None) < SURE_OF_RATIO]
    ratios = {name: abs(slopes[name]) for name in sure}
    if not ratios:
        return
    least, most = min(ratios, key=lambda name: ratios[name]), max(ratios, key=lambda name: ratios[name])
    if ratios[most] < (1.0 + ANOTHER_GEAR) * ratios[least]:
        return
    raise DataError(
        f"{least}, {most}",
        f"the runs are of different gears: the motor turns {ratios[least]:.6g} times for one turn of the output in "
        f"{least} and {ratios[most]:.6g} times in {most}",
        column="motor_position, output_position",
        expected=f"one ratio, within {100.0 * ANOTHER_GEAR:.0f} %",
        hint="Give the runs of one drive at a time, or correct the counts per revolution of one encoder.",
    )


def _why_ratio(factor: float, usual: float) -> str:
    """Say what makes the slope between the encoders `factor` times the `usual` one."""
    known = {
        -1.0: "One encoder counts the other way.",
        DEGREES: "motor_position looks like degrees.",
        1.0 / DEGREES: "output_position looks like degrees.",
        usual**-2: "The encoders look swapped.",
    }
    return next((text for value, text in known.items() if abs(factor / value - 1.0) < OTHER_RATIO), "One is scaled.")


def check_jumps(runs: Sequence[Run]) -> None:
    """Raise DataError for an angle that jumps from one sample to the next: one that wraps, or lost its place."""
    for run in runs:
        for name in ANGLES:
            if name not in run.signals:
                continue
            good = _read_at(run.signals[name])
            time, angle = run.time[good], run.signals[name][good]
            at = _jumps(time, angle)
            if not at.size:
                continue
            step = float(angle[at[0] + 1] - angle[at[0]])
            wraps = abs(abs(step) / (2.0 * np.pi) - 1.0) < OTHER_RATIO
            raise DataError(
                str(run.file),
                f"{name} jumps by {step:.4g} rad at {time[at[0]]:.6g} s, {counted(at.size, 'time')} in this run",
                column=name,
                value=step,
                expected="an angle that goes on from sample to sample, over full turns too",
                hint="It wraps at a full turn: unwrap it before the import."
                if wraps
                else "The encoder lost its place or single values are wrong: leave the run out or repeat it.",
            )


def _read_at(angle: Floats) -> NDArray[np.bool_]:
    """Tell in which rows (n,) an angle is known: of one that is held over rows where it was read, at rest as well."""
    known, readings = np.isfinite(angle), np.flatnonzero(np.isfinite(unheld(angle)))
    if readings.size < 2 or readings.size == np.count_nonzero(known):
        return known
    every = max(1, round(float(np.median(np.diff(readings)))))
    last = readings[np.maximum(np.searchsorted(readings, np.arange(angle.size), side="right") - 1, 0)]
    return np.asarray(known & ((np.arange(angle.size) - last) % every == 0))


def _jumps(time: Floats, angle: Floats) -> NDArray[np.intp]:
    """Give the samples after which an angle (n,), without missing values, steps by far more than its speed lets it.

    It may go as much further over missing samples as they last longer than one step.
    """
    if angle.size < FEWEST_SAMPLES:
        return np.zeros(0, dtype=np.intp)
    apart = np.diff(time)
    speed = np.diff(angle) / np.maximum(apart, 1e-12)
    off = np.abs(speed - median_filter(speed, STEPS_AROUND, mode="nearest")) * apart
    usual = median_filter(np.abs(speed), STEPS_AROUND, mode="nearest") * np.maximum(apart, np.median(apart))
    return np.flatnonzero((off > np.maximum(LEAST_JUMP, JUMP * usual)) & (apart < GAP))


def check_signs(tracks: Sequence[Track], ratio: float | None) -> None:
    """Raise DataError where a torque has the wrong sign: it must wind the drive up, and drive what it turns.

    Where one sweep winds by another order of magnitude than the others, its unit is wrong, and that is said instead.
    """
    for procedure, angle in LETS_GO.items():
        _check_each_compliance([track for track in tracks if track.procedure is procedure], angle)
    for track in tracks:
        if np.count_nonzero(track.usable) >= FEWEST_SAMPLES:
            _check_torsion(track, ratio)
            _check_power(track, ratio)


def _check_each_compliance(sweeps: Sequence[Track], name: str) -> None:
    """Raise DataError for a sweep of a procedure that winds up far more or less by its torque than most others.

    `name`: of the angle that the procedure lets go.
    """
    found: dict[str, float] = {}
    for track in sweeps:
        angle: Floats | None = getattr(track, name)
        if angle is None or track.T is None or np.count_nonzero(track.usable) < FEWEST_SAMPLES:
            continue
        if _swept(track.output_torque, track.T, track):
            found[track.name] = float(np.ptp(angle[track.usable])) / float(np.ptp(track.T[track.usable]))
    usual = float(np.median(list(found.values()))) if len(found) >= FEWEST_TURNING else 0.0
    for run, compliance in found.items():
        if usual == 0.0 or 1.0 / OTHER_COMPLIANCE < compliance / usual < OTHER_COMPLIANCE:
            continue
        degrees = any(0.5 < compliance / usual / value < 2.0 for value in (DEGREES, 1.0 / DEGREES))
        raise DataError(
            run,
            f"{name} moves by {compliance:.3g} rad for 1 N*m of output_torque, in most sweeps by {usual:.3g} rad",
            column=name,
            value=compliance,
            expected=f"within a factor {OTHER_COMPLIANCE:g} of the other sweeps'",
            hint=f"{'Degrees and radians look mixed up. ' if degrees else ''}Check the unit of the angle and of the "
            f"torque in this run, and whether the lock held; leave the run out or repeat it.",
        )


def _swept(read: Floats | None, smoothed: Floats | None, track: Track) -> bool:
    """Whether a torque moved by more than its noise: where the mesh sticks, what the sensor reads says nothing."""
    if read is None or smoothed is None:
        return False
    noise = float(np.std((read - smoothed)[track.usable]))
    return float(np.ptp(smoothed[track.usable])) > LEAST_SWEEP * noise


def _check_torsion(track: Track, ratio: float | None) -> None:
    swept = track.procedure in (ProcedureName.LOCKED_OUTPUT, ProcedureName.BACKDRIVE) and not track.moves
    if not swept or ratio is None or track.motor_position is None or track.output_position is None:
        return
    torsion = track.output_position + track.motor_position / ratio
    torques = (("output_torque", track.output_torque, track.T), ("motor_torque", track.motor_torque, track.M))
    for name, read, torque in torques:
        if torque is None or not _swept(read, torque, track) or np.ptp(torsion[track.usable]) == 0.0:
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


def check_torques(tracks: Sequence[Track], ratio: float | None) -> None:
    """Raise DataError where the output torque is not by far ratio times the motor torque while the gear slips.

    Where the sweeps together agree with the ratio, each is looked at for itself.
    """
    found = torque_factor(tracks, ratio)
    if found is None or ratio is None:
        return
    if 1.0 / GROSS < found < GROSS:
        for track in tracks:
            _check_torques_of(track, ratio)
        return
    turning = measured_slope(tracks) is not None
    suspects = "the torque constant, or the gain or unit of one torque"
    raise DataError(
        "campaign",
        f"output_torque moves by {found * ratio:.4g} N*m for 1 N*m of motor_torque in the sweeps, {found:.3g} times "
        f"the ratio {ratio:g}",
        column="output_torque",
        value=round(found, 4),
        expected=f"a factor between {1.0 / GROSS:.2f} and {GROSS:.2f}",
        hint=f"Check {suspects}."
        if turning
        else f"Check the ratio of the device file (no run turns, so that it was not measured), {suspects}.",
    )


def _check_torques_of(track: Track, ratio: float) -> None:
    found = torque_factor([track], ratio)
    if found is None or 1.0 / GROSS_IN_A_RUN < found < GROSS_IN_A_RUN:
        return
    raise DataError(
        track.name,
        f"output_torque moves by {found * ratio:.4g} N*m for 1 N*m of motor_torque in this run, {found:.3g} times the "
        f"ratio {ratio:g}, with which the sweeps together agree",
        column="output_torque",
        value=round(found, 4),
        expected=f"a factor between {1.0 / GROSS_IN_A_RUN:g} and {GROSS_IN_A_RUN:g}",
        hint="Check the columns, the units and the gains of both torques of this run; leave it out or repeat it.",
    )


def torque_factor(tracks: Sequence[Track], ratio: float | None) -> float | None:
    """Give d(output_torque)/d(motor_torque) over the ratio where the gear slips in sweeps; None without such.

    Where it sticks, the torque that follows stands still, and the other one tells nothing.
    """
    found: list[float] = []
    for track in tracks:
        if ratio is None or track.moves or track.T is None or track.M is None or track.procedure not in SWEEPS:
            continue
        if track.size < FEWEST_SAMPLES:
            continue
        follows = track.T if track.procedure is ProcedureName.LOCKED_OUTPUT else track.M
        places = np.linspace(0, track.size - 1, STEPS + 1).astype(np.intp)
        seen = track.usable[places[:-1]] & track.usable[places[1:]]
        climbs = np.abs(np.diff(follows[places])) > CLIMB * float(np.ptp(follows))
        output, motor = np.diff(track.T[places]), ratio * np.diff(track.M[places])
        use = seen & climbs & (motor != 0.0)
        found += (output[use] / motor[use]).tolist()
    return float(np.median(found)) if len(found) >= FEWEST_CLIMBS else None


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
