//! Car following; see `overtaking.sim.reference.car_following`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{exp, log};
use crate::math::vectors::{F32, at_least, at_most, clamp_to, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};

/// Keeps the quotient finite behind a standing leader [m^2/s^2].
const MIN_STOPPING_TERM: f32 = 1e-3;
/// Near the desired speed the free acceleration vanishes [m/s^2] ...
const MIN_FREE_ACCEL: f32 = 1e-3;
/// ... and the exponent that blends it grows.
const MAX_EXPONENT: f32 = 1000.0;
/// Of the wanted to the actual gap, for its logarithm.
const MIN_GAP_RATIO: f32 = 1e-6;

#[inline(always)]
fn desired_gap<S: Simd>(
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    closing: F32<S>,
    time_gap: F32<S>,
) -> F32<S> {
    let dynamic = speed * time_gap + speed * closing * vehicle.idm_interaction;
    vehicle.min_gap + at_least(dynamic, 0.0)
}

/// Acceleration behind a leader: the IIDM, cooled, and heedful of a leader that brakes [m/s^2].
#[allow(clippy::too_many_arguments)]
#[inline(always)]
pub fn acc_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    desired: F32<S>,
    gap: F32<S>,
    closing: F32<S>,
    time_gap: F32<S>,
    leader_accel: F32<S>,
) -> F32<S> {
    speed.simd.vectorize(
        #[inline(always)]
        || {
            let needed = cah_accel(constants, speed, gap, closing, leader_accel);
            let wanted = iidm_accel(constants, vehicle, speed, desired, gap, closing, time_gap);
            let cool = blend_iidm_with_cah(constants, vehicle, wanted, needed);
            let brakes = leader_accel.simd_lt(-constants.stop_lamp_decel);
            if !brakes.any_true() {
                return cool;
            }
            let room =
                constants.stop_lamp_max_time_gap - gap / at_least(speed, constants.slip_speed);
            let heed = clamp_to(
                room / (constants.stop_lamp_max_time_gap - constants.stop_lamp_full_time_gap),
                0.0,
                1.0,
            );
            select(brakes, min(cool, heed * needed), cool)
        },
    )
}

/// Acceleration that just avoids a contact if the leader keeps braking as it does [m/s^2].
#[inline(always)]
pub fn cah_accel<S: Simd>(
    constants: &ModelConstants,
    speed: F32<S>,
    gap: F32<S>,
    closing: F32<S>,
    leader_accel: F32<S>,
) -> F32<S> {
    let room = 2.0 * at_least(gap, constants.min_effective_gap);
    let leader_speed = at_least(speed - closing, 0.0);
    let approach = at_least(closing, 0.0);
    let moving = leader_accel - (approach * approach) / room;
    let way = leader_speed * leader_speed - room * leader_accel;
    let stopping = speed * speed * leader_accel / at_least(way, MIN_STOPPING_TERM);
    let stops_first = (leader_speed * closing).simd_lt(-(room * leader_accel));
    select(stops_first, stopping, moving)
}

/// A wanted acceleration without the alarm of car-following models at small gaps [m/s^2].
#[inline(always)]
fn blend_iidm_with_cah<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    wanted: F32<S>,
    needed: F32<S>,
) -> F32<S> {
    let enough = wanted.simd_ge(needed);
    if enough.all_true() {
        return wanted;
    }
    let excess = at_most(wanted - needed, 0.0);
    let e = exp(2.0 * excess / vehicle.decel);
    let softened = needed + vehicle.decel * ((e - 1.0) / (e + 1.0));
    let alarmed = at_least(wanted, -constants.gravity);
    let calm = (1.0 - constants.coolness) * alarmed + constants.coolness * softened;
    select(enough, wanted, calm)
}

/// Acceleration of the improved intelligent driver model [m/s^2].
#[inline(always)]
fn iidm_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    desired: F32<S>,
    gap: F32<S>,
    closing: F32<S>,
    time_gap: F32<S>,
) -> F32<S> {
    let one = splat(speed.simd, 1.0);
    let z =
        desired_gap(vehicle, speed, closing, time_gap) / at_least(gap, constants.min_effective_gap);
    let ratio = speed / desired;
    let square = ratio * ratio;
    let free_below = vehicle.accel * (one - square * square);
    let interacting = vehicle.accel * (one - z * z);
    let steepness = at_most(
        2.0 * vehicle.accel / at_least(free_below, MIN_FREE_ACCEL),
        MAX_EXPONENT,
    );
    let blended = free_below * (one - exp(steepness * log(clamp_to(z, MIN_GAP_RATIO, 1.0))));
    let below = select(z.simd_ge(one), interacting, blended);
    let within = ratio.simd_le(one);
    if within.all_true() {
        return below;
    }
    let over = exp(-vehicle.overspeed_exponent * log(at_least(ratio, 1.0)));
    let free_above = -vehicle.decel * (one - over);
    let above = select(z.simd_ge(one), free_above + interacting, free_above);
    select(within, below, above)
}

/// Acceleration, never positive, of someone following at the speed that they want [m/s^2].
#[inline(always)]
pub fn imposed_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    gap: F32<S>,
    closing: F32<S>,
    time_gap: F32<S>,
) -> F32<S> {
    let z =
        desired_gap(vehicle, speed, closing, time_gap) / at_least(gap, constants.min_effective_gap);
    at_most(vehicle.accel * (1.0 - z * z), 0.0)
}
