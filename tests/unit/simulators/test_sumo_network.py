"""The network has our lanes: where they are, how wide, how fast, how slippery."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pytest

from overtaking.model.known_roads import known_road
from overtaking.simulators.sumo.network import BEHIND, length_for, network


def lanes(road, friction=None):
    grip = friction or [1.0] * road.num_lanes
    return ET.fromstring(network(road, 500.0, grip)).findall("edge/lane")


@pytest.mark.parametrize("name", ["town06", "motorway"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_lanes_lie_where_ours_do_counted_from_the_slow_side(name, mirrored):
    road = known_road(name).mirror() if mirrored else known_road(name)
    found = lanes(road)
    assert [int(lane.get("index")) for lane in found] == list(range(road.num_lanes))
    assert [float(lane.get("width")) for lane in found] == [lane.width for lane in road.lanes]
    for lane, centre in zip(found, road.overtaking_sign * road.lane_centres, strict=True):
        points = [tuple(map(float, point.split(","))) for point in lane.attrib["shape"].split()]
        assert points == [(-BEHIND, centre), (500.0, centre)]
        assert float(lane.get("length")) == 500.0 + BEHIND
    # SUMO's left is y: the fast lanes have the larger one in either kind of traffic.
    assert (np.diff([float(lane.attrib["shape"].split(",")[-1]) for lane in found]) > 0).all()


def test_every_lane_has_the_posted_limit_and_its_own_friction():
    road = known_road("motorway")
    found = lanes(road, [0.4, 0.5, 0.6])
    assert {float(lane.get("speed")) for lane in found} == {road.speed_limit}
    assert [float(lane.get("friction")) for lane in found] == [0.4, 0.5, 0.6]


def test_the_edge_ends_farther_than_anybody_can_come():
    fastest = 80.0
    assert length_for(450.0, 20.0) > 450.0 + fastest * 20.0
    assert length_for(-30.0, 20.0) > fastest * 20.0
