"""Figures of the papers, drawn without a display."""

import math

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def new_figure(title: str, panels: int = 1, *, height: float = 3.2) -> tuple[Figure, tuple[Axes, ...]]:
    """Give an empty figure with its panels one above the other; height: of one panel, inches."""
    figure = Figure(figsize=(7.0, 0.4 + height * panels), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=10)
    return figure, tuple(figure.add_subplot(panels, 1, number + 1) for number in range(panels))


def one_turn(axes: Axes) -> None:
    """End the horizontal axis, an angle in rad, at one turn."""
    axes.set_xlim(0.0, 2.0 * math.pi)
    quarters = ("0", "pi/2", "pi", "3 pi/2", "2 pi")
    axes.set_xticks([0.5 * math.pi * quarter for quarter in range(len(quarters))], labels=quarters)


def label(axes: Axes, x: str, y: str) -> None:
    """Name both axes, with units, and show the legend if any line has a name."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(visible=True, linewidth=0.3)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=7)
