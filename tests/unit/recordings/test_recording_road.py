"""The road between borders, against a circle, on which everything is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from overtaking.recordings.fitting import CLOSE
from overtaking.recordings.road import RoadShapeError, scaled, shape_of

WIDTH = 3.5


def circle(radius: float, angle: float, offsets: tuple[float, ...]) -> list[np.ndarray]:
    """Lines at offsets to the left of a circle about (0, radius), from the origin on."""
    turn = np.linspace(0.0, angle, 400)
    return [
        np.stack([(radius - left) * np.sin(turn), radius - (radius - left) * np.cos(turn)], axis=1)
        for left in offsets
    ]


def rotated(lines: list[np.ndarray], turn: float) -> list[np.ndarray]:
    cosine, sine = np.cos(turn), np.sin(turn)
    return [line @ np.array([[cosine, sine], [-sine, cosine]]) for line in lines]


@pytest.mark.ci
@settings(max_examples=30, deadline=None)
@given(
    radius=st.sampled_from([-2000.0, -500.0, 400.0, 900.0, 40.0]),
    turn=st.floats(-3.1, 3.1),
    left=st.floats(-5.0, 5.0),
    part=st.floats(0.15, 0.85),
)
def test_way_offset_direction_and_stretch_are_those_of_a_circle(radius, turn, left, part):
    angle = 150.0 / radius
    edges = tuple(WIDTH * (k - 1.5) for k in range(4))
    shape = shape_of(rotated(circle(radius, angle, edges), turn))
    at = angle * part
    (point,) = rotated(circle_points(radius, at, left), turn)
    other = angle * (part + 0.05)
    (further,) = rotated(circle_points(radius, other, left), turn)
    x, y = np.array([point[0], further[0]]).T
    found = shape.project(x, y)
    assert found.offset == pytest.approx(left, abs=CLOSE)
    assert found.d - shape.mean_borders[0] == pytest.approx(left - edges[0], abs=0.01)
    assert np.diff(found.s)[0] == pytest.approx(radius * (other - at), abs=0.02)
    direction = found.tangent - turn - np.array([at, other])
    assert np.abs(np.angle(np.exp(1j * direction))).max() < 1e-2
    assert found.stretch == pytest.approx(1.0 - left / radius, abs=5e-3)


def circle_points(radius: float, angle: float, left: float) -> list[np.ndarray]:
    far = radius - left
    return [np.array([[far * np.sin(angle), radius - far * np.cos(angle)]])]


def test_the_mean_borders_have_the_mean_widths_and_a_constant_road_is_exact():
    x = np.linspace(0.0, 300.0, 40)
    lines = [np.stack([x, np.full_like(x, 2.0 + 3.6 * k)], axis=1) for k in range(3)]
    shape = shape_of(lines)
    assert shape.length == pytest.approx(300.0)
    assert np.allclose(np.diff(shape.mean_borders), 3.6)
    assert (shape.turn, shape.widening) == (pytest.approx(0.0), pytest.approx(0.0))
    found = shape.project(np.array([10.0, 299.0]), np.array([2.0 + 3.6, 2.0 + 1.8]))
    assert found.s == pytest.approx([10.0, 299.0])
    assert found.d == pytest.approx([0.0, -1.8])


@given(
    offset=st.floats(-20.0, 20.0),
    widths=st.lists(st.floats(2.5, 5.0), min_size=2, max_size=5),
)
def test_scaling_keeps_lanes_and_what_is_beyond_them_and_can_be_undone(offset, widths):
    local = np.concatenate([[-4.0], -4.0 + np.cumsum(widths)])
    mean = np.concatenate([[-3.5], -3.5 + np.cumsum([3.5] * len(widths))])
    there = scaled(np.array([offset]), local[None, :], mean)
    if np.abs(local - offset).min() > 1e-9:  # Nearer to a border, rounding decides the side.
        assert np.searchsorted(mean, there, "right") == np.searchsorted(local, [offset], "right")
    back = scaled(there, mean[None, :], local)
    assert back == pytest.approx([offset], abs=1e-9)
    if offset < local[0]:
        assert mean[0] - there == pytest.approx(local[0] - offset)


@pytest.mark.parametrize(
    ("lines", "what"),
    [
        (circle(12.0, 1.0, (-3.5, 0.0, 3.5)), "bend"),
        (circle(1e6, 5e-6, (-3.5, 0.0, 3.5)), "lanes"),
    ],
)
def test_what_the_model_has_no_place_for_is_refused(lines, what):
    with pytest.raises(RoadShapeError, match=what):
        shape_of(lines)


def test_the_centre_of_a_bend_is_somewhere_and_no_warning():
    shape = shape_of(circle(100.0, 1.5, (-3.5, 0.0, 3.5)))
    with np.errstate(all="raise"):
        found = shape.project(np.array([0.0]), np.array([100.0]))
    assert np.isfinite([found.s, found.d, found.tangent, found.stretch]).all()


def test_points_closer_than_a_slope_can_tell_are_one():
    x = np.array([0.0, 1e-308, 150.0, 150.0, 300.0])
    lines = [np.stack([x, np.full_like(x, 3.5 * k)], axis=1) for k in range(3)]
    with np.errstate(all="raise", under="ignore"):
        shape = shape_of(lines)
    assert shape.length == pytest.approx(300.0)
    assert shape.turn == pytest.approx(0.0)


def test_a_border_that_leaps_to_the_side_is_no_road():
    x = np.array([0.0, 1e-308, 150.0, 150.0, 300.0])
    lines = [np.stack([x, np.array([0.0, 9.0, 0.0, 5.0, 0.0]) + 3.5 * k], axis=1) for k in range(3)]
    with np.errstate(all="raise", under="ignore"), pytest.raises(RoadShapeError):
        shape_of(lines)
