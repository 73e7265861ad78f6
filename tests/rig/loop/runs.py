"""Campaigns for the loop's tests: logs of the independent generator, and a few written in closed form."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut, default_dut
from rig.config.toml_file import parse_toml
from rig.log.run import ProcedureName, Run
from tests.independent.campaign import Campaign, Recording, held_out

Floats = NDArray[np.float64]


def dut(text: str | None = None) -> Dut:
    return default_dut()[0] if text is None else parse_toml(text, Dut, "test")


def make_run(
    name: str,
    procedure: str,
    time: Floats,
    signals: Mapping[str, Floats],
    replicate: str | None = None,
    metadata: Mapping[str, str] | None = None,
) -> Run:
    return Run(
        name=name,
        file=Path(f"{name}.csv"),
        procedure=ProcedureName(procedure),
        time=time,
        signals=MappingProxyType(dict(signals)),
        replicate=replicate,
        metadata=MappingProxyType(dict(metadata or {})),
    )


def as_run(recording: Recording) -> Run:
    return make_run(
        recording.name, recording.procedure, recording.time, recording.columns, replicate=recording.replicate
    )


def runs_of(campaign: Campaign) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Give the runs, and the names that the generator suggests to hold out."""
    recordings = campaign.recordings()
    return tuple(as_run(recording) for recording in recordings), held_out(recordings)


def turning_run(name: str, seed: int, speed: float = 20.0, ratio: float = 100.0, **signs: float) -> Run:
    """Turn both ways at one speed; ideal gear, Coulomb friction 12 mN*m; `signs` multiply signals by name."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 24.0, 0.01)
    velocity = np.interp(time, [0, 1, 1.2, 12, 12.2, 12.4, 23.2, 23.4, 24], [0, 0, 1, 1, 0, -1, -1, 0, 0]) * speed
    angle = np.cumsum(velocity) * 0.01
    signals = {
        "motor_position": angle,
        "output_position": -angle / ratio + 3e-6 * rng.standard_normal(time.size),
        "motor_torque": 0.012 * np.sign(velocity) + 2e-4 * rng.standard_normal(time.size),
        "output_torque": 0.02 * rng.standard_normal(time.size),
    }
    return make_run(name, "free-run", time, {k: signs.get(k, 1.0) * v for k, v in signals.items()})
