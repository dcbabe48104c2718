//! Elementary functions of `f32` with the same bits on every machine.
//!
//! `overtaking.core.float32_math` has the same operations in the same order, and the source of the polynomials, the
//! Cephes library. Functions of the system are not used, because their last bit differs between systems.

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

/// e to the power `x`, `x` clamped to [-87, 88].
#[inline(always)]
pub fn exp<S: Simd>(x: F32<S>) -> F32<S> {
    let x = clamp_to(x, -87.0, 88.0);
    let k = (x * 1.442_695_04).round_ties_even();
    // ln 2 in two parts, so that the subtraction loses no digits.
    let r = x - k * 0.693_359_375 - k * -2.121_944_4e-4;
    let p = 1.987_569_1e-4 * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 0.5;
    let value = p * (r * r) + r + 1.0;
    let exponent: i32x16<S> = k.to_int();
    value * int_as_float((exponent + 127) << 23)
}

/// Natural logarithm of `x`; a smaller `x` counts as the smallest positive normal number.
#[inline(always)]
pub fn log<S: Simd>(x: F32<S>) -> F32<S> {
    let x = at_least(x, 1.175_494_4e-38);
    let bits = bits_as_int(x);
    let exponent: F32<S> = ((bits >> 23) - 126).to_float();
    let m = int_as_float((bits & 0x007F_FFFF) | 0x3F00_0000);
    let low = m.simd_lt(0.707_106_77);
    let e = select(low, exponent - 1.0, exponent);
    let m = select(low, m + m, m) - 1.0;
    let z = m * m;
    let p = 7.037_683_6e-2 * m + -1.151_461e-1;
    let p = p * m + 1.167_699_9e-1;
    let p = p * m + -1.242_014_1e-1;
    let p = p * m + 1.424_932_3e-1;
    let p = p * m + -1.666_805_8e-1;
    let p = p * m + 2.000_071_5e-1;
    let p = p * m + -2.499_999_4e-1;
    let p = p * m + 3.333_333_1e-1;
    let y = p * m * z + e * -2.121_944_4e-4 - 0.5 * z;
    m + y + e * 0.693_359_375
}

/// Sine and cosine of angles [rad].
///
/// If all sixteen angles are below 0.78, just under pi / 4, the quadrant is 0 and the reduction of the angle would
/// change no bit, so it is left out.
#[inline(always)]
pub fn sincos<S: Simd>(x: F32<S>) -> (F32<S>, F32<S>) {
    if x.abs().simd_lt(0.78).all_true() {
        // Adding 0 turns -0 into 0, as the reduction would.
        return sincos_reduced(x + 0.0);
    }
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

/// Sine and cosine of any angles: reduced by quarters of a turn, then exchanged and negated by quadrant.
#[inline(always)]
fn sincos_full<S: Simd>(x: F32<S>) -> (F32<S>, F32<S>) {
    let k = (x * 0.636_619_77).round_ties_even();
    // Pi / 2 in three parts, so that the subtraction loses no digits.
    let r = x - k * 1.570_312_5 - k * 4.837_512_969_970_703e-4 - k * 7.549_789_95e-8;
    let quarter_turns: i32x16<S> = k.to_int();
    let quadrant = quarter_turns & 3;
    let (s, c) = sincos_reduced(r);
    let odd = (quadrant & 1).simd_eq(1);
    let sine = select(odd, c, s);
    let cosine = select(odd, s, c);
    let sine = select(quadrant.simd_ge(2), -sine, sine);
    let flip = quadrant.simd_eq(1) | quadrant.simd_eq(2);
    (sine, select(flip, -cosine, cosine))
}

/// Inverse tangent [rad].
#[inline(always)]
pub fn atan<S: Simd>(x: F32<S>) -> F32<S> {
    let simd = x.simd;
    let magnitude = x.abs();
    let far = magnitude.simd_gt(2.414_213_7);
    let middle = magnitude.simd_gt(0.414_213_57) & !far;
    let divisor = select(far, magnitude, magnitude + 1.0);
    let numerator = select(far, splat(simd, -1.0), magnitude - 1.0);
    let r = select(far | middle, numerator / divisor, magnitude);
    let base = select(
        far,
        splat(simd, 1.570_796_4),
        select(middle, splat(simd, 0.785_398_2), splat(simd, 0.0)),
    );
    let z = r * r;
    let p = 8.053_744_5e-2 * z + -1.387_768_6e-1;
    let p = p * z + 1.997_771_1e-1;
    let p = p * z + -3.333_294_9e-1;
    let y = base + (p * z * r + r);
    select(x.simd_lt(0.0), -y, y)
}
