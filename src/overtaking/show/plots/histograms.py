"""The histogram of every feature, with the classes on each other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from overtaking.analysis.stats.distributions import Histogram
from overtaking.show.plots.style import (
    CLASS_COLOURS,
    CLASS_HATCHES,
    QUIET,
    is_narrow,
    new_figure,
    say_nothing_to_draw,
    set_margins,
    styled,
    words,
)

COLUMNS = 3
_PANEL_HEIGHT = 1.55
_FEW = 5  # Of fewer simulations an axis would show fractions.


@styled
def draw_histograms(
    histograms: Sequence[Histogram], classes: Sequence[str], *, is_weighted: bool = False
) -> Figure:
    """A panel for each feature.

    Args:
        histograms: `analysis.stats.distributions.histogram` of each feature to draw.
        classes: The classes of their counts.
        is_weighted: Whether simulations were counted by weight.
    """
    rows = -(-len(histograms) // COLUMNS)
    figure = new_figure(0.6 + _PANEL_HEIGHT * rows, is_fixed=True)
    top = 0.7 if is_narrow() else 0.52  # Room for a legend of two lines.
    set_margins(figure, left=0.52, right=0.16, top=top, bottom=0.28, wspace=0.24, hspace=0.42)
    panels = np.atleast_1d(figure.subplots(rows, COLUMNS)).ravel()
    for axes, one in zip(panels, histograms, strict=False):
        _draw_panel(axes, one, classes)
    for axes in panels[len(histograms) :]:
        axes.set_visible(False)
    axis = "simulations, weighted" if is_weighted else "simulations"
    figure.supylabel(axis, x=0.005, color=QUIET, size=8)
    add_class_legend(figure, classes)
    return figure


def _draw_panel(axes: Axes, one: Histogram, classes: Sequence[str]) -> None:
    """The histogram of one feature."""
    axes.set_title(one.feature.label, pad=3)
    if not one.counts.sum():
        say_nothing_to_draw(axes)
        return
    if one.levels:
        places, widths = np.arange(len(one.levels), dtype=float), np.full(len(one.levels), 0.78)
        axes.set_xticks(places, list(one.levels))
        axes.set_xlim(-0.6, len(places) - 0.4)
    else:
        places, widths = one.edges[:-1] + np.diff(one.edges) / 2.0, np.diff(one.edges) * 0.94
    below = np.zeros(len(places))
    for name, counts in zip(classes, one.counts, strict=True):
        there = counts > 0.0  # A bar that cannot be seen takes as long to draw as another.
        axes.bar(
            places[there],
            counts[there],
            widths[there],
            bottom=below[there],
            linewidth=0.0,
            **face(name),
        )
        below = below + counts
    if one.counts.sum(axis=0).max() < _FEW:
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if one.num_missing:
        axes.text(
            1.0, 1.02, f"{one.num_missing:,} without", ha="right", va="bottom", color=QUIET,
            size=6.5, transform=axes.transAxes,
        )  # fmt: skip


def face(name: str) -> Mapping[str, Any]:
    """Colour and hatching of an area of a class."""
    return {"facecolor": CLASS_COLOURS[name], "hatch": CLASS_HATCHES[name], "edgecolor": "white"}


def add_class_legend(figure: Figure, classes: Sequence[str]) -> None:
    """The classes with their colours, above a figure."""
    patches = [Patch(label=words(name), linewidth=0.0, **face(name)) for name in classes]
    figure.legend(
        handles=patches,
        loc="upper center",
        ncols=3 if is_narrow() else len(patches),
        handlelength=1.3,
        columnspacing=1.4,
    )
