//! Gap acceptance: whether drivers pull out, return or cancel, by the gaps in which they believe; the twin of
//! `overtaking.sim.reference.gap_acceptance`.
//!
//! On one-way roads the ego, the vehicle under study, decides by gap acceptance and the others by MOBIL
//! (`lane_change`). On two-way roads all drivers decide by it. Left is the overtaking side. The target is the vehicle
//! that a driver overtakes. A branch is a what-if repetition of a simulation, in which decisions can be forced on the
//! ego.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{Leader, cah_accel, imposed_accel};
use crate::decision_context::DriverContext;
use crate::lane_change::{LaneChangeRisk, anticipated_follower, lane_change_is_dangerous};
use crate::math::elementary::exp;
use crate::math::vectors::{F32, Mask, at_least, at_most, at_slot, min, select, splat};
use crate::names::VehicleParams;
use crate::names::forced_decision;
use crate::neighbour_search::Neighbours;
use crate::params::Params;
use crate::pass_continuation::PassContinuation;
use crate::passing::tall_vehicle_gap_factor;
use crate::perception::Beliefs;
use crate::state::{
    EGO_SLOT, FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
    stage,
};
use crate::vehicle_handle::VehicleHandle;

/// Keeps the imposed braking finite for an ego with a script, whose gap factor is 0 [1].
const MIN_GAP_FACTOR: f32 = 1e-6;

/// Beliefs and demands of a driver at a decision.
pub struct GapAcceptanceInputs<'a, S: Simd> {
    pub vehicle: &'a VehicleParams<S>,
    /// Beliefs of the driver about its neighbours. A `steady_leader` of a role is assumed to keep its speed.
    pub beliefs: &'a Beliefs<S>,
    /// Speed that the driver desires at this place [m/s].
    desired_speed: F32<S>,
    /// Speed of the driver [m/s].
    pub speed: F32<S>,
    /// Believed speed of the leader [m/s].
    pub leader_speed: F32<S>,
    /// Factor on the gaps that the driver asks for now, 0 with a script [1].
    gap_factor: F32<S>,
    /// Largest braking that the driver imposes on others, positive [m/s^2].
    acceptable_imposed_decel: F32<S>,
    /// Share of its demands that a driver keeps after waiting, 1 at first [1].
    pub patience_left: F32<S>,
    /// Factor on the gap to a leader that blocks the view [1].
    tall_vehicle_gap_factor: F32<S>,
    /// Whether the ego changes lanes by the script of the study by Pinto et al. (2023): it asks for no gap, ignores
    /// vehicles beside it, and cancels nothing.
    is_scripted: Mask<S>,
    /// Whether the script makes it pull out now: it has detected a slower leader.
    pulls_out_by_script: Mask<S>,
    /// Decision that a branch forces on the ego, a constant of `forced_decision`; 0 without one.
    forced_decision: F32<S>,
}

impl<'a, S: Simd> GapAcceptanceInputs<'a, S> {
    /// The lane change that is under way, as the driver judges it.
    ///
    /// `old_leader_role` is the role of the leader in the old lane, from which the driver moves.
    #[inline(always)]
    fn lane_change_risk(&self, old_leader_role: usize) -> LaneChangeRisk<'a, S> {
        let beliefs = self.beliefs;
        LaneChangeRisk {
            vehicle: self.vehicle,
            speed: self.speed,
            time_gap: self.vehicle.time_gap * self.gap_factor,
            acceptable_imposed_decel: self.acceptable_imposed_decel,
            leader: beliefs.steady_leader(LEADER),
            follower_gap: beliefs.gap[FOLLOWER],
            follower_closing_speed: beliefs.closing_speed[FOLLOWER],
            old_leader: beliefs.steady_leader(old_leader_role),
            // The follower of a lane has the role after its leader's.
            old_follower_gap: beliefs.gap[old_leader_role + 1],
        }
    }
}

/// Wishes and actions of a driver at a decision.
pub struct Intent<S: Simd> {
    /// Wants to pull out, and indicates it.
    pub wants_to_pull_out: Mask<S>,
    /// Wants to return, and indicates it.
    pub wants_to_return: Mask<S>,
    /// Starts to pull out now.
    pub starts_pull_out: Mask<S>,
    /// Starts to return now.
    pub starts_return: Mask<S>,
    /// Gives up pulling out, or passing, and goes back to the right now.
    pub cancels_pull_out: Mask<S>,
    /// Gives up returning and goes back to the left now.
    pub cancels_return: Mask<S>,
    /// The target's front is visibly behind the driver's own rear.
    pub has_passed_target: Mask<S>,
    /// The last lane change is over.
    pub has_finished_lane_change: Mask<S>,
}

/// Beliefs of the driver in `slot`, and its demands, which fall while it waits behind a slower leader.
///
/// This is no method of the handle, because the inputs must not borrow the state, which changes while they are in use.
#[inline(always)]
fn gap_acceptance_inputs<'a, S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &'a Params<S, N>,
    slot: usize,
    context: &'a DriverContext<S>,
) -> GapAcceptanceInputs<'a, S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let (neighbours, beliefs) = (&context.neighbours, &context.beliefs);
    let relative_wait = state.overtake.time_waiting[slot] * vehicle.inverse_patience;
    let patience_left = at_least(exp(-relative_wait), constants.patience_floor);
    let gap_factor = vehicle.gap_demand_factor * patience_left;
    // A driver that has waited also imposes harder braking on its follower. Two limits remain: `max_imposed_decel`,
    // 6 m/s^2 by UN Regulation 157, and the braking that the believed friction allows (`max_assumed_decel`).
    let imposed_decel = at_most(
        vehicle.safe_decel / at_least(gap_factor, MIN_GAP_FACTOR),
        constants.max_imposed_decel,
    );
    // Only the ego can have a script or a forced decision.
    let never = context.checks_mirrors & !context.checks_mirrors; // False in each simulation.
    let (mut follows_script, mut pulls_out_by_script) = (never, never);
    let mut forced_decision = splat(params.simd, 0.0);
    let driver = state.vehicle(params, slot);
    if slot == EGO_SLOT {
        follows_script = is_scripted(params);
        let has_slower_leader = driver
            .true_closing_speed_to_leader(neighbours)
            .simd_gt(vehicle.min_speed_gain);
        pulls_out_by_script = follows_script & beliefs.is_detected[LEADER] & has_slower_leader;
        forced_decision = params.simulations.forced_decision;
    }
    let speed = state.motion.vx[slot];
    GapAcceptanceInputs {
        vehicle,
        beliefs,
        desired_speed: driver.desired_speed(),
        speed,
        leader_speed: speed - beliefs.closing_speed[LEADER],
        gap_factor,
        acceptable_imposed_decel: min(imposed_decel, vehicle.max_assumed_decel),
        patience_left,
        tall_vehicle_gap_factor: if params.road.directions.has_oncoming_traffic {
            tall_vehicle_gap_factor(params, neighbours.slot[LEADER])
        } else {
            splat(params.simd, 1.0)
        },
        is_scripted: follows_script,
        pulls_out_by_script,
        forced_decision,
    }
}

/// Whether the ego changes lanes by the script of the study: it asks for no gap.
#[inline(always)]
pub fn is_scripted<S: Simd, const N: usize>(params: &Params<S, N>) -> Mask<S> {
    params.vehicles[EGO_SLOT].gap_demand_factor.simd_le(0.0)
}

/// Acceleration, never positive, that a leader imposes on the driver [m/s^2].
///
/// It follows from the time gap that the driver asks for now.
#[inline(always)]
fn imposed_accel_on_driver<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
    leader: &Leader<S>,
) -> F32<S> {
    let vehicle = inputs.vehicle;
    let time_gap = vehicle.time_gap * inputs.gap_factor;
    imposed_accel(&params.constants, vehicle, inputs.speed, time_gap, leader)
}

/// Acceleration, never positive, that the driver imposes on a follower [m/s^2].
///
/// It follows from the time gap that the driver asks for now: it assumes that the follower is like itself. `gap` is the
/// gap to the follower [m], and `closing_speed` the speed of the follower minus the driver's [m/s].
#[inline(always)]
fn imposed_accel_by_driver<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
    gap: F32<S>,
    closing_speed: F32<S>,
) -> F32<S> {
    let (vehicle, driver) = (inputs.vehicle, Leader::steady(gap, closing_speed));
    let time_gap = vehicle.time_gap * inputs.gap_factor;
    let follower_speed = inputs.speed + closing_speed;
    imposed_accel(
        &params.constants,
        vehicle,
        follower_speed,
        time_gap,
        &driver,
    )
}

/// Whether the leader is so slow and so near that the driver wants to overtake now.
#[inline(always)]
fn wants_to_overtake<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let (vehicle, leader) = (inputs.vehicle, inputs.beliefs.steady_leader(LEADER));
    let is_slow = (inputs.desired_speed - inputs.leader_speed)
        .simd_gt(vehicle.min_speed_gain * inputs.patience_left);
    let is_reached_soon = leader
        .gap
        .simd_lt(vehicle.pull_out_ttc * leader.closing_speed);
    let kept_time_gap = vehicle.time_gap * inputs.tall_vehicle_gap_factor;
    // `close_time_gap` is a factor: a leader within 1.5 time gaps holds the driver up.
    let near_gap = params.constants.close_time_gap * kept_time_gap * inputs.speed + vehicle.min_gap;
    let is_near = leader.gap.simd_lt(near_gap);
    inputs.beliefs.is_detected[LEADER] & is_slow & (is_reached_soon | is_near)
}

/// Whether the lane on the left looks free enough and, on one-way roads, better.
///
/// It is better if its leader is faster, farther away by `waiting_time_gap`, or not detected.
/// On two-way roads the left lane is the opposing lane. A leader there is overtaking too, and the driver waits for it.
/// `accepts_oncoming_gap` judges oncoming vehicles.
#[inline(always)]
fn accepts_pull_out_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let (constants, vehicle, beliefs) = (&params.constants, inputs.vehicle, inputs.beliefs);
    let leader = beliefs.steady_leader(LEFT_LEADER);
    let is_free_ahead = imposed_accel_on_driver(params, inputs, &leader).simd_ge(-vehicle.decel);
    let gap = beliefs.gap[LEFT_FOLLOWER];
    let closing_speed = beliefs.closing_speed[LEFT_FOLLOWER];
    // Gap and closing speed of a follower that accelerates for 2 s.
    let (later_gap, later_closing_speed) = anticipated_follower(params, gap, closing_speed);
    let follower_accel = min(
        imposed_accel_by_driver(params, inputs, gap, closing_speed),
        imposed_accel_by_driver(params, inputs, later_gap, later_closing_speed),
    );
    let is_free_behind = follower_accel.simd_ge(-inputs.acceptable_imposed_decel)
        & gap.simd_gt(constants.min_rear_gap * inputs.gap_factor);
    let has_no_leader = !beliefs.is_detected[LEFT_LEADER];
    if params.road.directions.has_oncoming_traffic {
        return is_free_behind & has_no_leader;
    }
    // Speed of the left leader minus the speed of the present leader.
    let is_faster = ((inputs.speed - leader.closing_speed) - inputs.leader_speed)
        .simd_gt(vehicle.min_speed_gain * inputs.patience_left);
    let extra_gap = constants.waiting_time_gap * inputs.speed;
    let is_far = leader.gap.simd_gt(beliefs.gap[LEADER] + extra_gap);
    is_free_ahead & is_free_behind & (is_faster | is_far | has_no_leader)
}

/// Whether the lane on the right has space for the return.
///
/// The driver judges the gap behind for the time when it crosses the line, half-way through the lane change, and the
/// gap ahead for the end of the lane change. `target_gap_factor` multiplies the gap that it leaves to its target; it is
/// 1 for a car.
#[inline(always)]
fn accepts_return_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
    target_gap_factor: F32<S>,
) -> Mask<S> {
    let (constants, vehicle, beliefs) = (&params.constants, inputs.vehicle, inputs.beliefs);
    let leader = beliefs.steady_leader(RIGHT_LEADER);
    let closing_speed = beliefs.closing_speed[RIGHT_FOLLOWER];
    let time_to_line = 0.5 * vehicle.lane_change_duration;
    // Only growth of the gap counts here: the imposed braking already covers a gap that shrinks.
    let follower_gap = beliefs.gap[RIGHT_FOLLOWER] - time_to_line * at_most(closing_speed, 0.0);
    let follower_speed = inputs.speed + closing_speed;
    let min_gap =
        vehicle.return_time_gap * follower_speed * inputs.patience_left * target_gap_factor;
    let follower_accel = imposed_accel_by_driver(params, inputs, follower_gap, closing_speed);
    let is_free_behind =
        follower_gap.simd_ge(min_gap) & follower_accel.simd_ge(-inputs.acceptable_imposed_decel);
    let leader_at_end = Leader {
        gap: leader.gap - vehicle.lane_change_duration * at_least(leader.closing_speed, 0.0),
        ..leader
    };
    let is_free_ahead =
        imposed_accel_on_driver(params, inputs, &leader_at_end).simd_ge(-vehicle.decel);
    // On a two-way road drivers return even if they soon reach the next vehicle.
    if params.road.directions.has_oncoming_traffic {
        return is_free_behind & is_free_ahead & leader.gap.simd_gt(constants.min_return_gap);
    }
    // On a one-way road a driver stays left if it would have to pull out again within `stay_time`.
    let stays_free = leader
        .gap
        .simd_gt(constants.stay_time * leader.closing_speed);
    is_free_behind & is_free_ahead & stays_free
}

/// Whether the lane on the right has the least space for an urgent return.
///
/// The driver judges both gaps for the time when it crosses the line. It accepts braking behind the leader, up to the
/// limit at which it would cancel a lane change: if it waited for a gap without braking, it would return too late
/// behind a slow vehicle.
#[inline(always)]
fn accepts_urgent_return_gaps<S: Simd, const N: usize>(
    params: &Params<S, N>,
    inputs: &GapAcceptanceInputs<'_, S>,
) -> Mask<S> {
    let (constants, beliefs) = (&params.constants, inputs.beliefs);
    let leader = beliefs.steady_leader(RIGHT_LEADER);
    let closing_speed = beliefs.closing_speed[RIGHT_FOLLOWER];
    let time_to_line = 0.5 * params.simulations.urgent_change_duration;
    // The gap ahead may also grow until then, so a driver slower than the leader need not wait for it. Of the gap
    // behind, which no imposed braking covers here, only shrinking counts (a choice of this model).
    let leader_gap = leader.gap - time_to_line * leader.closing_speed;
    let follower_gap = beliefs.gap[RIGHT_FOLLOWER] - time_to_line * at_least(closing_speed, 0.0);
    let has_space = min(follower_gap, leader_gap).simd_gt(constants.min_return_gap);
    let accel = cah_accel(constants, inputs.speed, &leader);
    // `abort_factor` is a factor on the comfortable deceleration.
    has_space & accel.simd_ge(-(constants.abort_factor * inputs.vehicle.decel))
}

/// Wishes of the driver in `slot`, and the lane change that it starts or cancels now.
///
/// Changes `lane_choice.wanted_side` and `overtake.time_indicating`. `continuation` is whether the driver completes or
/// aborts its pass; `None` on one-way roads.
#[inline(always)]
pub fn form_intent<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
    continuation: Option<&PassContinuation<S>>,
) -> Intent<S> {
    let inputs = &gap_acceptance_inputs(state, params, slot, context);
    let forced_decision = inputs.forced_decision;
    let driver = state.vehicle(params, slot);
    let wants_to_pull_out = driver.wants_to_pull_out(context, inputs);
    let wants_to_return = driver.wants_to_return(context, inputs, continuation);
    store_wanted_side(state, params, slot, wants_to_pull_out, wants_to_return);
    let driver = state.vehicle(params, slot);
    let has_indicated =
        state.overtake.time_indicating[slot].simd_gt(inputs.vehicle.indicator_lead_time);
    // A driver moves over only right after a check of its mirrors. It gives way to another driver that indicates into
    // the same lane and goes first.
    let may_move_over = (context.checks_mirrors & !context.gives_way) | inputs.is_scripted;
    let mut cancels_pull_out = driver.cancels_pull_out(context, inputs);
    let mut cancels_return = driver.cancels_return(context, inputs);
    let mut may_return = has_indicated;
    if let Some(continuation) = continuation {
        // A driver that aborts does not wait for mirrors or indicator. It goes back behind its target as soon as
        // braking will leave a gap to the target and to the leader in the right lane. `overtake` carries this out as a
        // cancelled pull-out.
        let has_gap_behind =
            inputs.beliefs.gap[RIGHT_FOLLOWER].simd_gt(params.constants.min_rear_gap);
        let falls_back = continuation.must_abort & continuation.fits_into_lane & has_gap_behind;
        // An urgent return does not wait for the indicator lead time.
        may_return = (may_return | continuation.must_return_urgently) & !falls_back;
        cancels_pull_out |= falls_back;
        // On two-way roads no driver cancels a return: it cannot stay in the opposing lane. The result is false in each
        // simulation.
        cancels_return &= !cancels_return;
    }
    Intent {
        wants_to_pull_out,
        wants_to_return,
        starts_pull_out: wants_to_pull_out
            & has_indicated
            & (may_move_over | forced_decision.simd_eq(forced_decision::PULL_OUT)),
        starts_return: wants_to_return
            & may_return
            & (may_move_over | forced_decision.simd_eq(forced_decision::RETURN)),
        cancels_pull_out,
        cancels_return,
        has_passed_target: driver.has_passed_target(),
        has_finished_lane_change: driver.has_finished_lane_change(),
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// True speed of the ego minus its leader's, 0 without a leader [m/s].
    ///
    /// The script decides by it. An ego that decided by its belief would pull out too late: it notices the closing
    /// speed only when the leader looms, and the study's egos pull out 31 to 56 m behind.
    #[inline(always)]
    pub fn true_closing_speed_to_leader(self, neighbours: &Neighbours<S>) -> F32<S> {
        let vx = &self.state.motion.vx;
        // Without a leader, `at_slot!` takes slot 0, the ego itself.
        vx[self.slot] - at_slot!(self.params, neighbours.slot[LEADER], |j| { vx[j] })
    }

    /// Whether the driver wants to overtake and accepts the gaps, or a branch forces it to.
    #[inline(always)]
    fn wants_to_pull_out(
        self,
        context: &DriverContext<S>,
        inputs: &GapAcceptanceInputs<'_, S>,
    ) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        // The pause keeps a driver that has cancelled a lane change from starting it again at once.
        let can_pull_out = self.is_in_stage(stage::FOLLOW)
            & self.has_finished_lane_change()
            & self.has_paused()
            & state.lane_choice.lane[slot].simd_lt((params.road.num_lanes - 1) as f32);
        let mut wants_now =
            wants_to_overtake(params, inputs) & accepts_pull_out_gaps(params, inputs);
        if params.road.directions.has_oncoming_traffic {
            wants_now &= self.accepts_oncoming_gap(context, inputs);
            wants_now &= !context.oncoming.leader_pulls_out;
        }
        let wants_now = select_mask(inputs.is_scripted, inputs.pulls_out_by_script, wants_now);
        // Between two checks of the mirrors drivers keep their intention.
        let decides = context.checks_mirrors | inputs.is_scripted;
        let keeps_wish = state.lane_choice.wanted_side[slot].simd_gt(0.0);
        let wants = select_mask(decides, wants_now, keeps_wish)
            & inputs.forced_decision.simd_ne(forced_decision::STAY);
        // A branch forces the first attempt only; later ones are the driver's own.
        let is_forced = inputs.forced_decision.simd_eq(forced_decision::PULL_OUT)
            & state.has_attempted.simd_eq(0.0);
        can_pull_out & (wants | is_forced)
    }

    /// Whether the driver wants to return: past the target, stuck beside it, or forced by a branch.
    #[inline(always)]
    fn wants_to_return(
        self,
        context: &DriverContext<S>,
        inputs: &GapAcceptanceInputs<'_, S>,
        continuation: Option<&PassContinuation<S>>,
    ) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let has_right_lane = state.lane_choice.lane[slot].simd_ge(1.0);
        let can_return = self.is_in_stage(stage::PASS) & has_right_lane;
        let has_passed = self.has_passed_target();
        let is_late = state.overtake.time_in_stage[slot].simd_gt(params.constants.give_up_after);
        let is_stuck = is_late & self.is_behind_target();
        let mut has_paused = self.has_paused();
        let target_gap_factor = if continuation.is_some() {
            tall_vehicle_gap_factor(params, state.overtake.target_slot[slot])
        } else {
            splat(params.simd, 1.0)
        };
        let mut accepts_gaps =
            accepts_return_gaps(params, inputs, target_gap_factor) & (has_passed | is_stuck);
        if let Some(continuation) = continuation {
            let accepts_small_gaps = continuation.accepts_small_gap
                & accepts_urgent_return_gaps(params, inputs)
                & has_passed;
            accepts_gaps |= accepts_small_gaps;
            // An urgent return does not wait for the pause after the pull-out.
            has_paused |= accepts_small_gaps;
        }
        let wants_now = select_mask(inputs.is_scripted, has_passed, accepts_gaps) & has_paused;
        let decides = context.checks_mirrors | inputs.is_scripted;
        let keeps_wish = state.lane_choice.wanted_side[slot].simd_lt(0.0);
        let wants = select_mask(decides, wants_now, keeps_wish);
        can_return & (wants | inputs.forced_decision.simd_eq(forced_decision::RETURN))
    }

    /// Whether the driver cancels a pull-out: it has become dangerous, or a branch forces it to.
    #[inline(always)]
    fn cancels_pull_out(
        self,
        context: &DriverContext<S>,
        inputs: &GapAcceptanceInputs<'_, S>,
    ) -> Mask<S> {
        let is_dangerous = context.checks_mirrors
            & !inputs.is_scripted
            & lane_change_is_dangerous(
                &self.params.constants,
                &inputs.lane_change_risk(RIGHT_LEADER),
            );
        let is_forced = inputs.forced_decision.simd_eq(forced_decision::CANCEL);
        self.can_cancel_pull_out() & (is_dangerous | is_forced)
    }

    /// Whether the driver cancels a return that has become dangerous, unless a branch forces it.
    #[inline(always)]
    fn cancels_return(
        self,
        context: &DriverContext<S>,
        inputs: &GapAcceptanceInputs<'_, S>,
    ) -> Mask<S> {
        let is_dangerous = context.checks_mirrors
            & !inputs.is_scripted
            & lane_change_is_dangerous(
                &self.params.constants,
                &inputs.lane_change_risk(LEFT_LEADER),
            );
        let is_forced = inputs.forced_decision.simd_eq(forced_decision::RETURN);
        self.can_cancel_return() & is_dangerous & !is_forced
    }

    /// Whether the pause after the last lane change, completed or cancelled, is over.
    #[inline(always)]
    fn has_paused(self) -> Mask<S> {
        self.state.lane_choice.time_since_lane_change[self.slot]
            .simd_ge(self.params.constants.abort_cooldown)
    }

    /// Whether the target's front is visibly behind this vehicle's rear.
    #[inline(always)]
    pub fn has_passed_target(self) -> Mask<S> {
        let (s, params) = (&self.state.motion.s, self.params);
        let target_slot = self.state.overtake.target_slot[self.slot];
        let target_s = at_slot!(params, target_slot, |j| s[j]);
        let target_half_length = at_slot!(params, target_slot, |j| params.vehicles[j].half_length);
        let half_lengths = self.vehicle().half_length + target_half_length;
        (s[self.slot] - target_s).simd_gt(half_lengths + params.constants.return_clearance)
    }

    /// Whether the target's centre is ahead.
    #[inline(always)]
    pub fn is_behind_target(self) -> Mask<S> {
        let s = &self.state.motion.s;
        let target_slot = self.state.overtake.target_slot[self.slot];
        s[self.slot].simd_lt(at_slot!(self.params, target_slot, |j| s[j]))
    }

    /// Whether the lane change has just begun, so that turning back is quicker than finishing it.
    #[inline(always)]
    fn is_quicker_to_turn_back(self) -> Mask<S> {
        let (path, slot) = (&self.state.path, self.slot);
        path.elapsed[slot].simd_lt(self.params.constants.abort_until * path.duration[slot])
    }

    /// Whether the driver has just begun to pull out.
    #[inline(always)]
    pub fn can_cancel_pull_out(self) -> Mask<S> {
        self.is_in_stage(stage::PULL_OUT) & self.is_quicker_to_turn_back()
    }

    /// Whether the driver has just begun to go back by a whole lane, not from a cancelled pull-out.
    #[inline(always)]
    pub fn can_cancel_return(self) -> Mask<S> {
        (self.is_in_stage(stage::RETURN) | self.is_in_stage(stage::ABORT))
            & self.is_quicker_to_turn_back()
            & self.lane_change_direction().is_whole_lane
    }
}

/// `a` where `mask` holds, else `b`.
#[inline(always)]
fn select_mask<S: Simd>(mask: Mask<S>, a: Mask<S>, b: Mask<S>) -> Mask<S> {
    (mask & a) | (!mask & b)
}

/// Store the side that the driver in `slot` wants, 1 left, -1 right or 0, and the time for which it has wanted it.
#[inline(always)]
pub fn store_wanted_side<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    wants_to_pull_out: Mask<S>,
    wants_to_return: Mask<S>,
) {
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    state.lane_choice.wanted_side[slot] =
        select(wants_to_pull_out, one, select(wants_to_return, -one, zero));
    // The time counts whether or not the driver uses its indicator. Without a wish it falls to 0 as fast as it has
    // grown, so a short doubt does not restart the lead time. `decision` is the time between two decisions [s].
    let time_indicating = state.overtake.time_indicating[slot];
    let longer_time = time_indicating + params.constants.decision;
    let shorter_time = at_least(time_indicating - params.constants.decision, 0.0);
    state.overtake.time_indicating[slot] = select(
        wants_to_pull_out | wants_to_return,
        longer_time,
        shorter_time,
    );
}
