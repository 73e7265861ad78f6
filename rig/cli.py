"""The command line. Each command imports what it needs in its body, so that `rig --help` answers at once."""

import re
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from drivers.errors import ConfigError, Mistake
from rig.terminal import carry_out, shortened

_SUGGESTION = re.compile(r"\. Did you mean (.*)\?$")

UsageError = cast(type[Exception], typer.BadParameter.__mro__[1])
"""What typer raises for a command line that it cannot read; the class itself has no public name."""


class CommandLine(TyperGroup):
    """The commands. Whatever goes wrong is told in one way, also a command line that cannot be read."""

    def main(self, args: Sequence[str] | None = None, *further: Any, **options: Any) -> None:
        """Carry out a command line and leave with its exit code."""
        words = list(sys.argv[1:] if args is None else args)

        def command() -> object:
            try:
                return super(CommandLine, self).main(words or ["--help"], "rig", standalone_mode=False)
            except UsageError as error:
                raise _wrong_use(error, words) from error

        sys.exit(carry_out(command, as_json="--json" in words))


def _wrong_use(error: Any, words: Sequence[str]) -> ConfigError:
    """Name the argument, what was given for it, and what is expected."""
    param = getattr(error, "param", None)
    rule = _SUGGESTION.sub(r" (did you mean \1?)", error.message).rstrip(".") or "missing"
    if param is None:
        mistake = Mistake("rig", shortened(" ".join(words)), rule)
    else:
        name = param.opts[-1]
        given = next((after for word, after in pairwise(words) if word == name), None)
        given = next((word[len(name) + 1 :] for word in words if word.startswith(f"{name}=")), given)
        shown = name if name.startswith("-") else param.metavar or name
        mistake = Mistake(shown, given and shortened(given), rule)
    command = error.ctx.command_path if error.ctx is not None else "rig"
    return ConfigError("command line", [mistake], hint=f"See `{command} --help`.")


app = typer.Typer(
    name="rig",
    cls=CommandLine,
    help="Test-rig software for benches with a motor, a harmonic drive and encoders.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _path(text: str | Path) -> Path:
    """Refuse a path without a letter, which would stand for the folder at hand."""
    if not str(text).strip():
        raise typer.BadParameter("expected a path")
    return Path(text)


Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
Out = Annotated[Path, typer.Option("-o", "--out", parser=_path, metavar="FOLDER", help="Folder for what is written.")]
DutFile = Annotated[
    Path | None, typer.Option("--dut", parser=_path, metavar="FILE", help="Device under test (dut.toml).")
]
Runs = Annotated[
    list[Path], typer.Argument(parser=_path, help="Logs (.mcap, .csv) or folders of logs.", metavar="RUN...")
]


@app.command()
def run(
    procedures: Annotated[list[str], typer.Argument(metavar="PROCEDURE...", help="See `rig procedures`.")],
    bench: Annotated[str, typer.Option(help="Bench file, or 'sim' for the simulated bench.")] = "sim",
    dut: DutFile = None,
    model: Annotated[
        Path | None, typer.Option(parser=_path, metavar="FILE", help="Fitted model that the simulated bench runs.")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="PROCEDURE.NAME=VALUE", help="Set a parameter; repeatable.")
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, max=1000, help="Run each procedure this often, as replicates.")] = 1,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Simulate against the bench's limits; open no device.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Consent to motion and to every request of a procedure.")] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the simulated instruments' noise.")] = None,
    out: Out = Path("runs"),
    as_json: Json = False,
) -> None:
    """Run procedures on a bench and log each run."""
    from rig.commands.run import RunOptions, run_command

    run_command(
        tuple(procedures),
        RunOptions(bench, dut, model, tuple(settings or ()), repeat, yes, seed, out, as_json),
        dry_run,
    )


@app.command()
def procedures(as_json: Json = False) -> None:
    """List the procedures, their parameters, units and ranges."""
    from rig.commands.lists import list_procedures

    list_procedures(as_json)


@app.command()
def devices(as_json: Json = False) -> None:
    """List the device drivers."""
    from rig.commands.lists import list_devices

    list_devices(as_json)


@app.command()
def effects(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME",
            help="Only these effects or groups: base, torsion, motor-balance, output-balance, friction, reading.",
        ),
    ] = None,
    brief: Annotated[bool, typer.Option("--brief", help="One line for each effect.")] = False,
    as_json: Json = False,
) -> None:
    """List the effects that the model knows: equation, units, ranges, where they show, what tells them apart."""
    from rig.commands.lists import list_effects

    list_effects(tuple(names or ()), brief, as_json)


@app.command()
def show(
    log: Annotated[Path, typer.Argument(parser=_path, metavar="RUN", help="A log (.mcap or .csv).")],
    as_json: Json = False,
) -> None:
    """Show what a log holds."""
    from rig.commands.logs import show_command

    show_command(log, as_json)


@app.command()
def recover(
    log: Annotated[Path, typer.Argument(parser=_path, metavar="RUN", help="A log that was cut off (.mcap).")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", parser=_path, metavar="FILE", help="Where to write; default beside the log."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Save what is readable of a log that was cut off."""
    from rig.commands.logs import recover_command

    recover_command(log, out, as_json)


@app.command()
def export(
    logs: Runs,
    to: Annotated[str, typer.Option("--to", help="hdf5, csv or parquet.")],
    out: Out = Path("runs"),
    as_json: Json = False,
) -> None:
    """Export logs for other programs."""
    from rig.commands.logs import export_command

    export_command(tuple(logs), to, out, as_json)


@app.command("import")
def import_(
    files: Annotated[
        list[Path], typer.Argument(parser=_path, metavar="FILE...", help="CSV, HDF5, MAT or Parquet files.")
    ],
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--map", parser=_path, metavar="FILE", help="Mapping file (map.toml); not needed for contract CSV."
        ),
    ] = None,
    out: Out = Path("runs"),
    as_json: Json = False,
) -> None:
    """Turn foreign recordings into logs."""
    from rig.commands.logs import import_command

    import_command(tuple(files), mapping, out, as_json)


@app.command()
def loop(
    logs: Runs,
    dut: DutFile = None,
    base: Annotated[
        Path | None, typer.Option(parser=_path, metavar="FILE", help="Model to start from (model.json).")
    ] = None,
    compliance: Annotated[
        str | None,
        typer.Option(
            metavar="LAW", help="Flexspline: arctan, cubic or piecewise; default: that of --base, without one arctan."
        ),
    ] = None,
    held_out: Annotated[list[str] | None, typer.Option("--held-out", metavar="GLOB", help="Runs to hold out.")] = None,
    alpha: Annotated[float, typer.Option(min=1e-6, max=0.5, help="False-alarm probability.")] = 0.01,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the split by run.")] = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers do the work; needs the extra `cluster`."),
    ] = None,
    out: Out = Path("runs/loop"),
    as_json: Json = False,
) -> None:
    """Fit the model, find the residual, trace it to what the model lacks, report the error before and after."""
    from rig.commands.loop import LoopCommand, loop_command

    patterns = tuple(held_out or ())
    loop_command(tuple(logs), LoopCommand(dut, base, compliance, patterns, alpha, seed, scheduler, out, as_json))


@app.command()
def predict(
    model: Annotated[Path, typer.Argument(parser=_path, metavar="MODEL", help="A model (model.json).")],
    logs: Runs,
    out: Out = Path("runs/predictions"),
    as_json: Json = False,
) -> None:
    """Evaluate a model on logs: prediction and residual of every equation the log allows."""
    from rig.commands.loop import predict_command

    predict_command(model, tuple(logs), out, as_json)


@app.command()
def report(
    paths: Annotated[
        list[Path],
        typer.Argument(
            parser=_path, metavar="RUN_OR_LOOP_DIR...", help="Folders that `rig loop` wrote, logs, or folders of logs."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            parser=_path,
            metavar="FOLDER",
            help="Folder for the reports; default: beside each result or log.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a report of a loop or of runs: one HTML file that opens without network, on a phone too, and prints."""
    from rig.commands.report import report_command

    report_command(tuple(paths), out, as_json)


@app.command()
def demo(
    seed: Annotated[int | None, typer.Option(min=0, help="Seed that draws the effect; default: drawn.")] = None,
    out: Out = Path("runs/demo"),
    as_json: Json = False,
) -> None:
    """Tell the whole story on the simulated bench, with an effect that the loop is not told."""
    from rig.commands.demo import demo_command

    demo_command(seed, out, as_json)


@app.command()
def papers(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME...", help="A paper or a part of one: zhang2014, fig12, castejon2009/eq35; default: all."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter experiments; coarser figures.")] = False,
    out: Out = Path("runs/papers"),
    as_json: Json = False,
) -> None:
    """Reproduce the source papers: their figures, and what they print beside what comes out.

    All of them give table.md and results.json, a part its own: castejon2009-eq35.md and castejon2009-eq35.json.

    Several parts give castejon2009-eq35+both.md or, where that is too long, zhang2014-eq1-and-35-more.md.
    """
    from rig.commands.papers import papers_command

    papers_command(tuple(names or ()), out, quick, as_json)
