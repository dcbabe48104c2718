//! Perception of the drivers at a decision; the twin of `overtaking.sim.reference.decision_context`.
//!
//! A block is a set of simulations that run side by side, one in each lane of a SIMD vector. `N` is the number of
//! vehicle slots.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{Mask, splat};
use crate::neighbour_search::{Neighbours, VisibleBody};
use crate::oncoming::{OncomingSearch, OncomingTraffic};
use crate::perception::Beliefs;
use crate::state::PerVehicle;

/// Perception of one driver at a decision.
///
/// `Copy`, so that `run::stepped_batch` can keep the ego's context until the action of an external driver arrives.
#[derive(Clone, Copy)]
pub struct DriverContext<S: Simd> {
    /// Slot of the driver.
    pub slot: usize,
    /// The nearest vehicles of the own direction, by role: ahead and behind in the own and both adjacent lanes.
    pub neighbours: Neighbours<S>,
    /// Beliefs of the driver about them.
    pub beliefs: Beliefs<S>,
    /// Vehicles of the other direction.
    ///
    /// On one-way roads it keeps the values of `empty`: all blocks that use the context in turn are on the same road.
    pub oncoming: OncomingTraffic<S>,
    /// Whether the driver checks mirrors and adjacent lanes at this decision.
    pub checks_mirrors: Mask<S>,
    /// Whether another driver that indicates for the same gap goes first.
    ///
    /// Set for the ego only. `change_lanes_by_mobil` computes it for the other drivers, and only on one-way roads: two
    /// drivers enter one lane from both sides only where there are three lanes, which two-way roads do not have.
    pub gives_way: Mask<S>,
    /// Index of the decision since the start of the simulation, 20 per second.
    pub decision_index: u32,
}

impl<S: Simd> DriverContext<S> {
    /// The context of the driver in `slot` before its first look.
    pub fn empty(simd: S, slot: usize) -> Self {
        Self {
            slot,
            neighbours: Neighbours::no_vehicles(simd),
            beliefs: Beliefs::without_neighbours(simd),
            oncoming: OncomingTraffic::no_vehicles(simd),
            checks_mirrors: never(simd),
            gives_way: never(simd),
            decision_index: 0,
        }
    }
}

/// Positions of all vehicles.
pub struct RoadPositions<S: Simd, const N: usize> {
    /// Stations [m].
    pub s: PerVehicle<S, N>,
    /// Lateral positions [m].
    pub d: PerVehicle<S, N>,
}

/// The contexts of all drivers of a `run::block`, and what is computed once for all of them.
///
/// A thread has one and overwrites it at every decision of every block. It has several KiB; moving it would cost more
/// than some of the computations that read it.
pub struct DecisionContext<S: Simd, const N: usize> {
    /// The context of each driver, by slot.
    pub drivers: [DriverContext<S>; N],
    /// Sides, lane, indicator and rear lamps of each vehicle, as other drivers see them.
    pub bodies: [VisibleBody<S>; N],
    /// Which vehicles can meet which, on two-way roads.
    pub oncoming_search: OncomingSearch<S, N>,
    /// Largest acceleration of each driver except the ego [m/s^2].
    ///
    /// `drive_others` writes it before it reads it. It is a field only so that the next decision uses the same memory.
    pub accel_limit: PerVehicle<S, N>,
    /// Positions at the start of an integration step, from which contacts are swept.
    ///
    /// A field only so that steps use the same memory: each step in which two vehicles may touch writes it, and
    /// decisions do not read it.
    pub step_start: RoadPositions<S, N>,
}

impl<S: Simd, const N: usize> DecisionContext<S, N> {
    /// Memory for the contexts of one thread.
    pub fn new(simd: S) -> Self {
        let zero = [splat(simd, 0.0); N];
        Self {
            drivers: core::array::from_fn(|slot| DriverContext::empty(simd, slot)),
            bodies: [VisibleBody::no_vehicle(simd); N],
            oncoming_search: OncomingSearch::no_vehicles(simd),
            accel_limit: zero,
            step_start: RoadPositions { s: zero, d: zero },
        }
    }
}

/// True in no simulation.
fn never<S: Simd>(simd: S) -> Mask<S> {
    let zero = splat(simd, 0.0);
    zero.simd_lt(zero)
}
