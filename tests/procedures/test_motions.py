import math

import pytest

from drivers.errors import DataError
from drivers.types import Mode, Sample, Setpoint
from procedures.intents import Command, Mark
from procedures.motions import (
    RELEASED,
    Motion,
    dwell,
    load_torque,
    motor_torque,
    motor_velocity,
    move_to,
    observed,
    ramp,
    triangle,
    triangle_time,
)
from procedures.recording import Recording

DT = 1e-3


def play(motion: Motion, position: float | None = 0.0) -> tuple[list[Command], list[Mark], Sample]:
    """Answer every command with a sample of its number; give commands, marks and what the motion returned."""
    commands: list[Command] = []
    marks: list[Mark] = []
    sample = Sample(time=0.0, cycle=0)
    try:
        intent = next(motion)
        while True:
            if isinstance(intent, Command):
                commands.append(intent)
                sample = Sample(time=len(commands) * DT, cycle=len(commands), motor_position=position)
            elif isinstance(intent, Mark):
                marks.append(intent)
            intent = motion.send(sample)
    except StopIteration as end:
        return commands, marks, end.value


def test_one_command_is_one_cycle_and_the_last_sample_comes_back() -> None:
    commands, _, last = play(dwell(0.02, RELEASED, DT))
    assert commands == [RELEASED] * 20
    assert last.cycle == 20


def test_a_ramp_of_one_axis_keeps_the_other_as_it_was_told() -> None:
    hold = Setpoint(Mode.POSITION, 1.5)
    commands, _, _ = play(ramp(0.0, 0.01, 0.5, motor_torque(hold), DT))
    assert all(command.load is hold for command in commands)
    assert [command.motor.value for command in commands][-1] == pytest.approx(0.01)
    commands, _, _ = play(ramp(0.0, 0.01, 0.5, load_torque(hold), DT))
    assert all(command.motor is hold for command in commands)


def test_a_speed_ramp_commands_speeds() -> None:
    commands, _, _ = play(ramp(0.0, 1.0, 100.0, motor_velocity(), DT))
    assert len(commands) == 10
    assert {command.motor.mode for command in commands} == {Mode.VELOCITY}


def test_a_triangle_marks_every_leg_and_records_those_asked_for() -> None:
    points = (0.0, 1.0, -1.0, 0.0)
    legs = {1: Recording("cycle")}
    commands, marks, _ = play(triangle(points, 100.0, 0.0, motor_torque(), DT, legs))
    assert [mark.phase for mark in marks] == ["sweep up to 1 N*m", "sweep down to -1 N*m", "sweep up to 0 N*m"]
    assert len(commands) == round(triangle_time(points, 100.0, 0.0) / DT)
    (cycle,) = legs[1].columns()
    assert (cycle[0], cycle[-1]) == (11, 30)


def test_holds_follow_every_turning_point_but_the_last() -> None:
    points = (0.0, 1.0, -1.0, 0.0)
    commands, marks, _ = play(triangle(points, 100.0, 0.05, motor_torque(), DT, {}))
    assert len(commands) == round(triangle_time(points, 100.0, 0.05) / DT) == 140
    assert [mark.phase for mark in marks if mark.phase.startswith("hold")] == ["hold at 1 N*m", "hold at -1 N*m"]


def test_a_move_takes_the_short_way_from_where_the_motor_stands() -> None:
    commands, _, _ = play(move_to(0.1, 0.5, DT), position=2.0 * math.pi + 6.0)
    targets = [command.motor.value for command in commands[1:]]
    assert commands[0] == RELEASED
    assert targets[0] == pytest.approx(2.0 * math.pi + 6.0, abs=1e-4)
    assert targets[-1] == pytest.approx(4.0 * math.pi + 0.1)


def test_a_move_without_a_motor_angle_names_the_missing_signal() -> None:
    with pytest.raises(DataError, match="motor_position"):
        play(move_to(0.1, 0.5, DT), position=None)


def test_an_observer_sees_every_cycle_and_no_mark() -> None:
    seen: list[int] = []
    motion = triangle((0.0, 1.0, 0.0), 100.0, 0.0, motor_torque(), DT, {})
    commands, _, last = play(observed(motion, lambda sample: seen.append(sample.cycle)))
    assert seen == list(range(1, len(commands) + 1))
    assert last.cycle == len(commands)


def test_a_recording_marks_missing_values_as_not_a_number() -> None:
    recording = Recording("time", "output_torque")
    recording.add(Sample(time=1.0, cycle=1, output_torque=2.0))
    recording.add(Sample(time=2.0, cycle=2))
    time, torque = recording.columns()
    assert time.tolist() == [1.0, 2.0]
    assert torque[0] == 2.0
    assert math.isnan(torque[1])


def test_a_recording_of_one_signal_gives_one_column() -> None:
    recording = Recording("cycle")
    recording.add(Sample(time=0.0, cycle=7))
    assert [column.tolist() for column in recording.columns()] == [[7.0]]
