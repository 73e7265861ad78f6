"""A writer that is killed loses at most the last 100 ms of samples."""

import random
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from rig.log.mcap_reader import read_mcap
from rig.log.recover import recover

ROOT = Path(__file__).parents[3]
WRITER = """
import mmap, struct, sys
from pathlib import Path
from drivers.types import Sample
from rig.log.writer import LogWriter

shared = open(sys.argv[2], "r+b")
counter = mmap.mmap(shared.fileno(), 8)
writer = LogWriter(Path(sys.argv[1]), {"procedure": "free-run"}, attachments={}, cycle_rate=1000.0, epoch_ns=10**18)
for index in range(10**7):
    writer.write(Sample(time=index * 1e-3, cycle=index, motor_position=index * 1.5, output_torque=0.1 * index))
    counter[:8] = struct.pack("<q", index)
"""


@pytest.mark.parametrize("seed", range(6))
def test_a_killed_writer_loses_at_most_100_ms(tmp_path: Path, seed: int) -> None:
    log, shared = tmp_path / "a.mcap", tmp_path / "counter"
    shared.write_bytes(struct.pack("<q", -1))
    wait_for = random.Random(seed).randrange(100, 20_000)
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(log), str(shared)], cwd=ROOT)
    try:
        with shared.open("rb", buffering=0) as counter:
            written = -1
            while written < wait_for and process.poll() is None:
                counter.seek(0)
                (written,) = struct.unpack("<q", counter.read(8))
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert process.returncode == -signal.SIGKILL
    (written,) = struct.unpack("<q", shared.read_bytes())

    run = read_mcap(log)
    assert not run.complete
    assert run.warnings
    # `written` samples were handed over at 1 kHz; the one being written may or may not be there
    assert written - 100 <= len(run.time) <= written + 2
    assert list(run.signals["cycle"]) == list(range(len(run.time)))
    assert run.signals["motor_position"][-1] == 1.5 * (len(run.time) - 1)

    report = recover(log)
    assert report.samples == len(run.time)
    assert len(read_mcap(report.file).time) == len(run.time)
