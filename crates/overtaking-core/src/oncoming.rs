//! Who comes the other way, and what drivers believe of it; see `overtaking.sim.reference.oncoming`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::exp;
use crate::lanes::{M, V, at_least, at_most, choose, min, pick, pick_each, splat};
use crate::neighbours::{Body, Neighbours};
use crate::perception::{LEAST_REACH, optical_depth, recall, sense, strain};
use crate::state::{EGO, LEAD, NOBODY, State, UNKNOWN};
use crate::traffic::Traffic;
use crate::world::{MAX_STATIONS, World, station_indices};

const FAR: f32 = 1e9;
/// Keeps the time until vehicles meet finite [m/s].
const SLOWEST: f32 = 0.1;

/// Where drivers look for oncoming vehicles, in `State::oncoming_id`: in any lane, and in their own.
const ANY_LANE: usize = 0;
const OWN_LANE: usize = 1;

/// The nearest vehicle of the other direction ahead, and what the driver believes of it.
#[derive(Clone, Copy)]
pub struct Oncoming<S: Simd> {
    pub slot: V<S>,
    pub gap: V<S>,
    pub detected: M<S>,
    /// Whether the driver has looked for long enough to know who comes, if anybody.
    pub sure: M<S>,
    pub believed_gap: V<S>,
    pub closing: V<S>,
    /// How far the driver sees the other lane, and what comes there [m].
    pub sight: V<S>,
}

/// Whom a driver meets on a two-way road.
#[derive(Clone, Copy)]
pub struct Encounters<S: Simd> {
    /// Who comes in any lane: that is who limits a pass.
    pub coming: Oncoming<S>,
    /// Whether somebody is seen to come in the driver's lane.
    pub faces: M<S>,
    /// When that one is believed to be met [s].
    pub faced_in: V<S>,
    /// Whether somebody is passing the driver, as far as that is noticed.
    pub passed: M<S>,
    /// Whether the leader signals that it will pull out itself.
    pub leader_goes: M<S>,
}

impl<S: Simd> Oncoming<S> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            slot: splat(simd, NOBODY),
            gap: zero,
            detected: never,
            sure: never,
            believed_gap: zero,
            closing: zero,
            sight: zero,
        }
    }
}

impl<S: Simd> Encounters<S> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            coming: Oncoming::nobody(simd),
            faces: never,
            faced_in: zero,
            passed: never,
            leader_goes: never,
        }
    }
}

/// Whom driver `i` meets, and what it believes of them; advances the time in view.
///
/// What it believes of who comes in any lane, and of its leader, is left as it was where it is not `asked`:
/// nothing is decided then.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn look_ahead<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    (bodies, traffic): (&[Body<S>; N], &Traffic<S, N>),
    near: &Neighbours<S>,
    i: usize,
    decision: usize,
    asked: bool,
    met: &mut Encounters<S>,
) {
    let [coming, facing] = traffic.nearest(state, w, bodies, i);
    let sight = sight(state, w, near, i);
    let view = look_at(state, w, near, i, coming, sight);
    let sure = watch(state, w, i, ANY_LANE, coming.0, &view);
    if asked {
        met.coming = judged(state, w, i, coming.0, sight, &view, sure, decision);
        let lead = near.slot[LEAD];
        let side = pick!(w.count, lead, |j| state.indicator[j]);
        met.leader_goes = lead.simd_ge(0.0) & side.simd_gt(0.0);
    }
    if facing.0.simd_ge(0.0).any_true() {
        let range = state.shown[i];
        let view = look_at(state, w, near, i, facing, range);
        let sure = watch(state, w, i, OWN_LANE, facing.0, &view);
        let facing = judged(state, w, i, facing.0, range, &view, sure, decision);
        met.faces = facing.detected;
        met.faced_in = facing.believed_gap / at_least(facing.closing, SLOWEST);
    } else {
        remember(state, w, i, OWN_LANE, facing.0);
        met.faces = sure & !sure;
    }
    met.passed = traffic.is_passed(state, w, i);
}

/// Whether driver `i` has looked for long enough to know who comes in some lanes; advances the time in view.
#[inline(always)]
fn watch<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    lanes: usize,
    slot: V<S>,
    view: &Glimpse<S>,
) -> M<S> {
    let (c, q, effort) = (w.c, &w.q, view.effort);
    let needed = q.detection_time * (1.0 + c.detection_growth * (effort * effort * effort));
    let needed = choose(view.visible, needed, q.detection_time);
    let seen = choose(view.visible, slot, splat(w.simd, NOBODY));
    remember(state, w, i, lanes, seen);
    state.oncoming_time[i][lanes].simd_ge(needed)
}

/// Count for how long driver `i` has seen whom it sees now in some lanes.
#[inline(always)]
fn remember<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    lanes: usize,
    seen: V<S>,
) {
    let before = state.oncoming_id[i][lanes];
    let time = state.oncoming_time[i][lanes] + w.c.decision;
    let longer = choose(seen.simd_eq(before), time, splat(w.simd, 0.0));
    let first = before.simd_eq(UNKNOWN);
    state.oncoming_time[i][lanes] = choose(first, splat(w.simd, w.c.initial_time_in_view), longer);
    state.oncoming_id[i][lanes] = seen;
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
    let met = Traffic::nearest_but(state, w, EGO, first.slot);
    let view = look_at(state, w, near, EGO, met, first.sight);
    let sight = first.sight;
    judged(state, w, EGO, met.0, sight, &view, first.detected, decision)
}

/// Whether an oncomer can be seen.
struct Glimpse<S: Simd> {
    /// Half of the lengths of both [m].
    reach: V<S>,
    gap: V<S>,
    effort: V<S>,
    visible: M<S>,
}

/// What there is to see of an oncomer, as far as a range.
#[inline(always)]
fn look_at<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    i: usize,
    (slot, distance): (V<S>, V<S>),
    range: V<S>,
) -> Glimpse<S> {
    let [half, contrast, lamp] = pick_each!(w.count, slot, |j| [
        w.p[j].half_length,
        w.p[j].log_contrast,
        w.p[j].inverse_head_lamp
    ]);
    let reach = half + w.p[i].half_length;
    let gap = distance - reach;
    let leader_speed = pick!(w.count, near.slot[LEAD], |j| state.vx[j]);
    let depths = optical_depth(state, w, near, leader_speed, i);
    let effort = strain(w, gap, true, [contrast, lamp], depths);
    let range = at_most(range, w.c.oncoming_range);
    Glimpse {
        reach,
        gap,
        effort,
        visible: slot.simd_ge(0.0) & effort.simd_le(1.0) & gap.simd_lt(range),
    }
}

/// Speed of approach that driver `i` expects of who comes.
#[inline(always)]
pub fn usual_closing<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    state.road_velocity(i).0 + w.q.expected_oncoming_speed
}

/// What driver `i` believes of an oncomer that it sees, and is `sure` of.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn judged<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    slot: V<S>,
    sight: V<S>,
    view: &Glimpse<S>,
    sure: M<S>,
    decision: usize,
) -> Oncoming<S> {
    let (c, q, p) = (w.c, &w.q, &w.p[i]);
    let [width, two_wheeler, their_vx] = pick_each!(w.count, slot, |j| [
        w.p[j].looming_width,
        w.p[j].two_wheeler,
        state.vx[j]
    ]);
    let detected = view.visible & sure;
    let (own_speed, _) = state.road_velocity(i);
    let urgent = view.gap.simd_lt(c.urgent_time * (own_speed + their_vx));
    let ticks = choose(urgent, p.urgent_reaction_delay, p.reaction_delay);
    let at = splat(w.simd, decision as f32);
    let then = at_least(at - ticks, 0.0);
    let (place, speed) = recall(state, w.simd, then, slot);
    let place = place + speed * ((at - then) * c.decision);
    let gap = (w.road.ways.length - place) - state.s[i] - view.reach;
    let closing = own_speed + speed;
    let (_, clear, share, sensed) = sense(state, w, i, gap, closing, width);
    let small = choose(
        two_wheeler.simd_gt(0.0),
        splat(w.simd, c.two_wheeler_distance_factor),
        splat(w.simd, 1.0),
    );
    let judged = exp(q.oncoming_error * state.distance_error[i]) * small;
    let habit = usual_closing(state, w, i);
    let range = splat(w.simd, c.oncoming_range);
    Oncoming {
        slot,
        gap: view.gap,
        detected,
        sure,
        believed_gap: choose(detected, gap + gap * ((judged - 1.0) * share), range),
        closing: choose(detected, habit + clear * (sensed - habit), habit),
        sight,
    }
}

/// How far driver `i` sees the other lane: by the road, the weather, and past a high leader.
#[inline(always)]
fn sight<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    i: usize,
) -> V<S> {
    let (c, road) = (w.c, w.road);
    let (place, _) = state.on_the_road(w, i);
    let turned = w.p[i].travel_sign.simd_lt(0.0);
    let [along, against] = &road.ways.sight;
    let mut by_road = splat(w.simd, 0.0);
    for (table, there) in [(along, !turned), (against, turned)] {
        if there.any_true() {
            by_road = choose(there, shown(table, place), by_road);
        }
    }
    let lead = near.slot[LEAD];
    let [half_width, tall] = pick_each!(w.count, lead, |j| [w.p[j].half_width, w.p[j].blocks_view]);
    let reach = at_least(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH);
    let edge = near.aside[LEAD] + half_width - c.eye_offset;
    let middle = 0.5 * (road.boundaries[road.num_lanes] + road.boundaries[road.ways.num_own_lanes]);
    let beside = middle - state.d[i] - c.eye_offset;
    let hides = lead.simd_ge(0.0) & tall.simd_gt(0.0) & edge.simd_gt(0.0) & beside.simd_gt(0.0);
    let past = choose(
        hides,
        beside * (reach / at_least(edge, LEAST_REACH)),
        splat(w.simd, FAR),
    );
    let by_road = min(by_road, state.shown[i]);
    min(min(by_road, past), w.q.oncoming_sight)
}

/// What a table of `Ways::sight` says of places [m].
#[inline(always)]
fn shown<S: Simd>([stations, values, slopes]: &[[f32; MAX_STATIONS]; 3], place: V<S>) -> V<S> {
    let mut found = splat(place.simd, 0.0);
    for k in station_indices(stations) {
        let here = values[k] + (place - stations[k]) * slopes[k];
        found = choose(place.simd_ge(stations[k]), here, found);
    }
    found
}
