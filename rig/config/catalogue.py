"""What a dut file must not say of its drive if anything is to be computed with it, and what is hardly meant."""

from collections.abc import Iterator

from drivers.errors import Mistake
from rig.config.dut import Dut, Gear
from sim_backend.model.estimation import PIECEWISE_EQUATION
from sim_backend.model.limits import CATALOGUE, PIECEWISE

USUAL_T1_SHARE, USUAL_T2_SHARE = (0.08, 1.0), (0.25, 2.5)
"""T1 and T2 over the rated torque. These ranges are working ranges, not verified against every maker's tables: wide
enough for drives of all sizes and ratios, and a torque that is ten times off lies outside of one at least."""

USUAL_SPREAD = (1.5, 8.0)
"""T2 over T1."""

USUAL_T1_TORSION, USUAL_T2_TORSION = (1.5e-4, 2e-3), (4e-4, 5e-3)
"""rad; T1/K1 and T2/K2: some arc minutes, whatever the size of the drive."""


def beyond_limits(dut: Dut) -> Iterator[Mistake]:
    """Name the catalogue values of the drive that no drive of any size has, in the dut's keys."""
    for name, (unit, low, high, _) in {**CATALOGUE, "K3": PIECEWISE["K3"]}.items():
        value = getattr(dut.gear, name)
        if value is not None and not low <= value <= high:
            rule = f"is not possible: a drive has {low:g} to {high:g} {unit}".rstrip()
            yield Mistake(f"gear.{name}", value, rule)


def doubt(dut: Dut) -> str | None:
    """Say where T1 and T2, where the catalogue's stiffness changes, contradict rated torque, stiffness or each other.

    Such a drive can be, so it is no mistake; but a digit or a unit that slipped is more likely.
    """
    gear = dut.gear
    found = [
        f"{what} is {value:.3g}{unit}, usually {low:g} to {high:g}{unit}"
        for what, value, unit, (low, high) in _proportions(gear)
        if not low <= value <= high
    ]
    if not found:
        return None
    given = ", ".join(f"gear.{name} = {getattr(gear, name):g} N*m" for name in ("T1", "T2") if getattr(gear, name))
    needed = f"{PIECEWISE_EQUATION} needs them right: are digits and units those of the catalogue?"
    return f"{given}: {'; '.join(found)}. {needed}"


def _proportions(gear: Gear) -> Iterator[tuple[str, float, str, tuple[float, float]]]:
    """Give what T1 and T2 can be held against: name, value, unit, usual range."""
    if gear.T1 is not None and gear.rated_torque is not None:
        yield "T1/rated_torque", gear.T1 / gear.rated_torque, "", USUAL_T1_SHARE
    if gear.T2 is not None and gear.rated_torque is not None:
        yield "T2/rated_torque", gear.T2 / gear.rated_torque, "", USUAL_T2_SHARE
    if gear.T1 is not None and gear.T2 is not None:
        yield "T2/T1", gear.T2 / gear.T1, "", USUAL_SPREAD
    if gear.T1 is not None and gear.K1 is not None:
        yield "T1/K1", gear.T1 / gear.K1, " rad", USUAL_T1_TORSION
    if gear.T2 is not None and gear.K2 is not None:
        yield "T2/K2", gear.T2 / gear.K2, " rad", USUAL_T2_TORSION
