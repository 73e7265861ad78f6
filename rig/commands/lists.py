"""What there is: procedures, drivers, effects."""

import math

from rich.console import Console
from rich.table import Table

from drivers.registry import all_drivers
from procedures.plan import ParameterInfo, parameter_table
from procedures.registry import PROCEDURES
from rig.terminal import emit
from sim_backend.model.effects import CATALOGUE


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
    console.print("\nSet one with --set PROCEDURE.PARAMETER=VALUE.", highlight=False)


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


def list_effects(as_json: bool) -> None:
    """Print the effect catalogue: equation, unit, range, where it shows, what it can be confused with."""
    if as_json:
        emit(
            {
                "effects": [
                    {
                        "id": effect.id,
                        "summary": effect.summary,
                        "equation": effect.equation,
                        "enters": str(effect.enters),
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
                                "meaning": p.meaning,
                            }
                            for p in effect.parameters
                        ],
                    }
                    for effect in CATALOGUE.values()
                ]
            }
        )
        return
    console = Console()
    for effect in CATALOGUE.values():
        console.print(f"\n[bold]{effect.id}[/bold]  {effect.summary}", highlight=False)
        console.print(f"  {effect.equation}", highlight=False)
        for p in effect.parameters:
            console.print(
                f"  {p.name}: {p.meaning}; {p.low:g} to {p.high:g} {p.unit}, typically {p.typical:g}", highlight=False
            )
        console.print(f"  shows in: {', '.join(effect.shows)}", highlight=False)
        console.print(f"  can be taken for: {', '.join(effect.confusable)}", highlight=False)
        console.print(f"  told apart by: {effect.separated_by}", highlight=False)
        console.print(f"  source: {effect.source}", highlight=False)


def _default(info: ParameterInfo) -> str:
    if info.default is None:
        return "from dut"
    if isinstance(info.default, tuple):
        return ",".join(f"{value:g}" for value in info.default) or "none"
    return f"{info.default:g}" if isinstance(info.default, float) else str(info.default)


def _range(info: ParameterInfo) -> str:
    if info.kind in (bool, str):
        return ""
    return f"{info.low:g} to {info.high:g}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
