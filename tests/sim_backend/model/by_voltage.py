"""A driven transmission as a right-hand side: what integrators that share nothing with `driven` are given."""

from collections.abc import Callable, Sequence

from sim_backend.model.dc_motor import DcMotor
from sim_backend.model.driven import laws
from sim_backend.model.driven_loop import driven_rates
from sim_backend.model.fourier_error import FourierError
from sim_backend.model.transmission import Transmission


def voltage_driven(
    transmission: Transmission, series: FourierError, motor: DcMotor, voltage: float, load_torque: float = 0.0
) -> Callable[[float, Sequence[float]], list[float]]:
    """Give the right-hand side f(t, y) with the motor; y: theta_m, theta_m', theta_l, theta_l', current (A)."""
    c, coefficients = laws(transmission), series.coefficients
    electrical = (motor.resistance, motor.inductance, motor.constant)

    def rates(_: float, y: Sequence[float]) -> list[float]:
        return list(driven_rates(*y, voltage, load_torque, *electrical, coefficients, c))

    return rates
