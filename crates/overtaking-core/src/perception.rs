//! What each driver believes about the neighbours; see `overtaking.sim.reference.perception`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::elementary::exp;
use crate::environment::{lane_film, lane_value};
use crate::lanes::{
    LANES, M, V, at_least, at_most, choose, clamp_to, floor, max, min, pick, pick_each, put, splat,
};
use crate::neighbours::{Body, Neighbours, along};
use crate::philox::{GLANCES, uniform, words};
use crate::state::{FAST_LEAD, HISTORY, LEAD, ROLES, ROOM, State, UNKNOWN};
use crate::world::World;

/// Who touches is as visible, and looms as much, as at this gap [m].
const NEAREST: f32 = 1.0;
/// Beyond this every limit of sight has been passed [m].
const FARTHEST: f32 = 1e4;
/// Nothing is seen through e^-40; larger exponents only overflow.
const DEEPEST: f32 = 40.0;
/// What is left of the logarithm of the contrast of something as large as a vehicle near by.
const LEAST_CONTRAST: f32 = 0.02;
/// Keeps the growth finite where all looming is seen [rad/s].
const LEAST_LOOMING: f32 = 1e-9;
/// Keeps sight lines finite alongside [m].
pub const LEAST_REACH: f32 = 0.1;

/// What one driver acts on, by role.
#[derive(Clone, Copy)]
pub struct Beliefs<S: Simd> {
    pub detected: [M<S>; ROLES],
    pub gap: [V<S>; ROLES],
    pub closing: [V<S>; ROLES],
    /// Believed acceleration of those ahead, never positive [m/s^2].
    pub accel: [V<S>; ROLES],
}

impl<S: Simd> Beliefs<S> {
    /// Before anyone has looked.
    #[inline(always)]
    pub fn nothing(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        Self {
            detected: [zero.simd_lt(zero); ROLES],
            gap: [zero; ROLES],
            closing: [zero; ROLES],
            accel: [zero; ROLES],
        }
    }
}

/// Write down where everybody is now.
#[inline(always)]
pub fn remember<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    decision: usize,
) {
    let row = decision % HISTORY;
    for i in 0..w.count {
        let (along, _) = state.road_velocity(i);
        let (low, high) = state.s[i].interleave(along);
        let (low, high) = (low.to_array(), high.to_array());
        let pairs = low.as_chunks::<2>().0.iter().chain(high.as_chunks().0);
        for (memory, pair) in state.history[i].iter_mut().zip(pairs) {
            memory[row] = *pair;
        }
    }
}

/// Which simulations' driver `i` looks into the mirrors and at the other lanes now.
#[inline(always)]
pub fn looks_around<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    decision: u32,
) -> M<S> {
    let (c, p) = (w.c, &w.p[i]);
    let interval = c.glance_interval as u32;
    let turn = decision + i as u32 * c.glance_stagger as u32;
    if decision >= interval && turn.is_multiple_of(interval) {
        return p.valid.simd_eq(p.valid);
    }
    let signalled = if w.road.lets_overtake(i) {
        state.signalled[i].simd_gt(p.indicator_lead_time)
    } else {
        state.wanted_time[i].simd_ge(p.indicator_lead_time)
    };
    let looks = state.wanted[i].simd_ne(0.0) & signalled;
    if decision.is_multiple_of(c.glance_moving as u32) {
        return looks | state.path_time[i].simd_lt(c.abort_until * state.path_duration[i]);
    }
    looks
}

/// Draw whether driver `i` looks over the shoulder before the next lane change.
#[inline(always)]
pub fn draw_check<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    drawn: M<S>,
    decision: u32,
) {
    let stream = GLANCES + i as u32;
    let [word, ..] = words(w.key, &w.index_low, &w.index_high, stream, decision);
    let word = uniform(w.simd, word);
    let (zero, one) = (splat(w.simd, 0.0), splat(w.simd, 1.0));
    let checks = choose(word.simd_lt(w.p[i].checks_blind_spot), one, zero);
    state.checks[i] = choose(drawn, checks, state.checks[i]);
}

#[inline(always)]
pub fn optical_depth<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    leader_speed: V<S>,
    i: usize,
) -> (V<S>, V<S>) {
    let (c, q) = (w.c, &w.q);
    let air = q.fog_extinction + q.rain_extinction * (1.0 + state.vx[i] / c.rain_speed);
    let path = lane_value(&w.road.film_path[..w.road.num_lanes], state.lane[i]);
    let water = lane_film(w, path);
    let zero = splat(w.simd, 0.0);
    if water.simd_le(0.0).all_true() {
        return (air, zero);
    }
    let speed = leader_speed / c.spray_speed;
    let wetness = at_most(water / c.spray_film, 1.0);
    let lifted = pick!(w.count, near.slot[LEAD], |j| w.p[j].spray);
    let spray = c.spray_coefficient * wetness * (speed * speed) * lifted;
    let close = near.slot[LEAD].simd_ge(0.0) & near.gap[LEAD].simd_lt(c.spray_reach);
    (air, choose(close, spray, zero))
}

/// What the leader hides.
struct Leader<S: Simd> {
    /// Whether it is there and so high that nobody looks over it.
    is_tall: M<S>,
    half_width: V<S>,
}

impl<S: Simd> Leader<S> {
    #[inline(always)]
    fn new<const N: usize>(w: &World<'_, S, N>, near: &Neighbours<S>) -> Self {
        let slot = near.slot[LEAD];
        let [tall, half_width] =
            pick_each!(w.count, slot, |j| [w.p[j].blocks_view, w.p[j].half_width]);
        Self {
            is_tall: slot.simd_ge(0.0) & tall.simd_gt(0.0),
            half_width,
        }
    }
}

#[inline(always)]
fn is_hidden<S: Simd>(near: &Neighbours<S>, leader: &Leader<S>, role: usize) -> M<S> {
    let (lead, other) = (near.slot[LEAD], near.slot[role]);
    let reach = at_least(near.distance[LEAD] - near.half_length[LEAD], LEAST_REACH);
    let distance = near.distance[role];
    let crossing = near.aside[role] * (reach / at_least(distance, LEAST_REACH));
    let offset = (crossing - near.aside[LEAD]).abs();
    let blocked = distance.simd_gt(reach) & offset.simd_lt(leader.half_width) & other.simd_ne(lead);
    leader.is_tall & blocked
}

/// How close to the limit of sight somebody at a gap is, by contrast or by lamps.
#[inline(always)]
pub fn strain<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    gap: V<S>,
    is_front: bool,
    [contrast, lamp]: [V<S>; 2],
    (air, spray): (V<S>, V<S>),
) -> V<S> {
    let (c, q) = (w.c, &w.q);
    let distance = clamp_to(gap, NEAREST, FARTHEST);
    let mut depth = air * distance;
    let mut sensitivity = q.log_contrast_sensitivity_behind;
    if is_front {
        depth += spray * at_most(distance, c.spray_reach);
        sensitivity = q.log_contrast_sensitivity_ahead;
    }
    let by_contrast = depth / at_least(contrast + sensitivity, LEAST_CONTRAST);
    let by_contrast = max(by_contrast, distance * q.inverse_lit_range);
    let by_lamp =
        (distance * distance * (q.lamp_threshold * lamp) * exp(at_most(depth, DEEPEST))).sqrt();
    min(by_contrast, by_lamp)
}

#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn notice<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    i: usize,
    role: usize,
    effort: V<S>,
    leader: Option<&Leader<S>>,
    before: &([V<S>; ROLES], [V<S>; ROLES]),
    (steadily, now): (M<S>, M<S>),
) -> M<S> {
    let c = w.c;
    let zero = splat(w.simd, 0.0);
    let (slot, gap) = (near.slot[role], near.gap[role]);
    let is_front = role.is_multiple_of(2);
    let reach = if is_front {
        w.p[i].attention_range
    } else {
        splat(w.simd, c.mirror_range)
    };
    let mut visible = slot.simd_ge(0.0) & effort.simd_le(1.0) & gap.simd_lt(reach);
    if let Some(leader) = leader.filter(|leader| is_front && leader.is_tall.any_true()) {
        visible &= !is_hidden(near, leader, role);
    }
    let hides =
        gap.simd_lt(if is_front { 0.0 } else { c.blind_spot }) & state.checks[i].simd_eq(0.0);
    if hides.any_true() {
        let width = pick!(w.count, slot, |j| w.p[j].half_width);
        let aside = near.aside[role].abs() - (w.p[i].half_width + width);
        visible &= !(hides & aside.simd_gt(c.alongside));
    }
    let more = choose(
        steadily,
        splat(w.simd, c.decision),
        splat(w.simd, c.glance_time),
    );
    let mut longer = zero;
    for (known, time) in before.0.into_iter().zip(before.1) {
        longer = choose(slot.simd_eq(known), max(longer, time), longer);
    }
    let first = before.0[role].simd_eq(UNKNOWN);
    let longer = choose(first, splat(w.simd, c.initial_time_in_view), longer + more);
    let longer = choose(visible, longer, zero);
    put(&mut state.seen_time[i][role], now, longer);
    put(&mut state.seen_id[i][role], now, slot);
    let needed = w.q.detection_time * (1.0 + c.detection_growth * (effort * effort * effort));
    now & visible & state.seen_time[i][role].simd_ge(needed)
}

/// 0, 1, 2 ... 15.
#[inline(always)]
fn numbered<S: Simd>(simd: S) -> V<S> {
    let number: [f32; LANES] = [
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
    ];
    V::simd_from(simd, number)
}

/// Where and how fast the vehicles in `slot` were at decision `then`.
#[inline(always)]
pub fn recall<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    simd: S,
    then: V<S>,
    slot: V<S>,
) -> (V<S>, V<S>) {
    let row = then - HISTORY as f32 * floor(then * (1.0 / HISTORY as f32));
    let who = at_least(slot, 0.0);
    let place: i32x16<S> = (row + (who * LANES as f32 + numbered(simd)) * ROOM as f32).to_int();
    let place = place.to_array();
    let moments = state.history.as_flattened().as_flattened();
    let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
    for (lane, pair) in low
        .as_chunks_mut::<2>()
        .0
        .iter_mut()
        .chain(high.as_chunks_mut::<2>().0)
        .enumerate()
    {
        // The limit does nothing but spare the check of the bounds.
        *pair = moments[(place[lane] as u32).min((N * LANES * ROOM - 1) as u32) as usize];
    }
    V::simd_from(simd, low).deinterleave(V::simd_from(simd, high))
}

/// How an approach looms to driver `i`: whether it does at all, how much of it is noticed, what is left of
/// misjudgements as contact comes near, and the speed of approach that is sensed.
#[inline(always)]
pub fn sense<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    gap: V<S>,
    closing: V<S>,
    width: V<S>,
) -> (M<S>, V<S>, V<S>, V<S>) {
    let c = w.c;
    let distance = at_least(gap, NEAREST);
    let expansion = width * closing.abs() / (distance * distance);
    let excess = expansion - c.looming_threshold;
    let span = (c.looming_growth * c.looming_threshold).max(LEAST_LOOMING);
    let clear = clamp_to(excess / span, 0.0, 1.0);
    let fading = at_least(closing * c.error_fade_time, NEAREST);
    let share = at_most(distance / fading, 1.0);
    let sensed = closing * (1.0 + share * (w.q.speed_error * state.speed_error[i]));
    (excess.simd_gt(0.0), clear, share, sensed)
}

/// What driver `i` believes about the six neighbours.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
pub fn perceive<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    near: &Neighbours<S>,
    i: usize,
    decision: usize,
    looks: M<S>,
    believed: &mut Beliefs<S>,
) {
    let (c, q, p) = (w.c, &w.q, &w.p[i]);
    let zero = splat(w.simd, 0.0);
    let leader_speed = pick!(w.count, near.slot[LEAD], |j| state.vx[j]);
    let depths = optical_depth(state, w, near, leader_speed, i);
    let everybody = p.valid.simd_eq(p.valid);
    let changing = state.path_time[i].simd_lt(state.path_duration[i]);
    // Beliefs about roles that no driver of the block looks at are not computed.
    let watched = |role: usize| {
        role == LEAD || looks.any_true() || (role.is_multiple_of(2) && changing.any_true())
    };
    let at = splat(w.simd, decision as f32);
    let urgent = near.gap[LEAD].simd_lt(c.urgent_time * (state.vx[i] - leader_speed));
    let (own_speed, _) = state.road_velocity(i);
    let judged = exp(q.distance_error * state.distance_error[i]);
    *believed = Beliefs::nothing(w.simd);
    let leader = watched(FAST_LEAD).then(|| Leader::new(w, near));
    let before = (state.seen_id[i], state.seen_time[i]);
    // A short pass: the exponential and the root of one role take the time of those of several.
    let mut efforts = [zero; ROLES];
    for role in (0..ROLES).filter(|role| watched(*role)) {
        let (slot, is_front) = (near.slot[role], role.is_multiple_of(2));
        let shines = if is_front {
            pick_each!(w.count, slot, |j| [
                w.p[j].log_contrast,
                bodies[j].inverse_rear_lamp
            ])
        } else {
            pick_each!(w.count, slot, |j| [
                w.p[j].log_contrast,
                w.p[j].inverse_head_lamp
            ])
        };
        efforts[role] = strain(w, near.gap[role], is_front, shines, depths);
    }
    for role in 0..ROLES {
        let slot = near.slot[role];
        let is_front = role.is_multiple_of(2);
        believed.gap[role] = splat(w.simd, c.unseen_gap);
        if !watched(role) {
            continue;
        }
        let steadily = match role {
            LEAD => everybody,
            _ if is_front => changing,
            _ => !everybody,
        };
        let now = looks | steadily;
        if slot.simd_lt(0.0).all_true() {
            put(&mut state.seen_id[i][role], now, slot);
            put(&mut state.seen_time[i][role], now, zero);
            continue;
        }
        let noticed = w.simd.vectorize(
            #[inline(always)]
            || {
                notice(
                    state,
                    w,
                    near,
                    i,
                    role,
                    efforts[role],
                    leader.as_ref().filter(|_| role != LEAD),
                    &before,
                    (steadily, now),
                )
            },
        );
        let ticks = match role {
            LEAD => choose(urgent, p.urgent_reaction_delay, p.reaction_delay),
            _ => p.reaction_delay,
        };
        let then = at_least(at - ticks, 0.0);
        let (place, speed) = recall(state, w.simd, then, slot);
        let place = place + speed * ((at - then) * c.decision);
        let ahead = if is_front {
            place - state.s[i]
        } else {
            state.s[i] - place
        };
        let ahead = along(w, ahead);
        let gap = ahead - (near.half_length[role] + p.half_length);
        let closing = if is_front {
            own_speed - speed
        } else {
            speed - own_speed
        };
        let width = pick!(w.count, slot, |j| w.p[j].looming_width);
        let (looms, clear, share, sensed) = sense(state, w, i, gap, closing, width);
        let error = (judged - 1.0) * share;
        if is_front {
            let before = at_least(then - c.brake_memory, 0.0);
            let (_, early) = recall(state, w.simd, before, slot);
            let change = at_most((speed - early) / (c.brake_memory * c.decision), 0.0);
            let lamps = change.simd_lt(-c.stop_lamp_decel) & !looms;
            let seen = choose(lamps, at_most(change, -c.lamp_decel), change);
            believed.accel[role] = choose(noticed, seen, zero);
        }
        believed.detected[role] = noticed;
        believed.gap[role] = choose(noticed, gap + gap * error, splat(w.simd, c.unseen_gap));
        believed.closing[role] = choose(noticed, clear * sensed, zero);
    }
}
