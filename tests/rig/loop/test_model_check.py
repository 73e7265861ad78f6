"""A model file is held against the catalogue where it is read: what `rig loop` writes loads, the rest does not."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from drivers.errors import ConfigError, DataError
from rig.cli import app
from rig.config.dut import SHD_17_100, default_dut
from rig.config.toml_file import parse_toml
from rig.log.run import Run
from rig.loop.files.model_file import Model, ModelBase, ModelEffect, ModelEstimate, ModelLine
from rig.loop.files.model_storage import load_model, write_model
from rig.loop.model.parameters import parameter_table
from rig.loop.model.shapes import ShapeClass, catalogue_shapes
from rig.loop.model.terms import periodic_effects
from rig.loop.predict import predict_run
from sim_backend.model.effects import CATALOGUE, Enters
from tests.rig.loop.runs import make_run, turning_run

DUT = default_dut()[0]


def model(*effects: ModelEffect, **parameters: ModelEstimate) -> Model:
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters=parameters)
    return Model(schema="rig.model/1", dut=DUT, base=base, effects=effects, software="0")


def line_effect(name: str, **changes: Any) -> ModelEffect:
    """A line as the loop writes it."""
    kind = next(kind for kind in periodic_effects() if kind.effect == name)
    order = 1.0 if kind.fixed_order else 2.0
    parameters = {
        "amplitude": ModelEstimate(value=1e-4, ci95=(0.9e-4, 1.1e-4), unit=kind.equation.unit),
        "order": ModelEstimate(value=order, unit="1/rev"),
        "phase": ModelEstimate(value=0.3, unit="rad"),
        "amplitude_2": ModelEstimate(value=1e-5, unit=kind.equation.unit),
    }
    if kind.fixed_order:
        del parameters["order"]
    fields: dict[str, Any] = {
        "effect": name,
        "enters": kind.enters,
        "variable": kind.variable,
        "shape": kind.shape,
        "lines": (ModelLine(order=order, amplitude=1e-4, phase=0.3),),
        "parameters": parameters,
    }
    return ModelEffect(**{**fields, **changes})


def shape_effect(name: str, parameters: dict[str, ModelEstimate] | None = None, **changes: Any) -> ModelEffect:
    """An effect that is no line as the loop writes it."""
    kind = ShapeClass(CATALOGUE[name])
    own = {"encoder_counts": 16384.0, "ratio": 100.0, "torque_constant": 0.321}
    typical = {p.name: ModelEstimate(value=own.get(p.name, p.typical), unit=p.unit) for p in CATALOGUE[name].parameters}
    fields = {"effect": name, "enters": kind.enters, "variable": kind.variable, "shape": kind.shape}
    return ModelEffect(**{**fields, "parameters": {**typical, **(parameters or {})}, **changes})


def loaded(written: Model, folder: Path) -> Model:
    write_model(written, folder / "model.json")
    return load_model(folder / "model.json")


def mistakes_of(path: Path) -> list[tuple[str, str]]:
    """Give path and rule of everything for which a model file is refused."""
    with pytest.raises(ConfigError) as caught:
        load_model(path)
    return [(mistake.path, mistake.rule) for mistake in caught.value.mistakes]


def refused(written: Model, folder: Path) -> list[tuple[str, str]]:
    write_model(written, folder / "model.json")
    return mistakes_of(folder / "model.json")


@pytest.mark.parametrize("name", [kind.effect for kind in periodic_effects()])
def test_every_line_that_the_loop_can_name_is_read_back(name, tmp_path):
    written = model(line_effect(name))
    assert loaded(written, tmp_path) == written


@pytest.mark.parametrize("name", [effect.id for effect in catalogue_shapes()])
def test_every_other_effect_that_the_loop_can_name_is_read_back(name, tmp_path):
    written = model(shape_effect(name))
    assert loaded(written, tmp_path) == written


@pytest.mark.parametrize(
    "effect",
    [
        line_effect("kinematic-error", effect="unnamed:motor_position:periodic"),
        line_effect("kinematic-error", effect="ambiguous:flexspline-compliance|kinematic-error|soft-windup"),
        line_effect("cogging", effect="ambiguous:cogging|unnamed:motor_position:periodic"),
        line_effect("cogging", effect="unnamed:output_position:periodic", variable="output_position"),
        shape_effect("maxwell-slip", effect="ambiguous:maxwell-slip|soft-windup"),
    ],
)
def test_what_the_loop_could_not_name_is_read_back(effect, tmp_path):
    written = model(effect)
    assert loaded(written, tmp_path) == written


def test_every_base_parameter_of_the_loop_is_read_back(tmp_path):
    table = parameter_table(DUT, 100.0)
    parameters = {
        entry.name: ModelEstimate(value=float(value), unit=entry.unit)
        for entry, value in zip(table.entries, table.start(), strict=True)
    }
    # a fit leaves the viscous friction of a bearing a little below zero now and then
    parameters["b"] = ModelEstimate(value=-1e-6, ci95=(-3e-6, 1e-6), unit="N*m*s")
    written = model(**parameters)
    assert loaded(written, tmp_path) == written


NAMED = {effect.id for effect in CATALOGUE.values() if effect.enters is Enters.BASE}


@pytest.mark.parametrize("name", sorted(NAMED))
def test_a_base_term_is_no_effect_of_a_model(name, tmp_path):
    effect = ModelEffect(effect=name, enters="base", variable="motor_velocity", shape="static", parameters={})
    assert refused(model(effect), tmp_path) == [
        ("effects.0.effect", "is a term of the base model, whose parameters are in base.parameters")
    ]


@pytest.mark.parametrize(
    ("effect", "path", "rule"),
    [
        (shape_effect("creep", effect="crep"), "effects.0.effect", "did you mean creep"),
        (shape_effect("creep", enters="reading"), "effects.0.enters", "must be 'torsion' for creep"),
        (shape_effect("creep", variable="time"), "effects.0.variable", "must be 'output_torque'"),
        (
            shape_effect("creep", {"amplitude": ModelEstimate(value=-1.0, unit="1")}),
            "effects.0.parameters.amplitude",
            "must be 0 to",
        ),
        (
            shape_effect("creep", {"stiffness": ModelEstimate(value=8e3, unit="N*m/deg")}),
            "effects.0.parameters.stiffness.unit",
            "must be N*m/rad",
        ),
        (
            shape_effect("creep", {"bogus": ModelEstimate(value=1.0, unit="1")}),
            "effects.0.parameters.bogus",
            "is no parameter of creep",
        ),
        (shape_effect("creep").model_copy(update={"parameters": {}}), "effects.0.parameters.amplitude", "missing"),
        (
            shape_effect("backlash", {"ratio": ModelEstimate(value=50.0, unit="1")}),
            "effects.0.parameters.ratio",
            "contradicts the device, which has 100",
        ),
        (
            shape_effect("current-sensor-offset", {"torque_constant": ModelEstimate(value=0.1, unit="N*m/A")}),
            "effects.0.parameters.torque_constant",
            "contradicts the device, which has 0.321",
        ),
        (line_effect("kinematic-error", lines=()), "effects.0.lines", "is periodic and needs at least one line"),
        (
            shape_effect("creep", lines=(ModelLine(order=1.0, amplitude=0.0, phase=0.0),)),
            "effects.0.lines",
            "is not periodic",
        ),
        (
            line_effect("kinematic-error", lines=(ModelLine(order=2.0, amplitude=-1e-4, phase=0.0),)),
            "effects.0.lines.0.amplitude",
            "must be 0 to",
        ),
        (
            line_effect("kinematic-error", lines=(ModelLine(order=2.0, amplitude=1e-4, phase=1e300),)),
            "effects.0.lines.0.phase",
            "must be -6.28319 to 6.28319 rad",
        ),
        (
            line_effect("gravity-load", lines=(ModelLine(order=2.0, amplitude=1e-4, phase=0.0),)),
            "effects.0.lines.0.order",
            "must be 1 to 1 1/rev",
        ),
        (line_effect("cogging", enters="torsion"), "effects.0.enters", "must be 'motor balance'"),
        (line_effect("cogging", effect="unnamed:x:periodic", enters="reading"), "effects.0.enters", "must be one of"),
        (
            line_effect("cogging", parameters={"phase": ModelEstimate(value=1.0, unit="deg")}),
            "effects.0.parameters.phase.unit",
            "must be rad",
        ),
        (
            line_effect("cogging", effect="ambiguous:cogging|torque-ripple", lines=()),
            "effects.0.parameters",
            "must have lines, or the parameters",
        ),
    ],
)
def test_an_effect_that_cannot_be_is_refused_with_its_place(effect, path, rule, tmp_path):
    mistakes = dict(refused(model(effect), tmp_path))
    assert rule in mistakes[path]


@pytest.mark.parametrize(
    ("name", "value", "unit", "rule"),
    [
        ("C_F", 1e9, "1/(N*m)", "must be 1e-09 to 1e+06 1/(N*m)"),
        ("K_F0", 8e3, "N*m/deg", "must be N*m/rad"),
        ("K_F0", -8e3, "N*m/rad", "must be 0.001 to"),
        ("T_fs", 0.0, "N*m", "must be 1e-06 to"),
        ("b", 1e7, "N*m*s", "must be"),
        ("K_0", 1.0, "N*m", "is no parameter of the base model (did you mean K_w0"),
    ],
)
def test_a_base_parameter_that_cannot_be_is_refused(name, value, unit, rule, tmp_path):
    ((path, told),) = refused(model(**{name: ModelEstimate(value=value, unit=unit)}), tmp_path)
    assert path.startswith(f"base.parameters.{name}")
    assert told.startswith(rule.partition(" (did")[0])


def test_a_ratio_that_is_not_the_device_s_is_refused(tmp_path):
    written = model()
    other = written.model_copy(update={"base": written.base.model_copy(update={"ratio": 50.0})})
    assert refused(other, tmp_path) == [("base.ratio", f"contradicts dut.gear.ratio, which is {DUT.gear.ratio:g}")]


def test_an_interval_from_high_to_low_is_refused(tmp_path):
    ((path, rule),) = refused(model(T_fs=ModelEstimate(value=0.012, ci95=(9e9, 1.0), unit="N*m")), tmp_path)
    assert (path, rule) == ("base.parameters.T_fs.ci95", "must go from low to high")


def test_a_viscous_friction_that_would_drive_is_refused(tmp_path):
    level = ModelEstimate(value=0.012, unit="N*m")
    ((path, rule),) = refused(model(T_c=level, b=ModelEstimate(value=-1.0, unit="N*m*s")), tmp_path)
    assert path == "base.parameters.b"
    assert rule == "must be -0.00012 to 1e+06 N*m*s"


def test_a_device_that_cannot_be_is_refused_in_the_models_file(tmp_path):
    dut = parse_toml(SHD_17_100.replace("T1 = 3.9 ", "T1 = 1e-200 "), type(DUT), "dut.toml")
    assert refused(model().model_copy(update={"dut": dut}), tmp_path)[0][0] == "dut.gear.T1"


def edited(folder: Path, written: Model, place: tuple[str | int, ...], value: object) -> list[tuple[str, str]]:
    """Give what is refused of a model file in which `value` stands at `place`."""
    path = folder / "model.json"
    write_model(written, path)
    content = json.loads(path.read_text())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(content))
    return mistakes_of(path)


@pytest.mark.parametrize("value", [{}, {"value": 3.9}, [], True, "3.9", 10**400])
@pytest.mark.parametrize("name", ["T1", "T2"])
def test_what_is_no_number_in_a_models_device_is_refused_by_name(name, value, tmp_path):
    ((path, rule),) = edited(tmp_path, model(), ("dut", "gear", name), value)
    assert path == f"dut.gear.{name}"
    assert "number" in rule


NUMBERS = [
    ("base", "ratio"),
    ("base", "parameters", "K_F0", "value"),
    ("base", "parameters", "K_F0", "ci95", 1),
    ("effects", 0, "parameters", "order", "value"),
    ("effects", 0, "lines", 0, "order"),
    ("effects", 0, "lines", 0, "amplitude"),
    ("effects", 0, "lines", 0, "phase"),
]
WHOLE = ModelEstimate(value=9e3, ci95=(8e3, 9e3), unit="N*m/rad")


@pytest.mark.parametrize("value", [True, "3", "3e-5", [3.0], {}, 10**400])
@pytest.mark.parametrize("place", NUMBERS, ids=lambda place: ".".join(map(str, place)))
def test_what_is_no_number_in_a_model_is_refused_with_its_place(place, value, tmp_path):
    mistakes = edited(tmp_path, model(line_effect("kinematic-error"), K_F0=WHOLE), place, value)
    assert [path for path, _ in mistakes] == [".".join(map(str, place))]
    assert "number" in mistakes[0][1]


def test_a_whole_number_serves_in_a_model_where_a_real_one_is_meant(tmp_path):
    written = model(line_effect("kinematic-error"), K_F0=WHOLE)
    path = tmp_path / "model.json"
    write_model(written, path)
    text = path.read_text()
    assert text.count(".0") >= 6
    path.write_text(re.sub(r"(\d)\.0\b", r"\1", text))
    assert load_model(path) == written


def test_running_and_predicting_refuse_a_model_alike(tmp_path):
    path = tmp_path / "model.json"
    write_model(model(shape_effect("creep", {"amplitude": ModelEstimate(value=-1.0, unit="1")})), path)
    run = ["run", "starting-torque", "--model", str(path), "-o", str(tmp_path / "runs")]
    told = []
    for arguments in (["predict", str(path), str(tmp_path)], run):
        answer = CliRunner().invoke(app, [*arguments, "--json"])
        assert answer.exit_code == 2
        told.append(json.loads(answer.stdout)["error"]["mistakes"])
    assert told[0] == told[1]
    assert told[0][0]["path"] == "effects.0.parameters.amplitude"
    assert not (tmp_path / "runs").exists()


# ---- what a model that can be says of a run


def held_run(name: str) -> Run:
    """The output swept by +-5 N*m against a held motor."""
    time = np.arange(0.0, 20.0, 0.01)
    torque = 5.0 * np.interp(time % 10.0, [0.0, 2.5, 7.5, 10.0], [0.0, 1.0, -1.0, 0.0])
    torque = torque + 0.02 * np.random.default_rng(3).standard_normal(time.size)
    still = np.zeros(time.size)
    signals = {
        "motor_position": still,
        "output_position": torque / 8e3,
        "motor_torque": torque / 100.0,
        "output_torque": torque,
    }
    return make_run(name, "locked-output", time, signals)


@pytest.mark.filterwarnings("error")
def test_a_prediction_that_is_no_number_is_told_with_what_may_be_too_large():
    wild = line_effect("kinematic-error", lines=(ModelLine(order=1e3, amplitude=0.05, phase=0.3),))
    with pytest.raises(
        DataError,
        match=r"^d: what the model predicts of its torsion is no number\..* kinematic-error of order 1000",
    ):
        predict_run(held_run("d"), model(wild))


def test_a_model_that_can_be_still_predicts():
    for item in predict_run(turning_run("d", 7), model(line_effect("kinematic-error"))):
        assert np.all(np.isfinite(item.predicted))
    assert math.isfinite(item.residual.sum())
