"""The commands as their user meets them: exit code, one paragraph on stderr, results on stdout."""

import functools
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from drivers.clock import RealClock
from drivers.errors import DriveFaultError
from drivers.signals import BY_NAME
from drivers.types import Sample
from rig.cli import app
from rig.config.bench import BenchFile, load_bench
from rig.config.dut import default_dut
from rig.config.toml_file import parse_toml
from rig.log.load import load_run, load_runs
from rig.log.writer import LogWriter
from rig.loop.files.model_file import Model, ModelBase, ModelEffect, ModelLine
from rig.loop.files.model_storage import write_model
from rig.provenance import file_identity
from rig.session import calibration

SHORT_BACKDRIVE = ["--set", "backdrive.dwell=0.5", "--set", "backdrive.start_angles=1", "--set", "backdrive.repeats=1"]
TOO_MUCH = ["--set", "locked-output.peak_torque=0.17"]
"""About 16 N*m at the output, said outright; the default would keep below the bench's limit by itself."""
SHORT_SWEEP = [
    "--set", "locked-output.dwell=0.5", "--set", "locked-output.start_angles=1",
    "--set", "locked-output.replicate_pairs=0", "--set", "locked-output.rates=0.3",
    "--set", "locked-output.amplitudes=1",
]  # fmt: skip


def rig(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaign")
    answer = rig("run", "locked-output", *SHORT_SWEEP, "--seed", 1, "-o", folder)
    assert answer.exit_code == 0, answer.stderr
    return folder


def test_a_run_logs_the_measurement_and_its_set_up_apart(campaign):
    (run,) = load_runs([campaign])
    assert run.procedure == "locked-output"
    assert run.complete
    assert {"motor_position", "motor_torque", "output_position", "output_torque"} <= set(run.signals)
    assert list((campaign / "set-up").glob("*.mcap"))
    assert run.events[0].text == "dwell"


def test_a_log_is_shown_with_short_lines_for_its_devices_and_in_full_as_json(campaign):
    log = campaign / "locked-output-angle-1.mcap"
    shown = rig("show", log).stdout
    assert "motor: cia402, node 1 on simulated 'bench', serial 0x00000001, " in shown
    assert "settings changed" in shown
    assert "(identity and settings in full: rig show --json)" in shown
    assert max(map(len, shown.splitlines())) < 200
    assert "vendor" in json.loads(rig("show", log, "--json").stdout)["metadata"]["devices"]


def test_a_log_carries_its_provenance(campaign):
    (run,) = load_runs([campaign])
    for key in (
        "run_id",
        "procedure",
        "parameters",
        "operator",
        "dut",
        "bench",
        "backend",
        "software",
        "started",
        "calibration",
    ):
        assert run.metadata[key], key
    assert run.metadata["outcome.status"] == "done"
    assert run.metadata["outcome.safe_state_confirmed"] == "true"
    assert json.loads(run.metadata["outcome.measurements"])
    assert "SHD-17-100" in run.dut_text
    assert 'name = "sim"' in run.bench_text


def test_a_log_says_how_each_channel_came_to_its_value(tmp_path):
    answer = rig("run", "locked-output", *SHORT_SWEEP, "--set", "locked-output.tare=true", "-o", tmp_path)
    assert answer.exit_code == 0, answer.stderr
    (run,) = load_runs([tmp_path])
    channels = json.loads(run.metadata["calibration"])
    for name in ("motor_position", "motor_torque", "load_torque", "output_position", "output_torque"):
        assert (channels[name]["sign"], channels[name]["unit"]) == (1, BY_NAME[name].unit)
    assert channels["output_position"]["resolution"] == pytest.approx(2 * math.pi / 524288)
    assert channels["motor_torque"]["resolution"] == pytest.approx(0.188e-3, rel=0.01)
    assert channels["motor_position"]["resolution"] is None
    assert re.match(r"removed \S+ N\*m in locked-output-set-up", channels["output_torque"]["tare"])
    sets_up = [json.loads(set_up.metadata["calibration"]) for set_up in load_runs([tmp_path / "set-up"])]
    assert None in [channels["output_torque"]["tare"] for channels in sets_up]
    text = load_bench("sim")[1].replace("[limits]", "[devices.load.sign]\nload_torque = -1\n[limits]")
    turned = calibration(parse_toml(text, BenchFile, "bench.toml"), (), {})
    assert (turned["load_torque"]["sign"], turned["load_position"]["sign"]) == (-1, 1)


def test_a_second_run_into_one_folder_overwrites_nothing(campaign, tmp_path):
    for _ in range(2):
        assert rig("run", "locked-output", *SHORT_SWEEP, "-o", tmp_path).exit_code == 0
    assert len(load_runs([tmp_path])) == 2


def test_show_prints_what_the_log_holds(campaign):
    (run,) = load_runs([campaign])
    answer = rig("show", run.file)
    assert answer.exit_code == 0
    assert "output_torque" in answer.stdout
    assert "locked-output" in answer.stdout
    assert json.loads(rig("show", run.file, "--json").stdout)["samples"] == len(run.time)


def aborted(path: Path, ripple: float = 1e-4) -> Path:
    """Write a log whose run was aborted in the middle of a sweep; the torque changes by `ripple`, N*m."""
    writer = LogWriter(path, {"run_id": "1", "procedure": "free-run"}, attachments={}, cycle_rate=1000, epoch_ns=0)
    for cycle in range(3000):
        angle = 0.02 * max(cycle - 500, 0)
        writer.write(
            Sample(
                time=1e-3 * cycle,
                cycle=cycle,
                motor_position=angle,
                output_position=-angle / 100,
                motor_torque=0.01 + ripple * (cycle % 3),
            )
        )
    writer.close({"status": "aborted", "error": "Aborted by SIGINT in 'sweep'. Reaction: ramp."})
    return path


def test_show_tells_at_the_top_how_the_run_ended_beside_whether_the_file_was_closed(campaign, tmp_path):
    lines = rig("show", aborted(tmp_path / "a.mcap")).stdout.splitlines()
    assert lines[3] == "outcome      ABORTED: Aborted by SIGINT in 'sweep'. Reaction: ramp."
    assert lines[4] == "file         complete: it was closed"
    (run,) = load_runs([campaign])
    assert rig("show", run.file).stdout.splitlines()[3] == "outcome      done: went as planned"


def test_show_prints_measurements_as_the_run_did_and_parameters_with_their_units(campaign):
    (run,) = load_runs([campaign])
    lines = [" ".join(line.split()) for line in rig("show", run.file).stdout.splitlines()]
    measured = json.loads(run.metadata["outcome.measurements"])
    assert "quantity value ± unit meaning" in lines
    for m in measured:
        row = f"{m['name']} {m['value']:.5g} {m['uncertainty']:.2g} {m['unit']} "
        assert any(line.startswith(row) for line in lines), row
    for told in ("parameters dwell 0.5 s", "rates 0.3 N*m/s", "tare no", "outcome.extremes motor_torque 0.172208 N*m"):
        assert told in lines, told
    assert any(line.startswith("motor_torque device motor, unit N*m, sign 1, resolution 0.000188") for line in lines)
    assert not any("{" in line for line in lines)


@pytest.mark.parametrize(
    ("measurements", "told"),
    [
        ('[{"name": "x"}]', "outcome.measurements name x"),
        ('[{"name": 1, "value": 2.5, "unit": "N*m"}]', "1 2.5 N*m"),
        ('[{"name": "x", "value": 2.5, "unit": "N*m", "uncertainty": "nan"}]', "x 2.5 nan N*m"),
        ('[{"name": "x", "value": 2.5, "unit": "N*m", "uncertainty": []}]', "name x, value 2.5, unit N*m"),
        ('[{"name": "x", "value": %s, "unit": "N*m"}]' % ("1" + 400 * "0"), "outcome.measurements name x"),
        ("[1, 2]", "outcome.measurements 1"),
    ],
)
def test_show_prints_metadata_that_is_no_json_as_it_is(tmp_path, measurements, told):
    info = {"run_id": "1", "parameters": "{speed", "note": "[see page 3]"}
    writer = LogWriter(tmp_path / "x.mcap", info, attachments={}, cycle_rate=1000, epoch_ns=0)
    writer.write(Sample(time=0.0, cycle=0, motor_position=1.0))
    writer.close({"status": "done", "measurements": measurements})
    answer = rig("show", tmp_path / "x.mcap")
    assert answer.exit_code == 0
    shown = "\n".join(" ".join(line.split()) for line in answer.stdout.splitlines())
    for text in ("parameters {speed", "note [see page 3]", told):
        assert text in shown, text


def test_show_tells_what_is_empty_or_not_set_and_the_unit_of_a_speed_that_is_no_signal(tmp_path):
    info = {"run_id": "1", "procedure": "backdrive", "parameters": '{"rates": [], "motion": null, "note": ""}'}
    writer = LogWriter(tmp_path / "x.mcap", info, attachments={}, cycle_rate=1000, epoch_ns=0)
    writer.write(Sample(time=0.0, cycle=0, motor_position=1.0))
    writer.close({"status": "done", "extremes": '{"load_velocity": 0.5}'})
    lines = [" ".join(line.split()) for line in rig("show", tmp_path / "x.mcap").stdout.splitlines()]
    for told in ("parameters rates empty", "motion not set", "note -", "outcome.extremes load_velocity 0.5 rad/s"):
        assert told in lines, told


@pytest.mark.parametrize("command", ["show", "recover"])
def test_a_folder_is_no_log_and_the_message_says_so_and_names_one(campaign, tmp_path, command):
    answer = rig(command, campaign)
    assert answer.exit_code == 5
    assert "this is a folder, with 1 log in it: locked-output-angle-1.mcap" in answer.stderr
    assert f"Name one of them: {campaign / 'locked-output-angle-1.mcap'}" in answer.stderr
    assert "a folder, with 0 logs in it. Expected one log" in rig(command, tmp_path).stderr


def test_a_folder_in_the_place_of_a_model_is_answered_with_the_model_in_it(tmp_path):
    arguments = ("run", "locked-output", "--dry-run", "--model", tmp_path)
    answer = rig(*arguments)
    assert answer.exit_code == 2
    assert answer.stderr.endswith("is a folder, no model.\n")
    (tmp_path / "model.json").write_text("{}")
    assert rig(*arguments).stderr.endswith(f"is a folder, no model. The model in it is {tmp_path / 'model.json'}.\n")


def test_logs_in_the_place_of_the_model_are_answered_with_the_order_that_is_meant(campaign):
    for logs in (campaign, campaign / "locked-output-angle-1.mcap"):
        answer = rig("predict", logs, "runs/model.json")
        assert answer.exit_code == 2
        assert "the model (model.json) comes first, then the logs" in answer.stderr
        assert answer.stderr.endswith(f"rig predict runs/model.json {logs}\n")


def test_the_loop_is_named_as_next_only_where_two_runs_are_there_and_earlier_logs_are_told_first(tmp_path):
    first, second = (rig("run", "backdrive", *SHORT_BACKDRIVE, "-o", tmp_path).stderr for _ in range(2))
    assert first.endswith(f"Logs in {tmp_path}.\n")
    assert "already holds" not in first
    told = f"{tmp_path} already holds 1 log: rig loop {tmp_path} will read these and the new ones."
    lines = second.splitlines()
    assert lines.index(told) < next(k for k, line in enumerate(lines) if line.startswith("backdrive, run 1/1"))
    assert second.endswith(f"Logs in {tmp_path}. Next: rig loop {tmp_path}\n")


def test_replicates_alone_are_not_sent_to_the_loop_and_a_further_experiment_with_the_earlier_logs(tmp_path):
    out = tmp_path / "next"
    first = rig("run", "backdrive", *SHORT_BACKDRIVE, "--repeat", 2, "-o", out).stderr
    assert first.endswith(f"Logs in {out}.\n")
    (tmp_path / "locked-output-angle-1.mcap").write_bytes(b"")
    second = rig("run", "backdrive", *SHORT_BACKDRIVE, "-o", out).stderr
    assert second.endswith(f"Logs in {out}. Next: rig loop {tmp_path} {out}, with the options of the loop before\n")


def test_logs_of_starting_torques_do_not_count_as_runs_for_the_loop(tmp_path):
    (tmp_path / "starting-torque-angle-1.mcap").write_bytes(b"")
    told = rig("run", "backdrive", *SHORT_BACKDRIVE, "-o", tmp_path).stderr
    assert told.endswith(f"Logs in {tmp_path}.\n")


def test_a_result_never_takes_the_place_of_its_own_base_model(tmp_path):
    base = tmp_path / "model.json"
    base.write_text("the base model")
    answer = rig("loop", tmp_path, "--base", base, "-o", tmp_path)
    assert answer.exit_code == 2
    assert "the base model, which the result would replace" in " ".join(answer.stderr.split())
    assert base.read_text() == "the base model"


def test_a_prediction_of_an_aborted_run_says_that_it_was_aborted(tmp_path):
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters={})
    write_model(Model(schema="rig.model/1", dut=default_dut()[0], base=base, software="0"), tmp_path / "model.json")
    told = "a: the run was aborted (Aborted by SIGINT in 'sweep')."
    arguments = ("predict", tmp_path / "model.json", aborted(tmp_path / "a.mcap"), "-o", tmp_path / "out")
    answer = rig(*arguments)
    assert answer.exit_code == 0, answer.stderr
    assert f"! {told}" in answer.stderr.splitlines()
    assert json.loads(rig(*arguments, "--json").stdout)["warnings"] == [told]


def test_a_prediction_takes_a_dead_channel_as_not_recorded_and_says_so(tmp_path):
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters={})
    write_model(Model(schema="rig.model/1", dut=default_dut()[0], base=base, software="0"), tmp_path / "model.json")
    dead = aborted(tmp_path / "a.mcap", ripple=0.0)
    answer = rig("predict", tmp_path / "model.json", dead, "-o", tmp_path / "out")
    assert answer.exit_code == 0, answer.stderr
    assert "! a: motor_torque stood still while the drive moved, taken as not recorded." in answer.stderr.splitlines()
    assert "motor_torque" not in (tmp_path / "out" / "a.csv").read_text().splitlines()[0]


@pytest.mark.parametrize("kind", ["hdf5", "csv"])
def test_export_writes_one_file_per_run(campaign, tmp_path, kind):
    answer = rig("export", campaign, "--to", kind, "-o", tmp_path, "--json")
    assert answer.exit_code == 0, answer.stderr
    assert all(Path(name).stat().st_size > 0 for name in json.loads(answer.stdout)["files"])


def test_json_on_stdout_is_the_result_and_nothing_else(tmp_path):
    answer = rig("run", "backdrive", *SHORT_BACKDRIVE, "--json", "-o", tmp_path)
    record = json.loads(answer.stdout)
    names = {m["name"] for m in record["procedures"][0]["measurements"]}
    assert "hysteresis_loss" in names


def test_repeats_are_replicates_of_each_other(tmp_path):
    answer = rig("run", "locked-output", *SHORT_SWEEP, "--repeat", 2, "-o", tmp_path)
    assert answer.exit_code == 0, answer.stderr
    groups = {run.replicate for run in load_runs([tmp_path])}
    assert len(groups) == 1
    assert None not in groups


def test_a_dry_run_moves_nothing_and_prints_extremes_and_duration(tmp_path):
    answer = rig("run", "locked-output", *SHORT_SWEEP, "--dry-run", "--json", "-o", tmp_path / "none")
    assert answer.exit_code == 0, answer.stderr
    record = json.loads(answer.stdout)
    assert record["duration_s"] > 1
    assert "motor_torque" in record["dry_run"][-1]["extremes"]
    assert not (tmp_path / "none").exists()


def test_the_planned_time_of_all_runs_is_told_before_they_start(tmp_path):
    answer = rig("run", "locked-output", *SHORT_SWEEP, "backdrive", *SHORT_BACKDRIVE, "-o", tmp_path)
    lines = answer.stderr.splitlines()
    plan = next(line for line in lines if line.startswith("Planned"))
    further = lines[lines.index(plan) + 1 :]
    planned = re.fullmatch(
        r"Planned: (\d+) runs with \d+ set-up moves?, (\d+) s of bench time "
        r"\(locked-output (\d+) s, backdrive (\d+) s\)",
        plan,
    )
    took = sum(float(line.split()[1]) for line in further if line.startswith("done"))
    assert int(planned[1]) == sum(line.startswith("done") for line in further) == 2
    numbers = [line.split(":")[0] for line in further if ", run " in line]
    assert numbers == ["locked-output, run 1/2", "backdrive, run 2/2"]
    assert 0.8 * took < float(planned[2]) < 2 * took
    assert float(planned[2]) == pytest.approx(float(planned[3]) + float(planned[4]), abs=1.5)


def test_a_dry_run_shows_runs_through_the_same_phases_once_and_ends_with_the_nearest_limit(tmp_path):
    answer = rig("run", "backdrive", *SHORT_BACKDRIVE, "--repeat", 3, "--dry-run")
    assert "and 2 more like it" in " ".join(answer.stdout.replace("│", " ").split())
    assert answer.stdout.count("dwell at 0.0") == 1
    last = answer.stderr.splitlines()[-1]
    found = re.fullmatch(r"All within limits; nearest: (\w+) ([\d.]+) of ([\d.]+) (\S+) \((\d+) %\) in (\S+)", last)
    assert found is not None, last
    assert float(found[5]) == pytest.approx(100.0 * float(found[2]) / float(found[3]), abs=0.6)


def test_a_dry_run_tells_the_planned_time_before_it_starts(tmp_path):
    answer = rig("run", "backdrive", *SHORT_BACKDRIVE, "--dry-run")
    assert answer.stderr.startswith("Planned: 1 run with 1 set-up move, ")
    assert "\n1 run with 1 set-up move took " in answer.stderr


def test_a_device_file_that_contradicts_itself_is_called_doubtful_before_it_is_run(tmp_path):
    dut = tmp_path / "dut.toml"
    dut.write_text(default_dut()[1].replace("T2 = 12.0", "T2 = 120.0"))
    answer = rig("run", "locked-output", *SHORT_SWEEP, "--dut", dut, "--dry-run")
    assert answer.exit_code == 0, answer.stderr
    assert answer.stderr.startswith("doubtful: gear.T1 = 3.9 N*m, gear.T2 = 120 N*m: T2/rated_torque is 7.5, usually ")


def test_without_a_terminal_a_long_run_tells_how_far_it_is(tmp_path):
    settings = ["backdrive.dwell=70", "backdrive.start_angles=1", "backdrive.repeats=1", "backdrive.amplitudes=0.2"]
    answer = rig("run", "backdrive", *(word for text in settings for word in ("--set", text)), "-o", tmp_path)
    assert answer.exit_code == 0, answer.stderr
    lines = [line for line in answer.stderr.splitlines() if line.startswith("backdrive, run 1/1: ")]
    assert len(lines) >= 2
    assert re.search(r"dwell, 60 of about \d+ s", lines[1])


def test_a_dry_run_refuses_what_would_break_a_limit_of_a_real_bench(tmp_path):
    text = (
        load_bench("sim")[1]
        .replace('"simulated"\nchannel', '"socketcan"\nchannel')
        .replace('lock = "simulated"', 'lock = "operator"')
    )
    bench = tmp_path / "bench.toml"
    bench.write_text(text.replace("output_torque = 30.0", "output_torque = 12.0"))
    answer = rig("run", "locked-output", *SHORT_SWEEP, *TOO_MUCH, "--bench", bench, "--dry-run")
    assert answer.exit_code == 2
    assert "output_torque" in answer.stderr
    assert "12" in answer.stderr
    assert ".." not in answer.stderr


def test_a_file_in_the_place_of_the_set_up_folder_is_named(tmp_path):
    (tmp_path / "set-up").write_text("mine")
    answer = rig("run", "locked-output", *SHORT_SWEEP, "-o", tmp_path)
    assert answer.exit_code == 2
    assert "set-up" in answer.stderr
    assert "is a file" in answer.stderr
    assert "overwritten" not in answer.stderr


def test_a_real_bench_does_not_move_without_a_device_under_test(tmp_path):
    text = load_bench("sim")[1].replace('"simulated"\nchannel', '"socketcan"\nchannel')
    bench = tmp_path / "bench.toml"
    bench.write_text(text.replace('lock = "simulated"', 'lock = "operator"'))
    answer = rig("run", "free-run", "--bench", bench, "--yes", "-o", tmp_path / "runs")
    assert answer.exit_code == 2
    assert "--dut" in answer.stderr


def test_a_limit_hit_in_motion_ends_with_code_3_and_a_complete_log(tmp_path):
    bench = tmp_path / "bench.toml"
    # how much viscous friction there is no plan can know: 24 mN*m at 200 rad/s
    bench.write_text(load_bench("sim")[1].replace("motor_torque = 0.25 ", "motor_torque = 0.02 "))
    setting = ["--set", "free-run.speeds=200", "--set", "free-run.dwell=0.5", "--set", "free-run.repeats=1"]
    answer = rig("run", "free-run", *setting, "--bench", bench, "--seed", 2, "-o", tmp_path / "runs")
    assert answer.exit_code == 3
    for word in ("motor_torque", "0.02 N*m", "confirmed", ".mcap"):
        assert word in answer.stderr
    (run,) = load_runs([tmp_path / "runs"])
    assert run.complete
    assert run.metadata["outcome.status"] == "limit"


def test_a_simulated_plant_that_is_lost_is_a_bench_fault_with_code_3_and_a_complete_log(tmp_path, monkeypatch):
    monkeypatch.setattr("sim_backend.plant.check_effects", lambda effects, config: None)  # which refuses it
    wild = ModelEffect(
        effect="kinematic-error",
        enters="torsion",
        variable="motor_position",
        shape="periodic",
        lines=(ModelLine(order=1e3, amplitude=0.05, phase=0.0),),
        parameters={},
    )
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters={})
    model = tmp_path / "model.json"
    write_model(Model(schema="rig.model/1", dut=default_dut()[0], base=base, effects=(wild,), software="0"), model)
    answer = rig("run", "starting-torque", "--model", model, "--seed", 1, "-o", tmp_path / "runs")
    assert answer.exit_code == 3
    for word in ("cannot be computed", "motor_position", "kinematic-error (amplitude = 0.05 rad", "its step", ".mcap"):
        assert answer.stderr.count(word) == 1, word
    (run,) = load_runs([tmp_path / "runs" / "set-up"])
    assert run.complete
    assert run.metadata["outcome.status"] == "fault"
    assert run.metadata["backend"] == f"simulated, {file_identity(model)}"
    assert all(math.isfinite(value) for value in run.signals["motor_position"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "locked-outputs"], ["locked-outputs", "there are"]),
        (
            ["run", "free-run", "--set", "free-run.sped=3"],
            ["free-run.sped", "no such parameter (did you mean speeds?)"],
        ),
        (["loop", ".", "--compliance", "arctn"], ["expected one of arctan", "did you mean arctan?"]),
        (["export", ".", "--to", "hdf"], ["expected one of hdf5", "did you mean hdf5?"]),
        (["run", "free-run", "--set", "free-run.dwell=-1"], ["free-run.dwell", "out of range"]),
        (["run", "free-run", "--set", "free-run.dwell=long"], ["free-run.dwell", "number"]),
        (["run", "free-run", "--set", "dwell=1"], ["PROCEDURE.NAME=VALUE"]),
        (["run", "free-run", "--bench", "none.toml"], ["none.toml"]),
        (["run", "free-run", "--dut", "none.toml"], ["none.toml"]),
        (["run", "free-run", "--model", "none.json"], ["none.json"]),
        (["export", ".", "--to", "xlsx"], ["xlsx", "hdf5"]),
        (["run", "free-run", "--set", "free-run.dwell=1_0"], ["free-run.dwell = '1_0'", "a number"]),
        (["run", "free-run", "--set", "free-run.repeats=１"], ["free-run.repeats", "a whole number"]),
        (["run", "free-run", "--set", f"free-run.dwell={'1' * 5000}"], ["free-run.dwell = '1111", "1...'"]),
        (["run", "free-run", "--set", f"{'1' * 5000}"], ["PROCEDURE.NAME=VALUE"]),
        (["run", "free-run", "--set", "free-run.dwell=2", "--set", "free-run.dwell=3"], ["dwell=3", "set twice"]),
        (["run", "fre-run"], ["fre-run", "did you mean free-run?"]),
        (["run", "free-run", "-o", ""], ["-o", "expected a path"]),
        (["run", "free-run", "--dut", ""], ["--dut", "expected a path"]),
        (["run", "free-run", "--bench", ""], ["--bench", "expected a bench file"]),
        (["show", ""], ["RUN", "expected a path"]),
        (["proceduers"], ["proceduers", "did you mean 'procedures'?"]),
        (["loop", ".", "--alpha", "nan"], ["--alpha = 'nan'", "0.5", "rig loop --help"]),
        (["run", "free-run", "--repeat=0"], ["--repeat = '0'", "greater than or equal to 1"]),
        (["show"], ["RUN = None: missing"]),
        (["show", "--colour", "red"], ["No such option: --colour"]),
        (["run", "free-run", "--set"], ["--set", "requires an argument"]),
    ],
)
def test_wrong_use_is_one_paragraph_and_code_2(arguments, words):
    answer = rig(*arguments)
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert len(answer.stderr.splitlines()) == 1
    assert len(answer.stderr) < 1000
    assert not re.search(r"[^.]\.\.(\s|$)|\.;", answer.stderr)
    for word in words:
        assert word in answer.stderr


@pytest.mark.parametrize("arguments", [["run", "free-run", "--repeat", "0"], ["bla"], ["show", "none.mcap"]])
def test_an_error_is_json_too_where_json_is_asked_for(arguments):
    answer = rig(*arguments, "--json")
    error = json.loads(answer.stdout)["error"]
    assert error["exit_code"] == answer.exit_code
    assert error["message"] in answer.stderr


def test_the_procedures_say_where_a_default_comes_from():
    words = " ".join(rig("procedures").stdout.split())
    for told in (
        "torque_max from dut ",
        "from dut: 4 starting torques",
        "speeds empty ",
        "Default 'from dut': worked out",
    ):
        assert told in words


def test_without_a_command_there_is_help():
    answer = rig()
    assert answer.exit_code == 0
    assert "procedures" in answer.stdout


def test_nothing_is_said_to_be_assumed_before_a_refusal(tmp_path):
    dut = tmp_path / "dut.toml"
    dut.write_text('name = "x"\n[gear]\nrated_torque = 16\n')
    answer = rig("run", "starting-torque", "--dut", dut)
    assert answer.exit_code == 2
    assert "gear.ratio" in answer.stderr
    assert "assumed" not in answer.stderr


def test_every_wrong_argument_is_named_at_once():
    answer = rig("run", "spin", "free-run", "--set", "free-run.a=1", "--set", "free-run.dwell=-1", "--set", "x")
    for word in ("spin", "free-run.a", "free-run.dwell", "'x'"):
        assert word in answer.stderr


def broken(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("foreign.mcap", b"\x89MCAP0\r\nwhatever", ["foreign.mcap"]),
        ("text.mcap", b"no mcap at all", ["text.mcap"]),
        ("nan.csv", b"time[s],motor_position[rad]\n0,0\n1,nan\n", ["motor_position", "row 3"]),
        ("unit.csv", b"time[s],motor_position[bananas]\n0,0\n1,1\n", ["motor_position", "bananas"]),
        ("order.csv", b"time[s],motor_position[rad]\n0,0\n2,1\n1,2\n", ["time", "row 4"]),
        ("notime.csv", b"motor_position[rad]\n0\n1\n", ["time"]),
        ("empty.csv", b"", ["empty.csv"]),
    ],
)
def test_a_bad_log_is_one_error_with_code_5(tmp_path, name, content, words):
    answer = rig("show", broken(tmp_path, name, content))
    assert answer.exit_code == 5
    for word in words:
        assert word in answer.stderr


def test_a_cut_off_log_is_shown_and_recovered(campaign, tmp_path):
    (run,) = load_runs([campaign])
    cut = broken(tmp_path, "cut.mcap", run.file.read_bytes()[: run.file.stat().st_size // 2])
    shown = rig("show", cut, "--json")
    assert shown.exit_code == 0
    assert json.loads(shown.stdout)["complete"] is False
    assert rig("recover", cut, "-o", tmp_path / "saved.mcap").exit_code == 0
    assert len(load_run(tmp_path / "saved.mcap").time) == json.loads(shown.stdout)["samples"]


def test_what_holds_for_a_whole_recording_is_told_once(tmp_path):
    rows = "".join(f"{index // 2},{index}\n" for index in range(40))
    table = broken(tmp_path, "x.csv", f"time[s],motor_torque[N*m]\n{rows}".encode())
    rules = broken(tmp_path, "map.toml", b'[run.split]\nby = "time"\nblocks = 4\n')
    answer = rig("import", table, "--map", rules, "-o", tmp_path / "out")
    assert answer.exit_code == 0, answer.stderr
    assert len(answer.stdout.splitlines()) == 4
    assert answer.stderr.count("merged by mean") == 1
    assert answer.stderr.count("no procedure is stated") == 1
    assert "x.csv: 20 samples with the time stamp of the one before" in answer.stderr


def test_what_holds_for_one_run_of_a_recording_is_told_of_it(tmp_path):
    times = [0, 1, 2, 3, 4, 5, 6, 7, 8, 20, 21, 22]
    table = broken(tmp_path, "x.csv", b"t,tau\n" + "".join(f"{time},{time}\n" for time in times).encode())
    rules = b'[signals.time]\ncolumn = "t"\n[signals.motor_torque]\ncolumn = "tau"\n[run.split]\nby = "time"\n'
    answer = rig("import", table, "--map", broken(tmp_path, "m.toml", rules + b"period = 21\n"), "-o", tmp_path / "out")
    assert "x-01: 1 gap" in answer.stderr
    assert "x-02: 1 gap" not in answer.stderr


def test_gaps_all_over_a_recording_are_told_of_the_recording_alone(tmp_path):
    times = [float(time) for time in range(60) if time % 15 < 5]
    table = broken(tmp_path, "x.csv", b"t,tau\n" + "".join(f"{time},{time}\n" for time in times).encode())
    rules = (
        b'[signals.time]\ncolumn = "t"\n[signals.motor_torque]\ncolumn = "tau"\n[run.split]\nby = "time"\nblocks = 2\n'
    )
    answer = rig("import", table, "--map", broken(tmp_path, "m.toml", rules), "-o", tmp_path / "out")
    assert "x.csv: 3 gaps" in answer.stderr
    assert "x-0" not in answer.stderr.replace("x-01.mcap", "").replace("x-02.mcap", "")


def test_a_recovered_log_is_never_written_over_another(campaign, tmp_path):
    (run,) = load_runs([campaign])
    taken = broken(tmp_path, "taken.mcap", b"something")
    assert rig("recover", run.file, "-o", taken).exit_code == 2
    assert taken.read_bytes() == b"something"


def test_lists_are_complete_in_text_and_json():
    for command, key in (("procedures", "procedures"), ("devices", "devices"), ("effects", "effects")):
        assert rig(command).exit_code == 0
        assert json.loads(rig(command, "--json").stdout)[key]


PROGRAM = [sys.executable, "-m", "rig"]
ANNOUNCED = """
import rig.__main__ as program
listen = program.interrupt_on_signals
def announce():
    listen()
    print("listening", flush=True)
program.interrupt_on_signals = announce
program.main()
"""
"""The program, saying when it has begun to listen to signals."""


def wait(seconds: float) -> None:
    clock = RealClock()
    clock.sleep_until(clock.now() + seconds)


@pytest.mark.parametrize(
    ("sent", "then"),
    [
        (signal.SIGINT, signal.SIGTERM),
        (signal.SIGTERM, signal.SIGINT),
        (signal.SIGHUP, signal.SIGHUP),
    ],
)
def test_a_signal_ends_a_run_safely_with_code_4_and_a_complete_log(tmp_path, sent, then):
    process = subprocess.Popen(
        [*PROGRAM, "run", "free-run", "-o", str(tmp_path)],
        stderr=subprocess.PIPE,
        text=True,
        # under nohup a hang-up is ignored, which the program inherits and respects
        preexec_fn=functools.partial(signal.signal, signal.SIGHUP, signal.SIG_DFL),
    )
    clock = RealClock()
    while not list(tmp_path.glob("*.mcap")) and clock.now() < 60:
        wait(0.05)
    wait(0.5)
    process.send_signal(sent)
    wait(0.1)  # while the bench is made safe, the log closed, the error told or the interpreter ended
    process.send_signal(then)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 4, errors
    assert errors.splitlines()[-1].startswith(f"Aborted by {sent.name}")
    assert "confirmed" in errors
    (run,) = load_runs([tmp_path])
    assert run.complete
    assert run.metadata["outcome.status"] == "aborted"
    assert run.metadata["outcome.safe_state_confirmed"] == "true"


def test_a_dry_run_that_is_stopped_says_that_nothing_moved():
    process = subprocess.Popen(
        [*PROGRAM, "run", "free-run", "--set", "free-run.dwell=600", "--dry-run"], stderr=subprocess.PIPE, text=True
    )
    assert process.stderr.readline().startswith("Planned: ")
    assert process.stderr.readline().startswith("free-run, run 1/8: speed-1-repeat-1, ")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 4, errors
    told = errors.splitlines()[-1]
    assert told.startswith("Aborted by SIGINT")
    assert told.endswith(" This was a dry run: no device was opened and nothing moved.")
    for alarming in ("Reaction", "confirmed", "CONFIRMED", ".mcap"):
        assert alarming not in told


def test_a_dry_run_that_fails_tells_what_could_not_be_cleaned_up_and_that_nothing_moved(monkeypatch):
    error = DriveFaultError("motor", "is in fault", state="fault")
    notes = [
        "Reaction: disable; the drives confirmed it.",
        "Closing the bench failed too: no answer.",
        "The log up to here is complete: runs/free-run.mcap",
    ]
    error.facts |= {"reaction": "disable", "confirmed": True}

    def fail(*_: object) -> None:
        error.__notes__ = list(notes)
        raise error

    monkeypatch.setattr("rig.commands.run.run_jobs", fail)
    answer = rig("run", "locked-output", "--dry-run")
    assert answer.exit_code == 3
    assert answer.stderr.splitlines()[-1] == (
        "Dry run stopped: Drive 'motor' is in fault (state: fault). Closing the bench failed too: no answer. "
        "This was a dry run: no device was opened and nothing moved."
    )
    told = json.loads(rig("run", "locked-output", "--dry-run", "--json").stdout)["error"]
    assert told["notes"] == [notes[1], "This was a dry run: no device was opened and nothing moved."]
    assert (told["dry_run"], told["reaction"], told["confirmed"]) == (True, "disable", True)


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("delay", [0.0, 0.15, 0.4])
def test_a_signal_during_the_imports_is_an_abort_in_one_line(tmp_path, sent, delay):
    process = subprocess.Popen(
        [sys.executable, "-c", ANNOUNCED, "run", "free-run", "--set", "free-run.dwell=30", "-o", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "listening\n"
    wait(delay)
    process.send_signal(sent)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 4, errors
    assert errors.splitlines()[-1].startswith("Aborted by ")
    assert "Traceback" not in errors


def test_a_hang_up_that_was_to_be_ignored_does_not_end_a_run(tmp_path):
    process = subprocess.Popen(
        ["nohup", *PROGRAM, "run", "backdrive", *SHORT_BACKDRIVE, "-o", str(tmp_path)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    clock = RealClock()
    while not list(tmp_path.glob("*.mcap")) and clock.now() < 60:
        wait(0.05)
    process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_run_goes_on_and_is_logged_when_nobody_reads_the_terminal(tmp_path, unbuffered):
    process = subprocess.Popen(
        [*PROGRAM, "run", "backdrive", *SHORT_BACKDRIVE, "--repeat", "2", "-o", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )
    process.stdout.close()
    process.stderr.close()
    assert process.wait(timeout=60) == 0
    assert len(load_runs([tmp_path])) == 2


def test_a_run_is_logged_without_any_standard_descriptor(tmp_path):
    command = f"exec {shlex.join([*PROGRAM, 'run', 'backdrive', *SHORT_BACKDRIVE, '-o', str(tmp_path)])} <&- >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], timeout=60).returncode == 0
    (run,) = load_runs([tmp_path])
    assert run.complete


@pytest.mark.parametrize("arguments", [["procedures"], ["--help"], ["effects", "--json"]])
def test_a_reader_that_stops_early_is_no_error(arguments):
    process = subprocess.Popen([*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait(timeout=60) == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_under_stdout_is_one_paragraph_and_code_2():
    with Path("/dev/full").open("w") as full:
        answer = subprocess.run([*PROGRAM, "procedures"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
        assert answer.returncode == 2
        assert len(answer.stderr.splitlines()) == 1
        assert "No space left" in answer.stderr
        answer = subprocess.run([*PROGRAM, "show", "none.mcap"], stdout=full, stderr=full, timeout=60)
        assert answer.returncode == 5


def test_hostile_names_in_a_log_do_not_reach_the_terminal_as_markup(tmp_path):
    path = tmp_path / "x.mcap"
    writer = LogWriter(
        path, {"run_id": "1", "operator": "[bold red]Eve[/]"}, attachments={}, cycle_rate=1000, epoch_ns=0
    )
    writer.write(Sample(time=0.0, cycle=0, motor_position=1.0))
    writer.write(Sample(time=1e-3, cycle=1, motor_position=2.0))
    writer.close({"status": "done"})
    assert "[bold red]Eve[/]" in rig("show", path).stdout
