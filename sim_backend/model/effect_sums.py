"""What the active effects add, as the stepper calls it: here none; `kernel` writes the versions with effects.

Every sum but that of the coupling takes the signals `now`, then `output_torque` (N*m) and `flexspline_torsion` (rad),
which mean something else in each, then the time since the last call (s), the state with the effects' memory, and the
effects' parameters.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Signals(NamedTuple):
    """Signals that an effect may take, besides `output_torque` and `flexspline_torsion`: contract signs, SI, degC.

    `locked`: 1 while the fixture holds the output, else 0. `base_friction`: running friction of the base model at
    the motor, T_c + b |motor_velocity|, N*m.
    """

    time: float
    motor_position: float
    motor_velocity: float
    motor_torque: float
    motor_current: float
    output_position: float
    output_velocity: float
    temperature: float
    motor_temperature: float
    locked: float
    base_friction: float


FRICTION = False
"""An effect changes the friction level of the mesh."""
SERIES = False
"""An effect in the torsion depends on the torque in the flexspline: a spring in series with it."""
COUPLED = False
"""An effect in the torsion depends on the torque in the wave generator alone: a gap or spring in series with it."""
READINGS = False
"""An effect changes what an instrument shows."""


def torsion_effects(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> tuple[float, float, float, float]:
    """Give what depends on no spring's torque: (angle added to the torsion rad, slope, open, open slope).

    slope: the torque on the motor per N*m in the flexspline. The angle of an effect without memory gives the motor
    all the work that the flexspline does on it; open are angle and slope of the others, which may keep or add some, and
    of which the flexspline's damper feels nothing.
    `output_torque` and `flexspline_torsion` mean nothing here.
    """
    return 0.0, 0.0, 0.0, 0.0


def series_effects(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> float:
    """Give the angle of what lies in series with the flexspline, rad, for a trial of the torque and torsion in it.

    Memory is that of the step before; what becomes of it is on trial too, until `keep_series`.
    """
    return 0.0


def keep_series(state: Array) -> None:
    """Make the memory of the last trial the memory."""


def coupling_effects(motor_torque: float, effect_parameters: Array) -> float:
    """Give the angle of what lies in series with the wave generator, rad at the output, for the torque in it.

    motor_torque: N*m at the motor, what the motor must hold at rest: that on the motor shaft with the other sign.
    """
    return 0.0


def series_slope(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> float:
    """Give the torque on the motor per N*m in the flexspline that comes of the series, for the torque reached."""
    return 0.0


def friction_effects(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> float:
    """Give what is added to the level of dry friction, N*m at the motor; `output_torque` is the flexspline's."""
    return 0.0


def motor_effects(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> float:
    """Give the torque which the motor must overcome, N*m; `output_torque` is the transducer's."""
    return 0.0


def output_effects(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> float:
    """Give the torque which the output must overcome, N*m; `output_torque` is the transducer's."""
    return 0.0


def reading_errors(
    now: Signals, output_torque: float, flexspline_torsion: float, step: float, state: Array, effect_parameters: Array
) -> tuple[float, float, float, float]:
    """Give the errors of motor_position, motor_torque, output_position and output_torque; `output_torque` is true."""
    return 0.0, 0.0, 0.0, 0.0
