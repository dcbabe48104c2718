"""Drivers beside each other: differences, rates by weather, breaches by rule."""

import math
from collections.abc import Sequence
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from overtaking.analysis.evaluation.endpoints import LAW, PRIMARY, Endpoint
from overtaking.analysis.evaluation.results import (
    LEAST_EFFECTIVE,
    TOO_FEW,
    Contrast,
    Evaluation,
    Rate,
)
from overtaking.analysis.validation.overtakes import STRATA
from overtaking.show import palette
from overtaking.show.plots.style import (
    add_legend,
    is_narrow,
    legend_columns,
    new_figure,
    remark,
    single_axes,
    styled,
)

_COLOURS = (palette.ACCENT, "#d55e00", "#009e73", "#cc79a7", "#e69f00")
_MARKS = "osD^v"
"""Colour and mark of each driver, the policy's first."""

_ROW = 0.26  # Height of a row [inch].
_COLUMN_LETTERS = 22  # Letters per line of the name of a rule, in narrow figures.
_APART = 0.2  # Between drivers in a row, where rows are 1 apart.


@styled
def draw_contrasts(found: Evaluation) -> Figure:
    """The primary endpoints: policy minus each reference, with intervals.

    Args:
        found: What was evaluated.
    """
    count = len(found.references)
    figure = new_figure(0.35 + len(PRIMARY) * (0.62 + _ROW * count))
    panels = figure.subplots(len(PRIMARY), 1, squeeze=False)[:, 0]
    for axes, endpoint in zip(panels, PRIMARY, strict=True):
        rows = [one for one in found.contrasts if one.is_primary and one.endpoint == endpoint]
        _draw_contrasts(axes, endpoint, rows)
    return figure


def _draw_contrasts(axes: Axes, endpoint: Endpoint, rows: Sequence[Contrast]) -> None:
    unit, scale = _shown(endpoint)
    for place, one in enumerate(rows):
        is_shown = one.verdict not in (TOO_FEW, "no difference shown")
        colour = palette.ACCENT if is_shown else palette.QUIET
        if one.verdict != TOO_FEW and not math.isnan(one.low):
            axes.plot([scale * one.low, scale * one.high], [place] * 2, color=colour, linewidth=1.6)
        if not math.isnan(one.difference):
            fill = colour if is_shown else "white"
            axes.plot([scale * one.difference], [place], "o", color=colour, markerfacecolor=fill)
        style: dict[str, Any] = {"va": "center", "ha": "left", "fontsize": 8.0, "color": colour}
        axes.text(1.01, place, one.verdict, transform=axes.get_yaxis_transform(), **style)
    axes.axvline(0.0, color=palette.LINE, linewidth=0.8, zorder=0)
    names = [f"minus {one.reference}" for one in rows]
    axes.set_yticks(range(len(rows)), names)
    axes.set(ylim=(len(rows) - 0.4, -0.6))
    axes.margins(x=0.15)
    axes.grid(visible=True, axis="x")
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    _title(axes, endpoint, unit)
    if not is_narrow():
        remark(axes, "more is better" if endpoint.is_good else "less is better")


def _title(axes: Axes, endpoint: Endpoint, unit: str) -> None:
    name = endpoint.title.partition(",")[0]
    axes.set_title(f"{name}{f' [{unit}]' if unit else ''}", pad=4)


def _shown(endpoint: Endpoint) -> tuple[str, float]:
    """Unit on an axis and factor to it; shares are percent."""
    return (endpoint.unit, 1.0) if endpoint.unit else ("%", 100.0)


@styled
def draw_weathers(found: Evaluation) -> Figure:
    """The primary endpoints of each driver by weather, with intervals.

    Args:
        found: What was evaluated.
    """
    seen = [name for name in STRATA if any(one.weather == name for one in found.rates)]
    across = 1 if is_narrow() else 2
    height = (0.75 + 1.15 * _ROW * len(seen)) * math.ceil(len(PRIMARY) / across) + 0.4
    figure = new_figure(height)
    panels = figure.subplots(len(PRIMARY) // across, across, squeeze=False).ravel()
    for axes, endpoint in zip(panels, PRIMARY, strict=True):
        unit, _ = _shown(endpoint)
        rows = [
            [found.rate(driver, endpoint.name, one) for driver in found.drivers] for one in seen
        ]
        _draw_rates(axes, rows, seen)
        _title(axes, endpoint, unit)
    entries = _legend_entries(found.drivers)
    figure.legend(handles=entries, loc="outside upper left", ncols=legend_columns(len(entries)))
    return figure


@styled
def draw_law(found: Evaluation) -> Figure:
    """How often each driver breaks each rule where it applies, for rules that anyone breaks.

    Args:
        found: What was evaluated.
    """
    every = [[found.rate(driver, one.name) for driver in found.drivers] for one in LAW[3:]]
    rows = [one for one in every if any(rate.scenes for rate in one)]
    figure, axes = single_axes(0.9 + 1.15 * _ROW * max(len(rows), 1))
    names = [_rule(one[0].endpoint) for one in rows]
    if is_narrow():
        names = [fill(name, _COLUMN_LETTERS) for name in names]
    _draw_rates(axes, rows, names)
    axes.set_title("breaches [%]", pad=4)
    add_legend(figure, axes, _legend_entries(found.drivers), columns=legend_columns(3))
    return figure


def _rule(endpoint: Endpoint) -> str:
    """Code and name of a rule, without its articles."""
    code = endpoint.part.partition("_")[0]
    name = endpoint.title.rpartition(": ")[2].removesuffix(", broken")
    return f"{code} {name}"


def _draw_rates(axes: Axes, rows: Sequence[Sequence[Rate]], names: Sequence[str]) -> None:
    """Rates of drivers in rows, slightly apart."""
    for place, row in enumerate(rows):
        for number, one in enumerate(row):
            _, scale = _shown(one.endpoint)
            if math.isnan(one.value) or one.effective < LEAST_EFFECTIVE:
                continue
            y = place + _APART * (number - 0.5 * (len(row) - 1))
            colour, mark = _COLOURS[number % len(_COLOURS)], _MARKS[number % len(_MARKS)]
            ends = [one.value if math.isnan(end) else end for end in (one.low, one.high)]
            axes.plot([scale * end for end in ends], [y, y], color=colour, linewidth=1.1)
            axes.plot([scale * one.value], [y], mark, color=colour, markersize=3.6)
    axes.set_yticks(range(len(names)), names)
    axes.set(ylim=(max(len(names), 1) - 0.4, -0.6))
    axes.grid(visible=True, axis="x")
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)


def _legend_entries(drivers: Sequence[str]) -> list[Line2D]:
    return [
        Line2D([], [], color=colour, marker=mark, markersize=4.0, linewidth=1.1, label=name)
        for name, colour, mark in zip(drivers, _COLOURS, _MARKS, strict=False)
    ]
