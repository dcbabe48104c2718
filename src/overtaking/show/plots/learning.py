"""Figures of learning: confusion, calibration, and the factors in order."""

from textwrap import shorten

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from overtaking.analysis.learning.factors import FactorsFound
from overtaking.analysis.learning.models import TREES
from overtaking.show import palette
from overtaking.show.plots.style import (
    is_narrow,
    new_figure,
    single_axes,
    styled,
    words,
    write_cells,
)

_SHADES = LinearSegmentedColormap.from_list("shares", ("#ffffff", "#8fbfdd", palette.ACCENT))
_COLUMN_LETTERS = 26  # Of the name of a factor, in narrow figures.
_DARK = 0.6  # Shares beyond this need white letters.


@styled
def draw_confusion(found: FactorsFound) -> Figure:
    """Confusion matrix of the trees: shares of each true outcome by prediction.

    Args:
        found: `analysis.learning.factors.learn_factors`.
    """
    counts = next(one for one in found.models if one.name == TREES).confusion
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    names = [words(outcome) for outcome in found.outcomes]
    figure, axes = single_axes(0.6 + 0.5 * len(names))
    axes.imshow(shares, cmap=_SHADES, vmin=0.0, vmax=1.0, aspect="auto")
    cells = np.ndindex(*counts.shape)
    texts = {cell: f"{counts[cell]:,}\n{100.0 * float(shares[cell]):.0f} %" for cell in cells}
    colour = {cell: "white" if shares[cell] > _DARK else palette.INK for cell in texts}
    write_cells(axes, texts, size=8.0, color=colour.__getitem__)
    labels = [name.replace(" ", "\n") for name in names] if is_narrow() else names
    axes.set_xticks(range(len(names)), labels)
    axes.set_yticks(range(len(names)), labels)
    axes.set(xlabel=f"predicted class (policy {found.policy})", ylabel="actual class")
    axes.grid(visible=False)
    axes.tick_params(length=0, labelcolor=palette.INK)
    axes.spines[:].set_visible(False)
    return figure


@styled
def draw_reliability(found: FactorsFound) -> Figure:
    """How often each model is right, by how sure it is, and how many examples that is about.

    Args:
        found: `analysis.learning.factors.learn_factors`.
    """
    rows, columns = (len(found.models), 1) if is_narrow() else (1, len(found.models))
    figure = new_figure(2.6 * rows)
    panels = np.atleast_1d(figure.subplots(rows, columns, sharey=True))
    for axes, model in zip(panels, found.models, strict=True):
        axes.plot([0.0, 1.0], [0.0, 1.0], color=palette.LINE, linewidth=0.9, zorder=1)
        confidence = [one.confidence for one in model.reliability]
        right = [one.right for one in model.reliability]
        counts = np.array([one.examples for one in model.reliability])
        sizes = 6.0 + 90.0 * counts / counts.sum()
        axes.plot(confidence, right, color=palette.ACCENT, linewidth=0.9, zorder=2)
        axes.scatter(confidence, right, s=sizes, color=palette.ACCENT, linewidth=0.0, zorder=3)
        axes.set(title=model.name, xlabel="confidence", xlim=(0.0, 1.02), ylim=(0.0, 1.02))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        axes.grid(visible=True, axis="both")
        error = f"error {100.0 * model.calibration_error:.1f} %"
        corner = axes.transAxes
        axes.text(0.97, 0.05, error, ha="right", color=palette.QUIET, transform=corner)
    for axes in panels if is_narrow() else panels[:1]:
        axes.set_ylabel("accuracy")
    return figure


@styled
def draw_ranking(found: FactorsFound) -> Figure:
    """Accuracy with the first factor, the first two, and so on, with its confidence.

    Args:
        found: `analysis.learning.factors.learn_factors`.
    """
    figure, axes = single_axes(0.9 + 0.19 * len(found.ranking))
    places = np.arange(len(found.ranking))
    middle = np.array([one.accuracy for one in found.ranking])
    low = np.array([one.accuracy_low for one in found.ranking])
    high = np.array([one.accuracy_high for one in found.ranking])
    axes.fill_betweenx(places, low, high, color=palette.ACCENT, alpha=0.16, linewidth=0.0)
    axes.plot(middle, places, color=palette.ACCENT, linewidth=1.4, marker="o", markersize=3.6)
    least, text = found.most_frequent_accuracy, " always the most frequent"
    axes.axvline(least, color=palette.LINE, linewidth=0.9, linestyle="--")
    axes.text(least, len(places) - 0.6, text, color=palette.QUIET, va="bottom")
    names = [
        f"+ {step.factor}" if index else step.factor for index, step in enumerate(found.ranking)
    ]
    if is_narrow():
        names = [shorten(name, _COLUMN_LETTERS, placeholder=" …") for name in names]
    axes.set_yticks(places, names)
    axes.tick_params(axis="y", labelcolor=palette.INK)
    axes.set_ylim(len(places) - 0.4, -0.6)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel(
        f"accuracy with this factor and all above it (policy {found.policy})", wrap=True
    )
    axes.grid(visible=True, axis="x", color=palette.GRID)
    axes.grid(visible=False, axis="y")
    return figure
