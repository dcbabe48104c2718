//! Decisions during a pass on a two-way road: to complete it, to abort it, or to return urgently. The twin of
//! `overtaking.sim.reference.pass_continuation`.
//!
//! The target is the vehicle that a driver overtakes. A passing driver is in the opposing lane, and its own lane is on
//! its right. The right leader is the nearest vehicle there whose centre is ahead of the driver's: at first the target,
//! later the next vehicle. The right follower is the nearest one behind: later the target.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together. `VehicleHandle` is a view of one driver in them. `N` is the number of slots, the vehicles that a
//! simulation can have. `at_slot!` and `each_at_slot!` read values of the vehicle whose slot they get.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{Follower, acc_accel, cah_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{F32, Mask, at_least, at_slot, each_at_slot, min, select, splat};
use crate::oncoming::OncomingVehicle;
use crate::passing::{
    MIN_CLOSING_SPEED, PassingSpeeds, assumed_oncoming_gap, tall_vehicle_gap_factor,
};
use crate::state::{FAR, NO_ACCEL_LIMIT, RIGHT_FOLLOWER, RIGHT_LEADER, stage};
use crate::vehicle_handle::VehicleHandle;

/// Decisions of a passing driver on a two-way road.
pub struct PassContinuation<S: Simd> {
    /// Whether the driver falls back behind its target.
    pub must_abort: Mask<S>,
    /// Whether the driver accelerates and returns as fast as it can.
    pub must_return_urgently: Mask<S>,
    /// Whether the driver returns into a smaller gap than usual.
    pub accepts_small_gap: Mask<S>,
    /// Whether a driver that falls back will have gaps to its target and to the leader in its own lane once it has
    /// braked.
    pub fits_into_lane: Mask<S>,
}

/// Position of the target's centre minus the position of the driver's centre [m].
struct TargetLead<S: Simd> {
    /// The present lead.
    now: F32<S>,
    /// The lead at which the driver has the smallest gap that it needs behind the target.
    needed: F32<S>,
}

/// A passing driver and its target, along the road.
struct RelativeMotion<S: Simd> {
    /// Speed of the driver [m/s].
    speed: F32<S>,
    /// Speed of the target [m/s].
    target_speed: F32<S>,
    /// Speed of the driver minus the target's [m/s].
    closing_speed: F32<S>,
    /// How far the target is ahead, now and as needed for an abort.
    target_lead: TargetLead<S>,
}

impl<S: Simd> RelativeMotion<S> {
    /// Distance that the driver still has to gain on its target so that it can return ahead of it [m].
    ///
    /// The smallest gap ahead of the target is the same as behind it.
    #[inline(always)]
    fn distance_to_clear(&self) -> F32<S> {
        at_least(self.target_lead.now + self.target_lead.needed, 0.0)
    }
}

/// Durations that a passing driver compares [s].
struct PassTimes<S: Simd> {
    /// Time until it is past the target and back in its lane.
    complete: F32<S>,
    /// Time until it is back behind the target.
    abort: F32<S>,
    /// Time until it meets the oncoming vehicle, `FAR` without a detected one.
    meet: F32<S>,
}

/// Space beside a passing driver, between the two vehicles of its own lane.
struct ReturnSpace<S: Simd> {
    /// Gap to the leader plus gap to the follower, without the driver's own length [m].
    size: F32<S>,
    /// Whether the space is smaller than the driver's usual demand.
    is_cramped: Mask<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Decide whether the driver completes a pass, aborts it, or returns urgently.
    ///
    /// It compares three durations: to complete the pass, to be back behind the target, and to meet the oncoming
    /// vehicle.
    ///
    /// - While its centre is behind the target's centre, it aborts if it would meet the oncoming vehicle too soon after
    ///   the pass and aborting is quicker.
    /// - If its centre is past the target's centre and it has no time for the next vehicle, it returns between the two.
    ///   If the space between them is too small, or falling back is quicker than gaining the distance that it still
    ///   needs to return ahead of the target, it aborts.
    /// - It returns urgently, and accepts a small gap, if little time would be left after the pass, or if the space
    ///   between the two is less than its usual demand. A driver that heeds solid lines also returns urgently if it
    ///   would otherwise cross one, but keeps its usual gap.
    #[inline(always)]
    pub fn decide_pass_continuation(self, context: &DriverContext<S>) -> PassContinuation<S> {
        let motion = self.relative_motion();
        let times = PassTimes {
            complete: self.time_to_complete(&motion),
            abort: self.time_to_abort(&motion),
            meet: time_to_meet(&context.oncoming.nearest),
        };
        let is_passing = self.is_before_return(); // It pulls out or passes.
        let must_return_now = self.must_return_before_next(context);
        let space = self.return_space(context, &motion);
        // An abort is final during the pass.
        let is_aborting = self.state.overtake.must_abort[self.slot].simd_gt(0.0);
        let must_abort = (self.aborts_early(&motion, &times)
            | (must_return_now & self.is_trapped(&motion, &times, &space))
            | is_aborting)
            & is_passing;
        let continues = (is_passing | self.is_in_stage(stage::RETURN)) & !must_abort;
        let has_little_time =
            (times.meet - times.complete).simd_lt(self.params.constants.urgent_return_margin);
        let accepts_small_gap =
            continues & (has_little_time | (must_return_now & space.is_cramped));
        // Crossing a solid line is no danger in itself: the driver hurries, but accepts no small gap.
        let hurries_before_line = continues & self.would_cross_solid_line(&motion, &times);
        PassContinuation {
            must_abort,
            must_return_urgently: accepts_small_gap | hurries_before_line,
            accepts_small_gap,
            fits_into_lane: self.fits_after_braking(context, &motion),
        }
    }

    /// Speeds of the driver and its target, and the lead of the target.
    #[inline(always)]
    fn relative_motion(self) -> RelativeMotion<S> {
        let (speed, _) = self.road_velocity(); // Along and across the road.
        let target_speed = self.target_speed();
        RelativeMotion {
            speed,
            target_speed,
            closing_speed: speed - target_speed,
            target_lead: self.target_lead(),
        }
    }

    /// Lead of the target, now and as needed for an abort.
    #[inline(always)]
    fn target_lead(self) -> TargetLead<S> {
        let (s, params, slot) = (&self.state.motion.s, self.params, self.slot);
        let target_slot = self.state.overtake.target_slot[slot];
        let [target_s, half_length] = each_at_slot!(params, target_slot, |j| [
            s[j],
            params.vehicles[j].half_length
        ]);
        let half_lengths = self.vehicle().half_length + half_length;
        TargetLead {
            now: target_s - s[slot],
            needed: half_lengths + params.constants.min_return_gap,
        }
    }

    /// Half of an urgent lane change, after which a returning driver has crossed the line [s].
    #[inline(always)]
    fn time_to_move_over(self) -> F32<S> {
        0.5 * self.params.simulations.urgent_change_duration
    }

    /// Braking of an aborting driver, positive [m/s^2].
    ///
    /// It is less than `max_assumed_decel`, the hardest braking that the driver believes possible: a choice.
    #[inline(always)]
    fn abort_decel(self) -> F32<S> {
        self.params.constants.abort_decel_share * self.vehicle().max_assumed_decel
    }

    /// Time until the driver is past its target and back in its lane [s].
    #[inline(always)]
    fn time_to_complete(self, motion: &RelativeMotion<S>) -> F32<S> {
        let speeds = PassingSpeeds {
            passer: motion.speed,
            target: motion.target_speed,
            closing: motion.closing_speed,
        };
        self.time_to_pass(motion.distance_to_clear(), &speeds) + self.time_to_move_over()
    }

    /// Time until the braking driver is back behind its target [s].
    #[inline(always)]
    fn time_to_abort(self, motion: &RelativeMotion<S>) -> F32<S> {
        let (decel, closing_speed) = (self.abort_decel(), motion.closing_speed);
        let distance = at_least(motion.target_lead.needed - motion.target_lead.now, 0.0);
        // The braking takes the time t that solves distance = decel * t^2 / 2 - closing_speed * t.
        let root = (closing_speed * closing_speed + 2.0 * decel * distance).sqrt();
        (closing_speed + root) / decel + self.time_to_move_over()
    }

    /// The space between the two vehicles beside the driver, compared with its usual demand.
    #[inline(always)]
    fn return_space(
        self,
        context: &DriverContext<S>,
        motion: &RelativeMotion<S>,
    ) -> ReturnSpace<S> {
        // The true gaps: that drivers judge the space beside them without error is a choice.
        let (gap, vehicle) = (&context.neighbours.gap, self.vehicle());
        let size = gap[RIGHT_LEADER] + gap[RIGHT_FOLLOWER];
        // Drivers leave a longer gap ahead of a target that blocks the view, because such a vehicle brakes worse.
        let target_slot = self.state.overtake.target_slot[self.slot];
        let factor = tall_vehicle_gap_factor(self.params, target_slot);
        let return_time_gap = vehicle.return_time_gap * factor;
        // The usual gap behind the next vehicle, plus the usual gap ahead of the target, at its speed.
        let usual_size =
            vehicle.min_gap + (vehicle.time_gap + return_time_gap) * motion.target_speed;
        ReturnSpace {
            size,
            is_cramped: size.simd_lt(usual_size),
        }
    }

    /// Whether the target is still ahead, the pass would end too late, and aborting is quicker.
    #[inline(always)]
    fn aborts_early(self, motion: &RelativeMotion<S>, times: &PassTimes<S>) -> Mask<S> {
        let abort_margin = self.params.constants.abort_margin;
        motion.target_lead.now.simd_gt(0.0)
            & (times.complete + abort_margin).simd_gt(times.meet)
            & times.abort.simd_lt(times.complete)
    }

    /// Whether the space is too small, or aborting is quicker than clearing the target.
    #[inline(always)]
    fn is_trapped(
        self,
        motion: &RelativeMotion<S>,
        times: &PassTimes<S>,
        space: &ReturnSpace<S>,
    ) -> Mask<S> {
        let closing_speed = at_least(motion.closing_speed, MIN_CLOSING_SPEED);
        // The time at the present speed, because the driver follows the next vehicle, which may be too slow for it to
        // get clear of the target. The lane change, which `times.abort` contains, is left out: a choice, in favour of
        // the pass.
        let clears_target_late = (motion.distance_to_clear() / closing_speed).simd_gt(times.abort);
        space.size.simd_lt(self.params.constants.min_return_space) | clears_target_late
    }

    /// Whether a driver that heeds solid lines would return across one.
    #[inline(always)]
    fn would_cross_solid_line(self, motion: &RelativeMotion<S>, times: &PassTimes<S>) -> Mask<S> {
        // `line_is_solid` tests the line here and at this distance ahead, where the driver returns.
        let distance = at_least(motion.speed, 0.0) * times.complete;
        self.line_is_solid(distance) & self.vehicle().heeds_solid_lines.simd_gt(0.0)
    }

    /// Whether an aborting driver has gaps to its target and in its lane once it has braked.
    ///
    /// The gaps are those at the end of the braking. With present gaps, drivers moved over too early and touched the
    /// vehicle ahead, because braking takes effect late.
    #[inline(always)]
    fn fits_after_braking(self, context: &DriverContext<S>, motion: &RelativeMotion<S>) -> Mask<S> {
        // The lead over the target is the true one, as the gaps in `return_space`: a choice.
        let TargetLead { now, needed } = motion.target_lead;
        let lead_after_braking = now - self.distance_gained_while_braking(motion.closing_speed);
        // The leader in the own lane may be another vehicle, if the target has pulled out itself. `steady_leader` is
        // the believed leader with an acceleration of 0: the driver assumes that it keeps its speed.
        let leader = context.beliefs.steady_leader(RIGHT_LEADER);
        let gap = leader.gap - self.distance_gained_while_braking(leader.closing_speed);
        lead_after_braking.simd_gt(needed) & gap.simd_gt(self.params.constants.min_return_gap)
    }

    /// Distance that the braking driver still gains on a vehicle until both are equally fast [m].
    ///
    /// The closing speed lasts for `brake_ramp`, in which the brakes build up, and then falls to 0.
    #[inline(always)]
    fn distance_gained_while_braking(self, closing_speed: F32<S>) -> F32<S> {
        let closing_speed = at_least(closing_speed, 0.0);
        let half_braking_time = closing_speed / (2.0 * self.abort_decel());
        closing_speed * (self.params.constants.brake_ramp + half_braking_time)
    }

    /// Whether the driver passes and its centre is past the target's centre.
    #[inline(always)]
    fn is_past_target(self) -> Mask<S> {
        let s = &self.state.motion.s;
        let target_slot = self.state.overtake.target_slot[self.slot];
        let target_s = at_slot!(self.params, target_slot, |j| s[j]);
        self.is_in_stage(stage::PASS) & s[self.slot].simd_gt(target_s)
    }

    /// Whether the driver is past its target and has no time to pass the next vehicle as well.
    ///
    /// A driver that can no longer brake behind the next vehicle goes on to pass it.
    #[inline(always)]
    fn must_return_before_next(self, context: &DriverContext<S>) -> Mask<S> {
        let passes = self.is_in_stage(stage::PASS);
        if !passes.any_true() {
            return passes;
        }
        let (constants, vehicle) = (&self.params.constants, self.vehicle());
        let oncoming = &context.oncoming.nearest;
        // Along the vehicle's own axis, as in all car following; nearly the speed along the road.
        let speed = self.state.motion.vx[self.slot];
        let next_vehicle = context.beliefs.steady_leader(RIGHT_LEADER);
        // To pass the next vehicle, the driver gains the gap, both lengths and the smallest return gap.
        let lengths = 2.0 * (context.neighbours.half_length[RIGHT_LEADER] + vehicle.half_length);
        let distance = next_vehicle.gap + lengths + constants.min_return_gap;
        let speeds = PassingSpeeds {
            passer: speed,
            target: speed - next_vehicle.closing_speed,
            closing: next_vehicle.closing_speed,
        };
        let time = self.time_to_pass(distance, &speeds)
            + self.time_to_move_over()
            + constants.urgent_return_margin;
        // The driver also assumes an oncoming vehicle where the road is hidden. Without a detected vehicle,
        // `oncoming.closing_speed` is the closing speed of a vehicle at the usual speed.
        let would_be_late =
            assumed_oncoming_gap(vehicle, oncoming).simd_lt(time * oncoming.closing_speed);
        // The acceleration that just avoids a contact, if the next vehicle keeps its speed.
        let needed_accel = cah_accel(constants, speed, &next_vehicle);
        let can_brake = needed_accel.simd_ge(-self.abort_decel());
        self.is_past_target() & would_be_late & can_brake
    }

    /// Whether the driver is past its target and reaches the next vehicle, its new target.
    ///
    /// "Past" compares the centres. A driver reaches the next vehicle when the gap falls below the smallest with which
    /// it could still return behind that vehicle.
    #[inline(always)]
    pub fn overtakes_next_vehicle(self, context: &DriverContext<S>) -> Mask<S> {
        let passes = self.is_in_stage(stage::PASS);
        if !passes.any_true() {
            return passes;
        }
        let neighbours = &context.neighbours;
        let reaches_next =
            neighbours.gap[RIGHT_LEADER].simd_lt(self.params.constants.min_return_gap);
        let has_next_vehicle = neighbours.slot[RIGHT_LEADER].simd_ge(0.0);
        let stays_behind = self.must_return_before_next(context)
            | self.state.overtake.must_abort[self.slot].simd_gt(0.0);
        self.is_past_target() & reaches_next & has_next_vehicle & !stays_behind
    }

    /// Whether a passing driver on a two-way road is far enough back to return behind the target.
    ///
    /// The caller checks that the road is two-way.
    #[inline(always)]
    pub fn can_abort_pass(self) -> Mask<S> {
        let lead = self.target_lead();
        self.is_before_return() & lead.now.simd_gt(lead.needed)
    }

    /// Largest acceleration of a driver in the opposing lane [m/s^2].
    ///
    /// An aborting driver brakes until it is slower than its target by a margin, then keeps its speed. A driver past
    /// its target without the time to pass the next vehicle as well must fit in between the two. It follows the next
    /// vehicle with a share of its time gap, or in the middle of the space if that is nearer. All other drivers have
    /// the limit `NO_ACCEL_LIMIT`.
    #[inline(always)]
    pub fn accel_limit_while_passing(self, context: &DriverContext<S>) -> F32<S> {
        let (params, slot) = (self.params, self.slot);
        let no_limit = splat(params.simd, NO_ACCEL_LIMIT);
        let must_abort = self.state.overtake.must_abort[slot].simd_gt(0.0);
        if !(must_abort | self.is_in_stage(stage::PASS)).any_true() {
            return no_limit;
        }
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let speed_after_abort = self.target_speed() - constants.abort_speed_difference;
        let (speed_along_road, _) = self.road_velocity();
        let abort_accel = select(
            speed_along_road.simd_lt(speed_after_abort),
            splat(params.simd, 0.0),
            -self.abort_decel(),
        );
        let gap = &context.neighbours.gap; // True gaps, as in `return_space`.
        let gap_in_middle = 0.5 * (gap[RIGHT_LEADER] + gap[RIGHT_FOLLOWER]);
        // Along the vehicle's own axis, as in all car following; nearly the speed along the road.
        let speed = self.state.motion.vx[slot];
        // `slip_speed` is the least divisor wherever a formula divides by speed.
        let time_gap_in_middle =
            at_least(gap_in_middle - vehicle.min_gap, 0.0) / at_least(speed, constants.slip_speed);
        let follower = Follower {
            vehicle,
            speed,
            desired_speed: self.current_passing_speed(),
            time_gap: min(
                constants.return_time_gap_share * vehicle.time_gap,
                time_gap_in_middle,
            ),
        };
        let next_vehicle = context.beliefs.leader(RIGHT_LEADER);
        let following_accel = acc_accel(constants, &follower, &next_vehicle);
        let must_return = self.must_return_before_next(context);
        let limit = select(must_return, following_accel, no_limit);
        select(must_abort, abort_accel, limit)
    }
}

/// Time until the driver believes that it meets the oncoming vehicle [s].
#[inline(always)]
fn time_to_meet<S: Simd>(oncoming: &OncomingVehicle<S>) -> F32<S> {
    let closing_speed = at_least(oncoming.closing_speed, MIN_CLOSING_SPEED);
    select(
        oncoming.is_detected,
        oncoming.believed_gap / closing_speed,
        splat(closing_speed.simd, FAR),
    )
}
