"""The OpenDRIVE that we write, read by our own reader and by CARLA's."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.test_bends import BENDS, HILLS, on
from tests.support.carla import needs_wheel
from tests.support.worlds import wide_road

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import known_road
from overtaking.model.road import Lane, Road, RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse, SpeedLimitSpan
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.opendrive_writer import covering, write_opendrive
from overtaking.world.sight_distance import sight_at

if TYPE_CHECKING:
    from pathlib import Path

ROADS = {
    "town06": known_road("town06"),
    "motorway": known_road("motorway"),
    "longer": known_road("town06").extend_to(3000.0),
    "left-hand traffic": known_road("motorway").mirror(),
    "without shoulders": wide_road(),
    "short": dataclasses.replace(wide_road(), length=15.0),
}


def written(road: Road, folder: Path) -> Road:
    path = folder / "road.xodr"
    path.write_text(write_opendrive(road), encoding="utf-8")
    return read_opendrive(path, lanes="right" if road.lanes[0].lane_id < 0 else "left")


@pytest.mark.parametrize("road", ROADS.values(), ids=ROADS)
def test_a_road_comes_back_as_it_was(road: Road, tmp_path: Path):
    back = written(road, tmp_path)
    for field in dataclasses.fields(Road):
        if field.name not in ("name", "speed_limit"):
            assert getattr(back, field.name) == getattr(road, field.name), field.name
    assert back.speed_limit == pytest.approx(road.speed_limit, rel=1e-12)


def test_a_road_that_runs_against_its_reference_line_comes_back(tmp_path: Path):
    """Positive ids in right-hand traffic: the file's line runs the other way."""
    road = known_road("motorway")
    lanes = tuple(dataclasses.replace(lane, lane_id=-lane.lane_id) for lane in road.lanes)
    turned = dataclasses.replace(
        road, lanes=lanes, kerb_side_neighbour=None, overtaking_side_neighbour=None
    )
    back = written(turned, tmp_path)
    assert back.lanes == turned.lanes
    assert back.to_world(100.0, -5.0) == pytest.approx(turned.to_world(100.0, -5.0), abs=1e-9)
    assert back.kerb_edge_d == turned.kerb_edge_d


def limit(start: float, stop: float, speed: float, direction: int = 0) -> SpeedLimitSpan:
    return SpeedLimitSpan(start=start, stop=stop, speed=speed, direction=direction)


LIMITED = {
    "of one direction": (known_road("town06"), (limit(0, 100, 9.0), limit(300, 400, 20.0))),
    "up to its end": (known_road("motorway"), (limit(4000, 5000, 20.0),)),
    "of two directions": (known_road("rural"), (limit(100, 900, 20.0), limit(900, 950, 10.0))),
    "that differ": (
        known_road("rural"),
        (limit(0, 5000, 22.0, 1), limit(100, 900, 20.0, -1), limit(4995, 5000, 15.0, -1)),
    ),
    "of those who come": (known_road("rural").mirror(), (limit(100, 900, 20.0, -1),)),
}


@pytest.mark.parametrize("turned", [False, True], ids=["along the line", "against it"])
@pytest.mark.parametrize(("road", "limits"), LIMITED.values(), ids=LIMITED)
def test_limits_come_back_where_they_were(
    road: Road, limits: tuple[SpeedLimitSpan, ...], turned: bool, tmp_path: Path
):
    road = dataclasses.replace(road, course=RoadCourse(speed_limit_spans=limits))
    if turned:
        lanes = tuple(dataclasses.replace(lane, lane_id=-lane.lane_id) for lane in road.lanes)
        beyond = road.overtaking_side_neighbour if road.is_two_way else None
        across = beyond and dataclasses.replace(beyond, lane_id=-beyond.lane_id)
        road = dataclasses.replace(
            road, lanes=lanes, kerb_side_neighbour=None, overtaking_side_neighbour=across
        )
    back = written(road, tmp_path)
    assert back.course is not None
    assert back.speed_limit == pytest.approx(road.speed_limit, rel=1e-12)
    found = [
        (one.start, one.stop, one.speed, one.direction) for one in back.course.speed_limit_spans
    ]
    stated = [(one.start, one.stop, one.speed, one.direction) for one in limits]
    assert len(found) == len(stated)
    for one, other in zip(found, stated, strict=True):
        assert one == pytest.approx(other, rel=1e-9)


@needs_wheel
def test_carla_reads_the_limit_of_each_stretch():
    import carla

    course = RoadCourse(speed_limit_spans=(limit(100, 300, 50 / 3.6),))
    road = dataclasses.replace(known_road("town06"), course=course)
    text = write_opendrive(road)
    assert carla.Map("limits", text).get_waypoint_xodr(1, -7, 200.0) is not None
    assert text.count("<type ") == 3


@pytest.mark.parametrize("mark", [mark for mark in RoadMark if mark is not RoadMark.OTHER])
def test_every_mark_comes_back_on_either_side(mark: RoadMark, tmp_path: Path):
    lanes = (
        Lane(lane_id=-3, width=3.0, right_mark=mark, left_mark=mark),
        Lane(lane_id=-2, width=3.0, right_mark=mark.reverse, left_mark=mark),
    )
    road = dataclasses.replace(wide_road(), lanes=lanes)
    assert written(road, tmp_path).lanes == lanes


def test_ids_that_opendrive_does_not_allow_are_refused():
    lanes = tuple(dataclasses.replace(lane, lane_id=2 * lane.lane_id) for lane in wide_road().lanes)
    with pytest.raises(ConfigError, match="consecutive"):
        write_opendrive(dataclasses.replace(wide_road(), lanes=lanes))


@pytest.mark.parametrize("name", ['a "b" <c> & d', "a\x01b\x1b[31m", "a\ud800\uffff"])
def test_names_may_hold_what_xml_reserves_or_does_not_know(name: str, tmp_path: Path):
    road = dataclasses.replace(wide_road(), name=name)
    assert written(road, tmp_path).lanes == road.lanes


@needs_wheel
@pytest.mark.parametrize("name", ["town06", "motorway"])
def test_carla_finds_our_lanes_where_they_are(name: str):
    import carla

    road = known_road(name)
    place = carla.Map(name, write_opendrive(road, road_id="40"))
    for lane, d in zip(road.lanes, road.lane_centres, strict=True):
        x, y = (float(value) for value in road.to_world(300.0, d))
        found = place.get_waypoint(carla.Location(x, -y, 0.0))
        assert found.lane_id == lane.lane_id
        assert found.lane_width == pytest.approx(lane.width)
        assert (found.transform.location.x, found.transform.location.y) == pytest.approx(
            (x, -y), abs=1e-3
        )
        marks = (str(found.right_lane_marking.type), str(found.left_lane_marking.type))
        assert marks == (lane.right_mark.value, lane.left_mark.value)
    # Its Traffic Manager drives on the topology, which a road of one section does not have.
    assert len(place.get_topology()) >= road.num_lanes


OPEN = dataclasses.replace(known_road("rural"), course=None, length=1500.0)
WINDING = {
    "of one direction": on(known_road("town06").extend_to(1500.0), *BENDS, grade=HILLS),
    "of two directions": on(OPEN, *BENDS, grade=HILLS),
    "in left-hand traffic": on(OPEN, *BENDS, grade=HILLS).mirror(),
    "that goes on straight": on(known_road("town06").extend_to(2500.0), *BENDS),
    "that ends in a bend": on(known_road("town06"), *BENDS),
}
STATIONS = np.linspace(0.0, 1.0, 41)


def same_place(one: Road, other: Road, *, shift: float = 0.0) -> None:
    s = STATIONS * (one.length - 1.0)
    for d in (0.0, *one.lane_boundaries, *one.lane_centres):
        here, there = np.array(one.to_world(s, d)), np.array(other.to_world(s + shift, d))
        np.testing.assert_allclose(there, here, atol=1e-5)
    middle = s[(s > 5.0) & (s < one.length - 5.0)]  # The reader's slopes are means over 5 m.
    np.testing.assert_allclose(other.grade_at(middle + shift), one.grade_at(middle), atol=5e-4)


@pytest.mark.parametrize("road", WINDING.values(), ids=WINDING)
def test_a_road_that_bends_and_rises_comes_back(road: Road, tmp_path: Path):
    back = written(road, tmp_path)
    assert back.length == pytest.approx(road.length, abs=1e-6)
    assert back.lanes == road.lanes
    assert back.overtaking_side_neighbour == road.overtaking_side_neighbour
    assert back.is_two_way == road.is_two_way
    same_place(road, back)


def test_a_winding_road_that_runs_against_its_reference_line_comes_back(tmp_path: Path):
    road = WINDING["of one direction"]
    lanes = tuple(dataclasses.replace(lane, lane_id=-lane.lane_id) for lane in road.lanes)
    turned = dataclasses.replace(
        road, lanes=lanes, kerb_side_neighbour=None, overtaking_side_neighbour=None
    )
    same_place(turned, written(turned, tmp_path))


def test_a_road_that_covers_more_is_the_same_road():
    road = on(known_road("rural"), *BENDS, grade=HILLS)
    more = covering(road, -120.0, 5500.0)
    assert more.length == 5620.0
    same_place(road, more, shift=120.0)
    for s in (10.0, 500.0, 1800.0):
        assert sight_at(more, s + 120.0) == sight_at(road, s)
    lower = dataclasses.replace(road.course, speed_limit_spans=(limit(500, 700, 9.0, -1),))
    limited = covering(dataclasses.replace(road, course=lower), -120.0, 5500.0)
    assert limited.speed_limit_at([619.0, 621.0, 819.0, 821.0], -1).tolist() == [
        25.0,
        9.0,
        9.0,
        25.0,
    ]
    moved = [(start + 120.0, mark) for start, mark in road.overtaking_edge_marks[1:]]
    assert list(more.overtaking_edge_marks[1:]) == moved


def test_the_lane_of_oncoming_traffic_and_each_stretch_of_the_line_come_back(tmp_path: Path):
    back = written(OPEN, tmp_path)
    assert back.is_two_way
    assert back.overtaking_side_neighbour == OPEN.overtaking_side_neighbour


@needs_wheel
@pytest.mark.parametrize("turned", [False, True])
def test_carla_finds_the_marks_of_each_stretch_and_both_directions(turned: bool):
    import carla

    rural = known_road("rural")
    mixed = CentreLineSpan(start=100.0, stop=300.0, mark=RoadMark.SOLID_BROKEN)
    assert rural.course is not None
    course = dataclasses.replace(rural.course, centre_line_spans=(mixed,))
    road = dataclasses.replace(rural, course=course)
    if turned:
        beyond = road.overtaking_side_neighbour
        assert beyond is not None
        change = {
            "lanes": (dataclasses.replace(road.lanes[0], lane_id=1),),
            "overtaking_side_neighbour": dataclasses.replace(beyond, lane_id=-1),
            "kerb_side_neighbour": None,
        }
        road = dataclasses.replace(road, **change)
    place = carla.Map("rural", write_opendrive(road))
    own = float(road.lane_centres[0])
    for s, mark in ((50.0, "Broken"), (200.0, "SolidBroken"), (350.0, "Broken")):
        for d in (own, -own):
            x, y = (float(value) for value in road.to_world(s, d))
            found = place.get_waypoint(carla.Location(x, -y, 0.0))
            forward = found.transform.get_forward_vector()
            ahead = forward.x * np.cos(road.heading) - forward.y * np.sin(road.heading)
            assert ahead == pytest.approx(1.0 if d == own else -1.0, abs=1e-3)
            assert str(found.left_lane_marking.type) in (mark, mark[-6:] + mark[:-6])


@needs_wheel
def test_carla_finds_our_lanes_where_they_are_in_bends():
    import carla

    road = WINDING["of two directions"]
    place = carla.Map("winding", write_opendrive(road))
    for s in np.linspace(20.0, road.length - 20.0, 15):
        for d, along in ((float(road.lane_centres[0]), 1.0), (-float(road.lane_centres[0]), -1.0)):
            x, y = (float(value) for value in road.to_world(s, d))
            z = float(road.height_at(s))
            found = place.get_waypoint(carla.Location(x, -y, z)).transform
            # CARLA looks for the nearest point in steps along the lane.
            there = road.to_road(found.location.x, -found.location.y)
            assert there == (pytest.approx(s, abs=0.1), pytest.approx(d, abs=0.005))
            assert found.location.z == pytest.approx(z, abs=0.005)
            forward, heading = found.get_forward_vector(), float(road.heading_at(s))
            assert forward.x * np.cos(heading) - forward.y * np.sin(heading) == pytest.approx(
                along, abs=2e-3
            )
