"""Pedals: limits of jerk and braking, and braking for the leader of the lane that is left."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.traffic_instant import traffic_instant
from tests.support.worlds import Vehicle

from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference import acceleration, steering, vehicle_dynamics

JERK = {"up": 2.5, "down": 5.0, "urgent": 6.0 / 0.6, "release": 5.0}


def accel_after_decision(requested: float, leader: float, old_leader: float = 1e9) -> float:
    """Requested acceleration after one decision, with the accelerations of both leaders [m/s^2]."""
    instant = traffic_instant([Vehicle(speed=20.0)])
    instant.state.controls.requested_accel = np.full_like(
        instant.state.controls.requested_accel, requested
    )
    wanted_accel = [
        np.full_like(instant.state.controls.requested_accel, value)
        for value in (leader, old_leader)
    ]
    acceleration.apply_pedals(instant.state, instant.params, *wanted_accel)
    return float(instant.state.controls.requested_accel[0, 0])


@pytest.mark.parametrize(
    ("requested", "wanted_accel", "jerk"),
    [
        (0.0, 3.0, "up"),
        (1.0, -1.0, "down"),
        (0.0, -2.9, "down"),
        (0.0, -6.0, "urgent"),
    ],
)
def test_requested_acceleration_changes_with_limited_jerk(
    requested: float, wanted_accel: float, jerk: str
):
    change = accel_after_decision(requested, wanted_accel) - requested
    assert abs(change) == pytest.approx(JERK[jerk] * 0.05, rel=1e-5)
    assert np.sign(change) == np.sign(wanted_accel - requested)


def test_a_small_change_of_acceleration_is_applied_at_once():
    assert accel_after_decision(1.0, 1.05) == pytest.approx(1.05)
    assert accel_after_decision(-1.0, -1.02) == pytest.approx(-1.02)


def test_the_smaller_acceleration_of_two_leaders_applies():
    assert accel_after_decision(0.0, 2.0, -0.1) == pytest.approx(-0.1)
    assert accel_after_decision(0.0, -0.1, 2.0) == pytest.approx(-0.1)


def test_in_an_emergency_the_brakes_limit_deceleration_and_not_the_believed_friction():
    accel = 0.0
    for _ in range(40):
        accel = accel_after_decision(accel, -50.0)
    assert accel == pytest.approx(-9.0, rel=1e-4)  # The brakes of a car.


def test_a_wreck_requests_no_acceleration():
    instant = traffic_instant([Vehicle(speed=20.0)])
    instant.state.controls.requested_accel = np.full_like(
        instant.state.controls.requested_accel, -4.0
    )
    instant.state.motion.is_wreck = np.ones_like(instant.state.motion.is_wreck)
    zero_accel = np.zeros_like(instant.state.controls.requested_accel)
    acceleration.apply_pedals(instant.state, instant.params, zero_accel, zero_accel)
    assert (instant.state.controls.requested_accel == 0.0).all()


def test_the_ego_accelerates_more_while_it_passes():
    instant = traffic_instant([Vehicle(speed=20.0), Vehicle(s=-100.0, speed=20.0)])
    context = instant.context()
    following = acceleration.accel_behind_leader(instant.state, instant.params, context)
    instant.state.overtake.stage[EGO_SLOT] = np.float32(Stage.PASS)
    passing = acceleration.accel_behind_leader(instant.state, instant.params, context)
    # 1.3 times, towards a desired speed that is a tenth higher; others accelerate as before.
    faster = 1.5 * (1.0 - (20.0 / 33.0) ** 4)
    assert float(passing[0, 0]) == pytest.approx(1.3 * faster, rel=1e-3)
    assert float(passing[1, 0]) == pytest.approx(float(following[1, 0]))


def brakes_for_the_old_leader(*, gap: float, elapsed: float, duration: float = 5.0) -> bool:
    """Whether a driver at 30 m/s brakes for the leader, at 20 m/s, of the lane that it leaves."""
    length = 4.4
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=1, speed=30.0), Vehicle(s=gap + length, lane=0, speed=20.0)]
    )
    low, high = float(instant.state.motion.d[1, 0]), float(instant.state.motion.d[0, 0])
    zero = np.zeros_like(instant.state.motion.s)
    instant.state.path.coefficients[0] = instant.state.motion.d
    instant.state.path.coefficients[0][0] = low
    mask = zero == 1.0
    mask[0] = True
    steering.start_path(instant.state, mask, zero + np.float32(high), zero + np.float32(duration))
    instant.state.path.elapsed[0] = elapsed
    instant.state.motion.d[0] = float(steering.path_point(instant.state)[0][0, 0])
    accel = acceleration.accel_behind_old_leader(instant.state, instant.params, instant.context())
    return bool(accel[0, 0] < 0.0)


def test_a_driver_that_pulls_out_late_brakes_until_the_bodies_are_clear():
    assert brakes_for_the_old_leader(gap=10.0, elapsed=0.5)
    # 10 m/s closing, 3 s until clear, 2 s to spare and 2 m at standstill: 52 m.
    assert not brakes_for_the_old_leader(gap=55.0, elapsed=0.0)
    assert brakes_for_the_old_leader(gap=49.0, elapsed=0.0)


def test_a_driver_beside_its_old_leader_does_not_brake():
    # After 70 % of the path 2.9 of 3.5 m are covered, more than both half widths and the margin.
    assert not brakes_for_the_old_leader(gap=10.0, elapsed=3.5)


def test_a_driver_that_keeps_its_lane_does_not_brake_for_the_next_lane():
    instant = traffic_instant(
        [Vehicle(s=0.0, lane=1, speed=30.0), Vehicle(s=15.0, lane=0, speed=20.0)]
    )
    accel = acceleration.accel_behind_old_leader(instant.state, instant.params, instant.context())
    assert float(accel[0, 0]) > 1e6


@pytest.mark.parametrize(("kind", "share"), [("L", 0.6), ("MC", 0.95)])
def test_traction_control_leaves_driven_axles_most_of_their_side_force(kind: str, share: float):
    instant = traffic_instant([Vehicle(kind=kind, speed=30.0)])
    load = np.full_like(instant.state.motion.s, 8000.0)
    grip = float(instant.state.friction_and_wind.mu_left[0, 0]) * 8000.0
    for force, expected in ((1e6, share), (-1e6, -0.95)):
        requested_force = np.full_like(load, force)
        axle = vehicle_dynamics.axle_forces(instant.params, instant.state, requested_force, load)
        assert float(axle.force_lon[0, 0]) == pytest.approx(expected * grip, rel=1e-5)
        lateral_share = np.sqrt(1.0 - expected * expected)
        assert float(axle.max_lateral_force[0, 0]) == pytest.approx(lateral_share * grip, rel=1e-4)


@pytest.mark.parametrize(
    ("gap", "closing", "time", "needed"),
    # 2 (v t - x) / t^2 if the closing speed is above 0 until the time t, else v^2 / 2x.
    [(40.0, 10.0, 5.0, 0.8), (10.0, 10.0, 5.0, 5.0), (60.0, 10.0, 5.0, -0.8)],
)
def test_braking_makes_the_gap_last_until_the_bodies_are_clear(
    gap: float, closing: float, time: float, needed: float
):
    instant = traffic_instant([Vehicle(s=0.0)])
    arguments = (np.array([x], np.float32) for x in (gap, closing, time))
    decel = float(acceleration._braking_until_clear(instant.params.constants, *arguments)[0])
    assert decel == pytest.approx(needed)
    # With this braking the gap lasts for the whole time.
    times = np.linspace(0.0, min(time, closing / max(decel, 1e-9)), 200)
    assert (closing * times - 0.5 * max(decel, 0.0) * times**2 <= gap + 1e-3).all()
