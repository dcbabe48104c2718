"""Roads that another program wrote: what scenariogeneration puts into a file is what we read."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenariogeneration import xodr

from overtaking.model.road import DrivingSide, RoadMark
from overtaking.recordings.opendrive import read_opendrive

NAMES = {
    RoadMark.NONE: xodr.RoadMarkType.none,
    RoadMark.SOLID: xodr.RoadMarkType.solid,
    RoadMark.BROKEN: xodr.RoadMarkType.broken,
    RoadMark.SOLID_SOLID: xodr.RoadMarkType.solid_solid,
    RoadMark.SOLID_BROKEN: xodr.RoadMarkType.solid_broken,
    RoadMark.BROKEN_SOLID: xodr.RoadMarkType.broken_solid,
    RoadMark.BROKEN_BROKEN: xodr.RoadMarkType.broken_broken,
    RoadMark.BOTTS_DOTS: xodr.RoadMarkType.botts_dots,
    RoadMark.CURB: xodr.RoadMarkType.curb,
    RoadMark.GRASS: xodr.RoadMarkType.grass,
}


def write(
    path: Path,
    *,
    geometry=None,
    x: float = 0.0,
    y: float = 0.0,
    heading: float = 0.0,
    widths=(3.75, 3.75, 3.75),
    shoulder: float = 3.0,
    marks=(RoadMark.BROKEN, RoadMark.BROKEN, RoadMark.SOLID),
    rule=xodr.TrafficRule.RHT,
) -> Path:
    """A motorway, lanes right of the reference line for right-hand traffic, else left of it."""
    plan = xodr.PlanView()
    plan.set_start_point(x, y, heading)
    plan.add_geometry(geometry or xodr.Line(800))
    centre = xodr.Lane(a=0)
    centre.add_roadmark(xodr.RoadMark(xodr.RoadMarkType.solid, 0.2))
    section = xodr.LaneSection(0, centre)
    right = rule is xodr.TrafficRule.RHT
    add = section.add_right_lane if right else section.add_left_lane
    for width, mark in zip(widths, marks, strict=True):
        lane = xodr.Lane(a=width)
        lane.add_roadmark(xodr.RoadMark(NAMES[mark], 0.2))
        add(lane)
    if shoulder:
        add(xodr.Lane(lane_type=xodr.LaneType.shoulder, a=shoulder))
    lanes = xodr.Lanes()
    lanes.add_lanesection(section)
    road = xodr.Road(3, plan, lanes, rule=rule)
    road.add_type(xodr.RoadType.motorway, 0, speed=110, speed_unit="km/h")
    document = xodr.OpenDrive("test")
    document.add_road(road)
    document.adjust_roads_and_lanes()
    document.write_xml(str(path))
    return path


def test_a_three_lane_motorway_of_scenariogeneration_is_read(tmp_path: Path):
    road = read_opendrive(write(tmp_path / "three.xodr"), 3)
    assert (road.num_lanes, road.kind, road.length) == (3, "motorway", 800.0)
    assert road.speed_limit == pytest.approx(110 / 3.6)
    assert [lane.lane_id for lane in road.lanes] == [-3, -2, -1]
    np.testing.assert_allclose(road.lane_boundaries, [-11.25, -7.5, -3.75, 0.0], atol=1e-12)
    shoulder = road.kerb_side_neighbour
    assert shoulder is not None
    assert (shoulder.lane_id, shoulder.kind, shoulder.width) == (-4, "shoulder", 3.0)
    assert road.overtaking_side_neighbour is None


@given(
    x=st.floats(-1e4, 1e4),
    y=st.floats(-1e4, 1e4),
    heading=st.floats(-math.pi, math.pi),
    lanes=st.lists(
        st.tuples(st.floats(2.0, 6.0), st.sampled_from(sorted(NAMES, key=str))),
        min_size=1,
        max_size=8,
    ),
    left_hand=st.booleans(),
)
def test_any_straight_road_of_scenariogeneration_is_read(
    tmp_path_factory: pytest.TempPathFactory, x, y, heading, lanes, left_hand
):
    """Positions, widths and marks survive, in right- and left-hand traffic."""
    widths, marks = zip(*lanes, strict=True)
    rule = xodr.TrafficRule.LHT if left_hand else xodr.TrafficRule.RHT
    path = tmp_path_factory.getbasetemp() / "any.xodr"
    write(path, x=x, y=y, heading=heading, widths=widths, marks=marks, shoulder=0.0, rule=rule)
    road = read_opendrive(path)
    assert road.driving_side is (DrivingSide.LEFT if left_hand else DrivingSide.RIGHT)
    assert road.heading == pytest.approx(heading, abs=1e-9)
    assert [lane.width for lane in road.lanes[::-1]] == pytest.approx(widths)
    outer = [lane.left_mark if left_hand else lane.right_mark for lane in road.lanes[::-1]]
    assert outer == list(marks)
    # The innermost lane lies beside the reference line, on the side that traffic keeps to.
    t = (0.5 if left_hand else -0.5) * widths[0]
    found = road.to_world(400.0, road.lane_centres[-1])
    expected = (
        x + 400.0 * math.cos(heading) - t * math.sin(heading),
        y + 400.0 * math.sin(heading) + t * math.cos(heading),
    )
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("rule", [xodr.TrafficRule.RHT, xodr.TrafficRule.LHT])
@pytest.mark.parametrize(
    "geometry", [xodr.Arc(0.001, length=800), xodr.Spiral(0.0, 0.001, 800)], ids=["arc", "spiral"]
)
def test_a_bend_of_scenariogeneration_ends_where_it_says(tmp_path: Path, geometry, rule):
    path = write(tmp_path / "bend.xodr", x=5.0, y=-7.0, heading=0.4, geometry=geometry, rule=rule)
    road = read_opendrive(path)
    x, y, heading, _ = geometry.get_end_data(5.0, -7.0, 0.4)
    np.testing.assert_allclose(road.to_world(800.0, 0.0), (x, y), atol=1e-6)
    assert road.heading_at(800.0) == pytest.approx(heading, abs=1e-9)


def test_lanes_against_a_bend_are_driven_from_its_end(tmp_path: Path):
    path = write(tmp_path / "bend.xodr", geometry=xodr.Spiral(0.0, 0.002, 800))
    along = read_opendrive(path)
    text = path.read_text().replace('rule="RHT"', 'rule="LHT"')
    (tmp_path / "other.xodr").write_text(text)
    against = read_opendrive(tmp_path / "other.xodr")
    s = np.linspace(0.0, 800.0, 9)
    np.testing.assert_allclose(against.to_world(800.0 - s, -1.0), along.to_world(s, 1.0), atol=1e-6)
    np.testing.assert_allclose(against.curvature_at(800.0 - s), -along.curvature_at(s), atol=1e-12)
