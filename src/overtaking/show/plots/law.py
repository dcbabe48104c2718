"""Figures of the law: legal overtakes as tolerances are relaxed, and which rule decides."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import PercentFormatter

from overtaking.analysis.law_statistics import STEPS
from overtaking.show import palette
from overtaking.show.plots.style import is_narrow, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from overtaking.analysis.law_statistics import Curve

_COLUMN_LETTERS = 22  # Of the title of a rule beside its bar, in narrow figures.
_TITLES = {
    "distance": "distances shorter by",
    "speed": "speeds beyond by",
    "time": "times beyond by",
    "lasting": "breaches no longer than",
}


@styled
def draw_curve(found: Curve) -> Figure:
    """Share of legal overtakes by each tolerance; below, the rules that are broken, and alone.

    Args:
        found: `analysis.law_statistics.curve`.
    """
    codes = [code for code, count in found.broken.items() if count]
    down, across = (len(STEPS) // 2, 2) if is_narrow() else (1, len(STEPS))
    above, below = 1.9 * down, 0.4 + 0.19 * max(len(codes), 1)
    figure = new_figure(above + below + 0.2)
    rows = figure.add_gridspec(2, 1, height_ratios=(above, below))
    grid = rows[0].subgridspec(down, across).subplots(sharey=True)
    panels: list[Axes] = list(np.ravel(grid))  # pyright: ignore[reportArgumentType, reportCallIssue]
    whole = max(found.overtakes, 1)
    for axes, (name, counts) in zip(panels, found.relaxed.items(), strict=True):
        _, unit, values = STEPS[name]
        shares = np.array(counts) / whole
        axes.plot(values, shares, color=palette.ACCENT, linewidth=1.4, marker="o", markersize=2.8)
        axes.set(xlabel=f"{_TITLES[name]}\n[{unit}]", ylim=(0.0, 1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    panels[0].set_ylabel("legal")
    panels[0].set_title(f"{found.overtakes:,} overtakes by {found.pack}, policy {found.policy}")
    _bars(figure.add_subplot(rows[1]), found, codes)
    return figure


def _label(curve: Curve, code: str) -> str:
    """Title and code of a rule; narrow figures shorten the title."""
    title = curve.titles[code]
    if is_narrow():
        title = shorten(title, _COLUMN_LETTERS, placeholder=" …")
    return f"{title} {code}"


def _bars(axes: Axes, found: Curve, codes: list[str]) -> None:
    """How many overtakes break each rule, and how many break no other."""
    whole, places = max(found.overtakes, 1), np.arange(len(codes))
    for counts, colour, label in (
        (found.broken, palette.LINE, "break it"),
        (found.alone, palette.ACCENT, "break it alone"),
    ):
        shares = [counts[code] / whole for code in codes]
        axes.barh(places, shares, height=0.7, color=colour, label=label)
    axes.set_yticks(places, [_label(found, code) for code in codes])
    axes.tick_params(axis="y", labelcolor=palette.INK)
    axes.invert_yaxis()
    axes.grid(visible=True, axis="x", color=palette.GRID)
    axes.grid(visible=False, axis="y")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("share of the overtakes")
    if codes:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
