//! Whether drivers pass against oncoming traffic, the ego and the others alike; see `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{F32, Mask, at_least, at_slot, each_at_slot, max, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};
use crate::neighbour_search::Neighbours;
use crate::oncoming::OncomingVehicle;
use crate::params::{Params, station_indices};
use crate::state::{LEADER, State};

const FAR: f32 = 1e9;
/// Least surplus of speed to be past with, and of approach [m/s].
pub const MIN_CLOSING_SPEED: f32 = 0.5;
/// Keeps the time of accelerating finite [m/s^2].
const MIN_ACCEL: f32 = 0.1;

/// Time to gain a way on another vehicle, at constant acceleration up to a top speed.
#[inline(always)]
fn time_to_gain<S: Simd>(way: F32<S>, faster: F32<S>, top: F32<S>, accel: F32<S>) -> F32<S> {
    let (a, most) = (at_least(accel, MIN_ACCEL), at_least(top, MIN_CLOSING_SPEED));
    let v = min(at_least(faster, 0.0), most);
    let ramp = (most - v) / a;
    let covered = 0.5 * (v + most) * ramp;
    let within = ((v * v + 2.0 * a * way).sqrt() - v) / a;
    select(way.simd_lt(covered), within, ramp + (way - covered) / most)
}

/// The acceleration that a driver reckons with on the way up to a speed: what it likes to use, and no more
/// than the engine leaves halfway.
#[inline(always)]
fn expected_accel<S: Simd>(
    constants: &ModelConstants,
    own: &VehicleParams<S>,
    speed: F32<S>,
    top: F32<S>,
) -> F32<S> {
    let halfway = 0.5 * (speed + max(top, speed));
    let engine = min(
        own.launch_force,
        own.power / at_least(halfway, constants.slip_speed),
    );
    let left = (engine - (own.drag * halfway * halfway + own.rolling)) * own.inverse_mass;
    min(constants.accelerate_gain * own.accel, left)
}

/// The speed that driver `i` passes at: well above that of the other, if the vehicle can; the limit counts as on a free road.
#[inline(always)]
fn passing_speed<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    leader: F32<S>,
) -> F32<S> {
    let wanted = max(
        state.passing_speed(params, i),
        leader + params.constants.passing_speed_surplus,
    );
    let excess = at_least(wanted - state.speed_limit(params, i), 0.0);
    let heeded = wanted - params.vehicles[i].speed_limit_compliance * excess;
    min(heeded, params.vehicles[i].max_speed)
}

/// The speed that driver `i` wants now, if it passes.
#[inline(always)]
pub fn current_passing_speed<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
) -> F32<S> {
    let (constants, own) = (&params.constants, &params.vehicles[i]);
    let other = at_slot!(
        params.num_slots_in_use,
        state.overtake.target_slot[i],
        |j| state.road_velocity(j).0
    );
    let top = passing_speed(state, params, i, other);
    let hurried = select(
        state.overtake.must_return_urgently[i].simd_gt(0.0),
        constants.urgent_speed_factor * top,
        top,
    );
    min(hurried, own.max_speed)
}

/// How long driver `i` reckons to take to gain a way on another: from its own speed, and how much faster that is,
/// and the speed of the other.
#[inline(always)]
pub fn time_to_pass<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    way: F32<S>,
    (speed, faster): (F32<S>, F32<S>),
    other: F32<S>,
) -> F32<S> {
    let top = passing_speed(state, params, i, other);
    let accel = expected_accel(&params.constants, &params.vehicles[i], speed, top);
    time_to_gain(way, faster, top - other, accel)
}

/// The way up to who comes, or may come from where the road is not seen.
#[inline(always)]
pub fn assumed_oncoming_gap<S: Simd>(
    own: &VehicleParams<S>,
    coming: &OncomingVehicle<S>,
) -> F32<S> {
    min(
        coming.believed_gap,
        own.assumed_sight_factor * coming.sight_distance,
    )
}

/// How much more room drivers leave to the vehicle in a slot than to a car.
#[inline(always)]
pub fn tall_vehicle_gap_factor<S: Simd, const N: usize>(
    params: &Params<S, N>,
    slot: F32<S>,
) -> F32<S> {
    let tall = at_slot!(params.num_slots_in_use, slot, |j| params.vehicles[j]
        .blocks_view);
    let (more, same) = (
        splat(params.simd, params.constants.tall_vehicle_gap_factor),
        splat(params.simd, 1.0),
    );
    select(tall.simd_gt(0.0), more, same)
}

/// Whether the other lane is believed to be free for long enough by driver `i`, who believes the leader to be
/// at a gap, and at a speed.
#[inline(always)]
pub fn accepts_oncoming_gap<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    near: &Neighbours<S>,
    coming: &OncomingVehicle<S>,
    (gap, leader): (F32<S>, F32<S>),
    impatience: F32<S>,
) -> Mask<S> {
    let (constants, own, speed) = (&params.constants, &params.vehicles[i], state.motion.vx[i]);
    let bodies = 2.0 * (near.half_length[LEADER] + own.half_length);
    let returns = own.return_time_gap
        * impatience
        * tall_vehicle_gap_factor(params, near.slot[LEADER])
        * leader;
    let way = gap + bodies + returns;
    let top = passing_speed(state, params, i, leader);
    let gaining = time_to_pass(state, params, i, way, (speed, speed - leader), leader);
    let need = own.passing_time_factor * (gaining + own.lane_change_duration);
    let closing = coming.closing_speed + 0.5 * at_least(top - speed, 0.0);
    let spare = own.time_reserve_share * at_least(impatience, constants.min_time_reserve_share);
    let enough = assumed_oncoming_gap(own, coming).simd_gt(need * (1.0 + spare) * closing);
    let room = gap_ahead_of(state, params, i, near.slot[LEADER]);
    let least = 2.0 * own.half_length + constants.min_return_gap + returns;
    let room = room.simd_gt(least + constants.return_time_gap_share * own.time_gap * leader);
    let solid = line_is_solid(
        state,
        params,
        i,
        splat(params.simd, constants.line_lookahead),
    );
    enough & coming.is_certain & room & !(solid & own.heeds_solid_lines.simd_gt(0.0))
}

/// Gap that driver `i` finds between the vehicle in a slot and the one ahead of it.
#[inline(always)]
pub fn gap_ahead_of<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    slot: F32<S>,
) -> F32<S> {
    let [place, half_length] = each_at_slot!(params.num_slots_in_use, slot, |j| [
        state.motion.s[j],
        params.vehicles[j].half_length
    ]);
    let front = place + half_length;
    let mut room = splat(params.simd, FAR);
    for j in (0..params.num_slots_in_use).filter(|j| *j != i) {
        let vehicle = &params.vehicles[j];
        let beyond = vehicle.valid.simd_gt(0.0)
            & vehicle.travel_sign.simd_eq(params.vehicles[i].travel_sign)
            & state.motion.s[j].simd_gt(place)
            & slot.simd_ne(j as i32 as f32);
        room = select(
            beyond,
            min(room, (state.motion.s[j] - vehicle.half_length) - front),
            room,
        );
    }
    room
}

/// Whether the line is not to be crossed where driver `i` is, or at a way ahead of it.
#[inline(always)]
pub fn line_is_solid<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    i: usize,
    ahead: F32<S>,
) -> Mask<S> {
    let direction = params.vehicles[i].travel_sign;
    let ahead = direction * ahead;
    let [stations, along, against] = &params.road.directions.solid_line;
    let turned = direction.simd_lt(0.0);
    let (place, _) = state.road_position(params, i);
    let mut solid = [splat(params.simd, 0.0); 2];
    for k in station_indices(stations) {
        let mark = select(
            turned,
            splat(params.simd, against[k]),
            splat(params.simd, along[k]),
        );
        for (solid, place) in solid.iter_mut().zip([place, place + ahead]) {
            *solid = select(place.simd_ge(stations[k]), mark, *solid);
        }
    }
    solid[0].simd_gt(0.0) | solid[1].simd_gt(0.0)
}
