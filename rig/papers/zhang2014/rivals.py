"""The models of the torsion that Fig. 12 compares, and their errors on a measured sweep."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.papers.zhang2014.bench import Branch
from rig.papers.zhang2014.drive import PRINTED_C_F, flexspline_parameters, paper_drive
from sim_backend.model.compliance import LAWS, Compliance, total_torsion

Floats = NDArray[np.float64]

CUBIC, PIECEWISE = "cubic (10)", "piecewise (11)"
LINES_AND_WAVE_GENERATOR = "(11) + wave generator"
"""Not in the paper: tells apart what the flexspline's law gains and what the wave generator's hysteresis does."""
PRINTED, PROPOSED = "proposed (28), C_F as printed", "proposed (28)"


@dataclass(frozen=True, slots=True)
class Rival:
    """A law of the flexspline with its parameters, with or without the wave generator's share of (28)."""

    law: Compliance
    parameters: tuple[float, ...]
    wave_generator: bool


@dataclass(frozen=True, slots=True)
class Misfit:
    """Error of a model on a sweep: each sample (n,), rms and largest magnitude, rad; the mean is removed."""

    error: Floats
    rms: float
    largest: float


def rivals() -> Mapping[str, Rival]:
    """Give the models by name; every parameter is from the catalogue and the two tests, none is fitted to the sweep."""
    arctan = flexspline_parameters(Compliance.ARCTAN)
    return {
        CUBIC: Rival(Compliance.CUBIC, flexspline_parameters(Compliance.CUBIC), False),
        PIECEWISE: Rival(Compliance.PIECEWISE, flexspline_parameters(Compliance.PIECEWISE), False),
        LINES_AND_WAVE_GENERATOR: Rival(Compliance.PIECEWISE, flexspline_parameters(Compliance.PIECEWISE), True),
        PRINTED: Rival(Compliance.ARCTAN, (arctan[0], PRINTED_C_F), True),
        PROPOSED: Rival(Compliance.ARCTAN, arctan, True),
    }


def predicted(rival: Rival, output_torque: Floats, wave_generator_torque: Floats) -> Floats:
    """Give the torsion that a model predicts, rad; torques N*m, T_w as it acts back on the motor; all (n,)."""
    flexspline = LAWS[rival.law].torsion(output_torque, *rival.parameters)
    if not rival.wave_generator:
        return flexspline
    drive = paper_drive()
    return total_torsion(flexspline, wave_generator_torque, drive.ratio, drive.K_w0, drive.C_w)


def misfit(rival: Rival, branch: Branch, wave_generator_torque: Floats) -> Misfit:
    """Give the error of a model, measured less predicted. The zero of the encoders is free: the mean is removed."""
    error = branch.torsion - predicted(rival, branch.output_torque, wave_generator_torque)
    return misfit_of(error)


def misfit_of(error: Floats) -> Misfit:
    """Give rms and largest magnitude of an error (n,) without its mean."""
    error = error - np.mean(error)
    return Misfit(error, float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))))
