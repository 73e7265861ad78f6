"""What every registered procedure keeps; a new entry is covered without being named here."""

import itertools
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import ConfigError
from drivers.types import Limits, Mode
from procedures.intents import Command
from procedures.plan import PlannedRun, build_parameters, parameter_table
from procedures.registry import PROCEDURES
from tests.procedures.drive import CYCLE, FACTS, TURN, Driven, PlantBench, drive, with_facts

NAMES = tuple(PROCEDURES)

COUNT = TURN / FACTS.motor_counts


def default_plan(name: str) -> tuple[PlannedRun, ...]:
    procedure = PROCEDURES[name]
    return procedure.plan(procedure.parameters(), FACTS)


@pytest.fixture(scope="module")
def shortest() -> dict[str, tuple[PlannedRun, Driven]]:
    """The shortest default measuring run of every procedure on the simulated plant, after the set-up before it."""
    found = {}
    for name in NAMES:
        plan = default_plan(name)
        best = min((k for k, run in enumerate(plan) if not run.set_up), key=lambda k: plan[k].duration)
        bench = PlantBench()
        set_ups = [run for run in plan[:best] if run.set_up]
        if set_ups:
            assert drive(set_ups[-1], bench).error is None
        found[name] = (plan[best], drive(plan[best], bench))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_has_a_unit_a_range_that_holds_its_default_and_a_meaning(name: str) -> None:
    for info in parameter_table(PROCEDURES[name].parameters):
        assert info.unit
        assert info.meaning
        assert info.low <= info.high
        entries = info.default if isinstance(info.default, tuple) else (info.default,)
        for entry in entries:
            if isinstance(entry, (int, float)):
                assert info.low <= entry <= info.high, info.name


@pytest.mark.parametrize("name", NAMES)
def test_a_default_that_is_no_number_is_explained_in_the_words_of_its_column(name: str) -> None:
    for info in parameter_table(PROCEDURES[name].parameters):
        assert ("from dut: " in info.meaning) == (info.default is None), info.name
        assert ("empty: " in info.meaning) == (info.default == ()), info.name
        assert "from the bench" not in info.meaning


@pytest.mark.parametrize("name", NAMES)
def test_every_procedure_says_what_it_measures_and_what_an_abort_does(name: str) -> None:
    procedure = PROCEDURES[name]
    assert procedure.name == name
    assert procedure.summary
    assert procedure.on_abort
    assert procedure.needs


@pytest.mark.parametrize("name", NAMES)
def test_names_are_unique_within_a_plan(name: str) -> None:
    counts = Counter(run.name for run in default_plan(name))
    assert max(counts.values()) == 1


@pytest.mark.parametrize("name", NAMES)
def test_a_default_plan_has_at_least_two_replicate_pairs(name: str) -> None:
    groups = Counter(run.replicate for run in default_plan(name) if run.replicate is not None)
    assert sum(count >= 2 for count in groups.values()) >= 2
    assert all(group.startswith(name) for group in groups)


@pytest.mark.parametrize("name", NAMES)
def test_replicates_share_start_angle_and_duration(name: str) -> None:
    measuring = [run for run in default_plan(name) if run.replicate is not None]
    for _, group in itertools.groupby(sorted(measuring, key=lambda r: r.replicate), key=lambda r: r.replicate):
        runs = list(group)
        assert len({run.start_angle for run in runs}) == 1
        assert len({run.duration for run in runs}) == 1


def test_the_default_campaign_takes_less_than_25_minutes() -> None:
    assert sum(run.duration for name in NAMES for run in default_plan(name)) < 25 * 60


@pytest.mark.parametrize("name", NAMES)
def test_a_run_ends_without_an_error_and_measures_something(
    name: str, shortest: dict[str, tuple[PlannedRun, Driven]]
) -> None:
    driven = shortest[name][1]
    assert driven.error is None
    assert driven.result.measurements
    for measurement in driven.result.measurements:
        assert math.isfinite(measurement.value)
        assert measurement.unit
        assert measurement.meaning
        assert measurement.uncertainty is None or measurement.uncertainty >= 0.0


@pytest.mark.parametrize("name", NAMES)
def test_the_planned_duration_is_right_within_5_percent(
    name: str, shortest: dict[str, tuple[PlannedRun, Driven]]
) -> None:
    run, driven = shortest[name]
    assert driven.seconds == pytest.approx(run.duration, rel=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_begins_with_a_quiet_dwell_of_5_s(name: str, shortest: dict[str, tuple[PlannedRun, Driven]]) -> None:
    driven = shortest[name][1]
    assert driven.phases[0] == (0, "dwell")
    end = next(cycle for cycle, phase in driven.phases if phase != "dwell")
    assert end * CYCLE >= 5.0
    held = {
        (setpoint.mode, setpoint.value)
        for command in driven.commands[:end]
        for setpoint in (command.motor, command.load)
        if setpoint is not None
    }
    assert all(value == 0.0 for mode, value in held if mode is not Mode.POSITION)
    assert sum(mode is Mode.POSITION for mode, _ in held) <= 1
    positions = np.array([sample.motor_position for sample in driven.samples[:end]])
    # two counts: the encoder's noise makes it chatter between neighbours, and the wave generator's spring lets go
    assert np.ptp(positions[end // 2 :]) <= 2 * COUNT


@pytest.mark.parametrize("name", NAMES)
def test_a_run_ends_at_rest(name: str, shortest: dict[str, tuple[PlannedRun, Driven]]) -> None:
    last = shortest[name][1].commands[-1]
    for setpoint in (last.motor, last.load):
        assert setpoint is None or setpoint.mode is Mode.POSITION or setpoint.value == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_a_setpoint_never_jumps_except_to_zero(name: str, shortest: dict[str, tuple[PlannedRun, Driven]]) -> None:
    """1 % of a limit per cycle is a hundred times faster than any default ramp of torque or speed."""
    limits = FACTS.limits
    for axis, torque in (("motor", limits.motor_torque), ("load", limits.load_torque)):
        setpoints = [getattr(command, axis) for command in shortest[name][1].commands]
        for before, after in itertools.pairwise(setpoints):
            if after is None or after.mode is Mode.POSITION or after.value == 0.0:
                continue
            start = before.value if before is not None and before.mode is after.mode else 0.0
            limit = torque if after.mode is Mode.TORQUE else limits.motor_velocity
            assert abs(after.value - start) <= 0.01 * limit


@pytest.mark.parametrize("name", NAMES)
def test_summarise_joins_the_results_of_measuring_runs(
    name: str, shortest: dict[str, tuple[PlannedRun, Driven]]
) -> None:
    result = shortest[name][1].result
    joined = PROCEDURES[name].summarise((result, result))
    assert joined.measurements
    names = [measurement.name for measurement in joined.measurements]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", NAMES)
def test_a_plan_refuses_motion_beyond_the_travel_limit_before_anything_moves(name: str) -> None:
    procedure = PROCEDURES[name]
    tight = Limits(motor_torque=0.25, motor_velocity=220.0, output_torque=30.0, motor_travel=0.01)
    with pytest.raises(ConfigError, match=r"0\.01 rad") as caught:
        procedure.plan(procedure.parameters(), with_facts(limits=tight))
    assert caught.value.mistakes[0].path.startswith(f"{name}.")


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_parameter_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(ConfigError, match="dwell"):
        build_parameters(PROCEDURES[name], {"dwel": "3"})


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_can_be_set_by_text(name: str) -> None:
    procedure = PROCEDURES[name]
    for info in parameter_table(procedure.parameters):
        if info.kind is bool:
            text, value = "true", True
        elif info.kind is str:
            text = value = info.default
        elif info.kind is tuple:
            text, value = f"{info.low:.17g},{info.high:.17g}", (info.low, info.high)
        else:
            text, value = f"{info.high:.17g}", info.high
        assert getattr(build_parameters(procedure, {info.name: text}), info.name) == value


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cycles", [1, 400, 5500])
def test_a_run_can_be_closed_at_any_moment(name: str, cycles: int) -> None:
    bench = PlantBench()
    for run in itertools.takewhile(lambda run: run.set_up, default_plan(name)):
        drive(run, bench)
    run = next(run for run in default_plan(name) if not run.set_up)
    steps = run.steps()
    intent, done = next(steps), 0
    sample = bench.cycle(Command())
    while done < cycles:
        if isinstance(intent, Command):
            sample = bench.cycle(intent)
            done += 1
        intent = steps.send(sample)
    steps.close()
    with pytest.raises(StopIteration):
        next(steps)


@pytest.mark.parametrize("name", NAMES)
def test_the_steps_of_a_run_can_be_started_again(name: str) -> None:
    run = next(run for run in default_plan(name) if not run.set_up)
    first, second = run.steps(), run.steps()
    assert first is not second
    assert next(first) == next(second)
    first.close()
    second.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_page_of_the_docs_names_every_parameter_and_says_what_an_abort_does(name: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "procedures" / f"{name}.md").read_text(encoding="utf-8")
    for info in parameter_table(PROCEDURES[name].parameters):
        assert f"`{info.name}`" in page
    for heading in ("**Measures**", "**Set-up.**", "**Results**", "**Abort**"):
        assert heading in page
