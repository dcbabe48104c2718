"""How often each class occurs."""

import math

from matplotlib.figure import Figure

from overtaking.analysis.stats.table import Style, Table, write
from overtaking.show.plots.style import (
    CLASS_COLOURS,
    INK,
    QUIET,
    new_figure,
    styled,
    words,
)


@styled
def draw_classes(table: Table) -> Figure:
    """Bars with count and share of each class.

    Args:
        table: `analysis.stats.tables.class_table`.
    """
    rows = list(table.rows.itertuples(index=False, name=None))
    figure = new_figure(0.45 + 0.36 * len(rows))
    axes = figure.add_subplot()
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_xticks([])
    longest = max((high for *_, high in rows if not math.isnan(high)), default=1.0)
    for place, (name, count, share, low, high) in enumerate(rows):
        known = 0.0 if math.isnan(share) else share
        axes.barh(place, known, height=0.68, color=CLASS_COLOURS[name])
        if not math.isnan(high):
            axes.plot([low, high], [place, place], color=INK, linewidth=0.9, solid_capstyle="butt")
        end = known if math.isnan(high) else high
        text = f"{write(float(count), Style.COUNT)}   {write(share, Style.SHARE)}"
        axes.text(end + 0.015 * longest, place, text, va="center")
    axes.set_xlim(0.0, 1.25 * longest)
    axes.set_yticks(range(len(rows)), [words(str(row[0])) for row in rows])
    axes.tick_params(axis="y", labelcolor=INK, labelsize=8.0)
    axes.invert_yaxis()
    axes.set_xlabel("share of simulations; the line spans its 95 % confidence", color=QUIET)
    return figure
