"""Lane changes of the others by the rules of Kesting, Treiber and Helbing, without accidents."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.traffic_instant import PERFECT_PERCEPTION, TrafficInstant, traffic_instant
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
"""The ego, which does not change lanes by MOBIL, far from the other vehicles."""


def lane_steps(*others: Vehicle, lanes: int = 3) -> np.ndarray:
    """Number of lanes by which each of the others begins to change, positive to the left."""
    instant = traffic_instant([FAR_AWAY, *others], road=wide_road(lanes=lanes))
    before = instant.state.lane_choice.lane.copy()
    for _ in range(2):  # No driver begins a lane change at its first check of the mirrors.
        decide(instant)
    return (instant.state.lane_choice.lane - before)[1 : 1 + len(others), 0]


def decide(instant: TrafficInstant) -> None:
    """One check of the mirrors of all drivers, 0.2 s after the last one."""
    context = instant.context()
    accel = acceleration.accel_behind_leader(instant.state, instant.params, context)
    instant.state.lane_choice.time_wanted += np.float32(0.2)
    lane_change.change_lanes_by_mobil(instant.state, instant.params, context, accel)


def car(s: float, lane: int, speed: float, **driver: float) -> Vehicle:
    return Vehicle(s=s, lane=lane, speed=speed, driver=WILLING | {"desired_speed": 33.0} | driver)


def at_lane(vehicle: Vehicle, lane: int) -> Vehicle:
    return dataclasses.replace(vehicle, lane=lane)


def test_a_slow_leader_is_passed_on_the_overtaking_side():
    assert lane_steps(car(0.0, 1, 30.0), car(45.0, 1, 20.0, desired_speed=20.0))[0] == 1.0


def test_on_an_empty_road_drivers_keep_to_the_kerb_side():
    assert lane_steps(car(0.0, 2, 30.0))[0] == -1.0
    assert lane_steps(car(0.0, 0, 30.0))[0] == 0.0


def test_a_lane_change_begins_after_the_indicator_lead_time():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    instant = traffic_instant(
        [FAR_AWAY, car(0.0, 1, 30.0, indicator_lead_time=0.5), slow], road=wide_road(lanes=3)
    )
    moved = []
    for _ in range(5):
        decide(instant)
        moved.append(float(instant.state.lane_choice.lane[1, 0]))
        assert float(instant.state.controls.indicator[1, 0]) == 1.0
    assert moved == [1.0, 1.0, 1.0, 2.0, 2.0]  # Five checks a second: after 0.6 s.


def test_a_withdrawn_wish_restarts_the_indicator_lead_time():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    instant = traffic_instant(
        [FAR_AWAY, car(0.0, 1, 30.0, indicator_lead_time=0.5), slow], road=wide_road(lanes=3)
    )
    decide(instant)
    decide(instant)
    instant.state.motion.s[2] += 900.0
    decide(instant)
    assert float(instant.state.lane_choice.time_wanted[1, 0]) == 0.0
    instant.state.motion.s[2] -= 900.0
    decide(instant)
    decide(instant)
    assert float(instant.state.lane_choice.lane[1, 0]) == 1.0


def test_drivers_return_only_to_a_lane_that_is_free_far_ahead():
    # At 30 m/s it must be free for 9 s, 270 m, even behind a leader that is no slower.
    for gap, step in ((240.0, 0.0), (300.0, -1.0)):
        ahead = car(gap, 1, 30.0, desired_speed=30.0)
        assert lane_steps(car(0.0, 2, 30.0, desired_speed=30.0), ahead)[0] == step


def test_drivers_do_not_move_into_a_vehicle_beside_or_close_behind():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    for s in (-3.0, 0.0, 3.0, -6.0):
        assert lane_steps(car(0.0, 0, 30.0), at_lane(slow, 0), car(s, 1, 30.0))[0] == 0.0


def test_drivers_do_not_cut_in_ahead_of_a_much_faster_vehicle():
    slow = car(45.0, 1, 20.0, desired_speed=20.0)
    # 50 m behind at 20 m/s more: braking with 4 m/s^2, the most imposed, would not do.
    slow = at_lane(slow, 0)
    assert lane_steps(car(0.0, 0, 22.0), slow, car(-50.0, 1, 42.0))[0] == 0.0
    assert lane_steps(car(0.0, 0, 22.0), slow, car(-250.0, 1, 30.0))[0] == 1.0


def test_above_60_kmh_drivers_gain_nothing_on_the_kerb_side():
    # A slow leader blocks the left lane, the right lane is free: drivers pass there only in slow
    # traffic.
    for speed, step in ((25.0, 0.0), (14.0, -1.0)):
        blocked = car(30.0, 1, speed - 6.0, desired_speed=speed - 6.0)
        lane_step = lane_steps(car(0.0, 1, speed, keep_right_bias=0.0), blocked, lanes=2)[0]
        assert lane_step == step


def test_polite_drivers_let_a_follower_pass():
    # A faster vehicle approaches from behind; the lane on the right is as fast as this one.
    leader = car(60.0, 1, 28.0, desired_speed=28.0)
    slow = car(300.0, 0, 28.0, desired_speed=28.0)
    behind = car(-22.0, 1, 33.0)
    traits = {"keep_right_bias": 0.0, "desired_speed": 28.0}
    impolite = lane_steps(
        car(0.0, 1, 28.0, politeness=0.0, **traits), leader, slow, behind, lanes=2
    )
    polite = lane_steps(car(0.0, 1, 28.0, politeness=1.0, **traits), leader, slow, behind, lanes=2)
    assert impolite[0] == 0.0
    assert polite[0] == -1.0


def test_after_a_change_there_is_a_pause():
    instant = traffic_instant([FAR_AWAY, car(0.0, 2, 30.0)])
    instant.state.path.elapsed[1] = instant.state.path.duration[1] = 1.0
    instant.state.lane_choice.time_since_lane_change[1] = 9.9
    before = instant.state.lane_choice.lane.copy()
    decide(instant)
    np.testing.assert_array_equal(instant.state.lane_choice.lane, before)
    instant.state.lane_choice.time_since_lane_change[1] = 10.1
    decide(instant)
    np.testing.assert_array_equal(
        instant.state.lane_choice.lane, before
    )  # Nobody sets out at the first look.
    decide(instant)
    assert float(instant.state.lane_choice.lane[1, 0]) == 1.0


def test_the_ego_and_wrecks_and_empty_slots_do_not_change_lanes():
    instant = traffic_instant([car(0.0, 2, 30.0), car(500.0, 2, 30.0)])
    instant.state.motion.is_wreck[1] = 1.0
    before = instant.state.lane_choice.lane.copy()
    decide(instant)
    np.testing.assert_array_equal(instant.state.lane_choice.lane, before)


def test_drivers_that_use_the_indicator_indicate_a_lane_change():
    for uses in (0.0, 1.0):
        instant = traffic_instant([FAR_AWAY, car(0.0, 2, 30.0, uses_indicator=uses)])
        decide(instant)
        assert float(instant.state.controls.indicator[1, 0]) == -uses


@pytest.mark.parametrize("seed", range(4))
def test_lane_changes_without_errors_of_perception_cause_no_accident_in_dense_traffic(seed: int):
    # Seven cars on three lanes, 40 to 80 m apart, at different wishes, for a minute: they change
    # lanes many times, without errors of perception, wandering and wind, on a dry road.
    recording = dense_traffic(seed)
    lanes = recording.states.lane[:, 1:8].astype(int)
    assert (np.abs(np.diff(lanes, axis=2)) > 0).sum() > 600
    assert (recording.contacts.partner == 255).all()


@pytest.mark.ci
def test_lane_changes_without_indicator_and_errors_of_perception_cause_no_accident():
    # Two drivers that change into one gap from both sides perceive each other by their motion.
    for seed in range(4):
        assert (dense_traffic(seed, uses_indicator=0.0).contacts.partner == 255).all()


def dense_traffic(seed: int, **driver: float) -> Trajectories:
    """A hundred simulations of one minute, with seven close cars and perfect perception."""
    random = np.random.default_rng(seed)
    rows = []
    for _ in range(100):
        row = [Vehicle(s=-3000.0, lane=0)]
        for k in range(7):
            desired_speed = float(random.uniform(22.0, 36.0))
            speed = float(random.uniform(22.0, 30.0))
            s = 60.0 * k + float(random.uniform(-10.0, 10.0))
            row.append(
                car(s, int(random.integers(3)), speed, desired_speed=desired_speed, **driver)
            )
        rows.append(row)
    world = scenario(*rows, road=wide_road(), horizon=60.0)
    return engine.run(
        world, step_parameters(world, dataclasses.replace(PERFECT_PERCEPTION, mobil=True))
    )


def test_of_two_drivers_that_indicate_for_one_gap_the_rear_one_waits():
    # Both want the lane in the middle, from either side.
    for ahead, first in ((5.0, 2), (-5.0, 1)):
        instant = traffic_instant(
            [FAR_AWAY, car(0.0, 0, 25.0), car(ahead, 2, 25.0)], road=wide_road(lanes=3)
        )
        instant.state.controls.indicator[1:3, 0] = 1.0, -1.0
        side = np.zeros_like(instant.state.motion.s)
        side[1:3, 0] = 1.0, -1.0
        waits = lane_change.gives_way(
            instant.state, instant.params, side, lane_change.lane_claims(instant.state)
        )
        assert waits[1:3, 0].tolist() == [first == 2, first == 1]


def test_a_dangerous_lane_change_is_cancelled_once():
    # In the first half of a change into a lane with a vehicle beside it.
    instant = traffic_instant(
        [FAR_AWAY, car(0.0, 0, 25.0), car(-1.0, 1, 25.0)], road=wide_road(lanes=3)
    )
    instant.state.lane_choice.lane[1] = 1.0
    centre = instant.state.motion.d[2].copy()
    all_vehicles = np.ones(instant.state.motion.s.shape, np.bool_)
    start_path(
        instant.state,
        all_vehicles,
        np.broadcast_to(centre, instant.state.motion.s.shape),
        instant.state.motion.s * 0 + 8.0,
    )
    instant.state.path.elapsed[:] = 1.0
    instant.state.path.duration[2] = instant.state.path.elapsed[2] = 1.0
    decide(instant)
    assert float(instant.state.lane_choice.lane[1, 0]) == 0.0
    instant.state.path.elapsed[:] = 0.5
    decide(instant)
    assert float(instant.state.lane_choice.lane[1, 0]) == 0.0


def test_a_follower_must_be_safe_in_two_seconds_as_well():
    instant = traffic_instant([FAR_AWAY])
    gap, closing = (np.array([value], np.float32) for value in (30.0, 5.0))
    later, faster = lane_change.anticipated_follower(instant.params, gap, closing)
    # 30 m - 5 m/s 2 s - 0.5 m/s^2 (2 s)^2 / 2; and 1 m/s more.
    assert float(later[0]) == pytest.approx(30.0 - 10.0 - 1.0)
    assert float(faster[0]) == pytest.approx(6.0)


def test_a_driver_that_would_reach_its_leader_changes_lanes_faster():
    # At 10 m/s more the gap of 60 m is closed after 6 s: clear 2 s before, at 0.6 of the path.
    for closing, expected in ((0.0, 9.0), (10.0, (6.0 - 2.0) / 0.6), (30.0, 4.0)):
        instant = traffic_instant([FAR_AWAY, car(0.0, 0, 25.0, lane_change_duration=9.0)])
        shape = instant.state.motion.s.shape
        to_left, never = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
        to_left[1] = True
        context = instant.context()
        context.beliefs.gap[LEADER], context.beliefs.closing_speed[LEADER] = 60.0, closing
        moves = lane_change.LaneMoves(to_left=to_left, to_right=never, is_cancelled=never)
        lane_change.start_lane_changes(instant.state, instant.params, context, moves)
        assert float(instant.state.path.duration[1, 0]) == pytest.approx(expected, rel=1e-5)
