"""A campaign is reproducible, complete, says nothing of its truth, and shows its effect to plain least squares."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.independent import effects as fx
from tests.independent import laws
from tests.independent.campaign import STANDARD, Campaign, Plan, Recording
from tests.independent.draws import DRAWN

SMALL = Plan(locked_angles=2, locked_pairs=1, backdrives=1, backdrive_pairs=0, free_runs=1, free_run_pairs=0)
ERROR = fx.Effects(kinematic_error=(fx.Line(2.0, 1e-4, 0.8),))


@pytest.fixture(scope="module")
def campaign() -> tuple[Recording, ...]:
    return Campaign(11).recordings()


def test_the_default_campaign_holds_what_the_loop_needs(campaign: tuple[Recording, ...]):
    locked = [r for r in campaign if r.procedure == "locked-output"]
    assert len({r.start_angle for r in locked}) == 8
    assert len({r.replicate for r in locked} - {None}) == 2
    assert sum(r.procedure == "backdrive" for r in campaign) == 4
    slow = next(r for r in campaign if r.procedure == "free-run").truth
    speed = np.gradient(slow.motor_position) * 200.0
    for direction in (1.0, -1.0):
        leg = (direction * speed > 1.0) & (np.abs(speed) < 30.0)
        assert np.ptp(slow.output_position[leg]) > 2.0 * 2.0 * np.pi
    assert all(not np.ptp(r.truth.motor_position[: round(4.9 * 200)]) for r in campaign), "quiet dwell"


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others():
    first, again, other = (Campaign(seed, plan=SMALL).recordings()[0] for seed in (1, 1, 2))
    assert np.array_equal(first.columns["output_torque"], again.columns["output_torque"])
    assert first.start_angle != other.start_angle


def test_replicates_differ_only_by_noise_and_zeros(campaign: tuple[Recording, ...]):
    first, second = campaign[0], campaign[1]
    assert first.replicate == second.replicate is not None
    for name in ("motor_position", "output_position", "motor_torque", "output_torque"):
        assert np.array_equal(getattr(first.truth, name), getattr(second.truth, name))
    difference = first.columns["output_torque"] - second.columns["output_torque"]
    assert np.std(difference) == pytest.approx(0.02 * np.sqrt(2.0), rel=0.05)
    assert first.zeros != second.zeros


def test_a_kinematic_error_is_an_order_2_line_of_the_slow_free_run():
    run = next(r for r in Campaign(4, ERROR, plan=SMALL).recordings() if r.procedure == "free-run")
    speed = np.gradient(run.truth.motor_position) * 200.0
    motor, output = run.columns["motor_position"], run.columns["output_position"]
    leg = (np.abs(speed) < 30.0) & (np.abs(speed) > 14.0)
    orders = range(1, 7)
    angle, direction = motor[leg], np.sign(speed[leg])
    columns = [np.ones(leg.sum()), direction]
    for order in orders:
        columns += [np.sin(order * angle), np.cos(order * angle)]
    fitted = np.linalg.lstsq(np.column_stack(columns), output[leg] + motor[leg] / 100.0, rcond=None)[0]
    lines = {order: complex(*fitted[2 * order : 2 * order + 2]) for order in orders}
    # counts of 12 and 3.8 urad leave 3.7 urad rms on 25 000 samples: 0.03 urad a line; their steps are not white
    assert abs(lines[2]) == pytest.approx(1e-4, abs=5e-7)
    assert np.angle(lines[2]) == pytest.approx(0.8, abs=5e-3)
    assert max(abs(line) for order, line in lines.items() if order != 2) < 5e-7


def test_files_hold_the_contract_columns_and_nothing_of_the_truth(tmp_path: Path):
    effects = fx.Effects(kinematic_error=(fx.Line(2.0, 1.2345e-4, 0.8765),), gravity_load=fx.Arm(0.4321, 0.1))
    written = Campaign(987654321, effects, plan=SMALL).write(tmp_path)
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".toml"}
    for path in written.runs:
        header = path.read_text().splitlines()[0].split(",")
        assert header == [
            "time[s]",
            "motor_position[rad]",
            "output_position[rad]",
            "motor_torque[N*m]",
            "motor_current[A]",
            "output_torque[N*m]",
            "temperature[degC]",
        ]
        sidecar = tomllib.loads(path.with_suffix(".toml").read_text())
        assert set(sidecar) <= {"procedure", "replicate", "start_angle"}
    for path in tmp_path.glob("*.toml"):
        text = path.read_text()
        for secret in ("987654321", "kinematic", "gravity", "1.2345", "0.8765", "0.4321", "K_F0", "seed"):
            assert secret not in text, f"{secret} in {path.name}"
    assert written.secret.effects == effects
    assert set(written.held_out) < {path.stem for path in written.runs}


def test_what_is_written_is_what_was_measured(tmp_path: Path):
    campaign = Campaign(5, plan=SMALL)
    written = campaign.write(tmp_path)
    recording = campaign.recordings()[0]
    table = np.loadtxt(written.runs[0], delimiter=",", skiprows=1)
    assert table[:, 0] == pytest.approx(recording.time, abs=1e-12)
    for k, column in enumerate(recording.columns.values(), start=1):
        assert table[:, k] == pytest.approx(column, rel=1e-9, abs=1e-12)


def test_held_out_runs_are_never_replicates(campaign: tuple[Recording, ...], tmp_path: Path):
    names = Campaign(11).write(tmp_path).held_out
    alone = {r.name for r in campaign if r.replicate is None}
    assert set(names) <= alone
    assert {r.procedure for r in campaign if r.name in names} == {r.procedure for r in campaign}


def test_a_campaign_can_be_sampled_at_a_kilohertz():
    recording = Campaign(1, plan=SMALL, rate=1000.0).recordings()[0]
    assert np.diff(recording.time) == pytest.approx(1e-3)


def test_starting_torque_runs_can_be_added():
    plan = Plan(0 + 1, 0, 0, 0, 0, 0, starting_torques=1)
    recording = Campaign(8, plan=plan).recordings()[-1]
    assert recording.procedure == "starting-torque"
    assert np.max(np.abs(recording.truth.motor_torque)) == pytest.approx(0.0128, abs=6e-4)


@pytest.fixture(scope="module")
def standard() -> tuple[Recording, ...]:
    return Campaign(3, plan=STANDARD).recordings()


def rates(recording: Recording) -> np.ndarray:
    """Give the rates (N*m/s) of the straight legs of a sweep."""
    torque = (
        recording.truth.output_torque if recording.procedure == "backdrive" else 100.0 * recording.truth.motor_torque
    )
    return np.round(np.abs(np.diff(torque)) * 200.0, 6)


def test_the_standard_campaign_has_a_decade_of_rates_holds_and_start_angles(standard: tuple[Recording, ...]):
    assert sum(r.time.size for r in standard) < 600_000
    for procedure, angles in (("locked-output", 8), ("backdrive", 6)):
        runs = [r for r in standard if r.procedure == procedure]
        assert len({r.start_angle for r in runs}) == angles
        # a sine has no rate that most of its samples share
        most_common = [np.median(rates(r)[rates(r) > 0.0]) for r in runs]
        assert max(most_common) / min(most_common) > 9.0
        still = [r for r in runs if np.mean(rates(r)[1000:] == 0.0) > 0.2]
        assert len(still) >= 2, "holds"


def test_the_standard_campaign_turns_at_four_speeds_both_ways_and_under_load(standard: tuple[Recording, ...]):
    free = [r for r in standard if r.procedure == "free-run"]
    for run in free:
        speed = np.gradient(run.truth.motor_position, run.time)
        constant = np.abs(np.gradient(speed)) < 1e-9
        values = set(np.round(speed[constant & (np.abs(speed) > 0.1)], 6).tolist())
        assert len({abs(value) for value in values}) >= 4
        assert {-value for value in values} == values
        assert any(2.0 <= abs(value) <= 5.0 for value in values)
        assert np.ptp(run.truth.output_position) > 2.0 * 2.0 * np.pi
    loaded = [r for r in free if np.ptp(r.truth.output_torque) > 0.0]
    assert len(loaded) == 1
    assert set(np.round(loaded[0].truth.output_torque, 9).tolist()) >= {0.0, 6.0, -6.0, 11.0, -11.0}


def test_the_standard_campaign_is_run_cold_and_warm(standard: tuple[Recording, ...]):
    starts = [r.truth.temperature[0] for r in standard]
    assert max(starts) - min(starts) > 12.0
    assert max(np.ptp(r.truth.temperature) for r in standard) > 8.0


FEW = Plan(
    locked_angles=2,
    locked_pairs=0,
    backdrives=1,
    backdrive_pairs=0,
    free_runs=1,
    free_run_pairs=0,
    starting_torques=1,
    output_turns=0.3,
    torque_rates=(4.0,),
    loaded_free_runs=1,
    loads=STANDARD.loads,
    further_legs=((2.0, 5.0, 12.0),),
    room=(34.0, 38.0),
    warm_up=STANDARD.warm_up,
)


@pytest.fixture(scope="module")
def few() -> dict[str, Recording]:
    return {r.name: r for r in Campaign(21, plan=FEW, rate=100.0).recordings()}


@pytest.mark.parametrize("effect", sorted(DRAWN))
def test_every_effect_shows_in_the_logs_of_a_campaign(effect: str, few: dict[str, Recording]):
    """Encoders resolve 12 urad and 0.4 mrad, the torques are noisy by 0.02 N*m and 0.2 mN*m: seeds are the same."""
    resolved = {"motor_position": 4e-4, "output_position": 6e-6, "motor_torque": 2e-4, "output_torque": 0.02}
    seen = set()
    for run in Campaign(21, fx.draw(effect, np.random.default_rng(6)), plan=FEW, rate=100.0).recordings():
        plain = few[run.name]
        n = min(run.time.size, plain.time.size)
        for name, size in resolved.items():
            assert np.isfinite(run.columns[name]).all()
            change = run.columns[name][:n] - plain.columns[name][:n]
            if np.max(np.abs(change)) > 2.0 * size:
                seen.add((run.procedure, name))
    assert seen


def test_a_torque_constant_error_changes_the_motion_of_a_locked_run_and_the_torque_of_a_backdriven_one():
    wrong = fx.Effects(others=(fx.term("torque-constant-error", amplitude=0.1),))
    plain = {r.procedure: r for r in Campaign(21, plan=FEW, rate=100.0).recordings()}
    run = {r.procedure: r for r in Campaign(21, wrong, plan=FEW, rate=100.0).recordings()}
    locked, backdriven = run["locked-output"], run["backdrive"]
    noise = 6.0 * 2e-4
    assert locked.columns["motor_torque"] == pytest.approx(plain["locked-output"].columns["motor_torque"], abs=1e-12)
    assert np.max(np.abs(locked.truth.output_torque - plain["locked-output"].truth.output_torque)) > 0.5
    assert backdriven.columns["motor_torque"] == pytest.approx(1.1 * backdriven.truth.motor_torque, abs=noise)
    assert np.array_equal(backdriven.columns["output_position"], plain["backdrive"].columns["output_position"])


def test_a_fixture_yields_in_the_locked_runs_only():
    soft = fx.Effects(others=(fx.term("fixture-compliance", amplitude=4e-5),))
    for plain, run in zip(
        Campaign(21, plan=FEW, rate=100.0).recordings(),
        Campaign(21, soft, plan=FEW, rate=100.0).recordings(),
        strict=True,
    ):
        same = np.array_equal(plain.truth.motor_position, run.truth.motor_position)
        assert same == (run.procedure != "locked-output")
        assert np.array_equal(plain.truth.output_torque, run.truth.output_torque) or not same


def test_other_drives_can_be_measured():
    drive = laws.Drive(100.0, 6e3, 0.03, 1.0, 60.0, 0.02, 3.0, 0.02, 2e-4)
    recording = Campaign(21, drive=drive, plan=FEW, rate=100.0).recordings()[0]
    truth = recording.truth
    torsion = laws.total_torsion(truth.output_torque, truth.motor_torque, drive)
    assert truth.output_position + truth.motor_position / 100.0 == pytest.approx(torsion, abs=1e-11)
