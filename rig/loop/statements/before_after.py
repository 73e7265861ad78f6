"""The errors before and after, equation by equation, with the floor; and the refusal of one that is too good."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from drivers.errors import DataError
from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.model.equations import Equation, pieces_of
from rig.loop.model.prediction import Model
from rig.loop.result import EquationResult, Errors, Json, Open, Verdict
from rig.loop.search.followed import up_to
from rig.loop.signals.tracks import Track
from rig.loop.statements.events import Event, without_events
from rig.loop.statements.floor import Floor, floor_of, pooled
from rig.loop.statements.residuals import Residual, residual_of, rms

WORSE, WORSE_PROCEDURE = 1.02, 1.1
"""Times by which the held-out error of an equation, and of one procedure in it, may grow: the chance of a few runs."""


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """Residuals of one piece without and with the effects, and the single steps in the latter."""

    before: Residual
    after: Residual
    events: tuple[Event, ...] = ()

    @property
    def calm(self) -> Residual:
        """What is left without steps at single moments, which are no noise."""
        return without_events(self.after, self.events)

    @property
    def kept_apart_by(self) -> Residual:
        """What tells whether the run is another experiment: what is left, or was where the effects made it worse.

        A run that the model fitted without them is none.
        """
        worse = rms(self.calm.values) > WORSE_PROCEDURE * rms(self.before.values)
        return self.before if worse else self.calm

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.after.piece.track.name


def before_and_after(
    track: Track, names: Set[str], ratio: float | None, fastest: float, before: Model, after: Model
) -> list[BeforeAfter]:
    """Give the residuals of a run of these `names` without and with the effects, at the full rate; of others none."""
    if track.name not in names:
        return []
    pieces = [kept for piece in pieces_of(track, ratio) for kept in up_to(piece, fastest)]
    return [BeforeAfter(residual_of(piece, before, after), residual_of(piece, after)) for piece in pieces]


def equations_of(
    sides: dict[str, list[BeforeAfter]], dut: Dut, model: Model, odd: Set[str]
) -> dict[str, EquationResult]:
    """Give the errors of every equation. `odd`: runs that are no replicates, whatever they are called."""
    found = {}
    known = [pair for pairs in sides.values() for pair in pairs]
    for equation in Equation:
        if not any(pair.after.piece.equation is equation for pair in known):
            continue
        replicates = [pair.calm for pair in known if pair.after.piece.equation is equation and pair.run not in odd]
        results = {}
        for side, pairs in sides.items():
            own = [pair for pair in pairs if pair.after.piece.equation is equation]
            results[side] = _errors_of(own, replicates, dut, model) if own else None
        found[equation.value] = EquationResult(equation.unit, results["held_out"], results["train"])
    return found


def _errors_of(pairs: Sequence[BeforeAfter], known: Sequence[Residual], dut: Dut, model: Model) -> Errors:
    by_procedure = {}
    floors: list[tuple[Floor, int]] = []
    complete = True
    for procedure in dict.fromkeys(pair.after.piece.track.procedure for pair in pairs):
        own = [pair for pair in pairs if pair.after.piece.track.procedure is procedure]
        floor = floor_of([pair.after for pair in own], known, dut, model)
        count = sum(pair.after.values.size for pair in own)
        complete = complete and floor is not None
        if floor is not None:
            floors.append((floor, count))
        by_procedure[procedure.value] = _pooled_errors(own, floor)
    whole = _pooled_errors(pairs, pooled(floors) if complete else None)
    return replace(whole, by_procedure=by_procedure)


def _pooled_errors(pairs: Sequence[BeforeAfter], floor: Floor | None) -> Errors:
    one, two = np.concatenate([p.before.values for p in pairs]), np.concatenate([p.after.values for p in pairs])
    return Errors(
        rms_before=rms(one),
        rms_after=rms(two),
        max_before=float(np.abs(one).max()),
        max_after=float(np.abs(two).max()),
        floor=None if floor is None else floor.rms,
        floor_ci95=None if floor is None else (floor.low, floor.high),
    )


def untested(equations: Mapping[str, EquationResult]) -> list[str]:
    """Say which procedures of which equation are fitted and tested by no run that was held out, or the reverse.

    `equations`: errors without the runs that are experiments of another kind.
    """
    found = []
    for name, item in equations.items():
        fitted, tested = ({} if side is None else side.by_procedure for side in (item.train, item.held_out))
        missing = [procedure for procedure in fitted if procedure not in tested]
        if missing:
            found.append(
                f"No held-out run of the same kind tests {name} in {', '.join(missing)}: nothing but the fitted runs "
                f"says how well the model does there. Hold one out with --held-out, or record one more."
            )
        unknown = [procedure for procedure in tested if procedure not in fitted]
        if unknown:
            found.append(
                f"No run that was fitted has {name} in {', '.join(unknown)}: what is left of the held-out ones says "
                f"nothing of the model. Hold fewer out, or record one more."
            )
    return found


def made_worse(equations: Mapping[str, EquationResult]) -> list[Open]:
    """Say where what was added makes the held-out runs worse: in an equation, or in one procedure of it."""
    found = []
    for name, item in equations.items():
        if item.held_out is None:
            continue
        if item.held_out.rms_after > WORSE * item.held_out.rms_before:
            found.append(_worse(name, None, item.held_out))
            continue
        found += [
            _worse(name, procedure, errors)
            for procedure, errors in item.held_out.by_procedure.items()
            if errors.rms_after > WORSE_PROCEDURE * errors.rms_before
            and (errors.floor_ci95 is None or errors.rms_after > errors.floor_ci95[1])
        ]
    return found


def _worse(equation: str, procedure: str | None, errors: Errors) -> Open:
    place: dict[str, Json] = {"equation": equation}
    if procedure is not None:
        place["procedure"] = procedure
    return Open(
        verdict=Verdict.UNTRACED,
        evidence={
            **place,
            "held_out_rms_before": errors.rms_before,
            "held_out_rms_after": errors.rms_after,
            "meaning": "what was added on the training runs makes the held-out runs worse",
        },
    )


def no_better(equations: Mapping[str, EquationResult]) -> list[str]:
    """Say that what was added lowers the held-out error of no equation."""
    tested = [item.held_out for item in equations.values() if item.held_out is not None]
    if not tested or any(errors.rms_after < errors.rms_before for errors in tested):
        return []
    return [
        "What was added lowers no held-out error. The fitted runs alone speak for it, unless the base model takes it "
        "up (a fixture that yields is a softer flexspline): hold out runs that show it, or record more."
    ]


def refuse_leaks(equations: Mapping[str, EquationResult], held_out: Sequence[Run], unlike: Set[str]) -> None:
    """Raise DataError where the held-out error lies below what noise alone leaves.

    The procedures are looked at apart only where one of them has no floor, and with it the whole none. `unlike`:
    equations of which one run of a pair leaves far more than the other, so that their floor is no noise.
    """
    looked_at = []
    for name, item in equations.items():
        if name in unlike:
            continue
        if item.held_out is not None and item.held_out.floor_ci95 is not None:
            looked_at.append((name, item.unit, item.held_out))
        elif item.held_out is not None:
            apart = item.held_out.by_procedure.items()
            looked_at += [(f"{name} in {procedure}", item.unit, errors) for procedure, errors in apart]
    for name, unit, found in looked_at:
        if found.floor_ci95 is not None and found.rms_after < found.floor_ci95[0]:
            raise DataError(
                ", ".join(run.name for run in held_out),
                f"the held-out error of {name} after the fit is {found.rms_after:.4g} {unit}, below the floor "
                f"of the instruments {found.floor_ci95[0]:.4g} to {found.floor_ci95[1]:.4g} {unit}",
                value=found.rms_after,
                expected="an error not below what noise alone leaves",
                hint="A channel that is predicted may leak into a regressor, or replicates are not replicates.",
            )
