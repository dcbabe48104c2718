"""Elementary functions in float32 whose results have the same bits on every machine.

The last bits of `numpy.exp` and similar functions depend on the CPU and on the version, so the
simulator uses the functions of this module. They consist of operations that IEEE 754 rounds in one
way only: `+ - * /`, comparisons, rounding to integers and shifts of bits. The compiled simulator
(the engine) has the same functions in `crates/overtaking-core/src/math/elementary.rs`, with the
same operations in the same order. Change both together.

Arguments are float32 arrays or numbers of any shapes that broadcast; the results are float32 arrays
of the common shape.

Each function first maps its argument to a small interval around 0, and there evaluates a polynomial
whose largest error is as small as possible. Intervals and coefficients come from the single
precision of the Cephes library (Moshier, *Methods and Programs for Mathematical Functions*, 1989).
The docstrings state the largest errors in units in the last place (ulp) or as absolute values;
tests compare with mpmath. In the code, `r` or `m` is the argument in the interval, `z` its square
and `p` the polynomial.
"""

from typing import Any

import numpy as np

from overtaking.core.arrays import F32, F32Like

ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
TWO = np.float32(2.0)
HALF_PI = np.float32(1.570_796_4)
PI = np.float32(3.141_592_7)
TAU = np.float32(6.283_185_5)

_LOG2_E = np.float32(1.442_695_04)
_SQRT_HALF = np.float32(0.707_106_77)
_TWO_OVER_PI = np.float32(0.636_619_77)

# ln 2 and pi / 2 as sums of several parts. The high parts have so few bits that their products with
# an integer k are exact: `x - k * high - k * low` loses no digits where `x - k * ln2` would.
_LN2_HIGH = np.float32(0.693_359_375)
_LN2_LOW = np.float32(-2.121_944_4e-4)
_HALF_PI_HIGH = np.float32(1.570_312_5)
_HALF_PI_MIDDLE = np.float32(4.837_512_969_970_703e-4)
_HALF_PI_LOW = np.float32(7.549_789_95e-8)

_PI_OVER_4 = np.float32(0.785_398_2)
_TAN_3PI_8 = np.float32(2.414_213_7)
_TAN_PI_8 = np.float32(0.414_213_57)

_SMALLEST_NORMAL = np.float32(1.175_494_4e-38)
"""2**-126, the smallest positive float32 with the full number of digits."""


def as_f32(value: Any) -> F32:
    """Convert a value to a float32 array; each number is rounded to the nearest one (ties to even).

    Args:
        value: Numbers of any type and shape; a float32 array is returned without a copy.
    """
    return np.asarray(value, dtype=np.float32)


# Not `numpy.minimum`: for a pair of -0.0 and 0.0, or for NaN, its result can differ from the
# engine's.


def minimum(a: F32Like, b: F32Like) -> F32:
    """The smaller of two values; `b` where they are equal or one of them is NaN."""
    return np.where(a < b, a, b)


def maximum(a: F32Like, b: F32Like) -> F32:
    """The larger of two values; `b` where they are equal or one of them is NaN."""
    return np.where(a > b, a, b)


def clamp(value: F32Like, low: F32Like, high: F32Like) -> F32:
    """`value` limited to [low, high]; `low` where it is NaN."""
    return minimum(maximum(value, low), high)


def exp(x: F32Like) -> F32:
    """The number e to the power `x`, error below 2 ulp.

    An `x` below -87 or above 88 counts as that limit, so that the result is neither 0 nor infinite;
    NaN counts as -87.
    """
    x = clamp(as_f32(x), np.float32(-87.0), np.float32(88.0))
    # exp(x) = 2**k * exp(r) with |r| <= ln(2) / 2.
    k = np.rint(x * _LOG2_E)
    r = x - k * _LN2_HIGH - k * _LN2_LOW
    p = np.float32(1.987_569_1e-4) * r + np.float32(1.398_199_9e-3)
    p = p * r + np.float32(8.333_452e-3)
    p = p * r + np.float32(4.166_579_6e-2)
    p = p * r + np.float32(1.666_666_5e-1)
    p = p * r + HALF
    exp_r = p * (r * r) + r + ONE
    # A float32 stores the exponent of its power of 2, plus 127, from bit 23 on: this makes 2**k.
    return exp_r * ((k.astype(np.int32) + 127) << 23).view(np.float32)


def log(x: F32Like) -> F32:
    """Natural logarithm, error below 2 ulp or 1e-7, whichever is larger.

    An `x` below 2**-126 (1.2e-38), also a negative one, and NaN count as 2**-126: the result is
    never infinite.
    """
    x = maximum(as_f32(x), _SMALLEST_NORMAL)
    # x = fraction * 2**exponent with the fraction in [0.5, 1). Both come from the bits of x. The
    # exponent field, from bit 23 on, belongs to a fraction in [1, 2) and is larger by 127. The
    # fraction here is half as large, so its exponent is the field minus 126. 0x3F00_0000 are the
    # bits of 0.5.
    bits = x.view(np.int32)
    exponent = ((bits >> 23) - 126).astype(np.float32)
    fraction = ((bits & 0x007F_FFFF) | 0x3F00_0000).view(np.float32)
    # Move the fraction to [sqrt(0.5), sqrt(2)): log(x) = log(1 + m) + e * ln(2), with m around 0.
    is_below = fraction < _SQRT_HALF
    e = np.where(is_below, exponent - ONE, exponent)
    m = np.where(is_below, fraction + fraction, fraction) - ONE
    z = m * m
    p = np.float32(7.037_683_6e-2) * m + np.float32(-1.151_461e-1)
    p = p * m + np.float32(1.167_699_9e-1)
    p = p * m + np.float32(-1.242_014_1e-1)
    p = p * m + np.float32(1.424_932_3e-1)
    p = p * m + np.float32(-1.666_805_8e-1)
    p = p * m + np.float32(2.000_071_5e-1)
    p = p * m + np.float32(-2.499_999_4e-1)
    p = p * m + np.float32(3.333_333_1e-1)
    # log(1 + m) = m - m^2 / 2 + m^3 p(m). The largest terms are added last: the smaller ones would
    # lose bits beside them.
    y = p * m * z + e * _LN2_LOW - HALF * z
    return m + y + e * _LN2_HIGH


def power(base: F32Like, exponent: F32Like) -> F32:
    """`base ** exponent` for a positive base, computed as exp(exponent * log(base)).

    The rounding of that product limits the accuracy. With t = |exponent * log(base)| up to 86, the
    error is some 4 + 2 t ulp: measured with 20 million random pairs and bases from 1e-37 to 1e37,
    also near 1, it exceeded this by 2 % at most. A base below 2**-126, also 0, counts as 2**-126.
    """
    return exp(as_f32(exponent) * log(base))


def sincos(x: F32Like) -> tuple[F32, F32]:
    """Sine and cosine of an angle [rad]; absolute error below 1e-7 if |x| <= 1000, else larger.

    From |x| = 3e9 on, and for NaN, the results depend on the CPU, because k below does not fit into
    int32. Angles of the simulator are far smaller.
    """
    x = as_f32(x)
    # x = k * pi / 2 + r with |r| <= pi / 4: `s` and `c` are the sine and cosine of r, and the
    # quadrant, k modulo 4, decides which of them is the sine of x, and the signs.
    k = np.rint(x * _TWO_OVER_PI)
    r = x - k * _HALF_PI_HIGH - k * _HALF_PI_MIDDLE - k * _HALF_PI_LOW
    quadrant = k.astype(np.int32) & 3
    z = r * r
    s = np.float32(-1.951_529_6e-4) * z + np.float32(8.332_161e-3)
    s = s * z + np.float32(-1.666_665_5e-1)
    s = s * z * r + r
    c = np.float32(2.443_315_7e-5) * z + np.float32(-1.388_731_6e-3)
    c = c * z + np.float32(4.166_664_6e-2)
    c = c * (z * z) - HALF * z + ONE
    is_odd = (quadrant & 1) == 1
    sine = np.where(is_odd, c, s)
    cosine = np.where(is_odd, s, c)
    sine = np.where(quadrant >= 2, -sine, sine)
    cosine = np.where((quadrant == 1) | (quadrant == 2), -cosine, cosine)
    return sine, cosine


def atan(x: F32Like) -> F32:
    """Inverse tangent [rad], in [-pi / 2, pi / 2], error below 3 ulp; NaN for NaN."""
    x = as_f32(x)
    magnitude = np.abs(x)
    # atan(magnitude) = base + atan(r) with |r| <= tan(pi / 8), in three ranges of the magnitude:
    #   up to tan(pi / 8)    base = 0       r = magnitude
    #   up to tan(3 pi / 8)  base = pi / 4  r = (magnitude - 1) / (magnitude + 1)
    #   beyond               base = pi / 2  r = -1 / magnitude
    is_far = magnitude > _TAN_3PI_8
    is_middle = (magnitude > _TAN_PI_8) & ~is_far
    numerator = np.where(is_far, np.float32(-1.0), magnitude - ONE)
    divisor = np.where(is_far, magnitude, magnitude + ONE)
    r = np.where(is_far | is_middle, numerator / divisor, magnitude)
    base = np.where(is_far, HALF_PI, np.where(is_middle, _PI_OVER_4, ZERO))
    z = r * r
    p = np.float32(8.053_744_5e-2) * z + np.float32(-1.387_768_6e-1)
    p = p * z + np.float32(1.997_771_1e-1)
    p = p * z + np.float32(-3.333_294_9e-1)
    y = base + (p * z * r + r)
    return np.where(x < 0, -y, y)
