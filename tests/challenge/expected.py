"""Which answers are right, decided before any campaign: from docs/effects.md and from the registries of the cases."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

from tests.challenge.cases import EVENT, Case
from tests.challenge.outside import OUTSIDE

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"

COMPANIONS: Mapping[str, frozenset[str]] = MappingProxyType(
    {"torque-sensor-drift": frozenset({"torque-sensor-offset"})}
)
"""What may be added besides: a drifting transducer that was tared at 20 degC is, at the catalogue's 25, also offset."""


@dataclass(frozen=True, slots=True)
class Expected:
    """What counts as right. `names`: hidden ids. `set_is_right`: a set that holds the one hidden effect is enough.

    `set_only`: nothing but a set is right, as the design cannot tell. `nothing_added`: verdict without a term.
    `variables`, `shapes`, `same_as`: of physics outside the catalogue.
    """

    names: frozenset[str] = frozenset()
    set_is_right: bool = False
    set_only: bool = False
    nothing_added: bool = False
    variables: frozenset[str] = frozenset()
    shapes: frozenset[str] = frozenset()
    same_as: frozenset[str] = frozenset()

    @property
    def companions(self) -> frozenset[str]:
        """Ids that may be added besides."""
        return frozenset().union(*(COMPANIONS.get(name, frozenset()) for name in self.names))


def expected_of(case: Case) -> Expected:
    """Give what is right for a case."""
    if case.outside is not None:
        kind = OUTSIDE[case.outside]
        return Expected(variables=kind.variables, shapes=kind.shapes, same_as=kind.same_as)
    names = frozenset(case.ids)
    if case.family == "ambiguous":
        return Expected(names, set_is_right=True, set_only=True)
    unseparable = any(answers()[name] == "ambiguous" for name in names) or case.needs is not None
    return Expected(names, set_is_right=unseparable, nothing_added=names == {EVENT})


@cache
def answers() -> Mapping[str, str]:
    """Give the answer that docs/effects.md expects of a rich campaign, by effect."""
    section = PAGE.read_text("utf-8").partition("## What a campaign establishes")[2]
    rows = re.findall(r"^\| ([a-z-]+) \| ([a-z, ]+) \|", section, flags=re.M)
    return MappingProxyType({effect: answer for effect, answer in rows if effect != "effect"})
