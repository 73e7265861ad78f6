"""The lock-step bench: seconds of bench time per second of wall time, all frames, plant, limits and log included.

One core. Both drives are enabled and follow a torque sweep, so every cycle carries SYNC, two setpoint frames and four
readings; the plant runs at its default step and every sample goes to an MCAP log.
"""

import math
import statistics
import tempfile
import time
from pathlib import Path

from drivers.types import Mode, Setpoint
from procedures.intents import Command, Mark, Result, SetLock, Steps
from rig.config.bench import load_bench
from rig.config.dut import default_dut
from rig.log.writer import LogWriter
from rig.operator import SimulatedOperator
from rig.runner import execute
from rig.simulation import simulate
from rig.stop import Stop

CYCLES = 20_000
ROUNDS = 5


def sweep() -> Steps:
    yield SetLock(True)
    yield Mark("sweep")
    for k in range(CYCLES):
        yield Command(
            Setpoint(Mode.TORQUE, 0.1 * math.sin(1e-3 * k)),
            Setpoint(Mode.TORQUE, 5.0 * math.sin(7e-4 * k)),
        )
    return Result


def real_time_factor(number: int, folder: Path) -> float:
    bench_file, _ = load_bench("sim")
    simulated = simulate(bench_file, default_dut()[0], seed=number)
    simulated.bench.open()
    log = LogWriter(folder / f"{number}.mcap", {"run_id": str(number)}, attachments={}, cycle_rate=1000, epoch_ns=0)
    begin = time.perf_counter()
    outcome = execute(simulated.bench, sweep(), log, SimulatedOperator(), Stop())
    log.close({"status": str(outcome.status)})
    elapsed = time.perf_counter() - begin
    simulated.bench.close()
    if outcome.error is not None:
        raise outcome.error
    return outcome.duration / elapsed


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        real_time_factor(0, Path(folder))
        factors = [real_time_factor(number, Path(folder)) for number in range(1, ROUNDS + 1)]
    print(f"  lock-step bench, 1 kHz: {statistics.median(factors):.1f} times real time (wanted: at least 20)")
    print(f"  smallest {min(factors):.1f}, largest {max(factors):.1f} of {ROUNDS}")


if __name__ == "__main__":
    main()
