"""Lateral paths against linear algebra, and drivers that keep and change lanes on a bench."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.bench import DECISION, RECORDED, Bench, bench
from tests.support.worlds import FOUR_WHEELERS, Vehicle

from overtaking.sim.reference import steering

SPEEDS = {"S": 33.0, "M": 33.0, "L": 33.0, "V": 30.0, "T": 24.0, "MC": 33.0}
"""Largest speeds of the classes in the study of Pinto et al. (2023) [m/s]."""

LANE_WIDTH = 3.5


def quintic(start: tuple[float, float, float], end: float, duration: float) -> np.ndarray:
    """Coefficients of the path from a state to rest at `end`, by solving six equations."""
    t = duration
    rows = np.array(
        [
            [1, 0, 0, 0, 0, 0],
            [0, 1, 0, 0, 0, 0],
            [0, 0, 2, 0, 0, 0],
            [1, t, t**2, t**3, t**4, t**5],
            [0, 1, 2 * t, 3 * t**2, 4 * t**3, 5 * t**4],
            [0, 0, 2, 6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    return np.linalg.solve(rows, np.array([*start, end, 0.0, 0.0]))


def follow_path(b: Bench, time: float) -> tuple[float, float, float]:
    b.state.path.elapsed = np.full_like(b.state.path.elapsed, time)
    d, speed = (float(part[0, 0]) for part in steering.path_point(b.state))
    return d, speed, float(steering.path_accel(b.state)[0, 0])


@pytest.mark.ci
@given(
    end=st.floats(-8.0, 8.0), duration=st.floats(2.5, 12.0), turn_share=st.floats(0.0, 1.0),
    back_end=st.floats(-8.0, 8.0), back_duration=st.floats(2.5, 12.0), share=st.floats(0.0, 1.0),
)  # fmt: skip
def test_a_path_is_the_quintic_from_the_present_point_of_the_last_path(
    end: float,
    duration: float,
    turn_share: float,
    back_end: float,
    back_duration: float,
    share: float,
):
    b = bench(Vehicle())
    b.state.path.coefficients[:] = 0.0
    all_vehicles = np.ones_like(b.state.motion.s, bool)
    zero = np.zeros_like(b.state.motion.s)
    steering.start_path(b.state, all_vehicles, zero + np.float32(end), zero + np.float32(duration))
    start = follow_path(b, turn_share * duration)
    steering.start_path(
        b.state, all_vehicles, zero + np.float32(back_end), zero + np.float32(back_duration)
    )
    np.testing.assert_allclose(
        follow_path(b, 0.0), start, atol=1e-5
    )  # No jump in position, speed or acceleration.
    expected = np.polynomial.Polynomial(quintic(start, back_end, back_duration))
    d, speed, accel = follow_path(b, share * back_duration)
    t = share * back_duration
    # Float32 coefficients, and powers of up to 12 s.
    assert d == pytest.approx(expected(t), abs=2e-3)
    assert speed == pytest.approx(expected.deriv()(t), abs=2e-3)
    assert accel == pytest.approx(expected.deriv(2)(t), abs=4e-3)


def test_a_path_stays_at_its_end():
    b = bench(Vehicle())
    b.state.path.coefficients[:] = 0.0
    zero = np.zeros_like(b.state.motion.s)
    steering.start_path(b.state, zero == 0, zero + 3.5, zero + 4.0)
    assert follow_path(b, 4.0) == pytest.approx((3.5, 0.0, 0.0), abs=1e-5)
    assert follow_path(b, 400.0) == pytest.approx((3.5, 0.0, 0.0), abs=1e-5)


@pytest.mark.parametrize("duration", [3.0, 5.0, 7.0])
def test_the_peaks_of_a_lane_change_are_those_of_the_literature(duration: float):
    # Peak speed 1.875 D / T and peak acceleration 5.77 D / T^2 of a quintic from rest to rest.
    b = bench(Vehicle())
    b.state.path.coefficients[:] = 0.0
    zero = np.zeros_like(b.state.motion.s)
    steering.start_path(b.state, zero == 0, zero + LANE_WIDTH, zero + duration)
    rows = np.array([follow_path(b, t) for t in np.linspace(0.0, duration, 401)])
    assert rows[:, 1].max() == pytest.approx(1.875 * LANE_WIDTH / duration, rel=1e-3)
    assert rows[:, 2].max() == pytest.approx(5.77 * LANE_WIDTH / duration**2, rel=2e-3)


def drive(b: Bench, duration: float) -> dict[str, np.ndarray]:
    """Let the driver steer at constant speed, without wandering."""
    rows = {name: [] for name in RECORDED}
    for k in range(round(duration / DECISION)):
        b.decide()
        steering.update_wind_trim(b.state, b.params, k)
        motion = b.drive_one(b.steer(np.full_like(b.simulations.max_lateral_accel, 4.0)))
        for name, values in rows.items():
            values.append(motion[name])
    return {name: np.array(values) for name, values in rows.items()}


@pytest.mark.parametrize("kind", SPEEDS)
def test_every_class_returns_to_its_lane_without_weaving(kind: str):
    b = bench(Vehicle(kind=kind, speed=SPEEDS[kind]))
    centre = float(b.state.motion.d[0, 0])
    b.state.motion.d = b.state.motion.d + np.float32(0.5)
    offset = drive(b, 15.0)["d"] - centre
    # With a damping ratio of 0.4 the overshoot is a quarter of the step; weaving would grow.
    assert offset.min() > -0.25 * 0.5
    assert np.abs(offset[160:]).max() < 0.05
    assert np.abs(offset[240:]).max() < 0.02


@pytest.mark.ci
@pytest.mark.parametrize("kind", SPEEDS)
def test_a_lane_change_ends_in_the_lane(kind: str):
    duration = 6.5 if kind == "T" else 5.0  # Lorries take 1.3 times as long.
    b = bench(Vehicle(kind=kind, speed=SPEEDS[kind]))
    centre = b.state.motion.d.copy()
    zero = np.zeros_like(centre)
    steering.start_path(b.state, zero == 0, centre + LANE_WIDTH, zero + np.float32(duration))
    motion = drive(b, 16.0)
    d = motion["d"] - float(centre[0, 0])
    # The driver requests the path earlier, by the delay of wheels and tyres.
    assert d.max() < LANE_WIDTH + (0.1 if kind == "T" else 0.06)
    assert np.abs(d[260:] - LANE_WIDTH).max() < 0.05
    assert np.abs(motion["accel_lat"]).max() < 1.2 * 5.77 * LANE_WIDTH / duration**2


@pytest.mark.ci
@pytest.mark.parametrize("kind", FOUR_WHEELERS)
def test_a_steady_gale_is_steered_out(kind: str):
    sky = {"wind": 60.0, "wind_direction": math.pi / 2.0}
    b = bench(Vehicle(kind=kind, speed=SPEEDS[kind]), sky=sky)
    centre = float(b.state.motion.d[0, 0])
    offset = drive(b, 10.0)["d"] - centre
    # 12 m/s from the side: the driver compensates it from the first frame on, wheel and crab angle
    # follow within a second. Drivers do not correct the last decimetres.
    assert np.abs(offset).max() < 0.4
    assert np.abs(offset[160:]).max() < 0.2


@pytest.mark.parametrize("kind", FOUR_WHEELERS)
def test_a_sudden_side_wind_blows_aside_and_is_then_steered_out(kind: str):
    sky = {"wind": 60.0, "wind_direction": math.pi / 2.0}
    b = bench(Vehicle(kind=kind, speed=SPEEDS[kind]), sky=sky)
    centre = float(b.state.motion.d[0, 0])
    had_wind = b.updates_wind
    b.updates_wind = False
    drive(b, 0.5)
    b.updates_wind = had_wind
    b.decide()
    offset = drive_after_start(b, 12.0) - centre
    # Drivers compensate after 0.4 s, so the wind displaces vehicles, high ones more.
    assert 0.05 < offset.max() < 1.0
    assert np.abs(offset[200:]).max() < 0.2


def drive_after_start(b: Bench, duration: float) -> np.ndarray:
    """As `drive`, but after the first decision, at which drivers compensate the wind at once."""
    lateral_positions = []
    for k in range(round(duration / DECISION)):
        b.decide()
        steering.update_wind_trim(b.state, b.params, k + 1)
        lateral_positions.append(
            b.drive_one(b.steer(np.full_like(b.simulations.max_lateral_accel, 4.0)))["d"]
        )
    return np.array(lateral_positions)


def test_wheels_turn_within_their_rate_and_largest_angle():
    b = bench(Vehicle(speed=20.0))
    b.state.motion.d = b.state.motion.d + np.float32(30.0)
    before = 0.0
    for _ in range(60):
        middle = b.steer(np.full_like(b.simulations.max_lateral_accel, 50.0))
        wheel = float(b.state.controls.wheel_angle[0, 0])
        assert abs(wheel - before) <= 0.4 * DECISION + 1e-6
        assert float(middle[0, 0]) == pytest.approx(0.5 * (wheel + before), abs=1e-6)
        assert abs(wheel) <= 0.5 + 1e-6
        before = wheel


def test_a_sliding_car_is_steered_into_the_slide():
    # The car yaws to the left and slides to the right by 20 degrees (vy < 0). Its path is on the
    # left, but the front wheels turn to the right, into the slide.
    b = bench(Vehicle(speed=25.0), friction=0.4)
    b.state.motion.d = b.state.motion.d - np.float32(1.0)
    b.state.motion.vy = np.full_like(b.state.motion.vy, -9.0)
    b.state.motion.yaw_rate = np.full_like(b.state.motion.yaw_rate, 0.3)
    for _ in range(20):
        b.steer(np.full_like(b.simulations.max_lateral_accel, 3.0))
    slip = (-9.0 + 0.3 * float(b.vehicles.cg_front[0, 0])) / 25.0
    wheel = float(b.state.controls.wheel_angle[0, 0])
    assert wheel < 0.0
    # At most two thirds of the slip at which the tyre slides, 3 mu / C, after five time constants
    # of the wheels.
    assert wheel - slip <= 2.0 * 0.4 / float(b.vehicles.front_stiffness[0, 0]) + 0.01


def test_a_wreck_is_not_steered():
    b = bench(Vehicle(speed=20.0))
    b.state.motion.is_wreck = np.ones_like(b.state.motion.is_wreck)
    b.state.motion.d = b.state.motion.d + np.float32(2.0)
    assert float(b.steer(np.full_like(b.simulations.max_lateral_accel, 4.0))[0, 0]) == 0.0
    assert float(b.state.controls.wheel_angle[0, 0]) == 0.0
