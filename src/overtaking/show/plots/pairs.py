"""Features against each other: clouds of points, and matrices of associations and p-values."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from overtaking.analysis.stats.associations import ALPHA, Associations
from overtaking.analysis.stats.columns import BY_NAME
from overtaking.analysis.stats.distributions import Histogram, Points
from overtaking.analysis.stats.sample import Sample
from overtaking.core.arrays import F64, Mask
from overtaking.show import palette
from overtaking.show.plots.style import (
    is_narrow,
    legend_columns,
    new_figure,
    set_margins,
    styled,
    words,
    write_cells,
)

DETAILS = (("SE", "SP"), ("DSEP", "SE"))
"""The two pairs that the paper looks at closely, as (across, up)."""


@styled
def draw_pairs(sample: Sample, histograms: Sequence[Histogram], points: Points) -> Figure:
    """A panel for each pair of features, and the histogram of each on the diagonal.

    Args:
        sample: The features.
        histograms: `analysis.stats.distributions.histogram` of each feature, in order.
        points: `analysis.stats.distributions.pair_points`.
    """
    names = [one.feature.name for one in histograms]
    number = len(names)
    figure = new_figure(4.2 if is_narrow() else 7.4, is_fixed=True)
    bottom = 0.62 if is_narrow() else 0.3
    set_margins(figure, left=0.62, right=0.05, top=0.05, bottom=bottom, wspace=0.05, hspace=0.05)
    grid = figure.add_gridspec(number, number)
    columns = {name: sample.values(name)[points.simulations] for name in names}
    members = {name: of[points.simulations] for name, of in sample.groups()}
    for row, up in enumerate(names):
        for column, across in enumerate(names[: row + 1]):
            axes = figure.add_subplot(grid[row, column])
            if column == row:
                _draw_diagonal(axes, histograms[column])
            else:
                _draw_cloud(axes, columns[across], columns[up], members, size=2.2)
            _label_edges(axes, across, up, is_left=column == 0, is_bottom=row == number - 1)
    _add_marker_legend(figure, sample, "upper right", (0.98, 0.97))
    return figure


@styled
def draw_details(sample: Sample, points: Points) -> Figure:
    """The pairs SE with SP and DSEP with SE, large.

    Args:
        sample: The features.
        points: `analysis.stats.distributions.pair_points`.
    """
    figure = new_figure(6.0 if is_narrow() else 3.2)
    members = {name: of[points.simulations] for name, of in sample.groups()}
    for axes, (across, up) in zip(_panels(figure), DETAILS, strict=True):
        x, y = (sample.values(name)[points.simulations] for name in (across, up))
        _draw_cloud(axes, x, y, members, size=12.0)
        axes.grid(visible=True, axis="both")
        axes.set_xlabel(f"{BY_NAME[across].title}, {BY_NAME[across].label}")
        axes.set_ylabel(f"{BY_NAME[up].title}, {BY_NAME[up].label}")
        if {across, up} == {"SE", "SP"}:
            axes.axline((100.0, 100.0), slope=1.0, color=palette.LINE, linewidth=0.8, zorder=0)
    _add_marker_legend(figure, sample, "outside upper center", None)
    return figure


def _panels(figure: Figure) -> Sequence[Axes]:
    """A panel for each detail, side by side, on a phone below each other."""
    rows, columns = (len(DETAILS), 1) if is_narrow() else (1, len(DETAILS))
    return figure.subplots(rows, columns)


def _draw_cloud(axes: Axes, across: F64, up: F64, members: dict[str, Mask], *, size: float) -> None:
    """One point per simulation; the largest class lies below the others."""
    for name in sorted(members, key=lambda one: -int(members[one].sum())):
        of = members[name]
        axes.scatter(
            across[of],
            up[of],
            s=size,
            marker=palette.CLASS_MARKERS[name],
            color=palette.CLASS_COLOURS[name],
            alpha=0.7,
            linewidth=0.0,
            rasterized=True,  # Thousands of shapes would make a page slow.
        )
    axes.grid(visible=False)


def _draw_diagonal(axes: Axes, one: Histogram) -> None:
    """The histogram of one feature, all classes together."""
    if one.levels:
        places = np.array([float(level) for level in one.levels])
        whole = float(np.ptp(places)) or 1.0
        apart = float(np.diff(places).min(initial=whole))
        widths = np.full(len(places), max(0.6 * apart, 0.05 * whole))
    else:
        places, widths = one.edges[:-1] + np.diff(one.edges) / 2.0, np.diff(one.edges)
    axes.bar(places, one.counts.sum(axis=0), widths, color=palette.LINE, linewidth=0.0)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)


def _label_edges(axes: Axes, across: str, up: str, *, is_left: bool, is_bottom: bool) -> None:
    """Names at the left and lower edge only, and no numbers: this figure shows shapes."""
    axes.set_xticks([])
    axes.set_yticks([])
    if is_bottom:
        turned: dict[str, Any] = {"rotation": 90, "va": "top"} if is_narrow() else {}
        axes.set_xlabel(across, labelpad=4, **turned)
    if is_left:
        axes.set_ylabel(up, rotation=0, ha="right", va="center", labelpad=6)


def _add_marker_legend(
    figure: Figure, sample: Sample, place: str, anchor: tuple[float, float] | None
) -> None:
    """The classes with their colours and markers, and the policy."""
    dots: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0.0, "markersize": 5.0}
    handles = [
        Line2D(
            [],
            [],
            marker=palette.CLASS_MARKERS[name],
            color=palette.CLASS_COLOURS[name],
            label=words(name),
            **dots,
        )
        for name in sample.classes
    ]
    columns = 1 if anchor else legend_columns(len(handles))
    more: dict[str, Any] = {"loc": place, "bbox_to_anchor": anchor}
    more["title"] = f"class under the policy {sample.policy}"
    figure.legend(handles=handles, ncols=columns, handletextpad=0.2, **more)


_DIVERGING = LinearSegmentedColormap.from_list(
    "associations", ("#d55e00", "#f4b98f", "#ffffff", "#8fbfdd", "#0072b2")
)
_LIMITS = (0.001, 0.01, ALPHA)
_STEPS = ListedColormap(["#2f6f94", "#7fb2d0", "#cfe3ee", "#f4f5f6"])
_DARK = 0.62  # Associations beyond this need white letters.


@styled
def draw_associations(found: Associations) -> Figure:
    """The associations as a matrix, what goes together beside each other.

    Args:
        found: `analysis.stats.associations.associations`.
    """
    figure = new_figure(4.1 if is_narrow() else 6.0)
    axes = figure.add_subplot()
    image = axes.imshow(found.values, cmap=_DIVERGING, vmin=-1.0, vmax=1.0)
    # The cells of narrow figures are too small for readable numbers.
    write_cells(
        axes,
        {} if is_narrow() else _texts(found.values, _short),
        size=8.0,
        color=lambda cell: "white" if abs(found.values[cell]) > _DARK else palette.INK,
        in_layout=False,
    )
    _finish(axes, found)
    bar = figure.colorbar(image, ax=axes, shrink=0.5, aspect=24, pad=0.02)
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(size=0)
    bar.ax.grid(visible=False)
    return figure


@styled
def draw_p_values(found: Associations) -> Figure:
    """The p-values as a matrix; bold where the adjusted one stays below the level, too.

    Args:
        found: `analysis.stats.associations.associations`.
    """
    figure = new_figure(4.1 if is_narrow() else 6.0)
    axes = figure.add_subplot()
    steps = np.digitize(found.p_values, _LIMITS).astype(float)
    steps[np.isnan(found.p_values)] = np.nan
    axes.imshow(steps, cmap=_STEPS, vmin=-0.5, vmax=3.5)
    write_cells(
        axes,
        _significant(found) if is_narrow() else _texts(found.p_values, _p_value),
        size=8.0 if is_narrow() else 6.4,  # The largest size at which "<.001" in bold fits.
        weight=lambda cell: "bold" if found.q_values[cell] < ALPHA else "normal",
        color=lambda cell: "white" if steps[cell] == 0 else palette.INK,
        in_layout=False,
    )
    _finish(axes, found)
    _add_steps(figure, axes)
    return figure


def _finish(axes: Axes, found: Associations) -> None:
    """Names on both sides, thin white lines between the cells."""
    places = range(len(found.names))
    axes.set_xticks(places, list(found.names), rotation=90)
    axes.set_yticks(places, list(found.names))
    axes.set_xticks(np.arange(len(found.names) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(found.names) + 1) - 0.5, minor=True)
    axes.grid(visible=False, which="major")
    axes.grid(visible=True, which="minor", axis="both", color="white", linewidth=1.2)
    axes.tick_params(which="both", length=0)
    axes.tick_params(which="major", labelcolor=palette.INK)
    axes.spines[:].set_visible(False)
    axes.set_facecolor("#fafbfb")
    for label in [*axes.get_xticklabels(), *axes.get_yticklabels()]:
        if label.get_text() == "CLASS":
            label.set_fontweight("bold")


def _add_steps(figure: Figure, axes: Axes) -> None:
    """What the colours of the p-values mean."""
    from matplotlib.patches import Patch

    texts = ("p < 0.001", "p < 0.01", f"p < {ALPHA:g}", f"p ≥ {ALPHA:g}")
    patches = [
        Patch(facecolor=colour, edgecolor="#cfd4d9", linewidth=0.5, label=text)
        for colour, text in zip(_STEPS.colors, texts, strict=True)  # type: ignore[arg-type]
    ]
    legend = figure.legend(
        handles=patches, loc="outside upper center", ncols=legend_columns(4), handlelength=1.3
    )
    for text in legend.get_texts():
        text.set_color(palette.QUIET)
    axes.set_anchor("C")


def _texts(values: F64, text: Callable[[float], str]) -> dict[tuple[int, int], str]:
    """The text of each value that is there, by row and column."""
    return {cell: text(value) for cell, value in np.ndenumerate(values) if not np.isnan(value)}  # type: ignore[misc]


def _significant(associations: Associations) -> dict[tuple[int, int], str]:
    """A dot for each pair whose adjusted p-value stays below the level."""
    return {cell: "•" for cell, value in np.ndenumerate(associations.q_values) if value < ALPHA}  # type: ignore[misc]


def _short(value: float) -> str:
    """An association in four letters or fewer."""
    hundredths = round(abs(value) * 100.0)
    sign = "−" if value < 0.0 and hundredths else ""
    return f"{sign}1.0" if hundredths == 100 else f"{sign}.{hundredths:02d}"


def _p_value(value: float) -> str:
    """A p-value in five letters or fewer."""
    return "<.001" if value < _LIMITS[0] else f"{value:.3f}"[1:] if value < 1.0 else "1"
