"""Watches over a motion that must stay small: a shaft that is held must not travel."""

from collections.abc import Callable

from drivers.types import Sample
from procedures.errors import TravelError
from procedures.recording import measured


def travel_guard(rest: Sample, travel_max: float, held: str) -> Callable[[Sample], None]:
    """Give a function that raises TravelError once the motor is more than `travel_max` (rad) away from `rest`.

    `held` completes the message: what must have let go.
    """
    start = measured(rest.motor_position, "motor_position")

    def check(sample: Sample) -> None:
        travel = measured(sample.motor_position, "motor_position") - start
        if abs(travel) > travel_max:
            raise TravelError(
                "motor_position",
                travel,
                travel_max,
                "rad",
                cycle=sample.cycle,
                what=(
                    f"The motor turned by {travel:.4g} rad in cycle {sample.cycle}, the limit is travel_max = "
                    f"{travel_max:.4g} rad: {held}."
                ),
                hint="The torque was taken away. Check what should hold before the next run.",
            )

    return check
