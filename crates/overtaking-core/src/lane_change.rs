//! Lane changes by MOBIL: incentives, safety, cancelling, and the start of a lane change; the twin of
//! `overtaking.sim.reference.lane_change`.
//!
//! MOBIL (Kesting, Treiber, Helbing 2007) weighs a driver's gain in acceleration against the loss of its followers. On
//! one-way roads all drivers but the ego decide by it. `start_lane_changes` starts the lane changes of all drivers.
//! Left is the overtaking side; lanes are numbered from the right. During a lane change the driver's lane is the one
//! that it enters, and its old lane the one that it leaves. Beliefs about a neighbour that is not detected are a gap of
//! 1000 m and a closing speed of 0; a `steady_leader` is assumed to keep its speed.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{Follower, Leader, acc_accel, cah_accel, imposed_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{F32, Mask, assign_where, at_least, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};
use crate::neighbour_search::{VisibleBody, lane_borders, nearest_image};
use crate::params::Params;
use crate::perception::{Beliefs, draw_shoulder_check};
use crate::state::{
    FOLLOWER, LEADER, LEFT_FOLLOWER, LEFT_LEADER, NUM_ROLES, RIGHT_FOLLOWER, RIGHT_LEADER, State,
};
use crate::steering::start_path;
use crate::vehicle_handle::VehicleHandle;

/// Keeps the time until a gap is closed finite. It matters only at gaps below about a metre [m/s].
const MIN_CLOSING_SPEED: f32 = 0.1;

/// Gain in acceleration by a lane change, less the weighted loss of a follower [m/s^2].
struct MobilIncentives<S: Simd> {
    to_left: F32<S>,
    to_right: F32<S>,
}

/// Direction of the lane change that is under way, or of the last one.
pub struct LaneChangeDirection<S: Simd> {
    pub is_to_left: Mask<S>,
    /// Whether it crosses a whole lane; a cancelled lane change does not.
    pub is_whole_lane: Mask<S>,
}

/// Lane changes that start at a decision.
pub struct LaneMoves<S: Simd> {
    pub to_left: Mask<S>,
    pub to_right: Mask<S>,
    /// Whether the move cancels a lane change, and so is shorter.
    pub is_cancelled: Mask<S>,
    /// Duration of an urgent lane change, 0 for one of the usual duration; `None` if no change is urgent [s].
    pub urgent_duration: Option<F32<S>>,
}

/// A lane change that is under way, as its driver judges it.
pub struct LaneChangeRisk<'a, S: Simd> {
    /// Parameters of the driver and its vehicle.
    pub vehicle: &'a VehicleParams<S>,
    /// Speed of the driver [m/s].
    pub speed: F32<S>,
    /// Time gap that the driver asks for, behind its leader and for its follower [s].
    pub time_gap: F32<S>,
    /// Braking that the driver may impose on a follower when it starts a lane change, positive [m/s^2].
    pub acceptable_imposed_decel: F32<S>,
    /// Leader in the new lane.
    pub leader: Leader<S>,
    /// Gap to the follower in the new lane [m].
    pub follower_gap: F32<S>,
    /// Speed of that follower minus the driver's [m/s].
    pub follower_closing_speed: F32<S>,
    /// Leader in the old lane.
    pub old_leader: Leader<S>,
    /// Gap to the follower in the old lane [m].
    pub old_follower_gap: F32<S>,
}

/// Whether the new lane has become dangerous, and the old one still has space.
///
/// The limits are clearly above those for starting a lane change. The new lane is dangerous if its follower must brake
/// harder than `abort_imposed_factor` times the acceptable braking, or if the driver must brake harder than
/// `abort_factor` times its comfortable braking.
#[inline(always)]
pub fn lane_change_is_dangerous<S: Simd>(
    constants: &ModelConstants,
    risk: &LaneChangeRisk<'_, S>,
) -> Mask<S> {
    let (vehicle, speed) = (risk.vehicle, risk.speed);
    let follower_accel = imposed_accel(
        constants,
        vehicle,
        speed + risk.follower_closing_speed,
        risk.time_gap,
        &Leader::steady(risk.follower_gap, risk.follower_closing_speed),
    );
    let max_imposed_decel = constants.abort_imposed_factor * risk.acceptable_imposed_decel;
    let endangers_follower = follower_accel.simd_lt(-max_imposed_decel);
    let accel = imposed_accel(constants, vehicle, speed, risk.time_gap, &risk.leader);
    let must_brake_hard = accel.simd_lt(-(constants.abort_factor * vehicle.decel));
    // Back in the old lane the driver only needs to avoid a contact with its old leader.
    let old_leader_accel = cah_accel(constants, speed, &risk.old_leader);
    let can_brake = old_leader_accel.simd_ge(-vehicle.max_assumed_decel);
    let has_space_behind = risk.old_follower_gap.simd_gt(constants.min_rear_gap);
    (endangers_follower | must_brake_hard) & can_brake & has_space_behind
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Acceleration that a vehicle in front would impose on a follower, as this driver judges it [m/s^2].
    ///
    /// The driver assumes that the follower is like itself and keeps the same time gap. `speed` is the speed of the
    /// vehicle in front, which may be the driver's own [m/s], `gap` the gap from that vehicle to the follower [m], and
    /// `closing_speed` the follower's speed minus `speed` [m/s].
    #[inline(always)]
    fn imposed_accel_on_follower(
        self,
        speed: F32<S>,
        gap: F32<S>,
        closing_speed: F32<S>,
    ) -> F32<S> {
        let vehicle = self.vehicle();
        imposed_accel(
            &self.params.constants,
            vehicle,
            speed + closing_speed,
            vehicle.time_gap,
            &Leader::steady(gap, closing_speed),
        )
    }

    /// MOBIL's incentives to change to the left and to the right [m/s^2].
    ///
    /// European rule: for a change to the left only the new follower counts, for a change to the right only the old
    /// one. Above `no_passing_right_speed`, 60 km/h, no driver passes on the right. `accel` is the acceleration behind
    /// the present leader [m/s^2].
    #[inline(always)]
    fn mobil_incentives(self, beliefs: &Beliefs<S>, accel: F32<S>) -> MobilIncentives<S> {
        let (constants, vehicle) = (&self.params.constants, self.vehicle());
        let speed = self.state.motion.vx[self.slot];
        let (gap, closing_speed) = (&beliefs.gap, &beliefs.closing_speed);
        let driver = Follower {
            vehicle,
            speed,
            desired_speed: self.desired_speed(),
            time_gap: vehicle.time_gap,
        };
        let accel_left = acc_accel(constants, &driver, &beliefs.steady_leader(LEFT_LEADER));
        let accel_right = acc_accel(constants, &driver, &beliefs.steady_leader(RIGHT_LEADER));
        let accel_left = self.limit_accel(accel_left);
        let accel_right = self.limit_accel(accel_right);
        // A driver that never passes on the right accelerates no more than the next lane on its left allows. The left
        // lane limits the acceleration in the present lane, and the present lane limits the acceleration in the right
        // lane.
        let never_passes_right = speed.simd_gt(constants.no_passing_right_speed);
        let reference_accel = select(never_passes_right, min(accel, accel_left), accel);
        let accel_right = select(never_passes_right, min(accel_right, accel), accel_right);
        let length = 2.0 * vehicle.half_length;
        // The new follower is behind the left leader now, and behind the driver after the change.
        let (follower_gap, follower_closing) = (gap[LEFT_FOLLOWER], closing_speed[LEFT_FOLLOWER]);
        let new_follower_accel_after =
            self.imposed_accel_on_follower(speed, follower_gap, follower_closing);
        let new_follower_accel_now = self.imposed_accel_on_follower(
            speed - closing_speed[LEFT_LEADER],
            follower_gap + gap[LEFT_LEADER] + length,
            follower_closing + closing_speed[LEFT_LEADER],
        );
        // The old follower is behind the driver now, and behind the driver's leader after the change.
        let old_follower_gap_after = gap[FOLLOWER] + gap[LEADER] + length;
        let old_follower_accel_now =
            self.imposed_accel_on_follower(speed, gap[FOLLOWER], closing_speed[FOLLOWER]);
        let old_follower_accel_after = self.imposed_accel_on_follower(
            speed - closing_speed[LEADER],
            old_follower_gap_after,
            closing_speed[FOLLOWER] + closing_speed[LEADER],
        );
        let new_follower_change = new_follower_accel_after - new_follower_accel_now;
        let old_follower_change = old_follower_accel_after - old_follower_accel_now;
        let to_left = accel_left - reference_accel + vehicle.politeness * new_follower_change;
        let to_right = accel_right - accel + vehicle.politeness * old_follower_change;
        MobilIncentives {
            to_left: to_left - vehicle.keep_right_bias,
            to_right: to_right + vehicle.keep_right_bias,
        }
    }

    /// Whether a lane change endangers neither the driver nor the new follower.
    ///
    /// The new follower is judged as it is now, and as `anticipated_follower` expects it. `leader_role` is the role of
    /// the leader in the new lane. The follower there has the next number.
    #[inline(always)]
    fn is_safe_lane_change(self, beliefs: &Beliefs<S>, leader_role: usize) -> Mask<S> {
        let (constants, vehicle) = (&self.params.constants, self.vehicle());
        let speed = self.state.motion.vx[self.slot];
        let leader = beliefs.steady_leader(leader_role);
        let rear_gap = beliefs.gap[leader_role + 1];
        let rear_closing_speed = beliefs.closing_speed[leader_role + 1];
        let (later_gap, later_closing_speed) =
            anticipated_follower(self.params, rear_gap, rear_closing_speed);
        let rear_accel = min(
            self.imposed_accel_on_follower(speed, rear_gap, rear_closing_speed),
            self.imposed_accel_on_follower(speed, later_gap, later_closing_speed),
        );
        let accel = imposed_accel(constants, vehicle, speed, vehicle.time_gap, &leader);
        // `min_rear_gap` is the least gap to the follower, and in this model also to the leader.
        let has_space =
            rear_gap.simd_gt(constants.min_rear_gap) & leader.gap.simd_gt(constants.min_rear_gap);
        has_space & rear_accel.simd_ge(-vehicle.safe_decel) & accel.simd_ge(-vehicle.safe_decel)
    }
}

/// Gap [m] and closing speed [m/s] of a follower after it has accelerated for `foresight`.
///
/// In this time, 2 s, the follower cannot react yet to a driver that starts to change lanes.
#[inline(always)]
pub fn anticipated_follower<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    closing_speed: F32<S>,
) -> (F32<S>, F32<S>) {
    let constants = &params.constants;
    let speed_gain = constants.foresight_accel * constants.foresight;
    (
        gap - constants.foresight * (closing_speed + 0.5 * speed_gain),
        closing_speed + speed_gain,
    )
}

/// Let a driver, not the ego, change lanes where it pays and is safe, or cancel in danger.
///
/// `accel` is the acceleration behind the present leader [m/s^2]. `bodies` are all vehicles as other drivers saw them
/// before any indicator changed: all drivers decide by the same state.
#[inline(always)]
pub fn change_lanes_by_mobil<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    bodies: &[VisibleBody<S>; N],
    context: &DriverContext<S>,
    accel: F32<S>,
) {
    let slot = context.slot;
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let (beliefs, checks_mirrors) = (&context.beliefs, context.checks_mirrors);
    let driver = state.vehicle(params, slot);
    let incentives = driver.mobil_incentives(beliefs, accel);
    let can_change = checks_mirrors & driver.is_ready_for_lane_change();
    let has_left_lane = state.lane_choice.lane[slot].simd_lt((params.road.num_lanes - 1) as f32);
    let has_right_lane = state.lane_choice.lane[slot].simd_ge(1.0);
    let to_left = can_change
        & has_left_lane
        & incentives.to_left.simd_gt(vehicle.lane_change_threshold)
        & driver.is_safe_lane_change(beliefs, LEFT_LEADER);
    // The right lane must be free far ahead, or the driver would soon have to pull out again. Speeds do not count,
    // because a driver cannot judge the speed of a distant vehicle.
    let is_free_ahead =
        beliefs.gap[RIGHT_LEADER].simd_gt(constants.free_ahead_time * state.motion.vx[slot]);
    let to_right = can_change
        & has_right_lane
        & incentives.to_right.simd_gt(vehicle.lane_change_threshold)
        & driver.is_safe_lane_change(beliefs, RIGHT_LEADER)
        & is_free_ahead
        & !to_left;
    let side = signed_side(params, to_left, to_right);
    let sets_indicator = checks_mirrors & driver.has_finished_lane_change();
    assign_where(
        &mut state.controls.indicator[slot],
        sets_indicator,
        side * vehicle.uses_indicator,
    );
    let mut starts = update_wanted_side(state, params, slot, side, checks_mirrors);
    if ((to_left | to_right) & starts).any_true() {
        starts &= !state.vehicle(params, slot).gives_way(bodies, side);
    }
    let driver = state.vehicle(params, slot);
    let direction = driver.lane_change_direction();
    let cancels = checks_mirrors & driver.cancels_lane_change(beliefs, &direction);
    // A cancelled lane change goes back, to the other side.
    let moves = LaneMoves {
        to_left: (to_left & starts) | (cancels & !direction.is_to_left),
        to_right: (to_right & starts) | (cancels & direction.is_to_left),
        is_cancelled: cancels,
        urgent_duration: None,
    };
    start_lane_changes(state, params, slot, context, &moves);
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether a driver beyond the wanted lane that indicates into this lane as well goes first.
    ///
    /// The driver farther ahead goes first, and of two that are abreast the one that moves to the left (a choice of
    /// this model). `side` is the side to which this driver wants to move: 1 left, -1 right, 0 for neither.
    #[inline(always)]
    pub fn gives_way(self, bodies: &[VisibleBody<S>; N], side: F32<S>) -> Mask<S> {
        let (motion, slot) = (&self.state.motion, self.slot);
        let max_distance = self.params.constants.claim_time * motion.vx[slot];
        let mut gives_way = side.simd_ne(side); // False in each simulation.
        for other_slot in 0..self.params.num_slots_in_use {
            let body = &bodies[other_slot];
            let distance_ahead = nearest_image(self.params, motion.s[other_slot] - motion.s[slot]);
            // Another driver wants the same lane if it is two lanes away and moves towards this driver.
            let wants_same_lane = body.claimed_side.simd_eq(-side)
                & body.lane.simd_eq(bodies[slot].lane + 2.0 * side)
                & side.simd_ne(0.0);
            let is_close = distance_ahead.abs().simd_lt(max_distance);
            let goes_first =
                distance_ahead.simd_gt(0.0) | (distance_ahead.simd_eq(0.0) & side.simd_lt(0.0));
            gives_way |= wants_same_lane & is_close & goes_first;
        }
        gives_way
    }

    /// Direction of the last lane change, and whether it crosses a whole lane.
    #[inline(always)]
    pub fn lane_change_direction(self) -> LaneChangeDirection<S> {
        let (state, slot) = (self.state, self.slot);
        let (right_edge, left_edge) = lane_borders(self.params, state.lane_choice.lane[slot], 0.0);
        // `coefficients[slot][0]` is the lateral position at which the path began.
        let distance = 0.5 * (right_edge + left_edge) - state.path.coefficients[slot][0];
        LaneChangeDirection {
            is_to_left: distance.simd_gt(0.0),
            is_whole_lane: distance.abs().simd_gt(0.5 * (left_edge - right_edge)),
        }
    }

    /// Whether the driver may change lanes by MOBIL: the pause after its last lane change is over.
    #[inline(always)]
    fn is_ready_for_lane_change(self) -> Mask<S> {
        let (state, slot) = (self.state, self.slot);
        let time_since_lane_change = state.lane_choice.time_since_lane_change[slot];
        self.has_finished_lane_change()
            & time_since_lane_change.simd_ge(self.params.constants.cooldown)
            & state.motion.is_wreck[slot].simd_eq(0.0)
            & self.vehicle().valid.simd_gt(0.0)
    }

    /// Whether the driver cancels a lane change that has become dangerous.
    ///
    /// No driver cancels the way back of a cancelled lane change. Without this rule vehicles swung back and forth until
    /// they left the road.
    #[inline(always)]
    fn cancels_lane_change(
        self,
        beliefs: &Beliefs<S>,
        direction: &LaneChangeDirection<S>,
    ) -> Mask<S> {
        let (state, slot) = (self.state, self.slot);
        let (constants, vehicle) = (&self.params.constants, self.vehicle());
        let (gap, closing_speed) = (&beliefs.gap, &beliefs.closing_speed);
        // After `abort_until`, half of its duration, a lane change is completed sooner than undone.
        let is_early = state.path.elapsed[slot]
            .simd_lt(constants.abort_until * state.path.duration[slot])
            & state.motion.is_wreck[slot].simd_eq(0.0)
            & vehicle.valid.simd_gt(0.0);
        if !is_early.any_true() {
            return is_early;
        }
        // After a change to the left, the old lane is the one on the right.
        let in_old_lane = |values: &[F32<S>; NUM_ROLES], right_role: usize, left_role: usize| {
            select(direction.is_to_left, values[right_role], values[left_role])
        };
        let risk = LaneChangeRisk {
            vehicle,
            speed: state.motion.vx[slot],
            time_gap: vehicle.time_gap,
            acceptable_imposed_decel: vehicle.safe_decel,
            leader: beliefs.steady_leader(LEADER),
            follower_gap: gap[FOLLOWER],
            follower_closing_speed: closing_speed[FOLLOWER],
            old_leader: Leader::steady(
                in_old_lane(gap, RIGHT_LEADER, LEFT_LEADER),
                in_old_lane(closing_speed, RIGHT_LEADER, LEFT_LEADER),
            ),
            old_follower_gap: in_old_lane(gap, RIGHT_FOLLOWER, LEFT_FOLLOWER),
        };
        lane_change_is_dangerous(constants, &risk) & is_early & direction.is_whole_lane
    }
}

/// Store the wanted side; return whether the driver has wanted it for its indicator lead time.
///
/// `side` is the side of the wanted lane change: 1 left, -1 right, 0 for neither. A driver that does not check its
/// mirrors now keeps its side. `run::step` adds the time between decisions to `time_wanted`.
#[inline(always)]
fn update_wanted_side<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    side: F32<S>,
    checks_mirrors: Mask<S>,
) -> Mask<S> {
    let choice = &mut state.lane_choice;
    let is_unchanged = side.simd_eq(choice.wanted_side[slot]) & side.simd_ne(0.0);
    assign_where(
        &mut choice.time_wanted[slot],
        checks_mirrors & !is_unchanged,
        splat(params.simd, 0.0),
    );
    assign_where(&mut choice.wanted_side[slot], checks_mirrors, side);
    let lead_time = params.vehicles[slot].indicator_lead_time;
    checks_mirrors & is_unchanged & choice.time_wanted[slot].simd_ge(lead_time)
}

/// 1 to the left, -1 to the right, 0 for neither.
#[inline(always)]
fn signed_side<S: Simd, const N: usize>(
    params: &Params<S, N>,
    to_left: Mask<S>,
    to_right: Mask<S>,
) -> F32<S> {
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    select(to_left, one, zero) - select(to_right, one, zero)
}

/// Start lane changes of the vehicle in `slot`, with the indicator if the driver uses it.
///
/// A lane change takes the driver's usual time, or less if the vehicle would reach its old leader before it has left
/// the old lane.
#[inline(always)]
pub fn start_lane_changes<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    context: &DriverContext<S>,
    moves: &LaneMoves<S>,
) {
    let is_moving = moves.to_left | moves.to_right;
    if !is_moving.any_true() {
        return;
    }
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let lane_step = signed_side(params, moves.to_left, moves.to_right);
    state.lane_choice.lane[slot] += lane_step;
    let (right_edge, left_edge) = lane_borders(params, state.lane_choice.lane[slot], 0.0);
    // The beliefs are from before the lane change: `LEADER` is the leader in the old lane.
    let old_leader = context.beliefs.steady_leader(LEADER);
    let time_to_old_leader = old_leader.gap / at_least(old_leader.closing_speed, MIN_CLOSING_SPEED);
    // The vehicle leaves the old lane at `lane_cleared_share` of the duration. This must be `lane_clearance_time`
    // before it would reach the old leader.
    let shortened_duration = at_least(
        (time_to_old_leader - constants.lane_clearance_time) / constants.lane_cleared_share,
        constants.min_lane_change_duration,
    );
    let mut duration = select(
        moves.is_cancelled,
        constants.abort_duration_share * vehicle.lane_change_duration,
        min(vehicle.lane_change_duration, shortened_duration),
    );
    if let Some(urgent_duration) = moves.urgent_duration {
        duration = select(urgent_duration.simd_gt(0.0), urgent_duration, duration);
    }
    let lane_centre = 0.5 * (right_edge + left_edge);
    start_path(state, slot, is_moving, lane_centre, duration);
    let indicator = lane_step * vehicle.uses_indicator;
    state.controls.indicator[slot] = select(is_moving, indicator, state.controls.indicator[slot]);
    state.lane_choice.wanted_side[slot] = select(
        is_moving,
        splat(params.simd, 0.0),
        state.lane_choice.wanted_side[slot],
    );
    // Draws whether the driver will look over its shoulder before its next lane change.
    draw_shoulder_check(state, params, slot, is_moving, context.decision_index);
}
