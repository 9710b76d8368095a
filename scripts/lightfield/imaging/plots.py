"""One style for every plot: labelled, colour-blind safe, as SVG and PNG, equal bytes each time."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib

from lightfield.core.files import atomic_path

# A picture is written to a file, never to a screen.
matplotlib.use("agg")

from matplotlib import pyplot, style

# Okabe and Ito's palette, which people with any kind of colour vision can tell apart.
BLUE = "#0072b2"
ORANGE = "#e69f00"
GREEN = "#009e73"
VERMILION = "#d55e00"
PURPLE = "#cc79a7"
SKY = "#56b4e9"
YELLOW = "#f0e442"
GREY = "#777777"
COLOURS = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, YELLOW, GREY)
# With the colours, so that a line is known without them too.
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
    # Element names in an SVG would otherwise be random.
    "svg.hashsalt": "plenoforge",
}


@contextmanager
def plot(
    stem: Path, rows: int = 1, columns: int = 1, size: tuple[float, float] = (8, 5)
) -> Iterator[Any]:
    """Yield axes to draw on, then write ``stem``.svg and ``stem``.png.

    One panel yields its axes, several an array of them. ``size`` is that of the figure, in inches.
    """
    # Whatever a user's matplotlibrc says.
    with style.context(("default", _STYLE)):
        figure, axes = pyplot.subplots(rows, columns, figsize=size)
        try:
            yield axes
            for suffix, metadata in ((".svg", {"Date": None}), (".png", {})):
                with atomic_path(stem.with_name(stem.name + suffix)) as temporary:
                    figure.savefig(temporary, metadata=metadata)
        finally:
            pyplot.close(figure)
