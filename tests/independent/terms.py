"""What acts on the bench beyond the base model: values only, no formula."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Line:
    """amplitude * sin(order * angle + phase): cycles per revolution, rad or N*m, rad."""

    order: float
    amplitude: float
    phase: float


@dataclass(frozen=True, slots=True)
class Arm:
    """Weight on the output: moment m*g*r (N*m) when level, `phase` (rad) of the arm from hanging straight down."""

    moment: float
    phase: float


@dataclass(frozen=True, slots=True)
class Term:
    """One effect by catalogue id with its parameters as (name, value), SI."""

    id: str
    parameters: tuple[tuple[str, float], ...]


def term(effect_id: str, **parameters: float) -> Term:
    """Give the effect with these parameters."""
    return Term(effect_id, tuple(parameters.items()))


@dataclass(frozen=True, slots=True)
class Effects:
    """What acts on the bench beyond the base model; empty means absent. `others` holds every further effect."""

    kinematic_error: tuple[Line, ...] = ()
    cogging: tuple[Line, ...] = ()
    gravity_load: Arm = Arm(0.0, 0.0)
    others: tuple[Term, ...] = ()

    def of(self, effect_id: str) -> tuple[Mapping[str, float], ...]:
        """Give the parameters of every instance of one effect, by name; empty if it is absent."""
        if effect_id == "kinematic-error":
            return tuple(_line_parameters(line) for line in self.kinematic_error)
        if effect_id == "cogging":
            return tuple(_line_parameters(line) for line in self.cogging)
        if effect_id == "gravity-load":
            arm = self.gravity_load
            return ({"amplitude": arm.moment, "phase": arm.phase},) if arm.moment else ()
        return tuple(dict(other.parameters) for other in self.others if other.id == effect_id)

    def ids(self) -> tuple[str, ...]:
        """Give the ids of what is present, each once."""
        built_in = [name for name in ("kinematic-error", "cogging", "gravity-load") if self.of(name)]
        return tuple(dict.fromkeys([*built_in, *(other.id for other in self.others)]))

    def __add__(self, further: "Effects") -> "Effects":
        """Give both together; of two arms the one with a moment."""
        return Effects(
            self.kinematic_error + further.kinematic_error,
            self.cogging + further.cogging,
            further.gravity_load if further.gravity_load.moment else self.gravity_load,
            self.others + further.others,
        )


def _line_parameters(line: Line) -> dict[str, float]:
    return {"amplitude": line.amplitude, "order": line.order, "phase": line.phase}
