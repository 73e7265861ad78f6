import math

import pytest

from drivers.errors import ConfigError, Mistake
from drivers.signals import BY_NAME
from rig.config.bench import ROLES, SIGNED_SIGNALS, BenchFile, Reaction, frame_bits, load_bench, naming_the_bench
from rig.config.toml_file import parse_toml

SIM = load_bench("sim")[1]


def broken(*changes: tuple[str, str]) -> ConfigError:
    text = SIM
    for old, new in changes:
        assert old in text, f"{old!r} is not in the shipped bench file"
        text = text.replace(old, new)
    with pytest.raises(ConfigError) as caught:
        parse_toml(text, BenchFile, "bench.toml")
    return caught.value


def paths(error: ConfigError) -> list[str]:
    return [mistake.path for mistake in error.mistakes]


def test_shipped_bench_is_valid_and_complete():
    bench, _ = load_bench("sim")
    assert set(bench.devices) == set(ROLES)
    assert bench.simulated
    assert bench.safety.reaction is Reaction.RAMP


def test_an_undeclared_bound_is_infinite_and_a_declared_one_is_kept():
    limits = load_bench("sim")[0].limits.frozen()
    assert limits.motor_travel == math.inf
    assert limits.motor_torque == 0.25


def test_every_mistake_is_reported_at_once_with_its_path():
    error = broken(
        ("motor_torque = 0.25", "motor_torque = -0.25"),
        ("[safety]", "[safty]"),
        ("cia406", "cia999"),
        ('reaction = "ramp"', 'reaction = "hope"'),
    )
    text = str(error)
    for path in ("limits.motor_torque", "safty", "output_encoder.driver"):
        assert path in text
    assert error.exit_code == 2
    assert len(error.mistakes) >= 3


@pytest.mark.parametrize(
    ("old", "new", "path"),
    [
        ("cycle_rate = 1000", "cycle_rate = 0", "cycle_rate"),
        ("cycle_rate = 1000", 'cycle_rate = "fast"', "cycle_rate"),
        ("node = 1\n", "node = 128\n", "devices.motor.node"),
        ("output_torque = 30.0", "output_torque = nan", "limits.output_torque"),
        ("late_cycles = 0", "late_cycles = 0.5", "limits.late_cycles"),
        ('lock = "simulated"', 'lock = "glue"', "fixture.lock"),
    ],
)
def test_a_value_out_of_range_is_named_by_its_path(old, new, path):
    assert path in str(broken((old, new)))


def test_a_limit_out_of_range_is_told_its_range_and_unit():
    (mistake,) = broken(("motor_torque = 0.25", "motor_torque = -0.25")).mistakes
    assert mistake.rule == "must be above 0 and at most 1e+09 N*m; the check in every cycle needs it"
    (mistake,) = broken(("cycle_rate = 1000", "cycle_rate = 5000")).mistakes
    assert mistake.rule.startswith("must be at least 10 and at most 2000 Hz")


def test_two_devices_with_one_node_id_are_refused():
    assert "share a node id" in str(broken(("node = 2\n", "node = 1\n")))


def test_a_missing_motor_is_refused():
    assert "devices.motor" in paths(broken(("[devices.motor]", "[devices.output_encoder2]")))


def test_a_bus_that_cannot_carry_the_cycle_is_refused_with_its_load():
    error = broken(('channel = "bench"', 'channel = "bench"\nbitrate = 500000'))
    assert "load 149%" in str(error)
    assert "limit 80%" in str(error)


def test_bus_load_of_the_three_device_bus_counts_every_bit():
    # SYNC 55, two drives of 115 + 135, encoder 95, torque sensor 95: 745 bits of 1000 at 1 kHz and 1 Mbit/s
    assert load_bench("sim")[0].bus_loads() == {("simulated", "bench"): pytest.approx(0.745)}


@pytest.mark.parametrize(("size", "bits"), [(0, 55), (8, 135)])
def test_worst_case_frame_lengths_are_those_of_the_can_standard(size, bits):
    assert frame_bits(size) == bits


def test_udp_multicast_is_refused_by_name():
    assert "udp_multicast" in str(broken(('interface = "simulated"', 'interface = "udp_multicast"')))


def test_simulated_and_real_devices_are_not_mixed_silently():
    error = broken(
        ("[devices.motor]                   # the motor under test, on the wave generator\n", "[devices.motor]\n"),
        ('interface = "simulated"\nchannel = "bench"\nnode = 1', 'interface = "slcan"\nchannel = "p"\nnode = 1'),
    )
    assert "mixed" in str(error)


def test_signed_channels_are_signals_of_the_table():
    assert {name for names in SIGNED_SIGNALS.values() for name in names} <= set(BY_NAME)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"a = [", b"[" * 100_000, b"x" * 2_000_000])
def test_a_file_that_is_no_toml_is_a_config_error(tmp_path, content):
    path = tmp_path / "bench.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load_bench(str(path))
    assert str(path) in str(caught.value)


def test_a_missing_file_is_a_config_error(tmp_path):
    with pytest.raises(ConfigError):
        load_bench(str(tmp_path / "none.toml"))


def test_roles_drivers_and_buses_are_checked_where_other_values_are_wrong():
    error = broken(
        ("[limits]", '[devices.foo]\ndriver = "zzz"\ninterface = "simulated"\nchannel = "bench"\nnode = 2\n[limits]'),
        ("node = 1\n", "node = 300\n"),
        ("heartbeat_time = 0.2", "heartbeat_time = 0.005"),
        ("load_torque = ", "load_torqe = "),
    )
    assert {
        "devices.motor.node",
        "devices.foo",
        "devices.foo.driver",
        "devices.foo.node",
        "safety.heartbeat_time",
        "limits.load_torqe",
        "limits.load_torque",
    } == set(paths(error))
    assert len(error.mistakes) == len(set(paths(error)))


def test_the_output_encoder_turns_no_faster_than_the_load_drive_or_without_one_than_the_motor():
    bench = load_bench("sim")[0]
    alone = bench.model_copy(update={"devices": {r: d for r, d in bench.devices.items() if r != "load"}})
    fastest = [{c.name: c.max_velocity for c in b.device_configs()}["output_encoder"] for b in (bench, alone)]
    assert fastest == [10.0, 220.0]


@pytest.mark.parametrize("limit", ["load_torque = 30.0", "load_velocity = 10.0"])
def test_a_load_drive_needs_limits_of_torque_and_speed(limit):
    error = broken((limit, ""))
    assert paths(error) == [f"limits.{limit.split()[0]}"]
    assert "a bench with a load drive bounds its" in str(error)


def test_the_load_of_a_bus_is_checked_where_a_limit_is_wrong():
    error = broken(("motor_torque = 0.25", "motor_torque = -1"), ("cycle_rate = 1000", "cycle_rate = 2000"))
    assert paths(error) == ["limits.motor_torque", "cycle_rate"]


@pytest.mark.parametrize("value", ["nan", "[1]", "{ a = 1 }", "1979-05-27"])
def test_a_wrong_option_is_one_mistake(value):
    error = broken(("[devices.motor]", f"[devices.motor]\noptions.max_torque = {value}"))
    assert paths(error) == ["devices.motor.options.max_torque"]


def test_an_unknown_key_is_answered_with_the_one_that_was_meant():
    assert "did you mean cycle_rate?" in str(broken(("cycle_rate", "cyclerate")))
    assert "did you mean output_torque?" in str(broken(("output_torque = 30", "output_torqe = 30")))
    assert "did you mean torque_sensor?" in str(broken(("[devices.torque_sensor]", "[devices.torque]")))


def test_the_node_id_of_the_bench_itself_is_refused_under_the_files_key():
    error = broken(("node = 1\n", "node = 127\n"))
    assert paths(error) == ["devices.motor.node"]
    assert "master_id" in str(error)


@pytest.mark.parametrize(
    ("text", "path", "words"),
    [
        ('name = "x"\nname = "y"\n', "line 2", "key 'name' is there twice"),
        ("[limits]\n\n[limits]\n", "line 3", "table 'limits' is there twice"),
        ('name = "x"\ncycle_rate = \n', "line 2", "Invalid value"),
        ('name = "x', "line 1", "no TOML"),
    ],
)
def test_a_text_that_is_no_toml_is_named_by_its_line(text, path, words):
    with pytest.raises(ConfigError) as caught:
        parse_toml(text, BenchFile, "bench.toml")
    (mistake,) = caught.value.mistakes
    assert mistake.path == path
    assert mistake.value == text.splitlines()[int(path.split()[1]) - 1].strip()
    assert words in mistake.rule


def test_no_bench_and_a_folder_for_a_bench_are_named_as_such(tmp_path):
    with pytest.raises(ConfigError, match="--bench"):
        load_bench("")
    with pytest.raises(ConfigError, match="directory") as caught:
        load_bench(str(tmp_path))
    assert caught.value.mistakes[0].value == str(tmp_path)


def test_what_a_driver_finds_in_the_bench_is_told_of_the_file_and_its_keys():
    found = ConfigError("bench", [Mistake("devices.load.address", 127, "rule"), Mistake("devices.load.sign", 2, "r")])
    with pytest.raises(ConfigError) as caught, naming_the_bench("my.toml"):
        raise found
    assert caught.value.source == "my.toml"
    assert paths(caught.value) == ["devices.load.node", "devices.load.sign"]
    with pytest.raises(ConfigError) as caught, naming_the_bench("my.toml"):
        raise ConfigError("device 'motor'", [Mistake("options.max_torque", 1e9, "rule")])
    assert paths(caught.value) == ["devices.motor.options.max_torque"]
