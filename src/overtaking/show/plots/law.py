"""Figures of the law: legal overtakes as tolerances are relaxed, and which rule decides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import PercentFormatter

from overtaking.analysis.law.curve import STEPS
from overtaking.show import palette
from overtaking.show.plots.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from overtaking.analysis.law.curve import Curve

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
        found: `analysis.law.curve.curve`.
    """
    codes = [code for code, count in found.broken.items() if count]
    figure = new_figure(2.5 + 0.17 * max(len(codes), 1))
    rows = figure.add_gridspec(2, 1, height_ratios=(1.9, 0.4 + 0.17 * max(len(codes), 1)))
    panels: list[Axes] = list(rows[0].subgridspec(1, len(STEPS)).subplots(sharey=True))  # pyright: ignore[reportArgumentType]
    whole = max(found.overtakes, 1)
    for axes, (name, counts) in zip(panels, found.relaxed.items(), strict=True):
        _, unit, values = STEPS[name]
        shares = np.array(counts) / whole
        axes.plot(values, shares, color=palette.ACCENT, linewidth=1.4, marker="o", markersize=2.8)
        axes.set(xlabel=f"{_TITLES[name]} [{unit}]", ylim=(0.0, 1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    panels[0].set_ylabel("legal")
    panels[0].set_title(f"{found.overtakes:,} overtakes by {found.pack}, {found.policy}")
    _bars(figure.add_subplot(rows[1]), found, codes)
    return figure


def _bars(axes: Axes, found: Curve, codes: list[str]) -> None:
    """How many overtakes break each rule, and how many break no other."""
    whole, places = max(found.overtakes, 1), np.arange(len(codes))
    for counts, colour, label in (
        (found.broken, palette.LINE, "break it"),
        (found.alone, palette.ACCENT, "break it alone"),
    ):
        shares = [counts[code] / whole for code in codes]
        axes.barh(places, shares, height=0.7, color=colour, label=label)
    axes.set_yticks(places, [f"{found.titles[code]} {code}" for code in codes])
    axes.tick_params(axis="y", labelcolor=palette.INK)
    axes.invert_yaxis()
    axes.grid(visible=True, axis="x", color=palette.GRID)
    axes.grid(visible=False, axis="y")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("share of the overtakes")
    if codes:
        axes.legend(loc="lower right")
