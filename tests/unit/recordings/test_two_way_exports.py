"""Simulations on roads with two directions, and on roads that bend and rise, in other formats."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.csv as pacsv
import pytest
from tests.reference.test_bends import BENDS, HILLS, on
from tests.support.two_way import pair, road
from tests.support.worlds import scenario

from overtaking.core.errors import ConfigError
from overtaking.model.road import RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse, SpeedLimitSpan
from overtaking.model.trajectories import STATE_RESOLUTION
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.commonroad_write import FIRST_OBSTACLE, scenario_id, write_commonroad
from overtaking.recordings.highd import read_highd
from overtaking.recordings.highd_write import write_highd
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.openscenario_write import write_openscenario
from overtaking.sim import engine

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

SOLID = CentreLineSpan(start=1100.0, stop=1250.0, mark=RoadMark.SOLID_BROKEN)
LINED = dataclasses.replace(road(), course=RoadCourse(centre_line_spans=(SOLID,)))
LIMITED = dataclasses.replace(
    road(),
    course=RoadCourse(
        speed_limit_spans=(
            SpeedLimitSpan(start=1100.0, stop=1250.0, speed=20.0),
            SpeedLimitSpan(start=1250.0, stop=1300.0, speed=10.0, direction=1),
            SpeedLimitSpan(start=1270.0, stop=1400.0, speed=15.0, direction=-1),
        )
    ),
)
WINDING = on(road(), *BENDS, grade=HILLS)
MIRRORED = WINDING.mirror()


def run_on(place: Road) -> Trajectories:
    """An ego that overtakes although somebody comes, and one beyond."""
    scene = pair(520.0, 800.0, gap_demand_factor=0.0)
    return engine.simulate(scenario(scene, road=place, horizon=14.0))


def column(run: Trajectories, name: str, slot: int) -> np.ndarray:
    return getattr(run.states, name)[0, slot, : run.num_frames[0]] * STATE_RESOLUTION[name]


def points(bound: ET.Element | None) -> np.ndarray:
    assert bound is not None
    rows = [[float(one.findtext(name) or "") for name in "xy"] for one in bound.findall("point")]
    return np.array(rows)


@pytest.mark.ci
@pytest.mark.parametrize("place", [LINED, WINDING, MIRRORED], ids=["lined", "winding", "mirrored"])
def test_commonroad_has_the_lanes_of_both_directions_where_they_are(place: Road, tmp_path: Path):
    write_commonroad(run_on(place), np.array([0]), tmp_path)
    root = ET.parse(tmp_path / f"{scenario_id(0)}.xml").getroot()
    assert root.find("scenarioTags/oncoming_traffic") is not None
    assert root.find("scenarioTags/no_oncoming_traffic") is None
    lanelets = {one.attrib["id"]: one for one in root.findall("lanelet")}
    middle = float(place.lane_boundaries[-1])
    for lanelet in lanelets.values():
        left, right = (points(lanelet.find(name)) for name in ("leftBound", "rightBound"))
        _, d = place.to_road(*left.T)
        _, e = place.to_road(*right.T)
        halfway = 0.5 * (left[1:] + left[:-1])
        off = np.abs(place.to_road(*halfway.T)[1] - np.median(d))
        assert off.max() < 0.005
        comes = np.median(d + e) * place.overtaking_sign > 2.0 * middle * place.overtaking_sign
        ahead = left[1] - left[0]
        s = place.to_road(*left[:1].T)[0]
        along = ahead @ np.array([np.cos(place.heading_at(s)), np.sin(place.heading_at(s))])
        assert (along[0] > 0) == (not comes)
        # Its own left is on its left, whichever way it goes.
        assert np.median(d - e) == pytest.approx(-3.5 if comes else 3.5)
        beside = next(one for one in lanelet if one.tag.startswith("adjacent"))
        assert beside.tag == ("adjacentLeft" if place.overtaking_sign > 0 else "adjacentRight")
        assert beside.attrib["drivingDir"] == "opposite"
        other = lanelets[beside.attrib["ref"]]
        assert any(one.get("ref") == lanelet.attrib["id"] for one in other)


def test_commonroad_has_a_lanelet_for_each_stretch_of_the_line(tmp_path: Path):
    write_commonroad(run_on(LINED), np.array([0]), tmp_path)
    root = ET.parse(tmp_path / f"{scenario_id(0)}.xml").getroot()
    lanelets = {one.attrib["id"]: one for one in root.findall("lanelet")}
    assert len(lanelets) == 6
    own = [lanelets[name] for name in ("1", "3", "5")]
    marks = [one.findtext("leftBound/lineMarking") for one in own]
    assert marks == ["dashed", "solid_dashed", "dashed"]
    theirs = [lanelets[name].findtext("leftBound/lineMarking") for name in ("2", "4", "6")]
    assert theirs == ["dashed", "dashed_solid", "dashed"]
    for lanelet in lanelets.values():
        for link in lanelet.findall("successor"):
            end, start = (
                points(lanelet.find("leftBound"))[-1],
                points(lanelets[link.attrib["ref"]].find("leftBound"))[0],
            )
            np.testing.assert_allclose(end, start)
    assert [len(one.findall("successor")) for one in lanelets.values()] == [1, 0, 1, 1, 0, 1]
    edges = [float(points(one.find("leftBound"))[0, 0]) for one in own[1:]]
    assert edges == pytest.approx([1100.0 + LINED.x0, 1250.0 + LINED.x0])


@pytest.mark.parametrize("place", [LINED, WINDING], ids=["lined", "winding"])
def test_commonroad_has_every_vehicle_where_it_was(place: Road, tmp_path: Path):
    run = run_on(place)
    write_commonroad(run, np.array([0]), tmp_path)
    root = ET.parse(tmp_path / f"{scenario_id(0)}.xml").getroot()
    for slot in range(4):
        found = root.find(f"dynamicObstacle[@id='{FIRST_OBSTACLE + slot}']")
        assert found is not None
        for name, path in (("x", "position/point/x"), ("y", "position/point/y")):
            told = np.array([float(one.text or "") for one in found.iterfind(f".//{path}")])
            np.testing.assert_allclose(told, column(run, name, slot), atol=1.1e-3)
        turned = [float(one.text or "") for one in found.iterfind(".//orientation/exact")]
        np.testing.assert_allclose(turned, column(run, "heading", slot), atol=1e-4)


def test_highd_has_the_other_direction_on_its_upper_carriageway(tmp_path: Path):
    run = run_on(LINED)
    write_highd(run, np.array([0]), tmp_path)
    tables = {
        name: pacsv.read_csv(tmp_path / f"01_{name}.csv").to_pandas()
        for name in ("tracks", "tracksMeta", "recordingMeta")
    }
    assert tables["tracksMeta"]["drivingDirection"].tolist() == [2, 2, 1, 1]
    upper, lower = (
        [float(one) for one in tables["recordingMeta"][f"{name}LaneMarkings"][0].split(";")]
        for name in ("upper", "lower")
    )
    assert upper[1] == pytest.approx(lower[0])
    rows = tables["tracks"]
    middle = rows["y"] + 0.5 * rows["height"]
    in_upper = (middle >= upper[0]) & (middle < upper[1])
    assert (rows["laneId"][in_upper] == 2).all()
    assert (rows["laneId"][~in_upper] == 4).all()
    ego, comes = rows[rows["id"] == 1], rows[rows["id"] == 3]
    assert set(ego["laneId"]) == {2, 4}  # It overtakes on the upper one.
    assert (ego["xVelocity"] > 0).all()
    assert (comes["xVelocity"] < 0).all()
    assert (np.diff(comes["x"]) < 0).all()
    assert (comes["precedingId"] == 0).all()  # The first that comes has nobody ahead.
    behind = rows[rows["id"] == 4]
    assert (behind["precedingId"] == 3).all()
    gap = behind["x"].to_numpy() - comes["x"].to_numpy() - comes["width"].to_numpy()
    np.testing.assert_allclose(behind["dhw"], gap, atol=2e-4)
    sums = rows["frontSightDistance"] + rows["backSightDistance"] + rows["width"]
    assert np.ptp(sums) < 1e-3
    ahead = comes["frontSightDistance"].to_numpy()
    np.testing.assert_allclose(ahead, comes["x"], atol=2e-4)


def test_highd_is_read_back_direction_by_direction(tmp_path: Path):
    run = run_on(LINED)
    write_highd(run, np.array([0]), tmp_path)
    there = read_highd(tmp_path / "01_tracks.csv", direction=2).tracks
    back = read_highd(tmp_path / "01_tracks.csv", direction=1).tracks
    assert there.num_vehicles == back.num_vehicles == 2
    time = np.arange(there.start[2] - there.start[1]) * 0.04
    known = run.time_ms[: run.num_frames[0]] / 1000.0
    expected = np.interp(time, known, column(run, "s", 1))
    off = there.s[there.start[1] : there.start[2]] - expected
    assert np.ptp(off) < 2e-3
    comes = np.interp(time, known, column(run, "s", 2))
    assert np.ptp(back.s[: back.start[1]] + comes) < 2e-3


def test_highd_is_refused_on_bends_and_where_the_limit_changes(tmp_path: Path):
    with pytest.raises(ConfigError, match="straight"):
        write_highd(run_on(WINDING), np.array([0]), tmp_path)
    run = run_on(LIMITED)
    with pytest.raises(ConfigError, match="expected one speed limit, got 3 stretches with lower"):
        write_highd(run, np.array([0]), tmp_path)
    write_highd(
        dataclasses.replace(run, unknown=frozenset(["speed_limit"])), np.array([0]), tmp_path
    )


@pytest.mark.parametrize("place", ["LIMITED", "MIRRORED"])
def test_commonroad_posts_every_limit_where_it_holds(place: str, tmp_path: Path):
    road = LIMITED if place == "LIMITED" else LIMITED.mirror()
    write_commonroad(run_on(road), np.array([0]), tmp_path)
    root = ET.parse(tmp_path / f"{scenario_id(0)}.xml").getroot()
    limits = {
        one.attrib["id"]: float(one.findtext(".//additionalValue") or "")
        for one in root.findall("trafficSign")
    }
    assert sorted(limits.values()) == pytest.approx([10.0, 15.0, 20.0, 25.0])
    seen = 0
    for lanelet in root.findall("lanelet"):
        sign = lanelet.find("trafficSignRef")
        assert sign is not None
        left, right = (points(lanelet.find(f"{side}Bound")) for side in ("left", "right"))
        s, d = road.to_road(*(0.5 * (left + right)).T)
        way = 1 if s[-1] > s[0] else -1
        assert (np.abs(d - road.lane_centres[0]) < 0.01).all() == (way == 1)
        inside = np.clip(np.linspace(min(s) + 0.1, max(s) - 0.1, 50), 0.0, road.length - 0.1)
        expected = limits[sign.attrib["ref"]]
        np.testing.assert_allclose(road.speed_limit_at(inside, way), expected, atol=1e-6)
        seen += 1
    assert seen == 2 * 6


def test_commonroad_is_read_back_with_its_limits(tmp_path: Path):
    write_commonroad(run_on(LIMITED), np.array([0]), tmp_path)
    found = read_commonroad(tmp_path / f"{scenario_id(0)}.xml", lanelet_id=1).road
    assert found.is_two_way
    s = np.arange(5.25, LIMITED.length - 5.0, 0.5)
    there, _ = found.to_road(*LIMITED.to_world(s, float(LIMITED.lane_centres[0])))
    for way in (1, -1):
        np.testing.assert_allclose(
            found.speed_limit_at(there, way), LIMITED.speed_limit_at(s, way), rtol=1e-6
        )


@pytest.mark.parametrize("place", [LINED, WINDING], ids=["lined", "winding"])
def test_openscenario_has_road_and_vehicles_in_the_plane_and_in_height(place: Road, tmp_path: Path):
    run = run_on(place)
    write_openscenario(run, np.array([0]), tmp_path)
    back = read_opendrive(tmp_path / "simulation-000000.xodr") if place is WINDING else place
    root = ET.parse(tmp_path / "simulation-000000.xosc").getroot()
    bodies = run.scenario.vehicles
    for slot, name in enumerate(("ego", "vehicle1", "vehicle2", "vehicle3")):
        group = root.find(f".//ManeuverGroup[@name='{name}']")
        assert group is not None
        told = {
            key: np.array([float(one.get(key, "0")) for one in group.iter("WorldPosition")])
            for key in "xyzhp"
        }
        behind = float(bodies.wheelbase[0, slot] - bodies.cg_to_front[0, slot])
        x = told["x"] + behind * np.cos(told["h"])
        y = told["y"] + behind * np.sin(told["h"])
        s, d = back.to_road(x, y)
        np.testing.assert_allclose(s, column(run, "s", slot), atol=2e-2)
        np.testing.assert_allclose(d, column(run, "d", slot), atol=2e-2)
        heights = back.height_at(s) - back.height_at(0.0)
        np.testing.assert_allclose(told["z"] + behind * -told["p"], heights, atol=0.03)
        way = np.where(np.cos(told["h"] - back.heading_at(s)) > 0, 1.0, -1.0)
        np.testing.assert_allclose(-told["p"], way * back.grade_at(s), atol=2e-3)


@pytest.mark.parametrize("place", [WINDING, MIRRORED], ids=["winding", "mirrored"])
def test_a_road_of_the_export_is_the_road_of_the_simulation(place: Road, tmp_path: Path):
    run = run_on(place)
    write_openscenario(run, np.array([0]), tmp_path)
    back = read_opendrive(tmp_path / "simulation-000000.xodr")
    assert back.is_two_way
    s = np.linspace(0.0, place.length, 50)
    np.testing.assert_allclose(back.to_world(s, 1.0), place.to_world(s, 1.0), atol=1e-3)
