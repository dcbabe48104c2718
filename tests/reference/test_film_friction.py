"""Water and grip: the handbook's table by SciPy, Gallaway's film, figures worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from tests.support.bench import bench
from tests.support.knowledge import numbers_of
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.world import road_surface
from overtaking.world.constants import model_constants
from overtaking.world.step_parameters import step_parameters

KMH = 1.0 / 3.6

# Peak friction of car tyres at 50, 90 and 130 km/h (rows) on 0, 0.2, 1 and 2 mm of water (columns),
# from the Bosch Automotive Handbook: new tyres, and tyres worn to 1.6 mm.
HANDBOOK_SPEEDS = (50.0 * KMH, 90.0 * KMH, 130.0 * KMH)
HANDBOOK_FILMS = (0.0, 0.2, 1.0, 2.0)
NEW = ((0.85, 0.65, 0.55, 0.50), (0.80, 0.60, 0.30, 0.05), (0.75, 0.55, 0.20, 0.0))
WORN = ((1.00, 0.50, 0.40, 0.25), (0.95, 0.20, 0.10, 0.05), (0.90, 0.20, 0.10, 0.0))
FLOOR = 0.05


def handbook(speed: float, film_mm: float, wear: float) -> float:
    """Bilinear in speed and film, linear in wear, clamped outside."""
    point = (
        float(np.clip(speed, HANDBOOK_SPEEDS[0], HANDBOOK_SPEEDS[-1])),
        float(np.clip(film_mm, HANDBOOK_FILMS[0], HANDBOOK_FILMS[-1])),
    )
    grids = [
        RegularGridInterpolator((HANDBOOK_SPEEDS, HANDBOOK_FILMS), rows) for rows in (NEW, WORN)
    ]
    new, worn = (float(grid(point)) for grid in grids)
    return max(new + wear * (worn - new), FLOOR)


def model(speed: float, film_mm: float, wear: float, truck: float = 0.0) -> float:
    numbers = [np.float32(x) for x in (speed, film_mm, wear, truck)]
    return float(road_surface.peak_friction(model_constants(), *numbers))


@given(speed=st.floats(0.0, 60.0), film_mm=st.floats(0.0, 4.0), wear=st.floats(0.0, 1.0))
def test_friction_is_the_handbooks_table_linear_between_its_knots(
    speed: float, film_mm: float, wear: float
):
    # Float32: differences of knots, divided by as little as 0.2 mm.
    assert model(speed, film_mm, wear) == pytest.approx(handbook(speed, film_mm, wear), abs=2e-6)


@pytest.mark.ci
def test_friction_rises_with_speed_or_water_only_as_in_the_table_of_the_handbook():
    speeds = np.linspace(0.0, 45.0, 91)
    for film_mm in np.linspace(0.0, 3.0, 31):
        for truck in (0.0, 1.0):
            values = [model(v, film_mm, 0.4, truck) for v in speeds]
            assert (np.diff(values) <= 1e-6).all()
    for speed in speeds[::10]:
        values = [model(speed, h, 0.4) for h in np.linspace(0.0, 3.0, 61)]
        assert (np.diff(values) <= 1e-6).all()


@pytest.mark.parametrize("speed", [10.0, 20.0, 30.0])
def test_lorry_tyres_have_less_grip_when_dry_and_lose_half_as_much_in_deep_water(speed: float):
    assert model(speed, 0.0, 0.0, 1.0) == pytest.approx(0.85 * model(speed, 0.0, 0.0), rel=1e-6)
    assert model(speed, 0.2, 0.0, 1.0) == pytest.approx(model(speed, 0.2, 0.0), rel=1e-6)
    slow = model(HANDBOOK_SPEEDS[0], 1.0, 0.0)
    loss = slow - model(speed, 1.0, 0.0)
    assert model(speed, 1.0, 0.0, 1.0) == pytest.approx(slow - 0.5 * loss, abs=1e-6)


# Peak friction of a new tyre at 50, 90 and 120 km/h, worked out by others from the same table, rain
# scale and Gallaway film; two digits.
WORKED_OUT = [
    (30.0, 7.0, 0.0, (0.65, 0.60, 0.56)),
    (60.0, 7.0, 0.0, (0.65, 0.60, 0.56)),
    (90.0, 7.0, 0.0, (0.61, 0.47, 0.41)),
    (100.0, 7.0, 0.0, (0.58, 0.38, 0.32)),
    (100.0, 17.5, 0.0, (0.52, 0.16, 0.11)),
    (100.0, 7.0, 1.0, (0.43, 0.13, 0.13)),
]


@pytest.mark.parametrize(("rain", "path", "wear", "expected"), WORKED_OUT)
def test_the_grip_in_rain_equals_values_worked_out_by_hand(
    rain: float, path: float, wear: float, expected: tuple[float, ...]
):
    water = road_surface.lane_film(
        np.float32(0.2),
        road_surface.film_rain_factor(road_surface.rain_rate(np.float32(rain))),
        road_surface.film_path_factor(np.float32(path)),
        np.float32(0.8),
    )
    grip = [model(v * KMH, float(water), wear) for v in (50.0, 90.0, 120.0)]
    # Rounding of the figures, and of the texture depth that they were made with.
    np.testing.assert_allclose(grip, expected, atol=0.016)


def braking_distance(speed: float, film_mm: float, wear: float) -> float:
    """Distance to a stop with anti-lock brakes, which use 0.95 of the friction [m]."""
    steps = np.linspace(0.0, speed, 2001, dtype=np.float32)
    v, dv = 0.5 * (steps[1:] + steps[:-1]), float(steps[1])
    constant_inputs = [np.full_like(v, value) for value in (film_mm, wear, 0.0)]
    grip = road_surface.peak_friction(model_constants(), v, *constant_inputs).astype(np.float64)
    return float((v * dv / (0.95 * 9.81 * grip)).sum())


MEASURED = {0.0: 26.0, 1.0: 40.0}
"""Braking from 50 mph in 0.5 to 1.5 mm of water by wear, of four cars [m].

MIRA (2003), tyre tread depth on wet roads, for the British Rubber Manufacturers' Association, as
reported by others.
"""


@pytest.mark.parametrize(
    ("film_mm", "new", "worn"), [(0.2, 42.0, 66.0), (0.5, 46.0, 73.0), (1.5, 65.0, 111.0)]
)
def test_wet_roads_are_more_slippery_than_measured_by_the_documented_factors(film_mm, new, worn):
    distances = [braking_distance(50.0 * 0.44704, film_mm, wear) for wear in MEASURED]
    assert distances == pytest.approx([new, worn], abs=0.5)
    assert 1.5 < distances[1] / distances[0] < 1.8  # Measured: 1.5.
    for distance, measured in zip(distances, MEASURED.values(), strict=True):
        assert 1.6 < distance / measured < 2.8


@given(rain=st.floats(1.0, 100.0), path=st.floats(0.5, 30.0))
def test_the_film_is_gallaways_in_float64(rain: float, path: float):
    rate = 50.0 * (rain / 100.0) ** 2.5
    expected = 0.01485 * 0.8**0.11 * path**0.43 * rate**0.59 / 0.025**0.42 - 0.8
    rate32 = road_surface.rain_rate(np.float32(rain))
    assert float(rate32) == pytest.approx(rate, rel=1e-5)
    per_path, per_rain = (
        road_surface.film_path_factor(np.float32(path)),
        road_surface.film_rain_factor(rate32),
    )
    value = road_surface.lane_film(np.float32(-1.0), per_rain, per_path, np.float32(0.8))
    # The film is a small difference: 1e-5 of the sum, up to 3 mm.
    assert float(value) == pytest.approx(max(expected, -1.0), abs=3e-5)


def test_without_rain_there_is_no_film_and_no_rate():
    assert float(road_surface.rain_rate(np.float32(0.0))) == 0.0
    assert float(road_surface.film_rain_factor(np.float32(0.0))) == 0.0


@pytest.mark.parametrize("cover", [0.02, 0.1, 0.25, 0.5])
def test_puddles_cover_half_of_the_square_of_their_reach(cover: float):
    reach = np.float32(np.sqrt(2.0 * cover))
    # 40 km of one wheel path, and many phases: the two waves together are then uniform.
    s = np.linspace(0.0, 40_000.0, 400_001, dtype=np.float32)
    shares = [
        float(
            np.mean(
                road_surface.puddle_depth_share(
                    model_constants(), s, np.float32(path), np.float32(u), np.float32(w), reach
                )
                > 0.0
            )
        )
        for path, u, w in ((0, 0.1, 0.7), (3, 0.5, 0.2), (7, 0.9, 0.4))
    ]
    # Float32 places lie 4 mm apart at 40 km, puddles are metres long; 1000 waves are sampled.
    np.testing.assert_allclose(shares, cover, atol=0.004)


def test_puddles_lie_still_and_are_metres_long():
    s = np.linspace(0.0, 5_000.0, 50_001, dtype=np.float32)
    args = (np.float32(0.3), np.float32(0.6), np.float32(0.8))
    water = road_surface.puddle_depth_share(model_constants(), s, np.float32(2.0), *args)
    np.testing.assert_array_equal(
        water, road_surface.puddle_depth_share(model_constants(), s, np.float32(2.0), *args)
    )
    assert ((water >= 0.0) & (water <= 1.0)).all()
    edges = np.flatnonzero(np.diff((water > 0.0).astype(int)))
    lengths = np.diff(s[edges])[int(water[edges[0]] > 0.0) :: 2]
    # Patches of 3 to 15 m: the slope of the waves lets a few be shorter.
    assert 3.0 <= np.median(lengths) <= 15.0
    assert lengths.max() <= 23.0


def test_neighbouring_wheel_paths_have_different_puddles():
    s = np.linspace(0.0, 2_000.0, 20_001, dtype=np.float32)
    args = (np.float32(0.3), np.float32(0.6), np.float32(0.8))
    left, right = (
        road_surface.puddle_depth_share(model_constants(), s, np.float32(path), *args) > 0.0
        for path in (4.0, 5.0)
    )
    common_share = float(np.mean(left & right))
    # With the same puddles in both paths the common share would be the share itself, 0.32.
    assert common_share < 0.75 * float(np.mean(left))


@given(st.floats(-(2.0**21), 2.0**21))
def test_our_floor_equals_numpy(x: float):
    value = np.float32(x)
    assert road_surface.floor(value) == np.floor(value)


def test_outer_lanes_are_wetter():
    world = scenario([Vehicle()], road=wide_road(lanes=5), weather={"rain": 100.0})
    given_ = step_parameters(world)
    q = given_.simulations
    water = road_surface.lane_film(
        q.min_wet_film, q.film_rain_factor, given_.road.film_path[:5], q.texture_depth
    )
    assert (np.diff(water) <= 0.0).all()  # Lane 0 is the outermost, farthest from the crown.
    assert water[0] > 2.0 * water[4]


def test_each_side_has_the_grip_of_the_water_in_its_own_wheel_path():
    # Puddles of the whole road at many places: the sides differ where only one stands in water.
    cars = [Vehicle(s=3.0 * k, speed=30.0, body={"tyre_wear": 0.3}) for k in range(200)]
    b = bench(*cars, friction=None, sky={"puddles": 90.0})
    b.decide()
    d, s = float(b.state.motion.d[0, 0]), b.state.motion.s[0]
    number = lambda name: getattr(b.simulations, name)  # noqa: E731
    width = 0.5 * 6.0  # Two wheel paths to each lane of 6 m.
    for side, grip in (
        (0.5, b.state.friction_and_wind.mu_left[0]),
        (-0.5, b.state.friction_and_wind.mu_right[0]),
    ):
        path = math.floor((d + side * 1.55 + 48.0) / width)
        phases = number("puddle_phase_1"), number("puddle_phase_2"), number("puddle_threshold")
        depth = road_surface.puddle_depth_share(model_constants(), s, np.float32(path), *phases)
        # 2 mm at 100 % of deposits, none at 50 %; the rest of the road has the film of any wet one.
        water = 0.2 + 2.0 * 0.8 * depth
        expected = [handbook(30.0, float(h), 0.3) for h in water]
        np.testing.assert_allclose(grip, expected, atol=3e-6)
    assert (b.state.friction_and_wind.mu_left != b.state.friction_and_wind.mu_right).any()


def test_a_puddle_under_one_side_turns_a_braking_car_towards_the_dry_side():
    b = bench(Vehicle(speed=30.0))
    b.state.friction_and_wind.mu_left = b.state.friction_and_wind.mu_left * np.float32(0.3)
    run = b.drive(0.3, lambda test, _: test.hold(accel=-6.0))
    # The left wheels, towards the fast side, have less grip, so the right ones turn it there, with
    # a moment of half the track times the difference of the brake forces, growing over 0.3 s.
    assert run["yaw_rate"][-1, 0] < -0.1
    table = numbers_of("friction.toml").table
    assert table.floor == FLOOR
