//! Whether drivers pass against oncoming traffic, by distance, passing time and sight; the twin of
//! `overtaking.sim.reference.passing`.
//!
//! The leader is the vehicle ahead in a driver's lane, the target the vehicle that it overtakes. The return gap is the
//! gap to the target that the driver leaves behind itself when it returns.
//!
//! Values of type `F32<S>` and `Mask<S>` have one element for each simulation of a block, the simulations that are
//! computed together. `VehicleHandle` is a view of one driver in them. `N` is the number of slots, the vehicles that a
//! simulation can have. `at_slot!` and `each_at_slot!` read values of the vehicle whose slot they get.

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

/// Smallest speed difference with which drivers compute the time of a pass or a meeting [m/s].
///
/// Smaller differences count as this one, so that the times stay finite. Chosen: it matters only for vehicles of nearly
/// equal speed.
pub const MIN_CLOSING_SPEED: f32 = 0.5;
/// Smallest acceleration with which drivers compute the time of a pass [m/s^2].
///
/// It keeps this time finite where a slow vehicle cannot accelerate. Chosen.
const MIN_ACCEL: f32 = 0.1;

/// Speeds of a passing driver and its target [m/s].
pub struct PassingSpeeds<S: Simd> {
    /// Speed of the passing driver.
    pub passer: F32<S>,
    /// Speed of the vehicle that it passes.
    pub target: F32<S>,
    /// `passer` minus `target`, a field of its own because of rounding: a driver may believe a closing speed, from
    /// which the target's speed is computed.
    pub closing: F32<S>,
}

/// Time to gain a distance [m] on another vehicle, accelerating up to a top speed [s].
///
/// `closing_speed` and `max_closing_speed` are the present and the top speed minus the other vehicle's [m/s].
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
    // Solves distance = v t + a t^2 / 2.
    let time_on_ramp = ((v * v + 2.0 * a * distance).sqrt() - v) / a;
    select(
        distance.simd_lt(ramp_distance),
        time_on_ramp,
        ramp_time + (distance - ramp_distance) / v_max,
    )
}

/// Acceleration that drivers expect on the way up to their passing speed [m/s^2].
///
/// Passing drivers accelerate more than followers, by the factor `accelerate_gain`. The engine limits them to its force
/// at the mean of the present speed and the passing speed: for constant power this mean gives the exact time.
/// `slip_speed` bounds it from below. Drivers know the power of their vehicle. They misjudge the time of a pass by the
/// trait `passing_time_factor`, which is not part of this acceleration.
#[inline(always)]
fn expected_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    passing_speed: F32<S>,
) -> F32<S> {
    let mean_speed = 0.5 * (speed + max(passing_speed, speed));
    let engine_force = min(
        vehicle.launch_force,
        vehicle.power / at_least(mean_speed, constants.slip_speed),
    );
    let force = engine_force - (vehicle.drag * mean_speed * mean_speed + vehicle.rolling);
    min(
        constants.accelerate_gain * vehicle.accel,
        force * vehicle.inverse_mass,
    )
}

/// Distance at which a driver assumes an oncoming vehicle, seen or not [m].
///
/// Where the road is hidden, a driver assumes a vehicle at a multiple of the sight distance. The factor
/// `assumed_sight_factor` is above 1 for most drivers: few believe that a vehicle is just beyond the visible road.
#[inline(always)]
pub fn assumed_oncoming_gap<S: Simd>(
    vehicle: &VehicleParams<S>,
    oncoming: &OncomingVehicle<S>,
) -> F32<S> {
    // Without a detected vehicle the believed gap is the range to which drivers look.
    min(
        oncoming.believed_gap,
        vehicle.assumed_sight_factor * oncoming.sight_distance,
    )
}

/// Factor on the gap that drivers keep to the vehicle in a slot, 1 for a car [1].
///
/// Drivers keep longer gaps to a vehicle that blocks the view: behind it, to see past it, and ahead of it at the
/// return, because it brakes worse. The number is fitted.
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
        // `desired_passing_speed` is the speed at which the driver desires to pass any vehicle.
        let speed = max(
            self.desired_passing_speed(),
            target_speed + self.params.constants.passing_speed_surplus,
        );
        // The compliance is the share of the excess over the limit that the driver gives up, 0 to 1.
        let excess = at_least(speed - self.speed_limit(), 0.0);
        min(
            speed - vehicle.speed_limit_compliance * excess,
            vehicle.max_speed,
        )
    }

    /// Speed along the road of the vehicle that the driver overtakes [m/s].
    #[inline(always)]
    pub fn target_speed(self) -> F32<S> {
        let target_slot = self.state.overtake.target_slot[self.slot];
        self.state.road_speed_at(self.params, target_slot)
    }

    /// Speed that the passing driver wants now [m/s].
    ///
    /// It is higher while the driver returns urgently, because an oncoming vehicle or a solid line is near.
    #[inline(always)]
    pub fn current_passing_speed(self) -> F32<S> {
        let usual = self.passing_speed(self.target_speed());
        let is_urgent = self.state.overtake.must_return_urgently[self.slot].simd_gt(0.0);
        let urgent = self.params.constants.urgent_speed_factor * usual;
        min(select(is_urgent, urgent, usual), self.vehicle().max_speed)
    }

    /// Time that the driver expects to need to gain a distance on its target [s].
    ///
    /// The trait `passing_time_factor`, by which it misjudges this time, is not applied here.
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
    /// It compares the time that passing takes, with its error about it and a reserve, with the time until it meets the
    /// nearest oncoming vehicle. Beyond its sight distance it assumes one. To the time of gaining on the leader it adds
    /// one lane change: half of it passes before the driver gains speed, half during the return. A waiting driver asks
    /// for less return gap and a smaller reserve: `patience_left` is the share that it still asks for, 1 at first. The
    /// reserve does not fall below a share of its first value, because drivers expect no oncoming vehicle to brake.
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
        // The present closing speed is too low (without a detected vehicle, it assumes one at the usual speed): on
        // average over the pass, the driver is faster by half of its gain in speed.
        let closing_speed = oncoming.closing_speed + 0.5 * at_least(passing_speed - speed, 0.0);
        let reserve =
            vehicle.time_reserve_share * at_least(patience_left, constants.min_time_reserve_share);
        let has_time =
            assumed_oncoming_gap(vehicle, oncoming).simd_gt(time * (1.0 + reserve) * closing_speed);
        // Ahead of the leader lie, one after the other, the return gap, the driver's vehicle, and its smallest gap and
        // a share of its time gap to the next vehicle.
        let min_gap = 2.0 * vehicle.half_length + constants.min_return_gap + return_gap;
        let time_gap = constants.return_time_gap_share * vehicle.time_gap;
        let fits_ahead = self
            .gap_ahead_of(leader_slot)
            .simd_gt(min_gap + time_gap * leader_speed);
        let line_is_solid = self.line_is_solid(splat(params.simd, constants.line_lookahead));
        let is_kept_by_line = line_is_solid & vehicle.heeds_solid_lines.simd_gt(0.0);
        // `is_certain`: the driver has looked long enough to know if a vehicle is coming.
        has_time & oncoming.is_certain & fits_ahead & !is_kept_by_line
    }

    /// Gap between the vehicle in `other_slot` and the next vehicle ahead of it; this driver's own does not count [m].
    ///
    /// The vehicle in `other_slot` travels in the driver's direction. The next vehicle may be in any lane, also in the
    /// opposing lane while it passes. Without one the gap is `FAR`.
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
            // Stations grow in each vehicle's direction of travel. No vehicle is ahead of its own centre; the
            // comparison of slots changes nothing.
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

    /// Whether the line between the directions is solid at the driver, or at a distance [m] ahead of it.
    ///
    /// A solid piece that begins and ends between the two places is overlooked.
    #[inline(always)]
    pub fn line_is_solid(self, distance: F32<S>) -> Mask<S> {
        let (params, travel_sign) = (self.params, self.vehicle().travel_sign);
        let LineMarks {
            stations,
            is_solid_along,
            is_solid_against,
        } = &params.road.directions.line_marks;
        // Lines have stations of the road, which `road_position` gives; `motion.s` grows in each vehicle's direction of
        // travel. The sign is 1 along the road and -1 against it.
        let is_against_road = travel_sign.simd_lt(0.0);
        let (s, _) = self.road_position();
        let places = [s, s + travel_sign * distance];
        let mut is_solid = [splat(params.simd, 0.0); 2];
        // A mark holds from its station to the next one. The first is far before the road, so every place has a mark.
        for k in station_indices(stations) {
            let mark = select(
                is_against_road,
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
