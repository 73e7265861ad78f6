"""A simulated bench that hides an effect, and a technician who types what the loop says: everything over the CLI."""

import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from rig.cli import app
from rig.config.dut import default_dut
from rig.loop.files.model_file import Model, ModelBase, ModelEffect, ModelEstimate, ModelLine
from rig.loop.files.model_storage import write_model
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import entry_of, is_line
from sim_backend.model.effects import CATALOGUE


def rig(*words: object) -> str:
    answer = CliRunner().invoke(app, [str(word) for word in words])
    assert answer.exit_code == 0, answer.stderr
    return answer.output


def truth(folder: Path, effect: str, **values: float) -> Path:
    """Write the model of a drive that follows its catalogue and has one effect, at its typical size beside `values`."""
    entry, dut = CATALOGUE[effect], default_dut()[0]
    known = {p.name: values.get(p.name, p.typical) for p in entry.parameters}
    if is_line(entry):
        line = ModelLine(order=known.get("order", 1.0), amplitude=known["amplitude"], phase=known["phase"])
        hidden = ModelEffect(
            effect=effect,
            enters=entry_of(entry).value,
            variable=entry.variable,
            shape=entry.shape.value,
            lines=(line,),
            parameters={},
        )
    else:
        kind = ShapeClass(CATALOGUE[effect])
        given = {p.name: ModelEstimate(value=known[p.name], unit=p.unit) for p in entry.parameters}
        hidden = ModelEffect(
            effect=effect, enters=kind.enters, variable=kind.variable, shape=kind.shape, parameters=given
        )
    base = ModelBase(model="zhang-2014", ratio=dut.gear.ratio, parameters={})
    file = folder / "truth.json"
    write_model(
        Model.model_validate({"schema": "rig.model/1", "dut": dut, "base": base, "effects": (hidden,), "software": ""}),
        file,
    )
    return file


def record(model: Path, command: str, seed: int, logs: Path) -> None:
    """Type a command of `rig run` at the bench that the model describes."""
    rig(*shlex.split(command)[1:], "--model", model, "--seed", seed, "-o", logs)


def loop(logs: Sequence[Path], out: Path) -> dict[str, Any]:
    """Close the loop over all logs; give the content of `loop.json`."""
    rig("loop", *logs, "-o", out)
    found: dict[str, Any] = json.loads((out / "loop.json").read_text())
    return found
