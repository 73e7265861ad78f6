import pytest

from drivers.errors import ConfigError
from rig.config.catalogue import doubt
from rig.config.dut import Dut, Gear, Motor, Output, Rotation, default_dut, load_dut
from rig.config.toml_file import parse_toml


def test_only_the_name_is_needed():
    dut = parse_toml('name = "x"', Dut, "dut.toml")
    assert dut.gear.ratio is None
    assert dut.gear.rotation is Rotation.OPPOSED


def test_every_key_of_the_contract_is_read():
    dut, _ = default_dut()
    assert (dut.gear.ratio, dut.gear.K1, dut.gear.T2) == (100.0, 8.4e3, 12.0)
    assert (dut.motor.encoder_counts, dut.motor.pole_pairs, dut.output.encoder_counts) == (16384, 7, 524288)


def test_a_whole_number_serves_where_a_real_number_is_meant():
    assert parse_toml('name = "x"\n[gear]\nratio = 50', Dut, "dut.toml").gear.ratio == 50.0


@pytest.mark.parametrize(
    ("line", "path"),
    [
        ("[gear]\nratio = -100", "gear.ratio"),
        ("[gear]\nratio = inf", "gear.ratio"),
        ("[gear]\nratio = true", "gear.ratio"),
        ("[gear]\nratoi = 100", "gear.ratoi"),
        ('[gear]\nrotation = "left"', "gear.rotation"),
        ("[gear]\nT1 = 5\nT2 = 4", "T2"),
        ("[motor]\nencoder_counts = 0", "motor.encoder_counts"),
        ("[motor]\nencoder_counts = 2.5", "motor.encoder_counts"),
        ("[output]\ninertia = 0", "output.inertia"),
        ("[wheel]\nsize = 3", "wheel"),
    ],
)
def test_what_is_impossible_is_named_by_its_path(line, path):
    with pytest.raises(ConfigError) as caught:
        parse_toml(f'name = "x"\n{line}', Dut, "dut.toml")
    assert path in str(caught.value)


def test_the_text_as_written_comes_with_the_values(tmp_path):
    path = tmp_path / "dut.toml"
    path.write_text('name = "x"  # a remark\n')
    assert load_dut(path)[1] == 'name = "x"  # a remark\n'


def test_every_mistake_of_a_dut_is_told_with_its_own_path():
    with pytest.raises(ConfigError) as caught:
        parse_toml("[gear]\nratio = 0\nT1 = 5\nT2 = 4\nK_1 = 3\n", Dut, "dut.toml")
    assert {mistake.path for mistake in caught.value.mistakes} == {"name", "gear.ratio", "gear.T2", "gear.K_1"}
    assert "did you mean K1?" in str(caught.value)


@pytest.mark.parametrize(
    ("line", "rule"),
    [
        ("[gear]\nratio = 0.5", "must be at least 1 and at most 1e+06; theta_m = -N theta_o, Zhang (4), needs it"),
        ("[gear]\nratio = inf", "must be finite, at least 1 and at most 1e+06; theta_m"),
        ("[gear]\nK1 = 'stiff'", "must be a number, above 0 and at most 1e+09 N*m/rad; f = T1/K1"),
        ("[gear]\nT1 = 5\nT2 = 4", "must be above 5 N*m; f = T1/K1 + (T - T1)/K2 from T1 to T2, Zhang (11), needs it"),
        ("[motor]\ninertia = -1.0", "must be above 0 and at most 1e+09 kg*m^2; (J_m + J_wg) dw/dt = sum of torques"),
        (
            "[output]\nencoder_counts = 2.5",
            "must be a whole number, at least 1 and at most 2.14748e+09 1/rev; angle = ",
        ),
    ],
)
def test_a_wrong_number_is_told_its_range_unit_and_what_needs_it(line, rule):
    with pytest.raises(ConfigError) as caught:
        parse_toml(f'name = "x"\n{line}', Dut, "dut.toml")
    (mistake,) = caught.value.mistakes
    assert mistake.rule.startswith(rule)


@pytest.mark.parametrize("value", ["{}", "{Nm = 3.9}", "[]", "[3.9]", "true", "'3.9'", "1979-05-27", "1" + 400 * "0"])
@pytest.mark.parametrize(("name", "other"), [("T1", "T2 = 12.0"), ("T2", "T1 = 3.9")])
def test_what_is_no_number_is_refused_by_name_before_it_is_compared_with_another(name, other, value):
    with pytest.raises(ConfigError) as caught:
        parse_toml(f'name = "x"\n[gear]\n{name} = {value}\n{other}', Dut, "dut.toml")
    (mistake,) = caught.value.mistakes
    assert mistake.path == f"gear.{name}"
    assert "number" in mistake.rule


def test_every_number_of_a_dut_states_what_needs_it():
    for table in (Gear, Motor, Output):
        for name in table.model_fields:
            assert name == "rotation" or table.wanted(name).endswith(" needs it"), name


def shipped(**changed: float | None) -> Dut:
    dut = default_dut()[0]
    return dut.model_copy(update={"gear": dut.gear.model_copy(update=changed)})


def test_nothing_is_doubtful_in_the_shipped_device_nor_where_nothing_is_said():
    assert doubt(shipped()) is None
    assert doubt(Dut(name="x")) is None


@pytest.mark.parametrize("without", [(), ("rated_torque",), ("K1", "K2"), ("rated_torque", "K1", "K2")])
@pytest.mark.parametrize("changed", [{"T1": 0.39}, {"T2": 120.0}])
def test_a_torque_that_is_ten_times_off_is_doubtful_by_whatever_else_is_known(changed, without):
    told = doubt(shipped(**changed, **dict.fromkeys(without)))
    assert ("/rated_torque is " in told) == ("rated_torque" not in without)
    assert (" rad, usually " in told) == ("K1" not in without)
    assert "T2/T1 is 30.8, usually 1.5 to 8" in told
    for name, value in changed.items():
        assert f"gear.{name} = {value:g} N*m" in told


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_both_torques_ten_times_off_contradict_the_rest(factor):
    told = doubt(shipped(T1=3.9 * factor, T2=12.0 * factor))
    assert told.startswith(f"gear.T1 = {3.9 * factor:g} N*m, gear.T2 = {12.0 * factor:g} N*m: T1/rated_torque is ")
    for what in ("T2/rated_torque", "T1/K1", "T2/K2"):
        assert f"; {what} is " in told
    assert "T2/T1" not in told
    assert "Zhang (11)" in told
