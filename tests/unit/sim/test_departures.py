"""Vehicles that leave the lanes or spin become wrecks, which slide to rest and end simulations."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.traffic_instant import TrafficInstant, traffic_instant
from tests.support.worlds import Vehicle, wide_road

from overtaking.model.trajectories import Stage
from overtaking.sim.reference import collisions


def wreck_departures(instant: TrafficInstant, step: int = 100) -> TrafficInstant:
    collisions.wreck_off_road_vehicles(instant.state, instant.params, step)
    return instant


@pytest.mark.parametrize(
    ("d", "heading", "is_wreck"),
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
def test_a_vehicle_a_metre_off_or_across_the_road_becomes_a_wreck(
    d: float, heading: float, is_wreck: bool
):
    instant = traffic_instant([Vehicle(), Vehicle(s=50.0)], road=wide_road())
    instant.state.motion.d[1], instant.state.motion.heading[1] = d, heading
    wreck_departures(instant)
    assert bool(instant.state.motion.is_wreck[1, 0]) is is_wreck
    assert not instant.state.motion.is_wreck[0, 0]
    assert float(instant.state.first_contact.partner[1, 0]) == -1.0  # No contact.


def test_a_wrecked_ego_ends_the_simulation_two_seconds_later_and_another_wreck_does_not():
    instant = traffic_instant([Vehicle(), Vehicle(s=50.0)], road=wide_road())
    last = float(instant.state.end_step[0])
    instant.state.motion.d[1] = 5.0
    wreck_departures(instant)
    assert float(instant.state.end_step[0]) == last
    instant.state.motion.d[0] = 5.0
    wreck_departures(instant, step=100)
    assert float(instant.state.end_step[0]) == 300.0
    assert float(instant.state.overtake.stage[0, 0]) == Stage.CRASHED


def test_empty_slots_never_become_wrecks():
    instant = traffic_instant([Vehicle()], road=wide_road())
    instant.state.motion.d[3] = 50.0
    wreck_departures(instant)
    assert not instant.state.motion.is_wreck[3, 0]


@pytest.mark.parametrize("friction", [0.8, 0.3])
@pytest.mark.parametrize("sideways", [0.0, 8.0])
def test_a_wreck_slides_to_rest_with_locked_wheels(friction: float, sideways: float):
    speed = 20.0
    vehicle_bench = bench(Vehicle(speed=speed), friction=friction)
    vehicle_bench.state.motion.is_wreck = np.ones_like(vehicle_bench.state.motion.is_wreck)
    vehicle_bench.state.motion.vy = np.full_like(vehicle_bench.state.motion.vy, sideways)
    vehicle_bench.state.motion.yaw_rate = np.full_like(vehicle_bench.state.motion.yaw_rate, 1.5)
    history = vehicle_bench.drive(15.0)
    distance = float(np.hypot(np.diff(history["s"][:, 0]), np.diff(history["d"][:, 0])).sum())
    # Three quarters of the peak friction, whichever way the wheels point.
    decel = 0.75 * friction * 9.81
    assert distance == pytest.approx((speed**2 + sideways**2) / (2.0 * decel), rel=0.02)
    assert float(np.hypot(history["vx"][-1, 0], history["vy"][-1, 0])) < 1e-3
    assert float(history["yaw_rate"][-1, 0]) == 0.0


def test_a_wreck_does_not_turn_the_way_it_slides():
    # Rotation does not change the direction of motion over ground.
    vehicle_bench = bench(Vehicle(speed=20.0), friction=0.3)
    vehicle_bench.state.motion.is_wreck = np.ones_like(vehicle_bench.state.motion.is_wreck)
    vehicle_bench.state.motion.yaw_rate = np.full_like(vehicle_bench.state.motion.yaw_rate, 2.5)
    history = vehicle_bench.drive(3.0)
    drift = float(history["d"][-1, 0] - history["d"][0, 0])
    assert abs(float(history["heading"][-1, 0])) > 0.5
    # First-order rotation of the velocity: 1 % of the way.
    assert abs(drift) < 0.02 * float(history["s"][-1, 0] - history["s"][0, 0])


def test_a_vehicle_that_stands_stays_where_it_is():
    vehicle_bench = bench(Vehicle(speed=0.05))
    history = vehicle_bench.drive(2.0, lambda test, _: test.hold(accel=-1.0))
    assert float(history["vx"][-1, 0]) == 0.0
    # It stops within the first step.
    assert float(history["s"][-1, 0] - history["s"][0, 0]) <= 0.05 * 0.05


def test_brakes_do_not_drive_backwards():
    vehicle_bench = bench(Vehicle(speed=8.0), friction=0.9)
    history = vehicle_bench.drive(4.0, lambda test, _: test.hold(accel=-9.0))
    assert (history["vx"] >= 0.0).all()
    assert float(history["vx"][-1, 0]) == 0.0
