"""The neighbours of each vehicle, compared with a plain search over all pairs."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.traffic_instant import TrafficInstant, traffic_instant
from tests.support.worlds import Vehicle

LANES, WIDTH, MARGIN = 3, 3.5, 0.2
AHEAD_OF_OWN, BEHIND_OWN = 0, 1

vehicles = st.builds(
    Vehicle,
    kind=st.sampled_from(["S", "M", "V", "T", "MC"]),
    s=st.integers(0, 2000).map(lambda x: 0.1 * x),
    lane=st.integers(0, LANES - 1),
)


def search_all_pairs(instant: TrafficInstant, observer: int, role: int) -> tuple[int, float]:
    """Slot and gap of the neighbour in a role, by a test of every vehicle."""
    number = lambda values, i: float(values[i, 0])  # noqa: E731
    lane = number(instant.state.lane_choice.lane, observer) + (0, 1, -1)[role // 2]
    low, high = -LANES * WIDTH + lane * WIDTH, -LANES * WIDTH + (lane + 1) * WIDTH
    nearest_slot, nearest_distance = -1, float("inf")
    for slot in range(8):
        if slot == observer or not number(instant.vehicles.valid, slot):
            continue
        d, half = number(instant.state.motion.d, slot), number(instant.vehicles.half_width, slot)
        if d + half <= low + MARGIN or d - half >= high - MARGIN:
            continue
        distance = number(instant.state.motion.s, slot) - number(instant.state.motion.s, observer)
        if (distance >= 0.0) != (role % 2 == 0) or abs(distance) >= nearest_distance:
            continue
        nearest_slot, nearest_distance = slot, abs(distance)
    if nearest_slot < 0:
        return -1, float("inf")
    lengths = number(instant.vehicles.half_length, observer) + number(
        instant.vehicles.half_length, nearest_slot
    )
    return nearest_slot, nearest_distance - lengths


def roles_of(instant: TrafficInstant, observer: int) -> list[int]:
    """The roles whose lane exists."""
    lane = int(instant.state.lane_choice.lane[observer, 0])
    return [role for role in range(6) if 0 <= lane + (0, 1, -1)[role // 2] < LANES]


@pytest.mark.ci
@given(
    traffic=st.lists(vehicles, min_size=1, max_size=8),
    shifts=st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8),
)
@settings(max_examples=60)
def test_neighbours_equal_those_of_a_plain_search(traffic: list[Vehicle], shifts: list[float]):
    instant = traffic_instant(traffic)
    for i in range(len(traffic)):
        instant.state.motion.d[i] += shifts[i]
    neighbours = instant.neighbours()
    for observer in range(len(traffic)):
        for role in roles_of(instant, observer):
            slot, gap = search_all_pairs(instant, observer, role)
            assert int(neighbours.slot[role, observer, 0]) == slot
            if slot >= 0:
                # Rounding of float32 positions up to 200 m.
                assert abs(float(neighbours.gap[role, observer, 0]) - gap) < 1e-4


def test_a_vehicle_on_a_line_is_in_both_lanes():
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=0), Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0)]
    )
    instant.state.motion.d[2] = -2.0 * WIDTH  # On the line between lanes 0 and 1.
    neighbours = instant.neighbours()
    assert int(neighbours.slot[AHEAD_OF_OWN, 0, 0]) == 2
    assert int(neighbours.slot[AHEAD_OF_OWN, 1, 0]) == 2


def test_a_small_overlap_of_a_line_is_not_in_the_lane():
    instant = traffic_instant([Vehicle(s=0.0, lane=0), Vehicle(s=40.0, lane=1)])
    instant.state.motion.d[1] = -2.0 * WIDTH + float(instant.vehicles.half_width[1, 0]) - 0.15
    assert int(instant.neighbours().slot[AHEAD_OF_OWN, 0, 0]) == -1


def leader_during_change(signal: float, change_share: float, crashed: float = 0.0) -> int:
    """Slot of the leader while another vehicle has done a part of its change into the lane."""
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0), Vehicle(s=0.0, lane=0)]
    )
    instant.state.lane_choice.lane[1], instant.state.controls.indicator[1] = 1.0, signal
    instant.state.path.elapsed[1], instant.state.path.duration[1] = 5.0 * change_share, 5.0
    instant.state.motion.is_wreck[1] = crashed
    neighbours = instant.neighbours()
    assert int(neighbours.slot[AHEAD_OF_OWN, 2, 0]) == 1  # It is still in its old lane, too.
    return int(neighbours.slot[AHEAD_OF_OWN, 0, 0])


def test_an_indicated_lane_change_counts_in_the_new_lane_before_the_body_arrives():
    assert leader_during_change(signal=1.0, change_share=0.01) == 1


def test_a_lane_change_without_indicator_counts_once_it_is_visible():
    assert leader_during_change(signal=0.0, change_share=0.19) == -1
    assert leader_during_change(signal=0.0, change_share=0.21) == 1


def test_a_wreck_is_only_in_the_lanes_under_its_body():
    assert leader_during_change(signal=1.0, change_share=0.5, crashed=1.0) == -1
    assert (
        leader_during_change(signal=1.0, change_share=1.0) == -1
    )  # The body is still in the old lane.


def test_an_indicator_alone_is_not_a_lane_change():
    instant = traffic_instant([Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0)])
    instant.state.controls.indicator[1] = 1.0
    assert int(instant.neighbours().slot[AHEAD_OF_OWN, 0, 0]) == -1


def test_vehicles_side_by_side_have_a_negative_gap():
    instant = traffic_instant([Vehicle(s=10.0, lane=0), Vehicle(s=12.0, lane=1)])
    neighbours = instant.neighbours()
    assert int(neighbours.slot[2, 0, 0]) == 1  # Ahead, in the lane on the left.
    assert float(neighbours.gap[2, 0, 0]) < 0.0
    assert int(neighbours.slot[5, 1, 0]) == 0  # The other is behind, in the lane on the right.


def test_empty_slots_are_no_neighbours():
    neighbours = traffic_instant([Vehicle(s=10.0)]).neighbours()
    assert (neighbours.slot[:, 0] == -1).all()
