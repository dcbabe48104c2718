"""How drivers who pass against oncoming traffic reckon."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.support.minds import moment
from tests.support.worlds import Vehicle, body_of

from overtaking.sim.reference.passing import expected_accel, passing_speed, time_to_gain

GRAVITY, AIR_DENSITY, USABLE_POWER = 9.81, 1.2, 0.9


def time_to_reach(kind: str, begin: float, end: float) -> float:
    """How long a vehicle takes that uses all of its engine, by an integration of its own [s]."""
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
def test_drivers_reckon_with_what_their_engine_has_at_the_speed_of_passing(kind, begin, end):
    m = moment([Vehicle(kind=kind, driver={"accel": 9.0})])
    given, own = m.given.constants, m.p.at_slots(0)
    speed, top = (np.array([one], np.float32) for one in (begin, end))
    accel = expected_accel(given, own, speed, top)
    taken = (end - begin) / float(accel[0])
    assert taken == pytest.approx(time_to_reach(kind, begin, end), rel=0.05)
    # Who likes less than that uses less.
    m = moment([Vehicle(kind=kind, driver={"accel": 0.2})])
    liked = expected_accel(given, m.p.at_slots(0), speed, top)
    assert float(liked[0]) == pytest.approx(given.accelerate_gain * 0.2, rel=1e-6)


def test_the_same_way_takes_longer_past_who_is_faster():
    m = moment([Vehicle(kind="M", driver={"accel": 2.0})])
    leader = np.arange(10.0, 36.0, 5.0, dtype=np.float32)
    own = m.p.at_slots(0)
    accel = expected_accel(m.given.constants, own, leader, leader + np.float32(10.0))
    needed = time_to_gain(np.float32(60.0), 0.0 * leader, np.full_like(leader, 10.0), accel)
    assert (np.diff(needed) >= 0.0).all()
    assert needed[-1] > 1.2 * needed[0]


def test_who_heeds_the_limit_heeds_it_as_much_while_passing():
    m = moment([Vehicle(kind="M", body={"max_speed": 60.0}, driver={"desired_speed": 20.0})])
    leader = np.arange(8.0, 40.0, 4.0, dtype=np.float32)
    limit, surplus = np.float32(25.0), np.float32(10.0)
    careless, half, heedful = (
        passing_speed(
            m.p.at_slots(0)._replace(speed_limit=limit, speed_limit_compliance=np.float32(share)),
            surplus,
            leader,
        )
        for share in (0.0, 0.5, 1.0)
    )
    np.testing.assert_array_equal(
        careless, np.maximum(leader + surplus, m.p.at_slots(0).passing_speed)
    )
    np.testing.assert_array_equal(heedful, np.minimum(careless, limit))
    np.testing.assert_allclose(half, (careless + heedful) / 2, rtol=1e-6)
