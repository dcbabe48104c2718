//! Who comes the other way, and how drivers give way to it; see `overtaking.sim.reference.oncoming`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::exp;
use crate::lanes::{M, V, at_least, at_most, choose, clamp_to, max, min, pick, pick_each, splat};
use crate::neighbours::{Body, Neighbours, lane_borders};
use crate::perception::{
    DEEPEST, FARTHEST, LEAST_CONTRAST, LEAST_LOOMING, LEAST_REACH, NEAREST, optical_depth, recall,
    row_of,
};
use crate::state::{EGO, LEAD, NOBODY, State, UNKNOWN, World, stage};
use crate::steering::begin_path;

const FAR: f32 = 1e9;
/// Keeps the time until vehicles meet finite [m/s].
const SLOWEST: f32 = 0.1;
/// Keeps braking finite for who is there already [s].
const SHORTEST: f32 = 0.1;

/// The nearest vehicle of the other direction ahead, and what the driver believes of it.
#[derive(Clone, Copy)]
pub struct Oncoming<S: Simd> {
    pub slot: V<S>,
    pub gap: V<S>,
    /// Whether it is in the driver's lane, or visibly on its way there.
    pub in_lane: M<S>,
    pub detected: M<S>,
    /// Whether the driver has looked for long enough to know who comes, if anybody.
    pub sure: M<S>,
    pub believed_gap: V<S>,
    pub closing: V<S>,
    /// How far the ego sees its road, and what comes there [m].
    pub sight: V<S>,
}

impl<S: Simd> Oncoming<S> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            slot: splat(simd, NOBODY),
            gap: zero,
            in_lane: never,
            detected: never,
            sure: never,
            believed_gap: zero,
            closing: zero,
            sight: zero,
        }
    }
}

/// Who comes, and what driver `i` believes of it; advances the time in view.
#[inline(always)]
pub fn look_ahead<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    near: &Neighbours<S>,
    i: usize,
    decision: usize,
) -> Oncoming<S> {
    let (c, q) = (w.c, &w.q);
    let zero = splat(w.simd, 0.0);
    let found = nearest(state, w, bodies, i, splat(w.simd, NOBODY));
    let sight = if i == EGO {
        sight(state, w, near)
    } else {
        zero
    };
    let view = look_at(state, w, near, i, found.0, found.1, sight);
    let effort = view.effort;
    let needed = q.detection_time * (1.0 + c.detection_growth * (effort * effort * effort));
    let needed = choose(view.visible, needed, q.detection_time);
    let seen = choose(view.visible, found.0, splat(w.simd, NOBODY));
    let same = seen.simd_eq(state.oncoming_id[i]);
    let longer = choose(same, state.oncoming_time[i] + c.decision, zero);
    let first = state.oncoming_id[i].simd_eq(UNKNOWN);
    state.oncoming_time[i] = choose(first, splat(w.simd, c.seen_before), longer);
    state.oncoming_id[i] = seen;
    let sure = state.oncoming_time[i].simd_ge(needed);
    judged(state, w, i, found, sight, &view, sure, decision)
}

/// Who comes behind the nearest, and what the ego would believe of it: our drivers decide by the nearest
/// alone, another driver is told of the next one. It is noticed with the nearest, where it can be seen.
#[inline(always)]
pub fn look_beyond<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    first: &Oncoming<S>,
    decision: usize,
) -> Oncoming<S> {
    let bodies = core::array::from_fn(|j| {
        if j < w.count {
            Body::new(state, w, j)
        } else {
            Body::nothing(w.simd)
        }
    });
    let found = nearest(state, w, &bodies, EGO, first.slot);
    let view = look_at(state, w, near, EGO, found.0, found.1, first.sight);
    judged(
        state,
        w,
        EGO,
        found,
        first.sight,
        &view,
        first.detected,
        decision,
    )
}

/// Whether an oncomer can be seen.
struct Glimpse<S: Simd> {
    /// Half of the lengths of both [m].
    reach: V<S>,
    gap: V<S>,
    effort: V<S>,
    visible: M<S>,
}

/// What there is to see of an oncomer in a slot, at a distance.
#[inline(always)]
fn look_at<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    i: usize,
    slot: V<S>,
    distance: V<S>,
    sight: V<S>,
) -> Glimpse<S> {
    let [half, contrast, lamp] = pick_each!(w.count, slot, |j| [
        w.p[j].half_length,
        w.p[j].contrast,
        w.p[j].inverse_head_lamp
    ]);
    let reach = half + w.p[i].half_length;
    let gap = distance - reach;
    let leader_speed = pick!(w.count, near.slot[LEAD], |j| state.vx[j]);
    let depths = optical_depth(state, w, near, leader_speed, i);
    let effort = strain(w, contrast, lamp, gap, depths);
    let range = at_most(state.shown[i], w.c.oncoming_range);
    let far = if i == EGO { min(range, sight) } else { range };
    Glimpse {
        reach,
        gap,
        effort,
        visible: slot.simd_ge(0.0) & effort.simd_le(1.0) & gap.simd_lt(far),
    }
}

/// Speed of approach that driver `i` expects of who comes.
#[inline(always)]
pub fn usual_closing<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    state.road_velocity(i).0 + w.q.usual_speed
}

/// What driver `i` believes of an oncomer that it sees, and is `sure` of.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn judged<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (slot, _, in_lane): (V<S>, V<S>, M<S>),
    sight: V<S>,
    view: &Glimpse<S>,
    sure: M<S>,
    decision: usize,
) -> Oncoming<S> {
    let (c, q, p) = (w.c, &w.q, &w.p[i]);
    let [width, two_wheeler, their_vx] = pick_each!(w.count, slot, |j| [
        w.p[j].loom_width,
        w.p[j].two_wheeler,
        state.vx[j]
    ]);
    let detected = view.visible & sure;
    let (own_speed, _) = state.road_velocity(i);
    let urgent = view.gap.simd_lt(c.urgent_time * (own_speed + their_vx));
    let ticks = choose(urgent, p.urgent_ticks, p.reaction_ticks);
    let at = splat(w.simd, decision as f32);
    let then = at_least(at - ticks, 0.0);
    let (place, speed) = recall(state, w.simd, row_of(then), slot);
    let place = place + speed * ((at - then) * c.decision);
    let gap = (w.road.ways.far_end - place) - state.s[i] - view.reach;
    let closing = own_speed + speed;
    let distance = at_least(gap, NEAREST);
    let expansion = width * closing.abs() / (distance * distance);
    let span = (c.looming_growth * c.looming_threshold).max(LEAST_LOOMING);
    let clear = clamp_to((expansion - c.looming_threshold) / span, 0.0, 1.0);
    let fading = at_least(closing * c.error_fade_time, NEAREST);
    let share = at_most(distance / fading, 1.0);
    let small = choose(
        two_wheeler.simd_gt(0.0),
        splat(w.simd, c.small_oncomer),
        splat(w.simd, 1.0),
    );
    let judged = exp(q.oncoming_error * state.distance_error[i]) * small;
    let sensed = closing * (1.0 + share * (q.speed_error * state.speed_error[i]));
    let habit = usual_closing(state, w, i);
    let range = splat(w.simd, c.oncoming_range);
    Oncoming {
        slot,
        gap: view.gap,
        in_lane,
        detected,
        sure,
        believed_gap: choose(detected, gap + gap * ((judged - 1.0) * share), range),
        closing: choose(detected, habit + clear * (sensed - habit), habit),
        sight,
    }
}

/// Slot and distance of the nearest oncomer of vehicle `i`, and whether it is in its lane.
#[inline(always)]
fn nearest<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    i: usize,
    but: V<S>,
) -> (V<S>, V<S>, M<S>) {
    let (c, road, own) = (w.c, w.road, &w.p[i]);
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    let to = if i == EGO {
        splat(w.simd, road.boundaries[road.num_lanes])
    } else {
        high
    };
    let (mut slot, mut nearest) = (splat(w.simd, NOBODY), splat(w.simd, FAR));
    let mut in_lane = slot.simd_gt(nearest);
    for j in 0..w.count {
        let other = &w.p[j];
        let opposed = other.valid.simd_gt(0.0)
            & other.direction.simd_ne(own.direction)
            & own.valid.simd_gt(0.0);
        if !opposed.any_true() {
            continue;
        }
        let (s, d) = (
            road.ways.far_end - state.s[j],
            road.ways.across - state.d[j],
        );
        let ahead = s - state.s[i];
        let (low_side, high_side) = (d - other.half_width, d + other.half_width);
        let lane = (road.num_lanes - 1) as f32 - state.lane[j];
        let comes = bodies[j].shows & lane.simd_eq(state.lane[i]);
        let above = high_side.simd_gt(low + c.corridor_margin);
        let inside = comes | (above & low_side.simd_lt(high - c.corridor_margin));
        let watched = comes | (above & low_side.simd_lt(to - c.corridor_margin));
        let nearer = opposed & watched & ahead.simd_ge(0.0) & ahead.simd_lt(nearest);
        let nearer = nearer & but.simd_ne(j as f32);
        slot = choose(nearer, splat(w.simd, j as f32), slot);
        nearest = choose(nearer, ahead, nearest);
        in_lane = (nearer & inside) | (!nearer & in_lane);
    }
    (slot, nearest, in_lane)
}

/// How far the ego sees the other lane: by the road, the weather, and past a high leader.
#[inline(always)]
fn sight<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
) -> V<S> {
    let (c, road, place) = (w.c, w.road, state.s[EGO]);
    let mut by_road = splat(w.simd, 0.0);
    let [stations, values, slopes] = &road.ways.sight;
    for ((station, value), slope) in stations.iter().zip(values).zip(slopes) {
        let here = *value + (place - *station) * *slope;
        by_road = choose(place.simd_ge(*station), here, by_road);
    }
    let lead = near.slot[LEAD];
    let [half_width, tall] = pick_each!(w.count, lead, |j| [w.p[j].half_width, w.p[j].tall]);
    let reach = at_least(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH);
    let edge = near.aside[LEAD] + half_width - c.eye_offset;
    let middle = 0.5 * (road.boundaries[road.num_lanes] + road.boundaries[road.ways.own_lanes]);
    let beside = middle - state.d[EGO] - c.eye_offset;
    let hides = lead.simd_ge(0.0) & tall.simd_gt(0.0) & edge.simd_gt(0.0) & beside.simd_gt(0.0);
    let past = choose(
        hides,
        beside * (reach / at_least(edge, LEAST_REACH)),
        splat(w.simd, FAR),
    );
    let by_road = min(by_road, state.shown[EGO]);
    min(min(by_road, past), w.q.oncoming_sight)
}

/// How close to the limit of sight an oncomer is.
#[inline(always)]
fn strain<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    contrast: V<S>,
    lamp: V<S>,
    gap: V<S>,
    (air, spray): (V<S>, V<S>),
) -> V<S> {
    let (c, q) = (w.c, &w.q);
    let distance = clamp_to(gap, NEAREST, FARTHEST);
    let depth = air * distance + spray * at_most(distance, c.spray_reach);
    let by_contrast = depth / at_least(contrast + q.sight_front, LEAST_CONTRAST);
    let by_contrast = max(by_contrast, distance * q.inverse_lit_range);
    let by_lamp =
        (distance * distance * (q.lamp_threshold * lamp) * exp(at_most(depth, DEEPEST))).sqrt();
    min(by_contrast, by_lamp)
}

/// Whether the ego is overtaking, or on its way back from there.
#[inline(always)]
fn is_out<S: Simd, const N: usize>(state: &State<'_, S, N>) -> M<S> {
    let away = state.stage.simd_ne(stage::FOLLOW) & state.stage.simd_ne(stage::DONE);
    away & state.crashed[EGO].simd_eq(0.0)
}

/// The acceleration that driver `i` does not go beyond for who comes in its lane; it may move aside, too.
#[inline(always)]
pub fn give_way<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    oncoming: &Oncoming<S>,
) -> V<S> {
    let c = w.c;
    let splat = |value: f32| splat(w.simd, value);
    let mut met = oncoming.detected & oncoming.in_lane & state.crashed[i].simd_eq(0.0);
    if i == EGO {
        met &= !is_out(state);
    }
    let time = oncoming.believed_gap / at_least(oncoming.closing, SLOWEST);
    let lifts = met & time.simd_lt(c.head_on_flash);
    let brakes = met & time.simd_lt(c.head_on_time);
    state.flashes[i] = choose(lifts, splat(1.0), splat(0.0));
    let halved = 2.0 * at_least(time, SHORTEST);
    let braking = clamp_to(state.vx[i] / halved, c.head_on_least, c.head_on_most);
    if i != EGO {
        move_aside(state, w, i, brakes);
    }
    choose(
        brakes,
        -braking,
        choose(lifts, splat(-c.head_on_lift), splat(FAR)),
    )
}

/// Whether the ego is passing vehicle `i`, as its driver notices it.
#[inline(always)]
pub fn is_passed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    let (p, ego) = (&w.p[i], &w.p[EGO]);
    let apart = (state.s[i] - state.s[EGO]).abs() - (p.half_length + ego.half_length);
    let beside = apart.simd_lt(w.c.beside_margin)
        & p.direction.simd_eq(ego.direction)
        & state.crashed[i].simd_eq(0.0);
    beside & state.lane[EGO].simd_gt(state.lane[i]) & is_out(state)
}

/// Move towards the edge of the lane for who comes in it, or passes; and back afterwards.
#[inline(always)]
fn move_aside<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    brakes: M<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let splat = |value: f32| splat(w.simd, value);
    let room = choose(is_passed(state, w, i), p.makes_room, splat(0.0));
    let wanted = choose(brakes, splat(c.aside_way), room);
    let arrived = state.path_time[i].simd_ge(state.path_duration[i]);
    let moved = wanted.simd_gt(state.aside[i]) | (arrived & wanted.simd_lt(state.aside[i]));
    let moved = moved & state.crashed[i].simd_eq(0.0) & p.valid.simd_gt(0.0);
    if !moved.any_true() {
        return;
    }
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    let duration = choose(
        brakes,
        splat(c.aside_duration),
        splat(2.0 * c.aside_duration),
    );
    begin_path(state, i, moved, 0.5 * (low + high) - wanted, duration);
    state.aside[i] = choose(moved, wanted, state.aside[i]);
}
