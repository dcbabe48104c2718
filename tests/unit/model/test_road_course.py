"""What changes along a road: what is refused, the line from end to end, sight, the road `rural`."""

import dataclasses
import math
import re

import numpy as np
import pytest

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import known_road
from overtaking.model.road_course import (
    CentreLineSpan,
    RoadCourse,
    RoadMark,
    RoadZone,
    SpeedLimitSpan,
    ZoneKind,
    marks_along,
)
from overtaking.world.sight_distance import sight_at

SOLID, BROKEN, MIXED = RoadMark.SOLID, RoadMark.BROKEN, RoadMark.SOLID_BROKEN


def line(start: float, stop: float, mark: RoadMark = SOLID) -> CentreLineSpan:
    return CentreLineSpan(start=start, stop=stop, mark=mark)


def limit(start: float, stop: float, speed: float, direction: int = 0) -> SpeedLimitSpan:
    return SpeedLimitSpan(start=start, stop=stop, speed=speed, direction=direction)


def test_the_mark_of_the_lane_holds_between_the_spans_of_the_centre_line():
    lines = (line(100.0, 200.0), line(200.0, 250.0, MIXED), line(400.0, 500.0, BROKEN))
    assert marks_along(lines, BROKEN) == (
        (-math.inf, BROKEN),
        (100.0, SOLID),
        (200.0, MIXED),
        (250.0, BROKEN),
    )
    assert marks_along((), SOLID) == ((-math.inf, SOLID),)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"centre_line_spans": (line(10.0, 10.0),)}, "stretch: expected start before stop"),
        (
            {"centre_line_spans": (line(0.0, 20.0), line(10.0, 30.0))},
            "centre_line_spans: expected in order",
        ),
        (
            {"speed_limit_spans": (limit(0, 20, 10.0), limit(10, 30, 9.0, -1))},
            "speed_limit_spans: expected in order",
        ),
        ({"speed_limit_spans": (limit(0, 20, 0.0),)}, "speed: expected more than 0"),
        ({"zones": (RoadZone(kind=ZoneKind.BEND, start=9.0, stop=1.0),)}, "start before stop"),
        ({"zones": (RoadZone(kind=ZoneKind.BEND, start=-1.0, stop=1.0),)}, "start: expected 0 to"),
        ({"sight": ((0.0, 100.0), (0.0, 200.0))}, "sight: expected stations in order"),
        ({"sight": ((0.0, 0.0),)}, "more than 0 and at most 10000 m, got 0 m at 0 m"),
        ({"sight_against": ((math.nan, 1.0),)}, "sight_against: expected 0 to 100000 m"),
        ({"sight": ((0.0, 1.0, 2.0),)}, "sight: expected several values"),
        ({"sight": tuple((float(k), 1.0) for k in range(1001))}, "sight: expected at most 1000"),
    ],
)
def test_spans_and_stations_out_of_order_are_refused(changes, reason: str):
    with pytest.raises(ConfigError, match=re.escape(reason)):
        RoadCourse(**changes)


@pytest.mark.parametrize(
    "course",
    [
        RoadCourse(centre_line_spans=(line(0.0, 10.0),)),
        RoadCourse(sight_against=((0.0, 10.0),)),
        RoadCourse(speed_limit_spans=(limit(0.0, 1.0, 10.0, -1),)),
        RoadCourse(zones=(RoadZone(kind=ZoneKind.CREST, start=0.0, stop=1.0, direction=-1),)),
    ],
)
def test_a_course_for_oncoming_traffic_needs_an_opposing_lane(course: RoadCourse):
    with pytest.raises(ConfigError, match="lines or sight for it, and no such lane"):
        dataclasses.replace(known_road("motorway"), course=course)


def test_a_course_ends_with_its_road():
    course = RoadCourse(sight=((0.0, 100.0), (5000.1, 100.0)))
    with pytest.raises(ConfigError, match="the length of the road, got 5000"):
        dataclasses.replace(known_road("motorway"), course=course)


def test_sight_is_linear_between_stations_and_constant_beyond():
    course = RoadCourse(sight=((100.0, 300.0), (200.0, 100.0)))
    np.testing.assert_array_equal(course.sight_at([0.0, 150.0, 999.0]), [300.0, 200.0, 100.0])
    np.testing.assert_array_equal(course.sight_at([0.0, 150.0], -1), [np.inf, np.inf])
    np.testing.assert_array_equal(sight_at(known_road("motorway"), 7.0), np.inf)


def test_speed_limit_spans_apply_from_start_to_stop_in_their_direction():
    both = (limit(100, 200, 20.0), limit(200, 300, 10.0, 1), limit(250, 300, 15.0, -1))
    road = dataclasses.replace(known_road("rural"), course=RoadCourse(speed_limit_spans=both))
    stations = [99.9, 100.0, 199.9, 200.0, 250.0, 300.0]
    np.testing.assert_array_equal(
        road.speed_limit_at(stations), [25.0, 20.0, 20.0, 10.0, 10.0, 25.0]
    )
    np.testing.assert_array_equal(
        road.speed_limit_at(stations, -1), [25.0, 20.0, 20.0, 25.0, 15.0, 25.0]
    )
    assert road.speed_limit_at(150.0) == 20.0
    assert road.mirror().course == road.course


def test_the_limit_of_a_road_is_its_highest():
    with pytest.raises(ConfigError, match="expected below 25 m/s, the limit of the road, got 26"):
        dataclasses.replace(
            known_road("rural"), course=RoadCourse(speed_limit_spans=(limit(0, 9, 26.0),))
        )


def test_a_course_is_the_same_in_a_mirrored_world():
    road = known_road("rural")
    mirrored = road.mirror()
    assert mirrored.course == road.course
    assert mirrored.overtaking_edge_marks == road.overtaking_edge_marks
    assert mirrored.mirror() == road


def test_the_sight_of_the_rural_road_is_that_of_its_bends_and_crests():
    road = known_road("rural")
    assert road.course is not None
    bend = 2.0 * 1000.0 * math.acos(1.0 - 5.0 / 1000.0)
    crest = math.sqrt(2.0 * 4000.0) * 2.0 * math.sqrt(1.08)
    for place in road.course.zones:
        within = {ZoneKind.BEND: bend, ZoneKind.CREST: crest}[place.kind]
        middle = 0.5 * (place.start + place.stop)
        for direction in (1, -1):
            assert sight_at(road, middle, direction) == pytest.approx(within, abs=0.5)
        # From the straight stretches one sees the place and as far into it as from within.
        assert sight_at(road, place.start - 100.0) == pytest.approx(100.0 + within, abs=0.5)
        assert sight_at(road, place.stop + 100.0, -1) == pytest.approx(100.0 + within, abs=0.5)


def test_the_line_of_the_rural_road_is_solid_where_sight_is_short():
    road = known_road("rural")
    starts, marks = zip(*road.overtaking_edge_marks, strict=True)
    s = np.arange(0.5, road.length, 1.0)
    here = np.array(marks, object)[np.searchsorted(starts, s, side="right") - 1]
    closed = (here == SOLID) | (here == MIXED)
    sight = sight_at(road, s)
    # Behind a bend the line stays solid while sight opens up, some 10 m.
    assert sight[~closed].min() >= 200.0
    assert sight[closed].max() <= 380.0
    assert np.mean(sight[~closed] < 280.0) < 0.01
    assert 0.3 < 1.0 - closed.mean() < 0.6
