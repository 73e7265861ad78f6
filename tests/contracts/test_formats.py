"""Every exporter, every reader of foreign files: a run survives the round trip, equal to the bit."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from scipy.io import savemat

from drivers.errors import ConfigError
from drivers.signals import BY_NAME, INTEGER_SIGNALS
from rig.log.export import EXPORTERS, ExportKind, export_run
from rig.log.foreign import READERS
from rig.log.importer import import_files
from rig.log.load import load_run
from rig.log.run import Floats, Run
from tests.rig.log.samples import EPOCH_NS, write_log


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Give a run as read from its MCAP log, with missing samples, an auxiliary signal and events."""
    path = tmp_path_factory.mktemp("log") / "round.mcap"
    write_log(path, 400)
    return load_run(path)


def read_back(path: Path) -> dict[str, Floats]:
    """Give the columns of an exported file by signal name, read by someone else's library where there is one."""
    if path.suffix == ".h5":
        with xarray.open_dataset(path, engine="h5netcdf") as data:
            names = [str(name) for name in data.variables if not str(name).startswith("event_")]
            return {name.removeprefix("aux_"): data[name].to_numpy().astype(np.float64) for name in names}
    if path.suffix == ".parquet":
        from pyarrow import parquet

        table = parquet.read_table(path)
        return {name.split("[")[0]: table.column(name).to_numpy() for name in table.column_names}
    again = load_run(path)
    return {"time": again.time, **again.signals, **again.auxiliary}


@pytest.mark.parametrize("kind", list(ExportKind))
def test_a_run_survives_its_export_to_the_bit(run: Run, kind: ExportKind, tmp_path: Path) -> None:
    if kind is ExportKind.PARQUET:
        pytest.importorskip("pyarrow", reason="Parquet needs the extra")
    columns = read_back(export_run(run, kind, tmp_path / "out"))
    expected = {"time": run.time, **run.signals, **run.auxiliary}
    assert set(columns) == set(expected)
    for name, column in expected.items():
        assert np.array_equal(columns[name], column, equal_nan=True), name


@pytest.mark.parametrize("kind", list(ExportKind))
def test_an_export_is_never_overwritten(run: Run, kind: ExportKind, tmp_path: Path) -> None:
    if kind is ExportKind.PARQUET:
        pytest.importorskip("pyarrow", reason="Parquet needs the extra")
    path = export_run(run, kind, tmp_path)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="never overwritten"):
        export_run(run, kind, tmp_path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("kind", list(ExportKind))
def test_a_run_without_samples_can_be_exported(kind: ExportKind, tmp_path: Path) -> None:
    if kind is ExportKind.PARQUET:
        pytest.importorskip("pyarrow", reason="Parquet needs the extra")
    write_log(tmp_path / "none.mcap", 0)
    path = export_run(load_run(tmp_path / "none.mcap"), kind, tmp_path / "out")
    assert path.stat().st_size > 0


def test_every_export_kind_has_an_exporter() -> None:
    assert set(EXPORTERS) == set(ExportKind)


def test_csv_keeps_the_facts_of_the_run_in_its_sidecar(run: Run, tmp_path: Path) -> None:
    again = load_run(export_run(run, ExportKind.CSV, tmp_path))
    assert (again.procedure, again.replicate, again.start_angle) == (run.procedure, run.replicate, run.start_angle)
    assert again.metadata["operator"] == "Ada"
    assert again.metadata["outcome.result"] == "done"
    assert again.auxiliary_units == run.auxiliary_units


def test_hdf5_is_netcdf_with_units_meanings_facts_and_events(run: Run, tmp_path: Path) -> None:
    path = export_run(run, ExportKind.HDF5, tmp_path)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        for name in run.signals:
            assert data[name].attrs["units"] == BY_NAME[name].unit
            assert data[name].attrs["long_name"] == BY_NAME[name].meaning
            assert data[name].dims == ("time",)
        assert data["time"].attrs["units"] == "s"
        assert data["aux_strain"].attrs["units"] == "mV/V"
        assert data.attrs["operator"] == "Ada"
        assert data.attrs["Conventions"] == "CF-1.8"
        assert data.attrs["dut_toml"] == run.dut_text
        assert data.attrs["start_time_ns"] == EPOCH_NS
        assert data.attrs["start_time"].startswith("2023-11-14T22:13:20.123456")
        assert json.loads(data.attrs["run_metadata"])["run_id"] == "r1"
        assert [text.decode() for text in data["event_text"].to_numpy()][:2] == ["dwell", "sweep"]


def test_hdf5_uses_nothing_that_needs_a_plug_in(run: Run, tmp_path: Path) -> None:
    with h5py.File(export_run(run, ExportKind.HDF5, tmp_path)) as file:
        for name in run.signals:
            dataset = file[name]
            assert dataset.ndim == 1
            assert dataset.compression == "gzip"
            assert dataset.shuffle
            missing = bool(np.isnan(run.signals[name]).any())
            assert dataset.dtype == (np.int64 if name in INTEGER_SIGNALS and not missing else np.float64)


def test_a_config_text_longer_than_an_hdf5_attribute_is_kept_whole(tmp_path: Path, run: Run) -> None:
    text = "µ" * 40_000
    long = Run(run.name, run.file, run.procedure, run.time, run.signals, auxiliary=run.auxiliary, dut_text=text)
    with h5py.File(export_run(long, ExportKind.HDF5, tmp_path)) as file:
        parts = [file.attrs[name] for name in ("dut_toml", "dut_toml_2", "dut_toml_3")]
    assert "".join(part.decode() if isinstance(part, bytes) else part for part in parts) == text


def write_foreign(path: Path, time: Floats, torque: Floats) -> None:
    match path.suffix:
        case ".csv" | ".txt":
            rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(time.tolist(), torque.tolist(), strict=True))
            path.write_text("t,tau\n" + rows)
        case ".tsv":
            rows = "".join(f"{a!r}\t{b!r}\n" for a, b in zip(time.tolist(), torque.tolist(), strict=True))
            path.write_text("t\ttau\n" + rows)
        case ".h5" | ".hdf5" | ".nc":
            with h5py.File(path, "w") as file:
                file["t"], file["tau"] = time, torque
        case ".mat":
            savemat(path, {"t": time, "tau": torque})
        case ".parquet":
            pyarrow = pytest.importorskip("pyarrow", reason="Parquet needs the extra")
            from pyarrow import parquet

            parquet.write_table(pyarrow.table({"t": time, "tau": torque}), path)
        case other:
            pytest.fail(f"no test file for the suffix {other}")


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_every_foreign_format_comes_in_to_the_bit(suffix: str, tmp_path: Path) -> None:
    time, torque = np.arange(50) / 500, np.random.default_rng(3).normal(size=50)
    write_foreign(tmp_path / f"f{suffix}", time, torque)
    (tmp_path / "map.toml").write_text(
        '[signals.time]\ncolumn = "t"\n[signals.output_torque]\ncolumn = "tau"\n[run]\nprocedure = "backdrive"\n'
    )
    (path,) = import_files([tmp_path / f"f{suffix}"], tmp_path / "map.toml", tmp_path / "out")
    run = load_run(path)
    assert np.array_equal(run.time, time)
    assert np.array_equal(run.signals["output_torque"], torque)


@pytest.mark.parametrize("suffix", sorted(set(READERS) - {".csv", ".txt", ".tsv"}))
def test_a_missing_number_in_a_mapped_column_is_named_in_every_format(suffix: str, tmp_path: Path) -> None:
    torque = np.array([1.0, np.nan, 2.0])
    write_foreign(tmp_path / f"f{suffix}", np.arange(3.0), torque)
    (tmp_path / "map.toml").write_text('[signals.time]\ncolumn = "t"\n[signals.output_torque]\ncolumn = "tau"\n')
    with pytest.raises(ValueError, match=r"column 'tau', row 2: the value is not a finite number"):
        import_files([tmp_path / f"f{suffix}"], tmp_path / "map.toml", tmp_path / "out")
