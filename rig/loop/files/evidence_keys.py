"""The keys of an open statement's evidence: in words, with unit and meaning, as table, report and page say them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeVar, cast

T = TypeVar("T")

OF_EQUATION = "of the equation"
"""Unit of an error: that of the equation, which the result names."""

OF_STATEMENT = "named beside it"
"""Unit of a parameter: the statement's own key `unit`."""


@dataclass(frozen=True, slots=True)
class Key:
    """What a key is called, its unit, "" for none, and what it says."""

    words: str
    unit: str
    meaning: str


KEYS: Mapping[str, Key] = MappingProxyType(
    {
        "rho": Key("correlation of replicates", "1", "of their residuals, smoothed: near 0 for noise, 1 what repeats"),
        "replicate_pairs": Key("replicate pairs", "1", "pairs of runs that repeat the same conditions"),
        "rms_repeating": Key("rms that repeats", OF_EQUATION, "what the runs of a pair share"),
        "rms_not_repeating": Key("rms that does not repeat", OF_EQUATION, "what they do not share"),
        "rms_slow": Key("slow rms", OF_EQUATION, "rms of the residual's means over 0.5 s, in which noise averages out"),
        "rms_slow_not_repeating": Key("slow rms that does not repeat", OF_EQUATION, "of it what a pair does not share"),
        "rms_slow_of_noise": Key("slow rms of noise alone", OF_EQUATION, "what noise and counts leave in it"),
        "rms_slow_of_others": Key("slow rms of the other runs", OF_EQUATION, "the median of the other runs"),
        "ljung_box_per_lag": Key(
            "memory (Ljung-Box per lag)", "1", "how the residual at 10 Hz follows itself: about 1 for white noise"
        ),
        "frequency": Key("frequency", "Hz", "of a hum over the time"),
        "amplitude": Key("amplitude", OF_EQUATION, "of the hum"),
        "legs": Key("legs", "1", "stretches of one speed, or sweeps, out of whose noise it stands"),
        "share_of_squares": Key("share of the squares", "1", "what such a shape would explain of them"),
        "p_value": Key("chance of noise", "1", "that noise alone would look so, in this one test"),
        "looks_like": Key("looks like", "", "effects that the residual resembles, without passing the tests"),
        "held_out_rms_before": Key("held-out rms before", OF_EQUATION, "error of the base model on held-out runs"),
        "held_out_rms_after": Key("held-out rms after", OF_EQUATION, "the same with what was added"),
        "rms_after": Key("rms after", OF_EQUATION, "error of held-out runs, single outliers counted up to 5 sigma"),
        "floor_high": Key(
            "upper end of the floor", OF_EQUATION, "of its 95 % interval, with what smoothing and plays carry on"
        ),
        "fitted": Key("fitted", OF_STATEMENT, "value of the parameter"),
        "catalogue": Key("catalogue", OF_STATEMENT, "value that the device file gives"),
        "unit": Key("unit", "", "of the values beside it"),
        "run": Key("run", "", "the run in question"),
        "odd_runs": Key("odd runs", "", "runs with events, or that leave far more than the others, the oddest first"),
        "speeds": Key("speeds of its own", "rad/s", "at which no other run was made"),
        "events": Key("events", "s, counts, rad", "run, time, size in encoder counts and at the output"),
        "channels": Key("further channels", "1", "correlation with channels that no term uses, and its p-value"),
        "replicates": Key("replicates", "", "what the replicates of the run do"),
        "missing": Key("missing", "", "what the campaign lacks to tell"),
    }
)
"""By key; beside them stand `equation`, `procedure` and the sentence `meaning`."""


def words_of(key: str) -> str:
    """Give a key in words."""
    return KEYS[key].words if key in KEYS else key.replace("_", " ")


def in_words(evidence: Mapping[str, T], of_equation: tuple[str, float]) -> list[tuple[str, str, T, str]]:
    """Give key, words, value and unit of everything that is known; `of_equation`: unit of its errors, its size in it.

    The key `unit` is told by the others, unless it stands for several equations.
    """
    shown, scale = of_equation
    own, found = str(evidence.get("unit") or ""), []
    for key, value in evidence.items():
        unit = KEYS[key].unit if key in KEYS else ""
        error = unit == OF_EQUATION
        if value is None or value == [] or (key == "unit" and "," not in own):
            continue
        said = {OF_EQUATION: shown, OF_STATEMENT: own}.get(unit, unit if unit in ("rad/s", "Hz") else "")
        found.append((key, words_of(key), _scaled(value, scale) if error and shown else value, said))
    return found


def _scaled(value: T, scale: float) -> T:
    """Scale a number, or every number of a list."""
    if isinstance(value, list):
        return cast("T", [_scaled(part, scale) for part in value])
    return cast("T", value * scale) if isinstance(value, float) else value


def meaning_of_key(key: str) -> str | None:
    """Say what a key says, None of one that is not known."""
    return KEYS[key].meaning if key in KEYS else None


def expected_of(parameter: str) -> str:
    """Give what a parameter is said to be off: its catalogue value, or 1 if it is the ratio of two channels."""
    return "1" if " / " in parameter else "its catalogue value"
