"""Carries out a planned run on a small bench of the tests: one command, one cycle, one sample."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Protocol

from drivers.types import Limits, Mode, Sample, Setpoint
from procedures.intents import Ask, Command, Evaluation, Mark, Result, SetLock, Tare
from procedures.plan import BenchFacts, PlannedRun
from sim_backend.model.effects import ActiveEffect
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

CYCLE = 1e-3
OUTPUT_COUNTS = 524288
TURN = 2.0 * math.pi

LIMITS = Limits(motor_torque=0.25, motor_velocity=220.0, output_torque=30.0, load_torque=30.0)

FACTS = BenchFacts(
    ratio=100.0,
    rated_torque=16.0,
    starting_torque=0.012,
    backdriving_torque=2.0,
    wave_generator_stiffness=1.333,
    motor_inertia=2.2e-5,
    motor_counts=16384,
    cycle_time=CYCLE,
    limits=LIMITS,
    has_load_drive=True,
    has_lock=True,
    has_output_encoder=True,
    has_torque_sensor=True,
)
"""The drive of Zhang, Ahmad & Liu 2014 on a bench that has everything."""


class TestBench(Protocol):
    """What a run needs: a cycle, the lock, the tare."""

    __test__ = False

    def cycle(self, command: Command) -> Sample:
        """Take the setpoints, give the sample one cycle later."""

    def set_lock(self, locked: bool) -> None: ...

    def tare(self) -> None: ...


@dataclass
class Driven:
    """What happened during one run. `asked[k]` was answered by `samples[k]`."""

    result: Result = field(default_factory=Result)
    commands: list[Command] = field(default_factory=list)
    samples: list[Sample] = field(default_factory=list)
    phases: list[tuple[int, str]] = field(default_factory=list)
    locks: list[bool] = field(default_factory=list)
    tares: int = 0
    error: Exception | None = None

    @property
    def seconds(self) -> float:
        return len(self.commands) * CYCLE

    def named(self, name: str) -> float:
        return self.measurement(name).value

    def measurement(self, name: str):
        return next(m for m in self.result.measurements if m.name == name)


def drive(run: PlannedRun, bench: TestBench, limits: Limits = LIMITS, keep_samples: bool = True) -> Driven:
    """Run to the end, or to the error that the procedure raises (kept in `error`); every setpoint is checked."""
    done = Driven()
    steps = run.steps()
    sample = Sample(time=0.0, cycle=0)
    released = True
    try:
        intent = next(steps)
        while True:
            match intent:
                case Command():
                    for setpoint, torque in ((intent.motor, limits.motor_torque), (intent.load, limits.load_torque)):
                        _within(setpoint, torque, limits)
                    done.commands.append(intent)
                    sample = bench.cycle(intent)
                    if keep_samples:
                        done.samples.append(sample)
                    released = intent == Command()
                case Mark(phase):
                    done.phases.append((len(done.commands), phase))
                case SetLock(locked):
                    assert released, "the lock changes at zero torque only"
                    bench.set_lock(locked)
                    done.locks.append(locked)
                case Tare():
                    assert released, "a loaded sensor is not zeroed"
                    bench.tare()
                    done.tares += 1
                case Ask():
                    raise AssertionError("no procedure asks here")
            intent = steps.send(sample)
    except StopIteration as end:
        _evaluate(done, end.value)
    except Exception as error:
        done.error = error
    return done


def _evaluate(done: Driven, evaluate: Evaluation) -> None:
    try:
        done.result = evaluate()
    except Exception as error:
        done.error = error


def _within(setpoint: Setpoint | None, torque: float, limits: Limits) -> None:
    if setpoint is None:
        return
    if setpoint.mode is Mode.TORQUE:
        assert abs(setpoint.value) <= torque, f"{setpoint} is above {torque} N*m"
    if setpoint.mode is Mode.VELOCITY:
        assert abs(setpoint.value) <= limits.motor_velocity, f"{setpoint} is above {limits.motor_velocity} rad/s"


def drive_all(runs: tuple[PlannedRun, ...], bench: TestBench) -> list[tuple[PlannedRun, Driven]]:
    """Drive all runs in order on one bench; a run that ends with an error raises it."""
    done = []
    for run in runs:
        driven = drive(run, bench)
        if driven.error is not None:
            raise driven.error
        done.append((run, driven))
    return done


def with_facts(**changes: object) -> BenchFacts:
    return dataclasses.replace(FACTS, **changes)


def zhang_plant(seed: int = 0, **changes: float) -> PlantConfig:
    gear = HarmonicDrive.from_catalogue(
        100.0,
        8.4e3,
        9.4e3,
        3.9,
        12.0,
        1.8e-4,
        0.012,
        viscous_friction=changes.pop("viscous_friction", 1e-4),
    )
    return PlantConfig(drive=gear, **changes)


class PlantBench:
    """The simulated plant with encoders that count and drives that take torques in steps."""

    def __init__(
        self,
        facts: BenchFacts = FACTS,
        config: PlantConfig | None = None,
        torque_step: float = 0.0,
        encoder_sign: float = 1.0,
        seed: int = 0,
        effects: tuple[ActiveEffect, ...] = (),
    ) -> None:
        self._plant = Plant(config or zhang_plant(), effects, seed=seed)
        self._plant.set_torque_limit("motor", facts.limits.motor_torque)
        self._facts = facts
        self._step = torque_step
        self._encoder_sign = encoder_sign
        self._cycle = 0

    def set_lock(self, locked: bool) -> None:
        self._plant.set_lock(locked)

    def tare(self) -> None:
        pass

    def cycle(self, command: Command) -> Sample:
        for axis, setpoint in (("motor", command.motor), ("load", command.load)):
            self._apply(axis, setpoint)
        self._cycle += 1
        self._plant.advance_to(self._cycle * CYCLE)
        r = self._plant.read()
        return Sample(
            time=self._cycle * CYCLE,
            cycle=self._cycle,
            motor_position=self._encoder_sign * _counted(r.motor_position, self._facts.motor_counts),
            motor_velocity=r.motor_velocity,
            motor_torque=self._coarse(r.motor_torque),
            output_position=_counted(r.output_position, OUTPUT_COUNTS),
            output_torque=r.output_torque,
            load_torque=r.load_torque,
            load_position=r.load_position,
        )

    def _apply(self, axis: str, setpoint: Setpoint | None) -> None:
        if setpoint is None:
            self._plant.command(axis, AxisMode.OFF, 0.0)
            return
        value = setpoint.value
        if setpoint.mode is Mode.TORQUE and axis == "motor":
            value = self._coarse(value)
        self._plant.command(axis, AxisMode[setpoint.mode.name], value)

    def _coarse(self, torque: float) -> float:
        return round(torque / self._step) * self._step if self._step else torque


def _counted(angle: float, counts: int) -> float:
    return math.floor(angle * counts / TURN) * TURN / counts
