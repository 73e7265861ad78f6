"""What a planned run will look like, without a bench: its own set-points carried out by an ideal drive.

The procedure's generator is asked for its set-points in steps of `PERIOD`, and the fitted base model says which torques
and angles follow. No noise, no rotor that swings: what several models predict for one run is compared, not measured.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from drivers.types import Mode, Sample, Setpoint
from procedures.intents import Command
from procedures.plan import BenchFacts, PlannedRun
from rig.config.dut import Dut, Rotation
from rig.log.run import ProcedureName, Run
from rig.loop.model.prediction import Model
from rig.loop.signals.play import play_path
from rig.loop.signals.tracks import Track, make_track
from sim_backend.model.compliance import wave_generator_torsion

Floats = NDArray[np.float64]

PERIOD = 0.04
"""s between the samples of a sketch; each stands for all samples of the log in this time."""


def coarse_facts(facts: BenchFacts) -> BenchFacts:
    """Give the facts by which a plan steps in `PERIOD`; without sensor no plan refuses that as too few samples."""
    return replace(facts, cycle_time=PERIOD, has_torque_sensor=False)


def sketch(run: PlannedRun, procedure: str, model: Model, dut: Dut) -> Track:
    """Give the track of one measuring run. `run`: of a plan made with `coarse_facts`; the model has a ratio."""
    motor, load = _set_points(run)
    start = run.start_angle or 0.0
    time = PERIOD * np.arange(len(motor), dtype=np.float64)
    name = ProcedureName(procedure)
    if name is ProcedureName.FREE_RUN:
        signals = _turning(motor, load, start, model)
    elif name is ProcedureName.BACKDRIVE:
        signals = _backdriven(_values(load, Mode.TORQUE), start, model)
    else:
        signals = _locked(_values(motor, Mode.TORQUE), start, model)
    sense = -1.0 if dut.gear.rotation is Rotation.SAME else 1.0
    turned = {k: sense * v if k.startswith("motor_") else v for k, v in signals.items()}
    made = make_track(
        Run(run.name, _no_file(run.name), name, time, MappingProxyType(turned), run.replicate, run.start_angle), dut
    )
    return replace(made, ripple=None)


def distinct(runs: Sequence[PlannedRun]) -> list[tuple[PlannedRun, int]]:
    """Give the measuring runs, replicates joined, each with how often it is run."""
    found: dict[str, tuple[PlannedRun, int]] = {}
    for run in runs:
        if not run.set_up:
            key = run.replicate or run.name
            found[key] = (found.get(key, (run, 0))[0], found.get(key, (run, 0))[1] + 1)
    return list(found.values())


def _set_points(run: PlannedRun) -> tuple[list[Setpoint | None], list[Setpoint | None]]:
    """Give the set-points of motor and load, cycle by cycle; an axis that is not turned stands still."""
    steps = run.steps()
    motor: list[Setpoint | None] = []
    load: list[Setpoint | None] = []
    angle, speed = run.start_angle or 0.0, 0.0
    sample = Sample(0.0, 0, motor_position=angle, motor_velocity=0.0, load_position=0.0)
    try:
        intent = next(steps)
        while True:
            if isinstance(intent, Command):
                motor.append(intent.motor)
                load.append(intent.load)
                speed = intent.motor.value if intent.motor is not None and intent.motor.mode is Mode.VELOCITY else 0.0
                angle += speed * PERIOD
                sample = sample._replace(motor_position=angle, motor_velocity=speed)
            intent = steps.send(sample)
    except StopIteration:
        return motor, load


def _values(points: Sequence[Setpoint | None], mode: Mode) -> Floats:
    """Give the set-points of one mode, 0 where the axis has none, shape (n,)."""
    return np.array([p.value if p is not None and p.mode is mode else 0.0 for p in points])


def _locked(M: Floats, start: float, model: Model) -> dict[str, Floats]:
    N = _ratio(model)
    T = play_path(N * M, N * model.value("T_fs")).output
    torsion = _torsion(T, M, model)
    return {
        "motor_torque": M,
        "output_torque": T,
        "motor_position": start + N * torsion,
        "output_position": np.zeros(M.size),
    }


def _backdriven(T: Floats, start: float, model: Model) -> dict[str, Floats]:
    N = _ratio(model)
    M = play_path(T / N, model.value("T_fb") / N).output
    motor = np.full(T.size, start)
    return {
        "motor_torque": M,
        "output_torque": T,
        "motor_position": motor,
        "output_position": _torsion(T, M, model) - start / N,
    }


def _turning(
    motor: Sequence[Setpoint | None], load: Sequence[Setpoint | None], start: float, model: Model
) -> dict[str, Floats]:
    N = _ratio(model)
    speed, T = _values(motor, Mode.VELOCITY), _values(load, Mode.TORQUE)
    angle = start + PERIOD * (np.cumsum(speed) - 0.5 * speed)
    M = T / N + np.sign(speed) * model.value("T_c") + model.value("b") * speed
    return {
        "motor_torque": M,
        "output_torque": T,
        "motor_position": angle,
        "output_position": _torsion(T, M, model) - angle / N,
    }


def _torsion(T: Floats, M: Floats, model: Model) -> Floats:
    wound = wave_generator_torsion(M, model.value("K_w0"), model.value("C_w"))
    return model.flexspline_torsion(T) + wound / _ratio(model)


def _ratio(model: Model) -> float:
    if model.ratio is None:
        raise ValueError("a sketch needs the gear ratio")
    return model.ratio


def _no_file(name: str) -> Path:
    return Path(f"{name}.sketch")
