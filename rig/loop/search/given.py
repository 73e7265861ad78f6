"""What the model file that a search starts from has decided already: its effects, as steps that are there."""

from rig.loop.files.model_file import Model as ModelFile
from rig.loop.model.prediction import Model
from rig.loop.result import Verdict
from rig.loop.search.decision import Decision

SET = "ambiguous:"


def given_decisions(file: ModelFile | None, start: Model) -> tuple[Decision, ...]:
    """Give the decisions about the effects of a model file. `start`: the model with its terms in the file's order."""
    if file is None:
        return ()
    lines, shapes = iter(start.lines), iter(start.shapes)
    found = []
    for effect in file.effects:
        own = [next(lines) for _ in effect.lines]
        kind = own[0].kind if own else next(shapes).kind
        members = tuple(effect.effect.removeprefix(SET).split("|")) if effect.effect.startswith(SET) else ()
        named = Verdict.NAMED if kind.effect else Verdict.UNNAMED
        verdict = Verdict.AMBIGUOUS if members else named
        found.append(Decision(kind, verdict, members, (), 1.0, tuple(line.order for line in own), given=True))
    return tuple(found)
