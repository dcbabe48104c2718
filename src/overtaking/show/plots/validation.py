"""A profile beside real traffic: every figure with its interval, on the scale of its target."""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from overtaking.analysis.validation.figures import Figure
from overtaking.analysis.validation.run import Validation
from overtaking.show.plots.style import ACCENT, GRID, INK, QUIET, new_figure, styled

MET, MISSED = ACCENT, "#d55e00"
"""Colours of a figure that meets its target and of one that does not; the mark differs, too."""

_ROOM = 0.6  # Beside the target, over its width.


@styled
def draw_validation(found: Validation) -> Drawing:
    """One strip for each figure that has a target: the target as a band, the figure as a mark.

    Args:
        found: What `analysis.validation.run.validate` returned.
    """
    judged = [one for one in found.figures if one.met is not None]
    drawing = new_figure(0.3 + 0.46 * len(judged))
    panels = drawing.subplots(len(judged), 1, squeeze=False)[:, 0]
    for axes, figure in zip(panels, judged, strict=True):
        _draw_strip(axes, figure)
    drawing.suptitle(
        f"{found.profile}: {found.simulations:,} simulations beside measured traffic",
        x=0.02,
        ha="left",
        fontsize=9.0,
        fontweight="bold",
    )
    return drawing


def _draw_strip(axes: Axes, figure: Figure) -> None:
    low, high = _scale(figure)
    begin = low if figure.target_low is None else figure.target_low
    end = high if figure.target_high is None else figure.target_high
    colour = MET if figure.met else MISSED
    axes.axvspan(begin, end, color=GRID, linewidth=0)
    if not math.isnan(figure.value):
        ends = [min(max(value, low), high) for value in (figure.low, figure.high)]
        axes.plot(ends, [0.0, 0.0], color=colour, linewidth=1.6, solid_capstyle="butt")
        place = min(max(figure.value, low), high)
        axes.plot([place], [0.0], "o" if figure.met else "X", color=colour, markersize=5.0)
    axes.set_xlim(low, high)
    axes.set_ylim(-1.0, 1.0)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[["left"]].set_visible(False)
    unit = f" {figure.unit}" if figure.unit else ""
    unit, title = (text.replace("^2", "²") for text in (unit, figure.title))
    axes.set_title(title, fontweight="normal", fontsize=7.5, color=INK, pad=2.0)
    said = f"{figure.value:.3g}{unit}" if not math.isnan(figure.value) else "nothing counted"
    axes.text(1.0, 1.02, said, transform=axes.transAxes, ha="right", va="bottom", color=colour)
    axes.tick_params(axis="x", labelsize=6.5, labelcolor=QUIET, pad=1.5)


def _scale(figure: Figure) -> tuple[float, float]:
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
