"""One figure of a loop: the held-out residual of every equation against what explains it, before and after."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.loop.display import SCALES, axis_label
from rig.loop.files.views_file import ResidualView
from rig.loop.result import LoopResult
from rig.loop.table import headline

TITLE_WIDTH = 120
"""Letters in a line of the title: as many as the figure is wide."""


def plot_loop(result: LoopResult, path: Path) -> Path:
    """Write the figure as SVG or PNG, by the suffix of `path`; give the path."""
    views = _chosen(result.views.residuals)
    count = max(len(views), 1)
    figure = Figure(figsize=(9.0, 1.0 + 2.6 * count), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(textwrap.fill(headline(result), TITLE_WIDTH), fontsize=9)
    for number, view in enumerate(views):
        axes = figure.add_subplot(count, 1, number + 1)
        shown, scale = SCALES.get(view.unit, (view.unit, 1.0))
        for name, values, rms, color in (
            ("before", view.before, view.rms_before, "0.65"),
            ("after", view.after, view.rms_after, "C0"),
        ):
            label = f"{name}, rms {rms * scale:.3g} {shown}"
            scaled = [value * scale for value in values]
            axes.plot(view.x, scaled, ".", markersize=1.5, color=color, label=label, rasterized=True)
        axes.set_xlabel(f"{axis_label(view.variable, view.variable_unit, view.order)}; {view.procedure}")
        axes.set_ylabel(f"residual of {view.equation} [{shown}]")
        axes.legend(loc="upper right", fontsize=7, markerscale=5)
        runs = textwrap.shorten(", ".join(view.runs), 150, placeholder=" ...")
        axes.text(0.005, 0.02, runs, transform=axes.transAxes, fontsize=6, color="0.3", parse_math=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _chosen(views: Sequence[ResidualView]) -> list[ResidualView]:
    """Give one view an equation: of the procedure from which most was removed."""
    found: dict[str, ResidualView] = {}
    for view in views:
        best = found.get(view.equation)
        if best is None or _removed(view) > _removed(best):
            found[view.equation] = view
    return list(found.values())


def _removed(view: ResidualView) -> float:
    return view.rms_before**2 - view.rms_after**2
