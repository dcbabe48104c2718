"""Stability control corrects only a yaw rate that the wheel angle does not request."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.worlds import Vehicle

from overtaking.sim.reference import vehicle_dynamics

THRESHOLD = 0.06
SPEED = 30.0


def yaw_moment_share(yaw_rate: float, wheel: float = 0.0, friction: float = 0.9) -> float:
    """Yaw moment of stability control at 30 m/s, as a share of the largest moment."""
    b = bench(Vehicle(speed=SPEED), friction=friction)
    params = replace(b.params, constants=b.constants.replace(stability_threshold=THRESHOLD))
    b.state.motion.yaw_rate[:] = yaw_rate
    angle = np.full_like(b.state.motion.s, wheel)
    yaw_moment = float(
        vehicle_dynamics._stability_control(b.state, params, b.state.motion.vx, angle)[0, 0]
    )
    wheel_force = friction * 9.81 * float(b.vehicles.mass[0, 0]) / 4.0
    return yaw_moment / (wheel_force * float(b.vehicles.half_track[0, 0]))


def test_stability_control_ignores_small_errors_of_the_yaw_rate():
    b = bench(Vehicle(speed=SPEED))
    understeer, wheelbase = float(b.vehicles.understeer[0, 0]), float(b.vehicles.wheelbase[0, 0])
    requested_rate = SPEED * 0.01 / (wheelbase + understeer * SPEED**2)
    for off in (-0.9, 0.0, 0.9):
        assert yaw_moment_share(requested_rate + off * THRESHOLD, wheel=0.01) == 0.0
    assert (
        yaw_moment_share(requested_rate + 1.1 * THRESHOLD, wheel=0.01)
        < 0.0
        < yaw_moment_share(requested_rate - 1.1 * THRESHOLD, 0.01)
    )


@pytest.mark.parametrize("friction", [0.9, 0.3])
def test_stability_control_brakes_at_most_one_wheel(friction: float):
    assert yaw_moment_share(2.0, friction=friction) == pytest.approx(-1.0, rel=1e-5)
    assert yaw_moment_share(-2.0, friction=friction) == pytest.approx(1.0, rel=1e-5)


def test_the_reference_yaw_rate_is_limited_by_friction():
    # At 30 m/s and mu 0.3 a vehicle turns with 0.098 rad/s, however far the wheel is turned.
    friction_rate = 0.3 * 9.81 / SPEED
    assert yaw_moment_share(friction_rate + 0.9 * THRESHOLD, wheel=0.3, friction=0.3) == 0.0
    assert yaw_moment_share(friction_rate + 1.1 * THRESHOLD, wheel=0.3, friction=0.3) < 0.0


def test_a_skid_ends_sooner():
    remaining_rate = {}
    for threshold in (THRESHOLD, 1e9):
        b = bench(Vehicle(speed=SPEED), friction=0.3)
        constants = b.constants.replace(stability_threshold=threshold)
        b = replace(b, params=replace(b.params, constants=constants))
        b.state.motion.yaw_rate[:] = 0.5
        for _ in range(20):
            b.move(np.zeros_like(b.state.motion.s))
        remaining_rate[threshold] = abs(float(b.state.motion.yaw_rate[0, 0]))
    assert remaining_rate[THRESHOLD] < 0.8 * remaining_rate[1e9]
