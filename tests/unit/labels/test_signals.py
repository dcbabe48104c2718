"""Signals of recordings for which the expected values follow by hand."""

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


def signals_of(*others: Track, ego: Track | None = None, **options):
    """Signals of 20 frames of an ego in the middle lane and other vehicles."""
    return case(ego or Track(speed=20.0, lane=1, body=BODY), *others, frames=20, **options).signals


@pytest.mark.parametrize(
    ("role", "lane", "s"),
    [
        (NeighbourRole.LEADER, 1, 30.0),
        (NeighbourRole.FOLLOWER, 1, -30.0),
        (NeighbourRole.LEFT_LEADER, 2, 30.0),
        (NeighbourRole.LEFT_FOLLOWER, 2, -30.0),
        (NeighbourRole.RIGHT_LEADER, 0, 30.0),
        (NeighbourRole.RIGHT_FOLLOWER, 0, -30.0),
    ],
)
def test_a_vehicle_is_the_neighbour_of_its_role_only(role, lane, s):
    signals = signals_of(Track(s=s, lane=lane, speed=25.0, body=BODY))
    assert signals.neighbour_slot[0, role, 0] == 1
    assert (signals.neighbour_slot[0, :, 0] != NO_VEHICLE).sum() == 1
    assert signals.gap[0, role, 0] == pytest.approx(30.0 - LENGTH, abs=2e-3)
    closing = -5.0 if role % 2 == 0 else 5.0
    assert signals.closing_speed[0, role, 0] == pytest.approx(closing, abs=1e-3)
    lateral_gap = 3.75 * (lane != 1) - WIDTH
    assert signals.lateral_gap[0, role, 0] == pytest.approx(lateral_gap, abs=2e-3)


def test_the_nearest_vehicle_ahead_is_the_leader():
    signals = signals_of(Track(s=60.0, lane=1), Track(s=35.0, lane=1), Track(s=90.0, lane=1))
    assert signals.neighbour_slot[0, NeighbourRole.LEADER, 0] == 2


def test_a_vehicle_alongside_has_a_negative_gap():
    signals = signals_of(Track(s=1.0, lane=2, body=BODY))
    assert signals.neighbour_slot[0, NeighbourRole.LEFT_LEADER, 0] == 1
    assert signals.gap[0, NeighbourRole.LEFT_LEADER, 0] == pytest.approx(1.0 - LENGTH, abs=2e-3)


def test_a_vehicle_two_lanes_to_the_left_is_no_neighbour():
    signals = signals_of(Track(s=30.0, lane=2), ego=Track(speed=20.0, lane=0))
    assert (signals.neighbour_slot[0, :, 0] == NO_VEHICLE).all()


def test_the_body_reaches_half_its_width_when_it_points_along_the_road():
    signals = signals_of()
    assert signals.left_edge[0, 0] - signals.lateral_position[0, 0] == pytest.approx(
        WIDTH / 2, abs=1e-3
    )
    assert signals.lateral_position[0, 0] - signals.right_edge[0, 0] == pytest.approx(
        WIDTH / 2, abs=1e-3
    )


def test_the_lateral_speed_is_the_slope_of_the_lateral_position():
    lane = ramp((0.0, 0.0), (1.0, 0.4), frames=20)
    signals = signals_of(ego=Track(speed=20.0, lane=lane))
    assert signals.lateral_speed[0, 3:16] == pytest.approx(1.5, abs=0.02)


def test_occupancy_counts_the_lengths_within_a_hundred_metres():
    others = [Track(s=s, lane=2, body={"length": 10.0}) for s in (-50.0, 20.0, 100.0, 120.0)]
    signals = signals_of(*others)
    # Two whole vehicles, half of the third, none of the fourth.
    assert signals.left_occupancy[0, 0] == pytest.approx(25.0 / 200.0, abs=1e-4)
    assert signals.left_count[0, 0] == 4


def test_the_friction_on_a_dry_road_equals_the_value_of_the_handbook():
    signals = signals_of(ego=Track(speed=25.0, lane=1, body=BODY | {"tyre_wear": 0.0}))
    assert signals.friction[0, 0] == pytest.approx(0.80, abs=1e-3)  # Bosch, new tyre, 90 km/h


def test_outer_lanes_are_wetter_and_so_more_slippery():
    rain = {"rain": 100.0}
    slow = signals_of(ego=Track(speed=30.0, lane=0), weather=rain)
    fast = signals_of(ego=Track(speed=30.0, lane=2), weather=rain)
    assert slow.friction[0, 0] < fast.friction[0, 0] - 0.01


def test_the_sight_in_fog_follows_koschmieder():
    signals = signals_of(weather={"fog": 80.0})
    extinction = 3.0 / meteorological_range(np.float32(80.0))
    # A car of contrast 0.5 against the threshold of 5 %.
    expected = contrast_range(extinction, np.float32(0.5), np.float32(0.05))
    assert signals.sight_unlit[0, 0] == pytest.approx(float(expected), rel=0.02)


def test_at_night_lit_vehicles_are_visible_farther_than_the_headlamps_reach():
    signals = signals_of(weather=NIGHT)
    assert signals.sight_unlit[0, 0] == pytest.approx(60.0, abs=0.1)
    assert signals.sight_lit[0, 0] == pytest.approx(300.0)


def test_the_sight_of_lamps_in_thick_fog_at_night_follows_allard():
    signals = signals_of(weather=NIGHT | {"fog": 100.0})
    extinction = np.float32(3.0) / meteorological_range(np.float32(100.0))
    expected = lamp_range(extinction, np.float32(8.0), np.float32(8e-7))
    assert signals.sight_lit[0, 0] == pytest.approx(float(expected), rel=0.01)
    # Allard's law itself: the illuminance at that distance is the threshold.
    r = float(signals.sight_lit[0, 0])
    assert 8.0 * np.exp(-float(extinction) * r) / r**2 == pytest.approx(8e-7, rel=0.03)


def test_an_ego_off_the_road_has_no_neighbours():
    road = wide_road(lanes=3)
    signals = signals_of(Track(s=30.0, lane=2), ego=Track(speed=20.0, lane=3), road=road)
    assert signals.lane[0, 0] == 3
    assert (signals.neighbour_slot[0, :, 0] == NO_VEHICLE).all()
