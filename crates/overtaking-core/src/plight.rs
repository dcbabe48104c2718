//! How a driver goes on in the other lane: past, back behind the other, or in haste; see
//! `overtaking.sim.reference.plight`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::following::{follow, needed_braking};
use crate::intent::in_stage;
use crate::lanes::{M, V, at_least, choose, min, pick, pick_each, splat};
use crate::moment::Mind;
use crate::passing::{SLOWEST, is_solid, room_left, seen_ahead, speed_of_pass, time_to_pass};
use crate::state::{EGO, SLOW_LEAD, SLOW_REAR, State, stage};
use crate::world::World;

const FAR: f32 = 1e9;

/// How a driver in the other lane stands.
pub struct Plight<S: Simd> {
    /// It falls back behind the vehicle that it was to pass.
    pub yields: M<S>,
    /// It wants to be back soon.
    pub hurries: M<S>,
    /// It would take a small gap for that.
    pub pressed: M<S>,
    /// There will be room behind that vehicle, and the next one in its lane, once it is no faster.
    pub fits: M<S>,
}

/// Whether driver `i` goes on with its pass, and how.
#[inline(always)]
pub fn weigh<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    mind: &Mind<'_, S>,
) -> Plight<S> {
    let (c, own, near, coming) = (w.c, &w.p[i], mind.near, &mind.met.coming);
    let out = is_passing(state, i);
    let other = pick!(w.count, state.target[i], |j| state.road_velocity(j).0);
    let speed = state.road_velocity(i).0;
    let (lead, bodies) = to_fall_in(state, w, i);
    let faster = speed - other;
    let aside = 0.5 * w.q.urgent_change_duration;
    let onwards = at_least(lead + bodies, 0.0);
    let rest = time_to_pass(state, w, i, onwards, (speed, faster), other) + aside;
    let brake = c.abort_decel_share * own.max_assumed_decel;
    let backwards = at_least(bodies - lead, 0.0);
    let back = (faster + (faster * faster + 2.0 * brake * backwards).sqrt()) / brake + aside;
    let there = choose(
        coming.detected,
        coming.believed_gap / at_least(coming.closing, SLOWEST),
        splat(w.simd, FAR),
    );
    let gives_up = lead.simd_gt(0.0) & (rest + c.abort_margin).simd_gt(there) & back.simd_lt(rest);
    let no_time = is_confined(state, w, i, mind);
    let room = near.gap[SLOW_LEAD] + near.gap[SLOW_REAR];
    let left = own.return_time_gap * room_left(w, state.target[i]);
    let cramped = no_time & room.simd_lt(own.min_gap + (own.time_gap + left) * other);
    let too_slow = (onwards / at_least(faster, SLOWEST)).simd_gt(back);
    let trapped = no_time & (room.simd_lt(c.min_return_space) | too_slow);
    let yields = (gives_up | trapped | state.yields[i].simd_gt(0.0)) & out;
    let beyond = (out | in_stage(state, i, stage::RETURN)) & !yields;
    let pressed = beyond & ((there - rest).simd_lt(c.urgent_return_margin) | cramped);
    let late =
        is_solid(state, w, i, at_least(speed, 0.0) * rest) & own.heeds_solid_lines.simd_gt(0.0);
    // What is still gained on another while the brakes come on, and with them.
    let gained = |faster: V<S>| {
        let faster = at_least(faster, 0.0);
        faster * (c.brake_ramp + faster / (2.0 * brake))
    };
    let (front, closing) = (
        mind.believed.gap[SLOW_LEAD],
        mind.believed.closing[SLOW_LEAD],
    );
    let fits = (lead - gained(faster)).simd_gt(bodies)
        & (front - gained(closing)).simd_gt(c.min_return_gap);
    Plight {
        yields,
        hurries: pressed | (beyond & late),
        pressed,
        fits,
    }
}

/// Whether driver `i` is past the one that it overtakes, has no time to pass the next one as well, and can still
/// brake behind that.
#[inline(always)]
fn is_confined<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    mind: &Mind<'_, S>,
) -> M<S> {
    let passes = in_stage(state, i, stage::PASS);
    if !passes.any_true() {
        return passes;
    }
    let (c, own, coming) = (w.c, &w.p[i], &mind.met.coming);
    let past = passes & state.s[i].simd_gt(pick!(w.count, state.target[i], |j| state.s[j]));
    let (gap, closing) = (
        mind.believed.gap[SLOW_LEAD],
        mind.believed.closing[SLOW_LEAD],
    );
    let next_one = state.vx[i] - closing;
    let bodies = 2.0 * (mind.near.half_length[SLOW_LEAD] + own.half_length);
    let way = gap + bodies + c.min_return_gap;
    let longer = time_to_pass(state, w, i, way, (state.vx[i], closing), next_one);
    let longer = longer + 0.5 * w.q.urgent_change_duration + c.urgent_return_margin;
    let late = seen_ahead(own, coming).simd_lt(longer * coming.closing);
    let needed = needed_braking(c, state.vx[i], gap, closing, splat(w.simd, 0.0));
    past & late & needed.simd_ge(-(c.abort_decel_share * own.max_assumed_decel))
}

/// Whether driver `i` is past the one that it overtakes and comes beside the next one: it overtakes that now.
#[inline(always)]
pub fn goes_on<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    mind: &Mind<'_, S>,
) -> M<S> {
    let passes = in_stage(state, i, stage::PASS);
    if !passes.any_true() {
        return passes;
    }
    let near = mind.near;
    let past = passes & state.s[i].simd_gt(pick!(w.count, state.target[i], |j| state.s[j]));
    let beside = near.gap[SLOW_LEAD].simd_lt(w.c.min_return_gap);
    let follows = is_confined(state, w, i, mind) | state.yields[i].simd_gt(0.0);
    past & beside & near.slot[SLOW_LEAD].simd_ge(0.0) & !follows
}

/// Whether driver `i` is on its way past another.
#[inline(always)]
fn is_passing<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    in_stage(state, i, stage::PULL_OUT) | in_stage(state, i, stage::PASS)
}

/// Whether the ego of a two-way road can give up its pass: it is behind who is overtaken.
#[inline(always)]
pub fn can_fall_in<S: Simd, const N: usize>(state: &State<'_, S, N>, w: &World<'_, S, N>) -> M<S> {
    let (lead, bodies) = to_fall_in(state, w, EGO);
    is_passing(state, EGO) & lead.simd_gt(bodies)
}

/// How far ahead the target is, and has to be for driver `i` to fall in behind it [m].
#[inline(always)]
fn to_fall_in<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> (V<S>, V<S>) {
    let [place, half_length] = pick_each!(w.count, state.target[i], |j| [
        state.s[j],
        w.p[j].half_length
    ]);
    let bodies = w.p[i].half_length + half_length + w.c.min_return_gap;
    (place - state.s[i], bodies)
}

/// The acceleration that driver `i` in the other lane does not go beyond: falling back, or fitting in
/// where no time is left to pass the next one, too.
#[inline(always)]
pub fn held_back<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    mind: &Mind<'_, S>,
) -> V<S> {
    let free = splat(w.simd, FAR);
    let yields = state.yields[i].simd_gt(0.0);
    if !(yields | in_stage(state, i, stage::PASS)).any_true() {
        return free;
    }
    let (c, own, near, believed) = (w.c, &w.p[i], mind.near, mind.believed);
    let (gap, closing) = (believed.gap[SLOW_LEAD], believed.closing[SLOW_LEAD]);
    let other = pick!(w.count, state.target[i], |j| state.road_velocity(j).0);
    let slow = state
        .road_velocity(i)
        .0
        .simd_lt(other - c.abort_speed_difference);
    let brake = choose(
        slow,
        splat(w.simd, 0.0),
        -(c.abort_decel_share * own.max_assumed_decel),
    );
    let middle = 0.5 * (near.gap[SLOW_LEAD] + near.gap[SLOW_REAR]);
    let nearest = at_least(middle - own.min_gap, 0.0) / at_least(state.vx[i], c.slip_speed);
    let fitting = follow(
        c,
        own,
        state.vx[i],
        speed_of_pass(state, w, i),
        gap,
        closing,
        min(c.return_time_gap_share * own.time_gap, nearest),
        believed.accel[SLOW_LEAD],
    );
    let capped = choose(is_confined(state, w, i, mind), fitting, free);
    choose(yields, brake, capped)
}
