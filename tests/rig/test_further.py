"""The next experiment can be typed as printed: its own folder, the bench it is meant for, the loop that follows."""

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig.commands.demo import bench_model, draw_effect
from rig.commands.further import Asked, with_commands
from rig.commands.loop import LoopCommand, _typed, dut_of, print_result
from rig.config.bench import load_bench
from rig.config.dut import default_dut
from rig.log.run import ProcedureName, Run
from rig.loop.experiment.next import NO_EFFECT
from rig.loop.files.model_check import mistakes_in
from rig.loop.result import EquationResult, Errors, LoopResult, NextExperiment, Open, Verdict
from rig.loop.table import headline, text_of
from sim_backend.model.effects import CATALOGUE

SURVEY = "rig run free-run --set free-run.speeds=5,10,20,40,80,160 --set free-run.load_torques=-9.6,0,9.6 --repeat 2"


def result(*commands: str) -> LoopResult:
    """Give the result of a loop that leaves one statement open for each command."""
    still_open = tuple(
        Open(Verdict.UNTRACED, {}, next_experiment=NextExperiment(f"Reason {k}.", command))
        for k, command in enumerate(commands)
    )
    return LoopResult(("a",), ("b",), {}, (), still_open, (), 0.0, bench_model(draw_effect(1)))


def run(bench: str | None = None, dut: str | None = None, name: str = "a") -> Run:
    """Give a run of the simulated bench, or of one whose files are these."""
    return Run(
        name, Path(f"{name}.mcap"), ProcedureName.FREE_RUN, np.arange(3.0), {},
        bench_text=load_bench("sim")[1] if bench is None else bench, dut_text=default_dut()[1] if dut is None else dut,
    )  # fmt: skip


def told(asked: Asked, *runs: Run, commands: tuple[str, ...] = (SURVEY,)) -> list[NextExperiment]:
    found = with_commands(result(*commands), runs, asked)
    return [item.next_experiment for item in found.open if item.next_experiment is not None]


def test_the_command_writes_into_a_folder_of_its_own_and_the_loop_over_old_and_new_logs_follows(tmp_path):
    (next_one,) = told(Asked((tmp_path,), None, ("--alpha", "0.05")), run())
    assert next_one.command == f"{SURVEY} -o {tmp_path / 'next'}"
    assert next_one.then == f"rig loop {tmp_path} {tmp_path / 'next'} --alpha 0.05 -o {tmp_path / 'next' / 'loop'}"
    assert next_one.why == "Reason 0."


def test_every_command_has_its_folder_and_one_that_is_there_is_not_taken(tmp_path):
    (tmp_path / "next").mkdir()
    found = told(Asked((tmp_path,)), run(), commands=("rig run backdrive", SURVEY, "rig run backdrive", ""))
    folders = [shlex.split(item.command)[-1] for item in found[:3]]
    assert folders == [str(tmp_path / name) for name in ("next-2", "next-3", "next-2")]
    assert found[3] == NextExperiment("Reason 3.", "")


def test_all_logs_of_a_folder_are_named_by_the_folder_and_a_path_with_a_blank_is_quoted(tmp_path):
    folder = tmp_path / "mon day"
    folder.mkdir()
    logs = tuple(folder / f"{name}.mcap" for name in "abc")
    for log in logs:
        log.write_bytes(b"")
    (whole,) = told(Asked(logs), run())
    assert shlex.split(whole.then)[2:4] == [str(folder), str(folder / "next")]
    (some,) = told(Asked(logs[:2]), run())
    assert shlex.split(some.then)[2:5] == [str(logs[0]), str(logs[1]), str(folder / "next")]


@pytest.mark.parametrize(("bench", "said"), [("", "the logs name none"), ("name = 'ours'", "another than the simul")])
def test_logs_of_no_bench_or_another_ask_for_the_file_of_the_bench(tmp_path, bench, said):
    (next_one,) = told(Asked((tmp_path,)), run(bench=bench))
    assert next_one.command == f"{SURVEY} --bench BENCH.toml --dut DUT.toml -o {tmp_path / 'next'}"
    assert "--bench" not in next_one.then
    assert said in next_one.why


def test_the_device_file_of_the_loop_goes_with_both_commands(tmp_path):
    (next_one,) = told(Asked((tmp_path,), Path("gear.toml")), run(bench="", dut=""))
    assert "--bench BENCH.toml --dut gear.toml -o" in next_one.command
    assert "--dut gear.toml" in next_one.then
    assert "DUT.toml" not in next_one.command + next_one.why


def test_a_bench_that_runs_a_model_runs_it_again(tmp_path):
    (next_one,) = told(Asked((tmp_path,), model=Path("bench.json")), run())
    assert next_one.command == f"{SURVEY} --model bench.json -o {tmp_path / 'next'}"


def test_logs_of_a_bench_that_ran_a_model_ask_for_the_model(tmp_path):
    logged = replace(run(), metadata={"backend": "simulated, drawn.json sha256:0123456789abcdef"})
    (next_one,) = told(Asked((tmp_path,)), logged)
    assert next_one.command == f"{SURVEY} --model MODEL.json -o {tmp_path / 'next'}"
    assert "MODEL.json stands for the model that the bench ran: simulated, drawn.json sha256:0123" in next_one.why


def test_a_device_file_written_otherwise_is_the_same_device():
    again = bench_model(draw_effect(1)).dut_text()
    assert again != default_dut()[1]
    assert dut_of([run(), run(dut=again, name="b")]) == default_dut()[0]


def test_options_of_the_loop_are_typed_again_where_they_are_not_the_usual_ones():
    usual = LoopCommand(None, None, None, (), 0.01, 0, None, Path("x"), False)
    assert _typed(usual) == ()
    other = replace(usual, base=Path("m.json"), compliance="cubic", held_out=("a*", "b"), alpha=0.05, seed=3)
    words = "--base m.json --compliance cubic --held-out a* --held-out b --alpha 0.05 --seed 3"
    assert _typed(other) == tuple(words.split())


def test_one_run_is_told_as_one():
    assert "(1 training run, 1 held out; nothing was added)" in headline(result())


def test_the_headline_says_of_which_procedure_no_run_was_held_out():
    fitted, tested = (
        Errors(2.0, 1.0, 3.0, 2.0, by_procedure=dict.fromkeys(names, Errors(2.0, 1.0, 3.0, 2.0)))
        for names in (("free-run", "backdrive"), ("backdrive",))
    )
    equations = {"motor-torque": EquationResult("N*m", tested, fitted), "torsion": EquationResult("rad", None, tested)}
    assert "(1 training run, 1 held out, none tests free-run; nothing" in headline(
        replace(result(), equations=equations)
    )


def test_the_rival_that_nothing_is_missing_is_no_effect_of_the_catalogue():
    assert NO_EFFECT == "no effect"
    assert NO_EFFECT not in CATALOGUE


def test_an_error_above_its_floor_is_said_below_the_table(capsys):
    errors = Errors(3e-4, 2.4e-4, 1e-3, 1e-3, 2.1e-4, (1.9e-4, 2.3e-4))
    found = replace(result(), equations={"motor-torque": EquationResult("N*m", errors, None)})
    print_result(found)
    for text in (capsys.readouterr().out, text_of(found)):
        assert "After lies above the floor's interval in motor-torque: up to 1.5 times" in " ".join(text.split())


def test_commands_stand_in_a_line_of_their_own_however_narrow_the_terminal(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    found = with_commands(result(SURVEY), [run()], Asked((tmp_path,)))
    (next_one,) = (item.next_experiment for item in found.open)
    assert next_one is not None
    assert len(next_one.command) > 80
    print_result(found)
    for text in (capsys.readouterr().out, text_of(found)):
        lines = [line.strip() for line in text.splitlines()]
        assert next_one.command in lines
        assert next_one.then in lines


@pytest.mark.parametrize("seed", range(12))
def test_the_model_of_a_demo_bench_can_be_run(seed):
    assert mistakes_in(bench_model(draw_effect(seed))) == []
