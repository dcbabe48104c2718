"""Numbers beside published ones: a reproduction of the paper, and a profile beside traffic."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from overtaking.analysis.reproduction.run import Comparison
from overtaking.analysis.reproduction.statements import ALL
from overtaking.analysis.validation.figures import Figure as Measured
from overtaking.analysis.validation.run import Validation
from overtaking.core.arrays import F64
from overtaking.show import palette
from overtaking.show.plots.style import is_narrow, lightened, new_figure, remark, styled, words

_ROW, _HEAD = 0.3, 0.62  # Height of a ridge, and of title and axis of a panel [inch].
_LEFT, _RIGHT = 1.08, 0.46  # Labels left, percentiles right [inch].
_BINS = 56  # Over the width of a panel.
_RIDGE = 0.82  # Height of the highest bin, where rows are 1 apart.


@dataclass(frozen=True, slots=True, kw_only=True)
class Ridge:
    """One number.

    Attributes:
        label: Text beside it.
        of: The paper's number among ours.
    """

    label: str
    of: Comparison


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Numbers on one axis.

    Attributes:
        title: What they are about.
        unit: Their unit.
        ridges: From the top down.
    """

    title: str
    unit: str
    ridges: tuple[Ridge, ...]

    @property
    def height(self) -> float:
        """How much room it needs [inch]."""
        return _HEAD + _ROW * len(self.ridges)


def panels(comparisons: Sequence[Comparison]) -> list[Panel]:
    """A panel for each group of numbers that simulations give, in their order.

    Args:
        comparisons: Of a reproduction.
    """
    groups: dict[tuple[str, str], list[Comparison]] = {}
    for one in comparisons:
        if not one.is_design:
            groups.setdefault((one.statement.about, one.statement.unit), []).append(one)
    return [
        Panel(title=about, unit=unit, ridges=tuple(_ridge(one, group) for one in group))
        for (about, unit), group in groups.items()
    ]


def _ridge(one: Comparison, group: Sequence[Comparison]) -> Ridge:
    """A number with as much of its name as tells it from the others of its group."""
    said = one.statement
    different = len({other.statement.text for other in group}) > 1
    parts = [] if said.outcome_class == ALL else [words(said.outcome_class)]
    if different or said.outcome_class == ALL:
        parts.append(said.text)
    return Ridge(label=", ".join(parts), of=one)


@styled
def draw_ridges(panels: Sequence[Panel]) -> Figure:
    """Panels in two columns, in the order given, the first from the top of the left one.

    Args:
        panels: What to draw.
    """
    columns = _columns(panels)
    height = max(sum(one.height for one in column) for column in columns)
    figure = new_figure(height + 0.4, is_fixed=True)
    for side, column in enumerate(columns):
        _draw_column(figure, column, side / len(columns), 1.0 / len(columns))
    _add_legend(figure)
    return figure


def _columns(panels: Sequence[Panel]) -> list[list[Panel]]:
    """The panels in two columns of about the same height; in one column in narrow figures."""
    if is_narrow():
        return [list(panels)]
    total = sum(one.height for one in panels)
    heights = np.cumsum([one.height for one in panels])
    first = 1 + int(np.argmin(np.abs(heights - 0.5 * total)))
    return [part for part in (list(panels[:first]), list(panels[first:])) if part]


def _draw_column(figure: Figure, panels: Sequence[Panel], begin: float, share: float) -> None:
    """Draw panels below each other; the rest of the column stays empty.

    Args:
        figure: The figure.
        panels: Panels of the column, from top to bottom.
        begin: Left edge of the column, as a share of the width of the figure.
        share: Width of the column, as a share of the width of the figure.
    """
    width, tall = figure.get_size_inches()
    top = tall - _top()
    across = share * width
    for one in panels:
        axes_height = _ROW * len(one.ridges)
        bottom = top - axes_height
        left = _LEFT + begin * width
        size = ((across - _LEFT - _RIGHT) / width, axes_height / tall)
        _draw_panel(figure.add_axes((left / width, bottom / tall, *size)), one)
        top -= one.height


def _top() -> float:
    """Room for the legend above the panels [inch]; narrow figures have one entry per line."""
    return 0.92 if is_narrow() else 0.62


def _draw_panel(axes: Axes, panel: Panel) -> None:
    """Ridges on one axis."""
    unit = f" [{panel.unit}]" if panel.unit else ""
    axes.set_title(f"{panel.title}{unit}", pad=4)
    low, high = _ends(panel.ridges)
    axes.set(xlim=(low, high), ylim=(-0.12, len(panel.ridges) - 0.02))
    axes.spines["left"].set_visible(False)
    axes.grid(visible=True, axis="x")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="x", labelsize=8.0, pad=2)
    places = [len(panel.ridges) - 1 - row for row in range(len(panel.ridges))]
    axes.set_yticks([place + 0.22 for place in places], [one.label for one in panel.ridges])
    axes.tick_params(axis="y", labelsize=8.0, labelcolor=palette.INK)
    for place, one in zip(places, panel.ridges, strict=True):
        _draw_ridge(axes, place, one.of, (low, high))


def _draw_ridge(axes: Axes, place: int, one: Comparison, ends: tuple[float, float]) -> None:
    """The replicates of one number as a hill, and the paper's number as a diamond."""
    colour, paper = (
        palette.CLASS_COLOURS.get(one.statement.outcome_class, palette.ACCENT),
        one.statement.quoted,
    )
    if len(one.known):
        counts, edges = _bins(one, (ends[1] - ends[0]) / _BINS)
        axes.stairs(
            place + _RIDGE * counts / counts.max(),
            edges,
            baseline=place,
            fill=True,
            facecolor=lightened(colour, 0.45),
            edgecolor=colour,
            linewidth=0.7,
        )
    axes.axhline(place, color=colour, linewidth=0.5, alpha=0.6)
    axes.plot(
        [paper], [place + 0.22], "D", color=palette.INK, markersize=4.2, clip_on=False, zorder=5
    )
    beside: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "center", "size": 8.0}
    axes.text(1.02, place + 0.22, percent(one.percentile), color=palette.QUIET, **beside)


def _bins(one: Comparison, width: float) -> tuple[F64, F64]:
    """A histogram whose bins have a width, or hold as many whole numbers each."""
    values = one.known
    if one.is_count:
        width = max(1.0, float(np.rint(width)))
    first = width * (np.floor(values.min() / width) - 0.5)
    number = int(np.ceil((values.max() - first) / width + 1e-9))
    edges = first + width * np.arange(number + 1)
    counts, _ = np.histogram(values, edges)
    return counts.astype(np.float64), edges


def percent(percentile: float) -> str:
    """A percentile in few letters; the ends are marked as ends."""
    if percentile != percentile:
        return ""
    if percentile <= 0.0:
        return "below"
    return "above" if percentile >= 100.0 else f"{percentile:.3g} %"


def _ends(ridges: Sequence[Ridge]) -> tuple[float, float]:
    """Ends of the axis: all that is drawn, and a little room."""
    values = np.concatenate([np.append(one.of.known, one.of.statement.quoted) for one in ridges])
    room = 0.06 * float(np.ptp(values)) or 1.0
    return float(values.min()) - room, float(values.max()) + room


def _add_legend(figure: Figure) -> None:
    handles = [
        Line2D(
            [], [], marker="D", linestyle="", color=palette.INK, markersize=4.2, label="the paper"
        ),
        Patch(
            facecolor=lightened(palette.QUIET, 0.45),
            edgecolor=palette.QUIET,
            linewidth=0.7,
            label="our replicates",
        ),
        Patch(
            facecolor="none",
            edgecolor="none",
            label="right of each: share of the\nreplicates below the paper's number"
            if is_narrow()
            else "right of each: share of the replicates below the paper's number",
        ),
    ]
    figure.legend(
        handles=handles, loc="upper center", ncols=1 if is_narrow() else 3, columnspacing=1.4
    )


MET, MISSED = palette.ACCENT, "#d55e00"
"""Colours of a figure that meets its target and of one that does not; the mark differs, too."""

_COLUMN_LETTERS = 40  # Letters per line of a title above a strip, in narrow figures.
_ROOM = 0.6  # Beside the target, over its width.


@styled
def draw_validation(found: Validation) -> Figure:
    """One strip for each figure that has a target: the target as a band, the figure as a mark.

    Args:
        found: What `analysis.validation.run.validate` returned.
    """
    judged = [one for one in found.figures if one.has_target and not one.needs_km]
    drawing = new_figure(0.4 + (0.66 if is_narrow() else 0.48) * len(judged))
    panels = drawing.subplots(len(judged), 1, squeeze=False)[:, 0]
    for axes, figure in zip(panels, judged, strict=True):
        _draw_strip(axes, figure)
    drawing.suptitle(
        f"{found.profile}: {found.simulations:,} simulations"
        f"{chr(10) if is_narrow() else ' '}beside the limits of each figure",
        x=0.02,
        ha="left",
        fontsize=9.0,
        fontweight="bold",
    )
    return drawing


def _draw_strip(axes: Axes, figure: Measured) -> None:
    low, high = _scale(figure)
    begin = low if figure.target_low is None else figure.target_low
    end = high if figure.target_high is None else figure.target_high
    colour = palette.QUIET if figure.met is None else MET if figure.met else MISSED
    axes.axvspan(begin, end, color=palette.GRID, linewidth=0)
    if not math.isnan(figure.value):
        ends = [min(max(value, low), high) for value in (figure.low, figure.high)]
        axes.plot(ends, [0.0, 0.0], color=colour, linewidth=1.6, solid_capstyle="butt")
        place = min(max(figure.value, low), high)
        axes.plot([place], [0.0], "o" if figure.met else "X", color=colour, markersize=5.0)
    axes.set(xlim=(low, high), ylim=(-1.0, 1.0), yticks=[])
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)
    unit = f" {figure.unit}" if figure.unit else ""
    described = f"{figure.title} ({figure.standing})"
    unit, title = (text.replace("^2", "²") for text in (unit, described))
    if is_narrow():  # Title and value would overlap above the strip.
        title = f"{fill(title, _COLUMN_LETTERS)}:"
    axes.set_title(title, fontweight="normal", fontsize=8.0, color=palette.INK, pad=2.0)
    said = f"{figure.value:.3g}{unit}" if not math.isnan(figure.value) else "not measured"
    remark(axes, said, color=colour)
    axes.tick_params(axis="x", labelsize=8.0, labelcolor=palette.QUIET, pad=1.5)


def _scale(figure: Measured) -> tuple[float, float]:
    """Ends of the axis: around the target, wide enough for the value where that is near."""
    limits = [one for one in (figure.target_low, figure.target_high) if one is not None]
    values = [one for one in (figure.value, figure.low, figure.high) if not math.isnan(one)]
    width = max(limits) - min(limits) or abs(limits[0]) or 1.0
    low = min([min(limits) - _ROOM * width, *values])
    high = max([max(limits) + _ROOM * width, *values])
    if figure.target_low is None:
        low = 0.0
    if not figure.unit and figure.target_low is not None and figure.target_high is None:
        low, high = max(0.0, min([1.0 - 3.0 * (1.0 - figure.target_low), *values])), 1.0
    return low, high
