"""A run made ready for the equations: sense `opposed`, gaps filled and marked, inputs smoothed, legs found.

Rotation `same` is turned into `opposed` on entry by negating the motor signals (one set of equations serves both).
A play follows the extremes of a noisy input, so that torques that enter the model are averaged over `SMOOTHING`.
Start and stop transients look like missing physics: moving runs are used only on legs of constant speed, their ends
cut off.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_filter

from rig.config.dut import Dut, Rotation
from rig.log.run import SWEEPS, ProcedureName, Run
from rig.loop.signals.kinks import kinks
from rig.loop.signals.living import ANGLES, TORQUES
from rig.loop.signals.missing import between, filled, in_long_gaps, known_between, read_together, unheld
from rig.loop.signals.outliers import outliers_drawn_in
from rig.loop.signals.polyline import polyline
from rig.loop.signals.ripple import Ripple, speed_ripple
from rig.loop.signals.saturation import at_limit, cut_off, doubtful_after
from rig.loop.signals.smoothing import MIN_SIDE, THERMAL_SPANS, smooth
from rig.loop.signals.spikes import without_spikes

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SMOOTHING = 0.02
"""s over which a run that does not turn is averaged for the fit; quasi-static sweeps change over seconds."""

LEAST_THERE = 0.5
"""Share of the samples of a mean that must be usable; between them stand values read off a straight line."""

SPRING_SIDE, PLAY_SIDE = 0.025, 0.1
"""s on either side over which torques are smoothed at least before they enter a spring or a play, unless the whole
torque is a polyline."""

THERMAL_SIDE = 0.5
"""s on either side over which a temperature is smoothed at least: what stores heat does not jump."""

SPEED_BAND = 0.08
"""A sample belongs to a leg if its speed is within this share of the leg's speed."""

LEG_END = 0.2
"""s cut off at both ends of a leg."""

SHORTEST_LEG = 0.2
"""s of what remains of a leg."""

SPEED_WINDOW = 0.1
"""s over which an angle is differentiated."""

SHARE_OF_A_TURN = 0.125
"""Motor turns over which the output torque of a turning run is averaged: it keeps what repeats a few times a turn."""

RINGING = 0.025
"""s over which the acceleration of a shaft that does not turn is taken, by a quartic: flat up to some 40 Hz."""

FEWEST_TO_BEND = 7
"""Samples under such a quartic."""

MOVES = 1.0
"""rad of travel at the motor beyond which a run turns; a locked sweep at rated torque makes 0.33 rad."""

HELD_SPEED = 0.3
"""rad/s at the motor; slower sweeps from hold to hold are held still."""

TEMPERATURES = ("temperature", "motor_temperature")
CONDITIONS = (*TEMPERATURES, "bus_voltage", "supply_voltage")
"""Signals of the contract beside angles and torques that terms may use, as they may any further one of a log."""

_PREDICTED = (*ANGLES, *TORQUES)
_TURNING = _PREDICTED[:-1]
"""Channels that must be read together; while turning the output torque changes slowly, whatever it is."""


@dataclass(frozen=True, slots=True)
class Track:
    """One run at one resolution. Arrays of shape (n,), None where not recorded.

    `time` s; `period`: typical s between samples of the run, each of which stands for `fine` samples of the log;
    `step`: the same between the samples of this track, of which some may have been left out.
    `motor_position`, `output_position` rad; `T` and `M`: output and motor torque (N*m) as inputs of the springs,
    smoothed; `play_load`, `play_drive` (n * fine,) as inputs of a play, smoothed more and never thinned;
    `swept_torque` (n * fine,): the polyline that the output torque follows, never thinned, None where it follows none;
    `corners` (n * fine,): that, or straight lines with the corners of a torque that follows none, None without any;
    `output_torque`, `motor_torque` as recorded, `motor_current` (A) where it cannot be turned into a torque.
    `ripple`: how the rotor of a free run moves about its constant speed. `speed`: rad/s of the leg at the motor (at
    the output if only that angle and no motor torque is known), 0 outside legs; `acceleration`: rad/s^2 of that shaft;
    `direction`: sign of the smoothed speed. `usable`: neither missing nor saturated; `steady`: inside a leg. `moves`:
    the run turns, so that its measured angle is far larger than any torsion. `auxiliary`: temperatures, voltages and
    further signals by name; `torque_constant`: N*m/A of the device, None if unknown.
    """

    name: str
    procedure: ProcedureName
    replicate: str | None
    time: Floats
    period: float
    step: float
    fine: int
    motor_position: Floats | None
    output_position: Floats | None
    T: Floats | None
    M: Floats | None
    play_load: Floats | None
    play_drive: Floats | None
    swept_torque: Floats | None
    corners: Floats | None
    output_torque: Floats | None
    motor_torque: Floats | None
    motor_current: Floats | None
    ripple: Ripple | None
    auxiliary: Mapping[str, Floats]
    torque_constant: float | None
    acceleration: Floats
    speed: Floats
    direction: Floats
    usable: Flags
    steady: Flags
    moves: bool
    held: bool
    saturated: int

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)


def make_track(run: Run, dut: Dut) -> Track:
    """Give the run at the rate of its log, with rows that the log lacks put back and marked as not usable."""
    run = without_spikes(run)
    run = filled(read_together(run, _PREDICTED if run.procedure in SWEEPS else _TURNING))
    sense = -1.0 if dut.gear.rotation is Rotation.SAME else 1.0
    period = run.period
    usable = np.ones(run.time.size, dtype=bool)
    known: dict[str, Flags] = {}

    def signal(name: str, factor: float = 1.0) -> Floats | None:
        values = run.signals.get(name)
        if values is not None and name == "output_torque":
            values = unheld(values)
        if values is None or not np.any(np.isfinite(values)):
            return None
        good = np.isfinite(values)
        known[name] = known_between(good)
        if not good.all():
            usable[~known[name]] = False
            values = between(run.time, values, good, noisy=name not in ANGLES)
        return factor * np.asarray(values, dtype=float)

    motor_position, output_position = signal("motor_position", sense), signal("output_position")
    output_torque, motor_torque = signal("output_torque"), signal("motor_torque", sense)
    current = None if motor_torque is not None else signal("motor_current", sense)
    limited, cut = at_limit(run), cut_off(run)
    for flags in cut.values():
        usable &= ~flags
    if run.procedure in SWEEPS:
        swept = {"output_torque": output_torque, "motor_torque": motor_torque, "motor_current": current}
        for name, values in swept.items():
            if values is not None:
                unseen = in_long_gaps(run.time, known[name])
                usable &= ~doubtful_after(values, unseen | cut.get(name, unseen))
    if current is not None and dut.motor.torque_constant is not None:
        motor_torque, current = dut.motor.torque_constant * current, None
    saturated = np.logical_or.reduce([limited, *cut.values()])
    reach = max(1, round(SMOOTHING / period))
    usable &= ~maximum_filter1d(saturated, 2 * reach + 1)  # no mean of samples may hold a saturated one
    angle = motor_position if motor_position is not None else output_position
    speed = np.zeros(run.time.size)
    if angle is not None and run.time.size > 2:
        recorded = None if motor_position is not None else signal("output_velocity")
        speed = _smoothed_speed(run.time, angle, period) if recorded is None else recorded
    if motor_position is None and not (motor_torque is None and current is None):
        speed = -(dut.gear.ratio or 1.0) * speed  # the friction behind a motor torque follows the motor's direction
    leg_speed = _legs(speed, period)
    travel = float(np.ptp(angle)) if angle is not None and angle.size else 0.0
    moves = travel > MOVES if motor_position is not None else bool(np.any(leg_speed != 0))
    if not moves and run.procedure in (ProcedureName.LOCKED_OUTPUT, ProcedureName.BACKDRIVE):
        # a torque that stands still while it sweeps the drive is a dead channel, not a reading
        output_torque, motor_torque = _alive(output_torque), _alive(motor_torque)
    turning = run.procedure in (ProcedureName.FREE_RUN, ProcedureName.BACKDRIVE)
    still = speed.size > 0 and float(np.median(np.abs(speed))) < HELD_SPEED
    held = not turning and still and motor_position is not None
    load, drive = _calm(output_torque, period), None if moves else _calm(motor_torque, period)
    load_line, drive_line = _line(load, period), _line(drive, period)
    return Track(
        name=run.name,
        procedure=run.procedure,
        replicate=run.replicate,
        time=run.time,
        period=period,
        step=period,
        fine=1,
        motor_position=motor_position,
        output_position=output_position,
        T=_over_turns(output_torque, load_line, leg_speed, period)
        if moves
        else _clean(load, load_line, SPRING_SIDE, period),
        M=motor_torque if moves else _clean(drive, drive_line, SPRING_SIDE, period),
        play_load=None if moves else _clean(load, load_line, PLAY_SIDE, period),
        play_drive=None if moves else _clean(drive, drive_line, PLAY_SIDE, period),
        swept_torque=load_line,
        corners=kinks(load, period) if load is not None and load_line is None else load_line,
        output_torque=output_torque,
        motor_torque=motor_torque,
        motor_current=current,
        ripple=_ripple(run, motor_position, motor_torque, leg_speed),
        auxiliary=_auxiliary(run, period),
        torque_constant=dut.motor.torque_constant,
        acceleration=_acceleration(run.time, angle, speed, period, moves=moves),
        speed=leg_speed,
        direction=np.sign(speed),
        usable=usable,
        steady=leg_speed != 0.0,
        moves=moves,
        held=held,
        saturated=int(saturated.sum()),
    )


def thin_track(track: Track, over: float = SMOOTHING) -> Track:
    """Average a run that does not turn over `over` (s); a turning run keeps every sample, since its lines are fast."""
    factor = max(1, round(over / track.period))
    if track.moves or factor == 1 or track.size < 2 * factor:
        return track
    count = track.size // factor

    def mean(values: Floats | None) -> Floats | None:
        return None if values is None else values[: count * factor].reshape(count, factor).mean(axis=1)

    def whole(values: Floats | None) -> Floats | None:
        return None if values is None else values[: count * factor * track.fine]

    def pick(values: Floats) -> Floats:
        return values[: count * factor].reshape(count, factor)[:, factor // 2]

    usable: Flags = np.mean(track.usable[: count * factor].reshape(count, factor), axis=1) >= LEAST_THERE
    return replace(
        track,
        time=np.asarray(mean(track.time)),
        period=track.period * factor,
        step=track.step * factor,
        fine=track.fine * factor,
        motor_position=mean(track.motor_position),
        output_position=mean(track.output_position),
        T=mean(track.T),
        M=mean(track.M),
        play_load=whole(track.play_load),
        play_drive=whole(track.play_drive),
        swept_torque=whole(track.swept_torque),
        corners=whole(track.corners),
        output_torque=mean(track.output_torque),
        motor_torque=mean(track.motor_torque),
        motor_current=mean(track.motor_current),
        auxiliary={name: np.asarray(mean(values)) for name, values in track.auxiliary.items()},
        acceleration=np.asarray(mean(track.acceleration)),
        speed=pick(track.speed),
        direction=pick(track.direction),
        usable=usable,
        steady=pick(track.speed) != 0.0,
    )


def pick_rows(track: Track, rows: NDArray[np.intp]) -> Track:
    """Keep the samples `rows` (m,), even in time, of a turning run. What rings needs every sample and is left out."""

    def pick(values: Floats | None) -> Floats | None:
        return None if values is None else values[rows]

    return replace(
        track,
        time=track.time[rows],
        step=float(np.median(np.diff(track.time[rows]))) if rows.size > 1 else track.step,
        motor_position=pick(track.motor_position),
        output_position=pick(track.output_position),
        T=pick(track.T),
        M=pick(track.M),
        play_load=pick(track.play_load),
        play_drive=pick(track.play_drive),
        swept_torque=None,
        corners=None,
        output_torque=pick(track.output_torque),
        motor_torque=pick(track.motor_torque),
        motor_current=pick(track.motor_current),
        ripple=None if track.ripple is None else track.ripple[rows],
        auxiliary={name: values[rows] for name, values in track.auxiliary.items()},
        acceleration=track.acceleration[rows],
        speed=track.speed[rows],
        direction=track.direction[rows],
        usable=track.usable[rows],
        steady=track.steady[rows],
    )


def _auxiliary(run: Run, period: float) -> dict[str, Floats]:
    """Give what no equation predicts; where a value is missing for a while, it is taken from its neighbours in time.

    A temperature without its noise: what lags behind it would start at the noise of the first sample.
    """
    found = {}
    conditions = {name: run.signals[name] for name in CONDITIONS if name in run.signals}
    for name, values in {**run.auxiliary, **conditions}.items():
        if np.isfinite(values).any():
            good = np.isfinite(values)
            found[name] = np.interp(run.time, run.time[good], values[good])
    for name in found.keys() & set(TEMPERATURES):
        found[name] = smooth(found[name], round(THERMAL_SIDE / period), period, THERMAL_SPANS)
    return found


def _alive(values: Floats | None) -> Floats | None:
    return None if values is None or np.ptp(values) == 0.0 else values


def _ripple(run: Run, position: Floats | None, torque: Floats | None, leg_speed: Floats) -> Ripple | None:
    if run.procedure is not ProcedureName.FREE_RUN or position is None or torque is None:
        return None
    return speed_ripple(run.time, position, torque, leg_speed)


def _calm(values: Floats | None, period: float) -> Floats | None:
    """Give a torque (n,) without samples that stand far out of its noise."""
    return None if values is None else outliers_drawn_in(values, period)


def _line(values: Floats | None, period: float) -> Floats | None:
    """Give the polyline that a torque (n,) follows, None where it follows none."""
    return None if values is None else polyline(values, max(round(PLAY_SIDE / period), MIN_SIDE), period)


def _clean(values: Floats | None, line: Floats | None, side: float, period: float) -> Floats | None:
    """Take the noise from a torque (n,): give the polyline that it follows, else smooth it over `side` (s)."""
    return line if values is None or line is not None else smooth(values, round(side / period), period)


def _over_turns(values: Floats | None, line: Floats | None, leg_speed: Floats, period: float) -> Floats | None:
    """Give the polyline that a torque (n,) follows, else average it over a share of a motor turn, leg by leg."""
    if values is None or line is not None:
        return line
    averaged = values.copy()
    edges = np.flatnonzero(np.diff(leg_speed, prepend=np.nan, append=np.nan) != 0)
    for start, stop in itertools.pairwise(edges.tolist()):
        if leg_speed[start] != 0.0:
            width = round(SHARE_OF_A_TURN * 2.0 * np.pi / abs(leg_speed[start]) / period)
            width = max(1, min(width, stop - start))
            averaged[start:stop] = uniform_filter1d(values[start:stop], width, mode="reflect")
    return averaged


def _smoothed_speed(time: Floats, angle: Floats, period: float) -> Floats:
    """Give the derivative of `angle` over `SPEED_WINDOW`; of a speed it is the acceleration."""
    half = max(1, round(0.5 * SPEED_WINDOW / period))
    index = np.arange(time.size)
    low, high = np.maximum(index - half, 0), np.minimum(index + half, time.size - 1)
    return (angle[high] - angle[low]) / (time[high] - time[low])


def _acceleration(time: Floats, angle: Floats | None, speed: Floats, period: float, *, moves: bool) -> Floats:
    """Give the acceleration of a shaft, rad/s^2: of one that turns slow changes of speed, else what rings by itself.

    A rotor on the springs behind it rings at some tens of Hz; a quartic over `RINGING` follows that. Zero where the
    log is too slow for it, and beside gaps.
    """
    if angle is None or angle.size < 3:
        return np.zeros(time.size)
    if moves:
        return _smoothed_speed(time, speed, period)
    width = 2 * (round(RINGING / period) // 2) + 1
    if not FEWEST_TO_BEND <= width <= angle.size:
        return np.zeros(time.size)
    found: Floats = savgol_filter(angle, width, 4, deriv=2, delta=period)
    gap = np.abs(np.diff(time, prepend=time[0] - period) - period) > 0.5 * period
    found[uniform_filter1d(gap.astype(float), 2 * width) > 0.0] = 0.0
    return found


def _legs(speed: Floats, period: float) -> Floats:
    """Give the speed of the leg that each sample belongs to, 0 outside legs, shape as `speed`."""
    found = np.zeros(speed.size)
    size = np.abs(speed)
    if not size.size or size.max() == 0.0:
        return found
    reach = max(1, round(0.15 / period))
    index = np.arange(speed.size)
    change = np.abs(speed[np.minimum(index + reach, speed.size - 1)] - speed[np.maximum(index - reach, 0)])
    calm = (change < SPEED_BAND * size) & (size > 0.01 * size.max())
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (calm * np.sign(speed)).astype(int), [0]])))
    cut = round(LEG_END / period)
    least = 2 * cut + SHORTEST_LEG / period
    for first, last in itertools.pairwise(edges.tolist()):
        if not calm[first]:
            continue
        set_speed = _middle(speed[first:last])
        reach = int(least) + 1
        start, stop = _within(speed, set_speed, first, max(first - reach, 0), min(first + reach, speed.size))
        if stop - start >= least:  # of a sweep's many short stretches hardly one
            start, stop = _within(speed, set_speed, first, 0, speed.size)
            found[start + cut : stop - cut] = set_speed
    return found


def _middle(values: Floats) -> float:
    """Give the median of a few values; NumPy's own takes ten times as long for them."""
    ordered = np.sort(values)
    return float(0.5 * (ordered[(values.size - 1) // 2] + ordered[values.size // 2]))


def _within(speed: Floats, set_speed: float, place: int, low: int, high: int) -> tuple[int, int]:
    """Give from where to where about `place`, between `low` and `high`, the speed stays within the band of a leg."""
    away = np.abs(speed[low:high] - set_speed) > SPEED_BAND * abs(set_speed)
    before, after = np.flatnonzero(away[: place - low]), np.flatnonzero(away[place - low :])
    return low + int(before[-1]) + 1 if before.size else low, place + int(after[0]) if after.size else high
