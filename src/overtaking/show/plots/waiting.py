"""How many drivers are still waiting."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from overtaking.analysis.stats.survival import Survival
from overtaking.show.plots.style import ACCENT, INK, LINE, QUIET, new_figure, styled


@styled
def draw_waiting(curve: Survival, last: float) -> Figure:
    """The curve of Kaplan and Meier with its limits and its median.

    Args:
        curve: `analysis.stats.survival.waiting_time`.
        last: Where the time axis ends: the longest waiting time of all [s].
    """
    figure = new_figure(2.7)
    axes = figure.add_subplot()
    time = np.concatenate([[0.0], curve.time, [max(last, *curve.time, 1e-3)]])

    def stairs(values: np.ndarray) -> np.ndarray:
        return np.concatenate([[1.0], values, values[-1:] if len(values) else [1.0]])

    axes.fill_between(
        time, stairs(curve.low), stairs(curve.high), step="post", color=ACCENT, alpha=0.16,
        linewidth=0.0,
    )  # fmt: skip
    axes.step(time, stairs(curve.survival), where="post", color=ACCENT, linewidth=1.6)
    if not math.isnan(curve.median):
        is_late = curve.median > 0.6 * time[-1]  # Right of the line there would be no room.
        axes.plot([0.0, curve.median, curve.median], [0.5, 0.5, 0.0], color=LINE, linewidth=0.9)
        axes.annotate(
            f"half have begun after {curve.median:.2f} s",
            (curve.median, 0.5),
            (-6, 4) if is_late else (6, 4),
            textcoords="offset points",
            ha="right" if is_late else "left",
            color=INK,
        )
    axes.set_ylim(0.0, 1.03)
    axes.set_xlim(0.0, time[-1])
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("waiting time, WT [s]")
    axes.set_ylabel("still waiting")
    axes.text(
        1.0, 1.02, f"{curve.num_events:,} began, {curve.num_censored:,} censored", ha="right",
        va="bottom", color=QUIET, transform=axes.transAxes,
    )  # fmt: skip
    return figure
