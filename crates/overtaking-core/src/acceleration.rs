//! How hard each driver accelerates or brakes; see `overtaking.sim.reference.acceleration`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::acc_accel;
use crate::decision_context::DriverContext;
use crate::math::vectors::{
    F32, Mask, assign_where, at_least, at_slot, clamp, clamp_to, max, min, select, splat,
};
use crate::neighbour_search::lane_borders;
use crate::oncoming::OncomingTraffic;
use crate::params::Params;
use crate::passing::tall_vehicle_gap_factor;
use crate::state::{EGO_SLOT, LEADER, LEFT_LEADER, RIGHT_LEADER, State, stage};
use crate::steering::start_path;
use crate::vehicle_handle::VehicleHandle;

const NO_ACCEL_LIMIT: f32 = 1e9;

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn current_desired_speed(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let vehicle = self.vehicle();
        let mut desired = self.desired_speed();
        if params.road.directions.has_oncoming_traffic {
            let is_being_passed = context.oncoming.is_being_passed;
            desired = select(
                is_being_passed,
                desired * vehicle.speed_factor_when_passed,
                desired,
            );
            let passing = self.is_before_return();
            if passing.any_true() {
                desired = select(passing, self.current_passing_speed(), desired);
            }
        } else if slot == EGO_SLOT {
            desired = select(
                self.is_before_return(),
                self.desired_passing_speed(),
                desired,
            );
        }
        if params.road.varies_along_road() {
            return min(desired, state.road.bend_speed[slot]);
        }
        desired
    }

    /// Time gap kept; who is about to pull out accepts a smaller one, and to trucks of two-way roads more room is left.
    #[inline(always)]
    fn kept_time_gap(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let own = self.vehicle().time_gap;
        if params.road.can_overtake(slot) {
            let follows = self.is_in_stage(stage::FOLLOW);
            let about_to = state.overtake.time_indicating[slot].simd_gt(0.0) & follows;
            let kept = select(about_to, params.constants.signalling_time_gap * own, own);
            if params.road.directions.has_oncoming_traffic {
                select(
                    follows,
                    kept * tall_vehicle_gap_factor(params, context.neighbours.slot[LEADER]),
                    kept,
                )
            } else {
                kept
            }
        } else {
            own
        }
    }

    /// Acceleration behind the leader of the lane that is driven in or being entered; somebody may pass the driver.
    #[inline(always)]
    pub fn accel_behind_leader(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let desired = self.current_desired_speed(context);
        let kept = self.kept_time_gap(context);
        let believed = &context.beliefs;
        let (gap, closing) = (believed.gap[LEADER], believed.closing_speed[LEADER]);
        let wanted = acc_accel(
            constants,
            vehicle,
            state.motion.vx[slot],
            desired,
            gap,
            closing,
            kept,
            believed.accel[LEADER],
        );
        let eased = self.limit_accel(wanted);
        if params.road.can_overtake(slot) {
            let passing = self.is_before_return();
            let wanted = select(passing, wanted, eased);
            let eager = passing & wanted.simd_gt(0.0);
            let usual = splat(params.simd, params.constants.accelerate_gain);
            let gain = if params.road.directions.has_oncoming_traffic {
                let hurried = splat(params.simd, params.constants.urgent_accel_factor);
                select(
                    state.overtake.must_return_urgently[slot].simd_gt(0.0),
                    hurried,
                    usual,
                )
            } else {
                usual
            };
            wanted * select(eager, gain, splat(params.simd, 1.0))
        } else {
            eased
        }
    }

    /// Acceleration behind the one whose lane is being left, while the bodies overlap.
    #[inline(always)]
    fn accel_behind_old_leader(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (near, believed) = (&context.neighbours, &context.beliefs);
        let (constants, vehicle, n) = (&params.constants, self.vehicle(), params.num_slots_in_use);
        let free = splat(params.simd, NO_ACCEL_LIMIT);
        let changing = self.is_changing_lane();
        if !changing.any_true() {
            return free;
        }
        let to_fast =
            (0.5 * (near.lane_right_edge + near.lane_left_edge)).simd_gt(state.motion.d[slot]);
        let other_slot = select(to_fast, near.slot[RIGHT_LEADER], near.slot[LEFT_LEADER]);
        let gap = select(
            to_fast,
            believed.gap[RIGHT_LEADER],
            believed.gap[LEFT_LEADER],
        );
        let closing = select(
            to_fast,
            believed.closing_speed[RIGHT_LEADER],
            believed.closing_speed[LEFT_LEADER],
        );
        let accel = select(
            to_fast,
            believed.accel[RIGHT_LEADER],
            believed.accel[LEFT_LEADER],
        );
        let aside = select(
            to_fast,
            near.lateral_distance[RIGHT_LEADER],
            near.lateral_distance[LEFT_LEADER],
        )
        .abs();
        let overlaps = aside.simd_lt(
            vehicle.half_width
                + at_slot!(n, other_slot, |j| params.vehicles[j].half_width)
                + constants.footprint_margin,
        );
        let left = at_least(
            constants.lane_cleared_share * state.path.duration[slot] - state.path.elapsed[slot],
            0.0,
        );
        let needed = braking_until_clear(
            params,
            gap - vehicle.min_gap,
            closing,
            left + constants.lane_clearance_time,
        ) - accel;
        let matters = changing & other_slot.simd_ge(0.0) & overlaps & needed.simd_gt(0.0);
        if !matters.any_true() {
            return free;
        }
        let kept = acc_accel(
            constants,
            vehicle,
            state.motion.vx[slot],
            self.current_desired_speed(context),
            gap,
            closing,
            vehicle.time_gap,
            accel,
        );
        select(matters, max(kept, -needed), free)
    }
}

#[inline(always)]
fn braking_until_clear<S: Simd, const N: usize>(
    params: &Params<S, N>,
    room: F32<S>,
    closing: F32<S>,
    time: F32<S>,
) -> F32<S> {
    let room = at_least(room, params.constants.min_effective_gap);
    let way = closing * time;
    select(
        way.simd_lt(2.0 * room),
        2.0 * (way - room) / (time * time),
        closing * closing / (2.0 * room),
    )
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The acceleration that driver `i` wants behind the leader, and behind the one whose lane is being left.
    #[inline(always)]
    pub fn requested_accel(
        self,
        context: &DriverContext<S>,
        accel_behind_leader: F32<S>,
    ) -> F32<S> {
        min(accel_behind_leader, self.accel_behind_old_leader(context))
    }
}

/// Move the pedals of vehicle `slot` towards the wanted acceleration.
#[inline(always)]
pub fn apply_pedals<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    wanted: F32<S>,
) {
    let constants = &params.constants;
    let wanted = max(
        wanted,
        -(params.vehicles[slot].max_brake_force * params.vehicles[slot].inverse_mass),
    );
    let up = select(
        state.controls.requested_accel[slot].simd_lt(0.0),
        splat(params.simd, constants.jerk_release),
        splat(params.simd, constants.jerk_up),
    ) * constants.decision;
    let down = at_least(-wanted / constants.brake_ramp, constants.jerk_down) * constants.decision;
    let changed = state.controls.requested_accel[slot]
        + clamp(wanted - state.controls.requested_accel[slot], -down, up);
    state.controls.requested_accel[slot] = select(
        state.motion.is_wreck[slot].simd_gt(0.0),
        splat(params.simd, 0.0),
        changed,
    );
}

/// Keeps braking finite for who is there already [s].
const MIN_MEETING_TIME: f32 = 0.1;

/// The acceleration that driver `slot` does not go beyond for who comes in its lane; it may move aside, too.
#[inline(always)]
pub fn accel_for_oncoming<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    met: &OncomingTraffic<S>,
) -> F32<S> {
    let constants = &params.constants;
    let splat = |value: f32| splat(params.simd, value);
    let out = state.vehicle(params, slot).is_overtaking();
    let meets = met.meets_in_own_lane & state.motion.is_wreck[slot].simd_eq(0.0) & !out;
    let time = met.time_to_meeting;
    let lifts = meets & time.simd_lt(constants.oncoming_flash_time);
    let brakes = meets & time.simd_lt(constants.oncoming_brake_time);
    state.controls.flashes_high_beam[slot] = select(lifts, splat(1.0), splat(0.0));
    let halved = 2.0 * at_least(time, MIN_MEETING_TIME);
    let braking = clamp_to(
        state.motion.vx[slot] / halved,
        constants.oncoming_min_decel,
        constants.oncoming_max_decel,
    );
    shift_to_edge(state, params, slot, brakes, met.is_being_passed, out);
    select(
        brakes,
        -braking,
        select(
            lifts,
            splat(-constants.oncoming_lift_decel),
            splat(NO_ACCEL_LIMIT),
        ),
    )
}

/// Move towards the edge of the lane for who comes in it, or passes; and back afterwards. Who is `out` keeps
/// to the way of that.
#[inline(always)]
fn shift_to_edge<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    brakes: Mask<S>,
    passed: Mask<S>,
    out: Mask<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let splat = |value: f32| splat(params.simd, value);
    let room = select(passed, vehicle.edge_shift_when_passed, splat(0.0));
    let wanted = select(brakes, splat(constants.edge_shift), room);
    let arrived = state.path.elapsed[slot].simd_ge(state.path.duration[slot]);
    let moved = wanted.simd_gt(state.lane_choice.edge_shift[slot])
        | (arrived & wanted.simd_lt(state.lane_choice.edge_shift[slot]));
    let moved =
        moved & state.motion.is_wreck[slot].simd_eq(0.0) & vehicle.valid.simd_gt(0.0) & !out;
    if moved.any_true() {
        let (low, high) = lane_borders(params, state.lane_choice.lane[slot], 0.0);
        let duration = select(
            brakes,
            splat(constants.edge_shift_duration),
            splat(2.0 * constants.edge_shift_duration),
        );
        start_path(state, slot, moved, 0.5 * (low + high) - wanted, duration);
        assign_where(&mut state.lane_choice.edge_shift[slot], moved, wanted);
    }
    assign_where(&mut state.lane_choice.edge_shift[slot], out, splat(0.0));
}
