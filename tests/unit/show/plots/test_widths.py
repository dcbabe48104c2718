"""Figures for one column and for both columns of a paper have readable letters and are complete."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure as MatplotlibFigure
from matplotlib.text import Text
from tests.support.features import synthetic_features

from overtaking.analysis.stats.associations import associations
from overtaking.analysis.stats.results import statistics
from overtaking.show.plots import style
from overtaking.show.report import gallery

if TYPE_CHECKING:
    from matplotlib.figure import Figure

pytestmark = pytest.mark.ci

SMALLEST_LETTERS = 8.0
"""Smallest letters of a figure [1/72 inch], except for the numbers in the cells of p-values."""


def pictures() -> list[gallery.Picture]:
    numbers = statistics(synthetic_features(), policy="paper")
    return [
        gallery.class_picture(numbers),
        gallery.waiting_picture(numbers),
        *gallery.distribution_pictures(numbers),
        *gallery.pair_pictures(numbers),
        *gallery.association_pictures(associations(numbers.sample)),
    ]


def is_complete(figure: Figure) -> bool:
    """Whether all drawn parts lie within the figure, up to a hundredth of an inch."""
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return bool(
        drawn.x0 > -0.01
        and drawn.y0 > -0.01
        and drawn.x1 < width + 0.01
        and drawn.y1 < height + 0.01
    )


@pytest.mark.parametrize("picture", pictures(), ids=lambda picture: picture.name)
@pytest.mark.parametrize("width", style.WIDTHS)
def test_a_figure_has_its_width_and_is_complete_and_readable(
    picture: gallery.Picture, width: style.Width
):
    with style.drawn_for(width):
        figure = picture.draw()
    assert figure.get_size_inches()[0] == style.WIDTHS[width]
    style.to_svg(figure)
    assert is_complete(figure)
    texts = [text for text in figure.findobj(_is_text) if isinstance(text, Text)]
    sizes = {float(text.get_fontsize()) for text in texts}
    smallest = 6.4 if (picture.name, width) == ("p-values", "page") else SMALLEST_LETTERS
    assert smallest <= min(sizes) <= max(sizes) <= 9.0


def _is_text(artist: object) -> bool:
    return bool(getattr(artist, "get_text", str)()) and hasattr(artist, "get_size")


@pytest.mark.parametrize("name", ["associations", "p-values"])
@pytest.mark.parametrize("width", style.WIDTHS)
def test_the_numbers_of_a_matrix_stay_within_their_cells(name: str, width: style.Width):
    picture = next(picture for picture in pictures() if picture.name == name)
    with style.drawn_for(width):
        figure = picture.draw()
    style.to_svg(figure)
    axes = figure.axes[0]
    cell = axes.get_window_extent().width / len(axes.get_xticklabels())
    assert max((text.get_window_extent().width for text in axes.texts), default=0.0) < cell


def test_the_titles_of_histograms_do_not_overlap_their_remarks():
    picture = next(picture for picture in pictures() if picture.name == "histograms")
    with style.drawn_for("column"):
        figure = picture.draw()
    style.to_png(figure)
    for axes in figure.axes:
        title = axes._left_title.get_window_extent()  # pyright: ignore[reportAttributeAccessIssue]
        remarks = [text.get_window_extent() for text in axes.texts if "without" in text.get_text()]
        assert not any(title.overlaps(remark) for remark in remarks)


def test_axes_of_the_caller_keep_their_figure():
    figure = MatplotlibFigure(figsize=(5.0, 4.0))
    axes = figure.add_subplot()
    with style.drawn_for("page", axes):
        drawn = next(picture for picture in pictures() if picture.name == "classes").draw()
    assert drawn is figure
    assert tuple(figure.get_size_inches()) == (5.0, 4.0)
    assert len(axes.patches) > 0
