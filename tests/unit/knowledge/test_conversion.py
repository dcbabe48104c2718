"""Unit texts, against SciPy's tables."""

from __future__ import annotations

import math

import pytest
import scipy.constants as tables

from overtaking.core.errors import KnowledgeError
from overtaking.core.units import (
    SUFFIXES,
    mps_from_kmh,
    rad_from_deg,
    si_unit,
    unit_converter,
    unit_of_suffix,
)

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
    for unit in SUFFIXES.values():
        unit_converter(unit, where="suffix")
