//! Whether drivers pass against oncoming traffic, by distance, passing time and sight; the twin of
//! `overtaking.sim.reference.passing`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::decision_context::DriverContext;
use crate::gap_acceptance::GapAcceptanceInputs;
use crate::math::vectors::{F32, Mask, at_least, at_slot, each_at_slot, max, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};
use crate::oncoming::OncomingVehicle;
use crate::params::{LineMarks, Params, station_indices};
use crate::state::{FAR, LEADER};
use crate::vehicle_handle::VehicleHandle;

/// Smallest closing speed, which keeps the times of passing and of meeting finite [m/s].
pub const MIN_CLOSING_SPEED: f32 = 0.5;
/// Smallest acceleration, which keeps the time of accelerating finite [m/s^2].
const MIN_ACCEL: f32 = 0.1;

/// Speeds of a passing driver and its target [m/s].
pub struct PassingSpeeds<S: Simd> {
    /// Speed of the passing driver.
    pub passer: F32<S>,
    /// Speed of the vehicle that it passes.
    pub target: F32<S>,
    /// The first minus the second. A field of its own, because a believed closing speed differs in its last bits from
    /// the difference of the speeds.
    pub closing: F32<S>,
}

/// Time to gain a distance [m] on another vehicle, at constant acceleration up to a speed [s].
///
/// `closing_speed` and `max_closing_speed` are the present and the largest speed minus the other vehicle's [m/s].
#[inline(always)]
fn time_to_gain<S: Simd>(
    distance: F32<S>,
    closing_speed: F32<S>,
    max_closing_speed: F32<S>,
    accel: F32<S>,
) -> F32<S> {
    let a = at_least(accel, MIN_ACCEL);
    let v_max = at_least(max_closing_speed, MIN_CLOSING_SPEED);
    let v = min(at_least(closing_speed, 0.0), v_max);
    let ramp_time = (v_max - v) / a;
    let ramp_distance = 0.5 * (v + v_max) * ramp_time;
    // The driver gains the distance while it still accelerates, or at its largest speed after the ramp.
    let time_within_ramp = ((v * v + 2.0 * a * distance).sqrt() - v) / a;
    select(
        distance.simd_lt(ramp_distance),
        time_within_ramp,
        ramp_time + (distance - ramp_distance) / v_max,
    )
}

/// Acceleration that drivers expect on the way up to their passing speed [m/s^2].
///
/// It is the acceleration that they like to use, limited to what the engine can give halfway.
#[inline(always)]
fn expected_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    passing_speed: F32<S>,
) -> F32<S> {
    let halfway = 0.5 * (speed + max(passing_speed, speed));
    let engine_force = min(
        vehicle.launch_force,
        vehicle.power / at_least(halfway, constants.slip_speed),
    );
    let surplus = engine_force - (vehicle.drag * halfway * halfway + vehicle.rolling);
    min(
        constants.accelerate_gain * vehicle.accel,
        surplus * vehicle.inverse_mass,
    )
}

/// Distance at which a driver assumes an oncoming vehicle, seen or not [m].
///
/// Few drivers assume a vehicle at the very end of the visible road: one that does come from there comes into sight
/// while they pass.
#[inline(always)]
pub fn assumed_oncoming_gap<S: Simd>(
    vehicle: &VehicleParams<S>,
    oncoming: &OncomingVehicle<S>,
) -> F32<S> {
    min(
        oncoming.believed_gap,
        vehicle.assumed_sight_factor * oncoming.sight_distance,
    )
}

/// Factor on the gap that drivers keep to the vehicle in a slot: above 1 if no driver sees over that vehicle, else 1
/// [1].
#[inline(always)]
pub fn tall_vehicle_gap_factor<S: Simd, const N: usize>(
    params: &Params<S, N>,
    slot: F32<S>,
) -> F32<S> {
    let blocks_view = at_slot!(params, slot, |j| params.vehicles[j].blocks_view);
    select(
        blocks_view.simd_gt(0.0),
        splat(params.simd, params.constants.tall_vehicle_gap_factor),
        splat(params.simd, 1.0),
    )
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// Speed at which the driver passes: well above the target's, if the vehicle can reach it [m/s].
    ///
    /// A driver that complies with the speed limit on a free road complies as much while it passes, and takes longer.
    #[inline(always)]
    fn passing_speed(self, target_speed: F32<S>) -> F32<S> {
        let vehicle = self.vehicle();
        let unlimited = max(
            self.desired_passing_speed(),
            target_speed + self.params.constants.passing_speed_surplus,
        );
        let excess = at_least(unlimited - self.speed_limit(), 0.0);
        let limited = unlimited - vehicle.speed_limit_compliance * excess;
        min(limited, vehicle.max_speed)
    }

    /// Speed along the road of the vehicle that the driver overtakes [m/s].
    #[inline(always)]
    pub fn target_speed(self) -> F32<S> {
        let target_slot = self.state.overtake.target_slot[self.slot];
        self.state.road_speed_at(self.params, target_slot)
    }

    /// Speed that the passing driver desires now; higher in urgency [m/s].
    #[inline(always)]
    pub fn current_passing_speed(self) -> F32<S> {
        let usual = self.passing_speed(self.target_speed());
        let is_urgent = self.state.overtake.must_return_urgently[self.slot].simd_gt(0.0);
        let urgent = self.params.constants.urgent_speed_factor * usual;
        min(select(is_urgent, urgent, usual), self.vehicle().max_speed)
    }

    /// Time that the driver expects to need to gain a distance on its target [s].
    #[inline(always)]
    pub fn time_to_pass(self, distance: F32<S>, speeds: &PassingSpeeds<S>) -> F32<S> {
        let passing_speed = self.passing_speed(speeds.target);
        let accel = expected_accel(
            &self.params.constants,
            self.vehicle(),
            speeds.passer,
            passing_speed,
        );
        time_to_gain(
            distance,
            speeds.closing,
            passing_speed - speeds.target,
            accel,
        )
    }

    /// Whether the driver believes that the opposing lane is free for long enough.
    ///
    /// It compares the passing time, as it misjudges it and with a reserve, with the time until it meets the nearest
    /// oncoming vehicle. Where it does not see the road it assumes an oncoming vehicle. A pass has half a lane change
    /// before the driver gains on its target, and half a lane change at the end. A waiting driver keeps a smaller
    /// reserve, but not less than a share of its first one.
    #[inline(always)]
    pub fn accepts_oncoming_gap(
        self,
        context: &DriverContext<S>,
        inputs: &GapAcceptanceInputs<'_, S>,
    ) -> Mask<S> {
        let (params, vehicle) = (self.params, self.vehicle());
        let constants = &params.constants;
        let (neighbours, oncoming) = (&context.neighbours, &context.oncoming.nearest);
        let (leader_slot, leader_speed) = (neighbours.slot[LEADER], inputs.leader_speed);
        let (speed, patience_left) = (inputs.speed, inputs.patience_left);
        let lengths = 2.0 * (neighbours.half_length[LEADER] + vehicle.half_length);
        let return_gap = vehicle.return_time_gap
            * patience_left
            * tall_vehicle_gap_factor(params, leader_slot)
            * leader_speed;
        let distance = inputs.beliefs.gap[LEADER] + lengths + return_gap;
        let passing_speed = self.passing_speed(leader_speed);
        let speeds = PassingSpeeds {
            passer: speed,
            target: leader_speed,
            closing: speed - leader_speed,
        };
        let gaining_time = self.time_to_pass(distance, &speeds);
        let time = vehicle.passing_time_factor * (gaining_time + vehicle.lane_change_duration);
        // On average over its acceleration the driver is half of the gained speed faster.
        let closing_speed = oncoming.closing_speed + 0.5 * at_least(passing_speed - speed, 0.0);
        let reserve =
            vehicle.time_reserve_share * at_least(patience_left, constants.min_time_reserve_share);
        let has_time =
            assumed_oncoming_gap(vehicle, oncoming).simd_gt(time * (1.0 + reserve) * closing_speed);
        let min_gap = 2.0 * vehicle.half_length + constants.min_return_gap + return_gap;
        let time_gap = constants.return_time_gap_share * vehicle.time_gap;
        let fits_ahead = self
            .gap_ahead_of(leader_slot)
            .simd_gt(min_gap + time_gap * leader_speed);
        let line_is_solid = self.line_is_solid(splat(params.simd, constants.line_lookahead));
        let heeds_line = line_is_solid & vehicle.heeds_solid_lines.simd_gt(0.0);
        has_time & oncoming.is_certain & fits_ahead & !heeds_line
    }

    /// Gap between the vehicle in `other_slot` and the next vehicle ahead of it; this driver's own does not count [m].
    #[inline(always)]
    pub fn gap_ahead_of(self, other_slot: F32<S>) -> F32<S> {
        let (s, params) = (&self.state.motion.s, self.params);
        let [centre, half_length] = each_at_slot!(params, other_slot, |j| [
            s[j],
            params.vehicles[j].half_length
        ]);
        let front = centre + half_length;
        let mut gap = splat(params.simd, FAR);
        for j in (0..params.num_slots_in_use).filter(|j| *j != self.slot) {
            let vehicle = &params.vehicles[j];
            let is_ahead = vehicle.valid.simd_gt(0.0)
                & vehicle.travel_sign.simd_eq(self.vehicle().travel_sign)
                & s[j].simd_gt(centre)
                & other_slot.simd_ne(j as i32 as f32);
            gap = select(
                is_ahead,
                min(gap, (s[j] - vehicle.half_length) - front),
                gap,
            );
        }
        gap
    }

    /// Whether the line between the directions is solid at the driver, or at a distance ahead of it.
    #[inline(always)]
    pub fn line_is_solid(self, distance: F32<S>) -> Mask<S> {
        let (params, travel_sign) = (self.params, self.vehicle().travel_sign);
        let LineMarks {
            stations,
            is_solid_along,
            is_solid_against,
        } = &params.road.directions.line_marks;
        let is_oncoming = travel_sign.simd_lt(0.0);
        let (s, _) = self.road_position();
        let places = [s, s + travel_sign * distance];
        let mut is_solid = [splat(params.simd, 0.0); 2];
        for k in station_indices(stations) {
            let mark = select(
                is_oncoming,
                splat(params.simd, is_solid_against[k]),
                splat(params.simd, is_solid_along[k]),
            );
            for (is_solid, place) in is_solid.iter_mut().zip(places) {
                *is_solid = select(place.simd_ge(stations[k]), mark, *is_solid);
            }
        }
        is_solid[0].simd_gt(0.0) | is_solid[1].simd_gt(0.0)
    }
}
