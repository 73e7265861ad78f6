"""First step of a simulated bench in a new process whose kernel is in the cache, against importing numba alone.

Each is a fresh interpreter that reports the seconds from its first statement on; they take turns.
"""

import statistics
import subprocess
import sys
import time

PLANT = """
import time
begin = time.perf_counter()
from sim_backend.plant import Plant
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Enters
from sim_backend.model.parameters import HarmonicDrive, PlantConfig

drive = HarmonicDrive(ratio=100.0, K_F0=8e3, C_F=0.07, K_w0=1.333, C_w=83.3, friction_torque=1.2)
effects = [
    ActiveEffect(effect, tuple(parameter.typical for parameter in effect.parameters))
    for effect in CATALOGUE.values() if {every} and effect.enters is not Enters.BASE
]
Plant(PlantConfig(drive), effects).advance_to(1e-3)
print(time.perf_counter() - begin)
"""
NUMBA = """
import time
begin = time.perf_counter()
import numba
print(time.perf_counter() - begin)
"""
CODES = {
    "numba, import alone": NUMBA,
    "base plant, first step": PLANT.format(every=False),
    "plant with every effect": PLANT.format(every=True),
}
ROUNDS = 15
WANTED = 0.6


def seconds(code: str) -> tuple[float, float]:
    """Give the seconds inside, and those of the whole process."""
    begin = time.perf_counter()
    finished = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return float(finished.stdout), time.perf_counter() - begin


def main() -> None:
    for code in CODES.values():
        seconds(code)  # into the cache
    rounds = [[seconds(code) for code in CODES.values()] for _ in range(ROUNDS)]
    print(f"  median of {ROUNDS}               inside   process   inside, of numba's import")
    for place, name in enumerate(CODES):
        inside = statistics.median(row[place][0] for row in rounds)
        process = statistics.median(row[place][1] for row in rounds)
        ratio = statistics.median(row[place][0] / row[0][0] for row in rounds)
        print(f"  {name:26s} {inside:6.3f} s {process:6.3f} s {ratio:8.2f}")
    print(f"  wanted: first step within {WANTED} s")


if __name__ == "__main__":
    main()
