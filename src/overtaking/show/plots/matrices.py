"""The matrix of associations, and the matrix of p-values beside it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from overtaking.analysis.stats.associations import ALPHA, Associations
from overtaking.show.plots.style import INK, QUIET, is_narrow, new_figure, styled

F64 = NDArray[np.float64]

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
    for row, column in np.argwhere(~np.isnan(found.values)):
        value = float(found.values[row, column])
        colour = "white" if abs(value) > _DARK else INK
        axes.text(
            column,
            row,
            _short(value),
            ha="center",
            va="center",
            size=4.6 if is_narrow() else 6.6,
            color=colour,
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
    for row, column in np.argwhere(~np.isnan(found.p_values)):
        is_kept = found.q_values[row, column] < ALPHA
        axes.text(
            column,
            row,
            _p_value(float(found.p_values[row, column])),
            ha="center",
            va="center",
            size=4.0 if is_narrow() else 6.2,
            weight="bold" if is_kept else "normal",
            color="white" if steps[row, column] == 0 else INK,
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
    axes.tick_params(which="major", labelcolor=INK)
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
    legend = figure.legend(handles=patches, loc="outside upper center", ncols=4, handlelength=1.3)
    for text in legend.get_texts():
        text.set_color(QUIET)
    axes.set_anchor("C")


def _short(value: float) -> str:
    """An association in four letters or fewer."""
    hundredths = round(abs(value) * 100.0)
    sign = "−" if value < 0.0 and hundredths else ""
    return f"{sign}1.0" if hundredths == 100 else f"{sign}.{hundredths:02d}"


def _p_value(value: float) -> str:
    """A p-value in five letters or fewer."""
    return "<.001" if value < _LIMITS[0] else f"{value:.3f}"[1:] if value < 1.0 else "1"
