"""Parameters of the two-mass model: motor, harmonic drive with one linear spring, load; viscous friction only.

Source: Castejon, Garcia-Prada & Lara 2009, table 1.
"""

import math
from dataclasses import dataclass

from sim_backend.model.checks import require
from sim_backend.model.parameters import Rotation


@dataclass(frozen=True, slots=True)
class Transmission:
    """Inertias kg*m^2, damping N*m*s/rad, stiffness N*m/rad at the output, ratio 1; symbols of table 1 in brackets.

    Angles are counted so that theta_l = theta_m / ratio ideally, for both senses: the load angle of a drive that turns
    `opposed` is counted the other way round. The sense remains in one place, the bearing between wave generator and
    flexspline: its speed is theta_m' - theta_l' (`same`) or theta_m' + theta_l' (`opposed`, as (12) prints it).
    """

    motor_inertia: float
    """[J_m]"""
    wave_generator_inertia: float
    """[J_wg]; printed as B_wg, and left out of (15) although (9) has it."""
    load_inertia: float
    """[J_l]"""
    motor_damping: float
    """[B_m]"""
    bearing_damping: float
    """[B_ml] between wave generator and flexspline."""
    mesh_damping: float
    """[B_sp] between flexspline and circular spline; acts on the rate of the spring's deflection."""
    load_damping: float
    """[B_l]"""
    stiffness: float
    """[K]; printed as the load's, used as the drive's torsional stiffness."""
    ratio: float
    """[N]"""
    rotation: Rotation = Rotation.SAME

    def __post_init__(self) -> None:
        require("motor_inertia", self.motor_inertia, "kg*m^2", "(15)", above=0.0)
        require("wave_generator_inertia", self.wave_generator_inertia, "kg*m^2", "(9)", low=0.0)
        require("load_inertia", self.load_inertia, "kg*m^2", "(16)", above=0.0)
        for name in ("motor_damping", "bearing_damping", "mesh_damping", "load_damping"):
            require(name, getattr(self, name), "N*m*s/rad", "(12)", low=0.0)
        require("stiffness", self.stiffness, "N*m/rad", "(10)", above=0.0)
        require("ratio", self.ratio, "", "(8)", low=1.0)

    @property
    def shaft_inertia(self) -> float:
        """Everything that turns with the motor, J_m + J_wg of (9), kg*m^2."""
        return self.motor_inertia + self.wave_generator_inertia

    @property
    def bearing_sense(self) -> float:
        """Sign of theta_l' in the bearing's speed, 1: -1 `same`, +1 `opposed`."""
        return -1.0 if self.rotation is Rotation.SAME else 1.0

    @property
    def load_mode(self) -> float:
        """Angular frequency of the load on the spring with the motor held, rad/s."""
        return math.sqrt(self.stiffness / self.load_inertia)

    @property
    def drag(self) -> float:
        """Torque per speed, both at the motor, of a steady run without load torque, N*m*s/rad."""
        bearing = self.bearing_damping * (1.0 + self.bearing_sense / self.ratio) ** 2
        return self.motor_damping + bearing + self.load_damping / self.ratio**2


def hdc_40(rotation: Rotation = Rotation.SAME) -> Transmission:
    """Give table 1: an HDC-40 unit with ratio 50, its motor and its load."""
    return Transmission(
        motor_inertia=2.9e-4,
        wave_generator_inertia=1.6e-4,
        load_inertia=5.0e-4,
        motor_damping=1.7e-4,
        bearing_damping=1.3e-5,
        mesh_damping=1.0e-4,
        load_damping=5.0e-4,
        stiffness=7160.0,
        ratio=50.0,
        rotation=rotation,
    )
