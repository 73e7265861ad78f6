"""`rig loop` and `rig predict`: trace what the model lacks, and evaluate a model on logs."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path

from rich.console import Console

from drivers.clock import RealClock
from drivers.errors import ConfigError, Mistake
from drivers.spelling import did_you_mean
from rig.commands.further import Asked, devices_of, with_commands
from rig.commands.report import REPORT_NAME
from rig.config.dut import Dut, load_dut
from rig.log.load import MOST_SAMPLES, READERS, load_runs
from rig.log.names import gone_if_unused, written_aside
from rig.log.run import Run, averagings, endings
from rig.loop.campaign import LoopOptions
from rig.loop.files.model_storage import MODEL_NAME, load_model, write_model
from rig.loop.files.views_file import VIEWS_NAME, write_views
from rig.loop.plot import plot_loop
from rig.loop.predict import write_predictions
from rig.loop.result import RESULT_NAME, LoopResult
from rig.loop.signals.living import without_dead
from rig.loop.table import headline, is_command, remaining_table, statements, table_of, text_of
from rig.loop.trace import trace
from rig.stages import Stages
from rig.terminal import counted, emit, tell
from sim_backend.model.compliance import Compliance


@dataclass(frozen=True, slots=True)
class LoopCommand:
    """The options of `rig loop`, as given."""

    dut: Path | None
    base: Path | None
    compliance: str | None
    held_out: tuple[str, ...]
    alpha: float
    seed: int
    scheduler: str | None
    out: Path
    as_json: bool


@dataclass(frozen=True, slots=True)
class LoopFiles:
    """What a loop writes."""

    result: Path
    model: Path
    table: Path
    plot: Path
    views: Path


def loop_command(paths: tuple[Path, ...], options: LoopCommand) -> None:
    """Trace, write the result, print the table."""
    law = _law(options.compliance)
    with gone_if_unused(options.out), Stages(RealClock()) as stage:
        _keep_the_base(options)
        result = _traced(paths, options, law, stage)
        stage("drawing and writing the result")
        files = write_loop(result, options.out)
    if options.as_json:
        emit(result.to_json())
        return
    print_result(result)
    print_files(files)
    tell(f"Next: rig report {options.out}")


def _keep_the_base(options: LoopCommand) -> None:
    """Raise ConfigError where the result would take the place of the base model that it starts from."""
    if options.base is not None and options.base.resolve() in {p.resolve() for p in astuple(_files_in(options.out))}:
        rule = f"holds {options.base.name}, the base model, which the result would replace"
        raise ConfigError("-o", [Mistake("-o", str(options.out), rule)], hint="Choose another folder with -o.")


def _traced(
    paths: tuple[Path, ...], options: LoopCommand, law: Compliance | None, stage: Callable[[str], None]
) -> LoopResult:
    stage("reading the logs")
    runs = load_runs(paths, MOST_SAMPLES)
    base = load_model(options.base) if options.base is not None else None
    dut = load_dut(options.dut)[0] if options.dut is not None else base.dut if base is not None else dut_of(runs)
    how = LoopOptions(options.held_out, options.alpha, options.seed, base, law, options.scheduler)
    result = trace(runs, dut, how, on_stage=stage)
    return with_commands(result, runs, Asked(paths, options.dut, _typed(options)))


def _typed(options: LoopCommand) -> tuple[str, ...]:
    """Give the options of the search that differ from the usual ones, as they are typed."""
    usual = LoopOptions()
    words = [] if options.base is None else ["--base", str(options.base)]
    words += [] if options.compliance is None else ["--compliance", options.compliance]
    words += [word for pattern in options.held_out for word in ("--held-out", pattern)]
    words += [] if options.alpha == usual.alpha else ["--alpha", f"{options.alpha:g}"]
    words += [] if options.seed == usual.seed else ["--seed", str(options.seed)]
    return (*words, *([] if options.scheduler is None else ["--scheduler", options.scheduler]))


def _law(name: str | None) -> Compliance | None:
    if name is not None and name not in list(Compliance):
        rule = f"expected one of {', '.join(Compliance)}{did_you_mean(name, Compliance)}"
        raise ConfigError("--compliance", [Mistake("--compliance", name, rule)])
    return None if name is None else Compliance(name)


def predict_command(model_file: Path, paths: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Write the model's predictions for every run; print the files, the rms of what remains, and runs to distrust."""
    _refuse_swapped(model_file, paths)
    model = load_model(model_file)
    with Stages(RealClock()) as stage:
        stage("reading the logs")
        runs = load_runs(paths, MOST_SAMPLES)
        stage(f"predicting {counted(len(runs), 'run')}")
        living = [without_dead(run) for run in runs]
        written = write_predictions([run for run, _ in living], model, out)
    warnings = (*endings(runs), *averagings(runs), *(warning for _, warning in living if warning))
    if as_json:
        residuals = [{"run": one.run, **asdict(item)} for one in written for item in one.remaining]
        emit({"files": [str(one.file) for one in written], "residuals": residuals, "warnings": list(warnings)})
        return
    for one in written:
        print(one.file)
    Console().print(remaining_table(written))
    for warning in warnings:
        tell(f"! {warning}")


def _refuse_swapped(model_file: Path, paths: Sequence[Path]) -> None:
    """Raise ConfigError where logs stand in the model's place, with the order that is meant."""
    if not model_file.is_dir() and model_file.suffix.lower() not in READERS:
        return
    what = "a folder" if model_file.is_dir() else "a log"
    models = [path for path in paths if path.suffix.lower() == ".json"]
    first = models[0] if models else "MODEL"
    others = " ".join(str(path) for path in (model_file, *paths) if path not in models)
    raise ConfigError(
        "command line",
        [Mistake("MODEL", str(model_file), f"is {what}; the model (model.json) comes first, then the logs")],
        hint=f"rig predict {first} {others}",
    )


def dut_of(runs: Sequence[Run]) -> Dut:
    """Give the device that the logs name in their attachment; without one, a device of which nothing is known."""
    found = devices_of(runs)
    if not found:
        tell("No --dut and none in the logs: nothing is known of the device (ratio, counts, catalogue values).")
        return Dut(name="unknown")
    if len(found) > 1:
        raise ConfigError(
            "--dut",
            [Mistake("--dut", "", f"the logs come from {len(found)} different devices under test")],
            hint="Give the logs of one device, or name the device with --dut.",
        )
    return found[0]


def write_loop(result: LoopResult, out: Path) -> LoopFiles:
    """Write `loop.json`, `model.json`, `views.json` for the report, the table and the plot into `out`.

    If it is interrupted, what was there stays as it was. A report of the former result goes, and that is said.
    """
    with written_aside(out) as aside:
        _write_all(result, aside)
    former = out / REPORT_NAME
    if former.is_file():
        former.unlink()
        tell(f"! {former} was of the former result and is gone; `rig report {out}` makes the new one.")
    return _files_in(out)


def _files_in(folder: Path) -> LoopFiles:
    return LoopFiles(
        folder / RESULT_NAME, folder / MODEL_NAME, folder / "table.txt", folder / "plot.svg", folder / VIEWS_NAME
    )


def _write_all(result: LoopResult, folder: Path) -> None:
    files = _files_in(folder)
    plot_loop(result, files.plot)
    files.result.write_text(json.dumps(result.to_json(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    write_model(result.model, files.model)
    write_views(result.views, files.views)
    files.table.write_text(text_of(result) + "\n", encoding="utf-8")


def print_files(files: LoopFiles) -> None:
    """Say where everything is."""
    tell(f"result  {files.result}")
    tell(f"model   {files.model}")
    tell(f"table   {files.table}")
    tell(f"plot    {files.plot}")


def print_result(result: LoopResult) -> None:
    """Print the statement, the table before and after, and what remains open."""
    console = Console()
    console.print(headline(result), style="bold", highlight=False, markup=False)
    console.print(table_of(result))
    for line in statements(result):
        console.print(line, highlight=False, markup=False, soft_wrap=is_command(line))
