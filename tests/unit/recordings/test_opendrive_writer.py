"""The OpenDRIVE that we write, read by our own reader and by CARLA's."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest
from tests.support.carla import needs_wheel
from tests.support.worlds import wide_road

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import known_road
from overtaking.model.road import Lane, Road, RoadMark
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.opendrive_writer import write_opendrive

if TYPE_CHECKING:
    from pathlib import Path

ROADS = {
    "town06": known_road("town06"),
    "motorway": known_road("motorway"),
    "longer": known_road("town06").extended(3000.0),
    "left-hand traffic": known_road("motorway").mirrored(),
    "without shoulders": wide_road(),
    "short": dataclasses.replace(wide_road(), length=15.0),
}


def written(road: Road, folder: Path) -> Road:
    path = folder / "road.xodr"
    path.write_text(write_opendrive(road), encoding="utf-8")
    return read_opendrive(path)


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
        road, lanes=lanes, slow_side_neighbour=None, fast_side_neighbour=None
    )
    back = written(turned, tmp_path)
    assert back.lanes == turned.lanes
    assert back.world(100.0, -5.0) == pytest.approx(turned.world(100.0, -5.0), abs=1e-9)
    assert back.edge_d == turned.edge_d


@pytest.mark.parametrize("mark", [mark for mark in RoadMark if mark is not RoadMark.OTHER])
def test_every_mark_comes_back_on_either_side(mark: RoadMark, tmp_path: Path):
    lanes = (
        Lane(lane_id=-3, width=3.0, right_mark=mark, left_mark=mark),
        Lane(lane_id=-2, width=3.0, right_mark=mark.reversed, left_mark=mark),
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
    for lane, d in zip(road.lanes, road.centres, strict=True):
        x, y = (float(value) for value in road.world(300.0, d))
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
