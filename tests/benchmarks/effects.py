"""The base plant and every effect, each against the same plant with that effect written by hand in C (plant.c).

The C is compiled by `gcc -O2`. Before anything is timed, both must have gone through the same states to within
TOLERANCE: they take the same steps and differ by rounding, and at a gap by where a solver stops. Then they take turns
on the same motion. Two motions: in a free run the rim slides all the time; with the output locked and the motor torque
reversed every 20 ms it swings, sticks and slides. Seconds are of the processor, ratios the median over the rounds.
"""

import ctypes
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_backend.model import stepper
from sim_backend.model.constants import Constants, derive
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Enters
from sim_backend.model.kernel import plant_kernel
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.ports import AxisMode

DRIVE = HarmonicDrive.from_catalogue(
    100.0, K1=8.4e3, K2=9.4e3, T1=3.9, T2=12.0, hysteresis_loss=1.8e-4, starting_torque=0.012, viscous_friction=1.2e-4
)
CONFIG = PlantConfig(DRIVE, temperature=40.0)
"""Warm, so that what depends on the temperature acts."""
TOLERANCE = 1e-7
"""Largest difference of a number of the state at 20 ms intervals over 0.4 s, relative to its largest size in them."""
SEGMENT = 1000
"""Steps between two reversals, 20 ms."""
ROUNDS = 9
WANTED = 1.5
SOURCE = Path(__file__).with_name("plant.c")


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two plants: its function, and the arrays that it works on."""

    advance: Callable[[int], object]
    state: np.ndarray
    inputs: np.ndarray

    def run(self, segments: int, *, locked: bool) -> None:
        for k in range(segments):
            if locked:
                self.inputs[stepper.MOTOR_TARGET] = 0.1 if k % 2 else -0.1
            self.advance(SEGMENT)

    def seconds(self, segments: int, *, locked: bool) -> float:
        begin = time.process_time()
        self.run(segments, locked=locked)
        return time.process_time() - begin


def layout() -> str:
    """Give the header with the arrays of the simulated bench as structures, in their order."""
    names = list(vars(stepper))
    state = names[names.index("STEPS") : names.index("STATE_SIZE")]
    inputs = names[names.index("MOTOR_MODE") : names.index("INPUT_SIZE")]
    fields = {
        "state": [name.lower() for name in state],
        "inputs": [name.lower() for name in inputs],
        "constants": Constants._fields,
    }
    return "\n".join(f"struct {name} {{\n    double {', '.join(of)};\n}};" for name, of in fields.items())


def compiled_c(effect: Effect | None, folder: Path) -> ctypes.CDLL:
    library = folder / f"{effect.id if effect else 'base'}.so"
    (folder / "layout.h").write_text(layout())
    chosen = [f"-D{effect.id.replace('-', '_').upper()}"] if effect else []
    command = ["gcc", "-std=gnu11", "-O2", "-shared", "-fPIC", *chosen, f"-I{folder}", SOURCE, "-o", library, "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def sides(effect: Effect | None, c_library: ctypes.CDLL, *, locked: bool) -> tuple[Side, Side]:
    """Give both plants at rest, with their commands."""
    active = [ActiveEffect(effect, tuple(p.typical for p in effect.parameters))] if effect else []
    kernel = plant_kernel(active)
    state, inputs = np.zeros(kernel.state_size), np.zeros(stepper.INPUT_SIZE)
    state[[stepper.GEAR_TEMPERATURE, stepper.WINDING_TEMPERATURE]] = CONFIG.temperature, CONFIG.motor_temperature
    inputs[[stepper.MOTOR_LIMIT, stepper.LOAD_LIMIT]] = CONFIG.motor_rated_torque, CONFIG.load_rated_torque
    inputs[stepper.LOCKED] = float(locked)
    inputs[stepper.MOTOR_MODE] = AxisMode.TORQUE if locked else AxisMode.VELOCITY
    inputs[stepper.MOTOR_TARGET] = 50.0
    constants = np.array(derive(CONFIG))
    ours = kernel.bind(state, inputs, constants)
    ours.start(0)
    c_state, c_inputs = state.copy(), inputs.copy()
    arrays = (c_state, c_inputs, constants, kernel.effect_parameters)
    addresses = [ctypes.c_void_p(array.ctypes.data) for array in arrays]

    def advance_c(steps: int, _keep: object = arrays) -> None:
        c_library.advance(ctypes.c_int64(steps), *addresses)

    return Side(ours.advance, state, inputs), Side(advance_c, c_state, c_inputs)


def difference(pair: tuple[Side, Side], *, locked: bool) -> float:
    """Run both through 0.4 s; give the largest difference of their states, relative to the size of what differs."""
    rows = []
    for k in range(20):
        for side in pair:
            side.inputs[stepper.MOTOR_TARGET] = (0.1 if k % 2 else -0.1) if locked else 50.0
            side.advance(SEGMENT)
        rows.append([side.state[: stepper.STATE_SIZE].copy() for side in pair])
    ours, c = np.array(rows).transpose(1, 0, 2)
    if not (np.isfinite(ours).all() and np.isfinite(c).all()):
        return np.inf
    size = np.abs(ours).max(axis=0)
    off = np.abs(ours - c).max(axis=0)
    return float(np.max(np.divide(off, size, out=np.where(off > 0.0, np.inf, 0.0), where=size > 0.0)))


def compare(name: str, effect: Effect | None, library: ctypes.CDLL, segments: int = 200) -> bool:
    line, within = f"  {name:34s}", True
    for locked in (False, True):
        pair = sides(effect, library, locked=locked)
        off = difference(pair, locked=locked)
        if off > TOLERANCE:
            print(f"{line} not the same plant: states differ by {off:.1e} of their size")
            return False
        rounds = [[side.seconds(segments, locked=locked) for side in pair] for _ in range(ROUNDS)]
        steps = segments * SEGMENT / 1e6
        ours, c = (steps / statistics.median(row[k] for row in rounds) for k in (0, 1))
        ratio = statistics.median(row[0] / row[1] for row in rounds)
        within = within and ratio <= WANTED
        line += f" {ours:6.1f} {c:6.1f} {ratio:6.2f}   {off:7.0e}  "
    print(f"{line} {'ok' if within else f'over {WANTED}'}")
    return within


def main() -> None:
    if shutil.which("gcc") is None:
        print("  skipped: there is no gcc, which the comparison with C needs")
        return
    effects = {name: effect for name, effect in CATALOGUE.items() if effect.enters is not Enters.BASE}
    print("  million steps/s, ours and C, seconds ours/C, difference of the states")
    print(f"  {'':34s} free run                        locked, swinging")
    with tempfile.TemporaryDirectory() as folder:
        kinds: list[tuple[str, Effect | None]] = [("base plant", None), *effects.items()]
        within = [compare(name, effect, compiled_c(effect, Path(folder))) for name, effect in kinds]
    print(f"  {sum(within)} of {len(within)} within {WANTED}")


if __name__ == "__main__":
    main()
