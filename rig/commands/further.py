"""The next experiment as it is to be typed: where its logs go, on which bench, and the loop over old and new logs."""

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rig.config.bench import load_bench
from rig.config.dut import Dut, default_dut
from rig.config.toml_file import parse_toml
from rig.log.load import logs_in
from rig.log.names import NEXT_FOLDER
from rig.log.run import Run
from rig.loop.result import LoopResult, NextExperiment
from rig.provenance import MODEL_MARK

BENCH_PLACE, DUT_PLACE, MODEL_PLACE = "BENCH.toml", "DUT.toml", "MODEL.json"
"""Stand in a command for files whose path no log tells."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What `rig loop` was asked: the logs, the device file, and its further options as they are typed.

    `model`: what the simulated bench ran, where that is known.
    """

    paths: tuple[Path, ...]
    dut: Path | None = None
    options: tuple[str, ...] = ()
    model: Path | None = None


def with_commands(result: LoopResult, runs: Sequence[Run], asked: Asked) -> LoopResult:
    """Complete every command of a next experiment, and add the loop over old and new logs that follows it."""
    where, said = _places(runs, asked)
    told = [*(step.next_experiment for step in result.steps), *(item.next_experiment for item in result.open)]
    folders = _folders(_beside(asked.paths), dict.fromkeys(item.command for item in told if item and item.command))

    def completed(found: NextExperiment | None) -> NextExperiment | None:
        if found is None or not found.command:
            return found
        out = folders[found.command]
        again = [*map(str, _shortest(asked.paths)), str(out), *where.of_loop, *asked.options, "-o", str(out / "loop")]
        return replace(
            found,
            why=" ".join([found.why, *said]),
            command=f"{found.command} {shlex.join([*where.of_run, '-o', str(out)])}",
            then=f"rig loop {shlex.join(again)}",
        )

    return replace(
        result,
        steps=tuple(replace(step, next_experiment=completed(step.next_experiment)) for step in result.steps),
        open=tuple(replace(item, next_experiment=completed(item.next_experiment)) for item in result.open),
    )


@dataclass(frozen=True, slots=True)
class _Places:
    """The words that name bench and device, for `rig run` and for `rig loop`."""

    of_run: tuple[str, ...]
    of_loop: tuple[str, ...]


def _places(runs: Sequence[Run], asked: Asked) -> tuple[_Places, tuple[str, ...]]:
    """Give the words that name bench and device, and what is to be said of those that stand for a file."""
    benches = {run.bench_text for run in runs}
    bench: tuple[str, ...] = () if asked.model is None else ("--model", str(asked.model))
    said: tuple[str, ...] = ()
    ran = [backend for backend in sorted({run.metadata.get("backend", "") for run in runs}) if MODEL_MARK in backend]
    if ran and asked.model is None:
        bench = ("--model", MODEL_PLACE)
        said = (f"{MODEL_PLACE} stands for the model that the bench ran: {'; '.join(ran)}.",)
    if benches != {load_bench("sim")[1]}:
        bench = (*bench, "--bench", BENCH_PLACE)
        which = "none" if benches == {""} else "another than the simulated one"
        said += (f"{BENCH_PLACE} stands for your bench's file: the logs name {which}.",)
    device: tuple[str, ...] = ()
    if asked.dut is not None:
        device = ("--dut", str(asked.dut))
    elif asked.model is None and not ran and (bench or not _on_the_shipped_device(runs)):
        device = ("--dut", DUT_PLACE)
        said += (f"{DUT_PLACE} stands for the device's file.",)
    return _Places((*bench, *device), device), said


def _on_the_shipped_device(runs: Sequence[Run]) -> bool:
    return devices_of(runs) == [default_dut()[0]] and all(run.dut_text for run in runs)


def devices_of(runs: Sequence[Run]) -> list[Dut]:
    """Give the devices that the logs name in their attachments, each once. Raises ConfigError for an unreadable one."""
    files = {run.dut_text: run.file for run in runs if run.dut_text}
    found: list[Dut] = []
    for text, file in files.items():
        device = parse_toml(text, Dut, f"dut attached to {file}")
        found += [device] if device not in found else []
    return found


def _beside(paths: Sequence[Path]) -> Path:
    """Give the folder of the first logs."""
    return paths[0] if paths[0].is_dir() else paths[0].parent


def _folders(beside: Path, commands: Iterable[str]) -> dict[str, Path]:
    """Give each command a folder that does not exist yet."""
    found: dict[str, Path] = {}
    number = 1
    for command in commands:
        while (folder := beside / (NEXT_FOLDER if number == 1 else f"{NEXT_FOLDER}-{number}")).exists():
            number += 1
        found[command] = folder
        number += 1
    return found


def _shortest(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Give the folder in place of all its logs."""
    folders = dict.fromkeys(path if path.is_dir() else path.parent for path in paths)
    named = {path.resolve() for path in paths if not path.is_dir()}
    whole = all(folder in paths or {log.resolve() for log in logs_in(folder)} <= named for folder in folders)
    return tuple(folders) if whole else tuple(paths)
