"""A campaign of bench logs drawn from a seed: contract CSV files with sidecars, and the truth beside them."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.independent import bench
from tests.independent.effects import Effects
from tests.independent.instruments import Instruments, Truth, measure, true_motor_torque
from tests.independent.laws import Drive, shd_17_100

Floats = NDArray[np.float64]

Further = Callable[[str, Truth, Floats, int], tuple[Truth, dict[str, Floats]]]
"""What acts beyond every effect: from procedure, true signals, time (s) and a seed of the run's conditions, the true
signals with it and further columns of the log by name, each of shape (n,)."""

UNITS = {
    "motor_position": "rad",
    "output_position": "rad",
    "motor_torque": "N*m",
    "motor_current": "A",
    "output_torque": "N*m",
    "temperature": "degC",
    "supply_voltage": "V",
    "room_temperature": "degC",
}

DWELL = 5.0
"""s of rest at the start of every run."""

NESTED_PEAKS = (0.0, 1.0, -1.0, 0.6, -0.6, 0.3, -0.3, 0.0)

LOAD_STEP = 7.0
"""s from one load torque of a free run to the next; the last second is the ramp."""

DUT = """\
name = "SHD-17-100"
[gear]
ratio = 100
rotation = "opposed"
rated_torque = 16.0
K1 = 8.4e3
K2 = 9.4e3
T1 = 3.9
T2 = 12.0
hysteresis_loss = 1.8e-4
starting_torque = 0.012
backdriving_torque = 2.0
[motor]
encoder_counts = 16384
torque_constant = 0.321
pole_pairs = 7
[output]
encoder_counts = 524288
"""


@dataclass(frozen=True, slots=True)
class Plan:
    """How many runs of each kind; `*_pairs` of them are run twice under the same conditions, as replicates.

    `locked_angles` start angles are spread over one motor turn, each with `sweeps_per_angle` sweeps. Slow legs cover
    `output_turns` in both directions; with `one_way` every leg of every run turns forward.
    Sweeps go through `peaks` (of the drawn peak torque); run k takes the k-th of `torque_rates` (N*m/s; drawn where
    empty) and rests for the k-th of `holds` (s) at every turning point at the peak, both in turn.
    `further_legs`: lowest and highest speed (rad/s) and seconds of legs after the fast ones, both ways. The last
    `loaded_free_runs` free runs go through the output torques `loads` (N*m) again and again.
    `room`: degC at the start; `warm_up`: K by which a run would warm up in the end, with `warm_up_time` (s).
    """

    locked_angles: int = 8
    sweeps_per_angle: int = 1
    locked_pairs: int = 2
    backdrives: int = 3
    backdrive_pairs: int = 1
    free_runs: int = 2
    free_run_pairs: int = 1
    starting_torques: int = 0
    output_turns: float = 2.05
    one_way: bool = False
    slow_speed: tuple[float, float] = (15.0, 25.0)
    fast_speed: tuple[float, float] = (60.0, 120.0)
    sine_share: float = 0.25
    peaks: tuple[float, ...] = NESTED_PEAKS
    torque_rates: tuple[float, ...] = ()
    holds: tuple[float, ...] = ()
    further_legs: tuple[tuple[float, float, float], ...] = ()
    loaded_free_runs: int = 0
    loads: tuple[float, ...] = ()
    room: tuple[float, float] = (21.0, 29.0)
    warm_up: tuple[float, float] = (0.0, 8.0)
    warm_up_time: float = 300.0


STANDARD = Plan(
    locked_angles=8,
    locked_pairs=2,
    backdrives=6,
    backdrive_pairs=1,
    free_runs=3,
    free_run_pairs=1,
    sine_share=0.15,
    peaks=(0.0, 1.0, 0.5, 1.0, -1.0, -0.5, -1.0, 0.6, -0.6, 0.3, -0.3, 0.1, -0.1, 0.0),
    torque_rates=(3.0, 1.0, 5.5, 2.0, 10.0),
    holds=(0.0, 25.0, 0.0),
    further_legs=((2.0, 5.0, 25.0), (7.0, 11.0, 15.0)),
    loaded_free_runs=1,
    loads=(0.0, 6.0, -6.0, 11.0, -11.0),
    room=(20.0, 38.0),
    warm_up=(8.0, 30.0),
    warm_up_time=150.0,
)
"""Rich enough to show every effect of the catalogue: rates over a decade, holds, minor loops, start angles, slow legs
for the Stribeck range, loads while turning, a cold and a warm drive. At 200 samples a second below 600 000 samples."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One run: `columns` as the instruments saw them and `truth` as it was, all of shape (n,); `zeros` in rad."""

    name: str
    procedure: str
    replicate: str | None
    start_angle: float
    time: Floats
    columns: dict[str, Floats]
    truth: Truth
    zeros: dict[str, float]


@dataclass(frozen=True, slots=True)
class Secret:
    """What the campaign was made with; never written to a file."""

    seed: int
    drive: Drive
    effects: Effects
    instruments: Instruments


@dataclass(frozen=True, slots=True)
class Written:
    """Files of a campaign: runs, the dut file, a sensible choice of runs to hold out, and the truth."""

    runs: tuple[Path, ...]
    dut: Path
    held_out: tuple[str, ...]
    secret: Secret


@dataclass(frozen=True, slots=True)
class Campaign:
    """Draws runs from `seed`; `rate` in samples per second. The same arguments give the same numbers.

    `further`: what acts besides the effects.
    """

    seed: int
    effects: Effects = field(default_factory=Effects)
    drive: Drive = field(default_factory=shd_17_100)
    instruments: Instruments = field(default_factory=Instruments)
    plan: Plan = field(default_factory=Plan)
    rate: float = 200.0
    further: Further | None = None

    def recordings(self) -> tuple[Recording, ...]:
        """Give every run of the plan; replicates follow their first run."""
        rng = np.random.default_rng(self.seed)
        plan = self.plan
        spacing = 2.0 * math.pi / max(plan.locked_angles, 1)
        first = float(rng.uniform(0.0, spacing))
        angles = first + spacing * np.arange(plan.locked_angles)
        made: list[Recording] = []
        sweeps = np.tile(rng.permutation(angles), plan.sweeps_per_angle)
        for k, angle in enumerate(sweeps.tolist()):
            made += self._repeated("locked-output", k, k < plan.locked_pairs, angle, rng)
        for k in range(plan.backdrives):
            made += self._repeated("backdrive", k, k < plan.backdrive_pairs, self._any_angle(rng), rng)
        for k in range(plan.free_runs):
            made += self._repeated("free-run", k, k < plan.free_run_pairs, self._any_angle(rng), rng)
        for k in range(plan.starting_torques):
            made += self._repeated("starting-torque", k, False, self._any_angle(rng), rng)
        return tuple(made)

    def write(self, folder: Path) -> Written:
        """Write every run as `<name>.csv` with `<name>.toml`, and `dut.toml`; the truth is only returned."""
        folder.mkdir(parents=True, exist_ok=True)
        recordings = self.recordings()
        paths = tuple(write_recording(recording, folder) for recording in recordings)
        dut = folder / "dut.toml"
        dut.write_text(DUT)
        return Written(paths, dut, held_out(recordings), self.secret())

    def secret(self) -> Secret:
        """Give what the runs are made with."""
        return Secret(self.seed, self.drive, self.effects, self.instruments)

    def locked_output_run(
        self, name: str, seed: int, noise_seed: int, start_angle: float, replicate: str | None = None, number: int = 0
    ) -> Recording:
        """Sweep the motor torque against the locked output: nested triangles, or sines; `seed` draws the sweep.

        What is commanded is what the drive reads; what the motor gives may be another torque.
        """
        peak, shape = self._sweep(np.random.default_rng(seed), number)
        commanded = shape * (peak / self.drive.ratio + self.drive.T_fs)
        torque = true_motor_torque(commanded, self.effects, self.instruments.torque_constant)
        around = self._conditions(torque.size, seed)
        signals = bench.locked_output(torque, start_angle, self.drive, self.effects, around)
        return self._recording(name, "locked-output", signals, around, (seed, noise_seed), start_angle, replicate)

    def backdrive_run(
        self, name: str, seed: int, noise_seed: int, start_angle: float, replicate: str | None = None, number: int = 0
    ) -> Recording:
        """Sweep the torque on the output against the held wave generator; `seed` draws the sweep."""
        peak, shape = self._sweep(np.random.default_rng(seed), number)
        around = self._conditions(shape.size, seed)
        signals = bench.backdrive(shape * peak, start_angle, self.drive, self.effects, around)
        return self._recording(name, "backdrive", signals, around, (seed, noise_seed), start_angle, replicate)

    def free_run(
        self, name: str, seed: int, noise_seed: int, start_angle: float, replicate: str | None = None, number: int = 0
    ) -> Recording:
        """Turn the drive slowly, then fast, both ways; `seed` draws the speeds and the first direction."""
        rng = np.random.default_rng(seed)
        slow, fast = float(rng.uniform(*self.plan.slow_speed)), float(rng.uniform(*self.plan.fast_speed))
        first = 1.0 if rng.random() < 0.5 else -1.0
        slow_time = self.plan.output_turns * 2.0 * math.pi * self.drive.ratio / slow
        legs = [(first * slow, slow_time), (-first * slow, slow_time), (first * fast, 8.0), (-first * fast, 8.0)]
        for low, high, seconds in self.plan.further_legs:
            speed = first * float(rng.uniform(low, high))
            legs += [(speed, seconds), (-speed, seconds)]
        if self.plan.one_way:
            legs = [(abs(speed), seconds) for speed, seconds in legs]
        velocity = self._speed_profile(legs)
        position = start_angle + np.concatenate([[0.0], np.cumsum(velocity[1:] + velocity[:-1]) * 0.5 / self.rate])
        around = self._conditions(position.size, seed)
        loaded = number >= self.plan.free_runs - self.plan.loaded_free_runs
        load = self._load(around.time) if loaded and self.plan.loads else None
        signals = bench.free_run(position, velocity, self.drive, self.effects, around, load)
        return self._recording(name, "free-run", signals, around, (seed, noise_seed), start_angle, replicate)

    def starting_torque_run(
        self, name: str, seed: int, noise_seed: int, start_angle: float, replicate: str | None = None, number: int = 0
    ) -> Recording:
        """Raise the motor torque with the output free until the gear slips; `seed` draws direction and rate."""
        rng = np.random.default_rng(seed)
        rate = float(rng.choice([-1.0, 1.0]) * rng.uniform(2e-3, 6e-3))
        most = 20.0 * self.drive.T_fs
        ramp = rate * np.arange(round(most / abs(rate) * self.rate)) / self.rate
        commanded = np.concatenate([np.zeros(round(DWELL * self.rate)), ramp])
        torque = true_motor_torque(commanded, self.effects, self.instruments.torque_constant)
        room = float(self._conditions(1, seed).temperature[0])
        signals = bench.starting_torque(torque, 1.0 / self.rate, start_angle, 0.5, self.drive, self.effects, room)
        around = self._conditions(signals[0].size, seed)
        return self._recording(name, "starting-torque", signals, around, (seed, noise_seed), start_angle, replicate)

    def _repeated(
        self, procedure: str, index: int, twice: bool, start_angle: float, rng: np.random.Generator
    ) -> list[Recording]:
        run = {
            "locked-output": self.locked_output_run,
            "backdrive": self.backdrive_run,
            "free-run": self.free_run,
            "starting-torque": self.starting_torque_run,
        }[procedure]
        seed, *noise_seeds = (int(value) for value in rng.integers(0, 2**31, 3))
        name = f"{procedure}-{index + 1:02d}"
        if not twice:
            return [run(name, seed, noise_seeds[0], start_angle, None, index)]
        return [run(f"{name}{letter}", seed, noise_seeds[k], start_angle, name, index) for k, letter in enumerate("ab")]

    def _any_angle(self, rng: np.random.Generator) -> float:
        return float(rng.uniform(0.0, 2.0 * math.pi))

    def _sweep(self, rng: np.random.Generator, number: int) -> tuple[float, Floats]:
        """Give the peak output torque (N*m) and the sweep with peak 1, after the dwell."""
        plan = self.plan
        peak, torque_rate = float(rng.uniform(10.0, 16.0)), float(rng.uniform(2.0, 5.0))
        if plan.torque_rates:
            torque_rate = plan.torque_rates[number % len(plan.torque_rates)]
        if rng.random() < plan.sine_share:
            period = 2.0 * math.pi * peak / torque_rate
            t = np.arange(round(2.0 * period * self.rate) + 1) / self.rate
            return peak, self._after_dwell(np.sin(2.0 * math.pi * t / period))
        hold = plan.holds[number % len(plan.holds)] if plan.holds else 0.0
        times, values = [0.0], [0.0]
        for before, value in itertools.pairwise(plan.peaks):
            times.append(times[-1] + abs(value - before) * peak / torque_rate)
            values.append(value)
            if hold and abs(value) >= 0.9:
                times.append(times[-1] + hold)
                values.append(value)
        t = np.arange(round(times[-1] * self.rate) + 1) / self.rate
        return peak, self._after_dwell(np.interp(t, times, values))

    def _load(self, time: Floats) -> Floats:
        """Give the output torque of a loaded free run: after the dwell, step by step, each with a ramp of 1 s."""
        loads = self.plan.loads
        steps = np.arange(math.ceil(float(time[-1]) / LOAD_STEP))
        starts = DWELL + LOAD_STEP * steps
        times = np.sort(np.concatenate([starts, starts + LOAD_STEP - 1.0]))
        levels = np.repeat([loads[k % len(loads)] for k in steps.tolist()], 2)
        return np.interp(time, times, levels, left=0.0)

    def _conditions(self, samples: int, seed: int) -> bench.Conditions:
        """Give the temperature of a run: the room's or what is left of the last run, then warming up."""
        plan = self.plan
        time = np.arange(samples) / self.rate
        low, high = (plan.room[0], plan.warm_up[0]), (plan.room[1], plan.warm_up[1])
        room, warm_up = np.random.default_rng([seed, 1]).uniform(low, high)
        return bench.Conditions(time, room + warm_up * -np.expm1(-time / plan.warm_up_time))

    def _after_dwell(self, signal: Floats) -> Floats:
        return np.concatenate([np.zeros(round(DWELL * self.rate)), signal])

    def _speed_profile(self, legs: list[tuple[float, float]]) -> Floats:
        """Give the speed over time: after the dwell each leg with ramps and half a second of rest behind it."""
        times, speeds = [0.0, DWELL], [0.0, 0.0]
        for speed, duration in legs:
            for span, value in ((0.25, speed), (duration, speed), (0.25, 0.0), (0.5, 0.0)):
                times.append(times[-1] + span)
                speeds.append(value)
        t = np.arange(round(times[-1] * self.rate) + 1) / self.rate
        return np.interp(t, times, speeds)

    def _recording(
        self,
        name: str,
        procedure: str,
        signals: bench.Signals,
        around: bench.Conditions,
        seeds: tuple[int, int],
        start_angle: float,
        replicate: str | None,
    ) -> Recording:
        """Measure the true signals; `seeds`: of the run's conditions, which its replicate shares, and of its noise."""
        seed, noise_seed = seeds
        truth, channels = Truth(*signals, temperature=around.temperature), {}
        if self.further is not None:
            truth, channels = self.further(procedure, truth, around.time, seed)
        rng = np.random.default_rng(noise_seed)
        columns, zeros = measure(truth, self.instruments, self.drive.ratio, rng, self.effects, around.time)
        return Recording(name, procedure, replicate, start_angle, around.time, columns | channels, truth, zeros)


def held_out(recordings: tuple[Recording, ...]) -> tuple[str, ...]:
    """Give names to hold out: of each procedure the last quarter (at least one) of the runs that have no replicate."""
    chosen: list[str] = []
    for procedure in dict.fromkeys(recording.procedure for recording in recordings):
        alone = [r.name for r in recordings if r.procedure == procedure and r.replicate is None]
        chosen += alone[-max(1, len(alone) // 4) :]
    return tuple(chosen)


def write_recording(recording: Recording, folder: Path) -> Path:
    """Write one run as contract CSV with its sidecar; give the CSV's path."""
    path = folder / f"{recording.name}.csv"
    header = ",".join(["time[s]", *(f"{name}[{UNITS[name]}]" for name in recording.columns)])
    table = np.column_stack([recording.time, *recording.columns.values()])
    np.savetxt(path, table, fmt="%.10g", delimiter=",", header=header, comments="")
    lines = [f'procedure = "{recording.procedure}"', f"start_angle = {recording.start_angle:.6f}"]
    if recording.replicate is not None:
        lines.insert(1, f'replicate = "{recording.replicate}"')
    path.with_suffix(".toml").write_text("\n".join(lines) + "\n")
    return path
