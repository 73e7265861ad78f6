"""Device descriptions: what the file says, the driver holds and the device is must agree before anything moves."""

from dataclasses import replace
from pathlib import Path

import pytest

from drivers.canopen import objects
from drivers.canopen.eds import load_description
from drivers.devices import DeviceConfig
from drivers.errors import ConfigError
from sim_backend.nodes.eds import eds_text
from tests.drivers.canopen.bench import ENCODER, LOAD, MOTOR, TORQUE, SimulatedBench, simulated_bench

KEY = "devices.motor.options.eds"
ALL = (MOTOR, LOAD, ENCODER, TORQUE)


def shipped(config: DeviceConfig) -> str:
    return eds_text(simulated_bench().node(config.address))


def bench_with(folder: Path, config: DeviceConfig, text: str | bytes) -> SimulatedBench:
    file = folder / f"{config.name}.eds"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return simulated_bench(replace(config, options={"eds": str(file)}))


@pytest.mark.parametrize("config", ALL, ids=lambda config: config.name)
def test_every_simulated_device_agrees_with_its_own_file(tmp_path: Path, config: DeviceConfig) -> None:
    bench = bench_with(tmp_path, config, shipped(config))
    info = bench.devices[config.name].connect()
    assert ("description", f"{config.name}.eds") in info.identity


@pytest.mark.parametrize("config", ALL, ids=lambda config: config.name)
def test_the_file_of_a_simulated_device_lists_what_the_device_serves(tmp_path: Path, config: DeviceConfig) -> None:
    file = tmp_path / "device.eds"
    file.write_text(shipped(config))
    described = load_description(file, config.address, KEY)
    served = {(spec.index, spec.sub) for spec in simulated_bench().node(config.address).dictionary}
    assert set(described.codes) == served


def test_an_object_of_another_type_than_the_driver_takes_it_for_is_refused(tmp_path: Path) -> None:
    unsigned = shipped(MOTOR).replace(
        "ParameterName=Torque actual value (per mille)\nDataType=0x0003",
        "ParameterName=Torque actual value (per mille)\nDataType=0x0006",
    )
    assert unsigned != shipped(MOTOR)
    bench = bench_with(tmp_path, MOTOR, unsigned)
    with pytest.raises(ConfigError, match=r"0x6077:00.* as UNSIGNED16, the driver takes it for INTEGER16"):
        bench.motor.connect()


def test_a_drive_whose_file_lacks_an_object_that_is_needed_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "motor.eds"
    file.write_text(shipped(MOTOR))
    described = load_description(file, 1, KEY)
    assert described.disagreement(objects.TORQUE) == ""
    without = replace(described, codes={k: v for k, v in described.codes.items() if k != (0x6077, 0)})
    assert "has no object 0x6077:00" in without.disagreement(objects.TORQUE)


def test_another_product_than_the_file_describes_is_refused(tmp_path: Path) -> None:
    bench = bench_with(tmp_path, MOTOR, shipped(MOTOR).replace("ProductNumber=0x00000402", "ProductNumber=0x00000403"))
    with pytest.raises(ConfigError, match=r"describes product 0x00000403, but node 1 .* is 0x00000402"):
        bench.motor.connect()


def test_a_file_in_an_old_code_page_is_read(tmp_path: Path) -> None:
    text = shipped(ENCODER).replace("VendorName=simulated", "VendorName=Müller").encode("cp1252")
    assert bench_with(tmp_path, ENCODER, text).encoder.connect().identity


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "describes no object|is no EDS"),
        (b"nonsense without a section", "is no EDS that can be read"),
        (bytes(range(256)) * 40, "is no EDS that can be read"),
        (b"[OptionalObjects]\nSupportedObjects=1\n1=0x6040\n", "describes no object|is no EDS"),
    ],
)
def test_a_file_that_is_none_is_refused_before_anything_is_sent(tmp_path: Path, content: bytes, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        bench_with(tmp_path, MOTOR, content)
    assert caught.value.mistakes[0].path == KEY


def test_a_missing_file_and_a_wrong_suffix_are_named_with_their_key(tmp_path: Path) -> None:
    for name, words in (("none.eds", "No such file"), ("drive.txt", "ending in .eds or .dcf")):
        with pytest.raises(ConfigError, match=words) as caught:
            simulated_bench(replace(MOTOR, options={"eds": str(tmp_path / name)}))
        assert caught.value.mistakes[0].path == KEY
