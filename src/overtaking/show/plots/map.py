"""The roads of a map from above: which can be simulated, and where the others are."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from overtaking.model.road import Road
from overtaking.recordings.opendrive_map import MappedRoad
from overtaking.show.palette import ACCENT, INK, LINE
from overtaking.show.plots.style import (
    add_legend,
    figure_width,
    is_narrow,
    say_nothing_to_draw,
    single_axes,
    styled,
)

_STEP = 2.0  # Between the points of a drawn line [m].
_MOST_POINTS = 20_000  # Of one line.
_MOST_NAMES, _MOST_NAMES_IF_NARROW = 40, 12  # More names would hide the map.
_STYLES: dict[str, dict[str, Any]] = {
    "can be simulated": {"color": ACCENT, "linewidth": 2.4, "zorder": 3.0},
    "cannot be simulated": {"color": INK, "linewidth": 0.9, "zorder": 2.0},
    "way across a junction": {"color": LINE, "linewidth": 0.5, "zorder": 1.0},
}
_HEIGHTS = (2.4, 8.0)  # Least and greatest height of the picture [inch].


@styled
def draw_map(roads: Sequence[MappedRoad]) -> Figure:
    """The reference lines of a map, with the ids of its longest roads.

    Args:
        roads: The result of `list_opendrive_roads`.
    """
    drawn = [road for road in roads if road.line is not None]
    if not drawn:
        figure, axes = single_axes(_HEIGHTS[0])
        say_nothing_to_draw(axes)
        return figure
    lines = {kind: [_points(road) for road in drawn if _kind(road) == kind] for kind in _STYLES}
    # What is simulated of a road lies over the whole of it.
    lines["cannot be simulated"] += [_points(road) for road in drawn if _is_part(road)]
    lines["can be simulated"] = [_simulated(road.road) for road in drawn if road.road is not None]
    every = np.concatenate([points for found in lines.values() for points in found])
    wide, high = np.ptp(every, axis=0)
    height = float(np.clip(figure_width() * high / max(wide, 1.0) + 0.9, *_HEIGHTS))
    figure, axes = single_axes(height)
    for kind, style in _STYLES.items():
        axes.add_collection(LineCollection(lines[kind], capstyle="butt", **style), autolim=True)
    _name(axes, drawn)
    axes.autoscale_view()
    axes.set(aspect="equal", adjustable="datalim", xlabel="x [m]", ylabel="y [m]")
    axes.grid(visible=False)
    marks = [Line2D([], [], label=kind, **style) for kind, style in _STYLES.items()]
    columns = 1 if is_narrow() else 3
    add_legend(figure, axes, marks, columns=columns)
    return figure


def _kind(road: MappedRoad) -> str:
    if road.in_junction:
        return "way across a junction"
    return "cannot be simulated" if road.road is None else "can be simulated"


def _is_part(road: MappedRoad) -> bool:
    return road.part is not None and not road.part.is_whole


def _simulated(road: Road) -> np.ndarray:
    """Points of the line of a road as it is simulated, shape (point, 2) [m]."""
    count = int(np.clip(road.length / _STEP, 2, _MOST_POINTS))
    return np.stack(road.to_world(np.linspace(0.0, road.length, count), 0.0), axis=-1)


def _points(road: MappedRoad) -> np.ndarray:
    """Points of the reference line, shape (point, 2) [m]."""
    assert road.line is not None
    count = int(np.clip(road.length / _STEP, 2, _MOST_POINTS))
    pose = road.line.pose_at(np.linspace(0.0, road.line.length, count))
    return np.stack([pose.x, pose.y], axis=-1)


def _name(axes: Axes, roads: Sequence[MappedRoad]) -> None:
    """Write ids beside the middle of roads, the longest of those that are no way across first."""
    named = sorted((road for road in roads if not road.in_junction), key=lambda each: -each.length)
    for road in named[: _MOST_NAMES_IF_NARROW if is_narrow() else _MOST_NAMES]:
        assert road.line is not None
        x, y = road.line.to_world(road.line.length * 0.5, 0.0)
        axes.annotate(
            road.road_id,
            (float(x), float(y)),
            ha="center",
            va="center",
            fontsize=8.0,
            color=ACCENT if road.road is not None else INK,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
            zorder=4.0,
        )
