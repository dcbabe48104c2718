//! Contacts: oriented boxes, swept over a step; see `overtaking.sim.reference.collisions`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::RoadPositions;
use crate::math::elementary::sincos;
use crate::math::vectors::{F32, Mask, assign_where, clamp, clamp_to, max, min, select, splat};
use crate::params::{Params, StepLength};
use crate::state::{EGO_SLOT, State, in_opposite_frame, stage};
use crate::vehicle_handle::VehicleHandle;

/// Keeps the instant of contact finite without relative motion [m].
const TINY: f32 = 1e-6;
/// Steps before and after which nothing happens.
const NEVER: f32 = 1e9;

/// Bodies that stay further apart than this do not touch, whatever is rounded [m].
const ROUNDING_MARGIN: f32 = 0.05;

/// Which pairs may touch before the next decision: lower slot, higher slot, in which simulations.
pub type Pairs<S> = Vec<(usize, usize, Mask<S>)>;

/// A vector along and across the road.
type Vector<S> = (F32<S>, F32<S>);

/// One vehicle of each simulation as an oriented box.
#[derive(Clone, Copy)]
struct OrientedBox<S: Simd> {
    s: F32<S>,
    d: F32<S>,
    sine: F32<S>,
    cosine: F32<S>,
    half_length: F32<S>,
    half_width: F32<S>,
}

/// Which pairs may touch before the next decision.
#[inline(always)]
pub fn pairs_that_may_touch<S: Simd, const N: usize, const TWO_WAY: bool>(
    state: &State<S, N>,
    params: &Params<S, N>,
    pairs: &mut Pairs<S>,
) {
    let (constants, vehicles) = (&params.constants, &params.vehicles);
    pairs.clear();
    for i in 0..params.num_slots_in_use {
        for j in i + 1..params.num_slots_in_use {
            let (s, d) = state.vehicle(params, i).position_of::<TWO_WAY>(j);
            let along = (s - state.motion.s[i])
                .abs()
                .simd_lt(vehicles[i].half_length + vehicles[j].half_length + constants.near_gap);
            let aside = (d - state.motion.d[i])
                .abs()
                .simd_lt(vehicles[i].half_width + vehicles[j].half_width + constants.near_side);
            let near =
                along & aside & vehicles[i].valid.simd_gt(0.0) & vehicles[j].valid.simd_gt(0.0);
            if near.any_true() {
                pairs.push((i, j, near));
            }
        }
    }
}

/// Who has left the lanes, or stands across them, is lost: a wreck that slides to rest.
#[inline(always)]
pub fn wreck_off_road_vehicles<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    step: u32,
) {
    let (constants, road) = (&params.constants, &params.road);
    for i in 0..params.num_slots_in_use {
        let beyond = state.motion.d[i].simd_lt(road.boundaries[0] - constants.edge_margin)
            | state.motion.d[i].simd_gt(road.boundaries[road.num_lanes] + constants.edge_margin);
        let lost = (beyond | state.motion.heading[i].abs().simd_gt(constants.spin_angle))
            & params.vehicles[i].valid.simd_gt(0.0)
            & state.motion.is_wreck[i].simd_eq(0.0);
        assign_where(&mut state.motion.is_wreck[i], lost, splat(params.simd, 1.0));
        if i == EGO_SLOT {
            end_after_ego_accident(state, params, lost, step as i32);
        }
    }
}

/// An accident of the ego ends the simulation soon.
#[inline(always)]
pub(crate) fn end_after_ego_accident<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    crashed: Mask<S>,
    step: i32,
) {
    let constants = &params.constants;
    assign_where(
        &mut state.overtake.stage[EGO_SLOT],
        crashed,
        splat(params.simd, stage::CRASHED),
    );
    let after = splat(
        params.simd,
        step as f32 + (constants.after_collision / constants.step).round_ties_even(),
    );
    let sooner = min(state.end_step, after);
    assign_where(&mut state.end_step, crashed, sooner);
}

/// Exchange momentum in every near pair that touched during the last step.
#[inline(always)]
pub fn resolve_contacts<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pairs: &[(usize, usize, Mask<S>)],
    step_start: &RoadPositions<S, N>,
    step: u32,
    stride: &StepLength,
) {
    let was_sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
    for (i, j, near) in pairs.iter().copied() {
        params.simd.vectorize(
            #[inline(always)]
            || resolve_pair(state, params, near, step_start, (step, stride), (i, j)),
        );
    }
    let hit = was_sound & state.motion.is_wreck[EGO_SLOT].simd_gt(0.0);
    end_after_ego_accident(state, params, hit, step as i32);
}

/// Exchange momentum in one pair, where it touched during the last step.
#[inline(always)]
pub(crate) fn resolve_pair<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    near: Mask<S>,
    step_start: &RoadPositions<S, N>,
    (step, stride): (u32, &StepLength),
    (i, j): (usize, usize),
) {
    let (constants, vehicles) = (&params.constants, &params.vehicles);
    let turn = state.vehicle(params, i).pair_frame(j);
    let (a, b) = (
        state.vehicle(params, i).oriented_box(None),
        state.vehicle(params, j).oriented_box(turn),
    );
    let was = in_first_frame(params, turn, step_start.s[j], step_start.d[j]);
    let then = (was.0 - step_start.s[i], was.1 - step_start.d[i]);
    let now = (b.s - a.s, b.d - a.d);
    let near = near & !stay_clear(&a, &b, then, now);
    if !near.any_true() {
        return;
    }
    let overlap = swept_overlap(&a, &b, then, now);
    let near = near & is_within_step(overlap.0, overlap.1);
    if !near.any_true() {
        return;
    }
    let share = 1.0 - clamp_to(overlap.0, 0.0, 1.0);
    let a = state
        .vehicle(params, i)
        .box_at(step_start, (share, share * stride.length), None);
    let b = state
        .vehicle(params, j)
        .box_at(step_start, (share, share * stride.length), turn);
    let (enter, leave, along, across) = swept_overlap(&a, &b, then, now);
    let within = is_within_step(enter, leave);
    let enter = clamp_to(enter, 0.0, 1.0);
    // Levers of any other instant than the one that the pair goes on from would make spin.
    let turned = share * stride.length;
    let a = state
        .vehicle(params, i)
        .box_at(step_start, (1.0 - enter, turned), None);
    let b = state
        .vehicle(params, j)
        .box_at(step_start, (1.0 - enter, turned), turn);
    let (arm_a, arm_b) = contact_arms(&a, &b);
    let velocity_a = state.vehicle(params, i).point_velocity(arm_a, None);
    let velocity_b = state.vehicle(params, j).point_velocity(arm_b, turn);
    let approach = (velocity_a.0 - velocity_b.0) * along + (velocity_a.1 - velocity_b.1) * across;
    let instant = step as f32 * constants.step + enter * stride.length;
    let runs = instant.simd_lt(state.end_step * constants.step);
    let hit = near & within & approach.simd_gt(0.0) & runs;
    if !hit.any_true() {
        return;
    }
    let lever_a = arm_a.0 * across - arm_a.1 * along;
    let lever_b = arm_b.0 * across - arm_b.1 * along;
    let softness = vehicles[i].inverse_mass + vehicles[j].inverse_mass;
    let softness = softness
        + lever_a * lever_a * vehicles[i].inverse_inertia
        + lever_b * lever_b * vehicles[j].inverse_inertia;
    let zero = splat(params.simd, 0.0);
    let impulse = select(
        hit,
        (1.0 + constants.restitution) * approach / softness,
        zero,
    );
    let left = (1.0 - enter) * stride.length;
    apply_impulse(
        state,
        params,
        i,
        -impulse,
        (along, across),
        lever_a,
        (hit, left),
    );
    let (theirs, lever_b) =
        turn.map_or((impulse, lever_b), |turn| (turn * impulse, turn * lever_b));
    apply_impulse(
        state,
        params,
        j,
        theirs,
        (along, across),
        lever_b,
        (hit, left),
    );
    for (own, other) in [(i, j), (j, i)] {
        let sooner = state.first_contact.partner[own].simd_lt(0.0)
            | instant.simd_lt(state.first_contact.time[own]);
        let first = hit & sooner;
        let slot = splat(params.simd, other as f32);
        state.first_contact.partner[own] = select(first, slot, state.first_contact.partner[own]);
        state.first_contact.time[own] = select(first, instant, state.first_contact.time[own]);
        state.first_contact.impulse[own] = select(first, impulse, state.first_contact.impulse[own]);
        state.first_contact.closing_speed[own] =
            select(first, approach, state.first_contact.closing_speed[own]);
        state.motion.is_wreck[own] =
            select(hit, splat(params.simd, 1.0), state.motion.is_wreck[own]);
    }
}

/// How vehicle `j` is seen from vehicle `i`: 1, or -1 where its axes point the other way; none on a road of
/// one direction.
type PairFrame<S> = Option<F32<S>>;

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn pair_frame(self, j: usize) -> PairFrame<S> {
        let params = self.params;
        params
            .road
            .directions
            .has_oncoming_traffic
            .then(|| self.vehicle().travel_sign * params.vehicles[j].travel_sign)
    }
}

/// A position of the second vehicle of a pair in the frame of the first.
#[inline(always)]
fn in_first_frame<S: Simd, const N: usize>(
    params: &Params<S, N>,
    turn: PairFrame<S>,
    s: F32<S>,
    d: F32<S>,
) -> Vector<S> {
    turn.map_or((s, d), |turn| {
        in_opposite_frame(params, turn.simd_lt(0.0), s, d)
    })
}

/// Whether boxes overlap at some time of the step.
#[inline(always)]
fn is_within_step<S: Simd>(enter: F32<S>, leave: F32<S>) -> Mask<S> {
    enter.simd_le(leave) & enter.simd_le(1.0) & leave.simd_ge(0.0)
}

/// Whether boxes along the road around both bodies are apart during the whole step: most near pairs
/// are, and this is known without a division.
#[inline(always)]
fn stay_clear<S: Simd>(
    a: &OrientedBox<S>,
    b: &OrientedBox<S>,
    then: Vector<S>,
    now: Vector<S>,
) -> Mask<S> {
    let (along_a, across_a) = extent(a);
    let (along_b, across_b) = extent(b);
    let apart = |then: F32<S>, now: F32<S>, reach: F32<S>| {
        (then.simd_gt(reach) & now.simd_gt(reach)) | (then.simd_lt(-reach) & now.simd_lt(-reach))
    };
    apart(then.0, now.0, along_a + along_b + ROUNDING_MARGIN)
        | apart(then.1, now.1, across_a + across_b + ROUNDING_MARGIN)
}

/// Half of the room that a body takes along and across the road.
#[inline(always)]
fn extent<S: Simd>(body: &OrientedBox<S>) -> Vector<S> {
    let (sine, cosine) = (body.sine.abs(), body.cosine.abs());
    (
        body.half_length * cosine + body.half_width * sine,
        body.half_length * sine + body.half_width * cosine,
    )
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    #[inline(always)]
    fn oriented_box(self, turn: PairFrame<S>) -> OrientedBox<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (sine, cosine) = (
            state.motion.sin_heading[slot],
            state.motion.cos_heading[slot],
        );
        let (half_length, half_width) = (self.vehicle().half_length, self.vehicle().half_width);
        let (s, d) = in_first_frame(params, turn, state.motion.s[slot], state.motion.d[slot]);
        OrientedBox {
            s,
            d,
            sine: turn.map_or(sine, |turn| turn * sine),
            cosine: turn.map_or(cosine, |turn| turn * cosine),
            half_length,
            half_width,
        }
    }

    /// A vehicle as it was when a `share` of the step, a time `left`, was still to come.
    #[inline(always)]
    fn box_at(
        self,
        step_start: &RoadPositions<S, N>,
        (share, left): (F32<S>, F32<S>),
        turn: PairFrame<S>,
    ) -> OrientedBox<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (sine, cosine) =
            sincos(state.motion.heading[slot] - left * state.motion.yaw_rate[slot]);
        let s = state.motion.s[slot] - share * (state.motion.s[slot] - step_start.s[slot]);
        let d = state.motion.d[slot] - share * (state.motion.d[slot] - step_start.d[slot]);
        let (s, d) = in_first_frame(params, turn, s, d);
        OrientedBox {
            s,
            d,
            sine: turn.map_or(sine, |turn| turn * sine),
            cosine: turn.map_or(cosine, |turn| turn * cosine),
            half_length: self.vehicle().half_length,
            half_width: self.vehicle().half_width,
        }
    }
}

/// Start and end of the overlap as shares of the step, and the unit normal from a to b.
#[inline(always)]
fn swept_overlap<S: Simd>(
    a: &OrientedBox<S>,
    b: &OrientedBox<S>,
    then: Vector<S>,
    now: Vector<S>,
) -> (F32<S>, F32<S>, F32<S>, F32<S>) {
    let simd = a.s.simd;
    let turn_cosine = (a.cosine * b.cosine + a.sine * b.sine).abs();
    let turn_sine = (a.sine * b.cosine - a.cosine * b.sine).abs();
    let reach = [
        a.half_length + b.half_length * turn_cosine + b.half_width * turn_sine,
        a.half_width + b.half_length * turn_sine + b.half_width * turn_cosine,
        b.half_length + a.half_length * turn_cosine + a.half_width * turn_sine,
        b.half_width + a.half_length * turn_sine + a.half_width * turn_cosine,
    ];
    let axes = [
        (a.cosine, a.sine),
        (-a.sine, a.cosine),
        (b.cosine, b.sine),
        (-b.sine, b.cosine),
    ];
    let (mut enter, mut leave) = (splat(simd, -NEVER), splat(simd, NEVER));
    let (mut along, mut across) = (splat(simd, 0.0), splat(simd, 0.0));
    for ((axis_s, axis_d), limit) in axes.into_iter().zip(reach) {
        let start = then.0 * axis_s + then.1 * axis_d;
        let change = now.0 * axis_s + now.1 * axis_d - start;
        let change = select(change.abs().simd_lt(TINY), splat(simd, TINY), change);
        let (one, two) = ((-limit - start) / change, (limit - start) / change);
        let (begin, end) = (min(one, two), max(one, two));
        let later = begin.simd_gt(enter);
        let facing = start + change * clamp_to(begin, 0.0, 1.0);
        let sign = select(facing.simd_lt(0.0), splat(simd, -1.0), splat(simd, 1.0));
        along = select(later, sign * axis_s, along);
        across = select(later, sign * axis_d, across);
        enter = max(begin, enter);
        leave = min(end, leave);
    }
    (enter, leave, along, across)
}

#[inline(always)]
fn contact_arms<S: Simd>(a: &OrientedBox<S>, b: &OrientedBox<S>) -> (Vector<S>, Vector<S>) {
    let (ahead, aside) = (b.s - a.s, b.d - a.d);
    let near_a = nearest_point(a, ahead, aside);
    let near_b = nearest_point(b, -ahead, -aside);
    let point = (
        0.5 * (near_a.0 + ahead + near_b.0),
        0.5 * (near_a.1 + aside + near_b.1),
    );
    (point, (point.0 - ahead, point.1 - aside))
}

#[inline(always)]
fn nearest_point<S: Simd>(box_: &OrientedBox<S>, ahead: F32<S>, aside: F32<S>) -> Vector<S> {
    let (sine, cosine) = (box_.sine, box_.cosine);
    let along = clamp(
        ahead * cosine + aside * sine,
        -box_.half_length,
        box_.half_length,
    );
    let across = clamp(
        aside * cosine - ahead * sine,
        -box_.half_width,
        box_.half_width,
    );
    (
        along * cosine - across * sine,
        along * sine + across * cosine,
    )
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Velocity of a point of vehicle `i`, along and across, in a frame that is turned or not.
    #[inline(always)]
    fn point_velocity(self, arm: Vector<S>, turn: PairFrame<S>) -> Vector<S> {
        let (state, slot) = (self.state, self.slot);
        let (sine, cosine) = (
            state.motion.sin_heading[slot],
            state.motion.cos_heading[slot],
        );
        let along = state.motion.vx[slot] * cosine - state.motion.vy[slot] * sine;
        let across = state.motion.vx[slot] * sine + state.motion.vy[slot] * cosine;
        let (along, across) = turn.map_or((along, across), |turn| (turn * along, turn * across));
        (
            along - state.motion.yaw_rate[slot] * arm.1,
            across + state.motion.yaw_rate[slot] * arm.0,
        )
    }
}

/// Change the motion of vehicle `slot` by an impulse, and its place by what is left of the step.
#[inline(always)]
fn apply_impulse<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    impulse: F32<S>,
    normal: Vector<S>,
    lever: F32<S>,
    (hit, left): (Mask<S>, F32<S>),
) {
    let zero = splat(params.simd, 0.0);
    let change = impulse * params.vehicles[slot].inverse_mass;
    let (along, across) = state
        .vehicle(params, slot)
        .point_velocity((zero, zero), None);
    let (along, across) = (along + change * normal.0, across + change * normal.1);
    let spin = impulse * lever * params.vehicles[slot].inverse_inertia;
    state.motion.s[slot] += left * (change * normal.0);
    state.motion.d[slot] += left * (change * normal.1);
    state.motion.heading[slot] += left * spin;
    state.motion.yaw_rate[slot] += spin;
    let (sine, cosine) = sincos(state.motion.heading[slot]);
    state.motion.vx[slot] = select(hit, along * cosine + across * sine, state.motion.vx[slot]);
    state.motion.vy[slot] = select(hit, across * cosine - along * sine, state.motion.vy[slot]);
    (
        state.motion.sin_heading[slot],
        state.motion.cos_heading[slot],
    ) = (sine, cosine);
}
