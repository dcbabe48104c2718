//! What drivers know at a decision; see `overtaking.sim.reference.moment`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, splat};
use crate::neighbours::{Body, Neighbours};
use crate::oncoming::Encounters;
use crate::perception::Beliefs;
use crate::state::{EGO, Each};
use crate::traffic::Traffic;

/// Who drives around each vehicle and what its driver believes: written anew at every decision, and
/// kept in one place, as moving it costs more than some of what is computed from it.
pub struct Minds<S: Simd, const N: usize> {
    pub bodies: [Body<S>; N],
    pub near: [Neighbours<S>; N],
    pub believed: [Beliefs<S>; N],
    pub looks: [M<S>; N],
    /// Whom they meet, and what they look for; unused on roads of one direction.
    pub met: [Encounters<S>; N],
    pub traffic: Traffic<S, N>,
    /// Whether the ego would let somebody first who signals for the same place.
    pub waits: M<S>,
    /// Positions along and across the road before a step, if anybody is near anybody.
    pub before: (Each<S, N>, Each<S, N>),
}

impl<S: Simd, const N: usize> Minds<S, N> {
    /// Before anyone has looked.
    pub fn new(simd: S) -> Self {
        Self {
            bodies: [Body::nothing(simd); N],
            near: [Neighbours::nobody(simd); N],
            believed: [Beliefs::nothing(simd); N],
            looks: [never(simd); N],
            met: [Encounters::nobody(simd); N],
            traffic: Traffic::nobody(simd),
            waits: never(simd),
            before: ([splat(simd, 0.0); N], [splat(simd, 0.0); N]),
        }
    }
}

/// What a driver knows when it decides.
#[derive(Clone, Copy)]
pub struct Mind<'a, S: Simd> {
    pub near: &'a Neighbours<S>,
    pub believed: &'a Beliefs<S>,
    pub met: &'a Encounters<S>,
    pub looks: M<S>,
    pub waits: M<S>,
}

impl<S: Simd, const N: usize> Minds<S, N> {
    /// What the driver of the ego knows.
    pub fn of_ego(&self) -> Mind<'_, S> {
        Mind {
            near: &self.near[EGO],
            believed: &self.believed[EGO],
            met: &self.met[EGO],
            looks: self.looks[EGO],
            waits: self.waits,
        }
    }

    /// What the driver of another vehicle knows on a two-way road. No two vehicles change into one lane from both of
    /// its sides there, as that takes three lanes, so the driver gives way to nobody.
    pub fn of_other(&self, i: usize) -> Mind<'_, S> {
        Mind {
            near: &self.near[i],
            believed: &self.believed[i],
            met: &self.met[i],
            looks: self.looks[i],
            waits: self.waits & !self.waits,
        }
    }
}

/// In no simulation.
fn never<S: Simd>(simd: S) -> M<S> {
    let zero = splat(simd, 0.0);
    zero.simd_lt(zero)
}
