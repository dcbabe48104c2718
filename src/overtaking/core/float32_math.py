"""Elementary functions in float32 that have the same bits on every machine.

NumPy's and libm's last bits depend on the CPU and the version, so the simulator uses these instead:
only additions, multiplications, divisions, comparisons and integer shifts of float32, written once
here and once in `crates/overtaking-core/src/elementary.rs`, with the same operations in the same
order. The argument reductions and minimax polynomials come from the Cephes library, single
precision (Moshier, *Methods and Programs for Mathematical Functions*, 1989). Tests bound the error
against mpmath.
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
_LN2_HIGH = np.float32(0.693_359_375)
_LN2_LOW = np.float32(-2.121_944_4e-4)
_SQRT_HALF = np.float32(0.707_106_77)
_TWO_OVER_PI = np.float32(0.636_619_77)
_HALF_PI_HIGH = np.float32(1.570_312_5)
_HALF_PI_MIDDLE = np.float32(4.837_512_969_970_703e-4)
_HALF_PI_LOW = np.float32(7.549_789_95e-8)
_PI_OVER_4 = np.float32(0.785_398_2)
_TAN_3PI_8 = np.float32(2.414_213_7)
_TAN_PI_8 = np.float32(0.414_213_57)


def as_f32(value: Any) -> F32:
    """`value` as a float32 array, rounding once to nearest even."""
    return np.asarray(value, dtype=np.float32)


def minimum(a: F32Like, b: F32Like) -> F32:
    """The smaller of two values; `b` where they are equal, as in the engine."""
    return np.where(a < b, a, b)


def maximum(a: F32Like, b: F32Like) -> F32:
    """The larger of two values; `b` where they are equal, as in the engine."""
    return np.where(a > b, a, b)


def clamp(value: F32Like, low: F32Like, high: F32Like) -> F32:
    """`value` limited to [low, high]."""
    return minimum(maximum(value, low), high)


def exp(x: F32Like) -> F32:
    """E to the power `x`, relative error below 2 ulp; `x` is clamped to [-87, 88]."""
    x = clamp(as_f32(x), np.float32(-87.0), np.float32(88.0))
    k = np.rint(x * _LOG2_E)
    r = x - k * _LN2_HIGH - k * _LN2_LOW
    p = np.float32(1.987_569_1e-4) * r + np.float32(1.398_199_9e-3)
    p = p * r + np.float32(8.333_452e-3)
    p = p * r + np.float32(4.166_579_6e-2)
    p = p * r + np.float32(1.666_666_5e-1)
    p = p * r + HALF
    value = p * (r * r) + r + ONE
    return value * ((k.astype(np.int32) + 127) << 23).view(np.float32)


def log(x: F32Like) -> F32:
    """Natural logarithm, error below 2 ulp or 1e-7; anything below 1.2e-38 counts as that."""
    x = maximum(as_f32(x), np.float32(1.175_494_4e-38))
    bits = x.view(np.int32)
    exponent = ((bits >> 23) - 126).astype(np.float32)
    m = ((bits & 0x007F_FFFF) | 0x3F00_0000).view(np.float32)
    low = m < _SQRT_HALF
    e = np.where(low, exponent - ONE, exponent)
    m = np.where(low, m + m, m) - ONE
    z = m * m
    p = np.float32(7.037_683_6e-2) * m + np.float32(-1.151_461e-1)
    p = p * m + np.float32(1.167_699_9e-1)
    p = p * m + np.float32(-1.242_014_1e-1)
    p = p * m + np.float32(1.424_932_3e-1)
    p = p * m + np.float32(-1.666_805_8e-1)
    p = p * m + np.float32(2.000_071_5e-1)
    p = p * m + np.float32(-2.499_999_4e-1)
    p = p * m + np.float32(3.333_333_1e-1)
    y = p * m * z + e * _LN2_LOW - HALF * z
    return m + y + e * _LN2_HIGH


def power(base: F32Like, exponent: F32Like) -> F32:
    """`base ** exponent` for a positive base: exp(exponent * log(base))."""
    return exp(as_f32(exponent) * log(base))


def sincos(x: F32Like) -> tuple[F32, F32]:
    """Sine and cosine, absolute error below 1e-7 for |x| <= 1000."""
    x = as_f32(x)
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
    odd = (quadrant & 1) == 1
    sine = np.where(odd, c, s)
    cosine = np.where(odd, s, c)
    sine = np.where(quadrant >= 2, -sine, sine)
    cosine = np.where((quadrant == 1) | (quadrant == 2), -cosine, cosine)
    return sine, cosine


def atan(x: F32Like) -> F32:
    """Inverse tangent, error below 3 ulp."""
    x = as_f32(x)
    magnitude = np.abs(x)
    far = magnitude > _TAN_3PI_8
    middle = (magnitude > _TAN_PI_8) & ~far
    divisor = np.where(far, magnitude, magnitude + ONE)
    numerator = np.where(far, np.float32(-1.0), magnitude - ONE)
    r = np.where(far | middle, numerator / np.where(divisor == 0, ONE, divisor), magnitude)
    base = np.where(far, HALF_PI, np.where(middle, _PI_OVER_4, ZERO))
    z = r * r
    p = np.float32(8.053_744_5e-2) * z + np.float32(-1.387_768_6e-1)
    p = p * z + np.float32(1.997_771_1e-1)
    p = p * z + np.float32(-3.333_294_9e-1)
    y = base + (p * z * r + r)
    return np.where(x < 0, -y, y)
