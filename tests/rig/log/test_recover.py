"""Recovering cut logs into files that every reader opens."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from drivers.errors import ConfigError, DataError
from rig.log.mcap_reader import read_mcap
from rig.log.recover import recover
from tests.rig.log.samples import DUT, write_log


@pytest.fixture
def cut(tmp_path: Path) -> Path:
    """Give a log of which the end is missing, as a killed process leaves it."""
    write_log(tmp_path / "run.mcap", 300)
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    return tmp_path / "run.mcap"


def test_a_recovered_log_has_every_readable_sample_event_and_attachment(cut: Path) -> None:
    before = read_mcap(cut)
    report = recover(cut)
    after = read_mcap(report.file)
    assert report.file == cut.with_name("run-recovered.mcap")
    assert report.samples == len(before.time) == len(after.time) > 100
    assert report.messages == 3
    assert report.seconds == before.time[-1]
    assert not report.intact
    for name, column in before.signals.items():
        assert np.array_equal(column, after.signals[name], equal_nan=True)
    assert [event.text for event in after.events] == [event.text for event in before.events]
    assert after.dut_text == DUT.decode()
    assert after.metadata["operator"] == "Ada"


def test_a_recovered_log_still_says_that_its_end_is_missing(cut: Path) -> None:
    after = read_mcap(recover(cut).file)
    assert not after.complete
    assert any("recovered from run.mcap" in note for note in after.warnings)


def test_a_recovered_log_opens_in_an_indexed_reader(cut: Path) -> None:
    report = recover(cut)
    with report.file.open("rb") as handle:
        summary = make_reader(handle, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == report.samples + report.messages


def test_a_log_that_only_lost_its_index_is_complete_again(tmp_path: Path) -> None:
    write_log(tmp_path / "run.mcap", 300)
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").write_bytes(whole[:-20])
    after = read_mcap(recover(tmp_path / "run.mcap").file)
    assert len(after.time) == 300
    assert after.complete
    assert after.metadata["outcome.result"] == "done"


def test_an_intact_log_is_reported_as_intact(tmp_path: Path) -> None:
    write_log(tmp_path / "run.mcap", 30)
    report = recover(tmp_path / "run.mcap", tmp_path / "copy.mcap")
    assert report.intact
    assert read_mcap(report.file).complete


def test_the_target_is_never_overwritten(cut: Path) -> None:
    recover(cut)
    with pytest.raises(ConfigError, match=r"run-recovered\.mcap"):
        recover(cut)


def test_a_file_that_is_no_mcap_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_text("hello, this is text")
    with pytest.raises(DataError, match="no MCAP file"):
        recover(tmp_path / "x.mcap")
    assert not (tmp_path / "x-recovered.mcap").exists()
