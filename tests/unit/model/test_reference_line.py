"""Reference lines against Fresnel's integrals, circles and an independent integration."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import fresnel

from overtaking.model.reference_line import _NODES, _WEIGHTS, CurveSegment, ReferenceLine, cos_sin

_KM_10 = 10_000.0


def _curvatures(largest: float) -> st.SearchStrategy[float]:
    return st.floats(-largest, largest, allow_nan=False)


@st.composite
def lines(draw: st.DrawFn) -> ReferenceLine:
    """Lines of up to 10 km without a jump, which turn by less than half a turn in all.

    Such a line does not come back to itself, so a point near it has one foot. Its bends have
    radii of 30 m and more: 15 m beside it the curvature times the offset is below 0.5.
    """
    count = draw(st.integers(1, 8))
    x, y = draw(st.floats(-1e5, 1e5)), draw(st.floats(-1e5, 1e5))
    heading = draw(st.floats(-math.pi, math.pi))
    pieces: list[CurveSegment] = []
    for _ in range(count):
        length = draw(st.floats(1.0, _KM_10 / count))
        sharpest = min(0.033, 3.0 / (count * length))
        bends = draw(st.tuples(_curvatures(sharpest), _curvatures(sharpest)))
        piece = CurveSegment(x, y, heading, length, *bends)
        pieces.append(piece)
        end = ReferenceLine.from_segments([piece]).pose_at(piece.length)
        x, y, heading = float(end.x), float(end.y), float(end.heading)
    return ReferenceLine.from_segments(pieces)


def test_nodes_and_weights_are_those_of_numpy() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(8)
    assert np.allclose(np.sort(nodes)[4:], _NODES, rtol=0.0, atol=1e-15)
    assert np.allclose(weights[4:], _WEIGHTS, rtol=0.0, atol=1e-15)


def test_directions_are_sine_and_cosine() -> None:
    angles = np.linspace(-30.0, 30.0, 100_001)
    cosine, sine = cos_sin(angles)
    assert np.abs(cosine - np.cos(angles)).max() < 1e-14
    assert np.abs(sine - np.sin(angles)).max() < 1e-14


@pytest.mark.parametrize("growth", [1e-2, 1e-4, -3e-5])
def test_clothoids_are_fresnels_integrals(growth: float) -> None:
    # With x(s) the integral of cos(c u^2 / 2), s = sqrt(pi / c) z gives C(z), S(z) scaled so.
    length = 200.0
    line = ReferenceLine.from_segments([CurveSegment(0.0, 0.0, 0.0, length, 0.0, growth * length)])
    s = np.linspace(0.0, length, 501)
    scale = math.sqrt(math.pi / abs(growth))
    sine, cosine = fresnel(s / scale)
    found = line.pose_at(s)
    assert np.abs(found.x - scale * cosine).max() < 1e-10
    assert np.abs(found.y - math.copysign(1.0, growth) * scale * sine).max() < 1e-10


def test_an_arc_of_a_full_turn_returns_to_its_start() -> None:
    radius = 80.0
    line = ReferenceLine.from_segments(
        [CurveSegment(3.0, -4.0, 1.0, math.tau * radius, -1.0 / radius, -1.0 / radius)]
    )
    end = line.pose_at(line.length)
    assert math.hypot(float(end.x) - 3.0, float(end.y) + 4.0) < 1e-11
    assert float(end.heading) == pytest.approx(1.0 - math.tau, abs=1e-13)
    assert line.max_curvature == pytest.approx(1.0 / radius)


def test_a_line_through_all_kinds_agrees_with_an_independent_integration() -> None:
    lengths, curvatures = (100.0, 60.0, 120.0, 60.0, 300.0), (0.0, 0.0, 0.01, 0.01, -0.002, -0.002)
    pieces: list[CurveSegment] = []
    pose = (0.0, 0.0, 0.3)
    for number, length in enumerate(lengths):
        piece = CurveSegment(*pose, length, curvatures[number], curvatures[number + 1])
        pieces.append(piece)
        end = ReferenceLine.from_segments([piece]).pose_at(length)
        pose = (float(end.x), float(end.y), float(end.heading))
    line = ReferenceLine.from_segments(pieces)
    knots = np.cumsum([0.0, *lengths])
    solved = solve_ivp(
        lambda s, state: (
            math.cos(state[2]),
            math.sin(state[2]),
            float(np.interp(s, knots, curvatures)),
        ),
        (0.0, line.length),
        (0.0, 0.0, 0.3),
        rtol=1e-11,
        atol=1e-11,
        max_step=1.0,
        t_eval=np.linspace(0.0, line.length, 200),
    )
    found = line.pose_at(solved.t)
    assert np.abs(found.x - solved.y[0]).max() < 1e-6
    assert np.abs(found.y - solved.y[1]).max() < 1e-6
    assert np.abs(found.heading - solved.y[2]).max() < 1e-8


def test_it_goes_on_straight_beyond_its_ends() -> None:
    line = ReferenceLine.from_segments(
        [CurveSegment(0.0, 0.0, 0.0, 10.0), CurveSegment(10.0, 0.0, 0.0, 20.0, 0.0, 0.02)]
    )
    end = line.pose_at(line.length)
    x, y = line.to_world([-5.0, line.length + 7.0], [1.0, 0.0])
    assert (x[0], y[0]) == (-5.0, 1.0)
    assert x[1] == pytest.approx(float(end.x) + 7.0 * math.cos(float(end.heading)))
    s, d = line.to_road(x, y)
    assert s == pytest.approx([-5.0, line.length + 7.0], abs=1e-9)
    assert d == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.ci
@given(line=lines(), part=st.floats(0.0, 1.0), offset=st.floats(-15.0, 15.0))
def test_world_coordinates_lead_back_within_two_millimetres(
    line: ReferenceLine, part: float, offset: float
) -> None:
    s = part * line.length
    x, y = line.to_world(s, offset)
    found = line.to_road(x, y)
    assert float(found[0]) == pytest.approx(s, abs=0.002)
    assert float(found[1]) == pytest.approx(offset, abs=0.002)


def test_a_line_that_comes_back_to_itself_has_one_of_its_points_for_each() -> None:
    radius = 256.0
    line = ReferenceLine.from_segments(
        [CurveSegment(0.0, 0.0, 0.0, 13.0 * radius, 1.0 / radius, 1.0 / radius)]
    )
    x, y = line.to_world(np.linspace(0.0, line.length, 50), 3.0)
    again = line.to_world(*line.to_road(x, y))
    assert np.hypot(again[0] - x, again[1] - y).max() < 0.002
