"""Answers of a loop, written by hand for the tests of the scoring."""

from collections.abc import Mapping, Sequence
from typing import Any

BASE = {
    "K_F0": 8336.0,
    "C_F": 0.0449,
    "K_w0": 1.333,
    "C_w": 83.3,
    "T_fs": 0.012,
    "T_fb": 2.0,
    "T_c": 0.012,
    "b": 1e-4,
}


def estimate(value: float, half: float) -> dict[str, Any]:
    return {"value": value, "ci95": [value - half, value + half], "unit": "1"}


def step(
    effect: str,
    members: Sequence[str] = (),
    variable: str = "output_torque",
    shape: str = "static",
    parameters: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    shown = "ambiguous:" + "|".join(members) if members else effect
    return {
        "effect": shown,
        "set": list(members),
        "variable": variable,
        "shape": shape,
        "parameters": dict(parameters or {}),
        "equation": "torsion",
        "p_value": 1e-9,
        "lines": [],
        "verdict": "ambiguous" if members else "named",
    }


def answer(
    *steps: dict[str, Any],
    verdict: str | None = None,
    statements: Sequence[tuple[str, Sequence[str]]] = (),
    after: float = 1.0,
    before: float = 2.0,
) -> dict[str, Any]:
    """Give an answer; `statements`: verdict and group of what stays open; errors of the torsion in urad."""
    errors = {"rms_before": before * 1e-6, "rms_after": after * 1e-6}
    return {
        "verdict": verdict or (steps[0]["verdict"] if steps else "none"),
        "effects": [item["effect"] for item in steps],
        "steps": list(steps),
        "open": [{"verdict": name, "group": list(group), "evidence": {}} for name, group in statements],
        "equations": {"torsion": {"held_out": errors, "train": errors}},
        "base": {name: estimate(value, 0.01 * value) for name, value in BASE.items()},
        "warnings": [],
        "elapsed_s": 1.0,
    }
