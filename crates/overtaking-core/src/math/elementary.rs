//! Elementary functions of `f32` with the same bits on every machine.
//!
//! `overtaking.core.float32_math` has the same operations in the same order. Its docstrings cite the source of the
//! polynomials, the Cephes library, and state the largest errors. The functions of the system would not do, because
//! their last bit differs between systems.
//!
//! As in Python, `r` or `m` is the argument mapped to a small interval around 0, `z` its square and `p` the polynomial.
//! `s` and `c` are the sine and cosine of `r`.

// The coefficients are written as in Python, so that both can be compared digit by digit.
#![allow(clippy::excessive_precision, clippy::approx_constant)]

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::math::vectors::{F32, at_least, clamp_to, select, splat};

#[inline(always)]
fn bits_as_int<S: Simd>(x: F32<S>) -> i32x16<S> {
    x.to_bits().bitcast()
}

#[inline(always)]
fn int_as_float<S: Simd>(x: i32x16<S>) -> F32<S> {
    let bits: u32x16<S> = x.bitcast();
    F32::from_bits(bits)
}

/// e to the power `x`; `x` is clamped to [-87, 88], so that the result is neither 0 nor infinite.
#[inline(always)]
pub fn exp<S: Simd>(x: F32<S>) -> F32<S> {
    let x = clamp_to(x, -87.0, 88.0);
    // exp(x) = 2^k * exp(r) with |r| <= ln(2) / 2.
    let k = (x * 1.442_695_04).round_ties_even();
    // ln 2 in two parts. The product of `k` and the first part is exact, so the subtraction loses no digits.
    let r = x - k * 0.693_359_375 - k * -2.121_944_4e-4;
    let p = 1.987_569_1e-4 * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 0.5;
    let exp_r = p * (r * r) + r + 1.0;
    // A float stores the exponent of its power of 2, plus 127, from bit 23 on: this makes 2^k.
    let exponent: i32x16<S> = k.to_int();
    exp_r * int_as_float((exponent + 127) << 23)
}

/// Natural logarithm of `x`; an `x` below 2^-126, the smallest positive normal number, counts as 2^-126, so that the
/// result is finite.
#[inline(always)]
pub fn log<S: Simd>(x: F32<S>) -> F32<S> {
    let x = at_least(x, 1.175_494_4e-38);
    // x = fraction * 2^exponent with the fraction in [0.5, 1). The bits hold the exponent, plus 127, for a fraction in
    // [1, 2); for half that fraction it is larger by 1, so 126 is subtracted. 0x3F00_0000 are the bits of 0.5.
    let bits = bits_as_int(x);
    let exponent: F32<S> = ((bits >> 23) - 126).to_float();
    let fraction = int_as_float((bits & 0x007F_FFFF) | 0x3F00_0000);
    // Move the fraction to [sqrt(0.5), sqrt(2)): log(x) = log(1 + m) + e * ln(2), with m around 0.
    let is_below = fraction.simd_lt(0.707_106_77);
    let e = select(is_below, exponent - 1.0, exponent);
    let m = select(is_below, fraction + fraction, fraction) - 1.0;
    let z = m * m;
    let p = 7.037_683_6e-2 * m + -1.151_461e-1;
    let p = p * m + 1.167_699_9e-1;
    let p = p * m + -1.242_014_1e-1;
    let p = p * m + 1.424_932_3e-1;
    let p = p * m + -1.666_805_8e-1;
    let p = p * m + 2.000_071_5e-1;
    let p = p * m + -2.499_999_4e-1;
    let p = p * m + 3.333_333_1e-1;
    // log(1 + m) = m - m^2 / 2 + m^3 p(m), and ln 2 is in two parts. The largest terms are added last: the smaller ones
    // would lose bits beside them.
    let y = p * m * z + e * -2.121_944_4e-4 - 0.5 * z;
    m + y + e * 0.693_359_375
}

/// Sine and cosine of angles [rad]; absolute error below 1e-7 up to 1000 rad, else larger.
///
/// If all sixteen angles are below 0.78, just under pi / 4, the quadrant is 0, and the reduction of the angle would
/// only turn -0 into 0, so it is left out.
#[inline(always)]
pub fn sincos<S: Simd>(x: F32<S>) -> (F32<S>, F32<S>) {
    if x.abs().simd_lt(0.78).all_true() {
        // Adding 0 turns -0 into 0 as well.
        return sincos_reduced(x + 0.0);
    }
    // A function of its own, so that the rare case is not inlined at every call of `sincos`.
    x.simd.vectorize(
        #[inline(always)]
        || sincos_full(x),
    )
}

/// Sine and cosine of angles from -pi / 4 to pi / 4.
#[inline(always)]
fn sincos_reduced<S: Simd>(r: F32<S>) -> (F32<S>, F32<S>) {
    let z = r * r;
    let s = -1.951_529_6e-4 * z + 8.332_161e-3;
    let s = s * z + -1.666_665_5e-1;
    let s = s * z * r + r;
    let c = 2.443_315_7e-5 * z + -1.388_731_6e-3;
    let c = c * z + 4.166_664_6e-2;
    let c = c * (z * z) - 0.5 * z + 1.0;
    (s, c)
}

/// Sine and cosine of angles in any quadrant: reduced by quarters of a turn, then exchanged and negated by quadrant.
#[inline(always)]
fn sincos_full<S: Simd>(x: F32<S>) -> (F32<S>, F32<S>) {
    let k = (x * 0.636_619_77).round_ties_even();
    // Pi / 2 in three parts, so that the subtraction loses no digits; 0.6366 is 2 / pi.
    let r = x - k * 1.570_312_5 - k * 4.837_512_969_970_703e-4 - k * 7.549_789_95e-8;
    let quarter_turns: i32x16<S> = k.to_int();
    let quadrant = quarter_turns & 3;
    let (s, c) = sincos_reduced(r);
    let is_odd = (quadrant & 1).simd_eq(1);
    let sine = select(is_odd, c, s);
    let cosine = select(is_odd, s, c);
    let sine = select(quadrant.simd_ge(2), -sine, sine);
    let is_left = quadrant.simd_eq(1) | quadrant.simd_eq(2);
    (sine, select(is_left, -cosine, cosine))
}

/// Inverse tangent [rad].
#[inline(always)]
pub fn atan<S: Simd>(x: F32<S>) -> F32<S> {
    let simd = x.simd;
    let magnitude = x.abs();
    // atan(magnitude) = base + atan(r) with |r| <= tan(pi / 8), in three ranges of the magnitude:
    //   up to tan(pi / 8)    base = 0       r = magnitude
    //   up to tan(3 pi / 8)  base = pi / 4  r = (magnitude - 1) / (magnitude + 1)
    //   beyond               base = pi / 2  r = -1 / magnitude
    let is_far = magnitude.simd_gt(2.414_213_7);
    let is_middle = magnitude.simd_gt(0.414_213_57) & !is_far;
    let divisor = select(is_far, magnitude, magnitude + 1.0);
    let numerator = select(is_far, splat(simd, -1.0), magnitude - 1.0);
    let r = select(is_far | is_middle, numerator / divisor, magnitude);
    let base = select(
        is_far,
        splat(simd, 1.570_796_4),
        select(is_middle, splat(simd, 0.785_398_2), splat(simd, 0.0)),
    );
    let z = r * r;
    let p = 8.053_744_5e-2 * z + -1.387_768_6e-1;
    let p = p * z + 1.997_771_1e-1;
    let p = p * z + -3.333_294_9e-1;
    let y = base + (p * z * r + r);
    select(x.simd_lt(0.0), -y, y)
}
