"""`rig effects`: the catalogue as a person and as a program read it."""

import itertools
import json
import re

import pytest
from typer.testing import CliRunner, Result

from rig.cli import app
from rig.commands.lists import GROUPS
from sim_backend.model.effects import CATALOGUE, Enters


def effects(*arguments: str, width: int = 80) -> Result:
    return CliRunner(env={"COLUMNS": str(width)}).invoke(app, ["effects", *arguments])


def test_everything_is_printed_within_80_columns():
    answer = effects()
    assert answer.exit_code == 0
    assert max(len(line.rstrip()) for line in answer.stdout.splitlines()) <= 80
    words = " ".join(answer.stdout.split())
    for effect in CATALOGUE.values():
        for text in (effect.id, effect.summary, effect.equation, effect.separated_by, ", ".join(effect.confusable)):
            assert text in words, effect.id
        for p in effect.parameters:
            assert f"{p.name} {p.low:g} to {p.high:g}" in words
            assert f"usually {p.usual[0]:g} to {p.usual[1]:g}, typically {p.typical:g}: {p.meaning}" in words


def summaries() -> dict[str, str]:
    return {effect.id: effect.summary for effect in CATALOGUE.values()}


def told_of_each(lines: list[str]) -> dict[str, str]:
    told: dict[str, str] = {}
    for line in (line for line in lines if line.startswith("  ")):
        if line.startswith("   "):
            told[list(told)[-1]] += f" {line.strip()}"
        else:
            name, told[name] = line.strip().split(maxsplit=1)
    return told


@pytest.mark.parametrize("width", [60, 80, 130])
def test_it_begins_with_the_summary_of_each_effect_and_brief_is_these_lines_alone(width: int):
    brief = effects("--brief", width=width).stdout.splitlines()
    lines = effects(width=width).stdout.splitlines()
    brief, overview = ([*itertools.takewhile(lambda line: line[0] != "`", all_lines)] for all_lines in (brief, lines))
    assert brief == overview
    assert told_of_each(overview) == summaries()
    assert max(map(len, overview)) <= width
    assert "lag(u" not in effects("creep", "--brief").stdout


@pytest.mark.parametrize("arguments", [(), ("--brief",)])
def test_each_effect_has_one_line_where_nothing_says_how_wide_a_line_may_be(arguments: tuple[str, ...]):
    lines = CliRunner(env={"COLUMNS": ""}).invoke(app, ["effects", *arguments]).stdout.splitlines()
    for effect in CATALOGUE.values():
        assert any(line.split(maxsplit=1) == [effect.id, effect.summary] for line in lines), effect.id


def test_effects_stand_below_where_they_enter():
    lines = [line.rstrip() for line in effects().stdout.splitlines()]
    headings = [next(k for k, line in enumerate(lines) if line.startswith(f"{str(e).upper()}: ")) for e in Enters]
    assert headings == sorted(headings)
    for effect in CATALOGUE.values():
        above = [e for e, k in zip(Enters, headings, strict=True) if k < lines.index(effect.id)]
        assert above[-1] is effect.enters


def test_a_name_gives_that_effect_alone_and_explains_what_its_equation_uses():
    text = effects("creep", "soft-windup").stdout
    assert "lag(u; tau):" in text
    assert "play(u; r):" not in text
    for other in CATALOGUE:
        assert (f"\n{other}\n" in text) == (other in ("creep", "soft-windup")), other


@pytest.mark.parametrize("enters", list(Enters))
def test_a_group_gives_its_effects_alone(enters: Enters):
    wanted = [effect.id for effect in CATALOGUE.values() if effect.enters is enters]
    for name in (str(enters), str(enters).replace(" ", "-"), str(enters).replace(" ", "_"), str(enters).upper()):
        assert list(told_of_each(effects(name, "--brief", width=200).stdout.splitlines())) == wanted
    headings = [line for line in effects(str(enters)).stdout.splitlines() if line.split(": ")[0].isupper()]
    assert [line.split(": ")[0] for line in headings] == [str(enters).upper()]


def test_groups_and_effects_can_be_named_together():
    records = json.loads(effects("motor-balance", "creep", "--json").stdout)["effects"]
    balance = {effect.id for effect in CATALOGUE.values() if effect.enters is Enters.MOTOR_BALANCE}
    assert {record["id"] for record in records} == {*balance, "creep"}


def test_the_help_names_every_group():
    told = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["effects", "--help"]).stdout
    for name in GROUPS:
        assert re.search(rf"[ :]{name}[,.]", told), name


def test_no_group_has_the_name_of_an_effect():
    assert not set(GROUPS) & set(CATALOGUE)


def test_what_is_not_fitted_is_marked():
    words = " ".join(effects("backlash").stdout.split())
    assert "gear ratio; given, not fitted" in words
    assert "half of the gap, at the motor; given" not in words


def test_json_holds_the_whole_entry():
    records = json.loads(effects("--json").stdout)["effects"]
    assert [record["id"] for record in records] == list(CATALOGUE)
    for record in records:
        effect = CATALOGUE[record["id"]]
        assert record["enters"] == effect.enters
        assert record["reads"] == (effect.reads or None)
        for name in ("summary", "equation", "unit", "variable", "shape", "energy", "source", "separated_by"):
            assert record[name] == getattr(effect, name)
        for name in ("signals", "amplitudes", "shows", "confusable"):
            assert record[name] == list(getattr(effect, name))
        for given, p in zip(record["parameters"], effect.parameters, strict=True):
            assert given.pop("usual") == list(p.usual)
            assert given == {
                name: getattr(p, name) for name in ("name", "unit", "low", "high", "typical", "known", "meaning")
            }


def test_json_of_one_effect():
    (record,) = json.loads(effects("cogging", "--json").stdout)["effects"]
    assert record["id"] == "cogging"


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("creap", "did you mean creep?"),
        ("Kinematic_Error", "did you mean kinematic-error?"),
        ("eccentricity", "did you mean motor-encoder-eccentricity or output-encoder-eccentricity?"),
        ("gravity", "did you mean gravity-load?"),
        ("motor_balanse", "did you mean motor-balance"),
        ("xyz", "unknown."),
    ],
)
def test_an_unknown_name_is_wrong_use_and_those_near_to_it_are_told(name: str, near: str):
    answer = effects("creep", name)
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert f"NAME = '{name}': unknown" in answer.stderr
    assert near in answer.stderr
    assert "`rig effects` lists all of them" in answer.stderr


def test_every_unknown_name_is_told_at_once():
    answer = effects("creap", "cogg", "--json")
    assert answer.exit_code == 2
    assert [mistake["value"] for mistake in json.loads(answer.stdout)["error"]["mistakes"]] == ["'creap'", "'cogg'"]
