//! What each driver believes about the neighbours; see `overtaking.sim.reference.perception`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::decision_context::DriverContext;
use crate::math::elementary::exp;
use crate::math::philox::{GLANCES, uniform, words};
use crate::math::vectors::{
    F32, Mask, SIMD_LANES, assign_where, at_least, at_most, at_slot, clamp_to, each_at_slot, floor,
    max, min, select, splat,
};
use crate::neighbour_search::{Neighbours, VisibleBody, nearest_image};
use crate::params::Params;
use crate::road_conditions::{lane_film, value_of_lane};
use crate::state::{
    HISTORY_LENGTH, HISTORY_STRIDE, LEADER, LEFT_LEADER, NEVER_LOOKED, NUM_ROLES, State,
};
use crate::vehicle_handle::VehicleHandle;

/// Who touches is as visible, and looms as much, as at this gap [m].
const NEAREST_GAP: f32 = 1.0;
/// Beyond this every limit of sight has been passed [m].
const FARTHEST_GAP: f32 = 1e4;
/// Nothing is seen through e^-40; larger exponents only overflow.
const MAX_OPTICAL_DEPTH: f32 = 40.0;
/// What is left of the logarithm of the contrast of something as large as a vehicle near by.
const MIN_LOG_CONTRAST: f32 = 0.02;
/// Keeps the growth finite where all looming is seen [rad/s].
const MIN_LOOMING: f32 = 1e-9;
/// Keeps sight lines finite alongside [m].
pub const MIN_SIGHT_LINE: f32 = 0.1;

/// What one driver acts on, by role.
#[derive(Clone, Copy)]
pub struct Beliefs<S: Simd> {
    pub is_detected: [Mask<S>; NUM_ROLES],
    pub gap: [F32<S>; NUM_ROLES],
    pub closing_speed: [F32<S>; NUM_ROLES],
    /// Believed acceleration of those ahead, never positive [m/s^2].
    pub accel: [F32<S>; NUM_ROLES],
}

impl<S: Simd> Beliefs<S> {
    /// Before anyone has looked.
    #[inline(always)]
    pub fn none(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            is_detected: [zero.simd_lt(zero); NUM_ROLES],
            gap: [zero; NUM_ROLES],
            closing_speed: [zero; NUM_ROLES],
            accel: [zero; NUM_ROLES],
        }
    }
}

/// Write down where everybody is now.
#[inline(always)]
pub fn record_history<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    decision: usize,
) {
    let row = decision % HISTORY_LENGTH;
    for i in 0..params.num_slots_in_use {
        let (along, _) = state.vehicle(params, i).road_velocity();
        let (low, high) = state.motion.s[i].interleave(along);
        let (low, high) = (low.to_array(), high.to_array());
        let pairs = low.as_chunks::<2>().0.iter().chain(high.as_chunks().0);
        for (memory, pair) in state.attention.history[i].iter_mut().zip(pairs) {
            memory[row] = *pair;
        }
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Which simulations' driver `i` looks into the mirrors and at the other lanes now.
    #[inline(always)]
    pub fn checks_mirrors_now(self, decision: u32) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, vehicle) = (&params.constants, self.vehicle());
        let interval = constants.glance_interval as u32;
        let turn = decision + slot as u32 * constants.glance_stagger as u32;
        if decision >= interval && turn.is_multiple_of(interval) {
            return vehicle.valid.simd_eq(vehicle.valid);
        }
        let signalled = if params.road.can_overtake(slot) {
            state.overtake.time_indicating[slot].simd_gt(vehicle.indicator_lead_time)
        } else {
            state.lane_choice.time_wanted[slot].simd_ge(vehicle.indicator_lead_time)
        };
        let looks = state.lane_choice.wanted_side[slot].simd_ne(0.0) & signalled;
        if decision.is_multiple_of(constants.glance_moving as u32) {
            return looks
                | state.path.elapsed[slot]
                    .simd_lt(constants.abort_until * state.path.duration[slot]);
        }
        looks
    }
}

/// Draw whether driver `slot` looks over the shoulder before the next lane change.
#[inline(always)]
pub fn draw_shoulder_check<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    drawn: Mask<S>,
    decision: u32,
) {
    let stream = GLANCES + slot as u32;
    let [word, ..] = words(
        params.key,
        &params.scenario_index_low,
        &params.scenario_index_high,
        stream,
        decision,
    );
    let word = uniform(params.simd, word);
    let (zero, one) = (splat(params.simd, 0.0), splat(params.simd, 1.0));
    let checks = select(
        word.simd_lt(params.vehicles[slot].checks_blind_spot),
        one,
        zero,
    );
    state.lane_choice.checks_blind_spot[slot] =
        select(drawn, checks, state.lane_choice.checks_blind_spot[slot]);
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    pub fn extinction_ahead(self, near: &Neighbours<S>, leader_speed: F32<S>) -> (F32<S>, F32<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, simulation) = (&params.constants, &params.simulations);
        let air = simulation.fog_extinction
            + simulation.rain_extinction * (1.0 + state.motion.vx[slot] / constants.rain_speed);
        let path = value_of_lane(
            &params.road.film_path[..params.road.num_lanes],
            state.lane_choice.lane[slot],
        );
        let water = lane_film(params, path);
        let zero = splat(params.simd, 0.0);
        if water.simd_le(0.0).all_true() {
            return (air, zero);
        }
        let speed = leader_speed / constants.spray_speed;
        let wetness = at_most(water / constants.spray_film, 1.0);
        let lifted = at_slot!(params.num_slots_in_use, near.slot[LEADER], |j| params
            .vehicles[j]
            .spray);
        let spray = constants.spray_coefficient * wetness * (speed * speed) * lifted;
        let close =
            near.slot[LEADER].simd_ge(0.0) & near.gap[LEADER].simd_lt(constants.spray_reach);
        (air, select(close, spray, zero))
    }
}

/// What the leader hides.
struct TallLeader<S: Simd> {
    /// Whether it is there and so high that nobody looks over it.
    is_tall: Mask<S>,
    half_width: F32<S>,
}

impl<S: Simd> TallLeader<S> {
    #[inline(always)]
    fn new<const N: usize>(params: &Params<S, N>, near: &Neighbours<S>) -> Self {
        let slot = near.slot[LEADER];
        let [tall, half_width] = each_at_slot!(params.num_slots_in_use, slot, |j| [
            params.vehicles[j].blocks_view,
            params.vehicles[j].half_width
        ]);
        Self {
            is_tall: slot.simd_ge(0.0) & tall.simd_gt(0.0),
            half_width,
        }
    }
}

#[inline(always)]
fn is_occluded<S: Simd>(near: &Neighbours<S>, leader: &TallLeader<S>, role: usize) -> Mask<S> {
    let (lead, other) = (near.slot[LEADER], near.slot[role]);
    let reach = at_least(
        near.distance[LEADER] - near.half_length[LEADER],
        MIN_SIGHT_LINE,
    );
    let distance = near.distance[role];
    let crossing = near.lateral_distance[role] * (reach / at_least(distance, MIN_SIGHT_LINE));
    let offset = (crossing - near.lateral_distance[LEADER]).abs();
    let blocked = distance.simd_gt(reach) & offset.simd_lt(leader.half_width) & other.simd_ne(lead);
    leader.is_tall & blocked
}

/// How close to the limit of sight somebody at a gap is, by contrast or by lamps.
#[inline(always)]
pub fn sight_range_ratio<S: Simd, const N: usize>(
    params: &Params<S, N>,
    gap: F32<S>,
    is_front: bool,
    [contrast, lamp]: [F32<S>; 2],
    (air, spray): (F32<S>, F32<S>),
) -> F32<S> {
    let (constants, simulation) = (&params.constants, &params.simulations);
    let distance = clamp_to(gap, NEAREST_GAP, FARTHEST_GAP);
    let mut depth = air * distance;
    let mut sensitivity = simulation.log_contrast_sensitivity_behind;
    if is_front {
        depth += spray * at_most(distance, constants.spray_reach);
        sensitivity = simulation.log_contrast_sensitivity_ahead;
    }
    let by_contrast = depth / at_least(contrast + sensitivity, MIN_LOG_CONTRAST);
    let by_contrast = max(by_contrast, distance * simulation.inverse_lit_range);
    let by_lamp = (distance
        * distance
        * (simulation.lamp_threshold * lamp)
        * exp(at_most(depth, MAX_OPTICAL_DEPTH)))
    .sqrt();
    min(by_contrast, by_lamp)
}

#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn detect<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    near: &Neighbours<S>,
    slot: usize,
    role: usize,
    effort: F32<S>,
    leader: Option<&TallLeader<S>>,
    before: &([F32<S>; NUM_ROLES], [F32<S>; NUM_ROLES]),
    (steadily, now): (Mask<S>, Mask<S>),
) -> Mask<S> {
    let constants = &params.constants;
    let zero = splat(params.simd, 0.0);
    let (other_slot, gap) = (near.slot[role], near.gap[role]);
    let is_front = role.is_multiple_of(2);
    let reach = if is_front {
        params.vehicles[slot].attention_range
    } else {
        splat(params.simd, constants.mirror_range)
    };
    let mut visible = other_slot.simd_ge(0.0) & effort.simd_le(1.0) & gap.simd_lt(reach);
    if let Some(leader) = leader.filter(|leader| is_front && leader.is_tall.any_true()) {
        visible &= !is_occluded(near, leader, role);
    }
    let hides = gap.simd_lt(if is_front { 0.0 } else { constants.blind_spot })
        & state.lane_choice.checks_blind_spot[slot].simd_eq(0.0);
    if hides.any_true() {
        let width = at_slot!(params.num_slots_in_use, other_slot, |j| params.vehicles[j]
            .half_width);
        let aside = near.lateral_distance[role].abs() - (params.vehicles[slot].half_width + width);
        visible &= !(hides & aside.simd_gt(constants.alongside));
    }
    let more = select(
        steadily,
        splat(params.simd, constants.decision),
        splat(params.simd, constants.glance_time),
    );
    let mut longer = zero;
    for (known, time) in before.0.into_iter().zip(before.1) {
        longer = select(other_slot.simd_eq(known), max(longer, time), longer);
    }
    let first = before.0[role].simd_eq(NEVER_LOOKED);
    let longer = select(
        first,
        splat(params.simd, constants.initial_time_in_view),
        longer + more,
    );
    let longer = select(visible, longer, zero);
    assign_where(&mut state.attention.time_in_view[slot][role], now, longer);
    assign_where(
        &mut state.attention.slot_in_view[slot][role],
        now,
        other_slot,
    );
    let needed = params.simulations.detection_time
        * (1.0 + constants.detection_growth * (effort * effort * effort));
    now & visible & state.attention.time_in_view[slot][role].simd_ge(needed)
}

/// 0, 1, 2 ... 15.
#[inline(always)]
fn lane_numbers<S: Simd>(simd: S) -> F32<S> {
    let number: [f32; SIMD_LANES] = [
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
    ];
    F32::simd_from(simd, number)
}

/// Where and how fast the vehicles in `slot` were at decision `then`.
#[inline(always)]
pub fn recall_motion<S: Simd, const N: usize>(
    state: &State<S, N>,
    simd: S,
    then: F32<S>,
    slot: F32<S>,
) -> (F32<S>, F32<S>) {
    let row = then - HISTORY_LENGTH as f32 * floor(then * (1.0 / HISTORY_LENGTH as f32));
    let who = at_least(slot, 0.0);
    let place: i32x16<S> =
        (row + (who * SIMD_LANES as f32 + lane_numbers(simd)) * HISTORY_STRIDE as f32).to_int();
    let place = place.to_array();
    let moments = state.attention.history.as_flattened().as_flattened();
    let (mut low, mut high) = ([0.0; SIMD_LANES], [0.0; SIMD_LANES]);
    for (lane, pair) in low
        .as_chunks_mut::<2>()
        .0
        .iter_mut()
        .chain(high.as_chunks_mut::<2>().0)
        .enumerate()
    {
        // The limit does nothing but spare the check of the bounds.
        *pair = moments
            [(place[lane] as u32).min((N * SIMD_LANES * HISTORY_STRIDE - 1) as u32) as usize];
    }
    F32::simd_from(simd, low).deinterleave(F32::simd_from(simd, high))
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// How an approach looms to driver `i`: whether it does at all, how much of it is noticed, what is left of
    /// misjudgements as contact comes near, and the speed of approach that is sensed.
    #[inline(always)]
    pub fn sense_looming(
        self,
        gap: F32<S>,
        closing: F32<S>,
        width: F32<S>,
    ) -> (Mask<S>, F32<S>, F32<S>, F32<S>) {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let constants = &params.constants;
        let distance = at_least(gap, NEAREST_GAP);
        let expansion = width * closing.abs() / (distance * distance);
        let excess = expansion - constants.looming_threshold;
        let span = (constants.looming_growth * constants.looming_threshold).max(MIN_LOOMING);
        let clear = clamp_to(excess / span, 0.0, 1.0);
        let fading = at_least(closing * constants.error_fade_time, NEAREST_GAP);
        let share = at_most(distance / fading, 1.0);
        let sensed = closing
            * (1.0 + share * (params.simulations.speed_error * state.noise.speed_error[slot]));
        (excess.simd_gt(0.0), clear, share, sensed)
    }
}

/// Update what driver `slot` believes about its six neighbours.
#[inline(always)]
pub fn form_beliefs<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    bodies: &[VisibleBody<S>; N],
    context: &mut DriverContext<S>,
) {
    let (near, believed) = (&context.neighbours, &mut context.beliefs);
    let (looks, decision) = (context.checks_mirrors, context.decision_index);
    let (constants, simulation, vehicle) = (
        &params.constants,
        &params.simulations,
        &params.vehicles[slot],
    );
    let zero = splat(params.simd, 0.0);
    let leader_speed = at_slot!(params.num_slots_in_use, near.slot[LEADER], |j| state
        .motion
        .vx[j]);
    let depths = state
        .vehicle(params, slot)
        .extinction_ahead(near, leader_speed);
    let everybody = vehicle.valid.simd_eq(vehicle.valid);
    let changing = state.path.elapsed[slot].simd_lt(state.path.duration[slot]);
    // Beliefs about roles that no driver of the block looks at are not computed.
    let watched = |role: usize| {
        role == LEADER || looks.any_true() || (role.is_multiple_of(2) && changing.any_true())
    };
    let at = splat(params.simd, decision as f32);
    let urgent =
        near.gap[LEADER].simd_lt(constants.urgent_time * (state.motion.vx[slot] - leader_speed));
    let (own_speed, _) = state.vehicle(params, slot).road_velocity();
    let judged = exp(simulation.distance_error * state.noise.distance_error[slot]);
    *believed = Beliefs::none(params.simd);
    let leader = watched(LEFT_LEADER).then(|| TallLeader::new(params, near));
    let before = (
        state.attention.slot_in_view[slot],
        state.attention.time_in_view[slot],
    );
    // A short pass: the exponential and the root of one role take the time of those of several.
    let mut efforts = [zero; NUM_ROLES];
    for role in (0..NUM_ROLES).filter(|role| watched(*role)) {
        let (other_slot, is_front) = (near.slot[role], role.is_multiple_of(2));
        let shines = if is_front {
            each_at_slot!(params.num_slots_in_use, other_slot, |j| [
                params.vehicles[j].log_contrast,
                bodies[j].inverse_rear_lamp
            ])
        } else {
            each_at_slot!(params.num_slots_in_use, other_slot, |j| [
                params.vehicles[j].log_contrast,
                params.vehicles[j].inverse_head_lamp
            ])
        };
        efforts[role] = sight_range_ratio(params, near.gap[role], is_front, shines, depths);
    }
    for role in 0..NUM_ROLES {
        let other_slot = near.slot[role];
        let is_front = role.is_multiple_of(2);
        believed.gap[role] = splat(params.simd, constants.unseen_gap);
        if !watched(role) {
            continue;
        }
        let steadily = match role {
            LEADER => everybody,
            _ if is_front => changing,
            _ => !everybody,
        };
        let now = looks | steadily;
        if other_slot.simd_lt(0.0).all_true() {
            assign_where(
                &mut state.attention.slot_in_view[slot][role],
                now,
                other_slot,
            );
            assign_where(&mut state.attention.time_in_view[slot][role], now, zero);
            continue;
        }
        let noticed = params.simd.vectorize(
            #[inline(always)]
            || {
                detect(
                    state,
                    params,
                    near,
                    slot,
                    role,
                    efforts[role],
                    leader.as_ref().filter(|_| role != LEADER),
                    &before,
                    (steadily, now),
                )
            },
        );
        let ticks = match role {
            LEADER => select(
                urgent,
                vehicle.urgent_reaction_delay,
                vehicle.reaction_delay,
            ),
            _ => vehicle.reaction_delay,
        };
        let then = at_least(at - ticks, 0.0);
        let (place, speed) = recall_motion(state, params.simd, then, other_slot);
        let place = place + speed * ((at - then) * constants.decision);
        let ahead = if is_front {
            place - state.motion.s[slot]
        } else {
            state.motion.s[slot] - place
        };
        let ahead = nearest_image(params, ahead);
        let gap = ahead - (near.half_length[role] + vehicle.half_length);
        let closing = if is_front {
            own_speed - speed
        } else {
            speed - own_speed
        };
        let width = at_slot!(params.num_slots_in_use, other_slot, |j| params.vehicles[j]
            .looming_width);
        let (looms, clear, share, sensed) = state
            .vehicle(params, slot)
            .sense_looming(gap, closing, width);
        let error = (judged - 1.0) * share;
        if is_front {
            let before = at_least(then - constants.brake_memory, 0.0);
            let (_, early) = recall_motion(state, params.simd, before, other_slot);
            let change = at_most(
                (speed - early) / (constants.brake_memory * constants.decision),
                0.0,
            );
            let lamps = change.simd_lt(-constants.stop_lamp_decel) & !looms;
            let seen = select(lamps, at_most(change, -constants.lamp_decel), change);
            believed.accel[role] = select(noticed, seen, zero);
        }
        believed.is_detected[role] = noticed;
        believed.gap[role] = select(
            noticed,
            gap + gap * error,
            splat(params.simd, constants.unseen_gap),
        );
        believed.closing_speed[role] = select(noticed, clear * sensed, zero);
    }
}
