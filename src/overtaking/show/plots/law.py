"""Figures of the law: legal overtakes as tolerances are relaxed, and which rule decides."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import PercentFormatter

from overtaking.analysis.law_statistics import TOLERANCE_SCALES
from overtaking.show import palette
from overtaking.show.plots.style import is_narrow, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from overtaking.analysis.law_statistics import ToleranceCurve

_COLUMN_LETTERS = 22  # Of the title of a rule beside its bar, in narrow figures.
_TITLES = {
    "distance": "distances shorter by",
    "speed": "speeds beyond by",
    "time": "times beyond by",
    "duration": "breaches no longer than",
}


@styled
def draw_curve(curve: ToleranceCurve) -> Figure:
    """Share of legal overtakes by each tolerance; below, the rules that are broken, and alone.

    Args:
        curve: `analysis.law_statistics.tolerance_curve` returns it.
    """
    codes = [code for code, count in curve.broken.items() if count]
    num_panels = len(TOLERANCE_SCALES)
    num_rows, num_columns = (num_panels // 2, 2) if is_narrow() else (1, num_panels)
    curves_height, bars_height = 1.9 * num_rows, 0.4 + 0.19 * max(len(codes), 1)
    figure = new_figure(curves_height + bars_height + 0.2)
    parts = figure.add_gridspec(2, 1, height_ratios=(curves_height, bars_height))
    grid = parts[0].subgridspec(num_rows, num_columns).subplots(sharey=True)
    panels: list[Axes] = list(np.ravel(grid))  # pyright: ignore[reportArgumentType, reportCallIssue]
    num_overtakes = max(curve.overtakes, 1)
    for axes, (name, counts) in zip(panels, curve.legal_by_tolerance.items(), strict=True):
        scale, shares = TOLERANCE_SCALES[name], np.array(counts) / num_overtakes
        axes.plot(
            scale.values, shares, color=palette.ACCENT, linewidth=1.4, marker="o", markersize=2.8
        )
        axes.set(xlabel=f"{_TITLES[name]}\n[{scale.result_unit}]", ylim=(0.0, 1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    panels[0].set_ylabel("legal")
    panels[0].set_title(f"{curve.overtakes:,} overtakes by {curve.rule_set}, policy {curve.policy}")
    _draw_bars(figure.add_subplot(parts[1]), curve, codes)
    return figure


def _label(curve: ToleranceCurve, code: str) -> str:
    """Title and code of a rule; narrow figures shorten the title."""
    title = curve.titles[code]
    if is_narrow():
        title = shorten(title, _COLUMN_LETTERS, placeholder=" …")
    return f"{title} {code}"


def _draw_bars(axes: Axes, curve: ToleranceCurve, codes: list[str]) -> None:
    """Shares of overtakes that break each rule, and of those that break no other."""
    num_overtakes, positions = max(curve.overtakes, 1), np.arange(len(codes))
    for counts, colour, label in (
        (curve.broken, palette.LINE, "break it"),
        (curve.broken_alone, palette.ACCENT, "break it alone"),
    ):
        shares = [counts[code] / num_overtakes for code in codes]
        axes.barh(positions, shares, height=0.7, color=colour, label=label)
    axes.set_yticks(positions, [_label(curve, code) for code in codes])
    axes.tick_params(axis="y", labelcolor=palette.INK)
    axes.invert_yaxis()
    axes.grid(visible=True, axis="x", color=palette.GRID)
    axes.grid(visible=False, axis="y")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("share of the overtakes")
    if codes:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
