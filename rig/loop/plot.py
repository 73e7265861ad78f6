"""One figure of a loop: the held-out residual of every equation against what explains it, before and after."""

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.loop.result import LoopResult, View
from rig.loop.table import SCALES, headline

PER_TURN = ("motor_position", "output_position")
"""Variables shown over one turn."""

TITLE_WIDTH = 120
"""Letters in a line of the title: as many as the figure is wide."""


def plot_loop(result: LoopResult, path: Path) -> Path:
    """Write the figure as SVG or PNG, by the suffix of `path`; give the path."""
    count = max(len(result.views), 1)
    figure = Figure(figsize=(9.0, 1.0 + 2.6 * count), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(textwrap.fill(headline(result), TITLE_WIDTH), fontsize=9)
    for number, view in enumerate(result.views):
        axes = figure.add_subplot(count, 1, number + 1)
        x, label = _axis(view)
        shown, scale = SCALES.get(view.unit, (view.unit, 1.0))
        for name, values, color in (("before", view.before, "0.65"), ("after", view.after, "C0")):
            values = values * scale
            rms = f"{name}, rms {_rms(values):.3g} {shown}"
            axes.plot(x, values, ".", markersize=1.5, color=color, label=rms, rasterized=True)
        axes.set_xlabel(label)
        axes.set_ylabel(f"residual of {view.equation} [{shown}]")
        axes.legend(loc="upper right", fontsize=7, markerscale=5)
        runs = textwrap.shorten(", ".join(view.runs), 150, placeholder=" ...")
        axes.text(0.005, 0.02, runs, transform=axes.transAxes, fontsize=6, color="0.3", parse_math=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _axis(view: View) -> tuple[np.ndarray, str]:
    if view.variable in PER_TURN:
        return np.remainder(view.x, 2.0 * np.pi), f"{view.variable} [rad], within a turn; {view.procedure}"
    return view.x, f"time [s]; {view.procedure}"
