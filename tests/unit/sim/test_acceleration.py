"""Pedals: jerk, the hardest braking, whom a lane change still brakes for."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.minds import moment
from tests.support.worlds import Vehicle

from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference import acceleration, steering, vehicle_dynamics

JERK = {"up": 2.5, "down": 5.0, "urgent": 6.0 / 0.6, "release": 5.0}


def press(now: float, leader: float, old_leader: float = 1e9) -> float:
    """Acceleration after one decision that wants what both leaders allow [m/s^2]."""
    m = moment([Vehicle(speed=20.0)])
    m.state.controls.requested_accel = np.full_like(m.state.controls.requested_accel, now)
    wanted = [
        np.full_like(m.state.controls.requested_accel, value) for value in (leader, old_leader)
    ]
    acceleration.apply_pedals(m.state, m.given, *wanted)
    return float(m.state.controls.requested_accel[0, 0])


@pytest.mark.parametrize(
    ("now", "wanted", "jerk"),
    [
        (0.0, 3.0, "up"),
        (1.0, -1.0, "down"),
        (0.0, -2.9, "down"),
        (0.0, -6.0, "urgent"),
    ],
)
def test_pedals_move_no_faster_than_feet(now: float, wanted: float, jerk: str):
    change = press(now, wanted) - now
    assert abs(change) == pytest.approx(JERK[jerk] * 0.05, rel=1e-5)
    assert np.sign(change) == np.sign(wanted - now)


def test_a_small_wish_is_fulfilled_at_once():
    assert press(1.0, 1.05) == pytest.approx(1.05)
    assert press(-1.0, -1.02) == pytest.approx(-1.02)


def test_the_more_careful_of_two_leaders_counts():
    assert press(0.0, 2.0, -0.1) == pytest.approx(-0.1)
    assert press(0.0, -0.1, 2.0) == pytest.approx(-0.1)


def test_in_an_emergency_the_brakes_are_the_limit_and_not_the_believed_grip():
    accel = 0.0
    for _ in range(40):
        accel = press(accel, -50.0)
    assert accel == pytest.approx(-9.0, rel=1e-4)  # The brakes of a car.


def test_a_wreck_has_no_pedals():
    m = moment([Vehicle(speed=20.0)])
    m.state.controls.requested_accel = np.full_like(m.state.controls.requested_accel, -4.0)
    m.state.motion.is_wreck = np.ones_like(m.state.motion.is_wreck)
    still = np.zeros_like(m.state.controls.requested_accel)
    acceleration.apply_pedals(m.state, m.given, still, still)
    assert (m.state.controls.requested_accel == 0.0).all()


def test_the_ego_uses_more_of_the_engine_while_it_passes():
    m = moment([Vehicle(speed=20.0), Vehicle(s=-100.0, speed=20.0)])
    context = m.context()
    following = acceleration.accel_behind_leader(m.state, m.given, context)
    m.state.overtake.stage[EGO_SLOT] = np.float32(Stage.PASS)
    passing = acceleration.accel_behind_leader(m.state, m.given, context)
    # 1.3 times, towards a tenth more speed; the others are not in a hurry.
    faster = 1.5 * (1.0 - (20.0 / 33.0) ** 4)
    assert float(passing[0, 0]) == pytest.approx(1.3 * faster, rel=1e-3)
    assert float(passing[1, 0]) == pytest.approx(float(following[1, 0]))


def brakes_for_the_old_leader(*, gap: float, done: float, duration: float = 5.0) -> bool:
    """Whether somebody at 30 m/s who leaves the lane of one at 20 m/s still brakes for it."""
    length = 4.4
    m = moment([Vehicle(s=0.0, lane=1, speed=30.0), Vehicle(s=gap + length, lane=0, speed=20.0)])
    low, high = float(m.state.motion.d[1, 0]), float(m.state.motion.d[0, 0])
    zero = np.zeros_like(m.state.motion.s)
    m.state.path.coefficients[0] = m.state.motion.d
    m.state.path.coefficients[0][0] = low
    mask = zero == 1.0
    mask[0] = True
    steering.start_path(m.state, mask, zero + np.float32(high), zero + np.float32(duration))
    m.state.path.elapsed[0] = done
    m.state.motion.d[0] = float(steering.path_point(m.state)[0][0, 0])
    accel = acceleration.accel_behind_old_leader(m.state, m.given, m.context())
    return bool(accel[0, 0] < 0.0)


def test_who_pulls_out_late_brakes_until_the_bodies_are_clear():
    assert brakes_for_the_old_leader(gap=10.0, done=0.5)
    # 10 m/s closing, 3 s until clear, 2 s to spare and 2 m at standstill: 52 m.
    assert not brakes_for_the_old_leader(gap=55.0, done=0.0)
    assert brakes_for_the_old_leader(gap=49.0, done=0.0)


def test_who_is_beside_the_old_leader_does_not_brake():
    # After 70 % of the path 2.9 of 3.5 m are covered, more than both half widths and the margin.
    assert not brakes_for_the_old_leader(gap=10.0, done=3.5)


def test_who_keeps_the_lane_does_not_brake_for_the_next():
    m = moment([Vehicle(s=0.0, lane=1, speed=30.0), Vehicle(s=15.0, lane=0, speed=20.0)])
    accel = acceleration.accel_behind_old_leader(m.state, m.given, m.context())
    assert float(accel[0, 0]) > 1e6


@pytest.mark.parametrize(("kind", "share"), [("L", 0.6), ("MC", 0.95)])
def test_traction_control_leaves_driven_axles_most_of_their_side_force(kind: str, share: float):
    m = moment([Vehicle(kind=kind, speed=30.0)])
    load = np.full_like(m.state.motion.s, 8000.0)
    grip = float(m.state.friction_and_wind.mu_left[0, 0]) * 8000.0
    for force, expected in ((1e6, share), (-1e6, -0.95)):
        asked = np.full_like(load, force)
        axle = vehicle_dynamics.axle_forces(m.given, m.state, asked, load)
        assert float(axle.force_lon[0, 0]) == pytest.approx(expected * grip, rel=1e-5)
        rest = np.sqrt(1.0 - expected * expected)
        assert float(axle.max_lateral_force[0, 0]) == pytest.approx(rest * grip, rel=1e-4)


@pytest.mark.parametrize(
    ("room", "closing", "time", "needed"),
    # 2 (v t - x) / t^2 while the room is used up with speed to spare, else v^2 / 2x.
    [(40.0, 10.0, 5.0, 0.8), (10.0, 10.0, 5.0, 5.0), (60.0, 10.0, 5.0, -0.8)],
)
def test_the_room_lasts_until_the_bodies_are_clear(
    room: float, closing: float, time: float, needed: float
):
    m = moment([Vehicle(s=0.0)])
    numbers = (np.array([x], np.float32) for x in (room, closing, time))
    found = float(acceleration._braking_until_clear(m.given.constants, *numbers)[0])
    assert found == pytest.approx(needed)
    # Driven at that braking, the room is never used up before the time.
    instants = np.linspace(0.0, min(time, closing / max(found, 1e-9)), 200)
    assert (closing * instants - 0.5 * max(found, 0.0) * instants**2 <= room + 1e-3).all()
