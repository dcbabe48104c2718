"""Times and speeds that drivers expect of a pass against oncoming traffic."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.support.traffic_instant import traffic_instant
from tests.support.worlds import Vehicle, body_of

from overtaking.sim.reference.passing import expected_accel, passing_speed, time_to_gain

GRAVITY, AIR_DENSITY, USABLE_POWER = 9.81, 1.2, 0.9


def time_to_reach(kind: str, begin: float, end: float) -> float:
    """Time in which a vehicle at full throttle gains speed, by a separate integration [s]."""
    body = body_of(kind)
    power, mass = USABLE_POWER * body["power"], body["mass"]
    rolling = body["rolling_resistance"] * mass * GRAVITY

    def speed_up(_, v):
        drag = 0.5 * AIR_DENSITY * body["drag_area"] * v**2
        return (np.minimum(power / v, mass * body["launch_accel"]) - drag - rolling) / mass

    def arrives(_, v):
        return v[0] - end

    arrives.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    run = solve_ivp(speed_up, (0.0, 1000.0), [begin], events=arrives, rtol=1e-8)
    return float(run.t_events[0][0])


@pytest.mark.parametrize(
    ("kind", "begin", "end"),
    [("S", 22.0, 32.0), ("M", 22.0, 32.0), ("M", 28.0, 38.0), ("V", 25.0, 33.0), ("T", 18.0, 24.0)],
)
def test_drivers_expect_the_acceleration_of_their_engine_at_the_passing_speed(kind, begin, end):
    instant = traffic_instant([Vehicle(kind=kind, driver={"accel": 9.0})])
    constants, driver = instant.params.constants, instant.vehicles.at_slots(0)
    speed, top = (np.array([value], np.float32) for value in (begin, end))
    accel = expected_accel(constants, driver, speed, top)
    duration = (end - begin) / float(accel[0])
    assert duration == pytest.approx(time_to_reach(kind, begin, end), rel=0.05)
    # A driver with a smaller trait uses less of the engine.
    instant = traffic_instant([Vehicle(kind=kind, driver={"accel": 0.2})])
    gentle_accel = expected_accel(constants, instant.vehicles.at_slots(0), speed, top)
    assert float(gentle_accel[0]) == pytest.approx(constants.accelerate_gain * 0.2, rel=1e-6)


def test_gaining_a_distance_takes_longer_past_a_faster_target():
    instant = traffic_instant([Vehicle(kind="M", driver={"accel": 2.0})])
    leader = np.arange(10.0, 36.0, 5.0, dtype=np.float32)
    driver = instant.vehicles.at_slots(0)
    accel = expected_accel(instant.params.constants, driver, leader, leader + np.float32(10.0))
    durations = time_to_gain(np.float32(60.0), 0.0 * leader, np.full_like(leader, 10.0), accel)
    assert (np.diff(durations) >= 0.0).all()
    assert durations[-1] > 1.2 * durations[0]


def test_speed_limit_compliance_is_the_same_while_passing():
    instant = traffic_instant(
        [Vehicle(kind="M", body={"max_speed": 60.0}, driver={"desired_speed": 20.0})]
    )
    leader = np.arange(8.0, 40.0, 4.0, dtype=np.float32)
    limit, surplus = np.float32(25.0), np.float32(10.0)
    ignoring, half, complying = (
        passing_speed(
            instant.vehicles.at_slots(0)._replace(
                speed_limit=limit, speed_limit_compliance=np.float32(share)
            ),
            surplus,
            leader,
        )
        for share in (0.0, 0.5, 1.0)
    )
    np.testing.assert_array_equal(
        ignoring, np.maximum(leader + surplus, instant.vehicles.at_slots(0).passing_speed)
    )
    np.testing.assert_array_equal(complying, np.minimum(ignoring, limit))
    np.testing.assert_allclose(half, (ignoring + complying) / 2, rtol=1e-6)
