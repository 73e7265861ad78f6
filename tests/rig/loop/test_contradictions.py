"""What a device file or a sidecar says against what the logs show: refused with both, and never where effects do it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DataError
from rig.log.run import ProcedureName, Run
from rig.loop.campaign import LoopOptions
from rig.loop.signals.checks import check_gear, check_signs, check_torques
from rig.loop.signals.grid import check_counts, finer_grids
from rig.loop.signals.recordings import check_recordings
from rig.loop.signals.sweeps import check_sweeps, check_work
from rig.loop.signals.tracks import make_track
from rig.loop.trace import trace
from tests.independent.campaign import DUT, Campaign, Plan
from tests.rig.loop.runs import Floats, dut, make_run, runs_of, turning_run

SWEEPS = Plan(locked_angles=2, locked_pairs=0, backdrives=2, backdrive_pairs=0, free_runs=0)


def gear_of(text: str, *runs: Run) -> float | None:
    """Check the ratio of a device file against runs."""
    device = dut(f'name = "x"\n[gear]\n{text}\n')
    return check_gear([make_track(run, device) for run in runs], device)


def with_output(run: Run, error: Floats) -> Run:
    """Give the run with an error (n,) rad in its output angle."""
    return replace(run, signals={**run.signals, "output_position": run.signals["output_position"] + error})


# -- ratio


@pytest.mark.parametrize("given", [101.0, 100.5, 99.0])
@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_a_ratio_that_is_slightly_wrong_is_refused_with_the_measured_one(given: float, speed: float) -> None:
    with pytest.raises(DataError, match=rf"ratio = {given:g}, but the motor turns 100(\.\d+)? times"):
        gear_of(f"ratio = {given}", turning_run("a", 1, speed))


def test_a_rounded_ratio_is_refused_over_a_long_way() -> None:
    with pytest.raises(DataError, match=r"ratio = 57\.3, but the motor turns 57\.285\d times"):
        gear_of("ratio = 57.3", turning_run("a", 1, 80.0, ratio=401 / 7))


@pytest.mark.parametrize("speed", [0.8, 3.0, 20.0])
@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6])
def test_a_right_ratio_stands_whatever_the_gear_and_the_encoders_do(speed: float, phase: float) -> None:
    run = turning_run("a", 1, speed)
    motor, output = run.signals["motor_position"], run.signals["output_position"]
    noise = np.random.default_rng(1).standard_normal(run.time.size)
    for error in (
        2e-4 * np.sin(2.0 * motor + phase),
        2e-5 * np.sin(motor + phase),
        2e-3 * np.sin(output + phase),
        3e-4 * np.sign(np.gradient(motor)) + 2e-4 * np.sin(output + phase),
        1e-3 * noise,
        2e-4 * run.time / run.time[-1],
    ):
        assert gear_of("ratio = 100", with_output(run, error)) == 100.0


# -- recordings


@pytest.mark.parametrize("replicate", [None, "pair"])
def test_one_recording_under_two_names_is_refused_with_both(replicate: str | None) -> None:
    first, other = turning_run("a", 1), turning_run("b", 2)
    copy = replace(first, name="c", file=first.file.with_name("c.csv"), replicate=replicate)
    with pytest.raises(DataError, match="a, c: the two runs are the same recording") as caught:
        trace([replace(first, replicate=replicate), other, copy], dut(), LoopOptions(held_out=("b",)))
    assert "Remove c.csv" in str(caught.value)


def part_of(run: Run, rows: slice) -> Run:
    signals = {name: values[rows] for name, values in run.signals.items()}
    return replace(
        run, name="c", file=run.file.with_name("c.csv"), time=run.time[rows] - run.time[rows][0], signals=signals
    )


@pytest.mark.parametrize(
    ("rows", "count"), [(slice(50, None), 2350), (slice(None, 1500), 1500), (slice(None, None, 2), 1200)]
)
def test_a_part_of_a_recording_beside_the_whole_is_refused_with_both(rows: slice, count: int) -> None:
    run = turning_run("a", 1)
    torque = run.signals["output_torque"].copy()
    torque[::100] = np.nan
    run = replace(run, signals={**run.signals, "output_torque": torque})
    said = f"c, a: the two runs are of one recording: {count} of the {count} distinct samples of c are in a too"
    with pytest.raises(DataError, match=said) as caught:
        trace([run, turning_run("b", 2), part_of(run, rows)], dut(), LoopOptions(held_out=("c",)))
    assert "Remove c.csv" in str(caught.value)


def test_two_parts_of_one_recording_that_overlap_are_refused() -> None:
    run = turning_run("a", 1)
    with pytest.raises(DataError, match=r"1800 of the 2100 distinct samples"):
        check_recordings([part_of(run, slice(None, 2100)), part_of(run, slice(300, None))])


@pytest.mark.parametrize("speed", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("channels", [("motor_position", "output_position"), ("motor_position", "motor_torque")])
def test_replicates_whose_channels_are_counts_are_no_parts_of_each_other(
    speed: float, channels: tuple[str, ...]
) -> None:
    def counted(name: str, seed: int) -> Run:
        run = turning_run(name, seed, speed)
        noise = 1e-4 * np.random.default_rng(seed).standard_normal(run.time.size)
        motor = np.floor((run.signals["motor_position"] + noise) / 1e-3)
        output = np.floor(run.signals["output_position"] / 1e-4)
        torque = np.round(run.signals["motor_torque"] / 1e-3)
        signals = {"motor_position": motor, "output_position": output, "motor_torque": torque}
        return replace(run, signals={channel: signals[channel] for channel in channels})

    check_recordings([counted("a", 1), part_of(counted("b", 2), slice(50, None))])


def test_replicates_of_a_commanded_torque_and_a_coarse_encoder_are_no_parts_of_each_other() -> None:
    time = np.arange(0.0, 40.0, 0.01)
    torque = np.interp(time, [0.0, 10.0, 30.0, 40.0], [0.0, 8.0, -8.0, 0.0])

    def sweep(name: str, seed: int) -> Run:
        noise = 1e-5 * np.random.default_rng(seed).standard_normal(time.size)
        output = np.floor((1e-2 * np.sin(time / 7.0) + noise) / 1.5e-3)
        return make_run(name, "backdrive", time, {"output_torque": torque, "output_position": output})

    check_recordings([sweep("a", 1), part_of(sweep("b", 2), slice(None, 3800))])


def test_two_runs_of_a_held_encoder_alone_are_no_copies() -> None:
    time = np.arange(0.0, 30.0, 0.01)
    held = {"motor_position": np.zeros(time.size), "output_position": np.floor(2.0 + np.sin(time))}
    check_recordings([make_run(name, "backdrive", time, held) for name in "ab"])


def test_a_time_whose_samples_are_less_than_a_microsecond_apart_is_refused_with_its_interval() -> None:
    runs = [turning_run(name, seed) for seed, name in enumerate("ab")]
    with pytest.raises(DataError, match="the samples are 1e-08 s apart") as caught:
        trace([replace(run, time=1e-6 * run.time) for run in runs], dut(), LoopOptions())
    assert "unit of time" in str(caught.value)


def test_replicates_that_last_a_few_hundredths_of_a_second_are_no_replicates_and_no_numpy_warning() -> None:
    plan = replace(SWEEPS, locked_pairs=1, backdrives=0)
    runs, held_out = runs_of(Campaign(5, plan=plan, rate=100.0))
    result = trace([replace(run, time=1e-3 * run.time) for run in runs], dut(DUT), LoopOptions(held_out=held_out))
    assert result.equations


def cut(run: Run, first: int, count: int) -> Run:
    """Give `count` samples of a run."""
    part = slice(first, first + count)
    signals = {name: values[part] for name, values in run.signals.items()}
    return replace(run, time=run.time[part] - run.time[first], signals=signals)


def test_a_held_out_run_that_enters_no_equation_gives_no_verdict() -> None:
    runs = [turning_run("a", 1), turning_run("b", 2), cut(turning_run("c", 3), 500, 3)]
    with pytest.raises(DataError, match="no equation can be formed from the held-out runs") as caught:
        trace(runs, dut(), LoopOptions(held_out=("c",)))
    assert "Too short, at least 20 samples are needed: c (3 samples)" in str(caught.value)
    assert "another run with --held-out" in str(caught.value)


def test_a_run_of_three_samples_is_judged_by_no_sign_and_told_to_be_too_short() -> None:
    runs, _ = runs_of(Campaign(5, plan=SWEEPS, rate=100.0))
    short = [cut(run, first, 3) for run in runs for first in range(0, 2000, 20)]
    check_signs([make_track(run, dut()) for run in short], 100.0)
    three = cut(turning_run("c", 3), 500, 3)
    result = trace([turning_run("a", 1), turning_run("b", 2), three], dut(), LoopOptions(held_out=("b",)))
    assert "Too short, at least 20 samples are needed: c (3 samples)." in result.warnings


# -- sweeps


def swept() -> tuple[Run, ...]:
    """Give two locked runs and two backdrives."""
    return runs_of(Campaign(5, plan=SWEEPS, rate=100.0))[0]


def scaled(run: Run, **factors: float) -> Run:
    """Give the run with some signals multiplied."""
    return replace(run, signals={name: factors.get(name, 1.0) * values for name, values in run.signals.items()})


@pytest.mark.parametrize(
    ("given", "swapped", "held"),
    [
        (ProcedureName.LOCKED_OUTPUT, ProcedureName.BACKDRIVE, "motor"),
        (ProcedureName.BACKDRIVE, ProcedureName.LOCKED_OUTPUT, "output"),
    ],
)
def test_a_sweep_under_the_name_of_the_other_one_is_refused(
    given: ProcedureName, swapped: ProcedureName, held: str
) -> None:
    runs = swept()
    check_sweeps(runs, dut(DUT))
    wrong = [replace(run, procedure=swapped) if run.procedure is given else run for run in runs]
    with pytest.raises(DataError, match=f"a {swapped} run holds the {held}") as caught:
        trace(wrong, dut(DUT), LoopOptions())
    assert caught.value.column == "procedure"
    assert f"({given} holds" in str(caught.value)


@pytest.mark.parametrize("factor", [180.0 / np.pi, np.pi / 180.0])
def test_angles_in_another_unit_are_refused_by_the_stiffness_that_they_give(factor: float) -> None:
    runs = [scaled(run, motor_position=factor, output_position=factor) for run in swept()]
    with pytest.raises(DataError, match=r"N\*m/rad, but the device file's K1 is 8400 N\*m/rad") as caught:
        trace(runs, dut(DUT), LoopOptions())
    assert "Between degrees and rad" in str(caught.value)


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 100.0])
def test_a_stiffness_that_is_off_by_digits_is_not_refused(factor: float) -> None:
    check_sweeps(swept(), dut(DUT.replace("K1 = 8.4e3", f"K1 = {factor * 8.4e3}").replace("K2 = 9.4e3", "")))


def test_one_run_whose_torques_are_swapped_is_refused_with_its_name() -> None:
    runs = list(swept())
    signals = dict(runs[1].signals)
    signals["output_torque"], signals["motor_torque"] = signals["motor_torque"], signals["output_torque"]
    runs[1] = replace(runs[1], signals=signals)
    with pytest.raises(DataError, match=r"0\.0001 times the ratio 100, with which the sweeps together agree") as caught:
        check_torques([make_track(run, dut(DUT)) for run in runs], 100.0)
    assert runs[1].name in str(caught.value)


def test_one_run_whose_rows_run_backwards_is_refused_with_its_name() -> None:
    runs = list(swept())
    check_work(runs)
    runs[1] = replace(runs[1], signals={name: values[::-1].copy() for name, values in runs[1].signals.items()})
    with pytest.raises(DataError, match="the loop of motor_torque over motor_position runs backwards") as caught:
        trace(runs, dut(DUT), LoopOptions())
    assert runs[1].name in str(caught.value)


# -- counts and the torque constant


@pytest.mark.parametrize(
    ("name", "given", "counts"),
    [
        ("motor_position", 16384, 1638),
        ("motor_position", 16384, 163840),
        ("motor_position", 16384, 32768),
        ("output_position", 524288, 52428),
        ("output_position", 524288, 52428800),
    ],
)
def test_counts_that_the_log_contradicts_are_refused_with_those_that_it_shows(
    name: str, given: int, counts: int
) -> None:
    device = dut(DUT.replace(f"encoder_counts = {given}", f"encoder_counts = {counts}"))
    with pytest.raises(DataError, match=f"{name} goes in steps of .* an encoder of {given} counts") as caught:
        trace(swept(), device, LoopOptions())
    assert caught.value.value == counts


def test_angles_in_degrees_are_refused_by_their_grid_without_a_catalogue() -> None:
    factor = 180.0 / np.pi
    runs = [scaled(run, motor_position=factor, output_position=factor) for run in swept()]
    device = dut('name = "x"\n[motor]\nencoder_counts = 16384\n[output]\nencoder_counts = 524288\n')
    with pytest.raises(DataError, match="those counts if the angle is in degrees"):
        trace(runs, device, LoopOptions())


def angles(runs: Sequence[Run], change: Callable[[Floats], Floats]) -> list[Run]:
    """Give the runs with both angles changed."""
    return [
        replace(run, signals={n: change(v) if n.endswith("_position") else v for n, v in run.signals.items()})
        for run in runs
    ]


def averaged(angle: Floats) -> Floats:
    """Give moving means of four samples."""
    return np.convolve(angle, np.full(4, 0.25), mode="same")


@pytest.mark.parametrize(
    "change",
    [
        lambda angle: angle,
        lambda angle: angle + 1e-5 * np.random.default_rng(1).standard_normal(angle.size),
        lambda angle: np.round(angle, 4),
        lambda angle: np.radians(np.round(np.degrees(angle), 3)),
        lambda angle: angle.astype(np.float32).astype(float),
        lambda angle: 0.3 * angle + 0.7 * np.roll(angle, 1),
        averaged,
        lambda angle: np.round(angle * 1e-3 * 524288) / 524288 * 1e3,
    ],
    ids=["counts", "noise", "decimals", "decimals of degrees", "float32", "filter", "means", "no whole number"],
)
def test_an_angle_on_no_grid_or_one_that_is_no_encoders_contradicts_no_counts(
    change: Callable[[Floats], Floats],
) -> None:
    check_counts(angles(swept(), change), dut(DUT))
    check_counts(angles([turning_run("a", 1)], change), dut(DUT))


def test_a_grid_that_is_finer_by_a_whole_number_is_a_warning_because_it_may_be_of_means() -> None:
    assert finer_grids(swept(), dut(DUT)) == []
    lines = dut(DUT.replace("encoder_counts = 16384", "encoder_counts = 4096"))
    check_counts(swept(), lines)
    (told,) = finer_grids(swept(), lines)
    assert "means of 4 samples, or the counts are 16384" in told


def test_a_torque_constant_that_the_log_contradicts_is_a_warning_with_both() -> None:
    runs = [turning_run(name, seed) for seed, name in enumerate("ab")]
    with_current = [replace(r, signals={**r.signals, "motor_current": r.signals["motor_torque"] / 0.321}) for r in runs]
    for text, said in ((DUT, False), (DUT.replace("0.321", "3.21"), True)):
        warnings = trace(with_current, dut(text), LoopOptions(held_out=("b",))).warnings
        told = [warning for warning in warnings if "torque_constant" in warning]
        assert bool(told) is said
        assert not said or ("motor_torque is 0.321 N*m for 1 A" in told[0] and "is 3.21 N*m/A" in told[0])


# -- sweeps in which nothing comes through


def test_sweeps_in_which_the_mesh_sticks_say_nothing_of_how_far_a_torque_winds_the_drive() -> None:
    time, rng = np.arange(3000) * 0.01, np.random.default_rng(8)
    motor = 0.02 * np.sin(2.0 * np.pi * time / 30.0)

    def sweep(name: str, torque: float) -> Run:
        read = torque * np.sin(2.0 * np.pi * time / 30.0) + 0.02 * rng.standard_t(3, time.size)
        signals = {"motor_position": motor, "output_position": np.zeros(time.size), "output_torque": read}
        return make_run(name, "locked-output", time, signals)

    tracks = [make_track(sweep(f"stuck-{k}", 0.0), dut()) for k in range(4)]
    check_signs([*tracks, make_track(sweep("slipped", 0.5), dut())], 100.0)
    with pytest.raises(DataError, match="in most sweeps by"):
        check_signs([make_track(sweep(f"r{k}", 15.0 if k else 0.5), dut()) for k in range(4)], 100.0)
