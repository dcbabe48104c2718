"""Who drives around whom, against a plain search over every pair."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.minds import Moment, moment
from tests.support.worlds import Vehicle

LANES, WIDTH, MARGIN = 3, 3.5, 0.2
AHEAD_OF_OWN, BEHIND_OWN = 0, 1

vehicles = st.builds(
    Vehicle,
    kind=st.sampled_from(["S", "M", "V", "T", "MC"]),
    s=st.integers(0, 2000).map(lambda x: 0.1 * x),
    lane=st.integers(0, LANES - 1),
)


def searched(m: Moment, me: int, role: int) -> tuple[int, float]:
    """Slot and gap of the neighbour in a role, by looking at everyone in turn."""
    number = lambda values, i: float(values[i, 0])  # noqa: E731
    lane = number(m.state.lane_choice.lane, me) + (0, 1, -1)[role // 2]
    low, high = -LANES * WIDTH + lane * WIDTH, -LANES * WIDTH + (lane + 1) * WIDTH
    best, nearest = -1, float("inf")
    for other in range(8):
        if other == me or not number(m.p.valid, other):
            continue
        d, half = number(m.state.motion.d, other), number(m.p.half_width, other)
        if d + half <= low + MARGIN or d - half >= high - MARGIN:
            continue
        away = number(m.state.motion.s, other) - number(m.state.motion.s, me)
        if (away >= 0.0) != (role % 2 == 0) or abs(away) >= nearest:
            continue
        best, nearest = other, abs(away)
    if best < 0:
        return -1, float("inf")
    lengths = number(m.p.half_length, me) + number(m.p.half_length, best)
    return best, nearest - lengths


def roles_of(m: Moment, me: int) -> list[int]:
    """The roles whose lane exists."""
    lane = int(m.state.lane_choice.lane[me, 0])
    return [role for role in range(6) if 0 <= lane + (0, 1, -1)[role // 2] < LANES]


@pytest.mark.ci
@given(
    traffic=st.lists(vehicles, min_size=1, max_size=8),
    shifts=st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8),
)
@settings(max_examples=60)
def test_neighbours_are_those_that_a_plain_search_finds(
    traffic: list[Vehicle], shifts: list[float]
):
    m = moment(traffic)
    for i in range(len(traffic)):
        m.state.motion.d[i] += shifts[i]
    near = m.neighbours()
    for me in range(len(traffic)):
        for role in roles_of(m, me):
            slot, gap = searched(m, me, role)
            assert int(near.slot[role, me, 0]) == slot
            if slot >= 0:
                # Float32 of places up to 200 m.
                assert abs(float(near.gap[role, me, 0]) - gap) < 1e-4


def test_who_straddles_a_line_is_seen_from_both_lanes():
    m = moment([Vehicle(s=0.0, lane=0), Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0)])
    m.state.motion.d[2] = -2.0 * WIDTH  # On the line between lanes 0 and 1.
    near = m.neighbours()
    assert int(near.slot[AHEAD_OF_OWN, 0, 0]) == 2
    assert int(near.slot[AHEAD_OF_OWN, 1, 0]) == 2


def test_treading_on_a_line_is_not_being_in_the_lane():
    m = moment([Vehicle(s=0.0, lane=0), Vehicle(s=40.0, lane=1)])
    m.state.motion.d[1] = -2.0 * WIDTH + float(m.p.half_width[1, 0]) - 0.15
    assert int(m.neighbours().slot[AHEAD_OF_OWN, 0, 0]) == -1


def seen_changing(signal: float, done: float, crashed: float = 0.0) -> int:
    """Whom a driver sees ahead when another has done a part of its change into the lane."""
    m = moment([Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0), Vehicle(s=0.0, lane=0)])
    m.state.lane_choice.lane[1], m.state.controls.indicator[1] = 1.0, signal
    m.state.path.elapsed[1], m.state.path.duration[1] = 5.0 * done, 5.0
    m.state.motion.is_wreck[1] = crashed
    near = m.neighbours()
    assert int(near.slot[AHEAD_OF_OWN, 2, 0]) == 1  # From where it still is.
    return int(near.slot[AHEAD_OF_OWN, 0, 0])


def test_who_signals_a_lane_change_is_seen_from_there_before_the_body_arrives():
    assert seen_changing(signal=1.0, done=0.01) == 1


def test_who_does_not_signal_is_seen_from_there_once_it_visibly_moves():
    assert seen_changing(signal=0.0, done=0.19) == -1
    assert seen_changing(signal=0.0, done=0.21) == 1


def test_a_wreck_is_seen_only_where_it_lies():
    assert seen_changing(signal=1.0, done=0.5, crashed=1.0) == -1
    assert seen_changing(signal=1.0, done=1.0) == -1  # Nor one that has slid back.


def test_an_indicator_alone_is_not_a_lane_change():
    m = moment([Vehicle(s=0.0, lane=1), Vehicle(s=40.0, lane=0)])
    m.state.controls.indicator[1] = 1.0
    assert int(m.neighbours().slot[AHEAD_OF_OWN, 0, 0]) == -1


def test_vehicles_side_by_side_have_a_negative_gap():
    m = moment([Vehicle(s=10.0, lane=0), Vehicle(s=12.0, lane=1)])
    near = m.neighbours()
    assert int(near.slot[2, 0, 0]) == 1  # Ahead, in the faster lane.
    assert float(near.gap[2, 0, 0]) < 0.0
    assert int(near.slot[5, 1, 0]) == 0  # And it has the other behind, in the slower one.


def test_empty_slots_are_nobody():
    near = moment([Vehicle(s=10.0)]).neighbours()
    assert (near.slot[:, 0] == -1).all()
