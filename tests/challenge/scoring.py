"""An answer of the loop against the truth: naming, parameters, held-out error, silence. Reads frozen answers only."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.challenge.cases import EVENT, Case
from tests.challenge.expected import Expected, expected_of
from tests.challenge.sizes import Errors, Hidden
from tests.independent.laws import Drive
from tests.independent.terms import Effects

Answer = Mapping[str, Any]
"""What `loop.json` says, and `base`: the base parameters of `model.json`; or `error`, where the loop refused."""

NEAR_ORACLE = 1.05
"""Times the oracle's error that is allowed on the held-out runs."""

NOT_WORSE = 1.02
"""Times the error before: a little more than the sampling error of an rms of 2500 independent values, 1.4 %."""

RIGHT, SET, EXTRA, ABSORBED, WRONG, MISSED, FAILED = "right", "in set", "extra", "absorbed", "wrong", "missed", "error"
"""How an answer is called."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One interval against the truth; `of`: effect id or `base`."""

    of: str
    name: str
    truth: float
    value: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth; a phase does so up to whole turns."""
        truth = self.truth
        if self.name.startswith("phase"):
            truth += 2.0 * math.pi * round((self.value - truth) / (2.0 * math.pi))
        return self.low <= truth <= self.high


def score(case: Case, hidden: Hidden, oracle: Errors, without: Errors, answer: Answer) -> dict[str, Any]:
    """Give everything that is counted of one case, as JSON can hold it.

    oracle, without: held-out errors of one who knows everything, and of the campaign in which nothing is hidden.
    """
    expected = expected_of(case)
    if "error" in answer:
        return {"naming": FAILED, "found": [], "parameters": [], "error": answer["error"]}
    naming, found = naming_of(expected, answer)
    # The simulated bench's friction acts in another place than the fit's, and not all of it is in its device file.
    # Beside a curve over the torque the base's stiffness is no quantity of its own.
    base = case.family != "bench" and case.outside is None
    parameters = parameters_of(case.drive, hidden.effects, answer, naming, base=base)
    return {
        "naming": naming,
        "found": found,
        "added": list(answer["effects"]),
        "verdict": answer["verdict"],
        "parameters": [vars_of(item) for item in parameters],
        "after_over_oracle": _over(oracle, answer),
        "after_over_without": _over(without, answer),
        "after_over_before": _over_before(answer),
    }


def naming_of(expected: Expected, answer: Answer) -> tuple[str, list[str]]:
    """Give what the answer is called, and which of the hidden effects it holds, by name or in a set."""
    added = [_members(step) for step in answer["steps"]]
    absorbed = [frozenset(item["group"]) for item in answer["open"] if item["verdict"] == "absorbed"]
    if expected.variables:
        return _outside_naming(expected, answer), []
    names = expected.names
    if not names:
        return (RIGHT if not added and answer["verdict"] == "none" else WRONG), []
    if expected.nothing_added:
        silent = not added and any(item["verdict"] == "uncontrolled" for item in answer["open"])
        return (RIGHT if silent else MISSED if not added else WRONG), []
    found = sorted(name for name in names if any(name in members for members in added))
    others = [members for members in added if not members & (names | expected.companions)]
    if not added and any(names <= group for group in absorbed):
        return (RIGHT if expected.set_is_right else ABSORBED), sorted(names)
    if not found:
        return (WRONG if added else MISSED), found
    if expected.set_only and any(members == names for members in added):
        return WRONG, found
    if others:
        return EXTRA, found
    if len(found) < len(names):
        return MISSED, found
    in_set = [name for name in found if not any(members == {name} for members in added)]
    return (SET if in_set and not expected.set_is_right else RIGHT), found


def _members(step: Mapping[str, Any]) -> frozenset[str]:
    return frozenset(step["set"]) if step["set"] else frozenset({step["effect"]})


def _outside_naming(expected: Expected, answer: Answer) -> str:
    """Right: a step has variable and shape, or is called what is the same; no step gives a name that is wrong."""
    steps = answer["steps"]
    if not steps:
        return MISSED
    right = [step for step in steps if _describes(expected, step)]
    wrong = [s for s in steps if not _describes(expected, s) and not s["effect"].startswith("unnamed:")]
    if right and not wrong:
        return RIGHT if len(right) == len(steps) else EXTRA
    return WRONG


def _describes(expected: Expected, step: Mapping[str, Any]) -> bool:
    members = _members(step)
    if members & expected.same_as:
        return True
    unnamed = step["effect"].startswith("unnamed:")
    return unnamed and step["variable"] in expected.variables and step["shape"] in expected.shapes


def parameters_of(
    drive: Drive, hidden: Sequence[Effects], answer: Answer, naming: str, *, base: bool = True
) -> list[Parameter]:
    """Give every interval of the effects that were named and, where all is right and named, of the base parameters.

    `base`: whether the drive's base parameters are known to be the answer's.
    """
    found, named = [], set()
    for effects in hidden:
        effect = effects.ids()[0]
        step = next((s for s in answer["steps"] if s["effect"] == effect), None)
        if step is None:
            continue
        named.add(effect)
        for name, truth in truth_of(effects, step["parameters"]).items():
            found += _parameter(effect, name, truth, step["parameters"].get(name))
    if base and naming == RIGHT and named == {e.ids()[0] for e in hidden}:
        for name, truth in base_truth(drive, hidden, answer).items():
            found += _parameter("base", name, truth, answer["base"].get(name))
    return found


def _parameter(of: str, name: str, truth: float, estimate: Mapping[str, Any] | None) -> list[Parameter]:
    if estimate is None or estimate["ci95"] is None:
        return []
    return [Parameter(of, name, truth, estimate["value"], *estimate["ci95"])]


def truth_of(effects: Effects, estimated: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Give the true parameters in the frame of the loop: lines by size, at the reference and full scale it takes."""
    (effect,) = effects.ids()
    instances = sorted((dict(values) for values in effects.of(effect)), key=lambda v: -abs(v.get("amplitude", 0.0)))
    truth = dict(instances[0])
    for rank, further in enumerate(instances[1:], start=2):
        truth |= {f"{name}_{rank}": value for name, value in further.items()}
    if effect == "torque-sensor-nonlinearity":
        shrunk = estimated["full_scale"]["value"] / truth["full_scale"]
        truth |= {"even": truth["even"] * shrunk**2, "odd": truth["odd"] * shrunk**3}
    if effect == "temperature-dependent-stiffness":
        a = truth["amplitude"]
        truth["amplitude"] = a / (1.0 + a * (estimated["reference"]["value"] - truth["reference"]))
    return truth


def base_truth(drive: Drive, hidden: Sequence[Effects], answer: Answer) -> dict[str, float]:
    """Give the true base parameters; what depends on the temperature, at the reference that the loop takes."""
    truth = {name: getattr(drive, name) for name in ("K_F0", "C_F", "K_w0", "C_w", "T_fs", "T_fb", "T_c", "b")}
    for effects in hidden:
        (effect,) = effects.ids()
        if not effect.startswith("temperature-dependent-"):
            continue
        (values,) = effects.of(effect)
        step = next(s for s in answer["steps"] if s["effect"] == effect)
        warmer = step["parameters"]["reference"]["value"] - values["reference"]
        if effect == "temperature-dependent-stiffness":
            truth["K_F0"] /= 1.0 + values["amplitude"] * warmer
        else:
            thinner = math.exp(-values["amplitude"] * warmer)
            truth |= {name: thinner * truth[name] for name in ("T_fs", "T_fb", "T_c", "b")}
    return truth


def vars_of(item: Parameter) -> dict[str, Any]:
    """Give an interval as JSON."""
    return {
        "of": item.of,
        "name": item.name,
        "truth": item.truth,
        "value": item.value,
        "ci95": [item.low, item.high],
        "inside": item.inside,
    }


def _over(oracle: Errors, answer: Answer) -> dict[str, float]:
    held_out = {name: item["held_out"] for name, item in answer["equations"].items() if item["held_out"] is not None}
    return {name: errors["rms_after"] / oracle[name] for name, errors in held_out.items() if name in oracle}


def _over_before(answer: Answer) -> dict[str, float]:
    held_out = {name: item["held_out"] for name, item in answer["equations"].items() if item["held_out"] is not None}
    return {name: errors["rms_after"] / errors["rms_before"] for name, errors in held_out.items()}


def can_reach_oracle(ids: Sequence[str]) -> bool:
    """Whether a term could bring the error to the oracle's: not that of an event."""
    return EVENT not in ids
