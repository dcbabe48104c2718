"""Conversions against the standard library and SciPy's CODATA tables, constants against physics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.constants
from hypothesis import given
from hypothesis import strategies as st

from overtaking.core import units

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
