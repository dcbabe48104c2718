//! How the ego passes against oncoming traffic; see `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::ego::in_stage;
use crate::following::follow;
use crate::lanes::{M, V, at_least, choose, max, min, pick, pick_each, splat};
use crate::names::Vehicle;
use crate::neighbours::Neighbours;
use crate::oncoming::Oncoming;
use crate::perception::Beliefs;
use crate::state::{EGO, LEAD, SLOW_LEAD, State, World, stage};

const FAR: f32 = 1e9;
/// Least surplus of speed to be past with [m/s].
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

/// The speed that is passed at: well above that of the other, if the vehicle can.
#[inline(always)]
fn top_speed<S: Simd>(own: &Vehicle<S>, surplus: f32, leader: V<S>) -> V<S> {
    min(max(own.pass_speed, leader + surplus), own.max_speed)
}

/// The speed that an ego which passes wants now.
#[inline(always)]
pub fn speed_of_pass<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
) -> V<S> {
    let (c, own) = (w.c, &w.p[EGO]);
    let other = pick!(w.count, state.target, |j| state.road_velocity(j).0);
    let top = top_speed(own, c.passing_surplus, other);
    let hurried = choose(state.hurries.simd_gt(0.0), c.hurry_speed * top, top);
    min(hurried, own.max_speed)
}

/// The way up to who comes, or may come from where the road is not seen.
#[inline(always)]
fn seen_ahead<S: Simd, const N: usize>(w: &World<'_, S, N>, oncoming: &Oncoming<S>) -> V<S> {
    min(oncoming.believed_gap, w.c.unseen_trust * oncoming.sight)
}

/// How much more room drivers leave to the vehicle in a slot than to a car.
#[inline(always)]
pub fn room_left<S: Simd, const N: usize>(w: &World<'_, S, N>, slot: V<S>) -> V<S> {
    let tall = pick!(w.count, slot, |j| w.p[j].tall);
    let (more, same) = (splat(w.simd, w.c.tall_room), splat(w.simd, 1.0));
    choose(tall.simd_gt(0.0), more, same)
}

/// Whether the other lane is believed to be free for long enough: `believed` is the gap to the leader, and
/// its speed.
#[inline(always)]
pub fn may_meet<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    oncoming: &Oncoming<S>,
    (gap, leader): (V<S>, V<S>),
    impatience: V<S>,
) -> M<S> {
    let (c, q, own, speed) = (w.c, &w.q, &w.p[EGO], state.vx[EGO]);
    let bodies = 2.0 * (near.half_length[LEAD] + own.half_length);
    let returns = own.return_time_gap * impatience * room_left(w, near.slot[LEAD]) * leader;
    let way = gap + bodies + returns;
    let top = top_speed(own, c.passing_surplus, leader) - leader;
    let gaining = time_to_gain(way, speed - leader, top, c.accelerate_gain * own.accel);
    let need = q.need_factor * (gaining + own.lane_change_duration);
    let closing = oncoming.closing + 0.5 * at_least(top + leader - speed, 0.0);
    let spare = q.spare * at_least(impatience, c.spare_kept);
    let enough = seen_ahead(w, oncoming).simd_gt(need * (1.0 + spare) * closing);
    let room = room_ahead(state, w, near.slot[LEAD]);
    let least = 2.0 * own.half_length + c.squeeze_gap + returns;
    let room = room.simd_gt(least + c.fit_share * own.time_gap * leader);
    let solid = is_solid(state, w);
    enough & oncoming.sure & room & !(solid & q.heeds_lines.simd_gt(0.0))
}

/// Gap between the vehicle in a slot and the one ahead of it.
#[inline(always)]
pub fn room_ahead<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    slot: V<S>,
) -> V<S> {
    let [place, half_length] = pick_each!(w.count, slot, |j| [state.s[j], w.p[j].half_length]);
    let front = place + half_length;
    let mut room = splat(w.simd, FAR);
    for j in EGO + 1..w.count {
        let p = &w.p[j];
        let beyond = p.valid.simd_gt(0.0)
            & p.direction.simd_eq(w.p[EGO].direction)
            & state.s[j].simd_gt(place)
            & slot.simd_ne(j as f32);
        room = choose(
            beyond,
            min(room, (state.s[j] - p.half_length) - front),
            room,
        );
    }
    room
}

/// Whether the line is not to be crossed where the ego is, or soon will be.
#[inline(always)]
pub fn is_solid<S: Simd, const N: usize>(state: &State<'_, S, N>, w: &World<'_, S, N>) -> M<S> {
    let ahead = w.c.line_ahead * state.vx[EGO];
    let [stations, solid] = &w.road.ways.line;
    let at = |place: V<S>| {
        let mut here = splat(w.simd, 0.0);
        for (station, solid) in stations.iter().zip(solid) {
            here = choose(place.simd_ge(*station), splat(w.simd, *solid), here);
        }
        here.simd_gt(0.0)
    };
    at(state.s[EGO]) | at(state.s[EGO] + ahead)
}

/// How an ego in the other lane stands.
pub struct Plight<S: Simd> {
    /// It falls back behind the vehicle that it was to pass.
    pub yields: M<S>,
    /// It is short of time to be past.
    pub hurries: M<S>,
    /// There is room behind that vehicle to fall in.
    pub fits: M<S>,
}

/// Whether the ego goes on with its pass, and how.
#[inline(always)]
pub fn weigh<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    oncoming: &Oncoming<S>,
) -> Plight<S> {
    let (c, own) = (w.c, &w.p[EGO]);
    let out = is_passing(state);
    let other = pick!(w.count, state.target, |j| state.road_velocity(j).0);
    let speed = state.road_velocity(EGO).0;
    let (lead, bodies) = to_fall_in(state, w);
    let faster = speed - other;
    let top = top_speed(own, c.passing_surplus, other) - other;
    let aside = 0.5 * w.q.hasty_change;
    let onwards = at_least(lead + bodies, 0.0);
    let rest = time_to_gain(onwards, faster, top, c.accelerate_gain * own.accel) + aside;
    let brake = c.fall_back_share * own.hardest_decel;
    let backwards = at_least(bodies - lead, 0.0);
    let back = (faster + (faster * faster + 2.0 * brake * backwards).sqrt()) / brake + aside;
    let there = choose(
        oncoming.detected,
        oncoming.believed_gap / oncoming.closing,
        splat(w.simd, FAR),
    );
    let gives_up = lead.simd_gt(0.0) & (rest + c.abort_margin).simd_gt(there) & back.simd_lt(rest);
    let room = room_ahead(state, w, state.target);
    let room = room.simd_gt(2.0 * (own.half_length + c.squeeze_gap));
    let waits_no_more = there.simd_lt(back + c.calm_margin);
    let trapped = lead.simd_le(0.0) & oncoming.detected & !room & waits_no_more;
    let yields = (gives_up | trapped | state.yields.simd_gt(0.0)) & out;
    let hurries =
        (out | in_stage(state, stage::RETURN)) & !yields & (there - rest).simd_lt(c.calm_margin);
    Plight {
        yields,
        hurries,
        fits: lead.simd_gt(bodies),
    }
}

/// Whether the ego is on its way past another.
#[inline(always)]
fn is_passing<S: Simd, const N: usize>(state: &State<'_, S, N>) -> M<S> {
    in_stage(state, stage::PULL_OUT) | in_stage(state, stage::PASS)
}

/// Whether the ego of a two-way road can give up its pass: it is behind who is overtaken.
#[inline(always)]
pub fn can_fall_in<S: Simd, const N: usize>(state: &State<'_, S, N>, w: &World<'_, S, N>) -> M<S> {
    let (lead, bodies) = to_fall_in(state, w);
    is_passing(state) & lead.simd_gt(bodies)
}

/// How far ahead the target is, and has to be for the ego to fall in behind it [m].
#[inline(always)]
fn to_fall_in<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
) -> (V<S>, V<S>) {
    let [place, half_length] =
        pick_each!(w.count, state.target, |j| [state.s[j], w.p[j].half_length]);
    let bodies = w.p[EGO].half_length + half_length + w.c.squeeze_gap;
    (place - state.s[EGO], bodies)
}

/// The acceleration that an ego in the other lane does not go beyond: falling back, or fitting in
/// where no time is left to pass the next one, too.
#[inline(always)]
pub fn held_back<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    oncoming: &Oncoming<S>,
    believed: &Beliefs<S>,
) -> V<S> {
    let (c, own) = (w.c, &w.p[EGO]);
    let (gap, closing) = (believed.gap[SLOW_LEAD], believed.closing[SLOW_LEAD]);
    let [other, place] = pick_each!(w.count, state.target, |j| [
        state.road_velocity(j).0,
        state.s[j]
    ]);
    let slow = state
        .road_velocity(EGO)
        .0
        .simd_lt(other - c.fall_back_speed);
    let brake = choose(
        slow,
        splat(w.simd, 0.0),
        -(c.fall_back_share * own.hardest_decel),
    );
    let past = in_stage(state, stage::PASS) & state.s[EGO].simd_gt(place);
    let next_one = state.vx[EGO] - closing;
    let top = top_speed(own, c.passing_surplus, next_one) - next_one;
    let onwards = gap + 2.0 * (near.half_length[SLOW_LEAD] + own.half_length) + c.squeeze_gap;
    let longer = time_to_gain(onwards, closing, top, c.accelerate_gain * own.accel);
    let longer = longer + 0.5 * w.q.hasty_change + c.calm_margin;
    let fits_in = past & seen_ahead(w, oncoming).simd_lt(longer * oncoming.closing);
    let fitting = follow(
        c,
        own,
        state.vx[EGO],
        speed_of_pass(state, w),
        gap,
        closing,
        c.fit_share * own.time_gap,
        believed.accel[SLOW_LEAD],
    );
    let capped = choose(fits_in, fitting, splat(w.simd, FAR));
    choose(state.yields.simd_gt(0.0), brake, capped)
}
