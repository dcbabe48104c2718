"""Lane changes of the others: Kesting, Treiber and Helbing's rules, and no accidents by them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.minds import CLEAR_MINDED, Moment, moment
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.sim import engine
from overtaking.sim.reference import acceleration, lane_change
from overtaking.sim.reference.state import LEADER
from overtaking.sim.reference.steering import start_path
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories

WILLING = {"lane_change_threshold": 0.1, "keep_right_bias": 0.2, "politeness": 0.2}
FAR_AWAY = Vehicle(s=5000.0, lane=0)
"""The ego, which does not change lanes by MOBIL, where it is in nobody's way."""


def changed(*others: Vehicle, lanes: int = 3) -> np.ndarray:
    """By how many lanes each of the others sets out to change, to the fast side positive."""
    m = moment([FAR_AWAY, *others], road=wide_road(lanes=lanes))
    before = m.state.lane_choice.lane.copy()
    for _ in range(2):  # Nobody sets out at the first look.
        decide(m)
    return (m.state.lane_choice.lane - before)[1 : 1 + len(others), 0]


def decide(m: Moment) -> None:
    """One look around of everybody, a fifth of a second after the last one."""
    context = m.context()
    accel = acceleration.accel_behind_leader(m.state, m.given, context)
    m.state.lane_choice.time_wanted += np.float32(0.2)
    lane_change.change_lanes_by_mobil(m.state, m.given, context, accel)


def car(s: float, lane: int, speed: float, **driver: float) -> Vehicle:
    return Vehicle(s=s, lane=lane, speed=speed, driver=WILLING | {"desired_speed": 33.0} | driver)


def at_lane(vehicle: Vehicle, lane: int) -> Vehicle:
    return dataclasses.replace(vehicle, lane=lane)


def test_a_slow_leader_is_passed_on_the_fast_side():
    assert changed(car(0.0, 1, 30.0), car(45.0, 1, 20.0, desired_speed=20.0))[0] == 1.0


def test_on_an_empty_road_everybody_keeps_to_the_slow_side():
    assert changed(car(0.0, 2, 30.0))[0] == -1.0
    assert changed(car(0.0, 0, 30.0))[0] == 0.0


def test_nobody_moves_over_before_having_wanted_to_for_as_long_as_they_signal():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    m = moment(
        [FAR_AWAY, car(0.0, 1, 30.0, indicator_lead_time=0.5), slow], road=wide_road(lanes=3)
    )
    moved = []
    for _ in range(5):
        decide(m)
        moved.append(float(m.state.lane_choice.lane[1, 0]))
        assert float(m.state.controls.indicator[1, 0]) == 1.0
    assert moved == [1.0, 1.0, 1.0, 2.0, 2.0]  # Five looks a second: after 0.6 s.


def test_who_changes_their_mind_begins_to_wait_anew():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    m = moment(
        [FAR_AWAY, car(0.0, 1, 30.0, indicator_lead_time=0.5), slow], road=wide_road(lanes=3)
    )
    decide(m)
    decide(m)
    m.state.motion.s[2] += 900.0
    decide(m)
    assert float(m.state.lane_choice.time_wanted[1, 0]) == 0.0
    m.state.motion.s[2] -= 900.0
    decide(m)
    decide(m)
    assert float(m.state.lane_choice.lane[1, 0]) == 1.0


def test_nobody_returns_to_a_lane_that_is_not_free_far_ahead():
    # At 30 m/s it must be free for 9 s, 270 m, even behind someone who is no slower.
    for gap, step in ((240.0, 0.0), (300.0, -1.0)):
        ahead = car(gap, 1, 30.0, desired_speed=30.0)
        assert changed(car(0.0, 2, 30.0, desired_speed=30.0), ahead)[0] == step


def test_nobody_moves_into_a_vehicle_beside_or_right_behind():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    for place in (-3.0, 0.0, 3.0, -6.0):
        assert changed(car(0.0, 0, 30.0), at_lane(slow, 0), car(place, 1, 30.0))[0] == 0.0


def test_nobody_cuts_in_before_someone_much_faster():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    # 50 m behind at 20 m/s more: braking with 4 m/s^2, the most imposed, would not do.
    slow = at_lane(slow, 0)
    assert changed(car(0.0, 0, 22.0), slow, car(-50.0, 1, 42.0))[0] == 0.0
    assert changed(car(0.0, 0, 22.0), slow, car(-250.0, 1, 30.0))[0] == 1.0


def test_above_60_kmh_nobody_gains_by_the_slow_side():
    # The fast lane is blocked by a slow leader, the slow lane is free: legal to pass there only in
    # slow traffic.
    for speed, step in ((25.0, 0.0), (14.0, -1.0)):
        blocked = car(30.0, 1, speed - 6.0, desired_speed=speed - 6.0)
        beside = changed(car(0.0, 1, speed, keep_right_bias=0.0), blocked, lanes=2)[0]
        assert beside == step


def test_politeness_lets_a_follower_by():
    # Somebody faster comes up behind in the fast lane; the slow lane is as fast as this one.
    leader = car(60.0, 1, 28.0, desired_speed=28.0)
    slow = car(300.0, 0, 28.0, desired_speed=28.0)
    behind = car(-22.0, 1, 33.0)
    own = {"keep_right_bias": 0.0, "desired_speed": 28.0}
    rude = changed(car(0.0, 1, 28.0, politeness=0.0, **own), leader, slow, behind, lanes=2)
    polite = changed(car(0.0, 1, 28.0, politeness=1.0, **own), leader, slow, behind, lanes=2)
    assert rude[0] == 0.0
    assert polite[0] == -1.0


def test_after_a_change_there_is_a_pause():
    m = moment([FAR_AWAY, car(0.0, 2, 30.0)])
    m.state.path.elapsed[1] = m.state.path.duration[1] = 1.0
    m.state.lane_choice.time_since_lane_change[1] = 9.9
    before = m.state.lane_choice.lane.copy()
    decide(m)
    np.testing.assert_array_equal(m.state.lane_choice.lane, before)
    m.state.lane_choice.time_since_lane_change[1] = 10.1
    decide(m)
    np.testing.assert_array_equal(
        m.state.lane_choice.lane, before
    )  # Nobody sets out at the first look.
    decide(m)
    assert float(m.state.lane_choice.lane[1, 0]) == 1.0


def test_the_ego_and_wrecks_and_empty_slots_do_not_change_lanes():
    m = moment([car(0.0, 2, 30.0), car(500.0, 2, 30.0)])
    m.state.motion.is_wreck[1] = 1.0
    before = m.state.lane_choice.lane.copy()
    decide(m)
    np.testing.assert_array_equal(m.state.lane_choice.lane, before)


def test_a_change_is_signalled_by_who_uses_the_indicator():
    for uses in (0.0, 1.0):
        m = moment([FAR_AWAY, car(0.0, 2, 30.0, uses_indicator=uses)])
        decide(m)
        assert float(m.state.controls.indicator[1, 0]) == -uses


@pytest.mark.parametrize("seed", range(4))
def test_lane_changes_of_clear_minds_in_dense_traffic_never_end_in_an_accident(seed: int):
    # Seven cars on three lanes, 40 to 80 m apart, at different wishes, for a minute: they change
    # lanes many times. (No error of perception, no wander, no wind, a dry road.)
    ran = dense_traffic(seed)
    lanes = ran.states.lane[:, 1:8].astype(int)
    assert (np.abs(np.diff(lanes, axis=2)) > 0).sum() > 600
    assert (ran.contacts.partner == 255).all()


@pytest.mark.ci
def test_nor_do_those_of_clear_minds_who_do_not_signal():
    # Two who make for one place from both sides see each other move; before the bodies are there.
    for seed in range(4):
        assert (dense_traffic(seed, uses_indicator=0.0).contacts.partner == 255).all()


def dense_traffic(seed: int, **driver: float) -> Trajectories:
    """A hundred minutes of seven cars close together, whose drivers see everything as it is."""
    random = np.random.default_rng(seed)
    rows = []
    for _ in range(100):
        row = [Vehicle(s=-3000.0, lane=0)]
        for k in range(7):
            wish = float(random.uniform(22.0, 36.0))
            speed = float(random.uniform(22.0, 30.0))
            place = 60.0 * k + float(random.uniform(-10.0, 10.0))
            row.append(car(place, int(random.integers(3)), speed, desired_speed=wish, **driver))
        rows.append(row)
    world = scenario(*rows, road=wide_road(), horizon=60.0)
    return engine.run(world, step_parameters(world, dataclasses.replace(CLEAR_MINDED, mobil=True)))


def test_of_two_who_signal_for_one_place_the_one_behind_waits():
    # Both want the lane in the middle, from either side; neither sees the other's lane.
    for ahead, first in ((5.0, 2), (-5.0, 1)):
        m = moment([FAR_AWAY, car(0.0, 0, 25.0), car(ahead, 2, 25.0)], road=wide_road(lanes=3))
        m.state.controls.indicator[1:3, 0] = 1.0, -1.0
        side = np.zeros_like(m.state.motion.s)
        side[1:3, 0] = 1.0, -1.0
        waits = lane_change.gives_way(m.state, m.given, side, lane_change.lane_claims(m.state))
        assert [bool(one) for one in waits[1:3, 0]] == [first == 2, first == 1]


def test_who_meets_danger_goes_back_and_does_not_retreat_from_a_retreat():
    # Halfway into a lane in which somebody drives beside it.
    m = moment([FAR_AWAY, car(0.0, 0, 25.0), car(-1.0, 1, 25.0)], road=wide_road(lanes=3))
    m.state.lane_choice.lane[1] = 1.0
    centre = m.state.motion.d[2].copy()
    everybody = np.ones(m.state.motion.s.shape, np.bool_)
    start_path(
        m.state,
        everybody,
        np.broadcast_to(centre, m.state.motion.s.shape),
        m.state.motion.s * 0 + 8.0,
    )
    m.state.path.elapsed[:] = 1.0
    m.state.path.duration[2] = m.state.path.elapsed[2] = 1.0
    decide(m)
    assert float(m.state.lane_choice.lane[1, 0]) == 0.0
    m.state.path.elapsed[:] = 0.5
    decide(m)
    assert float(m.state.lane_choice.lane[1, 0]) == 0.0


def test_a_follower_must_be_safe_in_two_seconds_as_well():
    m = moment([FAR_AWAY])
    gap, closing = (np.array([value], np.float32) for value in (30.0, 5.0))
    later, faster = lane_change.anticipated_follower(m.given, gap, closing)
    # 30 m - 5 m/s 2 s - 0.5 m/s^2 (2 s)^2 / 2; and 1 m/s more.
    assert float(later[0]) == pytest.approx(30.0 - 10.0 - 1.0)
    assert float(faster[0]) == pytest.approx(6.0)


def test_who_would_reach_the_leader_hurries():
    # At 10 m/s more the gap of 60 m is closed after 6 s: clear 2 s before, at 0.6 of the path.
    for closing, expected in ((0.0, 9.0), (10.0, (6.0 - 2.0) / 0.6), (30.0, 4.0)):
        m = moment([FAR_AWAY, car(0.0, 0, 25.0, lane_change_duration=9.0)])
        shape = m.state.motion.s.shape
        to_left, never = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
        to_left[1] = True
        context = m.context()
        context.beliefs.gap[LEADER], context.beliefs.closing_speed[LEADER] = 60.0, closing
        moves = lane_change.LaneMoves(to_left=to_left, to_right=never, is_cancelled=never)
        lane_change.start_lane_changes(m.state, m.given, context, moves)
        assert float(m.state.path.duration[1, 0]) == pytest.approx(expected, rel=1e-5)
