"""Equations (7)-(9) and (12)-(21): what turns by how much, read in the simulated plant.

The plant integrates its motor over time and finds the gear side (the rim) that balances both springs, each by the
inverse of its law; here its angles are held against the laws over torque, and against the laws' stiffness integrated
along the sweep, which the plant does not use. theta_Fi is the plant's rim, theta_wo = -N theta_Fi by assumption 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.papers.item import Outcome, Row, Workbench, definition
from rig.papers.zhang2014.drive import RATED_TORQUE, RATIO, STARTING_TORQUE, paper_drive
from sim_backend.model.compliance import (
    flexspline_stiffness,
    flexspline_torsion,
    total_torsion,
    wave_generator_stiffness,
    wave_generator_torsion,
)
from sim_backend.model.kinematics import wave_generator_torque
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

Floats = NDArray[np.float64]

PEAK = RATED_TORQUE / RATIO + STARTING_TORQUE
"""N*m at the motor: rated torque at the output after friction."""

PERIOD, CYCLE = 6.88, 1e-3
"""s of the triangle and between readings; 0.1 N*m/s at the motor."""

YIELDS = "what the wave generator yields: Psi/2, and 0.8 urad of its straight line above 1e3 N*m/rad; (18) has it"
FLEXSPLINE_DAMPER = "T_F has the flexspline's damper in it: falls with the rate"
WAVE_GENERATOR_DAMPER = (
    "T_w has the wave generator's damper in it: falls with the rate, to the 0.8 urad of its straight line"
)


@dataclass(frozen=True, slots=True)
class Swept:
    """A locked sweep from zero and through a full cycle; (n,). rad: theta_Fo, theta_Fi and theta_wi; N*m."""

    output: Floats
    gear_side: Floats
    motor: Floats
    T_F: Floats
    T_w: Floats

    @property
    def rim(self) -> Floats:
        """theta_wo, by (18)."""
        return -RATIO * self.gear_side

    @property
    def torsion(self) -> Floats:
        """(13), (19): what the encoders of motor and output show."""
        return self.output + self.motor / RATIO


def swept(_: Workbench) -> Swept:
    """Sweep the shipped bench with the paper's drive."""
    return sweep_of(PlantConfig(paper_drive()))


def sweep_of(config: PlantConfig) -> Swept:
    """Sweep the motor's torque against the lock, without instruments and their noise."""
    plant, rows = Plant(config), []
    plant.set_lock(True)
    for k in range(round(1.25 * PERIOD / CYCLE)):
        level = float(np.interp(k * CYCLE / PERIOD % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0]))
        plant.command("motor", AxisMode.TORQUE, PEAK * level)
        plant.advance_to((k + 1) * CYCLE)
        now = plant.truth()
        angles = now.output_position, now.rim_position, now.motor_position
        rows.append((*angles, now.flexspline_torque, now.wave_generator_torque))
    output, gear_side, motor, T_F, T_w = np.array(rows).T
    return Swept(output, gear_side, motor, T_F, T_w)


def friction(bench: Workbench) -> Outcome:
    """Give what (7)-(9) say of the gear side, and what the plant's gear side does."""
    drive, sweep = paper_drive(), bench.share(swept)
    held = wave_generator_torque(RATIO, RATED_TORQUE, drive.friction_torque)
    wound = float(np.max(np.abs(sweep.gear_side + sweep.motor / RATIO)))
    before = slice(0, int(np.argmax(sweep.gear_side != 0.0)))
    turned, followed = np.ptp(sweep.motor[before]) / RATIO, np.ptp(sweep.gear_side[before])
    return Outcome(
        (
            Row("theta_Fi + theta_w/N in the plant, largest", 0.0, wound, "rad", YIELDS, "eq. (7)"),
            Row(
                "omega_Fi over -omega_w/N in the plant before it breaks away",
                1.0,
                float(followed / turned),
                "1",
                "the mesh sticks: the wave generator turns alone",
                "eq. (8)",
            ),
            Row("T_w under 16 N*m and friction of 1.2 N*m", None, held, "N*m", "", "eq. (9)"),
            Row(
                "T_F + N T_w in the plant, largest",
                drive.friction_torque,
                float(np.max(np.abs(sweep.T_F + RATIO * sweep.T_w))),
                "N*m",
                "printed: N T_fs; |T_Fr| in (9)",
                "eq. (9)",
            ),
        )
    )


def decomposition(bench: Workbench) -> Outcome:
    """Hold the plant's angles against the laws over its torques."""
    drive, sweep = paper_drive(), bench.share(swept)
    flexspline = sweep.output - sweep.gear_side
    wave_generator = sweep.rim - sweep.motor
    f = flexspline_torsion(sweep.T_F, drive.K_F0, drive.C_F)
    g = wave_generator_torsion(sweep.T_w, drive.K_w0, drive.C_w)
    whole = total_torsion(f, sweep.T_w, RATIO, drive.K_w0, drive.C_w)
    most = int(np.argmax(sweep.T_F))
    started = float(wave_generator_torsion(np.array(STARTING_TORQUE), drive.K_w0, drive.C_w))
    return Outcome(
        (
            Row("loop of (12) at zero torque", 0.0, _width(sweep, flexspline), "rad", FLEXSPLINE_DAMPER, "eq. (12)"),
            Row(
                "loop of (13) at zero torque",
                None,
                _width(sweep, sweep.torsion),
                "rad",
                "the same sweep; the wave generator's share, which (12) leaves out",
                "eq. (13)",
            ),
            Row(
                "(14) in the plant less f(T_F), largest",
                0.0,
                _largest(flexspline - f),
                "rad",
                FLEXSPLINE_DAMPER,
                "eq. (14)",
            ),
            Row(
                "(15) in the plant less g(T_w), over N, largest",
                0.0,
                _largest(wave_generator - g) / RATIO,
                "rad",
                WAVE_GENERATOR_DAMPER,
                "eq. (15)",
            ),
            Row(
                f"K_F at {sweep.T_F[most]:.3g} N*m",
                None,
                float(sweep.T_F[most] / flexspline[most]),
                "N*m/rad",
                "plant; no constant, see (22)",
                "eq. (16)",
            ),
            Row(
                "K_w at the starting torque",
                None,
                STARTING_TORQUE / started,
                "N*m/rad",
                "no constant, see (25)",
                "eq. (17)",
            ),
            definition(18, "assumption 1: theta_wo = -N theta_Fi", "theta_wo has no sensor; it excludes backlash"),
            Row(
                "(19) in the plant less (28), largest",
                0.0,
                _largest(sweep.torsion - whole),
                "rad",
                WAVE_GENERATOR_DAMPER,
                "eq. (19)",
            ),
            definition(20, "(19) with theta_Fi and theta_wo/N added and taken away", "an identity"),
            Row(
                "(19) in the plant less the integral of dT_F/K_FL - dT_w/(N K_wL), largest",
                0.0,
                _largest(sweep.torsion[1:] - sweep.torsion[0] - _integrated(sweep)),
                "rad",
                f"along the sweep, with (22) and (25) for the stiffness; {WAVE_GENERATOR_DAMPER}",
                "eq. (21)",
            ),
        )
    )


def _integrated(sweep: Swept) -> Floats:
    """Integrate the stiffness of both springs along the sweep, midpoint by midpoint; rad, shape (n - 1,)."""
    drive = paper_drive()
    T_F, T_w = (0.5 * (torque[1:] + torque[:-1]) for torque in (sweep.T_F, sweep.T_w))
    flexspline = np.diff(sweep.T_F) / flexspline_stiffness(T_F, drive.K_F0, drive.C_F)
    wave_generator = np.diff(sweep.T_w) / wave_generator_stiffness(T_w, drive.K_w0, drive.C_w)
    return np.asarray(np.cumsum(flexspline - wave_generator / RATIO))


def _width(sweep: Swept, angle: Floats) -> float:
    """Give how far both branches of an angle lie apart at zero torque, rad."""
    begin = round(0.25 * PERIOD / CYCLE)
    torque, angle = sweep.T_F[begin:], angle[begin:]
    turn = int(np.argmin(torque))
    falling = float(np.interp(0.0, torque[:turn][::-1], angle[:turn][::-1]))
    return abs(float(np.interp(0.0, torque[turn:], angle[turn:])) - falling)


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))
