"""Our elementary functions against mpmath, and against NumPy's float64 where the grid is dense.

NumPy's float64 functions are wrong by about 1e-16, a millionth of the float32 unit in the last
place that is measured here, so they may stand in for mpmath on grids of a million points.
"""

import hypothesis.strategies as st
import mpmath
import numpy as np
import pytest
from hypothesis import given

from overtaking.core import float32_math

MPMATH_POINTS = 2_000
DENSE_POINTS = 500_000

EXP_ULP, LOG_ULP, LOG_ABSOLUTE, SINCOS_ABSOLUTE, ATAN_ULP = 2.0, 2.0, 1e-7, 1e-7, 3.0


def ulps(computed, exact_values):
    """Distance in units of the last place of the float32 nearest to `exact_values`."""
    spacing = np.spacing(np.abs(exact_values).astype(np.float32)).astype(np.float64)
    return np.abs(computed.astype(np.float64) - exact_values) / spacing


def exact(function, points):
    """`function` of mpmath at 40 digits, rounded once to float64."""
    with mpmath.workdps(40):
        return np.array([float(function(mpmath.mpf(float(x)))) for x in points])


def linear(low, high, count):
    return np.linspace(low, high, count).astype(np.float32)


def logarithmic(low, high, count):
    return np.exp(np.linspace(np.log(low), np.log(high), count)).astype(np.float32)


def floats_from(value, count):
    """`count` neighbouring positive floats, upwards from `value`."""
    first = int(np.float32(value).view(np.int32))
    return np.arange(first, first + count, dtype=np.int32).view(np.float32)


def test_exp_is_within_two_ulp_of_mpmath():
    x = np.concatenate([linear(-87, 88, MPMATH_POINTS), linear(-1, 1, MPMATH_POINTS)])
    assert ulps(float32_math.exp(x), exact(mpmath.exp, x)).max() < EXP_ULP


def test_exp_is_within_two_ulp_on_a_dense_grid():
    x = np.concatenate([linear(-87, 88, DENSE_POINTS), linear(-1, 1, DENSE_POINTS)])
    assert ulps(float32_math.exp(x), np.exp(x.astype(np.float64))).max() < EXP_ULP


def test_exp_of_zero_is_one_and_exp_is_clamped_beyond_its_range():
    x = np.array([0.0, -0.0, -1000.0, -87.0, 1000.0, 88.0], dtype=np.float32)
    at_zero, at_minus_zero, lowest, at_low, highest, at_high = float32_math.exp(x)
    assert at_zero == at_minus_zero == 1.0
    assert lowest == at_low > 0.0
    assert highest == at_high
    assert np.isfinite(at_high)


@pytest.mark.parametrize(("low", "high"), [(1e-37, 3e38), (0.5, 2.0), (0.99, 1.01)])
def test_log_is_within_its_bound_of_mpmath(low, high):
    x = logarithmic(low, high, MPMATH_POINTS)
    expected = exact(mpmath.log, x)
    close = np.abs(float32_math.log(x) - expected) < LOG_ABSOLUTE
    assert np.all(close | (ulps(float32_math.log(x), expected) < LOG_ULP))


@pytest.mark.parametrize(("low", "high"), [(1e-37, 3e38), (0.5, 2.0)])
def test_log_is_within_its_bound_on_a_dense_grid(low, high):
    x = logarithmic(low, high, DENSE_POINTS)
    expected = np.log(x.astype(np.float64))
    close = np.abs(float32_math.log(x) - expected) < LOG_ABSOLUTE
    assert np.all(close | (ulps(float32_math.log(x), expected) < LOG_ULP))


def test_log_treats_numbers_that_are_not_positive_as_the_smallest_normal():
    x = np.array([1.0, 0.0, -0.0, -5.0, 1e-40, np.finfo(np.float32).tiny], dtype=np.float32)
    at_one, *not_positive = float32_math.log(x)
    assert at_one == 0.0
    assert len(set(not_positive)) == 1
    assert not_positive[0] == pytest.approx(float(mpmath.log(2.0**-126)), rel=1e-7)


@pytest.mark.parametrize("reach", [0.785, 4.0, 100.0, 1000.0])
def test_sine_and_cosine_are_within_1e_7_of_mpmath(reach):
    x = linear(-reach, reach, MPMATH_POINTS)
    sine, cosine = float32_math.sincos(x)
    assert np.abs(sine - exact(mpmath.sin, x)).max() < SINCOS_ABSOLUTE
    assert np.abs(cosine - exact(mpmath.cos, x)).max() < SINCOS_ABSOLUTE


def test_sine_and_cosine_are_within_1e_7_on_a_dense_grid():
    x = linear(-1000.0, 1000.0, DENSE_POINTS)
    sine, cosine = float32_math.sincos(x)
    assert np.abs(sine - np.sin(x.astype(np.float64))).max() < SINCOS_ABSOLUTE
    assert np.abs(cosine - np.cos(x.astype(np.float64))).max() < SINCOS_ABSOLUTE


def test_sine_and_cosine_at_the_quadrants():
    x = float32_math.PI * np.array([0.0, 0.5, 1.0, 1.5, 2.0], dtype=np.float32)
    sine, cosine = float32_math.sincos(x)
    np.testing.assert_allclose(sine, [0, 1, 0, -1, 0], atol=2e-7)
    np.testing.assert_allclose(cosine, [1, 0, -1, 0, 1], atol=2e-7)


def test_atan_is_within_three_ulp_of_mpmath():
    positive = logarithmic(1e-30, 1e30, MPMATH_POINTS)
    x = np.concatenate([positive, -positive, linear(-3, 3, MPMATH_POINTS)])
    assert ulps(float32_math.atan(x), exact(mpmath.atan, x)).max() < ATAN_ULP


def test_atan_is_within_three_ulp_where_its_three_ranges_meet():
    x = np.concatenate([floats_from(v, DENSE_POINTS // 2) for v in (0.40, 0.43, 0.99, 2.40)])
    assert ulps(float32_math.atan(x), np.arctan(x.astype(np.float64))).max() < ATAN_ULP


def test_atan_at_special_points():
    x = np.array([0.0, 1.0, -1.0, np.inf, -np.inf], dtype=np.float32)
    np.testing.assert_array_equal(
        float32_math.atan(x),
        np.array([0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2], dtype=np.float32),
    )


@pytest.mark.parametrize("start", [0.41, 0.49, 0.70, 0.99, 1.99, 2.41, 80.0])
@pytest.mark.parametrize("name", ["exp", "log", "atan"])
def test_functions_do_not_fall_between_neighbouring_floats(name, start):
    values = getattr(float32_math, name)(floats_from(start, 200_000))
    assert np.all(np.diff(values) >= 0)


def test_the_error_of_power_is_bounded_by_its_exponent():
    base = logarithmic(1e-3, 1e3, MPMATH_POINTS)
    for exponent in (-2.0, 0.43, 0.59, 1.0, 2.5):
        computed = float32_math.power(base, np.full_like(base, exponent))
        with mpmath.workdps(40):
            power = mpmath.mpf(float(np.float32(exponent)))
        expected = exact(lambda x, power=power: x**power, base)
        # The argument of exp is rounded; its absolute error is a relative error of the result.
        argument = np.abs(exponent * np.log(base.astype(np.float64)))
        bound = EXP_ULP + 2.0 * (argument + 1.0)
        assert np.all(ulps(computed, expected) < bound)


@given(st.lists(st.floats(-(2.0**99), 2.0**99, width=32), min_size=3, max_size=3))
def test_clamp_is_the_nearest_value_inside(numbers):
    low, value, high = np.array(numbers, dtype=np.float32)[:, None]
    low, high = np.minimum(low, high), np.maximum(low, high)
    assert float32_math.clamp(value, low, high) == np.clip(value, low, high)


@pytest.mark.parametrize("name", ["exp", "log", "atan", "sincos"])
def test_every_result_is_float32_of_the_same_shape(name):
    x = np.full((2, 3), 0.5)
    results = getattr(float32_math, name)(x)
    for result in results if isinstance(results, tuple) else (results,):
        assert result.dtype == np.float32
        assert result.shape == x.shape


def test_as_f32_rounds_to_nearest_even():
    assert float32_math.as_f32(1.0 + 2.0**-24) == np.float32(1.0)
    assert float32_math.as_f32(1.0 + 3.0 * 2.0**-24) == np.float32(1.0 + 2.0**-22)
