"""Generated kernels: an edit of an effect is noticed, the cache is the user's own, foreign names are refused."""

import importlib.util
import math
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model import compiler, stepper
from sim_backend.model.compiler import cache_folder, load
from sim_backend.model.constants import derive
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Enters
from sim_backend.model.kernel import kernel_source, plant_kernel
from sim_backend.model.parameters import PlantConfig
from sim_backend.model.source import function_source, operators_of
from tests.sim_backend.model.test_parameters import DRIVE

OUTSIDE = 2.0


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    return tmp_path / "cache" / "harmonic-rig" / "kernels"


def write_and_import(path: Path, factor: float) -> ModuleType:
    """A module as an editor leaves it: same name, other text."""
    path.write_text(
        f"def pull(motor_position, amplitude):\n    return {factor!r} * amplitude * (motor_position + 0.3)\n"
    )
    importlib.invalidate_caches()
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    return module


def effect_of(function) -> Effect:
    model = CATALOGUE["cogging"]
    return Effect(
        **{
            **{name: getattr(model, name) for name in model.__dataclass_fields__},
            "id": "pull",
            "parameters": model.parameters[:1],
            "function": function,
        }
    )


def motor_effect(module: ModuleType) -> float:
    kernel = plant_kernel([ActiveEffect(effect_of(module.pull), (0.5,))])
    state, inputs = np.zeros(kernel.state_size), np.zeros(stepper.INPUT_SIZE)
    kernel.bind(state, inputs, np.array(derive(PlantConfig(DRIVE)))).start(0)
    return float(state[stepper.MOTOR_EFFECTS])


def test_an_edited_effect_changes_the_kernel_and_the_old_text_brings_the_old_value_back(tmp_path, own_cache):
    path = tmp_path / "edited_effect.py"
    values = [motor_effect(write_and_import(path, factor)) for factor in (1.0, 100.0, 1.0)]
    assert values == pytest.approx([0.15, 15.0, 0.15])
    assert len(list(own_cache.glob("*.o"))) == 2


def test_parameter_values_do_not_make_another_kernel():
    assert kernel_source([CATALOGUE["cogging"]]) == kernel_source([CATALOGUE["cogging"]])
    one, two = (plant_kernel([ActiveEffect(CATALOGUE["cogging"], (a, 84.0, 0.0))]) for a in (1e-3, 2e-3))
    assert one.source == two.source


@pytest.mark.skipif(os.name != "posix", reason="file modes exist on POSIX only")
def test_the_cache_folder_is_closed_to_others(own_cache):
    assert cache_folder() == own_cache
    assert own_cache.stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(os.name != "posix", reason="file modes exist on POSIX only")
def test_code_is_not_run_from_a_folder_that_others_can_write(own_cache):
    own_cache.mkdir(parents=True)
    own_cache.chmod(0o777)
    with pytest.raises(ModelError, match="others own it or may write to it"):
        cache_folder()


def test_a_home_that_cannot_be_written_costs_only_the_cache(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    folder = cache_folder()
    assert folder.is_dir()
    folder.rmdir()


BODY = "@compiled\ndef twice(x):\n    return 2.0 * x\n\n@compiled\ndef value(x):\n    return twice(x) + 1.0"


def forget() -> None:
    """As in a new process: nothing of the generated modules is in memory."""
    for name in [name for name in sys.modules if name.startswith("harmonic_rig_")]:
        del sys.modules[name]


@pytest.fixture
def kept(own_cache) -> Path:
    """The cache folder with `BODY` in it, which is not in memory."""
    forget()
    assert load("kept", BODY).value(3.0) == 7.0
    forget()
    return own_cache


def test_a_tampered_kernel_file_is_written_anew(kept):
    (path,) = kept.glob("*.py")
    text = path.read_text()
    path.write_text("raise SystemExit('not this')")
    assert load("kept", BODY).value(3.0) == 7.0
    assert path.read_text() == text


@pytest.mark.parametrize(
    "content", [b"", b"garbage" * 20, b"\x80\x04K\x03.", None], ids=["empty", "garbage", "3", "half"]
)
@pytest.mark.parametrize("spoilt", ["*value*.nbc", "*.nbc", "*.nbi", "*"])
def test_what_numba_kept_and_cannot_read_is_discarded_and_compiled_anew(kept, spoilt, content):
    if spoilt == "*.nbc":
        next((kept / "__pycache__").glob("*value*.nbi")).unlink()  # so that the inner function is asked for
    files = list((kept / "__pycache__").glob(spoilt))
    assert files
    for file in files:
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2] if content is None else content)
    assert load("kept", BODY).value(3.0) == 7.0
    forget()
    assert load("kept", BODY).value(3.0) == 7.0


def test_an_error_of_the_code_itself_is_no_error_of_the_cache(kept):
    body = "@compiled\ndef check(x):\n    if x < 0.0:\n        raise ValueError('below zero')\n    return x"
    check = load("raising", body).check
    with pytest.raises(ValueError, match="below zero"):
        check(-1.0)
    assert check(1.0) == 1.0


@contextmanager
def full_disk():
    """No file can grow beyond 10 bytes."""
    import resource  # on POSIX only

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.skipif(os.name != "posix", reason="the limit on file sizes exists on POSIX only")
def test_a_full_disk_costs_only_the_cache(own_cache):
    forget()
    with full_disk():
        assert load("full", BODY).value(3.0) == 7.0
    assert not [file for file in own_cache.rglob("*") if file.is_file()]
    forget()
    load("full", BODY)
    forget()
    with full_disk():  # numba has the text, and no room for what it compiles
        assert load("full", BODY).value(3.0) == 7.0


def test_a_folder_that_exists_and_cannot_be_written_costs_only_the_cache(own_cache, monkeypatch):
    forget()
    cache_folder()

    def refuse(*_args: object, **_options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(compiler.tempfile, "mkstemp", refuse)
    assert load("closed", BODY).value(3.0) == 7.0
    assert not list(own_cache.iterdir())


def test_a_folder_in_place_of_a_kernel_file_costs_only_the_cache(kept):
    (path,) = kept.glob("*.py")
    path.unlink()
    path.mkdir()
    assert load("kept", BODY).value(3.0) == 7.0
    assert not list(kept.glob("*.tmp"))


@pytest.mark.skipif(os.name != "posix", reason="file modes exist on POSIX only")
@pytest.mark.parametrize("pattern", ["*.py", "__pycache__/*.nbc", "__pycache__/*.nbi", "__pycache__"])
def test_a_file_that_others_can_write_is_not_used(kept, pattern):
    for file in kept.glob(pattern):
        file.chmod(0o777 if file.is_dir() else 0o666)
    assert load("kept", BODY).value(3.0) == 7.0
    if pattern != "__pycache__":  # a folder is left alone, and nothing is read from it
        assert all(file.stat().st_mode & 0o022 == 0 for file in kept.glob(pattern))


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root can give a file away")
@pytest.mark.parametrize("pattern", ["*.py", "__pycache__/*.nbc"])
def test_a_file_of_another_user_is_not_used(kept, pattern):
    for file in kept.glob(pattern):
        os.chown(file, 12345, 12345)
    assert load("kept", BODY).value(3.0) == 7.0
    assert all(file.stat().st_uid == 0 for file in kept.glob(pattern))


def test_without_numba_the_same_source_runs_as_plain_python(monkeypatch):
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    module = load("plain", "@compiled\ndef value(x):\n    return math.sin(x)")
    assert module.value(0.5) == math.sin(0.5)
    assert not hasattr(module.value, "py_func")


def uses_a_module_constant(motor_position, amplitude):
    return OUTSIDE * amplitude * motor_position


def test_a_function_that_needs_more_than_its_arguments_is_refused_by_name():
    with pytest.raises(ModelError, match=r"uses_a_module_constant\(\) cannot be compiled: it uses OUTSIDE"):
        function_source(uses_a_module_constant, "value")


def test_operators_come_along_once_however_many_effects_call_them():
    effects = [CATALOGUE[name].function for name in ("creep", "rate-dependent-hysteresis", "maxwell-slip", "cogging")]
    text = operators_of(effects)
    assert (text.count("def lag("), text.count("def play(")) == (1, 1)
    assert operators_of([CATALOGUE["cogging"].function]) == ""


def lag(signal):
    return 0.5 * signal


def calls_another_lag(motor_position, amplitude):
    return amplitude * lag(motor_position)


def test_a_function_of_its_own_with_an_operators_name_is_refused():
    with pytest.raises(ModelError, match=r"calls_another_lag\(\) cannot be compiled: it uses lag"):
        function_source(calls_another_lag, "value")


def test_a_function_without_source_is_refused():
    with pytest.raises(ModelError, match="source cannot be read"):
        function_source(math.sin, "value")
    with pytest.raises(ModelError, match="written with def"):
        function_source(lambda motor_position, amplitude: amplitude, "value")


def test_an_effect_on_a_signal_that_the_plant_does_not_have_is_refused():
    def pull(supply_voltage, amplitude):
        return amplitude * supply_voltage

    with pytest.raises(ModelError, match="pull takes supply_voltage, which the plant does not have"):
        kernel_source([effect_of(pull)])


def test_an_effect_on_a_reading_that_the_plant_has_not_is_refused():
    cogging = CATALOGUE["cogging"]
    fields = {name: getattr(cogging, name) for name in cogging.__dataclass_fields__}
    with pytest.raises(ModelError, match=r"cogging changes the reading of nothing; .* motor_position, motor_torque"):
        kernel_source([Effect(**{**fields, "enters": Enters.READING})])
    with pytest.raises(ModelError, match="cogging changes the reading of temperature"):
        kernel_source([Effect(**{**fields, "enters": Enters.READING, "reads": "temperature"})])


def test_a_base_term_is_not_an_active_effect():
    cogging = CATALOGUE["cogging"]
    fields = {name: getattr(cogging, name) for name in cogging.__dataclass_fields__}
    with pytest.raises(ModelError, match="cogging is a term of the base model: the plant has it always"):
        kernel_source([Effect(**{**fields, "enters": Enters.BASE})])


def test_friction_does_not_know_the_torsion_that_it_holds():
    def pull(flexspline_torsion, amplitude):
        return amplitude * flexspline_torsion

    effect = effect_of(pull)
    fields = {name: getattr(effect, name) for name in effect.__dataclass_fields__}
    with pytest.raises(ModelError, match=r"pull takes flexspline_torsion, which .* enters the friction"):
        kernel_source([Effect(**{**fields, "enters": Enters.FRICTION})])


def test_the_generated_source_contains_every_active_effect_once():
    effects = [effect for effect in CATALOGUE.values() if effect.enters is not Enters.BASE]
    source = kernel_source(effects)
    for number in range(len(effects)):
        assert source.count(f"def effect_{number}(") == 1
    count = sum(len(effect.parameters) for effect in effects)
    assert np.all([f"effect_parameters[{k}]" in source for k in range(count)])
