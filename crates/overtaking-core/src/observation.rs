//! The table that an external driver of the ego observes; see `overtaking.sim.reference.observation`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::gaps::{faster, is_told};
use crate::intent::{can_abort, can_remain, has_arrived, has_passed, in_stage, is_behind};
use crate::lanes::{M, V, at_most, choose, pick_each, splat};
use crate::moment::Mind;
use crate::oncoming::{Oncoming, look_beyond, usual_closing};
use crate::orders::{can_go_back, can_go_out};
use crate::passing::{is_solid, room_ahead, room_left};
use crate::plight::{can_fall_in, weigh};
use crate::state::{EGO, LEAD, ROLES, State, stage};
use crate::world::World;

/// Source of the observed motion of neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObservationSource {
    /// Beliefs of the model driver.
    Beliefs,
    /// The true state.
    Truth,
}

/// A struct of vectors whose fields are listed once: as fields and as names.
macro_rules! columns {
    ($(#[$doc:meta])* $names:ident, $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        struct $name<S: Simd> { $($field: V<S>),* }

        impl<S: Simd> $name<S> {
            #[inline(always)]
            fn write(self, out: &mut [V<S>]) {
                for (to, from) in out.iter_mut().zip([$(self.$field),*]) {
                    *to = from;
                }
            }
        }
    };
}

columns! {
    /// Columns of the ego, in order.
    EGO_COLUMN_NAMES, EgoColumns {
        speed, requested_accel, s, lateral_position, lane_offset, heading, yaw_rate, lane, stage, time_in_stage,
        time_waiting, time_indicating, wanted_side, time_since_lane_change, has_finished_lane_change, checks_mirrors,
        gives_way, has_passed_target, is_behind_target, can_pull_out, can_return, can_cancel_lane_change,
    }
}

columns! {
    /// Columns of a neighbour, in order.
    NEIGHBOUR_COLUMN_NAMES, NeighbourColumns {
        is_detected, gap, closing_speed, accel, lateral_distance, indicator, stop_lamp, length, is_truck,
        is_two_wheeler,
    }
}

columns! {
    /// Columns about a pass against oncoming traffic, in order; zero on one-way roads.
    PASSING_COLUMN_NAMES, PassingColumns {
        sight_distance, is_certain, expected_closing_speed, gap_ahead_of_leader, tall_vehicle_gap_factor,
        line_is_solid, return_urgency, abort_state, can_abort_pass,
    }
}

/// Number of observed neighbours: the six of the ego's direction, then two oncoming vehicles.
pub const NUM_OBSERVED_ROLES: usize = ROLES + 2;

const NEIGHBOURS_SIZE: usize = NUM_OBSERVED_ROLES * NEIGHBOUR_COLUMN_NAMES.len();

/// Number of values in the observation of one simulation.
pub const OBSERVATION_SIZE: usize =
    EGO_COLUMN_NAMES.len() + NEIGHBOURS_SIZE + PASSING_COLUMN_NAMES.len();

/// The observations of the simulations of a block.
pub type ObservationTable<S> = [V<S>; OBSERVATION_SIZE];

/// Observations of the ego in each simulation of a block.
#[inline(always)]
pub fn observe<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    source: ObservationSource,
    decision: usize,
) -> ObservationTable<S> {
    const NUM_COLUMNS: usize = NEIGHBOUR_COLUMN_NAMES.len();
    let mut table = [splat(w.simd, 0.0); OBSERVATION_SIZE];
    let (ego, rest) = table.split_at_mut(EGO_COLUMN_NAMES.len());
    let (neighbours, passing) = rest.split_at_mut(NEIGHBOURS_SIZE);
    ego_columns(state, w, mind).write(ego);
    let (same_direction, oncoming) = neighbours.split_at_mut(ROLES * NUM_COLUMNS);
    for (role, columns) in same_direction.chunks_exact_mut(NUM_COLUMNS).enumerate() {
        let motion = match source {
            ObservationSource::Beliefs => believed_motion(state, w, mind, role),
            ObservationSource::Truth => true_motion(state, w, mind, role),
        };
        neighbour_columns(state, w, mind, role, motion).write(columns);
    }
    let (near, first) = (mind.near, &mind.met.coming);
    let mut vehicles = [Oncoming::nobody(w.simd); 2];
    if w.road.ways.has_oncoming_traffic {
        vehicles = [*first, look_beyond(state, w, near, first, decision)];
        passing_columns(state, w, mind).write(passing);
    }
    for (vehicle, columns) in vehicles.iter().zip(oncoming.chunks_exact_mut(NUM_COLUMNS)) {
        oncoming_columns(state, w, vehicle, source).write(columns);
    }
    table
}

#[inline(always)]
fn ego_columns<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
) -> EgoColumns<S> {
    let flag = |mask| flag(w.simd, mask);
    let lane_centre = 0.5 * (mind.near.lane_low + mind.near.lane_high);
    EgoColumns {
        speed: state.vx[EGO],
        requested_accel: state.accel[EGO],
        s: state.s[EGO],
        lateral_position: state.d[EGO],
        lane_offset: state.d[EGO] - lane_centre,
        heading: state.psi[EGO],
        yaw_rate: state.r[EGO],
        lane: state.lane[EGO],
        stage: state.stage[EGO],
        time_in_stage: state.stage_time[EGO],
        time_waiting: state.waited[EGO],
        time_indicating: state.signalled[EGO],
        wanted_side: state.wanted[EGO],
        time_since_lane_change: state.since_change[EGO],
        has_finished_lane_change: flag(has_arrived(state, EGO)),
        checks_mirrors: flag(mind.looks),
        gives_way: flag(mind.waits),
        has_passed_target: flag(has_passed(state, w, EGO)),
        is_behind_target: flag(is_behind(state, w, EGO)),
        can_pull_out: flag(can_go_out(state, w)),
        can_return: flag(can_go_back(state)),
        can_cancel_lane_change: flag(can_abort(state, w, EGO) | can_remain(state, w, EGO)),
    }
}

/// Motion of a neighbour relative to the ego.
struct NeighbourMotion<S: Simd> {
    is_detected: M<S>,
    gap: V<S>,
    closing_speed: V<S>,
    accel: V<S>,
}

/// The model driver's beliefs; true closing speeds if the driver is told to change lanes.
#[inline(always)]
fn believed_motion<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
) -> NeighbourMotion<S> {
    let is_detected = mind.believed.detected[role];
    let mut closing_speed = mind.believed.closing[role];
    if role == LEAD {
        let knows_speed = is_told(w) & is_detected;
        closing_speed = choose(knows_speed, faster(state, w, mind.near), closing_speed);
    }
    NeighbourMotion {
        is_detected,
        gap: mind.believed.gap[role],
        closing_speed,
        accel: mind.believed.accel[role],
    }
}

/// The true motion of a neighbour; a large gap and zeros without one.
#[inline(always)]
fn true_motion<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
) -> NeighbourMotion<S> {
    let (zero, unseen) = (splat(w.simd, 0.0), splat(w.simd, w.c.unseen_gap));
    let slot = mind.near.slot[role];
    let exists = slot.simd_ge(0.0);
    let (ego_speed, _) = state.road_velocity(EGO);
    let [speed, accel] = pick_each!(w.count, slot, |j| [
        state.road_velocity(j).0,
        state.a_lon[j]
    ]);
    let is_ahead = role.is_multiple_of(2);
    let closing_speed = if is_ahead {
        ego_speed - speed
    } else {
        speed - ego_speed
    };
    NeighbourMotion {
        is_detected: exists,
        gap: choose(exists, mind.near.gap[role], unseen),
        closing_speed: choose(exists, closing_speed, zero),
        accel: choose(exists, accel, zero),
    }
}

/// One oncoming vehicle; a large gap and zeros without one.
#[inline(always)]
fn oncoming_columns<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    vehicle: &Oncoming<S>,
    source: ObservationSource,
) -> NeighbourColumns<S> {
    let zero = splat(w.simd, 0.0);
    let [
        speed,
        accel,
        d,
        indicator,
        half_length,
        is_truck,
        is_two_wheeler,
    ] = pick_each!(w.count, vehicle.slot, |j| [
        state.road_velocity(j).0,
        state.a_lon[j],
        state.d[j],
        state.indicator[j],
        w.p[j].half_length,
        w.p[j].has_truck_tyres,
        w.p[j].two_wheeler
    ]);
    let ego_speed = state.road_velocity(EGO).0;
    let (is_detected, gap, closing_speed, accel) = match source {
        ObservationSource::Beliefs => (
            vehicle.detected,
            vehicle.believed_gap,
            vehicle.closing,
            zero,
        ),
        ObservationSource::Truth => (
            vehicle.slot.simd_ge(0.0),
            vehicle.gap,
            ego_speed + speed,
            accel,
        ),
    };
    let if_detected = |value| choose(is_detected, value, zero);
    NeighbourColumns {
        is_detected: flag(w.simd, is_detected),
        gap: choose(is_detected, gap, splat(w.simd, w.c.unseen_gap)),
        closing_speed: if_detected(closing_speed),
        accel: if_detected(accel),
        lateral_distance: if_detected((w.road.ways.edge_sum - d) - state.d[EGO]),
        indicator: if_detected(-indicator),
        stop_lamp: zero,
        length: if_detected(2.0 * half_length),
        is_truck: if_detected(is_truck),
        is_two_wheeler: if_detected(is_two_wheeler),
    }
}

/// The model driver's knowledge about a pass against oncoming traffic.
#[inline(always)]
fn passing_columns<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
) -> PassingColumns<S> {
    let flag = |mask| flag(w.simd, mask);
    let oncoming = &mind.met.coming;
    let plight = weigh(state, w, EGO, &mind);
    let leader = mind.near.slot[LEAD];
    let overtaken = choose(
        in_stage(state, EGO, stage::FOLLOW),
        leader,
        state.target[EGO],
    );
    PassingColumns {
        sight_distance: oncoming.sight,
        is_certain: flag(oncoming.sure),
        expected_closing_speed: usual_closing(state, w, EGO),
        gap_ahead_of_leader: at_most(room_ahead(state, w, EGO, leader), w.c.unseen_gap),
        tall_vehicle_gap_factor: room_left(w, overtaken),
        line_is_solid: flag(is_solid(state, w, EGO, splat(w.simd, w.c.line_lookahead))),
        return_urgency: 0.5 * flag(plight.hurries) + 0.5 * flag(plight.pressed),
        abort_state: 0.5 * flag(plight.yields) + 0.5 * flag(plight.yields & plight.fits),
        can_abort_pass: flag(can_fall_in(state, w)),
    }
}

/// A neighbour's motion and appearance; without a vehicle the appearance is zero.
#[inline(always)]
fn neighbour_columns<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    role: usize,
    motion: NeighbourMotion<S>,
) -> NeighbourColumns<S> {
    let zero = splat(w.simd, 0.0);
    let [
        indicator,
        requested_accel,
        crashed,
        is_truck,
        is_two_wheeler,
    ] = pick_each!(w.count, mind.near.slot[role], |j| [
        state.indicator[j],
        state.accel[j],
        state.crashed[j],
        w.p[j].has_truck_tyres,
        w.p[j].two_wheeler
    ]);
    let brakes = requested_accel.simd_lt(-w.c.stop_lamp_decel) | crashed.simd_gt(0.0);
    let if_detected = |value| choose(motion.is_detected, value, zero);
    NeighbourColumns {
        is_detected: flag(w.simd, motion.is_detected),
        gap: motion.gap,
        closing_speed: motion.closing_speed,
        accel: motion.accel,
        lateral_distance: if_detected(mind.near.aside[role]),
        indicator: if_detected(indicator),
        stop_lamp: if_detected(flag(w.simd, brakes)),
        length: if_detected(2.0 * mind.near.half_length[role]),
        is_truck: if_detected(is_truck),
        is_two_wheeler: if_detected(is_two_wheeler),
    }
}

/// 1 where the mask is true, else 0.
#[inline(always)]
fn flag<S: Simd>(simd: S, mask: M<S>) -> V<S> {
    choose(mask, splat(simd, 1.0), splat(simd, 0.0))
}
