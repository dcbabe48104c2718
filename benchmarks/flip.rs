//! Operators that can be flipped one at a time; `flips.py` adds this module to a copy of the engine.

use crate::math::vectors;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16, mask32x16};
use std::sync::LazyLock;

static FLIPPED: LazyLock<u32> = LazyLock::new(|| {
    std::env::var("OVERTAKING_FLIP")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(u32::MAX)
});

#[inline(always)]
fn is_flipped(number: u32) -> bool {
    *FLIPPED == number
}

#[inline(always)]
pub fn sign(number: u32) -> f32 {
    if is_flipped(number) { -1.0 } else { 1.0 }
}

#[inline(always)]
pub fn role(number: u32, role: usize) -> usize {
    if is_flipped(number) { role ^ 1 } else { role }
}

type V<S> = f32x16<S>;

#[inline(always)]
pub fn flip_min<S: Simd>(number: u32, a: V<S>, b: V<S>) -> V<S> {
    if is_flipped(number) {
        vectors::max(a, b)
    } else {
        vectors::min(a, b)
    }
}

#[inline(always)]
pub fn flip_max<S: Simd>(number: u32, a: V<S>, b: V<S>) -> V<S> {
    if is_flipped(number) {
        vectors::min(a, b)
    } else {
        vectors::max(a, b)
    }
}

#[inline(always)]
pub fn flip_at_most<S: Simd>(number: u32, a: V<S>, b: f32) -> V<S> {
    if is_flipped(number) {
        vectors::at_least(a, b)
    } else {
        vectors::at_most(a, b)
    }
}

#[inline(always)]
pub fn flip_at_least<S: Simd>(number: u32, a: V<S>, b: f32) -> V<S> {
    if is_flipped(number) {
        vectors::at_most(a, b)
    } else {
        vectors::at_least(a, b)
    }
}

macro_rules! comparisons { ($($own:ident: $normal:ident $flipped:ident),*) => {
    pub trait Flip<S: Simd>: Sized {
        $(fn $own(self, number: u32, other: impl SimdInto<Self, S>) -> mask32x16<S>;)*
    }
    macro_rules! for_kind { ($kind:ident) => { impl<S: Simd> Flip<S> for $kind<S> { $(
        #[inline(always)]
        fn $own(self, number: u32, other: impl SimdInto<Self, S>) -> mask32x16<S> {
            let other: Self = other.simd_into(self.simd);
            if is_flipped(number) { self.$flipped(other) } else { self.$normal(other) }
        }
    )* } } }
    for_kind!(f32x16);
    for_kind!(i32x16);
} }

comparisons!(flip_lt: simd_lt simd_gt, flip_gt: simd_gt simd_lt, flip_le: simd_le simd_ge,
    flip_ge: simd_ge simd_le, flip_eq: simd_eq simd_ne, flip_ne: simd_ne simd_eq);
