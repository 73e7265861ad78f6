"""The runs that a next experiment is chosen from: settings of the procedures as data, scaled to the bench and device.

Torques and rates are shares of what the device bears, so that one menu serves every drive; what bench or device cannot
do is left out. What separates which effects says docs/effects.md; here is what the four procedures can do of it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from drivers.errors import ConfigError
from procedures.checks import HEADROOM
from procedures.plan import BenchFacts, PlannedRun, build_parameters
from procedures.registry import PROCEDURES

SPEED_SHARE = 0.8
"""Share of the bench's speed limit that a speed of the menu uses at most."""


class Unit(StrEnum):
    """What the numbers of a setting are shares of."""

    PLAIN = "1"
    MOTOR_TORQUE = "largest motor torque of a locked sweep"
    OUTPUT_TORQUE = "rated torque, or what the bench allows"
    SPEED = "fastest leg"


@dataclass(frozen=True, slots=True)
class Scaled:
    """Numbers of one setting, in shares of `unit` (rates: shares a second)."""

    values: tuple[float, ...]
    unit: Unit = Unit.PLAIN


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry: a procedure with settings, and in a few words what it varies."""

    procedure: str
    varies: str
    settings: Mapping[str, Scaled]


@dataclass(frozen=True, slots=True)
class Offer:
    """An entry as this bench can run it: `settings` as `--set` takes them, and the runs that they give."""

    entry: Entry
    settings: tuple[tuple[str, str], ...]
    runs: tuple[PlannedRun, ...]

    @property
    def minutes(self) -> float:
        """Bench time, set-up moves included."""
        return sum(run.duration for run in self.runs) / 60.0

    def command(self, repeat: int = 1) -> str:
        """Give the command that runs it `repeat` times."""
        words = ["rig", "run", self.entry.procedure]
        words += [f"--set {self.entry.procedure}.{name}={value}" for name, value in self.settings]
        return " ".join(words + ([f"--repeat {repeat}"] if repeat > 1 else []))


def _entry(procedure: str, varies: str, /, **settings: Scaled) -> Entry:
    return Entry(procedure, varies, MappingProxyType(settings))


def _plain(*values: float) -> Scaled:
    return Scaled(values)


def _motor(*shares: float) -> Scaled:
    return Scaled(shares, Unit.MOTOR_TORQUE)


def _output(*shares: float) -> Scaled:
    return Scaled(shares, Unit.OUTPUT_TORQUE)


def _speed(*shares: float) -> Scaled:
    return Scaled(shares, Unit.SPEED)


_SHORT = _plain(2.0)
"""s of quiet dwell: the least of which the loop takes a floor."""

_WHOLE = _plain(1.0)
_LOCKED, _BACKDRIVE, _FREE = "locked-output", "backdrive", "free-run"

# the first rate has the replicates, from which the floor comes: at the fastest one the rotor swings, and raises it
MENU: tuple[Entry, ...] = (
    _entry(
        _LOCKED, "six start angles", dwell=_SHORT, start_angles=_plain(6), amplitudes=_WHOLE, rates=_motor(1.0 / 1.5)
    ),
    _entry(
        _LOCKED,
        "eight start angles and two amplitudes",
        dwell=_SHORT,
        start_angles=_plain(8),
        amplitudes=_plain(1.0, 0.5),
        rates=_motor(1.0 / 1.5),
    ),
    _entry(
        _LOCKED,
        "five rates over a decade",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_WHOLE,
        rates=_motor(0.25, 1.0, 0.5, 0.125, 0.0625),
    ),
    _entry(
        _LOCKED,
        "two fast rates",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_WHOLE,
        rates=_motor(0.5, 1.0),
    ),
    _entry(
        _LOCKED,
        "a rate thirty times slower than the peak in a second",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(0),
        amplitudes=_WHOLE,
        rates=_motor(1.0 / 30.0),
    ),
    _entry(
        _LOCKED,
        "holds of 10 s at every turning point",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_plain(1.0, 0.5),
        rates=_motor(0.5),
        hold=_plain(10.0),
    ),
    _entry(
        _LOCKED,
        "holds of 100 s at every turning point",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_WHOLE,
        rates=_motor(0.5),
        hold=_plain(100.0),
    ),
    _entry(
        _LOCKED,
        "nested reversals at six amplitudes",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_plain(1.0, 0.8, 0.6, 0.45, 0.3, 0.2),
        rates=_motor(0.5),
    ),
    _entry(
        _LOCKED,
        "a small sweep about a bias torque",
        dwell=_SHORT,
        start_angles=_plain(1),
        replicate_pairs=_plain(1),
        amplitudes=_plain(1.0, 0.3),
        bias_torque=_motor(0.6),
        rates=_motor(0.25),
    ),
    _entry(
        _LOCKED,
        "small sweeps about zero torque",
        dwell=_SHORT,
        start_angles=_plain(2),
        amplitudes=_WHOLE,
        peak_torque=_motor(0.3),
        rates=_motor(0.05),
    ),
    _entry(
        _BACKDRIVE,
        "the load drive in place of the motor, the fixture open",
        dwell=_SHORT,
        start_angles=_plain(2),
        amplitudes=_plain(1.0, 0.5),
        rates=_output(1.0 / 3.0),
    ),
    _entry(
        _BACKDRIVE,
        "the load drive in place of the motor, four rates",
        dwell=_SHORT,
        start_angles=_plain(1),
        amplitudes=_WHOLE,
        rates=_output(0.25, 0.5, 0.125, 0.0625),
    ),
    _entry(
        _BACKDRIVE,
        "the load drive in place of the motor, holds of 10 s",
        dwell=_SHORT,
        start_angles=_plain(1),
        amplitudes=_plain(1.0, 0.5),
        rates=_output(0.5),
        hold=_plain(10.0),
    ),
    _entry(
        _FREE,
        "whole motor turns in both directions",
        dwell=_SHORT,
        speeds=_speed(0.125, 0.175, 0.235),
        turns=_plain(1),
        repeats=_plain(1),
    ),
    _entry(
        _FREE,
        "slow turns in both directions",
        dwell=_SHORT,
        speeds=_speed(0.05),
        turns=_plain(1),
        repeats=_plain(1),
    ),
    _entry(
        _FREE,
        "six speeds from slow to fast",
        dwell=_SHORT,
        speeds=_speed(0.0325, 0.0625, 0.125, 0.235, 0.485, 1.0),
        turns=_plain(1),
        repeats=_plain(1),
    ),
    _entry(
        _FREE,
        "turns under a ladder of loads",
        dwell=_SHORT,
        speeds=_speed(0.125, 0.235),
        turns=_plain(1),
        load_torques=_output(-0.6, 0.0, 0.6),
        repeats=_plain(1),
    ),
)
"""Every run that can be offered."""

SURVEYS: Mapping[str, Entry] = MappingProxyType(
    {
        entry.procedure: entry
        for entry in (
            _entry(
                _LOCKED,
                "start angles, amplitudes, rates and holds",
                dwell=_SHORT,
                start_angles=_plain(4),
                amplitudes=_plain(1.0, 0.6, 0.3),
                rates=_motor(1.0 / 3.0, 1.0, 1.0 / 12.0),
                hold=_plain(2.0),
            ),
            _entry(
                _BACKDRIVE,
                "start angles, amplitudes, rates and holds",
                dwell=_SHORT,
                start_angles=_plain(4),
                amplitudes=_plain(1.0, 0.6, 0.3),
                rates=_output(1.0 / 3.0, 1.0, 1.0 / 12.0),
                hold=_plain(2.0),
            ),
            _entry(
                _FREE,
                "speeds and loads",
                dwell=_SHORT,
                speeds=_speed(0.0625, 0.125, 0.235, 0.485),
                turns=_plain(1),
                load_torques=_output(-0.6, 0.0, 0.6),
                repeats=_plain(1),
            ),
        )
    }
)
"""By procedure: what varies everything that it can vary, for a residual of which nothing is known."""


def offers(facts: BenchFacts, menu: tuple[Entry, ...] = MENU) -> Iterator[Offer]:
    """Give the entries that this bench can run with this device, as they are to be run."""
    for entry in menu:
        settings = settings_of(entry, facts)
        try:
            yield Offer(entry, settings, planned(entry.procedure, settings, facts))
        except ConfigError:  # the bench has no load drive, no lock, or its limits are too tight
            continue


def planned(procedure: str, settings: tuple[tuple[str, str], ...], facts: BenchFacts) -> tuple[PlannedRun, ...]:
    """Give the runs of a procedure with settings as text. Raises ConfigError where the bench cannot run them."""
    chosen = PROCEDURES[procedure]
    missing = (chosen.needs_load_drive and not facts.has_load_drive) or (chosen.needs_lock and not facts.has_lock)
    if missing:
        raise ConfigError(f"plan of {procedure}", [])
    return chosen.plan(build_parameters(chosen, dict(settings)), facts)


def settings_of(entry: Entry, facts: BenchFacts) -> tuple[tuple[str, str], ...]:
    """Give the settings as text, in SI."""
    return tuple((name, _text(item, facts)) for name, item in entry.settings.items())


def _text(item: Scaled, facts: BenchFacts) -> str:
    limits = facts.limits
    load = min(facts.rated_torque, HEADROOM * min(limits.load_torque, limits.output_torque))
    scale = {
        Unit.PLAIN: 1.0,
        Unit.OUTPUT_TORQUE: min(load, HEADROOM * facts.ratio * limits.motor_torque),
        Unit.MOTOR_TORQUE: min(
            facts.rated_torque / facts.ratio + facts.starting_torque,
            HEADROOM * min(limits.motor_torque, limits.output_torque / facts.ratio + facts.starting_torque),
        ),
        Unit.SPEED: min(200.0, SPEED_SHARE * limits.motor_velocity),
    }[item.unit]
    return ",".join(f"{value * scale:.3g}" for value in item.values)
