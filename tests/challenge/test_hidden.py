"""What is hidden has the size it is to have, and nothing of it reaches the loop but through the signals."""

import dataclasses
import inspect
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from rig.commands import demo
from rig.log.run import Run
from tests.challenge import on_bench
from tests.challenge import run as runner
from tests.challenge.cases import EFFECTS, Case, campaign_of, make_case, scaled, together
from tests.challenge.sizes import Hidden, base_floor, floor_of, hide, logs_of, oracle_errors
from tests.independent.campaign import Plan
from tests.independent.draws import draw
from tests.independent.effects import Effects
from tests.independent.instruments import NoiseKind
from tests.independent.laws import shd_17_100
from tests.rig.loop.runs import dut as default_dut

TINY = Plan(
    locked_angles=3,
    locked_pairs=1,
    backdrives=2,
    backdrive_pairs=1,
    free_runs=2,
    free_run_pairs=1,
    output_turns=0.2,
    peaks=(0.0, 1.0, -1.0, 0.0),
    sine_share=0.0,
)
SEED = 918273645


def case_with(effect: str, size: float | None = 1.0) -> Case:
    return Case(
        "single",
        SEED,
        "tiny",
        TINY,
        NoiseKind.WHITE,
        shd_17_100(),
        (draw(effect, np.random.default_rng(3)),),
        size=size,
    )


@pytest.mark.parametrize(("effect", "size"), [("soft-windup", 1.0), ("cogging", 1.0 / 3.0)])
def test_an_effect_gets_the_size_that_is_left_of_it_beside_the_floor(effect: str, size: float):
    """By the difference of two noisy campaigns, the base fitted to each: not how the size was made."""
    case = case_with(effect, size)
    floor = floor_of(case)
    hidden = hide(case, floor)
    assert hidden.sizes[0] == pytest.approx(size, rel=0.05)
    (equation,) = hidden.equations
    with_it = floor_of(case, effects=together(hidden.effects))
    squares = with_it.train[equation] ** 2 - floor.train[equation] ** 2
    # counts that fall otherwise and noise that is correlated by chance with the effect
    assert np.sqrt(squares) / floor.train[equation] == pytest.approx(size, abs=0.12)


def errors_in_floors(effect: str, equation: str) -> tuple[float, float]:
    """Give the held-out errors of a base model that lacks the effect, and of one who knows all, in floors."""
    case = case_with(effect)
    floor = floor_of(case)
    hidden = hide(case, floor)
    runs, out = logs_of(case, hidden)
    lacking, knowing = base_floor(runs, out, default_dut()).held_out, oracle_errors(case, hidden, floor, runs, out)
    return lacking[equation] / floor.held_out[equation], knowing[equation] / floor.held_out[equation]


def test_one_who_knows_a_torque_has_the_error_of_logs_without_it():
    lacking, knowing = errors_in_floors("cogging", "motor-torque")
    assert lacking > 1.2
    assert knowing == pytest.approx(1.0, abs=1e-3)


def test_one_who_knows_a_ringing_frame_keeps_what_the_counts_make_of_it():
    """A locked encoder that stood on one count rings between two: less than the effect, more than nothing."""
    lacking, knowing = errors_in_floors("structural-resonance", "torsion")
    assert 1.005 < knowing < 1.0 + 0.5 * (lacking - 1.0)


def test_every_effect_is_scaled_and_two_together_are_the_sum():
    for effect in EFFECTS:
        drawn = draw(effect, np.random.default_rng(4))
        assert scaled(drawn, 1.0) == drawn or effect == "encoder-missed-counts"
        assert scaled(drawn, 2.0) != drawn
    both = together((draw("creep", np.random.default_rng(1)), draw("cogging", np.random.default_rng(2))))
    assert set(both.ids()) == {"creep", "cogging"}


def text_of(run: Run) -> str:
    """Give everything a run carries but its signals."""
    fields = {f.name: getattr(run, f.name) for f in dataclasses.fields(run)}
    for name in ("time", "signals", "auxiliary"):
        fields[name] = list(fields[name]) if name != "time" else []
    return repr(fields)


FIRST_DIGITS = 7
"""Letters of a number by which it is recognised, in whatever precision it is written."""


def secrets_of(case: Case, effects: Effects) -> list[str]:
    values = [value for effect in effects.ids() for found in effects.of(effect) for value in found.values()]
    numbers = [repr(value)[:FIRST_DIGITS] for value in values if value not in (1.0, 2.0, 100.0)]
    return [str(case.seed), *effects.ids(), *numbers, "amplitude", "effect"]


def test_runs_and_logs_hold_nothing_of_the_truth(tmp_path: Path):
    case = case_with("soft-windup", None)
    (hidden,) = case.hidden
    campaign = campaign_of(case, hidden)
    runs, out = logs_of(case, Hidden((hidden,), 0.0, (1.0,), ("torsion",), (1.0,)))
    text = "".join(text_of(run) for run in runs) + repr(out)
    text += "".join(path.name for path in campaign.write(tmp_path).runs)
    sidecars = [path.read_text() for path in tmp_path.glob("*.toml")]
    headers = [path.open().readline() for path in tmp_path.glob("*.csv")]
    text += "".join(sidecars + headers)
    assert len(sidecars) == len(headers) + 1
    secrets = secrets_of(case, hidden)
    for secret in secrets:
        assert secret not in text, secret
    planted = [value for effect in hidden.ids() for found in hidden.of(effect) for value in found.values()]
    seen = text_of(dataclasses.replace(runs[0], metadata={"note": f"{planted[0]!r} {planted[0]:.6g}"}))
    assert any(secret in seen for secret in secrets), "the search finds a number where there is one"


def test_with_and_without_the_effect_the_logs_have_the_same_names_columns_and_lengths():
    case = case_with("soft-windup", None)
    with_it, without = (campaign_of(case, e).recordings() for e in (case.hidden[0], Effects()))
    for one, other in zip(with_it, without, strict=True):
        assert (one.name, one.procedure, one.replicate, one.start_angle) == (
            other.name,
            other.procedure,
            other.replicate,
            other.start_angle,
        )
        assert list(one.columns) == list(other.columns)
        assert one.time.size == other.time.size
    noise = [run.columns["output_torque"] - run.truth.output_torque for run in with_it]
    same = [run.columns["output_torque"] - run.truth.output_torque for run in without]
    assert all(np.allclose(a, b, atol=1e-12) for a, b in zip(noise, same, strict=True)), "the same noise draws"


def test_the_loop_is_given_logs_and_device_file_only_and_its_answer_is_frozen_before_it_is_scored(monkeypatch):
    assert list(inspect.signature(runner.answer_of).parameters) == ["runs", "dut", "held_out"]
    order = []
    case = case_with("soft-windup", None)
    monkeypatch.setattr(runner, "make_case", lambda family, seed: case)

    def answer(runs, dut, held_out):
        order.append("answered")
        return json.dumps({"error": "does not know"})

    def scored(case, hidden, oracle, without, given):
        order.append("scored")
        assert given == {"error": "does not know"}
        return {"naming": "error", "found": [], "parameters": []}

    monkeypatch.setattr(runner, "answer_of", answer)
    monkeypatch.setattr(runner, "score", scored)
    assert runner.run_case("single", SEED)["naming"] == "error"
    assert order == ["answered", "scored"]


def test_physics_outside_the_catalogue_adds_its_channel_to_the_log_and_nothing_else():
    seeds = {make_case("outside", seed).outside: seed for seed in range(40)}
    case = dataclasses.replace(make_case("outside", seeds["supply voltage"]), plan=TINY)
    recordings = campaign_of(case, Effects(), 1e-3).recordings()
    assert all("supply_voltage" in run.columns and "room_temperature" not in run.columns for run in recordings)
    plain = campaign_of(case, Effects(), 0.0).recordings()
    for run, before in zip(recordings, plain, strict=True):
        moved = run.truth.motor_torque - before.truth.motor_torque
        expected = 1e-3 * (run.columns["supply_voltage"] - 24.0)
        assert np.max(np.abs(moved - expected)) < 1e-4
        assert np.array_equal(run.truth.output_position, before.truth.output_position)


def test_logs_of_the_simulated_bench_hold_nothing_of_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Every record of every log as bytes: names, metadata, attachments, events and samples."""
    monkeypatch.setattr(demo, "SHORT", {"starting-torque": {"dwell": "2", "start_angles": "1", "repeats": "1"}})
    case = dataclasses.replace(case_with("kinematic-error"), family="bench")
    runs, _ = on_bench.recorded(case, tmp_path)
    text = "".join(text_of(run) for run in runs) + "".join(path.name for path in tmp_path.iterdir())
    content = text.encode()
    for path in tmp_path.glob("*.mcap"):
        with path.open("rb") as file:
            reader = make_reader(file)
            content += b"".join(message.data for _, _, message in reader.iter_messages())
            content += b"".join(item.data + item.name.encode() for item in reader.iter_attachments())
            content += b"".join(repr(item.metadata).encode() for item in reader.iter_metadata())
    assert len(content) > 100_000
    (line,) = case.hidden[0].kinematic_error
    for number in (line.amplitude, line.phase):
        assert struct.pack("<d", number) not in content
        assert struct.pack("<f", number) not in content
    words = [word for word in secrets_of(case, case.hidden[0]) if word not in ("amplitude", "effect")]
    for secret in [*words, str(case.seed + 1)]:
        assert secret.encode() not in content, secret
