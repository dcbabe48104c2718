"""Films of two-way roads: both directions, the line between them, and the next kilometre."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.reference.test_bends import BENDS, HILLS, on
from tests.support.cases import two_way_road
from tests.support.overtakes import meeting, overtake, rural

from overtaking.model.road_course import CentreLineSpan, RoadCourse, RoadMark, RoadZone, ZoneKind
from overtaking.show.video.ahead import _LEFT, _MIDDLE, _SCALE, _TOP, AHEAD, BEHIND
from overtaking.show.video.film import Film, shape_of
from overtaking.show.video.road import dash_period
from overtaking.show.video.view import SCENE_TOP

COURSE = RoadCourse(
    centre_line_spans=(CentreLineSpan(start=200.0, stop=400.0, mark=RoadMark.SOLID),),
    zones=(RoadZone(kind=ZoneKind.CREST, start=700.0, stop=800.0),),
    sight=((0.0, 500.0),),
)


def film(course: RoadCourse | None = COURSE, side: str = "right") -> Film:
    road = dataclasses.replace(two_way_road(), course=course)
    road = road if side == "right" else road.mirror()
    case = rural(meeting(60.0), road=road)
    return Film(case.trajectories, events=case.events)


def pixels(made: Film, frame: int) -> np.ndarray:
    return np.asarray(made.draw(frame).to_rgb()).astype(int)


def bright(picture: np.ndarray, x: float, y: float) -> bool:
    return bool(picture[round(y), round(x)].min() > 180)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_line_between_the_directions_is_solid_where_it_is(side: str):
    made = film(side=side)
    frame = 250  # The ego is at 375 m.
    picture, period = pixels(made, frame), dash_period(made.view.scale)
    row = SCENE_TOP + made.view.y(float(made.scene.road.lane_boundaries[-1]))
    gaps = {True: [], False: []}
    for number in range(10, 60):
        s = (number + 0.7) * period / made.view.scale  # Between two dashes.
        x = made.view.x(frame, s)
        if 0.0 <= x < picture.shape[1] and abs(s - made.scene.s[0, frame]) > 8.0:
            gaps[200.0 < s < 400.0].append(bright(picture, x, row))
    assert gaps[True]
    assert all(gaps[True])
    assert gaps[False]
    assert not any(gaps[False])


def test_who_comes_is_in_the_strip_on_the_other_side():
    made, frame = film(), 200
    picture, ego = pixels(made, frame), made.scene.s[0, frame]
    x = _LEFT + (made.scene.s[2, frame] - ego + BEHIND) * _SCALE
    assert bright(picture, x, _TOP + _MIDDLE - 6.0)  # The left lane is above.
    assert not bright(picture, x, _TOP + _MIDDLE + 6.0)


def test_what_is_beyond_sight_is_darker():
    made, frame = film(), 10
    picture = pixels(made, frame)
    seen, unseen = (_LEFT + (away + BEHIND) * _SCALE for away in (480.0, 560.0))
    row = round(_TOP + _MIDDLE + 8.0)
    assert picture[row, round(seen)].sum() > 1.5 * picture[row, round(unseen)].sum()


def test_a_road_without_a_course_has_no_end_of_sight():
    picture = pixels(film(None), 10)
    row = round(_TOP + _MIDDLE + 8.0)
    first, last = (
        round(_LEFT + (away + BEHIND) * _SCALE) for away in (200.0, AHEAD - 20.0)
    )  # Beyond the target.
    assert np.abs(np.diff(picture[row, first:last], axis=0)).max() < 10


def test_on_a_road_of_one_direction_there_is_no_strip():
    made = overtake()
    picture = pixels(Film(made.trajectories, events=made.events), 10)
    assert np.ptp(picture[round(_TOP + _MIDDLE), 600:1200], axis=0).max() < 40


def test_the_shape_of_a_road_that_is_drawn_straight_is_told():
    road = on(dataclasses.replace(two_way_road(), course=None), *BENDS, grade=HILLS)
    assert shape_of(two_way_road(), 50.0) == ""
    assert shape_of(road, 0.0) == "road shown straight; here straight"
    here = shape_of(road, 600.0)
    assert here == "road shown straight; here a bend to the left, radius 400 m, downhill 2 %"
    assert "to the right" in shape_of(road, 1200.0)
    assert "to the right" in shape_of(road.mirror(), 600.0)


def test_a_film_of_a_bend_says_that_it_is_one():
    straight = dataclasses.replace(two_way_road(), course=RoadCourse(sight=((0.0, 700.0),)))
    bent = on(dataclasses.replace(straight, course=None), *BENDS).course
    assert bent is not None
    assert straight.course is not None
    bent = dataclasses.replace(bent, sight=straight.course.sight)  # Bends would limit it.
    places = (straight, dataclasses.replace(straight, course=bent))
    parts = [
        pixels(Film(case.trajectories, events=case.events), 100)
        for case in (rural(meeting(60.0), road=place) for place in places)
    ]
    changed = np.argwhere((parts[0] != parts[1]).any(axis=2))
    assert len(changed)
    assert changed[:, 0].min() > SCENE_TOP + 100  # A line of text at the lower edge, and no more.
    assert changed[:, 1].min() > 700
