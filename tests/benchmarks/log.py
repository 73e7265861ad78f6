"""The log: cost of a written sample, of its packing alone, and of reading a million samples into arrays."""

import tempfile
import time
from pathlib import Path

import numpy as np

from drivers.clock import RealClock
from drivers.types import Sample
from rig.log.csv_file import read_csv
from rig.log.export import ExportKind, export_run
from rig.log.mcap_reader import read_mcap
from rig.log.writer import LogWriter

SAMPLES = 1_000_000
ROUNDS = 10


def make_samples(count: int, first: int, dice: np.random.Generator) -> list[Sample]:
    """Give samples of 13 fields at 1 kHz, as a locked-output bench gives them."""
    noise = dice.normal(size=(count, 7)).tolist()
    return [
        Sample(
            time=(first + index) / 1000,
            cycle=first + index,
            motor_position=row[0],
            motor_velocity=row[1],
            motor_torque=row[2],
            motor_torque_command=row[3],
            motor_current=row[4],
            output_position=row[5],
            output_torque=row[6],
            load_torque=0.0,
            temperature=25.0,
            bus_voltage=48.0,
            status_word=0x1237,
        )
        for index, row in enumerate(noise)
    ]


def main() -> None:
    clock, dice = RealClock(), np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "big.mcap"
        writer = LogWriter(file, {}, attachments={}, cycle_rate=1000.0, epoch_ns=10**18)
        costs = []
        for number in range(ROUNDS):
            samples = make_samples(SAMPLES // ROUNDS, number * SAMPLES // ROUNDS, dice)
            begin = time.process_time()
            for sample in samples:
                writer.write(sample)
            costs.append((time.process_time() - begin) / len(samples))
        writer.close({})
        cost = sorted(costs)[len(costs) // 2]
        print(f"  write          {cost * 1e6:6.2f} us/sample   (wanted: at most 8)")
        print(f"  size           {file.stat().st_size / SAMPLES:6.0f} B/sample")

        begin = clock.now()
        run = read_mcap(file)
        print(f"  read {len(run.time):8d} {clock.now() - begin:6.2f} s           (wanted: at most 5)")
        for kind in (ExportKind.HDF5, ExportKind.CSV):
            begin = time.process_time()
            path = export_run(run, kind, Path(folder) / "out")
            cost = (time.process_time() - begin) / SAMPLES
            print(f"  export {kind:7s} {cost * 1e6:6.2f} us/sample, {path.stat().st_size / SAMPLES:.0f} B/sample")
        begin = clock.now()
        read_csv(path)
        print(f"  read CSV       {clock.now() - begin:6.2f} s")


if __name__ == "__main__":
    main()
