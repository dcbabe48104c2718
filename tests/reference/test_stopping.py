"""Stopping distances against closed forms, and quadrature where friction falls with speed."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import RegularGridInterpolator
from tests.support.bench import Bench, bench
from tests.support.knowledge import numbers_of
from tests.support.worlds import FOUR_WHEELERS, Vehicle, body_of

from overtaking.world.road_surface import stoppable_speed, stopping_distance

GRAVITY = 9.81
ANTI_LOCK = 0.95

# The step in which a vehicle comes to rest has the full length, and the last 0.1 m/s vanish at
# once: together below 0.1 m of 12 to 600 m.
SAME = 0.01

NO_RESISTANCE = {"drag_area": 0.0, "rolling_resistance": 0.0}


def stop(b: Bench, duration: float) -> np.ndarray:
    """Distance travelled with the brakes fully on, (simulation,) [m]."""
    run = b.drive(duration, lambda test, _: test.hold(accel=-50.0))
    assert (run["vx"][-1] == 0.0).all()
    return run["s"][-1] - run["s"][0]


def test_full_braking_takes_v_squared_over_2_mu_g():
    cases = list(product(FOUR_WHEELERS, (0.8, 0.5, 0.3), (12.0, 25.0, 35.0)))
    vehicles = [Vehicle(kind=kind, speed=speed, body=NO_RESISTANCE) for kind, _, speed in cases]
    run = stop(bench(*vehicles, friction=[friction for _, friction, _ in cases]), 14.0)
    expected = [
        speed**2 / 2.0 / min(ANTI_LOCK * friction * GRAVITY, body_of(kind)["peak_decel"])
        for kind, friction, speed in cases
    ]
    np.testing.assert_allclose(run, expected, rtol=SAME)


def test_weak_brakes_take_v_squared_over_twice_their_deceleration():
    weak = NO_RESISTANCE | {"peak_decel": 4.0}
    vehicles = [Vehicle(kind=kind, speed=30.0, body=weak) for kind in FOUR_WHEELERS]
    np.testing.assert_allclose(stop(bench(*vehicles), 9.0), 30.0**2 / (2.0 * 4.0), rtol=SAME)


def test_constant_braking_covers_the_distance_of_the_textbook_to_the_millimetre():
    # v t - b t^2 / 2: the mean of old and new speed is exact at constant force, whatever the step.
    run = bench(Vehicle(speed=30.0, body=NO_RESISTANCE | {"peak_decel": 4.0})).drive(
        5.0, lambda test, _: test.hold(accel=-50.0)
    )
    expected = 30.0 * run["t"] - 0.5 * 4.0 * run["t"] ** 2
    np.testing.assert_allclose(run["s"][:, 0], expected, atol=2e-3)


def test_drag_shortens_the_stopping_distance_by_the_closed_form():
    # m dv/dt = -(B + k v^2) stops within m / (2 k) ln(1 + k v^2 / B).
    friction, speed = 0.3, 35.0
    bodies = {name: [body_of(kind)[name] for kind in FOUR_WHEELERS] for name in body_of("S")}
    mass = np.array(bodies["mass"])
    k = 0.5 * 1.2 * np.array(bodies["drag_area"])
    rolling = np.array(bodies["rolling_resistance"]) * mass * GRAVITY
    brakes = ANTI_LOCK * friction * mass * GRAVITY + rolling
    expected = mass / (2.0 * k) * np.log1p(k * speed**2 / brakes)
    vehicles = [Vehicle(kind=kind, speed=speed) for kind in FOUR_WHEELERS]
    np.testing.assert_allclose(stop(bench(*vehicles, friction=friction), 14.0), expected, rtol=SAME)


def wet_friction(speed: float, film_mm: float) -> float:
    """The handbook's table for a new car tyre, linear between its knots, by SciPy."""
    table = numbers_of("friction.toml").table
    grid = RegularGridInterpolator((table.speeds, table.films_mm), table.new)
    inside = float(np.clip(speed, table.speeds[0], table.speeds[-1]))
    return max(float(grid((inside, film_mm))), table.floor)


def braking_distance(speed: float, film_mm: float) -> float:
    """Integral of v dv / b(v) [m]."""
    decel = lambda v: ANTI_LOCK * GRAVITY * wet_friction(v, film_mm)  # noqa: E731
    knots = [v for v in numbers_of("friction.toml").table.speeds if v < speed]
    return quad(lambda v: v / decel(v), 0.0, speed, epsrel=1e-4, points=knots)[0]


@pytest.mark.ci
def test_on_a_film_the_distance_is_the_integral_over_the_table():
    cases = list(product((0.0, 0.2, 0.6, 1.0, 1.5), (20.0, 30.0, 36.0)))
    body = NO_RESISTANCE | {"peak_decel": 20.0}
    b = bench(*[Vehicle(speed=speed, body=body) for _, speed in cases], friction=None)
    b.simulations.min_wet_film[:] = np.array([film_mm for film_mm, _ in cases], np.float32)
    expected = [braking_distance(speed, film_mm) for film_mm, speed in cases]
    np.testing.assert_allclose(stop(b, 20.0), expected, rtol=SAME)


@pytest.mark.parametrize(("friction", "metres"), [(0.76, 125.0), (0.56, 151.0), (0.32, 227.0)])
def test_the_stopping_distance_from_120_kmh_equals_the_value_worked_out_by_hand(
    friction: float, metres: float
):
    # 1.5 s at 33.3 m/s, then v^2 / (2 mu g); rounded to a metre.
    decel = np.float32(friction * GRAVITY)
    value = stopping_distance(np.float32(120.0 / 3.6), np.float32(1.5), decel)
    assert float(value) == pytest.approx(metres, abs=0.6)


def test_the_stoppable_speed_is_the_inverse_of_the_stopping_distance():
    speed, time, decel = np.meshgrid([5.0, 20.0, 40.0], [0.5, 1.2, 2.5], [1.0, 4.0, 8.0])
    inputs = [part.astype(np.float32) for part in (speed, time, decel)]
    distance = stopping_distance(*inputs)
    # Float32: the square root of a difference loses two digits of seven at worst.
    np.testing.assert_allclose(stoppable_speed(distance, inputs[1], inputs[2]), speed, rtol=2e-5)
