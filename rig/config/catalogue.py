"""What a dut file must not say of its drive if anything is to be computed with it."""

from collections.abc import Iterator

from drivers.errors import Mistake
from rig.config.dut import Dut
from sim_backend.model.limits import CATALOGUE, PIECEWISE


def beyond_limits(dut: Dut) -> Iterator[Mistake]:
    """Name the catalogue values of the drive that no drive of any size has, in the dut's keys."""
    for name, (unit, low, high, _) in {**CATALOGUE, "K3": PIECEWISE["K3"]}.items():
        value = getattr(dut.gear, name)
        if value is not None and not low <= value <= high:
            rule = f"is not possible: a drive has {low:g} to {high:g} {unit}".rstrip()
            yield Mistake(f"gear.{name}", value, rule)
