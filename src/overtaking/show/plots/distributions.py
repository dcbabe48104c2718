"""Single features: how often each class occurs, histograms, box plots, swarms, waiting times."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, PercentFormatter

from overtaking.analysis.stats.columns import Feature
from overtaking.analysis.stats.distributions import Box, Histogram, Points
from overtaking.analysis.stats.sample import Sample
from overtaking.analysis.stats.survival import Survival
from overtaking.analysis.stats.table import Style, Table, write
from overtaking.core.arrays import F64
from overtaking.show import palette
from overtaking.show.plots.style import (
    CLASS_HATCHES,
    is_narrow,
    legend_columns,
    lightened,
    new_figure,
    remark,
    say_nothing_to_draw,
    set_margins,
    single_axes,
    styled,
    words,
)


@styled
def draw_classes(table: Table, *, policy: str) -> Figure:
    """Bars with count and share of each class.

    Args:
        table: `analysis.stats.tables.class_table`.
        policy: Name of the policy of the classes.
    """
    rows = list(table.rows.itertuples(index=False, name=None))
    figure, axes = single_axes(0.45 + 0.36 * len(rows))
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_xticks([])
    longest = max((high for *_, high in rows if not math.isnan(high)), default=1.0)
    for place, (name, count, share, low, high) in enumerate(rows):
        known = 0.0 if math.isnan(share) else share
        axes.barh(place, known, height=0.68, color=palette.CLASS_COLOURS[name])
        if not math.isnan(high):
            axes.plot(
                [low, high], [place, place], color=palette.INK, linewidth=0.9, solid_capstyle="butt"
            )
        end = known if math.isnan(high) else high
        text = f"{write(float(count), Style.COUNT)}   {write(share, Style.SHARE)}"
        axes.text(end + 0.015 * longest, place, text, va="center")
    # The texts beside the bars (count and share) take a larger part of a narrow figure.
    axes.set_xlim(0.0, (1.7 if is_narrow() else 1.25) * longest)
    axes.set_yticks(range(len(rows)), [words(str(row[0])) for row in rows])
    axes.tick_params(axis="y", labelcolor=palette.INK, labelsize=8.0)
    axes.invert_yaxis()
    gap = "\n" if is_narrow() else " "
    axes.set_xlabel(
        f"share of simulations, policy {policy};{gap}the line spans its 95 % confidence",
        color=palette.QUIET,
    )
    return figure


_PANEL_HEIGHT = 1.55
_FEW = 5  # Of fewer simulations an axis would show fractions.


@styled
def draw_histograms(
    histograms: Sequence[Histogram],
    classes: Sequence[str],
    *,
    policy: str,
    is_weighted: bool = False,
) -> Figure:
    """A panel for each feature.

    Args:
        histograms: `analysis.stats.distributions.histogram` of each feature to draw.
        classes: The classes of their counts.
        policy: Name of the policy of the classes.
        is_weighted: Whether simulations were counted by weight.
    """
    columns = 2 if is_narrow() else 3
    rows = -(-len(histograms) // columns)
    figure = new_figure(0.6 + _PANEL_HEIGHT * rows, is_fixed=True)
    lines = -(-len(classes) // legend_columns(len(classes)))
    top = 0.36 + 0.16 * (lines + 1)  # Room for the legend and its title.
    set_margins(figure, left=0.52, right=0.16, top=top, bottom=0.28, wspace=0.34, hspace=0.46)
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axes, one in zip(panels, histograms, strict=False):
        _draw_panel(axes, one, classes)
    for axes in panels[len(histograms) :]:
        axes.set_visible(False)
    axis = "simulations, weighted" if is_weighted else "simulations"
    figure.supylabel(axis, x=0.005, color=palette.QUIET, size=8)
    add_class_legend(figure, classes, policy)
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
        # In narrow figures the remark stands above the title: one line is too short for both.
        remark(axes, f"{one.num_missing:,} without", height=1.17 if is_narrow() else 1.02)


def face(name: str) -> Mapping[str, Any]:
    """Colour and hatching of an area of a class."""
    return {
        "facecolor": palette.CLASS_COLOURS[name],
        "hatch": CLASS_HATCHES[name],
        "edgecolor": "white",
    }


def add_class_legend(figure: Figure, classes: Sequence[str], policy: str) -> None:
    """The classes with their colours and the policy, above a figure."""
    patches = [Patch(label=words(name), linewidth=0.0, **face(name)) for name in classes]
    figure.legend(
        handles=patches,
        title=f"class under the policy {policy}",
        loc="upper center",
        ncols=legend_columns(len(patches)),
        handlelength=1.3,
        columnspacing=1.4,
    )


MAX_OUTLIERS = 400
"""Outliers of one box that are drawn; of more, evenly spaced ones."""
_POINT = 3.2  # Diameter of a point of a swarm [1/72 inch].
_POINTS_PER_INCH = 72.0
_ROOM = 0.46  # Half of the width that a swarm may take, where classes are 1 apart.


@styled
def draw_scaled_boxes(boxes: Mapping[str, Box]) -> Figure:
    """A box for each numeric feature, each range scaled to 0 to 1.

    Args:
        boxes: `analysis.stats.distributions.scaled_boxes`.
    """
    figure, axes = single_axes(2.9)
    _draw_boxes(axes, boxes, dict.fromkeys(boxes, palette.ACCENT))
    axes.set_xticks(range(len(boxes)), list(boxes), rotation=90 if is_narrow() else 0)
    axes.set_ylabel("value, scaled to its range")
    axes.set_ylim(-0.04, 1.04)
    return figure


@styled
def draw_boxes_and_swarm(
    sample: Sample, feature: Feature, boxes: Mapping[str, Box], points: Mapping[str, Points]
) -> Figure:
    """A feature by class, as boxes on the left and as single simulations on the right.

    Args:
        sample: The features.
        feature: A numeric feature.
        boxes: `analysis.stats.distributions.boxes_by_class` of it.
        points: `analysis.stats.distributions.swarm_points` of it.
    """
    figure = new_figure(5.8 if is_narrow() else 3.3)
    rows, columns = (2, 1) if is_narrow() else (1, 2)
    left, right = figure.subplots(rows, columns, sharey=True)
    _draw_boxes(left, boxes, palette.CLASS_COLOURS)
    values = sample.values(feature.name)
    known = values[~np.isnan(values)]
    if len(known):
        margin = 0.04 * float(np.ptp(known)) or 1.0
        left.set_ylim(float(known.min()) - margin, float(known.max()) + margin)
        for place, (name, one) in enumerate(points.items()):
            _draw_swarm(right, place, values[one.simulations], name)
    else:
        say_nothing_to_draw(right)
    labels = [words(name).replace(" ", "\n") for name in boxes]
    turned: dict[str, Any] = {"rotation": 30, "ha": "right"} if is_narrow() else {}
    for axes in (left, right):
        axes.set_xticks(range(len(boxes)), list(map(words, boxes)) if turned else labels, **turned)
        axes.set_xlim(-0.55, len(boxes) - 0.45)
    left.set_ylabel(f"{feature.title}, {feature.label}")
    figure.supxlabel(f"class under the policy {sample.policy}", color=palette.QUIET, size=8)
    if any(one.is_sampled for one in points.values()):
        right.set_title("a sample of each class", color=palette.QUIET, weight="normal", size=8.0)
    return figure


def _draw_boxes(axes: Axes, boxes: Mapping[str, Box], colours: Mapping[str, str]) -> None:
    """Boxes beside each other, from their numbers."""
    for place, (name, one) in enumerate(boxes.items()):
        if not one.count:
            continue
        numbers = dict(zip(("q1", "med", "q3"), one.quartiles, strict=True))
        numbers |= dict(zip(("whislo", "whishi"), one.whiskers, strict=True))
        axes.bxp(
            [numbers | {"fliers": _thinned(one.outliers)}],
            positions=[place],
            widths=0.56,
            patch_artist=True,
            manage_ticks=False,
            boxprops={"facecolor": lightened(colours[name], 0.35), "edgecolor": colours[name]},
            medianprops={"color": palette.INK, "linewidth": 1.4},
            whiskerprops={"color": colours[name]},
            capprops={"color": colours[name]},
            flierprops={
                "marker": "o",
                "markersize": 2.4,
                "markerfacecolor": "none",
                "markeredgecolor": colours[name],
                "markeredgewidth": 0.6,
                "rasterized": len(one.outliers) > MAX_OUTLIERS,
            },
        )


def _thinned(outliers: F64) -> F64:
    """At most as many outliers as can be seen, the farthest among them."""
    if len(outliers) <= MAX_OUTLIERS:
        return outliers
    return outliers[np.linspace(0, len(outliers) - 1, MAX_OUTLIERS).round().astype(int)]


def _draw_swarm(axes: Axes, place: int, values: F64, name: str) -> None:
    """The simulations of one class as points that do not hide each other."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches() * _POINTS_PER_INCH
    low, high = axes.get_ylim()
    # The axes take about these shares of the figure once labels have their room.
    tall, wide = (0.40, 0.86) if is_narrow() else (0.80, 0.43)
    up, across = tall * height / (high - low), wide * width / len(palette.CLASS_COLOURS)
    offsets = swarm_offsets(values * up, _POINT) / across
    axes.scatter(
        place + np.clip(offsets, -_ROOM, _ROOM),
        values,
        s=_POINT**2,
        marker=palette.CLASS_MARKERS[name],
        color=palette.CLASS_COLOURS[name],
        linewidth=0.0,
    )


def swarm_offsets(heights: F64, diameter: float) -> F64:
    """How far aside each point goes so that none hides another.

    From the lowest to the highest, each point takes the free place nearest to the middle.

    Args:
        heights: Height of each point, shape (point,), in the unit of `diameter`.
        diameter: Diameter of a point.

    Returns:
        Offset of each point, same shape and unit.
    """
    offsets = np.zeros(len(heights))
    placed: list[int] = []
    for point in np.argsort(heights, kind="stable"):
        near = [one for one in placed if heights[point] - heights[one] < diameter]
        placed = [*near, int(point)]
        if near:
            others = np.array(near)
            apart = np.sqrt(diameter**2 - (heights[point] - heights[others]) ** 2)
            places = np.concatenate([[0.0], offsets[others] + apart, offsets[others] - apart])
            places = places[np.argsort(np.abs(places), kind="stable")]
            free = (np.abs(places[:, None] - offsets[others]) >= apart - 1e-9).all(axis=1)
            offsets[point] = places[free][0]
    return offsets


@styled
def draw_waiting(curve: Survival, last: float) -> Figure:
    """The curve of Kaplan and Meier with its limits and its median.

    Args:
        curve: `analysis.stats.survival.waiting_time`.
        last: Where the time axis ends: the longest waiting time of all [s].
    """
    figure, axes = single_axes(2.7)
    time = np.concatenate([[0.0], curve.time, [max(last, *curve.time, 1e-3)]])

    def stairs(values: np.ndarray) -> np.ndarray:
        return np.concatenate([[1.0], values, values[-1:] if len(values) else [1.0]])

    axes.fill_between(
        time, stairs(curve.low), stairs(curve.high), step="post", color=palette.ACCENT, alpha=0.16,
        linewidth=0.0,
    )  # fmt: skip
    axes.step(time, stairs(curve.survival), where="post", color=palette.ACCENT, linewidth=1.6)
    if not math.isnan(curve.median):
        is_late = curve.median > 0.6 * time[-1]  # Right of the line there would be no room.
        axes.plot(
            [0.0, curve.median, curve.median], [0.5, 0.5, 0.0], color=palette.LINE, linewidth=0.9
        )
        axes.annotate(
            f"half have begun after {curve.median:.2f} s",
            (curve.median, 0.5),
            (-6, 4) if is_late else (6, 4),
            textcoords="offset points",
            ha="right" if is_late else "left",
            color=palette.INK,
        )
    axes.set(xlim=(0.0, time[-1]), ylim=(0.0, 1.03))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set(xlabel="waiting time, WT [s]", ylabel="still waiting")
    remark(axes, f"{curve.num_events:,} began, {curve.num_censored:,} censored")
    return figure
