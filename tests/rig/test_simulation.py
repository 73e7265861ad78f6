"""The simulated bench is built from what a dut file says, or refused in the dut's own words."""

import pytest

from drivers.errors import ConfigError
from rig.config.bench import load_bench
from rig.config.dut import SHD_17_100, Dut, default_dut
from rig.config.toml_file import parse_toml
from rig.loop.model.parameters import parameter_table
from rig.simulation import simulate
from sim_backend.model.effects import CATALOGUE, ActiveEffect


def refused(*lines: str) -> ConfigError:
    text = SHD_17_100
    for line in lines:
        key = line.partition(" ")[0]
        (old,) = [given for given in text.splitlines() if given.partition(" ")[0] == key]
        text = text.replace(old, line if "=" in line else "")
    with pytest.raises(ConfigError) as caught:
        simulate(load_bench("sim")[0], parse_toml(text, Dut, "dut.toml"), seed=1)
    assert caught.value.source == "dut 'SHD-17-100'"
    return caught.value


@pytest.mark.parametrize(
    ("line", "paths", "limit"),
    [
        ("rated_torque = 1e9", "gear.rated_torque", "4.295e+06 N*m"),
        ("rated_torque = 1e-9", "gear.rated_torque", "0.001"),
        ("torque_constant = 1e-9", "motor.torque_constant", "4.295e+06 A"),
        (
            "starting_torque = 1e9",
            "gear.starting_torque, gear.hysteresis_loss, gear.ratio",
            "below 9 N*m with this ratio and hysteresis loss; K_w0 = 2 T_fs/(N Psi), Zhang (33),",
        ),
        ("hysteresis_loss = 1e-9", "gear.starting_torque, gear.hysteresis_loss, gear.ratio", "below 5e-05 N*m"),
        ("K1 = 1e-3", "gear.K1, gear.K2", "below 0.0166213 N*m/rad; C_F = 2 sqrt"),
        ("K2 = 1", "gear.K1, gear.K2", "below 139619 N*m/rad; C_F = 2 sqrt"),
    ],
)
def test_a_drive_that_cannot_be_is_refused_by_the_duts_keys_with_the_limit(line, paths, limit):
    (mistake,) = refused(line).mistakes
    assert mistake.path == paths
    assert limit in mistake.rule


def test_a_value_that_was_assumed_is_called_so():
    (mistake,) = refused("K1 = 1e-3", "K2").mistakes
    assert mistake.value == "0.001, 9400 (assumed)"


def test_torques_out_of_order_by_assumption_are_named():
    (mistake,) = refused("T1 = 20", "T2").mistakes
    assert mistake.path == "gear.T1, gear.T2"
    assert mistake.rule.startswith("T2 must be above 20 N*m; C_F = 2 sqrt")


def test_all_values_that_cannot_be_are_named_at_once():
    paths = [mistake.path for mistake in refused("rated_torque = 1e9", "K2 = 1", "starting_torque = 10").mistakes]
    assert paths == ["gear.rated_torque", "gear.K1, gear.K2", "gear.starting_torque, gear.hysteresis_loss, gear.ratio"]


@pytest.mark.parametrize("line", ["T1 = 1e-200", "hysteresis_loss = 1e-300", "starting_torque = 1e-300", "K1 = 1e-300"])
def test_a_value_that_no_drive_has_is_refused_by_its_key_on_the_bench_and_in_the_loop(line):
    name, _, value = line.partition(" = ")
    (mistake,) = refused(line).mistakes
    assert mistake.path == f"gear.{name}"
    assert "a drive has" in mistake.rule
    text = "\n".join(line if given.startswith(f"{name} = ") else given for given in SHD_17_100.splitlines())
    with pytest.raises(ConfigError, match=rf"gear\.{name} = {value}: is not possible"):
        parameter_table(parse_toml(text, Dut, "dut.toml"), 100.0)


def with_effect(effect: str, **changed: float) -> None:
    values = {p.name: p.typical for p in CATALOGUE[effect].parameters} | changed
    active = ActiveEffect(CATALOGUE[effect], tuple(values.values()))
    simulate(load_bench("sim")[0], default_dut()[0], effects=(active,), seed=1)


def test_an_effect_that_assumes_another_encoder_is_refused():
    with_effect("encoder-missed-counts")
    with_effect("encoder-subdivision-error", order=262144.0)
    with pytest.raises(ConfigError, match=r"encoder_counts = 4096\.0 1/rev contradicts .* has 16384 1/rev; motor_pos"):
        with_effect("encoder-missed-counts", encoder_counts=4096.0)
    with pytest.raises(ConfigError, match=r"order = 300000\.0 1/rev contradicts .* has 524288 1/rev: at most half"):
        with_effect("encoder-subdivision-error", order=300000.0)
