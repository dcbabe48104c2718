"""Recorded numbers are rounded once, have the right signs and lights, and are hashed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.model.trajectories import Lights
from overtaking.sim import engine
from overtaking.sim.reference.recorder import to_recorded_integers, wrap_angle


@given(st.floats(-1e5, 1e5))
def test_numbers_are_rounded_once_half_to_even(value: float):
    x = np.float32(value)
    scaled = x * np.float32(1000.0)
    assert int(to_recorded_integers(x, np.float32(1000.0))) == round(float(scaled))


def test_ties_go_to_the_even_number():
    halves = np.array([0.5, 1.5, 2.5, -0.5, -1.5], np.float32)
    np.testing.assert_array_equal(to_recorded_integers(halves, np.float32(1.0)), [0, 2, 2, 0, -2])


def test_numbers_beyond_the_type_are_clamped():
    large_values = np.array([1e9, -1e9], np.float32)
    limit = np.float32(32767.0)
    np.testing.assert_array_equal(
        to_recorded_integers(large_values, np.float32(1e4), limit), [32767, -32767]
    )


@given(st.floats(-100.0, 100.0))
def test_angles_are_wrapped_into_one_turn(angle: float):
    value = float(wrap_angle(np.float32(angle)))
    # Pi in float32 is above pi by 1e-7; 16 turns of rounding.
    assert -math.pi - 1e-5 <= value <= math.pi + 1e-5
    assert math.cos(value) == pytest.approx(math.cos(np.float32(angle)), abs=2e-5)
    assert math.sin(value) == pytest.approx(math.sin(np.float32(angle)), abs=2e-5)


def lights_of(weather: dict[str, float], kind: str = "M") -> int:
    vehicles = [Vehicle(speed=25.0), Vehicle(kind=kind, s=2000.0, speed=20.0)]
    world = scenario(vehicles, road=wide_road(), weather=weather, horizon=0.1)
    return int(engine.simulate(world).states.lights[0, 1, 0])


@pytest.mark.parametrize(
    ("weather", "expected"),
    [
        ({}, 0),
        ({"night": 1.0}, Lights.LOW_BEAM),
        ({"rain": 30.0}, Lights.LOW_BEAM),
        ({"fog": 60.0}, 0),
        ({"fog": 95.0}, Lights.LOW_BEAM | Lights.REAR_FOG),
    ],
)
def test_lamps_are_lit_at_night_in_rain_and_in_thick_fog(weather: dict[str, float], expected: int):
    lamps = Lights.LOW_BEAM | Lights.HIGH_BEAM | Lights.REAR_FOG
    assert lights_of(weather) & lamps == expected


def test_bicycles_have_no_lamps():
    assert lights_of({"night": 1.0}, kind="B") & Lights.LOW_BEAM == 0


def test_stop_lamps_show_braking():
    driver = {"desired_speed": 30.0, "reaction_time": 0.5}
    cars = [Vehicle(s=0.0, speed=30.0, driver=driver), Vehicle(s=60.0, speed=15.0)]
    recording = engine.simulate(scenario(cars, road=wide_road(lanes=1), horizon=6.0))
    frames = int(recording.num_frames[0])
    lit = (recording.states.lights[0, 0, :frames] & Lights.BRAKE) > 0
    accel = recording.states.accel_lon[0, 0, :frames] / 1000.0
    assert lit.any()
    assert not lit.all()
    # The request of one frame acts until the next frame.
    assert (accel[1:][lit[:-1]] < -0.3).mean() > 0.95
    assert (accel[1:][~lit[:-1]] > -0.7).all()


def test_a_vehicle_that_turns_left_is_recorded_with_positive_signs():
    # A gale pushes a van to the left: d grows, and the heading turns anticlockwise.
    weather = {"wind": 100.0, "wind_direction": math.pi / 2.0}
    world = scenario(
        [Vehicle(kind="V", lane=0, speed=30.0)], road=wide_road(lanes=5), weather=weather
    )
    recording = engine.simulate(world)
    d = recording.states.d[0, 0, : recording.num_frames[0]].astype(float)
    heading, y = (
        getattr(recording.states, name)[0, 0, : recording.num_frames[0]]
        for name in ("heading", "y")
    )
    # The road runs along x, so y is d. Where d grows fast, the heading points to the left.
    np.testing.assert_array_equal(y, d)
    rising = np.gradient(d) > 20.0
    assert rising.any()
    assert heading[rising].mean() > heading[~rising].mean()


def test_a_trace_hash_differs_for_every_simulation():
    world = scenario(*[[Vehicle(speed=20.0 + k)] for k in range(16)], horizon=1.0)
    hashes = {tuple(row) for row in engine.simulate(world).trace_hash.tolist()}
    assert len(hashes) == 16


def test_empty_slots_do_not_change_the_hash():
    cars = [Vehicle(s=0.0), Vehicle(s=50.0)]
    with_two_slots = engine.simulate(scenario(cars, num_slots=2, horizon=2.0))
    with_eight_slots = engine.simulate(scenario(cars, num_slots=8, horizon=2.0))
    np.testing.assert_array_equal(with_two_slots.trace_hash, with_eight_slots.trace_hash)
