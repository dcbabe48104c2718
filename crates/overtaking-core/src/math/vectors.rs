//! Vectors of sixteen numbers, and the operations on them whose bits or speed need care.
//!
//! The engine computes sixteen simulations at a time, a *block*: lane `k` of each vector belongs to the simulation in
//! lane `k` of the block. A *slot* is the number of a vehicle in its simulation.

use core::sync::atomic::{Ordering, compiler_fence};

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16, mask32x16};

use crate::SLOT_CAPACITIES;

/// Number of simulations in a block.
pub const SIMD_LANES: usize = 16;

/// One number of each simulation of a block.
pub type F32<S> = f32x16<S>;
/// One truth value of each simulation of a block.
pub type Mask<S> = mask32x16<S>;

/// The same number in every lane.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, value: f32) -> F32<S> {
    F32::splat(simd, value)
}

/// `a` where `mask` holds, else `b`.
#[inline(always)]
pub fn select<S: Simd>(mask: Mask<S>, a: F32<S>, b: F32<S>) -> F32<S> {
    mask.select(a, b)
}

/// Assign `value` to the lanes of `place` where `mask` holds.
///
/// The fence produces no instruction. It separates the load from the store; without it, LLVM 22 merges both into a
/// masked store, which takes a dozen cycles on AMD CPUs up to Zen 3 (llvm-project, issue 213195).
#[inline(always)]
pub fn assign_where<S: Simd>(place: &mut F32<S>, mask: Mask<S>, value: F32<S>) {
    let previous = *place;
    compiler_fence(Ordering::SeqCst);
    *place = select(mask, value, previous);
}

/// Whether the CPU instructions for minimum and maximum return the second of two equal values.
///
/// This matters for 0 and -0, which are equal: x86 returns the second one, ARM orders them.
const SECOND_OF_EQUALS: bool = cfg!(any(target_arch = "x86", target_arch = "x86_64"));

/// The smaller of two values; `b` where they are equal.
#[inline(always)]
pub fn min<S: Simd>(a: F32<S>, b: F32<S>) -> F32<S> {
    if SECOND_OF_EQUALS {
        a.min(b)
    } else {
        a.simd_lt(b).select(a, b)
    }
}

/// The larger of two values; `b` where they are equal.
#[inline(always)]
pub fn max<S: Simd>(a: F32<S>, b: F32<S>) -> F32<S> {
    if SECOND_OF_EQUALS {
        a.max(b)
    } else {
        a.simd_gt(b).select(a, b)
    }
}

/// The larger of `a` and one number for all lanes.
#[inline(always)]
pub fn at_least<S: Simd>(a: F32<S>, b: f32) -> F32<S> {
    max(a, splat(a.simd, b))
}

/// The smaller of `a` and one number for all lanes.
#[inline(always)]
pub fn at_most<S: Simd>(a: F32<S>, b: f32) -> F32<S> {
    min(a, splat(a.simd, b))
}

/// `value` limited to [low, high].
#[inline(always)]
pub fn clamp<S: Simd>(value: F32<S>, low: F32<S>, high: F32<S>) -> F32<S> {
    min(max(value, low), high)
}

/// `value` limited to [low, high], with the same limits in all lanes.
#[inline(always)]
pub fn clamp_to<S: Simd>(value: F32<S>, low: f32, high: f32) -> F32<S> {
    clamp(value, splat(value.simd, low), splat(value.simd, high))
}

/// Largest whole number not above `x`, for |x| < 2^22. The result is -0 only if `x` is -0.
#[inline(always)]
pub fn floor<S: Simd>(x: F32<S>) -> F32<S> {
    let nearest = x.round_ties_even();
    select(nearest.simd_gt(x), nearest - 1.0, nearest)
}

/// Data of a block that can be copied for one simulation, from a lane of one block to a lane of another.
pub trait CopyLane {
    /// Copy lane `source_lane` of `source` into lane `lane`.
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize);
}

impl<S: Simd> CopyLane for F32<S> {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self.as_mut_slice()[lane] = source.as_slice()[source_lane];
    }
}

impl CopyLane for [u32; SIMD_LANES] {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        self[lane] = source[source_lane];
    }
}

impl<T: CopyLane, const K: usize> CopyLane for [T; K] {
    fn copy_lane(&mut self, lane: usize, source: &Self, source_lane: usize) {
        for (element, source_element) in self.iter_mut().zip(source) {
            element.copy_lane(lane, source_element, source_lane);
        }
    }
}

/// Evaluate an expression with the SIMD type of a level.
///
/// The second form has an expression of its own for AVX-512 and for AVX2, which `overtaking-avx` compiles. SSE4.2 uses
/// the code of SSE2, so that one portable variant is compiled for x86.
#[macro_export]
macro_rules! dispatch {
    ($level:expr, |$simd:ident| $body:expr) => {
        $crate::dispatch!($level, |$simd| avx512: $body, avx2: $body, portable: $body)
    };
    ($level:expr, |$simd:ident| avx512: $avx512:expr, avx2: $avx2:expr, portable: $portable:expr) => {
        match $level {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Avx512($simd) => $avx512,
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Avx2($simd) => $avx2,
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            fearless_simd::Level::Sse4_2(_) | fearless_simd::Level::Sse2(_) => {
                match $level.as_sse2() {
                    Some($simd) => $portable,
                    None => unreachable!("a level above SSE2 has SSE2"),
                }
            }
            #[cfg(target_arch = "aarch64")]
            fearless_simd::Level::Neon($simd) => $portable,
            #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
            fearless_simd::Level::Fallback($simd) => $portable,
            _ => unreachable!("every level of this architecture is handled"),
        }
    };
}
pub(crate) use dispatch;

/// Evaluate an expression in a separate function that is compiled for the SIMD features of the CPU.
macro_rules! with_cpu_features {
    ($simd:expr, $body:expr) => {
        $simd.vectorize(
            #[inline(always)]
            || $body,
        )
    };
}
pub(crate) use with_cpu_features;

/// Whether `each_at_slot` loads one value for each simulation; if not, it compares every slot of the block with `slot`.
///
/// With up to 8 slots, seven comparisons are faster than sixteen loads. Where a vector is as wide as a block (AVX-512),
/// comparisons are faster for any number of slots, because one comparison then serves all sixteen simulations.
/// `_slot` only states the SIMD level.
#[inline(always)]
pub fn loads_own_slot<S: Simd>(_slot: F32<S>, capacity: usize) -> bool {
    let is_block_wide = size_of::<S::f32s>() >= size_of::<[f32; SIMD_LANES]>();
    capacity > SLOT_CAPACITIES[0] && !is_block_wide
}

/// Slots as indices; 0 for `NO_SLOT`, which is -1.
#[inline(always)]
pub fn slot_indices<S: Simd>(slot: F32<S>) -> [usize; SIMD_LANES] {
    let indices: i32x16<S> = at_least(slot, 0.0).to_int();
    indices.to_array().map(|index| index as usize)
}

/// Several values of vehicle `slot` in each simulation; the values of slot 0 where no vehicle has that slot.
///
/// `$params` are the parameters of the block, and the list gives the values of slot `$j`. This is a macro, because the
/// compiler may compile a closure as a separate function without the SIMD features of the CPU.
macro_rules! each_at_slot {
    ($params:expr, $slot:expr, |$j:ident| [$($value:expr),* $(,)?]) => {{
        let (params, slot) = ($params, $slot);
        let capacity = params.vehicles.len();
        if $crate::math::vectors::loads_own_slot(slot, capacity) {
            let indices = $crate::math::vectors::slot_indices(slot);
            [$({
                let mut picked = [0.0; $crate::math::vectors::SIMD_LANES];
                for (lane, picked) in picked.iter_mut().enumerate() {
                    // No slot reaches the capacity; with the remainder the compiler drops the check of the bounds.
                    let $j = indices[lane] % capacity;
                    *picked = $value[lane];
                }
                $crate::math::vectors::F32::simd_from(slot.simd, picked)
            }),*]
        } else {
            let mut picked = {
                let $j = 0;
                [$($value),*]
            };
            for $j in 1..params.num_slots_in_use {
                let is_slot = slot.simd_eq($j as i32 as f32);
                for (picked, value) in picked.iter_mut().zip([$($value),*]) {
                    *picked = $crate::math::vectors::select(is_slot, value, *picked);
                }
            }
            picked
        }
    }};
}
pub(crate) use each_at_slot;

/// One value of vehicle `slot` in each simulation, as `each_at_slot`.
macro_rules! at_slot {
    ($params:expr, $slot:expr, |$j:ident| $value:expr) => {{
        let [value] = $crate::math::vectors::each_at_slot!($params, $slot, |$j| [$value]);
        value
    }};
}
pub(crate) use at_slot;
