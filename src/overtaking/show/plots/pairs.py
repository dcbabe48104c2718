"""Every numeric feature against every other one."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import BY_NAME
from overtaking.analysis.stats.distributions import Histogram, Points
from overtaking.analysis.stats.sample import Mask, Sample
from overtaking.show.plots.style import (
    CLASS_COLOURS,
    CLASS_MARKERS,
    LINE,
    is_narrow,
    new_figure,
    set_margins,
    styled,
    words,
)

F64 = NDArray[np.float64]

DETAILS = (("SE", "SP"), ("DSEP", "SE"))
"""The two pairs that the paper looks at closely, as (across, up)."""


@styled
def draw_pairs(sample: Sample, histograms: Sequence[Histogram], points: Points) -> Figure:
    """A panel for each pair of features, and the histogram of each on the diagonal.

    Args:
        sample: The features.
        histograms: `analysis.stats.distributions.histogram` of each feature, in order.
        points: `analysis.stats.distributions.pair_points`.
    """
    names = [one.feature.name for one in histograms]
    number = len(names)
    figure = new_figure(7.4, is_fixed=True)
    set_margins(figure, left=0.52, right=0.05, top=0.05, bottom=0.3, wspace=0.05, hspace=0.05)
    grid = figure.add_gridspec(number, number)
    columns = {name: sample.values(name)[points.simulations] for name in names}
    members = {name: of[points.simulations] for name, of in sample.groups()}
    for row, up in enumerate(names):
        for column, across in enumerate(names[: row + 1]):
            axes = figure.add_subplot(grid[row, column])
            if column == row:
                _draw_diagonal(axes, histograms[column])
            else:
                _draw_cloud(axes, columns[across], columns[up], members, size=2.2)
            _label_edges(axes, across, up, is_left=column == 0, is_bottom=row == number - 1)
    _add_marker_legend(figure, list(members), "upper right", (0.98, 0.97))
    return figure


@styled
def draw_details(sample: Sample, points: Points) -> Figure:
    """The pairs SE with SP and DSEP with SE, large.

    Args:
        sample: The features.
        points: `analysis.stats.distributions.pair_points`.
    """
    figure = new_figure(6.0 if is_narrow() else 3.2)
    members = {name: of[points.simulations] for name, of in sample.groups()}
    for axes, (across, up) in zip(_panels(figure), DETAILS, strict=True):
        x, y = (sample.values(name)[points.simulations] for name in (across, up))
        _draw_cloud(axes, x, y, members, size=12.0)
        axes.grid(visible=True, axis="both")
        axes.set_xlabel(f"{BY_NAME[across].title}, {BY_NAME[across].label}")
        axes.set_ylabel(f"{BY_NAME[up].title}, {BY_NAME[up].label}")
        if {across, up} == {"SE", "SP"}:
            axes.axline((100.0, 100.0), slope=1.0, color=LINE, linewidth=0.8, zorder=0)
    _add_marker_legend(figure, list(members), "outside upper center", None)
    return figure


def _panels(figure: Figure) -> Sequence[Axes]:
    """A panel for each detail, side by side, on a phone below each other."""
    rows, columns = (len(DETAILS), 1) if is_narrow() else (1, len(DETAILS))
    return figure.subplots(rows, columns)


def _draw_cloud(axes: Axes, across: F64, up: F64, members: dict[str, Mask], *, size: float) -> None:
    """One point per simulation; the largest class lies below the others."""
    for name in sorted(members, key=lambda one: -int(members[one].sum())):
        of = members[name]
        axes.scatter(
            across[of],
            up[of],
            s=size,
            marker=CLASS_MARKERS[name],
            color=CLASS_COLOURS[name],
            alpha=0.7,
            linewidth=0.0,
            rasterized=True,  # Thousands of shapes would make a page slow.
        )
    axes.grid(visible=False)


def _draw_diagonal(axes: Axes, one: Histogram) -> None:
    """The histogram of one feature, all classes together."""
    if one.levels:
        places = np.array([float(level) for level in one.levels])
        whole = float(np.ptp(places)) or 1.0
        apart = float(np.diff(places).min(initial=whole))
        widths = np.full(len(places), max(0.6 * apart, 0.05 * whole))
    else:
        places, widths = one.edges[:-1] + np.diff(one.edges) / 2.0, np.diff(one.edges)
    axes.bar(places, one.counts.sum(axis=0), widths, color=LINE, linewidth=0.0)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)


def _label_edges(axes: Axes, across: str, up: str, *, is_left: bool, is_bottom: bool) -> None:
    """Names at the left and lower edge only, and no numbers: this figure shows shapes."""
    axes.set_xticks([])
    axes.set_yticks([])
    if is_bottom:
        axes.set_xlabel(across, labelpad=4)
    if is_left:
        axes.set_ylabel(up, rotation=0, ha="right", va="center", labelpad=6)


def _add_marker_legend(
    figure: Figure, classes: Sequence[str], place: str, anchor: tuple[float, float] | None
) -> None:
    """The classes with their colours and markers."""
    handles = [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=CLASS_MARKERS[name],
            color=CLASS_COLOURS[name],
            markeredgewidth=0.0,
            markersize=5.0,
            label=words(name),
        )
        for name in classes
    ]
    beside = 3 if is_narrow() else len(handles)
    columns = beside if anchor is None else 1
    more: dict[str, Any] = (
        {"loc": place} if anchor is None else {"loc": place, "bbox_to_anchor": anchor}
    )
    figure.legend(handles=handles, ncols=columns, handletextpad=0.2, **more)
