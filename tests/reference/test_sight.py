"""Sight distances on roads with bends and crests, against closed formulas."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.two_way import pair
from tests.support.worlds import scenario

from overtaking.model.known_roads import known_road
from overtaking.model.reference_line import CurveSegment, ReferenceLine
from overtaking.model.road_course import RoadCourse, RoadZone, ZoneKind
from overtaking.model.trajectories import Stage
from overtaking.sim import engine, reference
from overtaking.world.sight_distance import all_zones_for, sight_at, visible_distance

from .situations import difference

if TYPE_CHECKING:
    from overtaking.model.road import Road

LENGTH = 6000.0
CLEARANCE, CAR, TRUCK = 5.0, 1.08, 2.4


@cache
def two_way() -> Road:
    """A straight road of two lanes without a course."""
    return dataclasses.replace(known_road("rural").extend_to(LENGTH), course=None)


def bent(*parts: tuple[float, float, float], **course) -> Road:
    """The two-way road along segments of (length, curvature at begin, curvature at end)."""
    pieces, x, y, heading = [], 0.0, 0.0, 0.0
    for length, begin, end in parts:
        pieces.append(CurveSegment(x, y, heading, length, begin, end))
        end_pose = ReferenceLine.from_segments(pieces[-1:]).pose_at(length)
        x, y, heading = float(end_pose.x), float(end_pose.y), float(end_pose.heading)
    return dataclasses.replace(two_way(), course=RoadCourse(segments=tuple(pieces), **course))


def over(radius: float) -> Road:
    """The road over a crest from a rise to a fall of 0.06, its top in the middle."""
    half = 0.06 * radius
    grade = ((0.5 * LENGTH - half, 0.06), (0.5 * LENGTH + half, -0.06))
    return dataclasses.replace(two_way(), course=RoadCourse(grade=grade))


@pytest.mark.parametrize(("radius", "sight"), [(200, 90), (400, 127), (700, 167), (1500, 245)])
@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("direction", [1, -1])
def test_the_sight_distance_in_a_bend_is_the_chord_past_its_inside(
    radius: float, sight: float, turn: float, direction: int
):
    """S = 2 R acos(1 - m / R), R to the middle of the lane inside."""
    # The middle of the lanes is 1.75 m beside the line that the stations are counted along.
    line = radius + 1.75
    road = bent((LENGTH, turn / line, turn / line))
    formula = 2.0 * radius * math.acos(1.0 - CLEARANCE / radius)
    assert formula == pytest.approx(sight, abs=0.6)
    middle = 0.5 * LENGTH if direction > 0 else 0.5 * LENGTH + 1.0
    visible = float(sight_at(road, middle, direction)) * radius / line
    assert visible == pytest.approx(formula, abs=0.5)


@pytest.mark.parametrize(
    ("radius", "sight"), [(4_000, 186), (10_000, 294), (16_000, 372), (30_000, 509)]
)
@pytest.mark.parametrize("direction", [1, -1])
def test_the_sight_distance_over_a_crest_follows_its_tangent(
    radius: float, sight: float, direction: int
):
    """S = sqrt(2 R) (sqrt(a) + sqrt(b)), from a truck a quarter farther."""
    visible, formulas = visible_distance(over(radius), direction), []
    assert visible is not None
    for eye, distances in ((CAR, visible.over_crests), (TRUCK, visible.over_crests_from_truck)):
        formulas.append(math.sqrt(2.0 * radius) * (math.sqrt(eye) + math.sqrt(CAR)))
        # The eye is before the top, so that the visible distance lies on the crest.
        s = 0.5 * LENGTH - direction * 0.5 * formulas[-1]
        assert np.interp(s, np.arange(len(distances)) * 2.0, distances) == pytest.approx(
            formulas[-1], abs=1.0
        )
    assert formulas[0] == pytest.approx(sight, abs=0.6)
    assert formulas[1] / formulas[0] == pytest.approx(1.25, abs=0.01)


def test_the_sight_distance_falls_before_a_bend_and_recovers_behind_it():
    """Sight from a straight into a bend ends at the tangent to the inside of the bend."""
    radius, begin, end = 300.0, 2000.0, 2300.0
    line = radius + 1.75
    road = bent((begin, 0.0, 0.0), (end - begin, -1 / line, -1 / line), (LENGTH, 0.0, 0.0))
    for distance in (50.0, 150.0, 400.0):
        # From the eye on the tangent of the lane the wall begins at the clearance to its right; it
        # is touched at the angle a, beyond which the line meets the lane again at the angle b.
        eye = np.array([-distance, radius])
        angles = np.linspace(0.0, 0.8, 800_001)
        inner = radius - CLEARANCE
        # Slope of the line of sight past each point of the wall; the steepest one clears the wall.
        rise = (inner * np.cos(angles) - eye[1]) / (inner * np.sin(angles) - eye[0])
        steepest = rise.max()
        path = radius * np.cos(angles) - eye[1] - steepest * (radius * np.sin(angles) - eye[0])
        visible_arc = angles[np.flatnonzero(path < 0.0)[0]] * radius
        expected = distance + visible_arc * line / radius
        assert float(sight_at(road, begin - distance)) == pytest.approx(expected, abs=1.0)
    # After the bend, sight on the straight has no limit.
    assert np.isinf(sight_at(road, end + 60.0))
    assert np.isfinite(sight_at(road, end - 60.0))


def test_sight_is_mutual():
    """Eyes and visible points have the same height, so sight is mutual."""
    road = bent((1500.0, 0.0, 0.0), (300.0, 0.0, 1 / 250), (LENGTH, 1 / 250, 1 / 250),
                grade=((0.0, 0.04), (900.0, 0.04), (1200.0, -0.04)))  # fmt: skip
    s = np.arange(0.0, 3000.0, 2.0)
    visible_s = s + sight_at(road, s)
    s, visible_s = s[visible_s < 3000.0], visible_s[visible_s < 3000.0]
    assert len(s) > 1000
    s_back = visible_s - sight_at(road, visible_s, -1)
    # Before a crest centimetres ahead are metres here, so one of both directions must agree.
    visible_s_again = s_back + sight_at(road, s_back)
    assert np.minimum(np.abs(s_back - s), np.abs(visible_s_again - visible_s)).max() < 2.0


def test_straight_roads_have_unlimited_sight_and_stated_sight_is_kept():
    assert np.isinf(sight_at(two_way(), [0.0, 500.0])).all()
    slope = dataclasses.replace(two_way(), course=RoadCourse(grade=((0.0, 0.05),)))
    assert np.isinf(sight_at(slope, [0.0, 500.0])).all()
    stated = bent((LENGTH, 0.01, 0.01), sight=((0.0, 333.0),))
    assert sight_at(stated, 100.0) == 333.0
    assert not all_zones_for(stated, 1)


def test_zones_cover_bends_and_crests_with_too_little_sight():
    """Bends below the 50 m of Article 19, crests below the 280 m that are needed at 90 km/h."""
    assert not all_zones_for(bent((LENGTH, 1 / 100, 1 / 100)), 1)
    sharp = bent((1000.0, 0.0, 0.0), (60.0, 1 / 40, 1 / 40), (LENGTH, 0.0, 0.0))
    (bend,) = all_zones_for(sharp, 1)
    assert bend.kind is ZoneKind.BEND
    assert 950.0 < bend.start < 1000.0 < bend.stop < 1060.0
    (crest,) = all_zones_for(over(4_000.0), 1)
    assert crest.kind is ZoneKind.CREST
    assert crest.start < 0.5 * LENGTH < crest.stop
    (back,) = all_zones_for(over(4_000.0), -1)
    assert (back.start, back.stop) == pytest.approx(
        (LENGTH - crest.stop, LENGTH - crest.start), abs=2.0
    )
    assert not all_zones_for(over(10_000.0), 1)
    junction = RoadZone(kind=ZoneKind.JUNCTION, start=5.0, stop=6.0)
    course = dataclasses.replace(over(10_000.0).course or RoadCourse(), zones=(junction,))
    assert all_zones_for(dataclasses.replace(two_way(), course=course), 1) == (junction,)


@pytest.mark.ci
def test_both_engines_see_equally_far():
    """Behind bends and crests, from cars and from a truck, both ways: the same bits."""
    road = bent((1000.0, 0.0, 0.0), (LENGTH, 1 / 300, 1 / 300),
                grade=((0.0, 0.05), (1100.0, 0.05), (1300.0, -0.05)))  # fmt: skip
    near, far = (pair(gap, gap_demand_factor=0.0) for gap in (180.0, 400.0))
    far[0] = dataclasses.replace(far[0], kind="T")
    world = scenario(near, far, road=road, horizon=6.0, num_slots=3)
    expected = reference.simulate(world)
    assert (expected.stage == Stage.PULL_OUT).any()
    assert not difference(engine.simulate(world), expected)


def test_the_ego_does_not_pass_on_an_empty_road_without_sight():
    """An unseen road counts as an oncoming vehicle at the end of sight."""
    hidden = bent((LENGTH, 1 / 400, 1 / 400))
    assert hidden.course is not None
    course = dataclasses.replace(hidden.course, sight=((0.0, 1000.0),))
    for road, passes in ((hidden, False), (dataclasses.replace(hidden, course=course), True)):
        run = engine.simulate(scenario(pair(), road=road, horizon=25.0))
        assert (run.stage == Stage.PULL_OUT).any() == passes
