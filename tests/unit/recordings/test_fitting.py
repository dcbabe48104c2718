"""A line through points of roads that are known: circles, clothoids, noise, and what is no road."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import fresnel

from overtaking.model.reference_line import ReferenceLine
from overtaking.recordings.fitting import CLOSE, LARGEST_MISS, fitted, is_straight


def circle(radius: float, angle: float, spacing: float) -> np.ndarray:
    """Points of a circle about (0, radius) from the origin on, to the left if the radius is > 0."""
    turn = np.linspace(0.0, angle, 2 + int(abs(radius * angle) / spacing)) * np.sign(radius)
    return np.stack([radius * np.sin(turn), radius * (1.0 - np.cos(turn))], axis=1)


def spirals() -> tuple[np.ndarray, np.ndarray]:
    """Points and directions of two clothoids of 100 m, to a radius of 120 m and back, by SciPy."""
    scale = np.sqrt(np.pi * 120.0 * 100.0)
    s = np.linspace(0.0, 100.0, 101)
    north, east = fresnel(s / scale)
    half = scale * np.stack([east, north], axis=1)
    heading = s**2 / (2.0 * 120.0 * 100.0)
    turn = 2.0 * heading[-1]
    # The way back is the way out, seen in a mirror square to the road in its middle.
    mirror = -np.array([[np.cos(turn), np.sin(turn)], [np.sin(turn), -np.cos(turn)]])
    other = half[-1] + (half[::-1][1:] - half[-1]) @ mirror.T
    return np.concatenate([half, other]), np.append(heading, turn - heading[::-1][1:])


def off(pieces, points: np.ndarray) -> float:
    """Largest distance of points from a line."""
    return float(np.abs(ReferenceLine.from_segments(pieces).to_road(*points.T)[1]).max())


def test_a_straight_road_with_rough_edges_is_one_straight_piece():
    x = np.linspace(0.0, 800.0, 200)
    points = np.stack([x, 0.3 * x + np.random.default_rng(1).uniform(-0.05, 0.05, 200)], axis=1)
    line = fitted(points)
    assert line is not None
    assert is_straight(line.pieces)
    assert line.pieces[0].heading == pytest.approx(np.arctan(0.3), abs=1e-4)
    assert line.pieces[0].length == pytest.approx(800.0 * np.hypot(1.0, 0.3), abs=0.1)
    back = fitted(points[::-1])
    assert back is not None
    assert np.cos(back.pieces[0].heading) < 0.0


@pytest.mark.parametrize("radius", [15.0, -25.0, 80.0, -400.0, 3000.0])
@pytest.mark.parametrize("spacing", [1.0, 5.0])
def test_a_circle_is_near_by_everywhere_and_bends_as_it_does(radius, spacing):
    angle = min(4.0, 600.0 / abs(radius))
    line = fitted(circle(radius, angle, spacing))
    assert line is not None
    # Chords of 5 m lie inside a bend of 15 m by 0.21 m; the line runs between both.
    sag = spacing**2 / (8.0 * abs(radius))
    assert line.miss <= max(CLOSE, sag)
    made = ReferenceLine.from_segments(line.pieces)
    assert off(line.pieces, circle(radius, angle, 0.5)) <= CLOSE + sag
    assert made.length == pytest.approx(abs(radius) * angle, rel=0.02)
    inner = made.pose_at(np.linspace(0.1, 0.9, 50) * made.length)
    assert np.median(inner.curvature) == pytest.approx(1.0 / radius, rel=0.05)
    assert made.heading_at(made.length) == pytest.approx(angle * np.sign(radius), abs=0.1)


def test_clothoids_in_and_out_of_a_bend_with_noise_are_within_what_is_said():
    exact, heading = spirals()
    noisy = exact + np.random.default_rng(2).normal(0.0, 0.03, exact.shape)
    line = fitted(noisy)
    assert line is not None
    assert line.miss <= 0.25
    assert off(line.pieces, exact) < CLOSE
    made = ReferenceLine.from_segments(line.pieces)
    found = made.heading_at(made.to_road(*exact.T)[0])
    assert np.abs(found - heading).max() < 0.03
    assert len(line.pieces) <= 20


def test_pieces_join_in_place_direction_and_curvature():
    line = fitted(spirals()[0])
    assert line is not None
    assert len(line.pieces) > 1
    for one, after in zip(line.pieces, line.pieces[1:], strict=False):
        end = ReferenceLine.from_segments([one]).pose_at(one.length)
        assert (end.x, end.y) == pytest.approx((after.x, after.y), abs=1e-9)
        assert end.heading == pytest.approx(after.heading, abs=1e-12)
        assert one.end_curvature == after.curvature


def test_a_corner_is_no_road():
    line = fitted(np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 2.0]]))
    assert line is not None
    assert line.miss > LARGEST_MISS


@pytest.mark.parametrize("length", [0.0, 1e-9, 2e5])
def test_no_way_and_more_than_roads_have_are_none(length):
    with np.errstate(all="raise"):
        assert fitted(np.array([[0.0, 0.0], [length, 0.0], [length, 0.0]])) is None
