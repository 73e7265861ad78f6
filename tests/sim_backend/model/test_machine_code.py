"""Machine code that is kept: it does what the source says, starts without the compiler, and is made anew if damaged."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model import compiler, machine_code
from sim_backend.model.machine_code import bind
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from tests.sim_backend.model.test_compiler import full_disk
from tests.sim_backend.model.test_parameters import DRIVE

BODY = """
@compiled
def growth(x, rate):
    return math.exp(rate) * math.tan(x) % 3.0

@compiled
def grow(count, values, rates):
    for _ in range(count):
        for k in range(len(values)):
            values[k] = growth(values[k], rates[0])

@compiled
def clear(values, rates):
    part = values[1:3]
    part[:] = 0.0
"""
CALLS = (("grow", "grow(count, *arrays)"), ("clear", "clear(*arrays)"))
RAISES = """
@compiled
def check(values):
    if values[0] < 0.0:
        raise ValueError("below zero")
    values[0] += 1.0
"""


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    machine_code._machine_code.cache_clear()
    return tmp_path / "cache" / "harmonic-rig" / "kernels"


def grown(*, compiled: bool = True) -> list[float]:
    values = np.linspace(-1.2, 1.3, 5)
    functions = bind("growth", BODY, CALLS, (values, np.array([0.1])), compiled=compiled)
    functions["grow"](7)
    functions["clear"](0)
    return values.tolist()


def in_another_process(code: str) -> str:
    finished = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert finished.stderr == ""
    return finished.stdout


def test_machine_code_gives_the_bits_of_the_plain_source():
    assert grown() == grown(compiled=False)
    assert any(grown())


def test_one_closed_file_is_kept_and_used_again(own_cache):
    first = grown()
    (file,) = own_cache.iterdir()
    assert own_cache.stat().st_mode & 0o077 == 0
    assert file.stat().st_mode & 0o077 == 0
    before = file.stat()
    machine_code._machine_code.cache_clear()
    assert grown() == first
    assert file.stat() == before


@pytest.mark.parametrize("damage", [b"", b"not what was written", None])
def test_a_damaged_file_is_made_anew(own_cache, damage):
    first = grown()
    (file,) = own_cache.iterdir()
    written = file.read_bytes()
    file.write_bytes(written[:-100] if damage is None else damage)
    machine_code._machine_code.cache_clear()
    assert grown() == first
    assert machine_code._unsealed(file.read_bytes()) is not None


def test_a_folder_in_place_of_the_file_costs_only_the_cache(own_cache):
    first = grown()
    (file,) = own_cache.iterdir()
    file.unlink()
    file.mkdir()
    machine_code._machine_code.cache_clear()
    assert grown() == first
    assert list(own_cache.iterdir()) == [file]


@pytest.mark.skipif(os.name != "posix", reason="the limit on file sizes exists on POSIX only")
def test_a_full_disk_costs_only_the_cache_and_leaves_no_half_file(own_cache):
    with full_disk():
        assert any(grown())
    assert not list(own_cache.iterdir())


def test_a_folder_that_exists_and_cannot_be_written_costs_only_the_cache(own_cache, monkeypatch):
    own_cache.mkdir(parents=True, mode=0o700)

    def refuse(*_args: object, **_options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(compiler.tempfile, "mkstemp", refuse)
    assert any(grown())
    assert not list(own_cache.iterdir())


def spoil_mode(file: Path) -> None:
    file.chmod(0o666)


def spoil_link(file: Path) -> None:
    target = file.with_suffix(".elsewhere")
    file.rename(target)
    file.symlink_to(target)


def spoil_owner(file: Path) -> None:
    if not hasattr(os, "getuid") or os.getuid() != 0:
        pytest.skip("only root can give a file away")
    os.chown(file, 12345, 12345)


@pytest.mark.skipif(os.name != "posix", reason="file modes exist on POSIX only")
@pytest.mark.parametrize("spoil", [spoil_mode, spoil_link, spoil_owner])
def test_a_file_that_is_not_the_users_own_is_not_run_but_made_anew(own_cache, spoil):
    first = grown()
    (file,) = own_cache.iterdir()
    spoil(file)
    spoilt = file.lstat()
    machine_code._machine_code.cache_clear()
    assert grown() == first
    now = file.lstat()
    assert now.st_ino != spoilt.st_ino
    assert (now.st_uid, now.st_mode & 0o7777, file.is_symlink()) == (os.getuid(), 0o600, False)


def test_the_plant_starts_in_a_new_process_without_the_compiler():
    Plant(PlantConfig(DRIVE))
    code = """
import sys
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from tests.sim_backend.model.test_parameters import DRIVE
Plant(PlantConfig(DRIVE)).advance_to(1e-3)
print(sorted({"numba", "scipy"} & set(sys.modules)))
"""
    assert in_another_process(code) == "[]\n"


def test_code_that_raises_is_left_to_numba_and_raises(own_cache):
    values = np.array([0.5])
    check = bind("raising", RAISES, (("check", "check(*arrays)"),), (values,))["check"]
    check(0)
    assert values[0] == 1.5
    values[0] = -1.0
    with pytest.raises(ValueError, match="below zero"):
        check(0)
    assert not list(own_cache.glob("*.o"))


@pytest.mark.parametrize("values", [np.zeros(5, dtype=np.float32), np.zeros((5, 1)), np.zeros(10)[::2]])
def test_an_array_that_is_not_what_the_code_expects_is_refused(values):
    with pytest.raises(ModelError, match=r"array 0 has the shape .*; it must be \(n,\) of float64"):
        bind("growth", BODY, CALLS, (values, np.array([0.1])))


def test_the_functions_keep_their_arrays_alive():
    values = np.ones(5)
    grow = bind("growth", BODY, CALLS, (values, np.array([0.1])))["grow"]
    with pytest.raises(ValueError, match="cannot resize"):
        values.resize(50_000)
    grow(1)
