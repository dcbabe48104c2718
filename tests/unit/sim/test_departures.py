"""Vehicles that leave the lanes or spin, and wrecks: they slide to rest and end the story."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.minds import Moment, moment
from tests.support.worlds import Vehicle, wide_road

from overtaking.model.trajectories import Stage
from overtaking.sim.reference import collisions


def after_leaving(m: Moment, step: int = 100) -> Moment:
    collisions.wreck_off_road_vehicles(m.state, m.given, step)
    return m


@pytest.mark.parametrize(
    ("d", "psi", "lost"),
    [
        (-5.0, 0.0, False),
        (-11.4, 0.0, False),  # A wheel on the verge.
        (-11.6, 0.0, True),
        (0.9, 0.0, False),
        (1.1, 0.0, True),
        (-5.0, 0.7, False),
        (-5.0, 0.9, True),
        (-5.0, -0.9, True),
    ],
)
def test_who_is_a_metre_off_or_across_the_road_is_lost(d: float, psi: float, lost: bool):
    m = moment([Vehicle(), Vehicle(s=50.0)], road=wide_road())
    m.state.motion.d[1], m.state.motion.heading[1] = d, psi
    after_leaving(m)
    assert bool(m.state.motion.is_wreck[1, 0]) is lost
    assert not m.state.motion.is_wreck[0, 0]
    assert float(m.state.first_contact.partner[1, 0]) == -1.0  # Nobody was touched.


def test_a_lost_ego_ends_the_simulation_two_seconds_later_and_another_does_not():
    m = moment([Vehicle(), Vehicle(s=50.0)], road=wide_road())
    last = float(m.state.end_step[0])
    m.state.motion.d[1] = 5.0
    after_leaving(m)
    assert float(m.state.end_step[0]) == last
    m.state.motion.d[0] = 5.0
    after_leaving(m, step=100)
    assert float(m.state.end_step[0]) == 300.0
    assert float(m.state.overtake.stage[0, 0]) == Stage.CRASHED


def test_empty_slots_are_never_lost():
    m = moment([Vehicle()], road=wide_road())
    m.state.motion.d[3] = 50.0
    after_leaving(m)
    assert not m.state.motion.is_wreck[3, 0]


@pytest.mark.parametrize("friction", [0.8, 0.3])
@pytest.mark.parametrize("sideways", [0.0, 8.0])
def test_a_wreck_slides_to_rest_as_far_as_locked_wheels_let_it(friction: float, sideways: float):
    speed = 20.0
    b = bench(Vehicle(speed=speed), friction=friction)
    b.state.motion.is_wreck = np.ones_like(b.state.motion.is_wreck)
    b.state.motion.vy = np.full_like(b.state.motion.vy, sideways)
    b.state.motion.yaw_rate = np.full_like(b.state.motion.yaw_rate, 1.5)
    ran = b.drive(15.0)
    way = float(np.hypot(np.diff(ran["s"][:, 0]), np.diff(ran["d"][:, 0])).sum())
    # Three quarters of the peak friction, whichever way the wheels point.
    decel = 0.75 * friction * 9.81
    assert way == pytest.approx((speed**2 + sideways**2) / (2.0 * decel), rel=0.02)
    assert float(np.hypot(ran["vx"][-1, 0], ran["vy"][-1, 0])) < 1e-3
    assert float(ran["yaw_rate"][-1, 0]) == 0.0


def test_a_wreck_does_not_turn_the_way_it_slides():
    # Spinning changes the axes, not the course: the track over ground stays straight.
    b = bench(Vehicle(speed=20.0), friction=0.3)
    b.state.motion.is_wreck = np.ones_like(b.state.motion.is_wreck)
    b.state.motion.yaw_rate = np.full_like(b.state.motion.yaw_rate, 2.5)
    ran = b.drive(3.0)
    drift = float(ran["d"][-1, 0] - ran["d"][0, 0])
    assert abs(float(ran["heading"][-1, 0])) > 0.5
    # First-order rotation of the velocity: 1 % of the way.
    assert abs(drift) < 0.02 * float(ran["s"][-1, 0] - ran["s"][0, 0])


def test_a_vehicle_that_stands_stays_where_it_is():
    b = bench(Vehicle(speed=0.05))
    ran = b.drive(2.0, lambda test, _: test.hold(accel=-1.0))
    assert float(ran["vx"][-1, 0]) == 0.0
    # It stops within the first step.
    assert float(ran["s"][-1, 0] - ran["s"][0, 0]) <= 0.05 * 0.05


def test_brakes_do_not_drive_backwards():
    b = bench(Vehicle(speed=8.0), friction=0.9)
    ran = b.drive(4.0, lambda test, _: test.hold(accel=-9.0))
    assert (ran["vx"] >= 0.0).all()
    assert float(ran["vx"][-1, 0]) == 0.0
