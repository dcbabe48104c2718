//! Gap acceptance: what a driver sets out to do, from what it believes of the gaps around it; see
//! `overtaking.sim.reference.gap_acceptance`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{cah_accel, imposed_accel};
use crate::decision_context::DriverContext;
use crate::lane_change::anticipated_follower;
use crate::math::elementary::exp;
use crate::math::vectors::{F32, Mask, at_least, at_most, at_slot, min, select, splat};
use crate::names::VehicleParams;
use crate::names::forced_decision;
use crate::neighbour_search::Neighbours;
use crate::params::Params;
use crate::pass_continuation::PassContinuation;
use crate::passing::tall_vehicle_gap_factor;
use crate::state::{
    EGO_SLOT, FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
    stage,
};
use crate::vehicle_handle::VehicleHandle;

/// Keeps what is imposed finite for who demands nothing.
const MIN_GAP_FACTOR: f32 = 1e-6;

/// What a driver knows when it decides.
struct GapAcceptanceInputs<'a, S: Simd> {
    vehicle: &'a VehicleParams<S>,
    /// Speed that it wants where it is.
    desired_speed: F32<S>,
    speed: F32<S>,
    gap: &'a [F32<S>; 6],
    closing_speed: &'a [F32<S>; 6],
    is_detected: &'a [Mask<S>; 6],
    leader_speed: F32<S>,
    gap_factor: F32<S>,
    acceptable_imposed_decel: F32<S>,
    patience_left: F32<S>,
    /// How much more room it leaves to the leader than to a car.
    tall_vehicle_gap_factor: F32<S>,
    /// Is told to change lanes: needs no gap, ignores vehicles beside it and never aborts.
    is_scripted: Mask<S>,
    /// Is told to pull out now: a vehicle in sight ahead is slower.
    pulls_out_by_script: Mask<S>,
    /// Decision that is forced on the ego, 0 for none.
    forced_decision: F32<S>,
}

/// What driver `i` believes, and how much it demands after its wait.
#[inline(always)]
fn gap_acceptance_inputs<'a, S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &'a Params<S, N>,
    slot: usize,
    context: &'a DriverContext<S>,
) -> GapAcceptanceInputs<'a, S> {
    let (near, believed, own) = (
        &context.neighbours,
        &context.beliefs,
        &params.vehicles[slot],
    );
    let impatience = at_least(
        exp(-(state.overtake.time_waiting[slot] * own.inverse_patience)),
        params.constants.patience_floor,
    );
    let demand = own.gap_demand_factor * impatience;
    let never = context.checks_mirrors & !context.checks_mirrors;
    let (mut told, mut ordered, mut command) = (never, never, splat(params.simd, 0.0));
    if slot == EGO_SLOT {
        told = is_scripted(params);
        let faster = state
            .vehicle(params, slot)
            .true_closing_speed_to_leader(near);
        ordered = told & believed.is_detected[LEADER] & faster.simd_gt(own.min_speed_gain);
        command = params.simulations.forced_decision;
    }
    let bounded = own.safe_decel / at_least(demand, MIN_GAP_FACTOR);
    GapAcceptanceInputs {
        vehicle: own,
        desired_speed: state.vehicle(params, slot).desired_speed(),
        speed: state.motion.vx[slot],
        gap: &believed.gap,
        closing_speed: &believed.closing_speed,
        is_detected: &believed.is_detected,
        leader_speed: state.motion.vx[slot] - believed.closing_speed[LEADER],
        gap_factor: demand,
        acceptable_imposed_decel: min(
            at_most(bounded, params.constants.max_imposed_decel),
            own.max_assumed_decel,
        ),
        patience_left: impatience,
        tall_vehicle_gap_factor: if params.road.directions.has_oncoming_traffic {
            tall_vehicle_gap_factor(params, near.slot[LEADER])
        } else {
            splat(params.simd, 1.0)
        },
        is_scripted: told,
        pulls_out_by_script: ordered,
        forced_decision: command,
    }
}

/// Whether the ego is told to change lanes, as in the study: it demands no gap.
#[inline(always)]
pub fn is_scripted<S: Simd, const N: usize>(params: &Params<S, N>) -> Mask<S> {
    params.vehicles[EGO_SLOT].gap_demand_factor.simd_le(0.0)
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// By how much the ego is in truth faster than its leader, which decides where it is told.
    #[inline(always)]
    pub fn true_closing_speed_to_leader(self, near: &Neighbours<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        state.motion.vx[slot]
            - at_slot!(params.num_slots_in_use, near.slot[LEADER], |j| state
                .motion
                .vx[j])
    }
}

#[inline(always)]
fn imposed_accel_on_driver<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
    gap: F32<S>,
    closing: F32<S>,
) -> F32<S> {
    let time_gap = view.vehicle.time_gap * view.gap_factor;
    imposed_accel(
        &params.constants,
        view.vehicle,
        view.speed,
        gap,
        closing,
        time_gap,
    )
}

#[inline(always)]
fn imposed_accel_by_driver<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
    gap: F32<S>,
    closing: F32<S>,
) -> F32<S> {
    let time_gap = view.vehicle.time_gap * view.gap_factor;
    imposed_accel(
        &params.constants,
        view.vehicle,
        view.speed + closing,
        gap,
        closing,
        time_gap,
    )
}

#[inline(always)]
fn wants_to_overtake<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let own = view.vehicle;
    let slower =
        (view.desired_speed - view.leader_speed).simd_gt(own.min_speed_gain * view.patience_left);
    let soon = view.gap[LEADER].simd_lt(own.pull_out_ttc * view.closing_speed[LEADER]);
    let kept = own.time_gap * view.tall_vehicle_gap_factor;
    let near = params.constants.close_time_gap * kept * view.speed + own.min_gap;
    let close = view.gap[LEADER].simd_lt(near);
    view.is_detected[LEADER] & slower & (soon | close)
}

#[inline(always)]
fn accepts_pull_out_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let (constants, own) = (&params.constants, view.vehicle);
    let front = imposed_accel_on_driver(
        params,
        view,
        view.gap[LEFT_LEADER],
        view.closing_speed[LEFT_LEADER],
    )
    .simd_ge(-own.decel);
    let (gap, closing) = (view.gap[LEFT_FOLLOWER], view.closing_speed[LEFT_FOLLOWER]);
    let (later, faster) = anticipated_follower(params, gap, closing);
    let now = imposed_accel_by_driver(params, view, gap, closing);
    let imposed = min(now, imposed_accel_by_driver(params, view, later, faster));
    let rear = imposed.simd_ge(-view.acceptable_imposed_decel);
    let rear = rear & gap.simd_gt(constants.min_rear_gap * view.gap_factor);
    // The lane of oncoming traffic is free while the driver sees no other vehicle overtake there.
    if params.road.directions.has_oncoming_traffic {
        return rear & !view.is_detected[LEFT_LEADER];
    }
    let gain = ((view.speed - view.closing_speed[LEFT_LEADER]) - view.leader_speed)
        .simd_gt(own.min_speed_gain * view.patience_left);
    let far =
        view.gap[LEFT_LEADER].simd_gt(view.gap[LEADER] + constants.waiting_time_gap * view.speed);
    front & rear & (gain | far | !view.is_detected[LEFT_LEADER])
}

/// Whether the slower lane has room; `room_left` is how much more is left behind than to a car.
#[inline(always)]
fn accepts_return_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
    room_left: F32<S>,
) -> Mask<S> {
    let own = view.vehicle;
    let (closing, ahead) = (
        view.closing_speed[RIGHT_FOLLOWER],
        view.closing_speed[RIGHT_LEADER],
    );
    let crossing = 0.5 * own.lane_change_duration;
    let gap = view.gap[RIGHT_FOLLOWER] - crossing * at_most(closing, 0.0);
    let wanted = own.return_time_gap * (view.speed + closing) * view.patience_left;
    let left = gap.simd_ge(wanted * room_left);
    let rear = left
        & imposed_accel_by_driver(params, view, gap, closing)
            .simd_ge(-view.acceptable_imposed_decel);
    let room = view.gap[RIGHT_LEADER] - own.lane_change_duration * at_least(ahead, 0.0);
    let front = imposed_accel_on_driver(params, view, room, ahead).simd_ge(-own.decel);
    let worth = view.gap[RIGHT_LEADER]
        .simd_gt(params.constants.stay_time * view.closing_speed[RIGHT_LEADER]);
    // On a two-way road one returns even if one will soon catch up with the next vehicle.
    if params.road.directions.has_oncoming_traffic {
        return rear & front & view.gap[RIGHT_LEADER].simd_gt(params.constants.min_return_gap);
    }
    rear & front & worth
}

#[inline(always)]
fn lane_change_is_dangerous<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
    lead: usize,
    rear: usize,
) -> Mask<S> {
    let (constants, own) = (&params.constants, view.vehicle);
    let imposed = imposed_accel_by_driver(
        params,
        view,
        view.gap[FOLLOWER],
        view.closing_speed[FOLLOWER],
    );
    let braking =
        imposed_accel_on_driver(params, view, view.gap[LEADER], view.closing_speed[LEADER]);
    let bad = imposed.simd_lt(-(constants.abort_imposed_factor * view.acceptable_imposed_decel))
        | braking.simd_lt(-(constants.abort_factor * own.decel));
    let steady = splat(params.simd, 0.0);
    let back = cah_accel(
        constants,
        view.speed,
        view.gap[lead],
        view.closing_speed[lead],
        steady,
    );
    bad & back.simd_ge(-own.max_assumed_decel) & view.gap[rear].simd_gt(constants.min_rear_gap)
}

/// Whether the lane beside has room enough for a driver in a hurry when the line is crossed.
#[inline(always)]
fn accepts_urgent_return_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    view: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let (constants, closing) = (&params.constants, view.closing_speed[RIGHT_LEADER]);
    let crossing = 0.5 * params.simulations.urgent_change_duration;
    let front = view.gap[RIGHT_LEADER] - crossing * closing;
    let rear =
        view.gap[RIGHT_FOLLOWER] - crossing * at_least(view.closing_speed[RIGHT_FOLLOWER], 0.0);
    let squeezed = min(rear, front).simd_gt(constants.min_return_gap);
    // It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    let steady = splat(params.simd, 0.0);
    let ahead = cah_accel(
        constants,
        view.speed,
        view.gap[RIGHT_LEADER],
        closing,
        steady,
    );
    squeezed & ahead.simd_ge(-(constants.abort_factor * view.vehicle.decel))
}

/// What driver `slot` wants, and what of it is done now that it has signalled long enough.
#[inline(always)]
pub fn form_intent<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
    plight: Option<&PassContinuation<S>>,
) -> Intent<S> {
    let view = &gap_acceptance_inputs(state, params, slot, context);
    let (constants, looks, told, command) = (
        &params.constants,
        context.checks_mirrors,
        view.is_scripted,
        view.forced_decision,
    );
    let heeds = looks & !told;
    let arrived = state.vehicle(params, slot).has_finished_lane_change();
    let free = state.vehicle(params, slot).is_in_stage(stage::FOLLOW)
        & arrived
        & state.lane_choice.time_since_lane_change[slot].simd_ge(constants.abort_cooldown)
        & state.lane_choice.lane[slot].simd_lt((params.road.num_lanes - 1) as f32);
    let held = state.lane_choice.wanted_side[slot];
    let mut seen = wants_to_overtake(params, view) & accepts_pull_out_gaps(params, view);
    if plight.is_some() {
        let (coming, leader) = (
            &context.oncoming.nearest,
            (view.gap[LEADER], view.leader_speed),
        );
        seen &= state.vehicle(params, slot).accepts_oncoming_gap(
            &context.neighbours,
            coming,
            leader,
            view.patience_left,
        );
        seen &= !context.oncoming.leader_pulls_out;
    }
    let seen = select_mask(told, view.pulls_out_by_script, seen);
    let wanted =
        select_mask(looks | told, seen, held.simd_gt(0.0)) & command.simd_ne(forced_decision::STAY);
    let forced = command.simd_eq(forced_decision::PULL_OUT) & state.has_attempted.simd_eq(0.0);
    let start = free & (wanted | forced);

    let slower_lane = state.vehicle(params, slot).is_in_stage(stage::PASS)
        & state.lane_choice.lane[slot].simd_ge(1.0);
    let passed = state.vehicle(params, slot).has_passed_target();
    let stuck = state.overtake.time_in_stage[slot].simd_gt(constants.give_up_after)
        & state.vehicle(params, slot).is_behind_target();
    let mut rested =
        state.lane_choice.time_since_lane_change[slot].simd_ge(constants.abort_cooldown);
    let mut room = splat(params.simd, 1.0);
    if plight.is_some() {
        room = tall_vehicle_gap_factor(params, state.overtake.target_slot[slot]);
    }
    let mut may = accepts_return_gaps(params, view, room) & (passed | stuck);
    if let Some(plight) = plight {
        let hurried = plight.accepts_small_gap & accepts_urgent_return_gaps(params, view) & passed;
        may |= hurried;
        rested |= hurried;
    }
    let seen = select_mask(told, passed, may) & rested;
    let wanted = select_mask(looks | told, seen, held.simd_lt(0.0));
    let back = slower_lane & (wanted | command.simd_eq(forced_decision::RETURN));
    update_indicator(state, params, slot, start, back);
    let ready = state.overtake.time_indicating[slot].simd_gt(view.vehicle.indicator_lead_time);
    let danger = heeds & lane_change_is_dangerous(params, view, RIGHT_LEADER, RIGHT_FOLLOWER);
    let mut abort = state.vehicle(params, slot).can_cancel_pull_out()
        & (danger | command.simd_eq(forced_decision::CANCEL));
    let danger = heeds
        & lane_change_is_dangerous(params, view, LEFT_LEADER, LEFT_FOLLOWER)
        & command.simd_ne(forced_decision::RETURN);
    let sure = (looks & !context.gives_way) | told;
    let mut remain = state.vehicle(params, slot).can_cancel_return() & danger;
    let mut back_now = ready;
    if let Some(plight) = plight {
        let behind = view.gap[RIGHT_FOLLOWER].simd_gt(constants.min_rear_gap);
        let falls_in = plight.must_abort & plight.fits_into_lane & behind;
        back_now = (back_now | plight.must_return_urgently) & !falls_in;
        abort |= falls_in;
        // The other lane is no place to stay.
        remain &= !remain;
    }
    Intent {
        wants_to_pull_out: start,
        wants_to_return: back,
        starts_pull_out: start & ready & (sure | command.simd_eq(forced_decision::PULL_OUT)),
        starts_return: back & back_now & (sure | command.simd_eq(forced_decision::RETURN)),
        cancels_pull_out: abort,
        cancels_return: remain,
        has_passed_target: passed,
        has_finished_lane_change: arrived,
    }
}

/// One mask where another holds, and a third elsewhere.
#[inline(always)]
fn select_mask<S: Simd>(mask: Mask<S>, there: Mask<S>, elsewhere: Mask<S>) -> Mask<S> {
    (mask & there) | (!mask & elsewhere)
}

/// What a driver sets out to do at a decision.
pub struct Intent<S: Simd> {
    /// Wants to pull out, or to change back, and shows it.
    pub wants_to_pull_out: Mask<S>,
    pub wants_to_return: Mask<S>,
    /// Does it now.
    pub starts_pull_out: Mask<S>,
    pub starts_return: Mask<S>,
    pub cancels_pull_out: Mask<S>,
    /// Gives up changing back now.
    pub cancels_return: Mask<S>,
    /// The target is behind.
    pub has_passed_target: Mask<S>,
    /// The last lane change is over.
    pub has_finished_lane_change: Mask<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether the front of the target of driver `i` is visibly behind the own rear.
    #[inline(always)]
    pub fn has_passed_target(self) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let target = state.overtake.target_slot[slot];
        let target_s = at_slot!(params.num_slots_in_use, target, |j| state.motion.s[j]);
        let bodies = self.vehicle().half_length
            + at_slot!(params.num_slots_in_use, target, |j| params.vehicles[j]
                .half_length);
        (state.motion.s[slot] - target_s).simd_gt(bodies + params.constants.return_clearance)
    }

    /// Whether the target of driver `i` is ahead.
    #[inline(always)]
    pub fn is_behind_target(self) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let target_slot = state.overtake.target_slot[slot];
        let target_s = at_slot!(params.num_slots_in_use, target_slot, |j| state.motion.s[j]);
        state.motion.s[slot].simd_lt(target_s)
    }

    /// Whether going back is shorter than going on.
    #[inline(always)]
    fn is_quicker_to_turn_back(self) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        state.path.elapsed[slot].simd_lt(params.constants.abort_until * state.path.duration[slot])
    }

    /// Whether driver `i` pulls out, and going back is shorter than going on.
    #[inline(always)]
    pub fn can_cancel_pull_out(self) -> Mask<S> {
        self.is_in_stage(stage::PULL_OUT) & self.is_quicker_to_turn_back()
    }

    /// Whether driver `i` changes back by a whole lane, and going back is shorter than going on.
    #[inline(always)]
    pub fn can_cancel_return(self) -> Mask<S> {
        let comes_back = self.is_in_stage(stage::RETURN) | self.is_in_stage(stage::ABORT);
        comes_back & self.is_quicker_to_turn_back() & self.lane_change_direction().1
    }
}

/// Remember the side that is wanted, and for how long it has been shown.
#[inline(always)]
pub fn update_indicator<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    start: Mask<S>,
    back: Mask<S>,
) {
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    state.lane_choice.wanted_side[slot] = select(start, one, select(back, -one, zero));
    let longer = state.overtake.time_indicating[slot] + params.constants.decision;
    let fading = at_least(
        state.overtake.time_indicating[slot] - params.constants.decision,
        0.0,
    );
    state.overtake.time_indicating[slot] = select(start | back, longer, fading);
}
