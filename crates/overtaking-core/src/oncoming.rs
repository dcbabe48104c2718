//! Who comes the other way, and how drivers give way to it; see `overtaking.sim.reference.oncoming`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::exp;
use crate::lanes::{
    M, V, at_least, at_most, choose, clamp_to, max, min, pick, pick_each, put, splat,
};
use crate::neighbours::{Body, Neighbours, lane_borders};
use crate::perception::{
    DEEPEST, FARTHEST, LEAST_CONTRAST, LEAST_LOOMING, LEAST_REACH, NEAREST, optical_depth, recall,
    row_of,
};
use crate::state::{EGO, LEAD, MAX_KNOTS, NOBODY, State, UNKNOWN, World, stage};
use crate::steering::begin_path;

const FAR: f32 = 1e9;
/// Keeps the time until vehicles meet finite [m/s].
const SLOWEST: f32 = 0.1;
/// Keeps braking finite for who is there already [s].
const SHORTEST: f32 = 0.1;

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

/// A vehicle as who comes the other way sees it.
#[derive(Clone, Copy)]
struct Turned<S: Simd> {
    s: V<S>,
    low_side: V<S>,
    high_side: V<S>,
    lane: V<S>,
    /// Whether it is on the road, in any lane.
    on_road: M<S>,
}

impl<S: Simd> Turned<S> {
    /// Whether it is in a lane, or on a road, between edges.
    #[inline(always)]
    fn overlaps(&self, (low, high): (V<S>, V<S>)) -> M<S> {
        self.high_side.simd_gt(low) & self.low_side.simd_lt(high)
    }
}

/// What everybody on a two-way road looks for in everybody else; sets of slots have a bit for each.
#[derive(Clone, Copy)]
pub struct Traffic<S: Simd, const N: usize> {
    turned: [Turned<S>; N],
    /// Who drives along the road, and who against it, in any simulation.
    directions: [u32; 2],
    /// Who may be in the lane that those who come drive in, in any simulation.
    strays: u32,
    /// Who overtakes, in which simulations and in any.
    pub out: [M<S>; N],
    overtakers: u32,
}

impl<S: Simd, const N: usize> Traffic<S, N> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        let turned = Turned {
            s: zero,
            low_side: zero,
            high_side: zero,
            lane: zero,
            on_road: never,
        };
        Self {
            turned: [turned; N],
            directions: [0; 2],
            strays: 0,
            out: [never; N],
            overtakers: 0,
        }
    }

    /// Look at everybody.
    #[inline(always)]
    pub fn survey(&mut self, state: &State<'_, S, N>, w: &World<'_, S, N>, bodies: &[Body<S>; N]) {
        let (c, road) = (w.c, w.road);
        let low = splat(w.simd, road.boundaries[0] + c.corridor_margin);
        let home = (low, splat(w.simd, road.boundaries[1] - c.corridor_margin));
        let edge = road.boundaries[road.num_lanes] - c.corridor_margin;
        let whole = (low, splat(w.simd, edge));
        (self.directions, self.strays, self.overtakers) = ([0; 2], 0, 0);
        for j in 0..w.count {
            let other = &w.p[j];
            let valid = other.valid.simd_gt(0.0);
            let d = road.ways.across - state.d[j];
            let turned = Turned {
                s: road.ways.far_end - state.s[j],
                low_side: d - other.half_width,
                high_side: d + other.half_width,
                lane: (road.num_lanes - 1) as f32 - state.lane[j],
                on_road: valid,
            };
            let strays = turned.overlaps(home) | (bodies[j].shows & turned.lane.simd_eq(0.0));
            let along = other.direction.simd_gt(0.0);
            self.directions[0] |= u32::from((valid & along).any_true()) << j;
            self.directions[1] |= u32::from((valid & !along).any_true()) << j;
            self.strays |= u32::from((valid & strays).any_true()) << j;
            self.out[j] = is_out(state, j);
            self.overtakers |= u32::from(self.out[j].any_true()) << j;
            self.turned[j] = Turned {
                on_road: valid & turned.overlaps(whole),
                ..turned
            };
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
    let [coming, facing] = nearest(state, w, bodies, traffic, i);
    let sight = sight(state, w, near, i);
    let view = look_at(state, w, near, i, coming, sight);
    let sure = watch(state, w, i, ANY_LANE, coming, &view);
    if asked {
        met.coming = judged(state, w, i, coming, sight, &view, sure, decision);
        let lead = near.slot[LEAD];
        let side = pick!(w.count, lead, |j| state.indicator[j]);
        met.leader_goes = lead.simd_ge(0.0) & side.simd_gt(0.0);
    }
    if facing.0.simd_ge(0.0).any_true() {
        let range = state.shown[i];
        let view = look_at(state, w, near, i, facing, range);
        let sure = watch(state, w, i, OWN_LANE, facing, &view);
        let facing = judged(state, w, i, facing, range, &view, sure, decision);
        met.faces = facing.detected;
        met.faced_in = facing.believed_gap / at_least(facing.closing, SLOWEST);
    } else {
        remember(state, w, i, OWN_LANE, facing.0);
        met.faces = sure & !sure;
    }
    met.passed = is_passed(state, w, traffic, i);
}

/// Whether driver `i` has looked for long enough to know who comes in some lanes; advances the time in view.
#[inline(always)]
fn watch<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    lanes: usize,
    met: Met<S>,
    view: &Glimpse<S>,
) -> M<S> {
    let (c, q, effort) = (w.c, &w.q, view.effort);
    let needed = q.detection_time * (1.0 + c.detection_growth * (effort * effort * effort));
    let needed = choose(view.visible, needed, q.detection_time);
    let seen = choose(view.visible, met.0, splat(w.simd, NOBODY));
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
    state.oncoming_time[i][lanes] = choose(first, splat(w.simd, w.c.seen_before), longer);
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
    let bodies = core::array::from_fn(|j| {
        if j < w.count {
            Body::new(state, w, j)
        } else {
            Body::nothing(w.simd)
        }
    });
    let mut traffic = Traffic::nobody(w.simd);
    traffic.survey(state, w, &bodies);
    for j in 0..w.count {
        traffic.turned[j].on_road &= first.slot.simd_ne(j as i32 as f32);
    }
    let met = nearest(state, w, &bodies, &traffic, EGO)[ANY_LANE];
    let view = look_at(state, w, near, EGO, met, first.sight);
    let sight = first.sight;
    judged(state, w, EGO, met, sight, &view, first.detected, decision)
}

/// Slot of an oncomer, and the distance of the centres [m].
type Met<S> = (V<S>, V<S>);

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
    (slot, distance): Met<S>,
    range: V<S>,
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
    state.road_velocity(i).0 + w.q.usual_speed
}

/// What driver `i` believes of an oncomer that it sees, and is `sure` of.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn judged<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    (slot, _): Met<S>,
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
        detected,
        sure,
        believed_gap: choose(detected, gap + gap * ((judged - 1.0) * share), range),
        closing: choose(detected, habit + clear * (sensed - habit), habit),
        sight,
    }
}

/// The nearest oncomer of vehicle `i` in any lane, and in its own. One that is visibly on its way into the own
/// lane is there.
#[inline(always)]
fn nearest<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    traffic: &Traffic<S, N>,
    i: usize,
) -> [Met<S>; 2] {
    let nobody = (splat(w.simd, NOBODY), splat(w.simd, FAR));
    let [mut coming, mut facing] = [nobody; 2];
    let [along, against] = traffic.directions;
    let mut opposed = 0;
    for (own, other) in [(along, against), (against, along)] {
        if own >> i & 1 == 1 {
            opposed |= other;
        }
    }
    for j in (0..w.count).filter(|j| opposed >> *j & 1 == 1) {
        let other = &traffic.turned[j];
        let ahead = other.s - state.s[i];
        let there = w.p[j].direction.simd_ne(w.p[i].direction) & ahead.simd_ge(0.0);
        let nearer = there & other.on_road & ahead.simd_lt(coming.1);
        coming.0 = choose(nearer, splat(w.simd, j as i32 as f32), coming.0);
        coming.1 = choose(nearer, ahead, coming.1);
    }
    // Who keeps to its lane meets those alone who have left theirs.
    let at_home = state.lane[i].simd_eq(0.0).all_true();
    let opposed = if at_home {
        opposed & traffic.strays
    } else {
        opposed
    };
    if opposed == 0 {
        return [chosen(w, i, coming), facing];
    }
    let (low, high) = lane_borders(w, state.lane[i], 0.0);
    let (low, high) = (low + w.c.corridor_margin, high - w.c.corridor_margin);
    for j in (0..w.count).filter(|j| opposed >> *j & 1 == 1) {
        let other = &traffic.turned[j];
        let ahead = other.s - state.s[i];
        let there = w.p[j].valid.simd_gt(0.0)
            & w.p[j].direction.simd_ne(w.p[i].direction)
            & ahead.simd_ge(0.0);
        let comes = bodies[j].shows & other.lane.simd_eq(state.lane[i]);
        let nearer = there & (comes | other.overlaps((low, high))) & ahead.simd_lt(facing.1);
        facing.0 = choose(nearer, splat(w.simd, j as i32 as f32), facing.0);
        facing.1 = choose(nearer, ahead, facing.1);
    }
    [chosen(w, i, coming), chosen(w, i, facing)]
}

/// Whom vehicle `i` meets, where there is a vehicle `i`.
#[inline(always)]
fn chosen<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    i: usize,
    (slot, distance): Met<S>,
) -> Met<S> {
    let valid = w.p[i].valid.simd_gt(0.0);
    (
        choose(valid, slot, splat(w.simd, NOBODY)),
        choose(valid, distance, splat(w.simd, FAR)),
    )
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
    let turned = w.p[i].direction.simd_lt(0.0);
    let [along, against] = &road.ways.sight;
    let mut by_road = splat(w.simd, 0.0);
    for (table, there) in [(along, !turned), (against, turned)] {
        if there.any_true() {
            by_road = choose(there, shown(table, place), by_road);
        }
    }
    let lead = near.slot[LEAD];
    let [half_width, tall] = pick_each!(w.count, lead, |j| [w.p[j].half_width, w.p[j].tall]);
    let reach = at_least(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH);
    let edge = near.aside[LEAD] + half_width - c.eye_offset;
    let middle = 0.5 * (road.boundaries[road.num_lanes] + road.boundaries[road.ways.own_lanes]);
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
fn shown<S: Simd>([stations, values, slopes]: &[[f32; MAX_KNOTS]; 3], place: V<S>) -> V<S> {
    let mut found = splat(place.simd, 0.0);
    for k in knots(stations) {
        let here = values[k] + (place - stations[k]) * slopes[k];
        found = choose(place.simd_ge(stations[k]), here, found);
    }
    found
}

/// The knots of a table, without the last one's repetitions.
#[inline(always)]
pub fn knots(stations: &[f32; MAX_KNOTS]) -> impl Iterator<Item = usize> + '_ {
    (0..MAX_KNOTS).take_while(|k| *k == 0 || stations[*k] > stations[*k - 1])
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

/// Whether vehicle `i` is overtaking, or on its way back from there.
#[inline(always)]
pub fn is_out<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    let away = state.stage[i].simd_ne(stage::FOLLOW) & state.stage[i].simd_ne(stage::DONE);
    away & state.crashed[i].simd_eq(0.0)
}

/// The acceleration that driver `i` does not go beyond for who comes in its lane; it may move aside, too.
#[inline(always)]
pub fn give_way<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    met: &Encounters<S>,
) -> V<S> {
    let c = w.c;
    let splat = |value: f32| splat(w.simd, value);
    let out = is_out(state, i);
    let meets = met.faces & state.crashed[i].simd_eq(0.0) & !out;
    let time = met.faced_in;
    let lifts = meets & time.simd_lt(c.head_on_flash);
    let brakes = meets & time.simd_lt(c.head_on_time);
    state.flashes[i] = choose(lifts, splat(1.0), splat(0.0));
    let halved = 2.0 * at_least(time, SHORTEST);
    let braking = clamp_to(state.vx[i] / halved, c.head_on_least, c.head_on_most);
    move_aside(state, w, i, brakes, met.passed, out);
    choose(
        brakes,
        -braking,
        choose(lifts, splat(-c.head_on_lift), splat(FAR)),
    )
}

/// Whether somebody is passing vehicle `i`, as its driver notices it.
#[inline(always)]
fn is_passed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    traffic: &Traffic<S, N>,
    i: usize,
) -> M<S> {
    let p = &w.p[i];
    let mut passed = traffic.out[i] & !traffic.out[i];
    for j in (0..w.count).filter(|j| traffic.overtakers >> *j & 1 == 1) {
        let other = &w.p[j];
        let apart = (state.s[i] - state.s[j]).abs() - (p.half_length + other.half_length);
        let same = p.direction.simd_eq(other.direction) & traffic.out[j];
        let beside = apart.simd_lt(w.c.beside_margin) & same;
        passed |= beside & state.lane[j].simd_gt(state.lane[i]);
    }
    passed & state.crashed[i].simd_eq(0.0)
}

/// Move towards the edge of the lane for who comes in it, or passes; and back afterwards. Who is `out` keeps
/// to the way of that.
#[inline(always)]
fn move_aside<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    brakes: M<S>,
    passed: M<S>,
    out: M<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let splat = |value: f32| splat(w.simd, value);
    let room = choose(passed, p.makes_room, splat(0.0));
    let wanted = choose(brakes, splat(c.aside_way), room);
    let arrived = state.path_time[i].simd_ge(state.path_duration[i]);
    let moved = wanted.simd_gt(state.aside[i]) | (arrived & wanted.simd_lt(state.aside[i]));
    let moved = moved & state.crashed[i].simd_eq(0.0) & p.valid.simd_gt(0.0) & !out;
    if moved.any_true() {
        let (low, high) = lane_borders(w, state.lane[i], 0.0);
        let duration = choose(
            brakes,
            splat(c.aside_duration),
            splat(2.0 * c.aside_duration),
        );
        begin_path(state, i, moved, 0.5 * (low + high) - wanted, duration);
        put(&mut state.aside[i], moved, wanted);
    }
    put(&mut state.aside[i], out, splat(0.0));
}
