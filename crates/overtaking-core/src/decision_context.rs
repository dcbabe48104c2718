//! What drivers know at a decision; see `overtaking.sim.reference.decision_context`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{Mask, splat};
use crate::neighbour_search::{Neighbours, VisibleBody};
use crate::oncoming::OncomingSearch;
use crate::oncoming::OncomingTraffic;
use crate::perception::Beliefs;
use crate::state::{EGO_SLOT, PerVehicle};

/// Who drives around each vehicle and what its driver believes: written anew at every decision, and
/// kept in one place, as moving it costs more than some of what is computed from it.
pub struct DecisionContext<S: Simd, const N: usize> {
    pub bodies: [VisibleBody<S>; N],
    pub neighbours: [Neighbours<S>; N],
    pub beliefs: [Beliefs<S>; N],
    pub checks_mirrors: [Mask<S>; N],
    /// Whom they meet, and what they look for; unused on roads of one direction.
    pub oncoming: [OncomingTraffic<S>; N],
    pub oncoming_search: OncomingSearch<S, N>,
    /// Whether the ego would let somebody first who signals for the same place.
    pub gives_way: Mask<S>,
    /// Positions along and across the road before a step, if anybody is near anybody.
    pub step_start: (PerVehicle<S, N>, PerVehicle<S, N>),
}

impl<S: Simd, const N: usize> DecisionContext<S, N> {
    /// Before anyone has looked.
    pub fn new(simd: S) -> Self {
        Self {
            bodies: [VisibleBody::nothing(simd); N],
            neighbours: [Neighbours::nobody(simd); N],
            beliefs: [Beliefs::nothing(simd); N],
            checks_mirrors: [never(simd); N],
            oncoming: [OncomingTraffic::nobody(simd); N],
            oncoming_search: OncomingSearch::nobody(simd),
            gives_way: never(simd),
            step_start: ([splat(simd, 0.0); N], [splat(simd, 0.0); N]),
        }
    }
}

/// What a driver knows when it decides.
#[derive(Clone, Copy)]
pub struct DriverContext<'a, S: Simd> {
    pub neighbours: &'a Neighbours<S>,
    pub beliefs: &'a Beliefs<S>,
    pub oncoming: &'a OncomingTraffic<S>,
    pub checks_mirrors: Mask<S>,
    pub gives_way: Mask<S>,
}

impl<S: Simd, const N: usize> DecisionContext<S, N> {
    /// What the driver of the ego knows.
    pub fn of_ego(&self) -> DriverContext<'_, S> {
        DriverContext {
            neighbours: &self.neighbours[EGO_SLOT],
            beliefs: &self.beliefs[EGO_SLOT],
            oncoming: &self.oncoming[EGO_SLOT],
            checks_mirrors: self.checks_mirrors[EGO_SLOT],
            gives_way: self.gives_way,
        }
    }

    /// What the driver of another vehicle knows on a two-way road. No two vehicles change into one lane from both of
    /// its sides there, as that takes three lanes, so the driver gives way to nobody.
    pub fn of_other(&self, i: usize) -> DriverContext<'_, S> {
        DriverContext {
            neighbours: &self.neighbours[i],
            beliefs: &self.beliefs[i],
            oncoming: &self.oncoming[i],
            checks_mirrors: self.checks_mirrors[i],
            gives_way: self.gives_way & !self.gives_way,
        }
    }
}

/// In no simulation.
fn never<S: Simd>(simd: S) -> Mask<S> {
    let zero = splat(simd, 0.0);
    zero.simd_lt(zero)
}
