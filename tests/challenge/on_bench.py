"""The family of the simulated bench: all procedures on a bench that hides one effect, and on one that hides none."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rig.commands import demo
from rig.commands.loop import dut_of
from rig.config.dut import Dut
from rig.log.load import load_runs
from rig.log.run import Run
from rig.loop.campaign import LoopOptions, split_runs
from sim_backend.model.effects import CATALOGUE, ActiveEffect
from tests.challenge.cases import Case
from tests.challenge.sizes import BaseFloor, Hidden, base_floor
from tests.independent.terms import Arm, Effects, Line, Term


def recorded(case: Case, logs: Path) -> tuple[tuple[Run, ...], Dut]:
    """Run the procedures on the bench with what the case hides; give the logs as they are read back, and the dut."""
    demo.record(active(case.hidden), case.seed, logs)
    runs = tuple(load_runs([logs]))
    return runs, dut_of(runs)


def prepared(case: Case) -> tuple[BaseFloor, Hidden, tuple[Run, ...], Dut, tuple[str, ...]]:
    """Give floor, what is hidden with its size, runs, device file and runs to hold out.

    The size is what the base model leaves more than without the effect, in squares: two recordings of one noise seed.
    """
    with tempfile.TemporaryDirectory() as folder:
        runs, dut = recorded(case, Path(folder))
    with tempfile.TemporaryDirectory() as folder:
        without, _ = recorded(replace(case, hidden=()), Path(folder))
    out = tuple(run.name for run in split_runs(runs, LoopOptions()).held_out)
    floor, with_it = (base_floor(some, out, dut) for some in (without, runs))
    sizes = {
        name: math.sqrt(max(with_it.train[name] ** 2 - rms**2, 0.0)) / rms
        for name, rms in floor.train.items()
        if name in with_it.train
    }
    largest = max(sizes, key=lambda name: sizes[name])
    hidden = tuple(in_log_frame(effects, dut) for effects in case.hidden)
    return floor, Hidden(hidden, 0.0, (sizes[largest],), (largest,), (1.0,)), runs, dut, out


def active(hidden: Sequence[Effects]) -> tuple[ActiveEffect, ...]:
    """Give the plant's effects for those of the independent generator: ids and parameters have the same names."""
    return tuple(
        ActiveEffect(CATALOGUE[name], tuple(float(values[p.name]) for p in CATALOGUE[name].parameters))
        for effects in hidden
        for name in effects.ids()
        for values in effects.of(name)
    )


def in_log_frame(effects: Effects, dut: Dut) -> Effects:
    """Give the effect as a log shows it: an encoder counts down, so that a phase comes half a count later."""

    def later(order: float, counts: float | None) -> float:
        return 0.0 if counts is None else math.pi * order / counts

    motor, output = dut.motor.encoder_counts, dut.output.encoder_counts

    def line(item: Line) -> Line:
        return replace(item, phase=item.phase + later(item.order, motor))

    def of_term(item: Term) -> Term:
        values = dict(item.parameters)
        if "phase" in values:
            counts = output if CATALOGUE[item.id].variable == "output_position" else motor
            values["phase"] += later(values["order"], counts)
        return replace(item, parameters=tuple(values.items()))

    arm = effects.gravity_load
    return Effects(
        tuple(line(item) for item in effects.kinematic_error),
        tuple(line(item) for item in effects.cogging),
        Arm(arm.moment, arm.phase + later(1.0, output)) if arm.moment else arm,
        tuple(of_term(item) for item in effects.others),
    )
