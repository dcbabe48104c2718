//! The table that an external driver of the ego observes: beliefs of the model driver, or truth. The twin of
//! `overtaking.sim.reference.observation_table`.
//!
//! An external driver, such as a trained network, drives the ego, the vehicle under study, in place of the model
//! driver, which continues to perceive and judge. The target is the vehicle that the ego overtakes. Vehicles have slot
//! numbers; a role is a neighbour's place, such as leader in the ego's lane. Lateral values and the indicator are
//! positive to the left, the overtaking side. `overtaking.model.driver_interface` states unit and meaning of each
//! column.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together. `VehicleHandle` is a view of one vehicle of them, here the ego. `N` is the number of slots.
//! `at_slot!` and `each_at_slot!` read values of the vehicle whose slot they get, or of slot 0 without a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::gap_acceptance::is_scripted;
use crate::math::vectors::{F32, Mask, at_most, at_slot, each_at_slot, select, splat};
use crate::oncoming::OncomingVehicle;
use crate::passing::tall_vehicle_gap_factor;
use crate::state::{LEADER, NUM_ROLES, is_leader_role, stage};
use crate::vehicle_handle::VehicleHandle;

/// Source of the columns of neighbours. The columns about a pass are the model driver's judgements in both cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObservationSource {
    /// Beliefs of the model driver.
    Beliefs,
    /// The true state.
    Truth,
}

/// Declare a struct with one field for each column, and the list of the names of the columns.
macro_rules! columns {
    ($(#[$doc:meta])* $names:ident, $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        struct $name<S: Simd> { $($field: F32<S>),* }

        impl<S: Simd> $name<S> {
            /// Write the columns, in order, to a part of the table.
            #[inline(always)]
            fn write(self, entries: &mut [F32<S>]) {
                for (entry, value) in entries.iter_mut().zip([$(self.$field),*]) {
                    *entry = value;
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
pub const NUM_OBSERVED_ROLES: usize = NUM_ROLES + 2;

/// Number of columns of all observed neighbours.
const NEIGHBOURS_SIZE: usize = NUM_OBSERVED_ROLES * NEIGHBOUR_COLUMN_NAMES.len();

/// Number of values in the observation of one simulation.
pub const OBSERVATION_SIZE: usize =
    EGO_COLUMN_NAMES.len() + NEIGHBOURS_SIZE + PASSING_COLUMN_NAMES.len();

/// The observations of the simulations of a block.
pub type ObservationTable<S> = [F32<S>; OBSERVATION_SIZE];

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Observations of the ego in each simulation of a block.
    #[inline(always)]
    pub fn observation_table(
        self,
        context: &DriverContext<S>,
        source: ObservationSource,
    ) -> ObservationTable<S> {
        let params = self.params;
        const NUM_COLUMNS: usize = NEIGHBOUR_COLUMN_NAMES.len();
        let mut table = [splat(params.simd, 0.0); OBSERVATION_SIZE];
        let (ego, rest) = table.split_at_mut(EGO_COLUMN_NAMES.len());
        let (neighbours, passing) = rest.split_at_mut(NEIGHBOURS_SIZE);
        self.ego_columns(context).write(ego);
        let (same_direction, oncoming) = neighbours.split_at_mut(NUM_ROLES * NUM_COLUMNS);
        for (role, columns) in same_direction.chunks_exact_mut(NUM_COLUMNS).enumerate() {
            let motion = match source {
                ObservationSource::Beliefs => self.believed_motion(context, role),
                ObservationSource::Truth => self.true_motion(context, role),
            };
            self.neighbour_columns(context, role, motion).write(columns);
        }
        // On one-way roads the two oncoming vehicles keep the gap `unseen_gap`, and zeros in all other columns.
        let mut vehicles = [OncomingVehicle::no_vehicle(params.simd); 2];
        if params.road.directions.has_oncoming_traffic {
            vehicles = [
                context.oncoming.nearest,
                self.observe_second_oncoming(context),
            ];
            self.passing_columns(context).write(passing);
        }
        for (vehicle, columns) in vehicles.iter().zip(oncoming.chunks_exact_mut(NUM_COLUMNS)) {
            self.oncoming_columns(vehicle, source).write(columns);
        }
        table
    }

    /// The ego's own motion, and the state of its overtake.
    #[inline(always)]
    fn ego_columns(self, context: &DriverContext<S>) -> EgoColumns<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let flag = |mask| flag(params.simd, mask);
        let lane_centre =
            0.5 * (context.neighbours.lane_right_edge + context.neighbours.lane_left_edge);
        EgoColumns {
            speed: state.motion.vx[slot],
            requested_accel: state.controls.requested_accel[slot],
            s: state.motion.s[slot],
            lateral_position: state.motion.d[slot],
            lane_offset: state.motion.d[slot] - lane_centre,
            heading: state.motion.heading[slot],
            yaw_rate: state.motion.yaw_rate[slot],
            lane: state.lane_choice.lane[slot],
            stage: state.overtake.stage[slot],
            time_in_stage: state.overtake.time_in_stage[slot],
            time_waiting: state.overtake.time_waiting[slot],
            time_indicating: state.overtake.time_indicating[slot],
            wanted_side: state.lane_choice.wanted_side[slot],
            time_since_lane_change: state.lane_choice.time_since_lane_change[slot],
            has_finished_lane_change: flag(self.has_finished_lane_change()),
            checks_mirrors: flag(context.checks_mirrors),
            gives_way: flag(context.gives_way),
            has_passed_target: flag(self.has_passed_target()),
            is_behind_target: flag(self.is_behind_target()),
            can_pull_out: flag(self.can_pull_out()),
            can_return: flag(self.can_return()),
            can_cancel_lane_change: flag(self.can_cancel_pull_out() | self.can_cancel_return()),
        }
    }
}

/// Motion of a neighbour relative to the ego.
struct NeighbourMotion<S: Simd> {
    /// Whether the model driver has detected the neighbour; for an external driver that observes the truth, whether the
    /// neighbour exists.
    is_detected: Mask<S>,
    /// Gap between the bumpers [m].
    gap: F32<S>,
    /// Speed at which the gap shrinks [m/s].
    closing_speed: F32<S>,
    /// Acceleration of the neighbour [m/s^2].
    accel: F32<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The model driver's beliefs about a neighbour; `unseen_gap` and zeros without detection.
    ///
    /// In the profile of the study by Pinto et al. (2023) the ego changes lanes by that study's script, which decides
    /// by the true closing speed to the leader: by its belief the ego would pull out too late. The column of such
    /// an ego shows the true speed too.
    #[inline(always)]
    fn believed_motion(self, context: &DriverContext<S>, role: usize) -> NeighbourMotion<S> {
        let params = self.params;
        let is_detected = context.beliefs.is_detected[role];
        let mut closing_speed = context.beliefs.closing_speed[role];
        if role == LEADER {
            let uses_true_speed = is_scripted(params) & is_detected;
            closing_speed = select(
                uses_true_speed,
                self.true_closing_speed_to_leader(&context.neighbours),
                closing_speed,
            );
        }
        NeighbourMotion {
            is_detected,
            gap: context.beliefs.gap[role],
            closing_speed,
            accel: context.beliefs.accel[role],
        }
    }

    /// The true motion of a neighbour; `unseen_gap` and zeros without one.
    #[inline(always)]
    fn true_motion(self, context: &DriverContext<S>, role: usize) -> NeighbourMotion<S> {
        let (state, params) = (self.state, self.params);
        let (zero, unseen_gap) = (
            splat(params.simd, 0.0),
            splat(params.simd, params.constants.unseen_gap),
        );
        let neighbour_slot = context.neighbours.slot[role];
        let exists = neighbour_slot.simd_ge(0.0);
        let (ego_speed, _) = self.road_velocity(); // Along and across the road [m/s].
        let speed = state.road_speed_at(params, neighbour_slot);
        let accel = at_slot!(params, neighbour_slot, |j| state.motion.accel_lon[j]);
        let closing_speed = if is_leader_role(role) {
            ego_speed - speed
        } else {
            speed - ego_speed
        };
        NeighbourMotion {
            is_detected: exists,
            gap: select(exists, context.neighbours.gap[role], unseen_gap),
            closing_speed: select(exists, closing_speed, zero),
            accel: select(exists, accel, zero),
        }
    }

    /// Motion and appearance of an oncoming vehicle; `unseen_gap` and zeros without one.
    #[inline(always)]
    fn oncoming_columns(
        self,
        vehicle: &OncomingVehicle<S>,
        source: ObservationSource,
    ) -> NeighbourColumns<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let zero = splat(params.simd, 0.0);
        let speed = state.road_speed_at(params, vehicle.slot);
        let [accel, d, indicator, half_length, is_truck, is_two_wheeler] =
            each_at_slot!(params, vehicle.slot, |j| [
                state.motion.accel_lon[j],
                state.motion.d[j],
                state.controls.indicator[j],
                params.vehicles[j].half_length,
                params.vehicles[j].has_truck_tyres,
                params.vehicles[j].two_wheeler
            ]);
        let (ego_speed, _) = self.road_velocity(); // Along and across the road [m/s].
        // The speed and acceleration of each vehicle count along its own direction of travel.
        let (is_detected, gap, closing_speed, accel) = match source {
            ObservationSource::Beliefs => (
                vehicle.is_detected,
                vehicle.believed_gap,
                vehicle.closing_speed,
                zero, // Drivers do not judge the acceleration of an oncoming vehicle.
            ),
            ObservationSource::Truth => (
                vehicle.slot.simd_ge(0.0),
                vehicle.gap,
                ego_speed + speed,
                accel,
            ),
        };
        let if_detected = |value| select(is_detected, value, zero);
        NeighbourColumns {
            is_detected: flag(params.simd, is_detected),
            gap: select(
                is_detected,
                gap,
                splat(params.simd, params.constants.unseen_gap),
            ),
            closing_speed: if_detected(closing_speed),
            accel: if_detected(accel),
            // Oncoming vehicles count lateral positions from the other side of the road; `edge_sum`, the sum of the
            // positions of both edges, mirrors them.
            lateral_distance: if_detected(
                (params.road.directions.edge_sum - d) - state.motion.d[slot],
            ),
            // The left of an oncoming vehicle is the ego's right.
            indicator: if_detected(-indicator),
            // Stop lamps are at the rear, which the ego does not see.
            stop_lamp: zero,
            length: if_detected(2.0 * half_length),
            is_truck: if_detected(is_truck),
            is_two_wheeler: if_detected(is_two_wheeler),
        }
    }

    /// The model driver's knowledge about a pass against oncoming traffic.
    ///
    /// `oncoming.is_certain` says that the driver has watched long enough to know whether a vehicle is oncoming.
    #[inline(always)]
    fn passing_columns(self, context: &DriverContext<S>) -> PassingColumns<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let flag = |mask| flag(params.simd, mask);
        let oncoming = &context.oncoming.nearest;
        let continuation = self.decide_pass_continuation(context);
        let leader_slot = context.neighbours.slot[LEADER];
        // Before an overtake the leader is the vehicle that the ego would pass.
        let passed_slot = select(
            self.is_in_stage(stage::FOLLOW),
            leader_slot,
            state.overtake.target_slot[slot],
        );
        PassingColumns {
            sight_distance: oncoming.sight_distance,
            is_certain: flag(oncoming.is_certain),
            expected_closing_speed: self.expected_closing_speed(),
            // As its name says, this column follows the leader also while the ego overtakes.
            gap_ahead_of_leader: at_most(
                self.gap_ahead_of(leader_slot),
                params.constants.unseen_gap,
            ),
            tall_vehicle_gap_factor: tall_vehicle_gap_factor(params, passed_slot),
            line_is_solid: flag(
                self.line_is_solid(splat(params.simd, params.constants.line_lookahead)),
            ),
            // 1 for an urgent return that also accepts a small gap, 0.5 for another urgent return.
            return_urgency: 0.5 * flag(continuation.must_return_urgently)
                + 0.5 * flag(continuation.accepts_small_gap),
            // 1 for an abort with space behind the target, 0.5 for an abort without it yet.
            abort_state: 0.5 * flag(continuation.must_abort)
                + 0.5 * flag(continuation.must_abort & continuation.fits_into_lane),
            can_abort_pass: flag(self.can_abort_pass()),
        }
    }

    /// A neighbour's motion and appearance; without detection the appearance is zero.
    #[inline(always)]
    fn neighbour_columns(
        self,
        context: &DriverContext<S>,
        role: usize,
        motion: NeighbourMotion<S>,
    ) -> NeighbourColumns<S> {
        let (state, params) = (self.state, self.params);
        let zero = splat(params.simd, 0.0);
        let [
            indicator,
            requested_accel,
            is_wreck,
            is_truck,
            is_two_wheeler,
        ] = each_at_slot!(params, context.neighbours.slot[role], |j| [
            state.controls.indicator[j],
            state.controls.requested_accel[j],
            state.motion.is_wreck[j],
            params.vehicles[j].has_truck_tyres,
            params.vehicles[j].two_wheeler
        ]);
        // A wreck requests no braking, but slides with locked wheels; that it shows stop lamps is a choice.
        let stop_lamp =
            requested_accel.simd_lt(-params.constants.stop_lamp_decel) | is_wreck.simd_gt(0.0);
        let if_detected = |value| select(motion.is_detected, value, zero);
        NeighbourColumns {
            is_detected: flag(params.simd, motion.is_detected),
            gap: motion.gap,
            closing_speed: motion.closing_speed,
            accel: motion.accel,
            lateral_distance: if_detected(context.neighbours.lateral_distance[role]),
            indicator: if_detected(indicator),
            stop_lamp: if_detected(flag(params.simd, stop_lamp)),
            length: if_detected(2.0 * context.neighbours.half_length[role]),
            is_truck: if_detected(is_truck),
            is_two_wheeler: if_detected(is_two_wheeler),
        }
    }
}

/// 1 where the mask is true, else 0.
#[inline(always)]
fn flag<S: Simd>(simd: S, mask: Mask<S>) -> F32<S> {
    select(mask, splat(simd, 1.0), splat(simd, 0.0))
}
