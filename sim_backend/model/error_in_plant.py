"""A pure error identified on one bench as effects of the simulated bench.

The plant turns `opposed` and adds to the torsion theta_o + theta_m/N what the series takes from theta_m/N - theta_l:
with the motor angle mirrored, e(theta_m) = -theta_p(-theta_m). Its constant is an encoder's zero and is left out.
"""

import math

from sim_backend.model.effects import CATALOGUE, ActiveEffect
from sim_backend.model.fourier_error import FourierError


def kinematic_effects(series: FourierError) -> tuple[ActiveEffect, ...]:
    """Give one kinematic-error effect for every order of the series that is there."""
    return tuple(
        ActiveEffect(CATALOGUE["kinematic-error"], (math.hypot(a, b), float(order), math.atan2(-a, b)))
        for order, (a, b) in enumerate(zip(series.a, series.b, strict=True), start=1)
        if a != 0.0 or b != 0.0
    )


def series_of_torsion(series: FourierError) -> FourierError:
    """Turn a series of the torsion over the motor angle of the sense `opposed` into that of the error, and back."""
    return FourierError(-series.a0, tuple(-a for a in series.a), series.b)
