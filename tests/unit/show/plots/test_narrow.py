"""Figures for a phone: narrower, with letters of the same size, and nothing cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support.features import synthetic_features

from overtaking.analysis.stats.associations import associations
from overtaking.analysis.stats.results import statistics
from overtaking.show.plots import style
from overtaking.show.report import gallery

if TYPE_CHECKING:
    from matplotlib.figure import Figure

pytestmark = pytest.mark.ci


def pictures() -> list[gallery.Picture]:
    found = statistics(synthetic_features())
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
def test_a_figure_for_a_phone_is_narrow_and_whole(picture: gallery.Picture):
    with style.narrow():
        figure = picture.draw()
    assert figure.get_size_inches()[0] == style.NARROW_WIDTH
    style.to_svg(figure)
    assert is_whole(figure)
    assert picture.draw().get_size_inches()[0] == style.WIDTH


@pytest.mark.parametrize("name", ["associations", "p-values"])
def test_the_numbers_of_a_matrix_stay_within_their_cells(name: str):
    picture = next(one for one in pictures() if one.name == name)
    with style.narrow():
        figure = picture.draw()
    style.to_svg(figure)
    axes = figure.axes[0]
    cell = axes.get_window_extent().width / len(axes.get_xticklabels())
    assert max(one.get_window_extent().width for one in axes.texts) < cell
