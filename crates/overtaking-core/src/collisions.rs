//! Contacts of oriented boxes that are swept over a step; the twin of `overtaking.sim.reference.collisions`, which
//! names the sources.
//!
//! A frame has the direction of travel of a vehicle: s ahead along the road, d to the left. The two vehicles of a pair
//! are `first` and `second`, and the frame of the first is used for both. A step lasts 10 or 50 ms; a *share* of it is
//! a part from 0 to 1. `TWO_WAY` is whether the road has oncoming traffic.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen; a slot is the number of a vehicle.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::RoadPositions;
use crate::math::elementary::sincos;
use crate::math::vectors::{F32, Mask, assign_where, clamp, clamp_to, max, min, select, splat};
use crate::params::Params;
use crate::state::{EGO_SLOT, State, in_opposite_frame, stage};
use crate::vehicle_handle::VehicleHandle;

/// Keeps the time of contact finite without relative motion [m].
const MIN_MOTION: f32 = 1e-6;
/// Bound of an overlap that no axis has narrowed yet [shares].
const UNBOUNDED: f32 = 1e9;
/// Distance that `stay_clear` adds, so that rounding hides no contact [m].
const ROUNDING_MARGIN: f32 = 0.05;

/// A vector in a frame: a position, a difference of positions [m], or a velocity [m/s].
#[derive(Clone, Copy)]
struct RoadVector<S: Simd> {
    s: F32<S>,
    d: F32<S>,
}

/// Body of one vehicle in each simulation.
#[derive(Clone, Copy)]
struct OrientedBox<S: Simd> {
    /// Centre [m].
    s: F32<S>,
    d: F32<S>,
    /// Sine and cosine of the body's angle to the s axis.
    sine: F32<S>,
    cosine: F32<S>,
    /// Half of the sizes [m].
    half_length: F32<S>,
    half_width: F32<S>,
}

/// Turn from the frame of a vehicle to the frame of the first vehicle of its pair: 1, or -1 for opposite directions.
///
/// `None` on one-way roads, and for the first vehicle itself.
type PairFrame<S> = Option<F32<S>>;

/// Two vehicles that may touch before the next decision.
#[derive(Clone, Copy)]
pub struct VehiclePair<S: Simd> {
    /// Lower slot.
    pub first: usize,
    /// Higher slot.
    pub second: usize,
    /// In which simulations they may touch.
    pub is_near: Mask<S>,
}

/// The pairs that may touch before the next decision, ordered by their slots.
pub type Pairs<S> = Vec<VehiclePair<S>>;

/// A step over which bodies are swept.
pub struct SweptStep<'a, S: Simd, const N: usize> {
    /// Number of the step of 10 ms with which it begins.
    pub index: u32,
    /// Length [s]: one step, or all steps between two decisions if no frame is recorded between them.
    pub length: f32,
    /// Positions of all vehicles at its start.
    pub start: &'a RoadPositions<S, N>,
}

/// Part of a step that is still to come.
#[derive(Clone, Copy)]
struct RemainingStep<S: Simd> {
    /// Share by which the position is moved back towards its start, 0 to 1.
    share: F32<S>,
    /// Time by which the heading is turned back [s].
    time: F32<S>,
}

/// Overlap of two boxes in relative motion.
struct SweptOverlap<S: Simd> {
    /// Share of the step at which it begins.
    enter: F32<S>,
    /// Share of the step at which it ends.
    leave: F32<S>,
    /// Unit normal from the first box to the second.
    normal: RoadVector<S>,
}

impl<S: Simd> SweptOverlap<S> {
    /// Whether the boxes overlap at some time of the step.
    #[inline(always)]
    fn is_within_step(&self) -> Mask<S> {
        self.enter.simd_le(self.leave) & self.enter.simd_le(1.0) & self.leave.simd_ge(0.0)
    }
}

/// A contact of two vehicles in the frame of the first.
struct Impact<S: Simd> {
    /// Whether they touch in this step.
    exists: Mask<S>,
    /// Unit normal from the first to the second.
    normal: RoadVector<S>,
    /// Levers of the impulse about both centres, positive if an impulse along the normal turns the vehicle to the left
    /// [m].
    lever_first: F32<S>,
    lever_second: F32<S>,
    /// Closing speed along the normal [m/s].
    closing_speed: F32<S>,
    /// Time of the contact since the start of the simulation [s].
    time: F32<S>,
    /// Rest of the step [s].
    remaining_time: F32<S>,
}

/// Impulse on one vehicle in its own frame.
struct Impulse<S: Simd> {
    /// Along the normal, negative against it [N s].
    size: F32<S>,
    /// Lever about the vehicle's centre [m].
    lever: F32<S>,
}

/// Find the pairs that may touch before the next decision.
///
/// `near_gap`, 4 m, is more than two oncoming vehicles at 130 km/h approach until then, 3.6 m.
#[inline(always)]
pub fn pairs_that_may_touch<S: Simd, const N: usize, const TWO_WAY: bool>(
    state: &State<S, N>,
    params: &Params<S, N>,
    pairs: &mut Pairs<S>,
) {
    let (constants, vehicles, motion) = (&params.constants, &params.vehicles, &state.motion);
    pairs.clear();
    for first in 0..params.num_slots_in_use {
        for second in first + 1..params.num_slots_in_use {
            let (s, d) = state.vehicle(params, first).position_of::<TWO_WAY>(second);
            let half_lengths = vehicles[first].half_length + vehicles[second].half_length;
            let half_widths = vehicles[first].half_width + vehicles[second].half_width;
            let distance_s = (s - motion.s[first]).abs();
            let distance_d = (d - motion.d[first]).abs();
            let is_near = distance_s.simd_lt(half_lengths + constants.near_gap)
                & distance_d.simd_lt(half_widths + constants.near_side)
                & vehicles[first].valid.simd_gt(0.0)
                & vehicles[second].valid.simd_gt(0.0);
            if is_near.any_true() {
                pairs.push(VehiclePair {
                    first,
                    second,
                    is_near,
                });
            }
        }
    }
}

/// Turn vehicles that have left the road, or stand across it, into wrecks that slide to rest.
#[inline(always)]
pub fn wreck_off_road_vehicles<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    step: u32,
) {
    let (constants, road) = (&params.constants, &params.road);
    // The edges have the same lateral positions in the frames of both directions.
    let min_d = road.boundaries[0] - constants.edge_margin;
    let max_d = road.boundaries[road.num_lanes] + constants.edge_margin;
    for slot in 0..params.num_slots_in_use {
        let motion = &mut state.motion;
        let is_off_road = motion.d[slot].simd_lt(min_d) | motion.d[slot].simd_gt(max_d);
        let is_across = motion.heading[slot].abs().simd_gt(constants.spin_angle);
        let is_lost = (is_off_road | is_across)
            & params.vehicles[slot].valid.simd_gt(0.0)
            & motion.is_wreck[slot].simd_eq(0.0);
        assign_where(&mut motion.is_wreck[slot], is_lost, splat(params.simd, 1.0));
        if slot == EGO_SLOT {
            end_after_ego_accident(state, params, is_lost, step as i32);
        }
    }
}

/// End simulations `after_collision` [s] after `step`, at which their ego has crashed.
///
/// `step` is negative for a crash before the first decision, which `external_motion` reports.
#[inline(always)]
pub(crate) fn end_after_ego_accident<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    has_crashed: Mask<S>,
    step: i32,
) {
    let constants = &params.constants;
    assign_where(
        &mut state.overtake.stage[EGO_SLOT],
        has_crashed,
        splat(params.simd, stage::CRASHED),
    );
    // `step` is the number of a step, `constants.step` the length of each [s].
    let last_step = splat(
        params.simd,
        step as f32 + (constants.after_collision / constants.step).round_ties_even(),
    );
    let end_step = min(state.end_step, last_step);
    assign_where(&mut state.end_step, has_crashed, end_step);
}

/// Exchange momentum in every pair that touched during the last step.
///
/// For the rest of the step after a contact, the pair moves with its new velocities. If one of them touches a third
/// vehicle in the same step, it is swept along the straight line from its start to this new end.
#[inline(always)]
pub fn resolve_contacts<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pairs: &[VehiclePair<S>],
    swept: &SweptStep<'_, S, N>,
) {
    let was_sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
    for pair in pairs {
        params.simd.vectorize(
            #[inline(always)]
            || resolve_pair(state, params, pair, swept),
        );
    }
    let has_crashed = was_sound & state.motion.is_wreck[EGO_SLOT].simd_gt(0.0);
    end_after_ego_accident(state, params, has_crashed, swept.index as i32);
}

/// Exchange the momentum of one pair, where it touched during the step, and record its contact.
#[inline(always)]
pub(crate) fn resolve_pair<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pair: &VehiclePair<S>,
    swept: &SweptStep<'_, S, N>,
) {
    let VehiclePair { first, second, .. } = *pair;
    let frame = pair_frame(params, first, second);
    let Some(impact) = find_impact(state, params, (pair, frame), swept) else {
        return;
    };
    let size = impulse_size(params, &impact, pair);
    // The normal points from the first vehicle to the second, so the first is pushed against it.
    let on_first = Impulse {
        size: -size,
        lever: impact.lever_first,
    };
    // In an opposite frame the impulse is reversed, but not its moment, the product of size and lever; so the lever is
    // reversed as well.
    let on_second = Impulse {
        size: in_frame(frame, size),
        lever: in_frame(frame, impact.lever_second),
    };
    apply_impulse(state, params, first, &impact, &on_first);
    apply_impulse(state, params, second, &impact, &on_second);
    record_contact(state, params, (first, second), &impact, size);
    record_contact(state, params, (second, first), &impact, size);
}

/// The contact of a pair during the step; `None` if it touches in no simulation.
///
/// The boxes keep their heading while they are swept. The first sweep takes the heading at the end of the step; the
/// second takes the heading at the time of contact that the first has found. Two sweeps are enough: the times of
/// contact differ by at most 10 ms from a simulation with steps of 1 ms (`tests/reference/test_contact_times.py`).
#[inline(always)]
fn find_impact<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    (pair, frame): (&VehiclePair<S>, PairFrame<S>),
    swept: &SweptStep<'_, S, N>,
) -> Option<Impact<S>> {
    let constants = &params.constants;
    let VehiclePair { first, second, .. } = *pair;
    let (vehicle_1, vehicle_2) = (state.vehicle(params, first), state.vehicle(params, second));
    let (a, b) = (vehicle_1.oriented_box(None), vehicle_2.oriented_box(frame));
    let start = swept.start;
    let second_start = in_first_frame(params, frame, start.s[second], start.d[second]);
    let start_offset = RoadVector {
        s: second_start.s - start.s[first],
        d: second_start.d - start.d[first],
    };
    let end_offset = RoadVector {
        s: b.s - a.s,
        d: b.d - a.d,
    };
    let is_near = pair.is_near & !stay_clear(&a, &b, start_offset, end_offset);
    if !is_near.any_true() {
        return None;
    }
    let overlap = swept_overlap(&a, &b, start_offset, end_offset);
    let touches = is_near & overlap.is_within_step();
    if !touches.any_true() {
        return None;
    }
    // Where the first sweep has found a contact, the second takes its headings at that time.
    let share = 1.0 - clamp_to(overlap.enter, 0.0, 1.0);
    let time = share * swept.length;
    let remaining = RemainingStep { share, time };
    let a = vehicle_1.box_at(swept, remaining, None);
    let b = vehicle_2.box_at(swept, remaining, frame);
    let overlap = swept_overlap(&a, &b, start_offset, end_offset);
    let enter = clamp_to(overlap.enter, 0.0, 1.0);
    // The boxes as they touch in the second sweep: its headings, which stay those at `time`, and the positions at its
    // contact, `enter`. Levers of any other boxes would create spin.
    let remaining = RemainingStep {
        share: 1.0 - enter,
        time,
    };
    let a = vehicle_1.box_at(swept, remaining, None);
    let b = vehicle_2.box_at(swept, remaining, frame);
    let (arm_first, arm_second) = contact_arms(&a, &b);
    // Velocities are those at the end of the step, which a contact then changes.
    let velocity_first = vehicle_1.point_velocity(arm_first, None);
    let velocity_second = vehicle_2.point_velocity(arm_second, frame);
    let normal = overlap.normal;
    let closing_speed = (velocity_first.s - velocity_second.s) * normal.s
        + (velocity_first.d - velocity_second.d) * normal.d;
    let time_of_contact = swept.index as f32 * constants.step + enter * swept.length;
    let is_running = time_of_contact.simd_lt(state.end_step * constants.step);
    let exists = touches & overlap.is_within_step() & closing_speed.simd_gt(0.0) & is_running;
    if !exists.any_true() {
        return None;
    }
    Some(Impact {
        exists,
        normal,
        lever_first: arm_first.s * normal.d - arm_first.d * normal.s,
        lever_second: arm_second.s * normal.d - arm_second.d * normal.s,
        closing_speed,
        time: time_of_contact,
        remaining_time: (1.0 - enter) * swept.length,
    })
}

/// Impulse along the normal of two rigid bodies without friction between them [N s].
#[inline(always)]
fn impulse_size<S: Simd, const N: usize>(
    params: &Params<S, N>,
    impact: &Impact<S>,
    pair: &VehiclePair<S>,
) -> F32<S> {
    let first = &params.vehicles[pair.first];
    let second = &params.vehicles[pair.second];
    let compliance = first.inverse_mass + second.inverse_mass;
    let compliance = compliance
        + impact.lever_first * impact.lever_first * first.inverse_inertia
        + impact.lever_second * impact.lever_second * second.inverse_inertia;
    let size = (1.0 + params.constants.restitution) * impact.closing_speed / compliance;
    select(impact.exists, size, splat(params.simd, 0.0))
}

/// Keep the first contact of the vehicle in `slot`, and make it a wreck.
///
/// Pairs are resolved in the order of slots, so a contact that is earlier in the step may be resolved later.
#[inline(always)]
fn record_contact<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    (slot, partner): (usize, usize),
    impact: &Impact<S>,
    size: F32<S>,
) {
    let contact = &mut state.first_contact;
    let is_earlier = contact.partner[slot].simd_lt(0.0) | impact.time.simd_lt(contact.time[slot]);
    let is_first = impact.exists & is_earlier;
    let partner = splat(params.simd, partner as f32);
    contact.partner[slot] = select(is_first, partner, contact.partner[slot]);
    contact.time[slot] = select(is_first, impact.time, contact.time[slot]);
    contact.impulse[slot] = select(is_first, size, contact.impulse[slot]);
    contact.closing_speed[slot] =
        select(is_first, impact.closing_speed, contact.closing_speed[slot]);
    let is_wreck = &mut state.motion.is_wreck[slot];
    *is_wreck = select(impact.exists, splat(params.simd, 1.0), *is_wreck);
}

/// The turn from the axes of the second vehicle to the axes of the first.
#[inline(always)]
fn pair_frame<S: Simd, const N: usize>(
    params: &Params<S, N>,
    first: usize,
    second: usize,
) -> PairFrame<S> {
    let (first, second) = (&params.vehicles[first], &params.vehicles[second]);
    let has_oncoming_traffic = params.road.directions.has_oncoming_traffic;
    has_oncoming_traffic.then(|| first.travel_sign * second.travel_sign)
}

/// A component of a vector, or a lever, of the second vehicle in the frame of the first.
///
/// `match` instead of `Option::map_or`: the compiler leaves `map_or` outside as a function without the SIMD features of
/// the CPU, where each operation on a vector is a call.
#[inline(always)]
fn in_frame<S: Simd>(frame: PairFrame<S>, value: F32<S>) -> F32<S> {
    match frame {
        Some(turn) => turn * value,
        None => value,
    }
}

/// A position of the second vehicle in the frame of the first.
#[inline(always)]
fn in_first_frame<S: Simd, const N: usize>(
    params: &Params<S, N>,
    frame: PairFrame<S>,
    s: F32<S>,
    d: F32<S>,
) -> RoadVector<S> {
    let (s, d) = match frame {
        Some(turn) => in_opposite_frame(params, turn.simd_lt(0.0), s, d),
        None => (s, d),
    };
    RoadVector { s, d }
}

/// Whether the bodies stay apart along or across the road during the whole step.
///
/// This is true of most near pairs, and the test needs no division.
#[inline(always)]
fn stay_clear<S: Simd>(
    a: &OrientedBox<S>,
    b: &OrientedBox<S>,
    start_offset: RoadVector<S>,
    end_offset: RoadVector<S>,
) -> Mask<S> {
    let (extent_a, extent_b) = (extent(a), extent(b));
    stays_beyond(
        start_offset.s,
        end_offset.s,
        extent_a.s + extent_b.s + ROUNDING_MARGIN,
    ) | stays_beyond(
        start_offset.d,
        end_offset.d,
        extent_a.d + extent_b.d + ROUNDING_MARGIN,
    )
}

/// Whether an offset exceeds a distance on the same side at the start and at the end of the step.
///
/// A function, because the compiler leaves a closure that is called twice outside, without the SIMD features of the
/// CPU.
#[inline(always)]
fn stays_beyond<S: Simd>(start: F32<S>, end: F32<S>, distance: F32<S>) -> Mask<S> {
    (start.simd_gt(distance) & end.simd_gt(distance))
        | (start.simd_lt(-distance) & end.simd_lt(-distance))
}

/// Half of the space that a body takes along and across the road [m].
#[inline(always)]
fn extent<S: Simd>(body: &OrientedBox<S>) -> RoadVector<S> {
    let (sine, cosine) = (body.sine.abs(), body.cosine.abs());
    RoadVector {
        s: body.half_length * cosine + body.half_width * sine,
        d: body.half_length * sine + body.half_width * cosine,
    }
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The body at the end of the step, in the frame of the first vehicle. The state has sine and cosine of its
    /// heading.
    #[inline(always)]
    fn oriented_box(self, frame: PairFrame<S>) -> OrientedBox<S> {
        let (motion, slot, vehicle) = (&self.state.motion, self.slot, self.vehicle());
        let position = in_first_frame(self.params, frame, motion.s[slot], motion.d[slot]);
        OrientedBox {
            s: position.s,
            d: position.d,
            sine: in_frame(frame, motion.sin_heading[slot]),
            cosine: in_frame(frame, motion.cos_heading[slot]),
            half_length: vehicle.half_length,
            half_width: vehicle.half_width,
        }
    }

    /// The body when `remaining` was still to come, in the frame of the first vehicle.
    #[inline(always)]
    fn box_at(
        self,
        swept: &SweptStep<'_, S, N>,
        remaining: RemainingStep<S>,
        frame: PairFrame<S>,
    ) -> OrientedBox<S> {
        let (motion, slot, vehicle) = (&self.state.motion, self.slot, self.vehicle());
        let (sine, cosine) = sincos(motion.heading[slot] - remaining.time * motion.yaw_rate[slot]);
        let s = motion.s[slot] - remaining.share * (motion.s[slot] - swept.start.s[slot]);
        let d = motion.d[slot] - remaining.share * (motion.d[slot] - swept.start.d[slot]);
        let position = in_first_frame(self.params, frame, s, d);
        OrientedBox {
            s: position.s,
            d: position.d,
            sine: in_frame(frame, sine),
            cosine: in_frame(frame, cosine),
            half_length: vehicle.half_length,
            half_width: vehicle.half_width,
        }
    }

    /// Velocity of a point at an arm from the centre [m/s]; both are in the frame of the first vehicle.
    #[inline(always)]
    fn point_velocity(self, arm: RoadVector<S>, frame: PairFrame<S>) -> RoadVector<S> {
        let yaw_rate = self.state.motion.yaw_rate[self.slot];
        let (along, across) = self.road_velocity();
        RoadVector {
            s: in_frame(frame, along) - yaw_rate * arm.d,
            d: in_frame(frame, across) + yaw_rate * arm.s,
        }
    }
}

/// Overlap of two boxes in relative motion; of the boxes only size and heading count.
///
/// Along each separating axis of both boxes the relative centre moves linearly, which gives the part of the step in
/// which the projections overlap. The axis that starts to overlap last is the normal. The offsets are from the centre
/// of `a` to the centre of `b`.
#[inline(always)]
fn swept_overlap<S: Simd>(
    a: &OrientedBox<S>,
    b: &OrientedBox<S>,
    start_offset: RoadVector<S>,
    end_offset: RoadVector<S>,
) -> SweptOverlap<S> {
    let simd = a.s.simd;
    let axes = [
        (a.cosine, a.sine),
        (-a.sine, a.cosine),
        (b.cosine, b.sine),
        (-b.sine, b.cosine),
    ];
    let (mut enter, mut leave) = (splat(simd, -UNBOUNDED), splat(simd, UNBOUNDED));
    let (mut normal_s, mut normal_d) = (splat(simd, 0.0), splat(simd, 0.0));
    for ((axis_s, axis_d), distance) in axes.into_iter().zip(overlap_distances(a, b)) {
        let start = start_offset.s * axis_s + start_offset.d * axis_d;
        let change = end_offset.s * axis_s + end_offset.d * axis_d - start;
        let is_still = change.abs().simd_lt(MIN_MOTION);
        let change = select(is_still, splat(simd, MIN_MOTION), change);
        let at_first_side = (-distance - start) / change;
        let at_second_side = (distance - start) / change;
        let axis_enter = min(at_first_side, at_second_side);
        let axis_leave = max(at_first_side, at_second_side);
        let is_later = axis_enter.simd_gt(enter);
        // From a to b, at the time when this axis starts to overlap.
        let offset = start + change * clamp_to(axis_enter, 0.0, 1.0);
        let sign = select(offset.simd_lt(0.0), splat(simd, -1.0), splat(simd, 1.0));
        normal_s = select(is_later, sign * axis_s, normal_s);
        normal_d = select(is_later, sign * axis_d, normal_d);
        enter = max(axis_enter, enter);
        leave = min(axis_leave, leave);
    }
    SweptOverlap {
        enter,
        leave,
        normal: RoadVector {
            s: normal_s,
            d: normal_d,
        },
    }
}

/// Distance of the centres along each axis of both boxes below which projections overlap [m].
#[inline(always)]
fn overlap_distances<S: Simd>(a: &OrientedBox<S>, b: &OrientedBox<S>) -> [F32<S>; 4] {
    let relative_cosine = (a.cosine * b.cosine + a.sine * b.sine).abs();
    let relative_sine = (a.sine * b.cosine - a.cosine * b.sine).abs();
    [
        a.half_length + b.half_length * relative_cosine + b.half_width * relative_sine,
        a.half_width + b.half_length * relative_sine + b.half_width * relative_cosine,
        b.half_length + a.half_length * relative_cosine + a.half_width * relative_sine,
        b.half_width + a.half_length * relative_sine + a.half_width * relative_cosine,
    ]
}

/// Contact point relative to the centre of each box [m].
///
/// It lies midway between the points of each box nearest to the other's centre: a simple choice, since motion after a
/// contact is indicative only.
#[inline(always)]
fn contact_arms<S: Simd>(a: &OrientedBox<S>, b: &OrientedBox<S>) -> (RoadVector<S>, RoadVector<S>) {
    let offset = RoadVector {
        s: b.s - a.s,
        d: b.d - a.d,
    };
    let opposite_offset = RoadVector {
        s: -offset.s,
        d: -offset.d,
    };
    let point_of_a = nearest_point(a, offset);
    let point_of_b = nearest_point(b, opposite_offset);
    let arm_first = RoadVector {
        s: 0.5 * (point_of_a.s + offset.s + point_of_b.s),
        d: 0.5 * (point_of_a.d + offset.d + point_of_b.d),
    };
    let arm_second = RoadVector {
        s: arm_first.s - offset.s,
        d: arm_first.d - offset.d,
    };
    (arm_first, arm_second)
}

/// The point of a body nearest to another point, both relative to its centre [m].
#[inline(always)]
fn nearest_point<S: Simd>(body: &OrientedBox<S>, offset: RoadVector<S>) -> RoadVector<S> {
    let (sine, cosine) = (body.sine, body.cosine);
    let along = offset.s * cosine + offset.d * sine;
    let across = offset.d * cosine - offset.s * sine;
    let along = clamp(along, -body.half_length, body.half_length);
    let across = clamp(across, -body.half_width, body.half_width);
    RoadVector {
        s: along * cosine - across * sine,
        d: along * sine + across * cosine,
    }
}

/// Change the motion of the vehicle in `slot` by an impulse, and its position over the rest of the step.
#[inline(always)]
fn apply_impulse<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    impact: &Impact<S>,
    impulse: &Impulse<S>,
) {
    let (vehicle, time) = (&params.vehicles[slot], impact.remaining_time);
    let zero = splat(params.simd, 0.0);
    let centre = RoadVector { s: zero, d: zero };
    let velocity = state.vehicle(params, slot).point_velocity(centre, None);
    let speed_change = impulse.size * vehicle.inverse_mass;
    let change_s = speed_change * impact.normal.s;
    let change_d = speed_change * impact.normal.d;
    let (velocity_s, velocity_d) = (velocity.s + change_s, velocity.d + change_d);
    let spin_change = impulse.size * impulse.lever * vehicle.inverse_inertia;
    let motion = &mut state.motion;
    // Without a contact all changes are zero, but the turn of the velocity to the road and back would round; so only
    // the velocity is masked.
    motion.s[slot] += time * change_s;
    motion.d[slot] += time * change_d;
    motion.heading[slot] += time * spin_change;
    motion.yaw_rate[slot] += spin_change;
    let (sine, cosine) = sincos(motion.heading[slot]);
    let (vx, vy) = (
        velocity_s * cosine + velocity_d * sine,
        velocity_d * cosine - velocity_s * sine,
    );
    motion.vx[slot] = select(impact.exists, vx, motion.vx[slot]);
    motion.vy[slot] = select(impact.exists, vy, motion.vy[slot]);
    (motion.sin_heading[slot], motion.cos_heading[slot]) = (sine, cosine);
}
