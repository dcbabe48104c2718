//! Whether drivers pass against oncoming traffic, the ego and the others alike; see `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, V, at_least, choose, max, min, pick, pick_each, splat};
use crate::names::{Constants, Vehicle};
use crate::neighbours::Neighbours;
use crate::oncoming::Oncoming;
use crate::state::{LEAD, State};
use crate::world::{World, station_indices};

const FAR: f32 = 1e9;
/// Least surplus of speed to be past with, and of approach [m/s].
pub const SLOWEST: f32 = 0.5;
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
    let wanted = max(state.pass_speed(w, i), leader + w.c.passing_speed_surplus);
    let excess = at_least(wanted - state.limit(w, i), 0.0);
    let heeded = wanted - w.p[i].speed_limit_compliance * excess;
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
    let hurried = choose(
        state.hurries[i].simd_gt(0.0),
        c.urgent_speed_factor * top,
        top,
    );
    min(hurried, own.max_speed)
}

/// How long driver `i` reckons to take to gain a way on another: from its own speed, and how much faster that is,
/// and the speed of the other.
#[inline(always)]
pub fn time_to_pass<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    way: V<S>,
    (speed, faster): (V<S>, V<S>),
    other: V<S>,
) -> V<S> {
    let top = top_speed(state, w, i, other);
    let accel = reckoned_accel(w.c, &w.p[i], speed, top);
    time_to_gain(way, faster, top - other, accel)
}

/// The way up to who comes, or may come from where the road is not seen.
#[inline(always)]
pub fn seen_ahead<S: Simd>(own: &Vehicle<S>, coming: &Oncoming<S>) -> V<S> {
    min(coming.believed_gap, own.assumed_sight_factor * coming.sight)
}

/// How much more room drivers leave to the vehicle in a slot than to a car.
#[inline(always)]
pub fn room_left<S: Simd, const N: usize>(w: &World<'_, S, N>, slot: V<S>) -> V<S> {
    let tall = pick!(w.count, slot, |j| w.p[j].blocks_view);
    let (more, same) = (
        splat(w.simd, w.c.tall_vehicle_gap_factor),
        splat(w.simd, 1.0),
    );
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
    let gaining = time_to_pass(state, w, i, way, (speed, speed - leader), leader);
    let need = own.passing_time_factor * (gaining + own.lane_change_duration);
    let closing = coming.closing + 0.5 * at_least(top - speed, 0.0);
    let spare = own.time_reserve_share * at_least(impatience, c.min_time_reserve_share);
    let enough = seen_ahead(own, coming).simd_gt(need * (1.0 + spare) * closing);
    let room = room_ahead(state, w, i, near.slot[LEAD]);
    let least = 2.0 * own.half_length + c.min_return_gap + returns;
    let room = room.simd_gt(least + c.return_time_gap_share * own.time_gap * leader);
    let solid = is_solid(state, w, i, splat(w.simd, c.line_lookahead));
    enough & coming.sure & room & !(solid & own.heeds_solid_lines.simd_gt(0.0))
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
            & p.travel_sign.simd_eq(w.p[i].travel_sign)
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
    let direction = w.p[i].travel_sign;
    let ahead = direction * ahead;
    let [stations, along, against] = &w.road.ways.solid_line;
    let turned = direction.simd_lt(0.0);
    let (place, _) = state.on_the_road(w, i);
    let mut solid = [splat(w.simd, 0.0); 2];
    for k in station_indices(stations) {
        let mark = choose(turned, splat(w.simd, against[k]), splat(w.simd, along[k]));
        for (solid, place) in solid.iter_mut().zip([place, place + ahead]) {
            *solid = choose(place.simd_ge(stations[k]), mark, *solid);
        }
    }
    solid[0].simd_gt(0.0) | solid[1].simd_gt(0.0)
}
