"""Stability control: it takes back a yaw rate that the wheel does not ask for, and no other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.worlds import Vehicle

from overtaking.sim.reference import vehicle_dynamics

THRESHOLD = 0.06
SPEED = 30.0


def moment(r: float, wheel: float = 0.0, friction: float = 0.9) -> float:
    """The yaw moment at 30 m/s, as a share of the largest."""
    b = bench(Vehicle(speed=SPEED), friction=friction)
    given = replace(b.given, constants=b.c.replace(stability_threshold=THRESHOLD))
    b.state.motion.yaw_rate[:] = r
    angle = np.full_like(b.state.motion.s, wheel)
    found = float(
        vehicle_dynamics._stability_control(b.state, given, b.state.motion.vx, angle)[0, 0]
    )
    wheel_force = friction * 9.81 * float(b.p.mass[0, 0]) / 4.0
    return found / (wheel_force * float(b.p.half_track[0, 0]))


def test_a_yaw_rate_near_what_the_wheel_asks_for_is_left_alone():
    b = bench(Vehicle(speed=SPEED))
    understeer, wheelbase = float(b.p.understeer[0, 0]), float(b.p.wheelbase[0, 0])
    asked = SPEED * 0.01 / (wheelbase + understeer * SPEED**2)
    for off in (-0.9, 0.0, 0.9):
        assert moment(asked + off * THRESHOLD, wheel=0.01) == 0.0
    assert moment(asked + 1.1 * THRESHOLD, wheel=0.01) < 0.0 < moment(asked - 1.1 * THRESHOLD, 0.01)


@pytest.mark.parametrize("friction", [0.9, 0.3])
def test_it_brakes_one_wheel_at_most(friction: float):
    assert moment(2.0, friction=friction) == pytest.approx(-1.0, rel=1e-5)
    assert moment(-2.0, friction=friction) == pytest.approx(1.0, rel=1e-5)


def test_more_than_friction_allows_is_not_asked_for():
    # At 30 m/s and mu 0.3 a vehicle turns with 0.098 rad/s, however far the wheel is turned.
    reach = 0.3 * 9.81 / SPEED
    assert moment(reach + 0.9 * THRESHOLD, wheel=0.3, friction=0.3) == 0.0
    assert moment(reach + 1.1 * THRESHOLD, wheel=0.3, friction=0.3) < 0.0


def test_a_skid_ends_sooner():
    left = {}
    for threshold in (THRESHOLD, 1e9):
        b = bench(Vehicle(speed=SPEED), friction=0.3)
        constants = b.c.replace(stability_threshold=threshold)
        b = replace(b, given=replace(b.given, constants=constants))
        b.state.motion.yaw_rate[:] = 0.5
        for _ in range(20):
            b.move(np.zeros_like(b.state.motion.s))
        left[threshold] = abs(float(b.state.motion.yaw_rate[0, 0]))
    assert left[THRESHOLD] < 0.8 * left[1e9]
