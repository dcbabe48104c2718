"""One overtake in space and time, with its phases."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import NO_ATTEMPT
from overtaking.analysis.stats.diagrams import Diagram, Track
from overtaking.core.units import kmh_from_mps
from overtaking.show import palette
from overtaking.show.plots.style import PHASE_COLOURS, figure_width, new_figure, styled

_OTHERS = "#9aa1aa"
_SKY = "#56b4e9"  # Of the same palette; the grey of No_attempt would be lost among the others.
_LETTER_IN = 0.06  # Width of a letter [inch].
_BESIDE_AXIS = 0.9  # Sum of the margins left and right of the time axis [inch].
_NAME_HEIGHT = 0.07  # Height of a name, in heights of the upper panel.


@styled
def draw_overtake(one: Diagram, name: str) -> Figure:
    """Position along the road above, position across it below, phases behind both.

    Args:
        one: `analysis.stats.diagrams.diagram`.
        name: The class of the simulation, for the ego's colour.
    """
    figure = new_figure(4.6)
    along, across = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    colour = palette.CLASS_COLOURS[name] if name != NO_ATTEMPT else _SKY
    for axes in (along, across):
        axes.grid(visible=False)
        _draw_phases(axes, one)
        axes.set_xlim(one.time[0], max(one.time[-1], one.time[0] + 1e-3))
    draw_along(along, one, colour)
    _draw_across(across, one, colour)
    _name_phases(along, one)
    _name_marks(across, one)
    across.set_xlabel("time [s]", labelpad=18)
    figure.align_ylabels([along, across])
    return figure


def _draw_phases(axes: Axes, one: Diagram) -> None:
    """A band for each phase, a line for each event."""
    for phase in one.phases:
        axes.axvspan(
            phase.begin, phase.end, facecolor=PHASE_COLOURS[phase.name], linewidth=0, zorder=0
        )
    for symbol, time in one.marks:
        hit, others = (
            (palette.CLASS_COLOURS["Unsuccess_col"], 1.2, "-"),
            (palette.LINE, 0.7, (0, (3, 2))),
        )
        colour, width, style = hit if symbol == "collision" else others
        axes.axvline(time, color=colour, linewidth=width, linestyle=style, zorder=0.5)


def draw_along(axes: Axes, one: Diagram, colour: str) -> None:
    """Position of every vehicle along the road, from rear to front bumper."""
    for track in reversed(one.tracks):
        _draw_track(axes, one, track, track.ahead, track.length, colour)
    speed_kmh = kmh_from_mps(one.reference_speed)
    axes.set_ylabel(f"along the road, from a mark\nthat moves at {speed_kmh:.0f} km/h [m]")
    _name_tracks(axes, one, colour)


def _draw_across(axes: Axes, one: Diagram, colour: str) -> None:
    """Where ego and target are across the road, from side to side of their bodies."""
    for place, is_solid in one.lines:
        width, style = (1.0, "-") if is_solid else (0.8, (0, (6, 5)))
        axes.axhline(place, color=palette.QUIET, linewidth=width, linestyle=style, zorder=1)
    for track in reversed(one.tracks):
        width = track.width if track.is_ego or track.is_target else 0.0
        _draw_track(axes, one, track, track.lateral, width, colour)
    low, high = one.lines[0][0], one.lines[-1][0]
    reach = [track.lateral for track in one.tracks if track.is_ego]
    low = min([low, *(float(one.min()) for one in reach)])
    high = max([high, *(float(one.max()) for one in reach)])
    axes.set_ylim(low - 0.6, high + 0.6)
    axes.set_ylabel("across it, fast side up [m]")


def _draw_track(
    axes: Axes, one: Diagram, track: Track, middle: NDArray[np.float64], size: float, colour: str
) -> None:
    """The middle of a vehicle over time, in a band of its size."""
    shade, strength = _colour(track, colour)
    if size:
        low, high = middle - size / 2.0, middle + size / 2.0
        band: dict[str, Any] = {"color": shade, "alpha": strength, "linewidth": 0.0, "zorder": 2}
        axes.fill_between(one.time, low, high, **band)
    axes.plot(one.time, middle, color=shade, linewidth=_thickness(track), zorder=3)


def _colour(track: Track, colour: str) -> tuple[str, float]:
    """Colour and strength of a vehicle's band."""
    if track.is_ego:
        return colour, 0.45
    return (palette.INK, 0.28) if track.is_target else (_OTHERS, 0.22)


def _thickness(track: Track) -> float:
    return 1.5 if track.is_ego else 1.1 if track.is_target else 0.6


def _name_tracks(axes: Axes, one: Diagram, colour: str) -> None:
    """The vehicles' names at the ends of their lines, moved apart where they would overlap."""
    low, high = axes.get_ylim()
    ends = np.array([track.ahead[-1] for track in one.tracks], np.float64)
    named = np.flatnonzero(np.isfinite(ends))  # Who is removed has no end.
    places = moved_apart(ends[named], _NAME_HEIGHT * (high - low))
    for place, track in zip(places, (one.tracks[k] for k in named), strict=True):
        text = "ego" if track.is_ego else "target" if track.is_target else str(track.slot)
        axes.annotate(
            text, (float(one.time[-1]), place), (4, 0), textcoords="offset points", va="center",
            color=_colour(track, colour)[0], weight="bold" if track.is_ego else "normal", size=8,
            annotation_clip=False,
        )  # fmt: skip


def moved_apart(places: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Places in the same order, at least so far from each other, moved as little as that takes.

    Args:
        places: Places on an axis, shape (place,).
        least: Least distance between two of them.

    Source:
        Least squares under an order, by pooling those that violate it (Barlow et al. 1972).
    """
    order = np.argsort(places, kind="stable")
    room = least * np.arange(len(places))
    pools: list[list[float]] = []
    for one in (places[order] - room).tolist():
        pools.append([one])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    moved = np.empty_like(places)
    moved[order] = [np.mean(pool) for pool in pools for _ in pool] + room
    return moved


def _name_phases(axes: Axes, one: Diagram) -> None:
    """The name of each phase above its band, where it has room."""
    whole = float(one.time[-1] - one.time[0]) or 1.0
    for phase in one.phases:
        width = (phase.end - phase.begin) / whole
        if width < _letter() * len(phase.name):
            continue
        axes.text(
            (phase.begin + phase.end) / 2.0, 1.02, phase.name, ha="center", va="bottom",
            color=palette.QUIET, size=8, transform=axes.get_xaxis_transform(),
        )  # fmt: skip


def _letter() -> float:
    """Width of a letter, in lengths of the time axis."""
    return _LETTER_IN / (figure_width() - _BESIDE_AXIS)


def _name_marks(axes: Axes, one: Diagram) -> None:
    """The symbol of each event below the time axis; one that has no room goes a line down."""
    whole = float(one.time[-1] - one.time[0]) or 1.0
    end, is_down = -1.0, False
    for symbol, time in sorted(one.marks, key=lambda mark: mark[1]):
        half = 0.5 * _letter() * (len(symbol) + 1) * whole
        is_down = time - half < end and not is_down
        end = time + half
        axes.annotate(
            symbol, (time, 0.0), (0, -24 if is_down else -15),
            xycoords=axes.get_xaxis_transform(), textcoords="offset points", ha="center", va="top",
            color=palette.INK, size=8, style="italic", annotation_clip=False,
        )  # fmt: skip
