"""The weather's mappings against meteorological scales, the law, and figures worked out by hand."""

from __future__ import annotations

import math
from typing import cast

import pytest
from scipy.optimize import brentq
from tests.support.knowledge import weather_maps

from overtaking.core.units import deg_from_rad, kmh_from_mps, mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import vehicle_classes

AIR_DENSITY = number("model.nature.air_density")


def mor(fog_percent: float) -> float:
    fog = weather_maps().fog
    return fog.clear_range * (fog.thick_range / fog.clear_range) ** (fog_percent / 100.0)


def rate_mmph(precipitation_percent: float) -> float:
    rain = weather_maps().rain
    return rain.max_rate_mmph * (precipitation_percent / 100.0) ** rain.exponent


def mean_wind(wind_percent: float) -> float:
    return weather_maps().wind.full_speed * wind_percent / 100.0


@pytest.mark.parametrize(("percent", "rate"), [(30, 2.5), (60, 13.9), (90, 38.4), (100, 50.0)])
def test_rain_falls_at_the_borders_of_the_meteorological_scale(percent: float, rate: float):
    assert rate_mmph(percent) == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize(
    ("percent", "expected"),
    [(0, 10_000), (7, 6_900), (20, 3_470), (40, 1_200), (60, 416), (80, 144), (100, 50)],
)
def test_fog_has_the_range_worked_out_by_hand(percent: float, expected: float):
    assert mor(percent) == pytest.approx(expected, rel=0.005)


def test_thick_fog_is_exactly_insufficient_visibility_of_article_19():
    assert mor(100.0) == 50.0


def test_mor_is_the_distance_of_five_percent_transmission():
    depth = weather_maps().fog.transmission_depth
    assert math.exp(-depth) == pytest.approx(0.05, rel=0.005)
    assert weather_maps().contrast.threshold_day == 0.05


@pytest.mark.parametrize(("rate", "per_km"), [(2.5, 0.65), (14.0, 1.9), (50.0, 4.3)])
def test_falling_rain_dims_as_the_drop_spectrum_says(rate: float, per_km: float):
    rain = weather_maps().rain_sight
    extinction = rain.coefficient * rate**rain.exponent
    assert extinction * 1000.0 == pytest.approx(per_km, rel=0.02)


@pytest.mark.parametrize(("percent", "beaufort"), [(10.0, 2), (30.0, 4), (60.0, 6), (100.0, 8)])
def test_wind_percent_is_an_even_beaufort_number(percent: float, beaufort: int):
    # WMO code table 1100: the speeds in m/s at which each force begins.
    begins = [0.0, 0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8]
    speed = mean_wind(percent)
    assert begins[beaufort] <= speed < begins[beaufort + 1]


def side_accel(name: str, *, speed_kmh: float, wind: float, mass: float | None = None) -> float:
    """Lateral acceleration by a cross wind at right angles, before any correction [m/s^2]."""
    vehicle, speed = vehicle_classes()[name], mps_from_kmh(speed_kmh)
    angle = weather_maps().wind.angle_factor * math.atan2(wind, speed)
    pressure = 0.5 * AIR_DENSITY * (speed**2 + wind**2)
    force = pressure * vehicle.side_area.number * vehicle.wind_side_coefficient.number
    return force * math.sin(min(angle, math.pi / 2.0)) / (mass or vehicle.mass.number)


# Worked out by hand at 30, 60 and 100 percent of mean wind.
@pytest.mark.parametrize(
    ("name", "speed_kmh", "expected"),
    [
        ("M", 110.0, (0.41, 0.86, 1.57)),
        ("V", 110.0, (0.58, 1.2, 2.2)),
        ("T", 85.0, (0.23, 0.5, 0.94)),
        ("MC", 110.0, (0.56, 1.2, 2.1)),
    ],
)
def test_cross_wind_pushes_as_worked_out_by_hand(
    name: str, speed_kmh: float, expected: tuple[float, ...]
):
    winds = [mean_wind(percent) for percent in (30.0, 60.0, 100.0)]
    accels = [side_accel(name, speed_kmh=speed_kmh, wind=wind) for wind in winds]
    assert accels == pytest.approx(expected, rel=0.04)


def test_an_empty_truck_is_pushed_nearly_twice_as_hard():
    truck = vehicle_classes()["T"]
    loaded = side_accel("T", speed_kmh=85.0, wind=12.0)
    empty = side_accel("T", speed_kmh=85.0, wind=12.0, mass=truck.mass_empty.number)
    assert empty / loaded == pytest.approx(1.85, abs=0.01)


def lamp_range(intensity: float, threshold: float, fog_percent: float) -> float:
    """Distance at which a lamp is just seen (Allard) [m]."""
    beta = weather_maps().fog.transmission_depth / mor(fog_percent)
    seen = brentq(lambda d: intensity * math.exp(-beta * d) / d**2 - threshold, 1.0, 1e6)
    return cast("float", seen)


@pytest.mark.parametrize(
    ("fog", "expected"), [(0.0, 2300.0), (60.0, 508.0), (80.0, 246.0), (100.0, 112.0)]
)
def test_tail_lamps_are_seen_at_night_as_far_as_worked_out_by_hand(fog: float, expected: float):
    lamps = weather_maps().lamps
    assert lamp_range(lamps.rear_position, lamps.threshold_night, fog) == pytest.approx(
        expected, rel=0.02
    )


def test_rear_fog_lamps_reach_farther_by_night_and_by_day():
    lamps = weather_maps().lamps
    assert lamp_range(lamps.rear_fog, lamps.threshold_night, 100.0) == pytest.approx(154.0, abs=1)
    assert lamp_range(lamps.rear_fog, lamps.threshold_day, 100.0) == pytest.approx(91.0, abs=1)


def test_unlit_cars_are_seen_in_thick_fog_at_38_to_50_metres():
    threshold = weather_maps().contrast.threshold_day
    beta = weather_maps().fog.transmission_depth / mor(100.0)
    ranges = [math.log(contrast / threshold) / beta for contrast in (0.8, 0.5)]
    assert ranges == pytest.approx([46.0, 38.0], abs=0.5)


@pytest.mark.parametrize(
    ("lamp", "lowest", "highest"), [("rear_position", 4, 17), ("stop", 60, 260)]
)
def test_lamps_are_as_bright_as_type_approval_allows(lamp: str, lowest: float, highest: float):
    assert lowest <= getattr(weather_maps().lamps, lamp) <= highest


def test_only_a_low_sun_ahead_dazzles():
    glare = weather_maps().glare
    assert deg_from_rad(glare.max_sun_altitude) == pytest.approx(18.0)
    assert deg_from_rad(glare.half_width) == pytest.approx(25.0)
    # CARLA's sunset is at 15 degrees, its noon at 45.
    assert 15.0 < deg_from_rad(glare.max_sun_altitude) < 45.0


def test_a_car_on_a_wet_road_makes_a_cloud_of_a_quarter_kilometre():
    spray = weather_maps().spray
    assert kmh_from_mps(spray.speed_scale) == 90.0
    assert weather_maps().fog.transmission_depth / spray.coefficient == 250.0


def test_ranges_and_thresholds_are_in_order():
    maps = weather_maps()
    contrast, lamps, heads = maps.contrast, maps.lamps, maps.headlamps
    assert contrast.threshold_day < contrast.threshold_dusk < contrast.threshold_night
    assert lamps.threshold_night < lamps.threshold_dusk < lamps.threshold_day
    assert lamps.rear_position < lamps.stop < lamps.rear_fog
    assert heads.low_beam < heads.high_beam
    assert maps.puddles.first_wave < maps.puddles.second_wave
    assert maps.gusts.min_length < maps.gusts.max_length
    assert maps.errors.distance_cv_day < maps.errors.distance_cv_night < maps.errors.distance_cv_fog
