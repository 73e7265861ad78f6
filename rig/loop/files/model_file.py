"""The content of `model.json` (schema `rig.model/1`): device, base model, effects, runs, version."""

import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from pydantic import Field

from rig.config.dut import Dut, Ratio
from rig.config.toml_file import FileModel, Number
from sim_backend.model.compliance import Compliance


class ModelEstimate(FileModel):
    """A value with its 95 % interval (null: none) and unit."""

    value: Number
    ci95: tuple[Number, Number] | None = Field(default=None, strict=False)
    unit: str


class ModelLine(FileModel):
    """One line: cycles per revolution of the variable, amplitude in the term's unit, phase rad."""

    order: Number
    amplitude: Number
    phase: Number


class ModelEffect(FileModel):
    """One effect: id, where it acts, its variable and lines, and its parameters with intervals."""

    effect: str
    enters: str
    variable: str
    shape: str
    lines: tuple[ModelLine, ...] = Field(default=(), strict=False)
    parameters: dict[str, ModelEstimate]


BaseName = Literal["zhang-2014", "zhang-2014-cubic", "zhang-2014-piecewise"]

BASE_MODELS: Mapping[Compliance, BaseName] = MappingProxyType(
    {
        Compliance.ARCTAN: "zhang-2014",
        Compliance.CUBIC: "zhang-2014-cubic",
        Compliance.PIECEWISE: "zhang-2014-piecewise",
    }
)
"""Names of the base models by the law of their flexspline."""


class ModelBase(FileModel):
    """Base model by name, ratio (null: unknown) and parameters.

    `zhang-2014`: compliance (24), (27) and play friction of Zhang, Ahmad & Liu 2014, with Coulomb and viscous running
    friction; `-cubic` and `-piecewise` have (10) and (11) in place of (24).
    """

    model: BaseName
    ratio: Ratio | None
    parameters: dict[str, ModelEstimate]

    @property
    def law(self) -> Compliance:
        """The law of the flexspline."""
        return next(law for law, name in BASE_MODELS.items() if name == self.model)


class Model(FileModel):
    """The content of `model.json`."""

    schema_: Literal["rig.model/1"] = Field(alias="schema")
    dut: Dut
    base: ModelBase
    effects: tuple[ModelEffect, ...] = Field(default=(), strict=False)
    runs: tuple[str, ...] = Field(default=(), strict=False)
    software: str

    def dut_text(self) -> str:
        """Give the device as the text of a dut file."""
        lines = [f"name = {json.dumps(self.dut.name)}"]
        for table, content in self.dut.model_dump(mode="json", exclude={"name"}, exclude_none=True).items():
            lines.append(f"[{table}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in content.items()]
        return "\n".join(lines) + "\n"
