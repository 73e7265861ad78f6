"""One figure of a loop: the held-out residual of every equation against what explains it, before and after."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.loop.result import LoopResult, View
from rig.loop.table import headline

PER_TURN = ("motor_position", "output_position")
"""Variables shown over one turn."""


def plot_loop(result: LoopResult, path: Path) -> Path:
    """Write the figure as SVG or PNG, by the suffix of `path`; give the path."""
    count = max(len(result.views), 1)
    figure = Figure(figsize=(9.0, 1.0 + 2.6 * count), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(headline(result), fontsize=9)
    for number, view in enumerate(result.views):
        axes = figure.add_subplot(count, 1, number + 1)
        x, label = _axis(view)
        axes.plot(x, view.before, ".", markersize=1.5, color="0.65", label="before", rasterized=True)
        axes.plot(x, view.after, ".", markersize=1.5, color="C0", label="after", rasterized=True)
        axes.set_xlabel(label)
        axes.set_ylabel(f"{view.equation} [{view.unit}]")
        axes.legend(loc="upper right", fontsize=7, markerscale=5)
        runs = ", ".join(view.runs[:4]) + (", ..." if len(view.runs) > 4 else "")
        axes.text(0.005, 0.02, runs, transform=axes.transAxes, fontsize=6, color="0.3", parse_math=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    return path


def _axis(view: View) -> tuple[np.ndarray, str]:
    if view.variable in PER_TURN:
        return np.remainder(view.x, 2.0 * np.pi), f"{view.variable} [rad], within a turn; {view.procedure}"
    return view.x, f"time [s]; {view.procedure}"
