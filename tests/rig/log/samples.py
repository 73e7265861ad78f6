"""Logs for the tests: a short run with every kind of signal, written through the public writer."""

import math
import random
from collections.abc import Iterator
from pathlib import Path

from drivers.types import DeviceEvent, Sample
from rig.log.run import RunEvent
from rig.log.writer import LogWriter

EPOCH_NS = 1_700_000_000_123_456_789
DUT = b'name = "\xc2\xb5-drive"\n'
INFO = {
    "run_id": "r1",
    "procedure": "locked-output",
    "replicate": "A",
    "start_angle": "0.25",
    "operator": "Ada",
    "epoch_ns": "0",
}


def samples(count: int, *, seed: int = 1) -> Iterator[Sample]:
    """Give samples at 1 kHz; the load torque comes every third cycle only, the auxiliary signal from cycle 10 on."""
    dice = random.Random(seed)
    for index in range(count):
        yield Sample(
            time=index / 1000,
            cycle=index,
            late=int(index % 50 == 7),
            motor_position=math.sin(index * 1e-2) / 3,
            motor_velocity=dice.gauss(0.0, 1.0),
            motor_torque=dice.gauss(0.0, 0.1),
            motor_torque_command=0.1,
            motor_current=dice.gauss(0.0, 1.0),
            output_position=dice.gauss(0.0, 1e-3),
            output_torque=dice.gauss(0.0, 10.0),
            load_torque=dice.random() if index % 3 == 0 else None,
            temperature=25.0 + index * 1e-4,
            bus_voltage=48.0,
            status_word=0x1237,
            auxiliary=(("strain", dice.random()),) if index >= 10 else (),
        )


def write_log(path: Path, count: int = 300, *, closed: bool = True) -> LogWriter:
    """Write `count` samples, two events and an emergency; leave the file without an end if not `closed`."""
    writer = LogWriter(
        path,
        INFO,
        attachments={"dut.toml": DUT, "bench.toml": b"# bench\n"},
        cycle_rate=1000.0,
        epoch_ns=EPOCH_NS,
        auxiliary=("strain",),
        auxiliary_units={"strain": "mV/V"},
    )
    writer.event(RunEvent(0.0, "phase", "dwell"))
    for sample in samples(count):
        writer.write(sample)
        if sample.cycle == 20:
            writer.event(RunEvent(sample.time, "phase", "sweep"))
            writer.device_event(DeviceEvent("motor", sample.time, "overcurrent", 0x2310, 0x03, b"\x01\x02\x03\x04\x05"))
    if closed:
        writer.close({"result": "done"})
    return writer
