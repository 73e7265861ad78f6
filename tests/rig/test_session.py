"""What a session makes of its runs: how it counts them, and of one that did not end as planned."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from drivers.errors import CycleError
from drivers.types import Mode, Setpoint
from procedures.intents import Command, Result, SetLock, Steps
from procedures.plan import BenchFacts, PlannedRun, Procedure
from rig.config.dut import default_dut
from rig.log.load import load_run
from rig.operator import SimulatedOperator
from rig.session import Job, Provenance, Session, Watcher, run_jobs
from rig.stop import Stop
from sim_backend.faults import FAULTS
from tests.rig.bench import sim_bench


@dataclass(frozen=True)
class Nothing:
    """No parameters."""


def procedure(steps: Steps) -> Procedure:
    def plan(_parameters: object, _facts: BenchFacts) -> tuple[PlannedRun, ...]:
        return tuple(PlannedRun(name, lambda: steps, 1.0) for name in ("first", "second"))

    return Procedure("other", "a test", Nothing, plan, lambda _: Result(), (), "nothing")


def test_a_drive_that_falls_silent_ends_the_session_and_the_error_says_what_was_left_in_it(tmp_path: Path) -> None:
    sim = sim_bench()

    def steps() -> Steps:
        yield SetLock(True)
        for k in range(200):
            if k == 100:
                FAULTS["mute"].inject(sim.world, 1, 0.0)
            yield Command(motor=Setpoint(Mode.TORQUE, 0.02))
        return Result

    session = Session(
        sim.bench, default_dut()[0], Provenance("", "", "simulated"), tmp_path, SimulatedOperator(), Stop()
    )
    with pytest.raises(CycleError, match="No answer from 'motor'") as caught:
        run_jobs(session, [Job(procedure(steps()), Nothing())])
    told = " ".join(caught.value.__notes__)
    assert "NOT CONFIRMED" in told
    assert "Not restored on 'motor'" in told
    assert "heartbeat consumer" in told
    (log,) = tmp_path.glob("*.mcap")  # the second run was not begun
    metadata = load_run(log).metadata
    assert metadata["outcome.status"] == "fault"
    assert metadata["outcome.safe_state_confirmed"] == "false"
    assert "heartbeat consumer" in metadata["outcome.error"]


def test_the_measuring_runs_of_all_jobs_are_counted_and_a_set_up_move_has_the_number_of_its_run(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []

    def steps() -> Steps:
        yield Command()
        return Result

    def plan(_parameters: object, _facts: BenchFacts) -> tuple[PlannedRun, ...]:
        return (PlannedRun("move", steps, 0.1, set_up=True), *(PlannedRun(name, steps, 0.1) for name in "ab"))

    kind = Procedure("other", "a test", Nothing, plan, lambda _: Result(), (), "nothing")
    watcher = Watcher(on_run=lambda _, run, number, of: told.append((run.name, number, of)))
    who = SimulatedOperator()
    session = Session(sim_bench().bench, default_dut()[0], Provenance("", "", ""), tmp_path, who, Stop(), watcher)
    run_jobs(session, [Job(kind, Nothing())] * 2)
    numbers = [("move", 1), ("a", 1), ("b", 2), ("move", 3), ("a", 3), ("b", 4)]
    assert told == [(name, number, 4) for name, number in numbers]
