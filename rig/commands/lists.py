"""What there is: procedures, drivers, effects."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from rich.console import Console
from rich.table import Table
from rich.text import Text

from drivers.errors import ConfigError, Mistake
from drivers.registry import all_drivers
from drivers.spelling import did_you_mean, folded
from procedures.plan import ParameterInfo, parameter_table
from procedures.registry import PROCEDURES
from rig.terminal import emit, shortened, width_is_known
from sim_backend.model.effects import CATALOGUE, Effect, Energy, Enters

DEFAULTS = (
    "Default 'from dut': worked out from the dut file as the meaning says; what the file lacks is assumed, and told "
    "before the run. Default 'empty': no values; the meaning says what happens then."
)
"""What stands below the tables, for the words in their column of defaults."""


def list_procedures(as_json: bool) -> None:
    """Print every procedure with its parameters, units and ranges."""
    if as_json:
        emit(
            {
                "procedures": [
                    {
                        "name": procedure.name,
                        "summary": procedure.summary,
                        "needs": list(procedure.needs),
                        "needs_load_drive": procedure.needs_load_drive,
                        "needs_lock": procedure.needs_lock,
                        "on_abort": procedure.on_abort,
                        "parameters": [
                            {
                                "name": info.name,
                                "default": info.default,
                                "unit": info.unit,
                                "low": _finite(info.low),
                                "high": _finite(info.high),
                                "meaning": info.meaning,
                            }
                            for info in parameter_table(procedure.parameters)
                        ],
                    }
                    for procedure in PROCEDURES.values()
                ]
            }
        )
        return
    console = Console()
    for procedure in PROCEDURES.values():
        console.print(f"\n[bold]{procedure.name}[/bold]  {procedure.summary}", highlight=False)
        console.print(f"  When stopped: {procedure.on_abort}", highlight=False)
        table = Table(box=None, padding=(0, 2, 0, 2), header_style="bold")
        for heading in ("parameter", "default", "range", "unit", "meaning"):
            table.add_column(heading, overflow="fold")
        for info in parameter_table(procedure.parameters):
            table.add_row(info.name, _default(info), _range(info), info.unit, info.meaning)
        console.print(table)
    console.print(f"\n{DEFAULTS}\nSet one with --set PROCEDURE.PARAMETER=VALUE.", highlight=False)


def list_devices(as_json: bool) -> None:
    """Print every device driver."""
    drivers = all_drivers()
    if as_json:
        emit({"devices": [{"name": d.name, "kind": str(d.kind), "summary": d.summary} for d in drivers.values()]})
        return
    table = Table(box=None, header_style="bold")
    for heading in ("driver", "kind", "what"):
        table.add_column(heading)
    for driver in drivers.values():
        table.add_row(driver.name, str(driver.kind), driver.summary)
    Console().print(table)


ENTERS: Mapping[Enters, str] = MappingProxyType(
    {
        Enters.BASE: "terms of the base model, always there",
        Enters.TORSION: "an angle added to the torsion, rad at the output",
        Enters.MOTOR_BALANCE: "a torque that the motor must overcome, N*m at the motor",
        Enters.OUTPUT_BALANCE: "a torque that the output must overcome, N*m at the output",
        Enters.FRICTION: "added to the dry friction of the mesh, N*m at the motor, whatever the direction",
        Enters.READING: "added to what an instrument shows of a signal",
    }
)
"""What stands above the effects that enter there, in the order in which they are listed."""

NARROWEST_SUMMARY = 20
"""Columns that the summary of an effect has at least, however narrow the terminal is."""

GROUPS: Mapping[str, Enters] = MappingProxyType({str(enters).replace(" ", "-"): enters for enters in ENTERS})
"""Where effects enter, by the name that is typed."""

OPERATORS: Mapping[str, str] = MappingProxyType(
    {
        "lag(": "lag(u; tau): u behind a first-order low-pass of time constant tau",
        "play(": "play(u; r): follows u at a distance of up to r, and keeps still within it",
    }
)
"""What an equation may use, and what it means."""


def list_effects(names: Sequence[str], brief: bool, as_json: bool) -> None:
    """Print the effect catalogue, or the effects `names`: equation, unit, range, where it shows, what separates it.

    A name is an effect's or a group's, which is a heading as it is printed or with a hyphen: motor-balance.
    The whole catalogue begins with one line for each effect; `brief`: these lines alone. JSON carries everything.
    Raises ConfigError with every unknown name and the names near to it.
    """
    unknown = [
        Mistake("NAME", shortened(name), f"unknown{did_you_mean(name, [*CATALOGUE, *GROUPS])}")
        for name in names
        if name not in CATALOGUE and folded(name) not in GROUPS
    ]
    if unknown:
        raise ConfigError("command line", unknown, hint="`rig effects` lists all of them.")
    groups = {GROUPS.get(folded(name)) for name in names}
    effects = [e for e in CATALOGUE.values() if not names or e.id in names or e.enters in groups]
    if as_json:
        emit({"effects": [_effect_record(effect) for effect in effects]})
        return
    console = Console()
    if brief or not names:
        _overview(console, effects)
        told = "" if brief else "`rig effects --brief` prints these lines alone, "
        console.print(f"{told}`rig effects NAME...` all about some effects or groups (motor-balance).", highlight=False)
    if brief:
        return
    for enters, meaning in ENTERS.items():
        group = [effect for effect in effects if effect.enters is enters]
        if group:
            console.print(f"\n[bold]{str(enters).upper()}[/bold]: {meaning}", highlight=False)
        for effect in group:
            console.print(f"\n[bold]{effect.id}[/bold]", highlight=False)
            console.print(_effect_table(effect))
    used = [meaning for name, meaning in OPERATORS.items() if any(name in effect.equation for effect in effects)]
    console.print("", *used, sep="\n", highlight=False)


def _overview(console: Console, effects: Sequence[Effect]) -> None:
    """Print one line for each effect, which goes on in its own column where it is wider than the terminal or COLUMNS.

    Where neither says how wide a line may be, a line stays one: it goes to a file or to a search.
    """
    widest = max(len(effect.id) for effect in effects)
    for enters in ENTERS:
        group = [effect for effect in effects if effect.enters is enters]
        if group:
            console.print(f"[bold]{enters}[/bold]", highlight=False)
        for effect in group:
            begin = f"  {effect.id:{widest}}  "
            text = begin + effect.summary
            if width_is_known():
                text = textwrap.fill(
                    effect.summary,
                    width=max(console.width, len(begin) + NARROWEST_SUMMARY),
                    initial_indent=begin,
                    subsequent_indent=" " * len(begin),
                    break_long_words=False,
                    break_on_hyphens=False,
                )
            console.print(Text(text), soft_wrap=True)


def _effect_table(effect: Effect) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(width=17)
    table.add_column(overflow="fold")

    def row(label: str, text: str) -> None:
        table.add_row(Text(f"  {label}"), Text(text))

    row("what", effect.summary)
    row("equation", f"{effect.equation}  [{effect.unit}]")
    for p in effect.parameters:
        unit = "" if p.unit == "1" else f" {p.unit}"
        given = "; given, not fitted" if p.known else ""
        low, high = p.usual
        usual = f"usually {low:g} to {high:g}, typically {p.typical:g}"
        row(p.name, f"{p.low:g} to {p.high:g}{unit}, {usual}: {p.meaning}{given}")
    row("shows in", ", ".join(effect.shows))
    row("taken for", ", ".join(effect.confusable))
    row("told apart by", effect.separated_by)
    if effect.energy is not Energy.NONE:
        row("energy", str(effect.energy))
    row("source", effect.source)
    return table


def _effect_record(effect: Effect) -> dict[str, object]:
    return {
        "id": effect.id,
        "summary": effect.summary,
        "equation": effect.equation,
        "unit": effect.unit,
        "enters": str(effect.enters),
        "reads": effect.reads or None,
        "variable": effect.variable,
        "shape": str(effect.shape),
        "signals": list(effect.signals),
        "energy": str(effect.energy),
        "linear": effect.linear,
        "memory": effect.memory,
        "amplitudes": list(effect.amplitudes),
        "source": effect.source,
        "shows": list(effect.shows),
        "confusable": list(effect.confusable),
        "separated_by": effect.separated_by,
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "low": p.low,
                "high": p.high,
                "typical": p.typical,
                "usual": list(p.usual),
                "known": p.known,
                "meaning": p.meaning,
            }
            for p in effect.parameters
        ],
    }


def _default(info: ParameterInfo) -> str:
    if info.default is None:
        return "from dut"
    if isinstance(info.default, tuple):
        return ",".join(f"{value:g}" for value in info.default) or "empty"
    return f"{info.default:g}" if isinstance(info.default, float) else str(info.default)


def _range(info: ParameterInfo) -> str:
    if info.kind in (bool, str):
        return ""
    return f"{info.low:g} to {info.high:g}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
