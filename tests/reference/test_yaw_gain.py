"""Steady turns against the textbook's closed form of the single-track model."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.worlds import FOUR_WHEELERS, Vehicle, body_of

GRAVITY = 9.81

# At the lateral acceleration of 0.1 m/s^2 chosen here Fiala's tyre is 0.4 % softer at most, and a
# steady state does not depend on the step.
LATERAL = 0.1
SAME = 0.01


def understeer(kind: str) -> float:
    """K in delta = l / R + K a_y / g [rad]: load over stiffness, front minus rear."""
    body = body_of(kind)
    return 1.0 / body["front_stiffness"] - 1.0 / body["rear_stiffness"]


def steady_yaw_gains(cases: list[tuple[str, float]], **body: float) -> np.ndarray:
    """Yaw rate over wheel angle of each class at each speed, once the turn is steady [1/s]."""
    strong = {"max_speed": 100.0, "power": 1e9} | body
    vehicles = [Vehicle(kind=kind, speed=speed, body=strong) for kind, speed in cases]
    wheel = np.array(
        [
            LATERAL * (body_of(kind)["wheelbase"] / speed**2 + understeer(kind) / GRAVITY)
            for kind, speed in cases
        ]
    )
    run = bench(*vehicles).drive(12.0, lambda b, _: b.hold(wheel=wheel))
    np.testing.assert_allclose(run["yaw_rate"][-1], run["yaw_rate"][-20], rtol=1e-3)
    return run["yaw_rate"][-1] / wheel


def test_the_yaw_gain_is_v_over_l_plus_k_v_squared_over_g():
    cases = list(product(FOUR_WHEELERS, (10.0, 20.0, 30.0, 40.0)))
    expected = [
        speed / (body_of(kind)["wheelbase"] + understeer(kind) * speed**2 / GRAVITY)
        for kind, speed in cases
    ]
    np.testing.assert_allclose(steady_yaw_gains(cases), expected, rtol=SAME)


def test_at_the_characteristic_speed_the_yaw_gain_is_half_of_a_neutral_vehicle():
    wheelbases = [body_of(kind)["wheelbase"] for kind in FOUR_WHEELERS]
    speeds = [
        math.sqrt(GRAVITY * wheelbase / understeer(kind))
        for kind, wheelbase in zip(FOUR_WHEELERS, wheelbases, strict=True)
    ]
    expected = np.array(speeds) / np.array(wheelbases) / 2.0
    gains = steady_yaw_gains(list(zip(FOUR_WHEELERS, speeds, strict=True)))
    np.testing.assert_allclose(gains, expected, rtol=SAME)


@pytest.mark.parametrize(
    ("kind", "degrees"), [("S", 1.6), ("M", 1.7), ("L", 1.6), ("V", 1.6), ("T", 0.9)]
)
def test_every_class_has_its_understeer_angle(kind: str, degrees: float):
    assert math.degrees(understeer(kind)) == pytest.approx(degrees, abs=0.07)


def test_a_neutral_vehicle_turns_as_its_wheels_point():
    cases = list(product(FOUR_WHEELERS, (15.0, 30.0)))
    expected = [speed / body_of(kind)["wheelbase"] for kind, speed in cases]
    gains = steady_yaw_gains(cases, front_stiffness=15.0, rear_stiffness=15.0)
    np.testing.assert_allclose(gains, expected, rtol=SAME)
