"""Signals of recordings that are simple enough to say what they must be."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.cases import NIGHT, Track, case, ramp
from tests.support.worlds import wide_road

from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.world.visibility import contrast_range, lamp_range, meteorological_range

LENGTH, WIDTH = 4.0, 1.8
BODY = {"length": LENGTH, "width": WIDTH}


def seen(*others: Track, ego: Track | None = None, **given):
    return case(ego or Track(speed=20.0, lane=1, body=BODY), *others, frames=20, **given).signals


@pytest.mark.parametrize(
    ("place", "lane", "s"),
    [
        (NeighbourRole.LEADER, 1, 30.0),
        (NeighbourRole.FOLLOWER, 1, -30.0),
        (NeighbourRole.LEFT_LEADER, 2, 30.0),
        (NeighbourRole.LEFT_FOLLOWER, 2, -30.0),
        (NeighbourRole.RIGHT_LEADER, 0, 30.0),
        (NeighbourRole.RIGHT_FOLLOWER, 0, -30.0),
    ],
)
def test_each_neighbour_is_found_in_its_place_and_nowhere_else(place, lane, s):
    found = seen(Track(s=s, lane=lane, speed=25.0, body=BODY))
    assert found.neighbour_slot[0, place, 0] == 1
    assert (found.neighbour_slot[0, :, 0] != NO_VEHICLE).sum() == 1
    assert found.gap[0, place, 0] == pytest.approx(30.0 - LENGTH, abs=2e-3)
    closing = -5.0 if place % 2 == 0 else 5.0
    assert found.closing_speed[0, place, 0] == pytest.approx(closing, abs=1e-3)
    aside = 3.75 * (lane != 1) - WIDTH
    assert found.lateral_gap[0, place, 0] == pytest.approx(aside, abs=2e-3)


def test_the_nearest_of_several_is_the_neighbour():
    found = seen(Track(s=60.0, lane=1), Track(s=35.0, lane=1), Track(s=90.0, lane=1))
    assert found.neighbour_slot[0, NeighbourRole.LEADER, 0] == 2


def test_a_vehicle_alongside_has_a_negative_gap():
    found = seen(Track(s=1.0, lane=2, body=BODY))
    assert found.neighbour_slot[0, NeighbourRole.LEFT_LEADER, 0] == 1
    assert found.gap[0, NeighbourRole.LEFT_LEADER, 0] == pytest.approx(1.0 - LENGTH, abs=2e-3)


def test_nobody_is_in_two_lanes_to_the_left():
    found = seen(Track(s=30.0, lane=2), ego=Track(speed=20.0, lane=0))
    assert (found.neighbour_slot[0, :, 0] == NO_VEHICLE).all()


def test_the_body_reaches_half_its_width_when_it_points_along_the_road():
    found = seen()
    assert found.left_edge[0, 0] - found.lateral_position[0, 0] == pytest.approx(
        WIDTH / 2, abs=1e-3
    )
    assert found.lateral_position[0, 0] - found.right_edge[0, 0] == pytest.approx(
        WIDTH / 2, abs=1e-3
    )


def test_lateral_speed_is_the_slope_of_the_way_across():
    lane = ramp((0.0, 0.0), (1.0, 0.4), frames=20)
    found = seen(ego=Track(speed=20.0, lane=lane))
    assert found.lateral_speed[0, 3:16] == pytest.approx(1.5, abs=0.02)


def test_occupancy_counts_the_lengths_within_a_hundred_metres():
    others = [Track(s=s, lane=2, body={"length": 10.0}) for s in (-50.0, 20.0, 100.0, 120.0)]
    found = seen(*others)
    # Two whole vehicles, half of the third, none of the fourth.
    assert found.left_occupancy[0, 0] == pytest.approx(25.0 / 200.0, abs=1e-4)
    assert found.left_count[0, 0] == 4


def test_friction_on_a_dry_road_is_that_of_the_handbook():
    found = seen(ego=Track(speed=25.0, lane=1, body=BODY | {"tyre_wear": 0.0}))
    assert found.friction[0, 0] == pytest.approx(0.80, abs=1e-3)  # Bosch, new tyre, 90 km/h


def test_outer_lanes_are_wetter_and_so_more_slippery():
    rain = {"rain": 100.0}
    slow = seen(ego=Track(speed=30.0, lane=0), weather=rain)
    fast = seen(ego=Track(speed=30.0, lane=2), weather=rain)
    assert slow.friction[0, 0] < fast.friction[0, 0] - 0.01


def test_sight_in_fog_is_that_of_koschmieder():
    found = seen(weather={"fog": 80.0})
    extinction = 3.0 / meteorological_range(np.float32(80.0))
    # A car of contrast 0.5 against the threshold of 5 %.
    expected = contrast_range(extinction, np.float32(0.5), np.float32(0.05))
    assert found.sight_unlit[0, 0] == pytest.approx(float(expected), rel=0.02)


def test_by_night_what_is_lit_is_seen_farther_than_the_own_lamps_reach():
    found = seen(weather=NIGHT)
    assert found.sight_unlit[0, 0] == pytest.approx(60.0, abs=0.1)
    assert found.sight_lit[0, 0] == pytest.approx(300.0)


def test_lamps_in_thick_fog_at_night_are_seen_as_allard_says():
    found = seen(weather=NIGHT | {"fog": 100.0})
    extinction = np.float32(3.0) / meteorological_range(np.float32(100.0))
    expected = lamp_range(extinction, np.float32(8.0), np.float32(8e-7))
    assert found.sight_lit[0, 0] == pytest.approx(float(expected), rel=0.01)
    # The law itself: the illuminance at that distance is the threshold.
    r = float(found.sight_lit[0, 0])
    assert 8.0 * np.exp(-float(extinction) * r) / r**2 == pytest.approx(8e-7, rel=0.03)


def test_off_the_road_there_are_no_neighbours():
    road = wide_road(lanes=3)
    found = seen(Track(s=30.0, lane=2), ego=Track(speed=20.0, lane=3), road=road)
    assert found.lane[0, 0] == 3
    assert (found.neighbour_slot[0, :, 0] == NO_VEHICLE).all()
