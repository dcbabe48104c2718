"""The paper's numbers among our replicates, as they are drawn."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from overtaking.show.plots.comparison import Panel, Ridge, draw_ridges, percent


def ridge(values: list[float], paper: float, *, is_count: bool = False) -> Ridge:
    said = SimpleNamespace(outcome_class="Success_L", quoted=paper)
    of = SimpleNamespace(statement=said, known=np.array(values), percentile=40.0, is_count=is_count)
    return Ridge(label="a label", of=of)


def test_a_hill_holds_every_replicate_and_the_diamond_stands_at_the_number():
    values = [1.0, 1.2, 1.3, 2.0, 2.1, 4.0]
    figure = draw_ridges([Panel(title="x", unit="s", ridges=(ridge(values, 3.0),))])
    (axes,) = figure.axes
    (hill,) = axes.patches
    tops, edges, floor = hill.get_data()  # type: ignore[attr-defined]
    heights = (tops - floor) / (tops - floor).max()
    counts, _ = np.histogram(values, edges)
    assert counts.sum() == len(values)
    assert heights == pytest.approx(counts / counts.max())
    assert [
        np.ravel(one.get_xdata()).tolist() for one in axes.lines if one.get_marker() == "D"
    ] == [[3.0]]
    assert axes.get_title(loc="left") == "x [s]"


@pytest.mark.parametrize("values", [[], [2.0], [2.0, 2.0, 2.0]])
def test_no_replicate_one_and_equal_ones_can_be_drawn(values: list[float]):
    panels = [Panel(title="x", unit="", ridges=(ridge(values, 3.0), ridge([1.0, 5.0], 2.0)))]
    assert len(draw_ridges(panels).axes) == 1


def test_counts_have_bins_of_whole_numbers():
    panel = Panel(title="x", unit="", ridges=(ridge([3.0, 4.0, 4.0, 9.0], 5.0, is_count=True),))
    _, edges, _ = draw_ridges([panel]).axes[0].patches[0].get_data()  # type: ignore[attr-defined]
    assert (np.diff(edges) == 1.0).all()
    assert edges[0] == 2.5


def test_percentiles_at_the_ends_say_so():
    assert [percent(one) for one in (0.0, 100.0, 62.5, float("nan"))] == [
        "below",
        "above",
        "62.5 %",
        "",
    ]
