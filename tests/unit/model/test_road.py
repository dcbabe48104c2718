"""The frame of a road, its lanes, its mirror image and what it refuses."""

import cmath
import dataclasses
import math
import re

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import ROAD_NAMES, known_road
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark

WIDTHS = (3.75, 3.5, 3.25)


def straight(**changes) -> Road:
    """Three lanes of different widths, right-hand traffic, at an angle to the axes."""
    marks = [RoadMark.SOLID, RoadMark.BROKEN, RoadMark.SOLID_BROKEN, RoadMark.SOLID]
    lanes = tuple(
        Lane(
            lane_id=index - 3,
            width=width,
            right_mark=marks[index].reverse if index else marks[0],
            left_mark=marks[index + 1],
        )
        for index, width in enumerate(WIDTHS)
    )
    shoulder = Lane(
        lane_id=-4,
        width=2.5,
        kind="shoulder",
        right_mark=RoadMark.NONE,
        left_mark=RoadMark.SOLID,
    )
    values = {
        "name": "test",
        "kind": "motorway",
        "driving_side": DrivingSide.RIGHT,
        "lanes": lanes,
        "kerb_edge_d": -10.5,
        "length": 1000.0,
        "x0": 12.0,
        "y0": -7.0,
        "heading": 0.5,
        "speed_limit": 33.0,
        "kerb_side_neighbour": shoulder,
    }
    return Road(**(values | changes))


roads = st.builds(
    lambda lanes, edge, length, x, y, heading: dataclasses.replace(
        straight(),
        lanes=straight().lanes[:lanes],
        kerb_edge_d=edge,
        length=length,
        x0=x,
        y0=y,
        heading=heading,
    ),
    st.integers(1, 3),
    st.floats(-50.0, 50.0),
    st.floats(1.0, 1e5),
    st.floats(-1e5, 1e5),
    st.floats(-1e5, 1e5),
    st.floats(-math.tau, math.tau),
)
either_hand = st.one_of(roads, roads.map(Road.mirror))


def test_lanes_are_laid_out_from_the_slow_side_to_the_left_in_right_hand_traffic():
    road = straight()
    assert (road.num_lanes, road.overtaking_sign) == (3, 1.0)
    np.testing.assert_array_equal(road.lane_boundaries, [-10.5, -6.75, -3.25, 0.0])
    np.testing.assert_array_equal(road.lane_centres, [-8.625, -5.0, -1.625])


def test_lanes_are_laid_out_to_the_right_in_left_hand_traffic():
    road = straight().mirror()
    assert (road.driving_side, road.overtaking_sign) == (DrivingSide.LEFT, -1.0)
    np.testing.assert_array_equal(road.lane_boundaries, [10.5, 6.75, 3.25, 0.0])


def test_d_is_positive_to_the_left_of_the_direction_of_travel():
    north = straight(heading=math.pi / 2, x0=0.0, y0=0.0)
    x, y = north.to_world(100.0, 2.0)
    assert (float(x), float(y)) == pytest.approx((-2.0, 100.0), abs=1e-12)


@given(
    road=either_hand,
    s=st.floats(0.0, 1e5),
    d=st.floats(-100.0, 100.0),
)
def test_world_coordinates_are_a_rotation_of_the_complex_plane(road: Road, s: float, d: float):
    point = complex(road.x0, road.y0) + complex(s, d) * cmath.exp(1j * road.heading)
    x, y = road.to_world(s, d)
    assert abs(complex(x, y) - point) < 1e-9  # 1e5 m in float64 with a few roundings.


@pytest.mark.ci
@given(road=either_hand, data=st.data())
def test_road_coordinates_undo_world_coordinates(road: Road, data):
    points = data.draw(
        st.lists(st.tuples(st.floats(-1e3, 1e5), st.floats(-1e3, 1e3)), min_size=1, max_size=5)
    )
    s, d = np.array(points).T
    back_s, back_d = road.to_road(*road.to_world(s, d))
    np.testing.assert_allclose(back_s, s, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(back_d, d, rtol=0.0, atol=1e-9)


def test_world_broadcasts_stations_against_lanes():
    road = straight()
    x, y = road.to_world(np.linspace(0.0, 100.0, 11)[:, None], road.lane_centres)
    assert x.shape == y.shape == (11, 3)
    assert x.dtype == y.dtype == np.float64


@given(st.floats(-math.tau, math.tau))
def test_the_direction_of_travel_is_right_to_the_last_digit(heading: float):
    x, y = straight(heading=heading, x0=0.0, y0=0.0).to_world(1.0, 0.0)
    exact = mpmath.expj(heading)
    # Two units of the last place of 1: the multiples of a quarter turn are not representable.
    assert abs(float(x) - float(exact.real)) <= 4.5e-16
    assert abs(float(y) - float(exact.imag)) <= 4.5e-16


@given(road=either_hand, d=st.lists(st.floats(-100.0, 100.0), min_size=1))
def test_lane_index_counts_the_borders_that_are_passed(road: Road, d: list[float]):
    passed = [
        sum(
            1
            for border in road.lane_boundaries
            if road.overtaking_sign * value >= road.overtaking_sign * border
        )
        for value in d
    ]
    index = road.lane_index(np.array(d))
    assert index.tolist() == [count - 1 for count in passed]
    assert road.lane_index(d[0]).shape == ()


def test_a_border_belongs_to_the_faster_lane_and_the_edges_are_outside():
    for road in (straight(), straight().mirror()):
        assert road.lane_index(road.lane_boundaries).tolist() == [0, 1, 2, 3]
        assert road.lane_index(road.lane_centres).tolist() == [0, 1, 2]
        beyond = road.lane_boundaries[[0, -1]] + road.overtaking_sign * np.array([-0.01, 0.01])
        assert road.lane_index(beyond).tolist() == [-1, 3]


@given(road=either_hand, s=st.floats(0.0, 1e5), d=st.floats(-100.0, 100.0))
def test_the_mirror_image_is_exact(road: Road, s: float, d: float):
    image = road.mirror()
    assert image.mirror() == road
    x, y = road.to_world(s, d)
    image_x, image_y = image.to_world(s, -d)
    assert (float(image_x), float(image_y)) == (float(x), -float(y))
    np.testing.assert_array_equal(image.lane_boundaries, -road.lane_boundaries)
    assert image.lane_index(-d) == road.lane_index(d)


def test_the_mirror_image_swaps_marks_ids_and_neighbours_hands():
    image = straight().mirror()
    assert [lane.lane_id for lane in image.lanes] == [3, 2, 1]
    assert image.lanes[0].left_mark is RoadMark.SOLID
    assert image.lanes[2].left_mark is RoadMark.BROKEN_SOLID
    shoulder = image.kerb_side_neighbour
    assert shoulder is not None
    assert (shoulder.lane_id, shoulder.left_mark) == (4, RoadMark.NONE)


@pytest.mark.parametrize("mark", RoadMark)
def test_a_mark_seen_twice_from_the_other_side_is_itself(mark: RoadMark):
    assert mark.reverse.reverse is mark
    assert (mark.reverse is not mark) == (mark in (RoadMark.SOLID_BROKEN, RoadMark.BROKEN_SOLID))


def test_world_points_come_back_in_the_coordinates_of_the_source():
    road = straight(origin_x=691_000.0, origin_y=5_335_000.0)
    x, y = road.to_source(*road.to_world(100.0, 2.0))
    assert (float(x), float(y)) == pytest.approx((691_098.799, 5_335_042.698), abs=1e-3)
    s, d = road.to_road(*road.from_source(x, y))
    assert (float(s), float(d)) == pytest.approx((100.0, 2.0), abs=1e-6)


def test_the_origin_of_the_mirror_image_is_mirrored():
    road = straight(origin_x=691_000.0, origin_y=5_335_000.0)
    image = road.mirror()
    assert (image.origin_x, image.origin_y) == (691_000.0, -5_335_000.0)
    assert image.mirror() == road


def test_an_extended_road_only_grows():
    road = straight()
    longer = road.extend_to(2500.0)
    assert longer == dataclasses.replace(road, length=2500.0)
    assert road.extend_to(1000.0) == road
    for length in (999.0, math.nan, -math.inf):
        with pytest.raises(ConfigError, match="extended length"):
            road.extend_to(length)


def with_lane(**changes) -> tuple[Lane, ...]:
    lanes = straight().lanes
    return (*lanes[:2], dataclasses.replace(lanes[2], **changes))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"lanes": ()}, "driving lanes: expected 1 to 8, got 0"),
        ({"lanes": straight().lanes * 3}, "driving lanes: expected 1 to 8, got 9"),
        ({"lanes": with_lane(lane_id=-3)}, "lane ids"),
        ({"lanes": with_lane(width=1.9)}, "width of lane -1: expected 2 to 6 m, got 1.9 m"),
        ({"lanes": with_lane(kind="shoulder")}, "lane -1"),
        ({"lanes": with_lane(direction=-1)}, "lane -1"),
        ({"lanes": with_lane(right_mark=RoadMark.SOLID)}, "line between lanes -2 and -1"),
        ({"length": 0.0}, "length"),
        ({"length": math.inf}, "length"),
        ({"length": 100_001.0}, "length"),
        ({"heading": 7.0}, "heading"),
        ({"heading": math.nan}, "heading"),
        ({"x0": math.inf}, "x0"),
        ({"x0": 5_335_000.0}, "x0: expected -1.8e+06 to 1.8e+06 m, got 5.335e+06"),
        ({"origin_y": math.nan}, "origin_y"),
        ({"y0": math.nan}, "y0"),
        ({"kerb_edge_d": -math.inf}, "kerb_edge_d"),
        ({"speed_limit": 0.0}, "speed_limit"),
        ({"speed_limit": math.nan}, "speed_limit"),
        ({"length": "long"}, "length: expected a number, got 'long'"),
        ({"lanes": 3}, "lanes: expected several values, each of them a Lane, got 3"),
    ],
)
def test_a_road_that_the_model_is_not_made_for_is_refused(changes, reason: str):
    with pytest.raises(ConfigError) as caught:
        straight(**changes)
    assert str(caught.value).startswith("road test: ")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"width": math.nan}, "lane -1: width: expected more than 0 and at most 100 m, got nan"),
        ({"width": 0.0}, "lane -1: width: expected more than 0 and at most 100 m, got 0"),
        ({"width": "wide"}, "lane -1: width: expected a number, got 'wide'"),
        ({"direction": 2}, "lane -1: direction: expected -1 to 1, got 2"),
        ({"left_mark": "Solid"}, "lane -1: left_mark: expected a RoadMark, got 'Solid'"),
    ],
)
def test_what_is_no_lane_is_refused(changes, reason: str):
    with pytest.raises(ConfigError, match=re.escape(reason)):
        with_lane(**changes)


@pytest.mark.parametrize("name", ROAD_NAMES)
def test_roads_that_come_with_the_package_are_whole(name: str):
    road = known_road(name)
    assert road.name == name
    assert road.driving_side is DrivingSide.RIGHT
    slow, fast = road.kerb_side_neighbour, road.overtaking_side_neighbour
    assert slow is not None
    assert fast is not None
    assert slow.left_mark is road.lanes[0].right_mark is RoadMark.SOLID
    between = RoadMark.BROKEN if road.is_two_way else RoadMark.SOLID
    assert fast.right_mark is road.lanes[-1].left_mark is between
    ids = [slow.lane_id, *(lane.lane_id for lane in road.lanes), fast.lane_id]
    # The reference line, lane 0, is between the directions.
    assert ids == [one for one in range(ids[0], ids[-1] + 1) if one or not road.is_two_way]


def test_a_motorway_is_what_portuguese_practice_builds():
    road = known_road("motorway")
    np.testing.assert_array_equal(road.lane_boundaries, [-12.25, -8.5, -4.75, -1.0])
    assert road.speed_limit == pytest.approx(120.0 / 3.6)
    assert road.length == 5000.0
    assert road.kerb_side_neighbour is not None
    assert road.kerb_side_neighbour.width == 3.0


def test_an_unknown_road_is_named_with_the_known_ones():
    with pytest.raises(ConfigError, match=r"expected town06 or motorway or rural, got 'town6'"):
        known_road("town6")
