"""Box plots, and the swarm of single simulations."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import Feature
from overtaking.analysis.stats.distributions import Box, Points
from overtaking.analysis.stats.sample import Sample
from overtaking.show.plots.style import (
    ACCENT,
    CLASS_COLOURS,
    CLASS_MARKERS,
    INK,
    QUIET,
    is_narrow,
    lightened,
    new_figure,
    say_nothing_to_draw,
    styled,
    words,
)

F64 = NDArray[np.float64]

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
    figure = new_figure(2.9)
    axes = figure.add_subplot()
    _draw_boxes(axes, boxes, dict.fromkeys(boxes, ACCENT))
    axes.set_xticks(range(len(boxes)), list(boxes))
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
    _draw_boxes(left, boxes, CLASS_COLOURS)
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
    for axes in (left, right):
        axes.set_xticks(range(len(boxes)), labels)
        axes.set_xlim(-0.55, len(boxes) - 0.45)
    left.set_ylabel(f"{feature.title}, {feature.label}")
    if any(one.is_sampled for one in points.values()):
        right.set_title("a sample of each class", color=QUIET, weight="normal", size=7.5)
    return figure


def _draw_boxes(axes: Axes, boxes: Mapping[str, Box], colours: Mapping[str, str]) -> None:
    """Boxes beside each other, from their numbers."""
    for place, (name, one) in enumerate(boxes.items()):
        if not one.count:
            continue
        numbers = {
            "q1": one.quartiles[0],
            "med": one.quartiles[1],
            "q3": one.quartiles[2],
            "whislo": one.whiskers[0],
            "whishi": one.whiskers[1],
            "fliers": _thinned(one.outliers),
        }
        axes.bxp(
            [numbers],
            positions=[place],
            widths=0.56,
            patch_artist=True,
            manage_ticks=False,
            boxprops={"facecolor": lightened(colours[name], 0.35), "edgecolor": colours[name]},
            medianprops={"color": INK, "linewidth": 1.4},
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
    up, across = tall * height / (high - low), wide * width / len(CLASS_COLOURS)
    offsets = swarm_offsets(values * up, _POINT) / across
    axes.scatter(
        place + np.clip(offsets, -_ROOM, _ROOM),
        values,
        s=_POINT**2,
        marker=CLASS_MARKERS[name],
        color=CLASS_COLOURS[name],
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
