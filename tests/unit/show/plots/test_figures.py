"""Figures draw the numbers they are given, in one design, the same every time."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from scipy.optimize import isotonic_regression
from tests.support.features import synthetic_features

from overtaking.analysis.stats import distributions
from overtaking.analysis.stats.associations import associations
from overtaking.analysis.stats.columns import ALL_CLASSES, BY_NAME, FEATURES, NUMERIC
from overtaking.analysis.stats.diagrams import PHASES
from overtaking.analysis.stats.results import Statistics, statistics
from overtaking.analysis.stats.survival import kaplan_meier
from overtaking.show import palette
from overtaking.show.plots import distributions as single
from overtaking.show.plots import pairs, style
from overtaking.show.plots.overtake import moved_apart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def result() -> Statistics:
    return statistics(synthetic_features(), policy="paper")


def texts(figure: Figure) -> set[str]:
    """All that is written in a figure."""
    return {one.get_text() for one in figure.findobj(mpl.text.Text) if one.get_visible()}  # type: ignore[arg-type]


def test_bars_are_as_long_as_the_shares(result: Statistics):
    axes = single.draw_classes(result.classes, policy="paper").axes[0]
    widths = [bar.get_width() for bar in axes.patches]  # type: ignore[attr-defined]
    assert widths == pytest.approx(result.classes.rows["share"].tolist())


def test_stacked_bars_end_at_the_number_of_simulations(result: Statistics):
    counted = [distributions.histogram(result.sample, one.name) for one in FEATURES]
    figure = single.draw_histograms(counted, result.sample.classes, policy="paper")
    for axes, one in zip(figure.axes, counted, strict=False):
        tops: dict[float, float] = {}
        for bar in axes.patches:
            edge: Any = bar
            top = edge.get_y() + edge.get_height()
            tops[round(edge.get_x(), 6)] = max(tops.get(round(edge.get_x(), 6), 0.0), top)
        assert sum(tops.values()) == pytest.approx(276 - one.num_missing)
    assert {"SE [km/h]", "Success I"} <= texts(figure)


def test_boxes_stand_at_the_quartiles(result: Statistics):
    numbers = distributions.boxes_by_class(result.sample, "SE")
    points = distributions.swarm_points(result.sample, "SE")
    figure = single.draw_boxes_and_swarm(result.sample, BY_NAME["SE"], numbers, points)
    left, right = figure.axes
    for patch, one in zip(left.patches, numbers.values(), strict=True):
        corners: Any = patch.get_path().vertices
        assert corners[:, 1].min() == pytest.approx(one.quartiles[0])
        assert corners[:, 1].max() == pytest.approx(one.quartiles[2])
    drawn = np.concatenate([np.asarray(one.get_offsets())[:, 1] for one in right.collections])
    assert sorted(drawn) == pytest.approx(sorted(result.sample.values("SE")))


def test_points_of_a_swarm_do_not_hide_each_other():
    heights = np.sort(np.random.default_rng(4).normal(0.0, 30.0, 150))
    offsets = single.swarm_offsets(heights, 3.0)
    apart = np.hypot(heights[:, None] - heights, offsets[:, None] - offsets)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= 3.0 - 1e-6
    assert np.abs(offsets).max() < 20.0


def test_a_swarm_of_points_far_apart_is_a_line():
    assert single.swarm_offsets(np.arange(10) * 5.0, 3.0).tolist() == [0.0] * 10


def test_the_matrix_shows_every_association(result: Statistics):
    found = associations(result.sample)
    figure = pairs.draw_associations(found)
    image = figure.axes[0].images[0].get_array()
    np.testing.assert_array_equal(np.asarray(image), found.values)
    assert {*found.names, ".93"} <= texts(figure)


def test_p_values_that_survive_correction_are_bold(result: Statistics):
    found = associations(result.sample)
    figure = pairs.draw_p_values(found)
    bold = sum(one.get_fontweight() == "bold" for one in figure.axes[0].texts)
    assert bold == int((found.q_values < 0.05).sum())
    assert len(figure.axes[0].texts) == 16 * 15


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.5, ".50"), (-0.5, "−.50"), (-0.001, ".00"), (1.0, "1.0"), (-0.999, "−1.0")],
)
def test_an_association_is_short(result: Statistics, value: float, text: str):
    found = associations(result.sample)
    found.values[0, 1] = found.values[1, 0] = value
    assert text in texts(pairs.draw_associations(found))


def test_the_pair_plot_has_a_panel_for_each_pair(result: Statistics):
    counted = [distributions.histogram(result.sample, one.name) for one in NUMERIC]
    points = distributions.pair_points(result.sample)
    figure = pairs.draw_pairs(result.sample, counted, points)
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert len(shown) == 11 * 12 // 2
    drawn = sum(len(np.asarray(one.get_offsets())) for one in shown[1].collections)
    assert drawn == 276


def test_the_curve_goes_through_its_points():
    curve = kaplan_meier(np.array([1.0, 2.0, 3.0, 4.0]), np.array([True, True, False, True]))
    axes = single.draw_waiting(curve, 5.0).axes[0]
    x, y = (np.asarray(one) for one in axes.lines[0].get_data())
    assert x.tolist() == [0, 1, 2, 4, 5]
    assert y == pytest.approx([1.0, 0.75, 0.5, 0.0, 0.0])
    assert "half have begun after 2.00 s" in texts(axes.figure)  # type: ignore[arg-type]


def test_a_late_median_is_named_within_the_axes():
    curve = kaplan_meier(np.array([0.95]), np.array([True]))
    figure = single.draw_waiting(curve, 0.95)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    written = [one.get_window_extent() for one in axes.texts]
    frame = axes.get_window_extent()
    assert all(one.x1 <= frame.x1 + 1.0 for one in written)
    curves = axes.lines[0].get_window_extent()
    assert not any(one.y0 < curves.y1 < one.y1 for one in written)


@pytest.mark.parametrize("simulations", [1, 3])
def test_few_simulations_are_counted_in_whole_numbers(simulations: int):
    sample = statistics(synthetic_features(simulations), policy="paper").sample
    counted = [distributions.histogram(sample, one.name) for one in FEATURES]
    figure = single.draw_histograms(counted, sample.classes, policy="paper")
    for axes in figure.axes[: len(counted)]:
        assert all(tick == round(tick) for tick in axes.get_yticks() if axes.patches)


def test_the_same_figure_has_the_same_bytes(result: Statistics):
    first, second = (single.draw_classes(result.classes, policy="paper") for _ in range(2))
    assert style.to_svg(first) == style.to_svg(second)
    assert style.to_png(first) == style.to_png(second)
    assert b"<dc:date>" not in style.to_svg(first)


def test_a_users_settings_change_nothing_and_are_left_alone(result: Statistics):
    plain = style.to_svg(single.draw_classes(result.classes, policy="paper"))
    with mpl.rc_context({"font.size": 30.0, "axes.labelpad": 40.0}):
        assert style.to_svg(single.draw_classes(result.classes, policy="paper")) == plain
        assert mpl.rcParams["font.size"] == 30.0


def test_a_figure_needs_nothing_from_outside(result: Statistics):
    svg = style.to_svg(single.draw_classes(result.classes, policy="paper")).decode()
    links = set(re.findall(r'(?:href|src)="([^"#]+)', svg)) | set(re.findall(r"url\((?!#)", svg))
    assert links == set()
    assert "<text" in svg
    assert "@font-face" not in svg


@pytest.mark.parametrize("rows", [0, 1])
def test_hardly_any_simulations_can_be_drawn(rows: int):
    result = statistics(
        synthetic_features(rows) if rows else synthetic_features(1).iloc[:0], policy="paper"
    )
    sample = result.sample
    counted = [distributions.histogram(sample, one.name) for one in FEATURES]
    points = distributions.pair_points(sample)
    found = associations(sample)
    figures = [
        single.draw_classes(result.classes, policy="paper"),
        single.draw_histograms(counted, sample.classes, policy="paper"),
        single.draw_scaled_boxes(distributions.scaled_boxes(sample)),
        single.draw_boxes_and_swarm(
            sample,
            BY_NAME["SE"],
            distributions.boxes_by_class(sample, "SE"),
            distributions.swarm_points(sample, "SE"),
        ),
        pairs.draw_pairs(sample, [one for one in counted if not one.feature.is_nominal], points),
        pairs.draw_details(sample, points),
        pairs.draw_associations(found),
        pairs.draw_p_values(found),
    ]
    for one in figures:
        one.draw_without_rendering()


# --- colours ---

# Severity 1.0 of G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, A physiologically-based
# model for simulation of color vision deficiency, IEEE TVCG 15 (2009) 1291-1298; on linear RGB.
DEFICIENCIES = {
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "tritanopia": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}


def linear(colour: str) -> np.ndarray:
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, white D65."""
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    xyz = to_xyz @ np.clip(rgb, 0.0, 1.0) / np.array([0.9505, 1.0, 1.089])
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("name", ["none", *DEFICIENCIES])
def test_the_classes_can_be_told_apart_with_any_colour_vision(name: str):
    """Colours that differ by less than 10 (CIE 1976) are easily confused; ours by more than 15."""
    seen = np.array(DEFICIENCIES.get(name, np.eye(3)))
    found = [lab(seen @ linear(palette.CLASS_COLOURS[one])) for one in ALL_CLASSES]
    distances = [
        float(np.linalg.norm(one - other)) for n, one in enumerate(found) for other in found[:n]
    ]
    assert min(distances) > 15.0


def test_every_class_has_a_look_of_its_own():
    assert list(palette.CLASS_COLOURS) == list(ALL_CLASSES)
    for looks in (palette.CLASS_COLOURS, palette.CLASS_MARKERS):
        assert len(set(looks.values())) == len(ALL_CLASSES)


@pytest.fixture(scope="module")
def of_every_class() -> Statistics:
    """Statistics of simulations of all classes, also those that the paper does not have."""
    frame = synthetic_features()
    frame["CLASS"] = np.resize(ALL_CLASSES, len(frame))
    return statistics(frame, policy="paper")


def test_a_legend_of_all_classes_fits_into_the_figure(of_every_class: Statistics):
    sample = of_every_class.sample
    counted = [distributions.histogram(sample, one.name) for one in FEATURES]
    points = distributions.pair_points(sample)
    for figure in (
        single.draw_histograms(counted, sample.classes, policy="paper"),
        pairs.draw_details(sample, points),
    ):
        (legend,) = figure.legends
        figure.canvas.draw()
        inside, whole = legend.get_window_extent(), figure.bbox
        assert len(legend.get_texts()) == len(ALL_CLASSES)
        assert inside.x0 >= whole.x0
        assert inside.x1 <= whole.x1
        assert inside.y1 <= whole.y1


def test_no_two_classes_share_a_colour_a_marker_or_a_hatching_on_a_colour():
    for looks in (palette.CLASS_COLOURS, palette.CLASS_MARKERS):
        assert len(set(looks.values())) == len(looks) == len(ALL_CLASSES)


def test_every_phase_of_an_overtake_has_a_colour():
    assert {"follows", *PHASES.values()} == style.PHASE_COLOURS.keys()


@pytest.mark.parametrize("least", [0.5, 3.0, 50.0])
def test_names_are_moved_apart_as_little_as_that_takes(least: float):
    places = np.random.default_rng(3).uniform(-20.0, 20.0, 8)
    moved = moved_apart(places, least)
    order = np.argsort(places)
    assert (np.diff(moved[order]) > least - 1e-9).all()
    room = least * np.arange(8)
    known = isotonic_regression(places[order] - room).x + room
    np.testing.assert_allclose(moved[order], known)
    assert moved_apart(places[:1], least) == places[:1]
    assert not moved_apart(places[:0], least).size
