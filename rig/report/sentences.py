"""The statement of a loop in one sentence, and the names of effects in words."""

from collections.abc import Sequence

from rig.loop.files.evidence_keys import expected_of
from rig.loop.result import above_floor, fitted_alone
from rig.report.loop_file import Equation, LoopFile, Open, Step
from rig.report.numbers import error_scale, scaled

WORSE = 0.02
"""Share by which an error must have grown to be called worse in the statement."""


def statement(loop: LoopFile, apart: Sequence[str] = ()) -> str:
    """Say what was found and what it did to the error of runs that took no part.

    `apart`: held-out runs of another kind, which the verdict does not count.
    """
    alone = fitted_alone(loop.equations)
    untested = f"; no held-out run tests {listed(alone, 'or')}" if alone else ""
    return f"{_finding(loop)}{not_counting(apart)}{_effect_on_errors(loop)}{untested}."


def not_counting(apart: Sequence[str]) -> str:
    """Say which held-out runs the verdict does not count; "" where it counts all."""
    return f", not counting {listed(apart)}, of another kind" if apart else ""


def effect_words(effect: str) -> str:
    """Give the id of an effect in words: a set as alternatives, an unnamed one by its variable and shape."""
    if effect.startswith("ambiguous:"):
        return " or ".join(effect_words(part) for part in effect.removeprefix("ambiguous:").split("|"))
    if effect.startswith("unnamed:"):
        _, variable, shape = (*effect.split(":"), "", "")[:3]
        return f"something {shape} in {variable} that no effect of the catalogue is"
    return effect


def listed(names: Sequence[str], word: str = "and") -> str:
    """Give names as in a sentence: a, b and c."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {word} {names[-1]}"


def place_of(item: Open) -> str:
    """Say of what an open statement speaks."""
    places = [str(item.evidence[key]) for key in ("equation", "procedure") if item.evidence.get(key)]
    return " in ".join(places) or listed(item.group, "or") or "this campaign"


def floor_remark(loop: LoopFile) -> str:
    """Say which errors lie above the floor's interval and are no statement; "" where none does."""
    held_out = {name: item.held_out for name, item in loop.equations.items() if item.held_out is not None}
    return above_floor(held_out, [item.evidence for item in loop.open])


def largest_drop(loop: LoopFile) -> str | None:
    """Give the equation whose held-out error fell most, None where none is known before and after."""
    falls = {name: fall for name, item in loop.equations.items() if (fall := _fall(item)) is not None}
    return max(falls, key=lambda name: falls[name]) if falls else None


def _finding(loop: LoopFile) -> str:
    added = [effect_words(step.effect) for step in loop.steps]
    match loop.verdict:
        case "none":
            return "Nothing is missing as far as these runs tell: what is left is noise"
        case "absorbed":
            return _absorbed(loop)
        case "uncontrolled":
            left = listed(_open_equations(loop)) or "the error"
            found = f", after adding {listed(added)}," if added else ""
            return f"What is left of {left}{found} does not repeat: single events, or something that is not held"
        case "untraced":
            found = f", after adding {listed(added)}," if added else ""
            return (
                f"What is left of {listed(_open_equations(loop)) or 'the error'}{found} could not be traced to a cause"
            )
        case "ambiguous":
            sets = [effect_words(step.effect) for step in loop.steps if step.verdict == "ambiguous"]
            sets += [listed(item.group, "or") for item in loop.open if item.verdict == "ambiguous"]
            others = [effect_words(step.effect) for step in loop.steps if step.verdict != "ambiguous"]
            also = f"; besides it lacks {listed(others)}" if others else ""
            return f"The model lacks {listed(sets)}: these runs cannot tell which{also}"
        case _:
            return f"The model lacks {listed(added) or 'something'}"


def _absorbed(loop: LoopFile) -> str:
    item = next((item for item in loop.open if item.verdict == "absorbed"), None)
    if item is None or item.parameter is None or item.deviation is None:
        return "A base parameter is away from its catalogue value, and several causes could have moved it"
    side = "below" if item.deviation < 0.0 else "above"
    causes = f": {listed(item.group, 'or')} could have moved it" if item.group else ""
    return f"{item.parameter} is {100.0 * abs(item.deviation):.1f} % {side} {expected_of(item.parameter)}{causes}"


def _effect_on_errors(loop: LoopFile) -> str:
    held = len(loop.runs.held_out)
    untraced = [name for name in _open_equations(loop) if name in loop.equations]
    name = untraced[0] if untraced and not loop.steps else largest_drop(loop)
    if name is None:
        return ""
    found = loop.equations[name].held_out
    if found is None:
        return ""
    unit, scale = error_scale(loop.equations[name].unit)
    runs = f"{held} held-out run{'s' if held != 1 else ''}"
    floor = f" (noise alone leaves {scaled(found.floor, scale, 3)} {unit})" if found.floor is not None else ""
    before, after = scaled(found.rms_before, scale, 3), scaled(found.rms_after, scale, 3)
    if not loop.steps:
        return f"; on {runs} the error of {name} is {after} {unit} rms{floor}"
    way = "falls" if (found.rms_after or 0.0) < (found.rms_before or 0.0) else "goes"
    worse = [_rise(other, loop.equations[other]) for other in loop.equations if _is_worse(loop.equations[other])]
    but = f", but that of {listed(worse)}" if worse else ""
    return f"; on {runs} the error of {name} {way} from {before} to {after} {unit} rms{floor}{but}"


def _open_equations(loop: LoopFile) -> list[str]:
    """Give the equations of which the campaign's verdict is said, each once."""
    told = [item.evidence.get("equation") for item in loop.open if item.verdict == loop.verdict]
    return list(dict.fromkeys(one for names in told if isinstance(names, str) for one in names.split(", ")))


def _is_worse(item: Equation) -> bool:
    fall = _fall(item)
    return fall is not None and fall < -WORSE


def _rise(name: str, item: Equation) -> str:
    unit, scale = error_scale(item.unit)
    found = item.held_out
    if found is None:
        return name
    return f"{name} rises from {scaled(found.rms_before, scale, 3)} to {scaled(found.rms_after, scale, 3)} {unit}"


def _fall(item: Equation) -> float | None:
    found = item.held_out
    if found is None or not found.rms_before or found.rms_after is None:
        return None
    return 1.0 - found.rms_after / found.rms_before


def title_of(step: Step) -> str:
    """Give the heading of a step."""
    words = effect_words(step.effect)
    return words[0].upper() + words[1:] if step.effect.startswith("unnamed:") else words
