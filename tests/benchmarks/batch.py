"""A batch of 64 plants with different parameters: one worker against two, in turn, in seconds of wall time.

What two threads gain at best while other programs run is measured beside it, on hashes that share nothing.
"""

import dataclasses
import hashlib
import statistics
import time
from concurrent.futures import ThreadPoolExecutor

from sim_backend.batch import advance_all
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

DRIVE = HarmonicDrive(ratio=100.0, K_F0=8e3, C_F=0.07, K_w0=1.333, C_w=83.3, friction_torque=1.2)
PLANTS = 64
SECONDS = 0.5
ROUNDS = 15
DATA = bytes(1_000_000)


def batch() -> list[Plant]:
    plants = [Plant(PlantConfig(dataclasses.replace(DRIVE, K_F0=DRIVE.K_F0 * (1.0 + 0.01 * k)))) for k in range(PLANTS)]
    for k, plant in enumerate(plants):
        plant.command("motor", AxisMode.VELOCITY, 20.0 + k)
    return plants


def seconds(plants: list[Plant], workers: int) -> float:
    begin = time.perf_counter()
    advance_all(plants, plants[0].time + SECONDS, workers)
    return time.perf_counter() - begin


def hashing(workers: int) -> float:
    """Hash the data as often as there are plants."""
    begin = time.perf_counter()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda _: hashlib.sha256(DATA).digest(), range(PLANTS)))
    return time.perf_counter() - begin


def main() -> None:
    plants = batch()
    seconds(plants, 2)
    rounds = [(seconds(plants, 1), seconds(plants, 2), hashing(1), hashing(2)) for _ in range(ROUNDS)]
    steps = PLANTS * SECONDS / plants[0].config.step / 1e6
    for place, name in enumerate(("one worker", "two workers")):
        taken = statistics.median(row[place] for row in rounds)
        print(f"  {PLANTS} plants, {name:12s} {steps / taken:6.1f} million steps/s")
    for name, one, two in (("plants", 0, 1), ("hashes", 2, 3)):
        gains = sorted(row[one] / row[two] for row in rounds)
        print(f"  speed-up of {name}: {statistics.median(gains):.2f} ({gains[0]:.2f} to {gains[-1]:.2f} of {ROUNDS})")
    print("  wanted: the plants gain what the hashes gain, 2 on two free cores")


if __name__ == "__main__":
    main()
