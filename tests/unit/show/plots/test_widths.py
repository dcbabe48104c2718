"""Figures for one column and for both of a paper: letters of the same size, and nothing cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure as MatplotlibFigure
from tests.support.features import synthetic_features

from overtaking.analysis.stats.associations import associations
from overtaking.analysis.stats.results import statistics
from overtaking.show.plots import style
from overtaking.show.report import gallery

if TYPE_CHECKING:
    from matplotlib.figure import Figure

pytestmark = pytest.mark.ci

SMALLEST_LETTERS = 8.0
"""Letters of every figure but the matrix of p-values, where numbers stand in cells [1/72 inch]."""


def pictures() -> list[gallery.Picture]:
    found = statistics(synthetic_features(), policy="paper")
    measured = associations(found.sample)
    return [
        gallery.class_picture(found),
        gallery.waiting_picture(found),
        *gallery.distribution_pictures(found),
        *gallery.pair_pictures(found),
        *gallery.association_pictures(measured),
    ]


def is_whole(figure: Figure) -> bool:
    """Whether everything that is drawn lies within the figure, up to a hundredth of an inch."""
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return bool(
        drawn.x0 > -0.01
        and drawn.y0 > -0.01
        and drawn.x1 < width + 0.01
        and drawn.y1 < height + 0.01
    )


@pytest.mark.parametrize("picture", pictures(), ids=lambda one: one.name)
@pytest.mark.parametrize("width", style.WIDTHS)
def test_a_figure_has_its_width_is_whole_and_can_be_read(
    picture: gallery.Picture, width: style.Width
):
    with style.drawn_for(width):
        figure = picture.draw()
    assert figure.get_size_inches()[0] == style.WIDTHS[width]
    style.to_svg(figure)
    assert is_whole(figure)
    sizes = {one.get_size() for one in figure.findobj(_has_text)}
    smallest = 6.4 if (picture.name, width) == ("p-values", "page") else SMALLEST_LETTERS
    assert smallest <= min(sizes) <= max(sizes) <= 9.0


def _has_text(one: object) -> bool:
    return bool(getattr(one, "get_text", str)()) and hasattr(one, "get_size")


@pytest.mark.parametrize("name", ["associations", "p-values"])
@pytest.mark.parametrize("width", style.WIDTHS)
def test_the_numbers_of_a_matrix_stay_within_their_cells(name: str, width: style.Width):
    picture = next(one for one in pictures() if one.name == name)
    with style.drawn_for(width):
        figure = picture.draw()
    style.to_svg(figure)
    axes = figure.axes[0]
    cell = axes.get_window_extent().width / len(axes.get_xticklabels())
    assert max((one.get_window_extent().width for one in axes.texts), default=0.0) < cell


def test_the_titles_of_histograms_do_not_meet_their_remarks():
    picture = next(one for one in pictures() if one.name == "histograms")
    with style.drawn_for("column"):
        figure = picture.draw()
    style.to_png(figure)
    for axes in figure.axes:
        title = axes._left_title.get_window_extent()  # pyright: ignore[reportAttributeAccessIssue]
        remarks = [one.get_window_extent() for one in axes.texts if "without" in one.get_text()]
        assert not any(title.overlaps(one) for one in remarks)


def test_axes_of_the_caller_keep_their_figure():
    figure = MatplotlibFigure(figsize=(5.0, 4.0))
    axes = figure.add_subplot()
    with style.drawn_for("page", axes):
        drawn = next(one for one in pictures() if one.name == "classes").draw()
    assert drawn is figure
    assert tuple(figure.get_size_inches()) == (5.0, 4.0)
    assert len(axes.patches) > 0
