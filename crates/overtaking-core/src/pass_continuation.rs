//! How a driver goes on in the other lane: past, back behind the other, or in haste; see
//! `overtaking.sim.reference.pass_continuation`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::car_following::{acc_accel, cah_accel};
use crate::decision_context::DriverContext;
use crate::math::vectors::{F32, Mask, at_least, at_slot, each_at_slot, min, select, splat};
use crate::passing::{MIN_CLOSING_SPEED, assumed_oncoming_gap, tall_vehicle_gap_factor};
use crate::state::{RIGHT_FOLLOWER, RIGHT_LEADER, stage};
use crate::vehicle_handle::VehicleHandle;

const FAR: f32 = 1e9;

/// How a driver in the other lane stands.
pub struct PassContinuation<S: Simd> {
    /// It falls back behind the vehicle that it was to pass.
    pub must_abort: Mask<S>,
    /// It wants to be back soon.
    pub must_return_urgently: Mask<S>,
    /// It would take a small gap for that.
    pub accepts_small_gap: Mask<S>,
    /// There will be room behind that vehicle, and the next one in its lane, once it is no faster.
    pub fits_into_lane: Mask<S>,
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether driver `i` goes on with its pass, and how.
    #[inline(always)]
    pub fn decide_pass_continuation(self, context: &DriverContext<S>) -> PassContinuation<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, own, near, coming) = (
            &params.constants,
            self.vehicle(),
            &context.neighbours,
            &context.oncoming.nearest,
        );
        let out = self.is_before_return();
        let other = at_slot!(
            params.num_slots_in_use,
            state.overtake.target_slot[slot],
            |j| self.other(j).road_velocity().0
        );
        let speed = self.road_velocity().0;
        let (lead, bodies) = self.target_lead();
        let faster = speed - other;
        let aside = 0.5 * params.simulations.urgent_change_duration;
        let onwards = at_least(lead + bodies, 0.0);
        let rest = self.time_to_pass(onwards, (speed, faster), other) + aside;
        let brake = constants.abort_decel_share * own.max_assumed_decel;
        let backwards = at_least(bodies - lead, 0.0);
        let back = (faster + (faster * faster + 2.0 * brake * backwards).sqrt()) / brake + aside;
        let there = select(
            coming.is_detected,
            coming.believed_gap / at_least(coming.closing_speed, MIN_CLOSING_SPEED),
            splat(params.simd, FAR),
        );
        let gives_up =
            lead.simd_gt(0.0) & (rest + constants.abort_margin).simd_gt(there) & back.simd_lt(rest);
        let no_time = self.must_return_before_next(context);
        let room = near.gap[RIGHT_LEADER] + near.gap[RIGHT_FOLLOWER];
        let left =
            own.return_time_gap * tall_vehicle_gap_factor(params, state.overtake.target_slot[slot]);
        let cramped = no_time & room.simd_lt(own.min_gap + (own.time_gap + left) * other);
        let too_slow = (onwards / at_least(faster, MIN_CLOSING_SPEED)).simd_gt(back);
        let trapped = no_time & (room.simd_lt(constants.min_return_space) | too_slow);
        let yields = (gives_up | trapped | state.overtake.must_abort[slot].simd_gt(0.0)) & out;
        let beyond = (out | self.is_in_stage(stage::RETURN)) & !yields;
        let pressed = beyond & ((there - rest).simd_lt(constants.urgent_return_margin) | cramped);
        let late =
            self.line_is_solid(at_least(speed, 0.0) * rest) & own.heeds_solid_lines.simd_gt(0.0);
        // What is still gained on another while the brakes come on, and with them.
        let gained = |faster: F32<S>| {
            let faster = at_least(faster, 0.0);
            faster * (constants.brake_ramp + faster / (2.0 * brake))
        };
        let (front, closing) = (
            context.beliefs.gap[RIGHT_LEADER],
            context.beliefs.closing_speed[RIGHT_LEADER],
        );
        let fits = (lead - gained(faster)).simd_gt(bodies)
            & (front - gained(closing)).simd_gt(constants.min_return_gap);
        PassContinuation {
            must_abort: yields,
            must_return_urgently: pressed | (beyond & late),
            accepts_small_gap: pressed,
            fits_into_lane: fits,
        }
    }

    /// Whether driver `i` is past the one that it overtakes, has no time to pass the next one as well, and can still
    /// brake behind that.
    #[inline(always)]
    fn must_return_before_next(self, context: &DriverContext<S>) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let passes = self.is_in_stage(stage::PASS);
        if !passes.any_true() {
            return passes;
        }
        let (constants, own, coming) =
            (&params.constants, self.vehicle(), &context.oncoming.nearest);
        let target_slot = state.overtake.target_slot[slot];
        let target_s = at_slot!(params.num_slots_in_use, target_slot, |j| state.motion.s[j]);
        let past = passes & state.motion.s[slot].simd_gt(target_s);
        let (gap, closing) = (
            context.beliefs.gap[RIGHT_LEADER],
            context.beliefs.closing_speed[RIGHT_LEADER],
        );
        let next_one = state.motion.vx[slot] - closing;
        let bodies = 2.0 * (context.neighbours.half_length[RIGHT_LEADER] + own.half_length);
        let way = gap + bodies + constants.min_return_gap;
        let longer = self.time_to_pass(way, (state.motion.vx[slot], closing), next_one);
        let longer = longer
            + 0.5 * params.simulations.urgent_change_duration
            + constants.urgent_return_margin;
        let late = assumed_oncoming_gap(own, coming).simd_lt(longer * coming.closing_speed);
        let needed = cah_accel(
            constants,
            state.motion.vx[slot],
            gap,
            closing,
            splat(params.simd, 0.0),
        );
        past & late & needed.simd_ge(-(constants.abort_decel_share * own.max_assumed_decel))
    }

    /// Whether driver `i` is past the one that it overtakes and comes beside the next one: it overtakes that now.
    #[inline(always)]
    pub fn overtakes_next_vehicle(self, context: &DriverContext<S>) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let passes = self.is_in_stage(stage::PASS);
        if !passes.any_true() {
            return passes;
        }
        let near = &context.neighbours;
        let target_slot = state.overtake.target_slot[slot];
        let target_s = at_slot!(params.num_slots_in_use, target_slot, |j| state.motion.s[j]);
        let past = passes & state.motion.s[slot].simd_gt(target_s);
        let beside = near.gap[RIGHT_LEADER].simd_lt(params.constants.min_return_gap);
        let follows =
            self.must_return_before_next(context) | state.overtake.must_abort[slot].simd_gt(0.0);
        past & beside & near.slot[RIGHT_LEADER].simd_ge(0.0) & !follows
    }

    /// Whether the ego of a two-way road can give up its pass: it is behind who is overtaken.
    #[inline(always)]
    pub fn can_abort_pass(self) -> Mask<S> {
        let (lead, bodies) = self.target_lead();
        self.is_before_return() & lead.simd_gt(bodies)
    }

    /// How far ahead the target is, and has to be for driver `i` to fall in behind it [m].
    #[inline(always)]
    fn target_lead(self) -> (F32<S>, F32<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let [place, half_length] = each_at_slot!(
            params.num_slots_in_use,
            state.overtake.target_slot[slot],
            |j| [state.motion.s[j], params.vehicles[j].half_length]
        );
        let bodies = self.vehicle().half_length + half_length + params.constants.min_return_gap;
        (place - state.motion.s[slot], bodies)
    }

    /// The acceleration that driver `i` in the other lane does not go beyond: falling back, or fitting in
    /// where no time is left to pass the next one, too.
    #[inline(always)]
    pub fn accel_limit_while_passing(self, context: &DriverContext<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let free = splat(params.simd, FAR);
        let yields = state.overtake.must_abort[slot].simd_gt(0.0);
        if !(yields | self.is_in_stage(stage::PASS)).any_true() {
            return free;
        }
        let (constants, own, near, believed) = (
            &params.constants,
            self.vehicle(),
            &context.neighbours,
            &context.beliefs,
        );
        let (gap, closing) = (
            believed.gap[RIGHT_LEADER],
            believed.closing_speed[RIGHT_LEADER],
        );
        let other = at_slot!(
            params.num_slots_in_use,
            state.overtake.target_slot[slot],
            |j| self.other(j).road_velocity().0
        );
        let slow = self
            .road_velocity()
            .0
            .simd_lt(other - constants.abort_speed_difference);
        let brake = select(
            slow,
            splat(params.simd, 0.0),
            -(constants.abort_decel_share * own.max_assumed_decel),
        );
        let middle = 0.5 * (near.gap[RIGHT_LEADER] + near.gap[RIGHT_FOLLOWER]);
        let nearest = at_least(middle - own.min_gap, 0.0)
            / at_least(state.motion.vx[slot], constants.slip_speed);
        let fitting = acc_accel(
            constants,
            own,
            state.motion.vx[slot],
            self.current_passing_speed(),
            gap,
            closing,
            min(constants.return_time_gap_share * own.time_gap, nearest),
            believed.accel[RIGHT_LEADER],
        );
        let capped = select(self.must_return_before_next(context), fitting, free);
        select(yields, brake, capped)
    }
}
