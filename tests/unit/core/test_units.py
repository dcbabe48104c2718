"""Conversions and unit texts against the standard library and SciPy's tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.constants
import scipy.constants as tables
from hypothesis import given
from hypothesis import strategies as st

from overtaking.core import units
from overtaking.core.errors import KnowledgeError
from overtaking.core.units import (
    UNCONVERTED_SUFFIXES,
    mps_from_kmh,
    rad_from_deg,
    si_unit,
    unit_converter,
    unit_of_suffix,
)

if TYPE_CHECKING:
    from collections.abc import Callable


finite = st.floats(min_value=-1e6, max_value=1e6, allow_nan=False)
CONVERSIONS = [units.mps_from_kmh, units.kmh_from_mps, units.rad_from_deg, units.deg_from_rad]


@given(finite)
def test_speed_agrees_with_the_tables_of_scipy(speed_kmh: float):
    expected = speed_kmh * scipy.constants.kmh
    assert units.mps_from_kmh(speed_kmh) == pytest.approx(expected, rel=1e-15, abs=1e-300)


@given(finite)
def test_angle_agrees_with_the_standard_library(angle_deg: float):
    assert units.rad_from_deg(angle_deg) == math.radians(angle_deg)
    assert units.deg_from_rad(angle_deg) == math.degrees(angle_deg)


@given(finite)
def test_there_and_back_changes_nothing_that_matters(value: float):
    assert units.kmh_from_mps(units.mps_from_kmh(value)) == pytest.approx(value, rel=1e-15)
    assert units.deg_from_rad(units.rad_from_deg(value)) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("speed_kmh", "speed"), [(90.0, 25.0), (36.0, 10.0), (0.0, 0.0)])
def test_round_speeds_are_exact(speed_kmh: float, speed: float):
    assert units.mps_from_kmh(speed_kmh) == speed


@pytest.mark.parametrize("convert", CONVERSIONS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_array_keeps_its_type_and_shape(
    convert: Callable[[np.ndarray], np.ndarray], dtype: type[np.floating]
):
    array = np.linspace(-200.0, 200.0, 12, dtype=dtype).reshape(3, 4)
    result = convert(array)
    assert result.dtype == dtype
    assert result.shape == (3, 4)
    one_by_one = [convert(array[i, j : j + 1])[0] for i in range(3) for j in range(4)]
    np.testing.assert_array_equal(result.ravel(), one_by_one)


FACTORS = [
    ("km/h", tables.kmh, "m/s"),
    ("mm", tables.milli, "m"),
    ("inch", tables.inch, "m"),
    ("mm/h", tables.milli / tables.hour, "m/s"),
    ("min", tables.minute, "s"),
    ("ms", tables.milli, "s"),
    ("kPa", tables.kilo, "Pa"),
    ("kW/kg", tables.kilo, "W/kg"),
    ("deg", tables.degree, "rad"),
    ("deg/s^2", tables.degree, "rad/s^2"),
    ("1/deg", 1 / tables.degree, "1/rad"),
    ("1/km", 1 / tables.kilo, "1/m"),
    ("vehicle/km", 1 / tables.kilo, "vehicle/m"),
    ("mm^2", tables.milli**2, "m^2"),
    ("1/(km h)", 1 / (tables.kilo * tables.hour), "1/(m s)"),
    ("percent", 0.01, "1"),
    ("klx", tables.kilo, "lx"),
]


@pytest.mark.parametrize(("unit", "factor", "si"), FACTORS)
def test_a_unit_converts_by_the_factor_of_the_tables(unit: str, factor: float, si: str):
    assert unit_converter(unit, where="here")(7.5) == pytest.approx(7.5 * factor, rel=4e-16)
    assert si_unit(unit) == si


@pytest.mark.parametrize("unit", ["1", "m", "m/s^2", "kg m^2", "1/rad", "cd/m^2", "N m/rad"])
def test_an_si_unit_is_left_alone_to_the_last_bit(unit: str):
    assert unit_converter(unit, where="here")(math.pi) == math.pi
    assert si_unit(unit) == unit


@pytest.mark.parametrize("value", [50.0, 90.0, 110.0, 120.0, 130.0, 33.3])
def test_file_and_code_convert_speeds_and_angles_to_the_same_bits(value: float):
    assert unit_converter("km/h", where="here")(value) == mps_from_kmh(value)
    assert unit_converter("deg", where="here")(value) == rad_from_deg(value)


@pytest.mark.parametrize(
    "unit",
    ["", " ", "mph", "m//s", "m/s/s", "m^", "m^-1", "^2", "(m)", "m/(s", "2 m", "KM", "m/ s"],
)
def test_a_text_that_is_no_unit_is_refused(unit: str):
    with pytest.raises(KnowledgeError, match=r"^a\.toml \[b\]: unit: expected .*write one with"):
        unit_converter(unit, where="a.toml [b]")


def test_a_suffix_names_the_unit_that_is_kept():
    assert unit_of_suffix("film_mm") == "mm"
    assert unit_of_suffix("rate_mmph") == "mm/h"
    assert unit_of_suffix("cut_in") is None
    assert unit_of_suffix("length") is None
    for unit in UNCONVERTED_SUFFIXES.values():
        unit_converter(unit, where="suffix")
