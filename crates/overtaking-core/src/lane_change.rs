//! Lane changes of everybody but the ego; see `overtaking.sim.reference.lane_change`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{acc_accel, cah_accel, imposed_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{F32, Mask, assign_where, at_least, min, select, splat};
use crate::neighbour_search::{VisibleBody, lane_borders, nearest_image};
use crate::params::Params;
use crate::perception::{Beliefs, draw_shoulder_check};
use crate::state::{
    FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
};
use crate::steering::start_path;
use crate::vehicle_handle::VehicleHandle;

/// Keeps the time until a gap is closed finite [m/s].
const MIN_SPEED: f32 = 0.1;

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn imposed_accel_on_follower(self, speed: F32<S>, gap: F32<S>, closing: F32<S>) -> F32<S> {
        let params = self.params;
        imposed_accel(
            &params.constants,
            self.vehicle(),
            speed + closing,
            gap,
            closing,
            self.vehicle().time_gap,
        )
    }

    #[inline(always)]
    fn mobil_incentives(self, believed: &Beliefs<S>, own: F32<S>) -> (F32<S>, F32<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle, v) = (&params.constants, self.vehicle(), state.motion.vx[slot]);
        let (gap, closing) = (&believed.gap, &believed.closing_speed);
        let steady = splat(params.simd, 0.0);
        let desired = self.desired_speed();
        let fast = acc_accel(
            constants,
            vehicle,
            v,
            desired,
            gap[LEFT_LEADER],
            closing[LEFT_LEADER],
            vehicle.time_gap,
            steady,
        );
        let slow = acc_accel(
            constants,
            vehicle,
            v,
            desired,
            gap[RIGHT_LEADER],
            closing[RIGHT_LEADER],
            vehicle.time_gap,
            steady,
        );
        let (fast, slow) = (self.limit_accel(fast), self.limit_accel(slow));
        let no_passing = v.simd_gt(constants.no_passing_right_speed);
        let here = select(no_passing, min(own, fast), own);
        let there = select(no_passing, min(slow, own), slow);
        let body = 2.0 * vehicle.half_length;
        let after = self.imposed_accel_on_follower(v, gap[LEFT_FOLLOWER], closing[LEFT_FOLLOWER]);
        let open_gap = gap[LEFT_FOLLOWER] + gap[LEFT_LEADER] + body;
        let before = self.imposed_accel_on_follower(
            v - closing[LEFT_LEADER],
            open_gap,
            closing[LEFT_FOLLOWER] + closing[LEFT_LEADER],
        );
        let relieved_gap = gap[FOLLOWER] + gap[LEADER] + body;
        let now = self.imposed_accel_on_follower(v, gap[FOLLOWER], closing[FOLLOWER]);
        let relieved = self.imposed_accel_on_follower(
            v - closing[LEADER],
            relieved_gap,
            closing[FOLLOWER] + closing[LEADER],
        );
        let to_fast = fast - here + vehicle.politeness * (after - before) - vehicle.keep_right_bias;
        let to_slow = there - own + vehicle.politeness * (relieved - now) + vehicle.keep_right_bias;
        (to_fast, to_slow)
    }

    #[inline(always)]
    fn is_safe_lane_change(self, believed: &Beliefs<S>, front: usize, rear: usize) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle, v) = (&params.constants, self.vehicle(), state.motion.vx[slot]);
        let (gap, closing) = (&believed.gap, &believed.closing_speed);
        let (later, faster) = anticipated_follower(params, gap[rear], closing[rear]);
        let braking = min(
            self.imposed_accel_on_follower(v, gap[rear], closing[rear]),
            self.imposed_accel_on_follower(v, later, faster),
        );
        let own = imposed_accel(
            constants,
            vehicle,
            v,
            gap[front],
            closing[front],
            vehicle.time_gap,
        );
        let room =
            gap[rear].simd_gt(constants.min_rear_gap) & gap[front].simd_gt(constants.min_rear_gap);
        room & braking.simd_ge(-vehicle.safe_decel) & own.simd_ge(-vehicle.safe_decel)
    }
}

/// Gap to a follower, and how fast it closes, if it speeds up for some seconds.
#[inline(always)]
pub fn anticipated_follower<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    closing: F32<S>,
) -> (F32<S>, F32<S>) {
    let constants = &params.constants;
    let faster = constants.foresight_accel * constants.foresight;
    (
        gap - constants.foresight * (closing + 0.5 * faster),
        closing + faster,
    )
}

/// Let vehicle `slot`, not the ego, change lanes where it pays and is safe, or back in danger.
#[inline(always)]
pub fn change_lanes_by_mobil<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    bodies: &[VisibleBody<S>; N],
    context: &DriverContext<S>,
    own: F32<S>,
) {
    let (believed, looks) = (&context.beliefs, context.checks_mirrors);
    let (constants, vehicle, v) = (
        &params.constants,
        &params.vehicles[slot],
        state.motion.vx[slot],
    );
    let (to_fast, to_slow) = state.vehicle(params, slot).mobil_incentives(believed, own);
    let ready = looks
        & state.path.elapsed[slot].simd_ge(state.path.duration[slot])
        & state.lane_choice.time_since_lane_change[slot].simd_ge(constants.cooldown)
        & state.motion.is_wreck[slot].simd_eq(0.0)
        & vehicle.valid.simd_gt(0.0);
    let exists_fast = state.lane_choice.lane[slot].simd_lt((params.road.num_lanes - 1) as f32);
    let exists_slow = state.lane_choice.lane[slot].simd_ge(1.0);
    let fast = ready
        & exists_fast
        & to_fast.simd_gt(vehicle.lane_change_threshold)
        & state
            .vehicle(params, slot)
            .is_safe_lane_change(believed, LEFT_LEADER, LEFT_FOLLOWER);
    let slow = ready
        & exists_slow
        & to_slow.simd_gt(vehicle.lane_change_threshold)
        & state
            .vehicle(params, slot)
            .is_safe_lane_change(believed, RIGHT_LEADER, RIGHT_FOLLOWER)
        & believed.gap[RIGHT_LEADER].simd_gt(constants.free_ahead_time * v)
        & !fast;
    let wanted = signed_side(params, fast, slow);
    let shows = looks & state.path.elapsed[slot].simd_ge(state.path.duration[slot]);
    assign_where(
        &mut state.controls.indicator[slot],
        shows,
        wanted * vehicle.uses_indicator,
    );
    let decided = update_wanted_side(state, params, slot, wanted, looks);
    let (mut fast, mut slow) = (fast & decided, slow & decided);
    if (fast | slow).any_true() {
        let first = !state.vehicle(params, slot).gives_way(bodies, wanted);
        (fast, slow) = (fast & first, slow & first);
    }
    let (back, to_fast) = state.vehicle(params, slot).cancels_lane_change(believed);
    let back = back & looks;
    let (fast, slow) = (fast | (back & !to_fast), slow | (back & to_fast));
    start_lane_changes(
        state,
        params,
        slot,
        (fast, slow, back),
        believed,
        None,
        context.decision_index,
    );
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether vehicle `i` lets somebody first who signals for the same place from the other side of it.
    #[inline(always)]
    pub fn gives_way(self, bodies: &[VisibleBody<S>; N], signed_side: F32<S>) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let reach = params.constants.claim_time * state.motion.vx[slot];
        let mut waits = signed_side.simd_ne(signed_side);
        for j in 0..params.num_slots_in_use {
            let other = &bodies[j];
            let ahead = nearest_image(params, state.motion.s[j] - state.motion.s[slot]);
            let same = other.claimed_side.simd_eq(-signed_side)
                & other.lane.simd_eq(bodies[slot].lane + 2.0 * signed_side)
                & signed_side.simd_ne(0.0);
            let close = ahead.abs().simd_lt(reach);
            let first = ahead.simd_gt(0.0) | (ahead.simd_eq(0.0) & signed_side.simd_lt(0.0));
            waits |= same & close & first;
        }
        waits
    }

    /// Whether the lane change of vehicle `i` is to the fast side, and a whole one: a retreat has less far to
    /// go.
    #[inline(always)]
    pub fn lane_change_direction(self) -> (Mask<S>, Mask<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (low, high) = lane_borders(params, state.lane_choice.lane[slot], 0.0);
        let way = 0.5 * (low + high) - state.path.coefficients[slot][0];
        (way.simd_gt(0.0), way.abs().simd_gt(0.5 * (high - low)))
    }

    /// Whether vehicle `i` gives up a lane change, as it has turned dangerous; and whether it is to the fast
    /// side.
    #[inline(always)]
    fn cancels_lane_change(self, believed: &Beliefs<S>) -> (Mask<S>, Mask<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle, v) = (&params.constants, self.vehicle(), state.motion.vx[slot]);
        let (gap, closing) = (&believed.gap, &believed.closing_speed);
        let early = state.path.elapsed[slot]
            .simd_lt(constants.abort_until * state.path.duration[slot])
            & state.motion.is_wreck[slot].simd_eq(0.0)
            & vehicle.valid.simd_gt(0.0);
        if !early.any_true() {
            return (early, early);
        }
        let (to_fast, whole) = self.lane_change_direction();
        let old = |values: &[F32<S>; 6], slow: usize, fast: usize| {
            select(to_fast, values[slow], values[fast])
        };
        let bad_rear = self
            .imposed_accel_on_follower(v, gap[FOLLOWER], closing[FOLLOWER])
            .simd_lt(-(constants.abort_imposed_factor * vehicle.safe_decel));
        let own = imposed_accel(
            constants,
            vehicle,
            v,
            gap[LEADER],
            closing[LEADER],
            vehicle.time_gap,
        );
        let bad_front = own.simd_lt(-(constants.abort_factor * vehicle.decel));
        let (ahead, nearing) = (
            old(gap, RIGHT_LEADER, LEFT_LEADER),
            old(closing, RIGHT_LEADER, LEFT_LEADER),
        );
        let back = cah_accel(constants, v, ahead, nearing, splat(params.simd, 0.0));
        let room = back.simd_ge(-vehicle.max_assumed_decel)
            & old(gap, RIGHT_FOLLOWER, LEFT_FOLLOWER).simd_gt(constants.min_rear_gap);
        ((bad_rear | bad_front) & room & early & whole, to_fast)
    }
}

/// Whether vehicle `slot` has wanted the same for as long as it signals; remembers what it wants.
#[inline(always)]
fn update_wanted_side<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    wanted: F32<S>,
    looks: Mask<S>,
) -> Mask<S> {
    let same = wanted.simd_eq(state.lane_choice.wanted_side[slot]) & wanted.simd_ne(0.0);
    assign_where(
        &mut state.lane_choice.time_wanted[slot],
        looks & !same,
        splat(params.simd, 0.0),
    );
    assign_where(&mut state.lane_choice.wanted_side[slot], looks, wanted);
    looks
        & same
        & state.lane_choice.time_wanted[slot].simd_ge(params.vehicles[slot].indicator_lead_time)
}

/// 1 towards the fast side, -1 towards the slow side, 0 for neither.
#[inline(always)]
fn signed_side<S: Simd, const N: usize>(
    params: &Params<S, N>,
    fast: Mask<S>,
    slow: Mask<S>,
) -> F32<S> {
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    select(fast, one, zero) - select(slow, one, zero)
}

/// Begin a lane change of vehicle `slot` in the masked simulations, to the fast side, to the slow side or back;
/// in less than its usual time where the leader would be reached before, or in a time for who is in a hurry.
#[inline(always)]
pub fn start_lane_changes<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    (fast, slow, back): (Mask<S>, Mask<S>, Mask<S>),
    believed: &Beliefs<S>,
    hasty: Option<F32<S>>,
    decision: u32,
) {
    let moved = fast | slow;
    if !moved.any_true() {
        return;
    }
    let vehicle = &params.vehicles[slot];
    let step = signed_side(params, fast, slow);
    state.lane_choice.lane[slot] += step;
    let (low, high) = lane_borders(params, state.lane_choice.lane[slot], 0.0);
    let constants = &params.constants;
    let left = believed.gap[LEADER] / at_least(believed.closing_speed[LEADER], MIN_SPEED);
    let hurried = at_least(
        (left - constants.lane_clearance_time) / constants.lane_cleared_share,
        constants.min_lane_change_duration,
    );
    let usual = min(vehicle.lane_change_duration, hurried);
    let duration = select(
        back,
        constants.abort_duration_share * vehicle.lane_change_duration,
        usual,
    );
    let duration = hasty.map_or(duration, |hasty| {
        select(hasty.simd_gt(0.0), hasty, duration)
    });
    start_path(state, slot, moved, 0.5 * (low + high), duration);
    state.controls.indicator[slot] = select(
        moved,
        step * vehicle.uses_indicator,
        state.controls.indicator[slot],
    );
    state.lane_choice.wanted_side[slot] = select(
        moved,
        splat(params.simd, 0.0),
        state.lane_choice.wanted_side[slot],
    );
    draw_shoulder_check(state, params, slot, moved, decision);
}
