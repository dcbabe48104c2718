//! How drivers pass against oncoming traffic, the ego and the others alike; see `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::ego::in_stage;
use crate::following::{follow, needed_braking};
use crate::lanes::{M, V, at_least, choose, max, min, pick, pick_each, splat};
use crate::names::{Constants, Vehicle};
use crate::neighbours::Neighbours;
use crate::oncoming::{Oncoming, knots};
use crate::state::{EGO, LEAD, SLOW_LEAD, SLOW_REAR, State, World, stage};
use crate::step::Mind;

const FAR: f32 = 1e9;
/// Least surplus of speed to be past with, and of approach [m/s].
const SLOWEST: f32 = 0.5;
/// Keeps the time of accelerating finite [m/s^2].
const LEAST_ACCEL: f32 = 0.1;

/// Time to gain a way on another vehicle, at constant acceleration up to a top speed.
#[inline(always)]
fn time_to_gain<S: Simd>(way: V<S>, faster: V<S>, top: V<S>, accel: V<S>) -> V<S> {
    let (a, most) = (at_least(accel, LEAST_ACCEL), at_least(top, SLOWEST));
    let v = min(at_least(faster, 0.0), most);
    let ramp = (most - v) / a;
    let covered = 0.5 * (v + most) * ramp;
    let within = ((v * v + 2.0 * a * way).sqrt() - v) / a;
    choose(way.simd_lt(covered), within, ramp + (way - covered) / most)
}

/// The acceleration that a driver reckons with on the way up to a speed: what it likes to use, and no more
/// than the engine leaves halfway.
#[inline(always)]
fn reckoned_accel<S: Simd>(c: &Constants, own: &Vehicle<S>, speed: V<S>, top: V<S>) -> V<S> {
    let halfway = 0.5 * (speed + max(top, speed));
    let engine = min(
        own.launch_force,
        own.power / at_least(halfway, c.slip_speed),
    );
    let left = (engine - (own.drag * halfway * halfway + own.rolling)) * own.inverse_mass;
    min(c.accelerate_gain * own.accel, left)
}

/// The speed that driver `i` passes at: well above that of the other, if the vehicle can; the limit counts as on a free road.
#[inline(always)]
fn top_speed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    leader: V<S>,
) -> V<S> {
    let wanted = max(state.pass_speed(w, i), leader + w.c.passing_surplus);
    let excess = at_least(wanted - state.limit(w, i), 0.0);
    let heeded = wanted - w.p[i].limit_respect * excess;
    min(heeded, w.p[i].max_speed)
}

/// The speed that driver `i` wants now, if it passes.
#[inline(always)]
pub fn speed_of_pass<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> V<S> {
    let (c, own) = (w.c, &w.p[i]);
    let other = pick!(w.count, state.target[i], |j| state.road_velocity(j).0);
    let top = top_speed(state, w, i, other);
    let hurried = choose(state.hurries[i].simd_gt(0.0), c.hurry_speed * top, top);
    min(hurried, own.max_speed)
}

/// The way up to who comes, or may come from where the road is not seen.
#[inline(always)]
fn seen_ahead<S: Simd>(own: &Vehicle<S>, coming: &Oncoming<S>) -> V<S> {
    min(coming.believed_gap, own.unseen_trust * coming.sight)
}

/// How much more room drivers leave to the vehicle in a slot than to a car.
#[inline(always)]
pub fn room_left<S: Simd, const N: usize>(w: &World<'_, S, N>, slot: V<S>) -> V<S> {
    let tall = pick!(w.count, slot, |j| w.p[j].tall);
    let (more, same) = (splat(w.simd, w.c.tall_room), splat(w.simd, 1.0));
    choose(tall.simd_gt(0.0), more, same)
}

/// Whether the other lane is believed to be free for long enough by driver `i`, who believes the leader to be
/// at a gap, and at a speed.
#[inline(always)]
pub fn may_meet<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    near: &Neighbours<S>,
    coming: &Oncoming<S>,
    (gap, leader): (V<S>, V<S>),
    impatience: V<S>,
) -> M<S> {
    let (c, own, speed) = (w.c, &w.p[i], state.vx[i]);
    let bodies = 2.0 * (near.half_length[LEAD] + own.half_length);
    let returns = own.return_time_gap * impatience * room_left(w, near.slot[LEAD]) * leader;
    let way = gap + bodies + returns;
    let top = top_speed(state, w, i, leader);
    let accel = reckoned_accel(c, own, speed, top);
    let gaining = time_to_gain(way, speed - leader, top - leader, accel);
    let need = own.need_factor * (gaining + own.lane_change_duration);
    let closing = coming.closing + 0.5 * at_least(top - speed, 0.0);
    let spare = own.spare * at_least(impatience, c.spare_kept);
    let enough = seen_ahead(own, coming).simd_gt(need * (1.0 + spare) * closing);
    let room = room_ahead(state, w, i, near.slot[LEAD]);
    let least = 2.0 * own.half_length + c.squeeze_gap + returns;
    let room = room.simd_gt(least + c.fit_share * own.time_gap * leader);
    let solid = is_solid(state, w, i, splat(w.simd, c.line_ahead));
    enough & coming.sure & room & !(solid & own.heeds_lines.simd_gt(0.0))
}

/// Gap that driver `i` finds between the vehicle in a slot and the one ahead of it.
#[inline(always)]
pub fn room_ahead<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    slot: V<S>,
) -> V<S> {
    let [place, half_length] = pick_each!(w.count, slot, |j| [state.s[j], w.p[j].half_length]);
    let front = place + half_length;
    let mut room = splat(w.simd, FAR);
    for j in (0..w.count).filter(|j| *j != i) {
        let p = &w.p[j];
        let beyond = p.valid.simd_gt(0.0)
            & p.direction.simd_eq(w.p[i].direction)
            & state.s[j].simd_gt(place)
            & slot.simd_ne(j as i32 as f32);
        room = choose(
            beyond,
            min(room, (state.s[j] - p.half_length) - front),
            room,
        );
    }
    room
}

/// Whether the line is not to be crossed where driver `i` is, or at a way ahead of it.
#[inline(always)]
pub fn is_solid<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    ahead: V<S>,
) -> M<S> {
    let direction = w.p[i].direction;
    let ahead = direction * ahead;
    let [stations, along, against] = &w.road.ways.line;
    let turned = direction.simd_lt(0.0);
    let (place, _) = state.on_the_road(w, i);
    let mut solid = [splat(w.simd, 0.0); 2];
    for k in knots(stations) {
        let mark = choose(turned, splat(w.simd, against[k]), splat(w.simd, along[k]));
        for (solid, place) in solid.iter_mut().zip([place, place + ahead]) {
            *solid = choose(place.simd_ge(stations[k]), mark, *solid);
        }
    }
    solid[0].simd_gt(0.0) | solid[1].simd_gt(0.0)
}

/// How a driver in the other lane stands.
pub struct Plight<S: Simd> {
    /// It falls back behind the vehicle that it was to pass.
    pub yields: M<S>,
    /// It wants to be back soon.
    pub hurries: M<S>,
    /// It would take a small gap for that.
    pub pressed: M<S>,
    /// There is room behind that vehicle to fall in.
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
    let top = top_speed(state, w, i, other);
    let aside = 0.5 * w.q.hasty_change;
    let onwards = at_least(lead + bodies, 0.0);
    let accel = reckoned_accel(c, own, speed, top);
    let rest = time_to_gain(onwards, faster, top - other, accel) + aside;
    let brake = c.fall_back_share * own.hardest_decel;
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
    let trapped = no_time & (room.simd_lt(c.least_room) | too_slow);
    let yields = (gives_up | trapped | state.yields[i].simd_gt(0.0)) & out;
    let beyond = (out | in_stage(state, i, stage::RETURN)) & !yields;
    let pressed = beyond & ((there - rest).simd_lt(c.calm_margin) | cramped);
    let late = is_solid(state, w, i, at_least(speed, 0.0) * rest) & own.heeds_lines.simd_gt(0.0);
    Plight {
        yields,
        hurries: pressed | (beyond & late),
        pressed,
        fits: lead.simd_gt(bodies),
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
    let top = top_speed(state, w, i, next_one);
    let bodies = 2.0 * (mind.near.half_length[SLOW_LEAD] + own.half_length);
    let accel = reckoned_accel(c, own, state.vx[i], top);
    let longer = time_to_gain(gap + bodies + c.squeeze_gap, closing, top - next_one, accel);
    let longer = longer + 0.5 * w.q.hasty_change + c.calm_margin;
    let late = seen_ahead(own, coming).simd_lt(longer * coming.closing);
    let needed = needed_braking(c, state.vx[i], gap, closing, splat(w.simd, 0.0));
    past & late & needed.simd_ge(-(c.fall_back_share * own.hardest_decel))
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
    let beside = near.gap[SLOW_LEAD].simd_lt(w.c.squeeze_gap);
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
    let bodies = w.p[i].half_length + half_length + w.c.squeeze_gap;
    (place - state.s[i], bodies)
}

/// Where driver `i` may be held back: it falls back, or is in the other lane.
#[inline(always)]
pub fn is_held_back<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    state.yields[i].simd_gt(0.0) | in_stage(state, i, stage::PASS)
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
    let (c, own, near, believed) = (w.c, &w.p[i], mind.near, mind.believed);
    let (gap, closing) = (believed.gap[SLOW_LEAD], believed.closing[SLOW_LEAD]);
    let other = pick!(w.count, state.target[i], |j| state.road_velocity(j).0);
    let slow = state.road_velocity(i).0.simd_lt(other - c.fall_back_speed);
    let brake = choose(
        slow,
        splat(w.simd, 0.0),
        -(c.fall_back_share * own.hardest_decel),
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
        min(c.fit_share * own.time_gap, nearest),
        believed.accel[SLOW_LEAD],
    );
    let capped = choose(is_confined(state, w, i, mind), fitting, splat(w.simd, FAR));
    choose(state.yields[i].simd_gt(0.0), brake, capped)
}
