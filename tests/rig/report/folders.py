"""Folders as `rig loop` writes them, small and made by hand, whatever the names in them."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

HOSTILE = (
    "<script>window.pwned=1;alert(1)</script>",
    '"><img src=x onerror="window.pwned=2">',
    "'-alert(3)-'",
    "</script><script>window.pwned=4</script>",
    "</title></style><svg onload=alert(5)>",
    "javascript:alert(6)",
    "line\u2028and\u2029paragraph\u202eturned\x00cut",
    "half a \ud800 pair",
    "https://example.com/x.png",
    "{{7*7}} ${7*7} `x` &lt;b&gt;",
)
"""Names that would do something if they were taken for markup."""

ERRORS = {
    "rms_before": 2.4e-5,
    "rms_after": 4.0e-6,
    "max_before": 6e-5,
    "max_after": 1.6e-5,
    "floor": 3.9e-6,
    "floor_ci95": [3.4e-6, 4.4e-6],
}


def loop_content(name: str = "x", **changes: Any) -> dict[str, Any]:
    """Give the content of loop.json in which every foreign text is `name`."""
    run = f"run {name}"
    step = {
        "verdict": "named",
        "effect": "kinematic-error",
        "set": [],
        "variable": "motor_position",
        "shape": "periodic",
        "lines": [{"order": 2.0, "amplitude": 3.4e-5, "phase": 0.5}],
        "equation": "torsion",
        "parameters": {
            "amplitude": {"value": 3.4123e-5, "ci95": [3.38e-5, 3.44e-5], "unit": "rad"},
            name: {"unit": name},
        },
        "candidates": [
            {
                "effect": "kinematic-error",
                "variable": "motor_position",
                "enters": "torsion",
                "order": 2.0,
                "gain": 2000.0,
                "p_value": 1e-20,
            },
            {
                "effect": "kinematic-error",
                "variable": "motor_position",
                "enters": "torsion",
                "order": 2.5,
                "gain": 200.0,
                "p_value": 1.0,
            },
            {"effect": name, "gain": 20.0, "p_value": 1.0},
        ],
        "p_value": 1e-20,
        "held_out": {},
        "shift": {"K_F0": {"from": 8200.0, "to": 8330.0, "unit": "N*m/rad"}},
        "next_experiment": None,
    }
    statement = {
        "verdict": "untraced",
        "group": [name],
        "parameter": None,
        "deviation": None,
        "times": [1.5],
        "evidence": {
            "equation": name,
            "procedure": name,
            "meaning": name,
            "rho": 0.7,
            name: [name, None, {name: True}],
        },
        "next_experiment": {
            "why": f"because {name}",
            "command": f"rig run free-run --set free-run.turns=2 # {name}",
            "expected_separation_sigma": 4.5,
            "minutes": 3.0,
        },
    }
    held = {**ERRORS, "by_procedure": {"free-run": ERRORS, name: ERRORS}}
    content = {
        "schema": "rig.loop/1",
        "runs": {"train": [run, "b"], "held_out": ["c"]},
        "verdict": "untraced",
        "effects": ["kinematic-error"],
        "equations": {
            "torsion": {"unit": "rad", "held_out": held, "train": held},
            name: {"unit": name, "held_out": None, "train": None},
        },
        "steps": [step],
        "open": [statement],
        "warnings": [f"A warning about {name}.", f"Found, not added: {name}."],
        "elapsed_s": 12.3,
    }
    return {**content, **changes}


def model_content(name: str = "x") -> dict[str, Any]:
    """Give the content of model.json."""
    return {
        "schema": "rig.model/1",
        "dut": {"name": name, "gear": {"ratio": 100.0, "rotation": "opposed", name: name}, "motor": {}},
        "base": {
            "model": "zhang-2014",
            "ratio": 100.0,
            "parameters": {"K_F0": {"value": 8330.0, "ci95": [8310.0, 8350.0], "unit": "N*m/rad"}},
        },
        "runs": [f"run {name}", "b"],
        "software": f"harmonic-rig {name}",
    }


def views_content(name: str = "x") -> dict[str, Any]:
    """Give the content of views.json: one plot of each kind."""
    turn = [2.0 * math.pi * k / 200 for k in range(200)]
    before = [3e-5 * math.sin(2.0 * x) for x in turn]
    after = [2e-6 * math.sin(37.0 * x) for x in turn]
    torque = [12.0 * math.sin(x) for x in turn]
    torsion = [1e-4 * t + 1e-4 * math.cos(x) for t, x in zip(torque, turn, strict=True)]
    orders = [0.1 * 1.02**k for k in range(300)]
    amplitude = [1e-6 + 3e-5 / (1.0 + 1e4 * (order - 2.0) ** 2) for order in orders]
    place = {"equation": "torsion", "unit": "rad", "side": "held_out", "runs": [f"run {name}", "c"]}
    facts = {"samples": 1000, "seconds": 10.0, "procedure": "free-run"}
    return {
        "schema": "rig.views/1",
        "runs": [
            {**facts, "name": f"run {name}", "side": "train", "operator": name, "bench": name, "status": name},
            {**facts, "name": "b", "side": "train"},
            {**facts, "name": "c", "side": "held_out", "started": "2026-01-01"},
        ],
        "residuals": [
            {
                **place,
                "procedure": "free-run",
                "variable": "motor_position",
                "variable_unit": "rad",
                "effects": ["kinematic-error"],
                "order": 1.0,
                "samples": 50000,
                "rms_before": 2.1e-5,
                "rms_after": 1.4e-6,
                "x": turn,
                "before": before,
                "after": after,
                "means": {"x": turn[::10], "before": before[::10], "after": after[::10]},
            },
            {
                **place,
                "procedure": name,
                "variable": f"aux_{name}",
                "variable_unit": name,
                "samples": 200,
                "rms_before": 2.1e-5,
                "rms_after": 1.4e-6,
                "x": turn,
                "before": before,
                "after": after,
            },
        ],
        "cycles": [
            {
                **place,
                "procedure": "locked-output",
                "left_out": 2,
                "variable": "output_torque",
                "variable_unit": "N*m",
                "stretches": [
                    {"run": name, "x": torque, "measured": torsion, "before": torsion, "after": torsion},
                ],
            }
        ],
        "spectra": [
            {
                **place,
                "procedure": "free-run",
                "variable": "motor_position",
                "lines": [2.0],
                "orders": orders,
                "before": amplitude,
                "after": [1e-6] * 300,
            }
        ],
    }


def write_folder(
    folder: Path, name: str = "x", loop: Mapping[str, Any] | None = None, views: Mapping[str, Any] | None = None
) -> Path:
    """Write the three files of a loop; give the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = {
        "loop.json": loop if loop is not None else loop_content(name),
        "model.json": model_content(name),
        "views.json": views if views is not None else views_content(name),
    }
    for file, content in contents.items():
        (folder / file).write_text(json.dumps(content))
    return folder
