//! Whether drivers pass against oncoming traffic, the ego and the others alike; see `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{F32, Mask, at_least, at_slot, each_at_slot, max, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};
use crate::neighbour_search::Neighbours;
use crate::oncoming::OncomingVehicle;
use crate::params::{Params, station_indices};
use crate::state::LEADER;
use crate::vehicle_handle::VehicleHandle;

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

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The speed that driver `i` passes at: well above that of the other, if the vehicle can; the limit counts as on a free road.
    #[inline(always)]
    fn passing_speed(self, leader: F32<S>) -> F32<S> {
        let params = self.params;
        let wanted = max(
            self.desired_passing_speed(),
            leader + params.constants.passing_speed_surplus,
        );
        let excess = at_least(wanted - self.speed_limit(), 0.0);
        let heeded = wanted - self.vehicle().speed_limit_compliance * excess;
        min(heeded, self.vehicle().max_speed)
    }

    /// The speed that driver `i` wants now, if it passes.
    #[inline(always)]
    pub fn current_passing_speed(self) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, own) = (&params.constants, self.vehicle());
        let other = at_slot!(
            params.num_slots_in_use,
            state.overtake.target_slot[slot],
            |j| self.other(j).road_velocity().0
        );
        let top = self.passing_speed(other);
        let hurried = select(
            state.overtake.must_return_urgently[slot].simd_gt(0.0),
            constants.urgent_speed_factor * top,
            top,
        );
        min(hurried, own.max_speed)
    }

    /// How long driver `i` reckons to take to gain a way on another: from its own speed, and how much faster that is,
    /// and the speed of the other.
    #[inline(always)]
    pub fn time_to_pass(
        self,
        way: F32<S>,
        (speed, faster): (F32<S>, F32<S>),
        other: F32<S>,
    ) -> F32<S> {
        let params = self.params;
        let top = self.passing_speed(other);
        let accel = expected_accel(&params.constants, self.vehicle(), speed, top);
        time_to_gain(way, faster, top - other, accel)
    }
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

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Whether the other lane is believed to be free for long enough by driver `i`, who believes the leader to be
    /// at a gap, and at a speed.
    #[inline(always)]
    pub fn accepts_oncoming_gap(
        self,
        near: &Neighbours<S>,
        coming: &OncomingVehicle<S>,
        (gap, leader): (F32<S>, F32<S>),
        impatience: F32<S>,
    ) -> Mask<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (constants, own, speed) = (&params.constants, self.vehicle(), state.motion.vx[slot]);
        let bodies = 2.0 * (near.half_length[LEADER] + own.half_length);
        let returns = own.return_time_gap
            * impatience
            * tall_vehicle_gap_factor(params, near.slot[LEADER])
            * leader;
        let way = gap + bodies + returns;
        let top = self.passing_speed(leader);
        let gaining = self.time_to_pass(way, (speed, speed - leader), leader);
        let need = own.passing_time_factor * (gaining + own.lane_change_duration);
        let closing = coming.closing_speed + 0.5 * at_least(top - speed, 0.0);
        let spare = own.time_reserve_share * at_least(impatience, constants.min_time_reserve_share);
        let enough = assumed_oncoming_gap(own, coming).simd_gt(need * (1.0 + spare) * closing);
        let room = self.gap_ahead_of(near.slot[LEADER]);
        let least = 2.0 * own.half_length + constants.min_return_gap + returns;
        let room = room.simd_gt(least + constants.return_time_gap_share * own.time_gap * leader);
        let solid = self.line_is_solid(splat(params.simd, constants.line_lookahead));
        enough & coming.is_certain & room & !(solid & own.heeds_solid_lines.simd_gt(0.0))
    }

    /// Gap that driver `i` finds between the vehicle in a slot and the one ahead of it.
    #[inline(always)]
    pub fn gap_ahead_of(self, other_slot: F32<S>) -> F32<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let [place, half_length] = each_at_slot!(params.num_slots_in_use, other_slot, |j| [
            state.motion.s[j],
            params.vehicles[j].half_length
        ]);
        let front = place + half_length;
        let mut room = splat(params.simd, FAR);
        for j in (0..params.num_slots_in_use).filter(|j| *j != slot) {
            let vehicle = &params.vehicles[j];
            let beyond = vehicle.valid.simd_gt(0.0)
                & vehicle.travel_sign.simd_eq(self.vehicle().travel_sign)
                & state.motion.s[j].simd_gt(place)
                & other_slot.simd_ne(j as i32 as f32);
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
    pub fn line_is_solid(self, ahead: F32<S>) -> Mask<S> {
        let params = self.params;
        let direction = self.vehicle().travel_sign;
        let ahead = direction * ahead;
        let [stations, along, against] = &params.road.directions.solid_line;
        let turned = direction.simd_lt(0.0);
        let (place, _) = self.road_position();
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
}
