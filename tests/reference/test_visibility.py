"""Sight: Koschmieder, Allard, Stiles and Holladay, Marshall and Palmer, and known ranges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from overtaking.world import visibility

CLEAR, THICK = 10_000.0, 50.0
DEPTH = 3.0  # ln(1 / 0.05), rounded as the meteorological organization rounds it.


def f32(*values: float) -> list[np.float32]:
    return [np.float32(value) for value in values]


@pytest.mark.parametrize(
    ("fog", "metres"),
    [(0, 10_000), (7, 6_900), (20, 3_470), (40, 1_200), (60, 416), (80, 144), (100, 50)],
)
def test_the_range_in_fog_equals_values_worked_out_by_hand(fog: float, metres: float):
    assert float(visibility.meteorological_range(np.float32(fog))) == pytest.approx(
        metres, rel=5e-3
    )


@given(st.floats(0.0, 100.0))
def test_the_range_falls_by_the_same_factor_over_each_part_of_the_scale(fog: float):
    expected = CLEAR * (THICK / CLEAR) ** (fog / 100.0)
    assert float(visibility.meteorological_range(np.float32(fog))) == pytest.approx(
        expected, rel=1e-5
    )
    assert float(visibility.fog_extinction(np.float32(fog))) == pytest.approx(
        DEPTH / expected, rel=1e-5
    )


@given(st.floats(0.01, 100.0))
def test_falling_rain_dims_by_the_power_law_of_its_drops(rate: float):
    value = float(visibility.rain_extinction(np.float32(rate)))
    assert value == pytest.approx(0.365e-3 * rate**0.63, rel=1e-5)


@pytest.mark.parametrize(("rate", "mor_km"), [(2.5, 4.6), (14.0, 1.6), (50.0, 0.7)])
def test_falling_rain_alone_hardly_limits_sight(rate: float, mor_km: float):
    beta = float(visibility.rain_extinction(np.float32(rate)))
    assert DEPTH / beta / 1000.0 == pytest.approx(mor_km, abs=0.05)


@given(beta=st.floats(1e-4, 0.1), contrast=st.floats(0.05, 1.0), threshold=st.floats(0.02, 0.3))
def test_contrast_falls_to_the_threshold_at_its_range(
    beta: float, contrast: float, threshold: float
):
    value = float(visibility.contrast_range(*f32(beta, contrast, threshold)))
    expected = max(math.log(contrast / threshold), 0.0) / beta
    # The logarithm of a ratio near one has an absolute error, here 1e-7 over beta.
    assert value == pytest.approx(expected, rel=1e-5, abs=3e-7 / beta)


@pytest.mark.ci
@given(
    beta=st.floats(0.0, 0.06), intensity=st.floats(1.0, 500.0),
    threshold=st.sampled_from([8e-7, 1e-5, 1e-4]),
)  # fmt: skip
def test_a_lamp_is_as_bright_as_the_threshold_at_its_range(
    beta: float, intensity: float, threshold: float
):
    value = float(visibility.lamp_range(*f32(beta, intensity, threshold)))
    right = brentq(
        lambda r: math.log(intensity / threshold) - beta * r - 2.0 * math.log(r), 0.01, 1e6
    )
    # Newton's method in float32, stopped after eight rounds.
    assert value == pytest.approx(right, rel=1e-4)


@pytest.mark.parametrize(
    ("fog", "intensity", "night", "metres"),
    [
        (0.0, 8.0, True, 2300.0),
        (60.0, 8.0, True, 508.0),
        (80.0, 8.0, True, 246.0),
        (100.0, 8.0, True, 112.0),
        (100.0, 200.0, True, 154.0),
        (100.0, 200.0, False, 91.0),
    ],
)
def test_the_range_of_lamps_equals_values_worked_out_by_hand(
    fog: float, intensity: float, night: bool, metres: float
):
    beta = visibility.fog_extinction(np.float32(fog))
    threshold = visibility.lamp_threshold(np.array(night), np.array(False))
    value = float(visibility.lamp_range(beta, np.float32(intensity), threshold))
    # The figures are rounded to metres, the first to a hundred.
    assert value == pytest.approx(metres, rel=0.02 if fog == 0.0 else 0.006)


@pytest.mark.parametrize(("night", "dusk", "expected"), [(0, 0, 0.05), (0, 1, 0.08), (1, 0, 0.15)])
def test_dusk_and_night_need_more_contrast(night: int, dusk: int, expected: float):
    flags = np.array(bool(night)), np.array(bool(dusk))
    assert float(visibility.contrast_threshold(*flags, np.float32(0.0))) == pytest.approx(expected)
    # 50 mm/h on the windscreen double it.
    doubled = visibility.contrast_threshold(*flags, np.float32(50.0))
    assert float(doubled) == pytest.approx(2.0 * expected)


# Kasten and Young 1989, table of the relative optical air mass.
@pytest.mark.parametrize(
    ("degrees", "mass"), [(1.0, 26.3), (5.0, 10.31), (10.0, 5.58), (30.0, 1.99)]
)
def test_sunlight_comes_through_the_tabled_air_mass(degrees: float, mass: float):
    (altitude,) = f32(math.radians(degrees))
    value = float(visibility.sun_illuminance(altitude))
    assert -math.log(value / 127_500.0) / 0.21 == pytest.approx(mass, rel=3e-3)


@given(altitude=st.floats(0.1, 17.9), azimuth=st.floats(0.0, 24.9))
def test_glare_is_the_veil_of_stiles_and_holladay(altitude: float, azimuth: float):
    theta = max(math.hypot(altitude, azimuth), 1.0)
    numbers = f32(math.radians(altitude), math.radians(azimuth), 0.0)
    veil = 10.0 * float(visibility.sun_illuminance(numbers[0])) / theta**2
    value = float(visibility.glare_factor(*numbers))
    assert value == pytest.approx(4000.0 / (4000.0 + veil), rel=1e-4)


def test_a_sun_some_degrees_high_dazzles_most_but_not_totally():
    altitudes = np.radians(np.linspace(0.1, 17.9, 100)).astype(np.float32)
    zero = np.zeros_like(altitudes)
    left = visibility.glare_factor(altitudes, zero, zero)
    assert 2.0 < math.degrees(altitudes[left.argmin()]) < 7.0
    assert 0.3 < float(left.min()) < 0.5


@pytest.mark.parametrize(
    ("altitude", "azimuth", "cloud"),
    [(18.5, 0.0, 0.0), (-0.5, 0.0, 0.0), (10.0, 26.0, 0.0), (10.0, 0.0, 60.0)],
)
def test_a_high_or_hidden_sun_and_one_beside_the_road_do_not_dazzle(
    altitude: float, azimuth: float, cloud: float
):
    numbers = f32(math.radians(altitude), math.radians(azimuth), cloud)
    assert float(visibility.glare_factor(*numbers)) == 1.0
