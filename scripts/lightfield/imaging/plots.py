"""One style for all plots: safe for colour-blind readers, as SVG and PNG, with equal bytes."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib

from lightfield.core.files import atomic_path

# Plots go to files, never to a screen.
matplotlib.use("agg")

from matplotlib import pyplot, style
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

# Okabe and Ito's palette, which people with any kind of colour vision can tell apart.
BLUE = "#0072b2"
ORANGE = "#e69f00"
GREEN = "#009e73"
VERMILION = "#d55e00"
PURPLE = "#cc79a7"
SKY = "#56b4e9"
_YELLOW = "#f0e442"
GREY = "#777777"
COLOURS = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, _YELLOW, GREY)
# Each colour has a marker, so that lines differ without colour, too.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

_STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "font.size": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.markersize": 5,
    "savefig.dpi": 130,
    # Without a salt, the names of elements in an SVG are random.
    "svg.hashsalt": "plenoforge",
}


class PlotFigure(Figure):
    """A figure that is drawn once for each file.

    Before Matplotlib draws a file, it draws the figure without output, only to lay it out.
    """

    def draw(self, renderer: RendererBase) -> None:
        layout = self.get_layout_engine()
        # For the file itself, Matplotlib has turned the layout off.
        if isinstance(layout, ConstrainedLayoutEngine):
            layout.execute(self)
        else:
            super().draw(renderer)


@contextmanager
def plot(
    stem: Path, rows: int = 1, columns: int = 1, size: tuple[float, float] = (8, 5)
) -> Iterator[Any]:
    """Yield axes to draw on, then write ``stem``.svg and ``stem``.png.

    Yields the axes of a single panel, or an array of axes. ``size`` is the figure's, in inches.
    """
    # "default" overrides a user's matplotlibrc.
    with style.context(("default", _STYLE)):
        figure, axes = pyplot.subplots(rows, columns, figsize=size, FigureClass=PlotFigure)
        try:
            yield axes
            for suffix, metadata in ((".svg", {"Date": None}), (".png", {})):
                with atomic_path(stem.with_name(stem.name + suffix)) as temporary:
                    figure.savefig(temporary, metadata=metadata)
        finally:
            pyplot.close(figure)
