"""The lock-step bench: seconds of bench time per second of wall time, on one core, at 1 kHz.

A cycle is everything that a cycle of a simulated run is: the plant at its default step, the firmware of four devices
(motor drive, load drive, encoder, torque transducer), every CAN frame encoded and decoded on both sides (setpoints,
SYNC, four readings, heartbeats when due), the limits, the procedure itself and the sample in an MCAP log.

Two runs are timed, both with the output locked: the motor swept in torque while the load drive is released and only
reports, as the shipped locked-output procedure does; and both drives swept in torque.
"""

import math
import statistics
import tempfile
import time
from pathlib import Path

from drivers.types import Mode, Setpoint
from procedures.intents import Command, Mark, Result, SetLock, Steps
from procedures.motions import Shaper, motor_torque
from rig.config.bench import load_bench
from rig.config.dut import default_dut
from rig.log.writer import LogWriter
from rig.operator import SimulatedOperator
from rig.runner import execute
from rig.simulation import simulate
from rig.stop import Stop

CYCLES = 20_000
ROUNDS = 5
WANTED = 20


def both_torques(value: float) -> Command:
    return Command(Setpoint(Mode.TORQUE, value), Setpoint(Mode.TORQUE, 50.0 * value))


RUNS: dict[str, Shaper] = {"motor only": motor_torque(), "both drives": both_torques}


def sweep(shape: Shaper) -> Steps:
    yield SetLock(True)
    yield Mark("sweep")
    for k in range(CYCLES):
        yield shape(0.1 * math.sin(1e-3 * k))
    return Result


def real_time_factor(number: int, folder: Path, shape: Shaper = both_torques) -> float:
    bench_file, _ = load_bench("sim")
    simulated = simulate(bench_file, default_dut()[0], seed=number)
    simulated.bench.open()
    log = LogWriter(folder / f"{number}.mcap", {"run_id": str(number)}, attachments={}, cycle_rate=1000, epoch_ns=0)
    begin = time.perf_counter()
    outcome = execute(simulated.bench, sweep(shape), log, SimulatedOperator(), Stop())
    log.close({"status": str(outcome.status)})
    elapsed = time.perf_counter() - begin
    simulated.bench.close()
    if outcome.error is not None:
        raise outcome.error
    return outcome.duration / elapsed


def main() -> None:
    for name, shape in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            real_time_factor(0, Path(folder), shape)
            factors = [real_time_factor(number, Path(folder), shape) for number in range(1, ROUNDS + 1)]
        median = statistics.median(factors)
        print(f"  lock-step bench, {name}: {median:.1f} times real time (wanted: at least {WANTED})")
        print(f"  smallest {min(factors):.1f}, largest {max(factors):.1f} of {ROUNDS}")


if __name__ == "__main__":
    main()
