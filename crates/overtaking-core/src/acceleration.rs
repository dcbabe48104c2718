//! Acceleration that each driver requests until its next decision, 0.05 s later; the twin of
//! `overtaking.sim.reference.acceleration`.
//!
//! Left is the overtaking side, and lateral positions grow to the left. During a lane change the driver's lane is the
//! one that it enters, and its old lane the one that it leaves. A driver passes from its pull-out until it begins to
//! return or to abort.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{Follower, Leader, acc_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{
    F32, Mask, assign_where, at_least, at_slot, clamp, clamp_to, max, min, select, splat,
};
use crate::neighbour_search::lane_borders;
use crate::oncoming::OncomingTraffic;
use crate::params::Params;
use crate::passing::tall_vehicle_gap_factor;
use crate::state::{EGO_SLOT, LEADER, LEFT_LEADER, NO_ACCEL_LIMIT, RIGHT_LEADER, State, stage};
use crate::steering::start_path;
use crate::vehicle_handle::VehicleHandle;

/// Smallest time until vehicles meet, which keeps the braking finite [s]. It matters only below 1.6 m/s: at higher
/// speeds `oncoming_max_decel`, 8 m/s^2, limits the braking already.
const MIN_MEETING_TIME: f32 = 0.1;

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Acceleration behind the leader in the driver's lane [m/s^2].
    #[inline(always)]
    pub fn accel_behind_leader(self, context: &DriverContext<S>) -> F32<S> {
        let (params, slot) = (self.params, self.slot);
        let constants = &params.constants;
        let follower = Follower {
            vehicle: self.vehicle(),
            speed: self.state.motion.vx[slot],
            desired_speed: self.current_desired_speed(context),
            time_gap: self.kept_time_gap(context),
        };
        let accel = acc_accel(constants, &follower, &context.beliefs.leader(LEADER));
        let limited_accel = self.limit_accel(accel);
        // On one-way roads only the ego overtakes.
        if !params.road.can_overtake(slot) {
            return limited_accel;
        }
        let is_passing = self.is_before_return();
        // `limit_accel` slows drivers down for a lower speed limit ahead. In this model a passing driver slows down for
        // it only after the pass.
        let accel = select(is_passing, accel, limited_accel);
        // A passing driver uses more of the engine than in everyday driving: factors on its usual acceleration, 1.3
        // while it passes and 2.0 if it must return urgently, which happens only on two-way roads.
        let usual_factor = splat(params.simd, constants.accelerate_gain);
        let engine_factor = if params.road.directions.has_oncoming_traffic {
            select(
                self.state.overtake.must_return_urgently[slot].simd_gt(0.0),
                splat(params.simd, constants.urgent_accel_factor),
                usual_factor,
            )
        } else {
            usual_factor
        };
        let accelerates = is_passing & accel.simd_gt(0.0);
        accel * select(accelerates, engine_factor, splat(params.simd, 1.0))
    }

    /// Time gap that the driver keeps: shorter before a pull-out, longer behind a tall leader [s].
    #[inline(always)]
    fn kept_time_gap(self, context: &DriverContext<S>) -> F32<S> {
        let (params, slot) = (self.params, self.slot);
        let time_gap = self.vehicle().time_gap;
        if !params.road.can_overtake(slot) {
            return time_gap;
        }
        let is_following = self.state.overtake.stage[slot].simd_eq(stage::FOLLOW);
        let is_about_to_pull_out =
            self.state.overtake.time_indicating[slot].simd_gt(0.0) & is_following;
        // `signalling_time_gap` is a share of the time gap.
        let kept_time_gap = select(
            is_about_to_pull_out,
            params.constants.signalling_time_gap * time_gap,
            time_gap,
        );
        if !params.road.directions.has_oncoming_traffic {
            return kept_time_gap;
        }
        // On two-way roads drivers drop back behind a truck or van, to see oncoming traffic past it.
        let gap_factor = tall_vehicle_gap_factor(params, context.neighbours.slot[LEADER]);
        select(is_following, kept_time_gap * gap_factor, kept_time_gap)
    }

    /// Speed that the driver wants now: while it passes, while it is passed, and in bends [m/s].
    #[inline(always)]
    fn current_desired_speed(self, context: &DriverContext<S>) -> F32<S> {
        let mut desired_speed = self.desired_speed();
        if self.params.road.directions.has_oncoming_traffic {
            desired_speed = select(
                context.oncoming.is_being_passed,
                desired_speed * self.vehicle().speed_factor_when_passed,
                desired_speed,
            );
            let is_passing = self.is_before_return();
            // Here the passing speed also depends on the target's speed and on urgency.
            if is_passing.any_true() {
                desired_speed = select(is_passing, self.current_passing_speed(), desired_speed);
            }
        } else if self.slot == EGO_SLOT {
            desired_speed = select(
                self.is_before_return(),
                self.desired_passing_speed(),
                desired_speed,
            );
        }
        if self.params.road.varies_along_road() {
            return min(desired_speed, self.state.road.bend_speed[self.slot]);
        }
        desired_speed
    }

    /// Acceleration behind the leader in the old lane, until the bodies are clear [m/s^2].
    ///
    /// The driver brakes so that the gap lasts until its vehicle has left the old lane, plus a margin of time. It
    /// brakes no harder than behind a leader in its own lane.
    #[inline(always)]
    fn accel_behind_old_leader(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let (neighbours, beliefs) = (&context.neighbours, &context.beliefs);
        let no_limit = splat(params.simd, NO_ACCEL_LIMIT);
        let is_changing_lanes = self.is_changing_lane();
        if !is_changing_lanes.any_true() {
            return no_limit;
        }
        let lane_centre = 0.5 * (neighbours.lane_right_edge + neighbours.lane_left_edge);
        // Until the vehicle arrives, its new lane's centre is on the side to which it moves.
        let moves_left = lane_centre.simd_gt(state.motion.d[slot]);
        // The old lane is on the right of a vehicle that moves left.
        let (right, left) = (beliefs.leader(RIGHT_LEADER), beliefs.leader(LEFT_LEADER));
        let leader = Leader {
            gap: select(moves_left, right.gap, left.gap),
            closing_speed: select(moves_left, right.closing_speed, left.closing_speed),
            accel: select(moves_left, right.accel, left.accel),
        };
        let leader_slot = select(
            moves_left,
            neighbours.slot[RIGHT_LEADER],
            neighbours.slot[LEFT_LEADER],
        );
        let lateral_distance = select(
            moves_left,
            neighbours.lateral_distance[RIGHT_LEADER],
            neighbours.lateral_distance[LEFT_LEADER],
        )
        .abs();
        let leader_half_width = at_slot!(params, leader_slot, |j| params.vehicles[j].half_width);
        let bodies_overlap = lateral_distance
            .simd_lt(vehicle.half_width + leader_half_width + constants.footprint_margin);
        // At `lane_cleared_share`, 0.6 of its duration, the lateral path has covered 2.4 of 3.5 m, more than a car's
        // width. `lane_clearance_time` allows for misjudged distances: at night they are off by a fifth and more, and
        // drivers without this margin hit the leader.
        let time_to_clear = at_least(
            constants.lane_cleared_share * state.path.duration[slot] - state.path.elapsed[slot],
            0.0,
        );
        // `leader.accel` is never positive: the driver adds the braking of its old leader.
        let needed_decel = braking_until_clear(
            params,
            leader.gap - vehicle.min_gap,
            leader.closing_speed,
            time_to_clear + constants.lane_clearance_time,
        ) - leader.accel;
        let must_brake = is_changing_lanes
            & leader_slot.simd_ge(0.0)
            & bodies_overlap
            & needed_decel.simd_gt(0.0);
        if !must_brake.any_true() {
            return no_limit;
        }
        let follower = Follower {
            vehicle,
            speed: state.motion.vx[slot],
            desired_speed: self.current_desired_speed(context),
            time_gap: vehicle.time_gap,
        };
        let following_accel = acc_accel(constants, &follower, &leader);
        select(must_brake, max(following_accel, -needed_decel), no_limit)
    }

    /// Acceleration that the driver wants, behind its leader and behind the leader in its old lane [m/s^2].
    ///
    /// `leader_accel` is the acceleration behind the leader, or the smaller one that oncoming traffic or the pass
    /// demands [m/s^2]. `apply_pedals` moves the requested acceleration towards the result.
    #[inline(always)]
    pub fn target_accel(self, context: &DriverContext<S>, leader_accel: F32<S>) -> F32<S> {
        min(leader_accel, self.accel_behind_old_leader(context))
    }
}

/// Constant deceleration [m/s^2] with which a gap [m] lasts for a time [s].
///
/// It is negative where the gap lasts without braking. Where the closing speed would fall to 0 before that time, it is
/// the deceleration with which the gap is just used up.
#[inline(always)]
fn braking_until_clear<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    closing_speed: F32<S>,
    time: F32<S>,
) -> F32<S> {
    let gap = at_least(gap, params.constants.min_effective_gap);
    let unbraked_distance = closing_speed * time;
    // The first deceleration leaves a closing speed of (2 gap - unbraked_distance) / time, which must not be negative.
    select(
        unbraked_distance.simd_lt(2.0 * gap),
        2.0 * (unbraked_distance - gap) / (time * time),
        closing_speed * closing_speed / (2.0 * gap),
    )
}

/// Move the requested acceleration of the vehicle in `slot` towards `target_accel` [m/s^2], faster if the target is
/// hard braking.
///
/// The target is limited by the force of the brakes but not by friction. In an emergency a driver requests more braking
/// than it believes the road allows; tyres and anti-lock brakes then limit the actual braking.
#[inline(always)]
pub fn apply_pedals<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    target_accel: F32<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let requested_accel = state.controls.requested_accel[slot];
    let target_accel = max(
        target_accel,
        -(vehicle.max_brake_force * vehicle.inverse_mass),
    );
    // A foot leaves the brake faster than it presses the accelerator.
    let jerk_up = select(
        requested_accel.simd_lt(0.0),
        splat(params.simd, constants.jerk_release),
        splat(params.simd, constants.jerk_up),
    );
    // Drivers reach any braking within `brake_ramp`, so hard braking builds up faster (Markkula et al. 2016).
    let jerk_down = at_least(-target_accel / constants.brake_ramp, constants.jerk_down);
    // `constants.decision` is the time between two decisions [s].
    let change = clamp(
        target_accel - requested_accel,
        -(jerk_down * constants.decision),
        jerk_up * constants.decision,
    );
    state.controls.requested_accel[slot] = select(
        state.motion.is_wreck[slot].simd_gt(0.0),
        splat(params.simd, 0.0),
        requested_accel + change,
    );
}

/// Largest acceleration of the driver in `slot` with an oncoming vehicle in its own lane [m/s^2].
///
/// The driver first flashes the headlamps and releases the accelerator. Later it moves to the edge of the lane and
/// brakes so as to stop within its half of the distance. Some drivers also move to the edge while another vehicle
/// passes them. `pass_continuation` has the overtaking driver's reaction.
#[inline(always)]
pub fn accel_for_oncoming<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    oncoming: &OncomingTraffic<S>,
) -> F32<S> {
    let constants = &params.constants;
    let splat = |value: f32| splat(params.simd, value);
    let is_sound = state.motion.is_wreck[slot].simd_eq(0.0);
    let overtakes = state.vehicle(params, slot).is_overtaking();
    let meets_oncoming = oncoming.meets_in_own_lane & is_sound & !overtakes;
    let meeting_time = oncoming.time_to_meeting;
    let releases_accelerator = meets_oncoming & meeting_time.simd_lt(constants.oncoming_flash_time);
    let brakes = meets_oncoming & meeting_time.simd_lt(constants.oncoming_brake_time);
    state.controls.flashes_high_beam[slot] = select(releases_accelerator, splat(1.0), splat(0.0));
    // This braking stops the driver within vx t, half of the gap if both vehicles are equally fast.
    let decel = clamp_to(
        state.motion.vx[slot] / (2.0 * at_least(meeting_time, MIN_MEETING_TIME)),
        constants.oncoming_min_decel,
        constants.oncoming_max_decel,
    );
    shift_to_edge(state, params, slot, brakes, oncoming.is_being_passed);
    let coasting_accel = splat(-constants.oncoming_lift_decel);
    let accel_limit = select(releases_accelerator, coasting_accel, splat(NO_ACCEL_LIMIT));
    select(brakes, -decel, accel_limit)
}

/// Move to the right edge of the lane for an oncoming or passing vehicle, and back afterwards.
#[inline(always)]
fn shift_to_edge<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    brakes: Mask<S>,
    is_being_passed: Mask<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let splat = |value: f32| splat(params.simd, value);
    let shift_when_passed = select(is_being_passed, vehicle.edge_shift_when_passed, splat(0.0));
    let shift = select(brakes, splat(constants.edge_shift), shift_when_passed);
    let driver = state.vehicle(params, slot);
    // Drivers move out at once, but back only when they have arrived at the edge.
    let edge_shift = state.lane_choice.edge_shift[slot];
    let starts =
        shift.simd_gt(edge_shift) | (driver.has_finished_lane_change() & shift.simd_lt(edge_shift));
    // An overtaking driver keeps to the path of its lane change.
    let overtakes = driver.is_overtaking();
    let starts =
        starts & state.motion.is_wreck[slot].simd_eq(0.0) & vehicle.valid.simd_gt(0.0) & !overtakes;
    if starts.any_true() {
        // The last argument counts lanes to the left of the driver's lane.
        let (right_edge, left_edge) = lane_borders(params, state.lane_choice.lane[slot], 0.0);
        // A choice of this model: without an oncoming vehicle the move takes twice as long.
        let duration = select(
            brakes,
            splat(constants.edge_shift_duration),
            splat(2.0 * constants.edge_shift_duration),
        );
        let lateral_position = 0.5 * (right_edge + left_edge) - shift;
        start_path(state, slot, starts, lateral_position, duration);
        assign_where(&mut state.lane_choice.edge_shift[slot], starts, shift);
    }
    assign_where(
        &mut state.lane_choice.edge_shift[slot],
        overtakes,
        splat(0.0),
    );
}
