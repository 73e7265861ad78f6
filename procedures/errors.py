"""Errors of procedures: leaves below `LimitError`, so that they end a run as any safety limit does."""

from drivers.errors import LimitError


class NoMotionError(LimitError):
    """The motor did not move although the torque reached its limit.

    Attributes besides those of LimitError: `limit` (N*m, the largest torque allowed) and `travel` (rad, how far the
    motor had moved by then).
    """

    def __init__(self, signal: str, *, torque: float, limit: float, travel: float, motion: float, cycle: int) -> None:
        self.travel = travel
        super().__init__(
            signal,
            torque,
            limit,
            "N*m",
            cycle=cycle,
            what=(
                f"The motor did not break away: {signal} reached {torque:.6g} N*m in cycle {cycle}, the limit is "
                f"torque_max = {limit:.6g} N*m; it had moved by {travel:.4g} rad, {motion:.4g} rad count as motion."
            ),
            hint="The torque was taken away. Check that the output turns freely, then raise torque_max.",
        )
        self.facts["travel"] = travel


class TravelError(LimitError):
    """The motor travelled further than a held shaft allows, or faster than a procedure bounds it."""
