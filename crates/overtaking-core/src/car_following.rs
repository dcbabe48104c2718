//! Car following; the twin of `overtaking.sim.reference.car_following`, which names the sources.
//!
//! A vector (`F32`, `Mask`) has one value for each simulation of a block of sixteen.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{exp, log};
use crate::math::vectors::{F32, at_least, at_most, clamp_to, min, select, splat};
use crate::names::{ModelConstants, VehicleParams};

/// Keeps the stopping acceleration of `cah_accel` finite behind a leader at rest [m^2/s^2].
const MIN_STOPPING_TERM: f32 = 1e-3;
// Near the desired speed the free acceleration of `iidm_accel` approaches 0, and the exponent of z, the desired gap
// over the gap, approaches infinity. z^1000 is below 0.0001 for z < 0.99.
const MIN_FREE_ACCEL: f32 = 1e-3; // [m/s^2]
const MAX_EXPONENT: f32 = 1000.0;
/// Keeps the logarithm of z finite [1].
const MIN_GAP_RATIO: f32 = 1e-6;

/// A driver behind a leader.
#[derive(Clone, Copy)]
pub struct Follower<'a, S: Simd> {
    /// Parameters of the driver and its vehicle.
    pub vehicle: &'a VehicleParams<S>,
    /// Speed [m/s].
    pub speed: F32<S>,
    /// Speed on a free road, > 0 [m/s].
    pub desired_speed: F32<S>,
    /// Time gap that the driver keeps [s].
    pub time_gap: F32<S>,
}

/// The vehicle ahead of a follower, as it is or as the follower believes.
#[derive(Clone, Copy)]
pub struct Leader<S: Simd> {
    /// Gap between the bumpers [m].
    pub gap: F32<S>,
    /// Speed of the follower minus the leader's [m/s].
    pub closing_speed: F32<S>,
    /// Acceleration of the leader [m/s^2]. Never positive: `perception` clips the belief.
    pub accel: F32<S>,
}

impl<S: Simd> Leader<S> {
    /// A leader that keeps its speed.
    #[inline(always)]
    pub fn steady(gap: F32<S>, closing_speed: F32<S>) -> Self {
        Self {
            gap,
            closing_speed,
            accel: splat(gap.simd, 0.0),
        }
    }
}

/// Desired gap of the intelligent driver model [m].
///
/// `vehicle.idm_interaction` is 1 / (2 sqrt(a b)): a is `vehicle.accel` and b `vehicle.decel`. `closing_speed` is the
/// speed of the follower minus the leader's [m/s].
#[inline(always)]
fn desired_gap<S: Simd>(
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    time_gap: F32<S>,
    closing_speed: F32<S>,
) -> F32<S> {
    let dynamic_part = speed * time_gap + speed * closing_speed * vehicle.idm_interaction;
    vehicle.min_gap + at_least(dynamic_part, 0.0)
}

/// Acceleration behind a leader, with a reaction to its stop lamps [m/s^2].
///
/// The blended IIDM reacts to the gap and its change, so it brakes only after a braking leader has become visibly
/// slower. Stop lamps make a driver brake before that, with at least a share of `cah_accel`: all of it at short time
/// gaps, nothing at long ones, linear between.
#[inline(always)]
pub fn acc_accel<S: Simd>(
    constants: &ModelConstants,
    follower: &Follower<'_, S>,
    leader: &Leader<S>,
) -> F32<S> {
    follower.speed.simd.vectorize(
        #[inline(always)]
        || {
            let cah = cah_accel(constants, follower.speed, leader);
            let iidm = iidm_accel(constants, follower, leader);
            let accel = blend_iidm_with_cah(constants, follower.vehicle, iidm, cah);
            let stop_lamps_are_on = leader.accel.simd_lt(-constants.stop_lamp_decel);
            if !stop_lamps_are_on.any_true() {
                return accel;
            }
            // Formulas that divide by the vehicle's speed divide by at least `slip_speed`, 3 m/s.
            let time_gap_below_max = constants.stop_lamp_max_time_gap
                - leader.gap / at_least(follower.speed, constants.slip_speed);
            let reaction_share = clamp_to(
                time_gap_below_max
                    / (constants.stop_lamp_max_time_gap - constants.stop_lamp_full_time_gap),
                0.0,
                1.0,
            );
            select(stop_lamps_are_on, min(accel, reaction_share * cah), accel)
        },
    )
}

/// Acceleration that just avoids a contact if the leader keeps its acceleration [m/s^2].
///
/// This is the constant-acceleration heuristic (CAH). `speed` is the speed of the follower [m/s].
#[inline(always)]
pub fn cah_accel<S: Simd>(constants: &ModelConstants, speed: F32<S>, leader: &Leader<S>) -> F32<S> {
    let double_gap = 2.0 * at_least(leader.gap, constants.min_effective_gap);
    let leader_speed = at_least(speed - leader.closing_speed, 0.0);
    let closing_speed = at_least(leader.closing_speed, 0.0);
    // The leader still moves when the closing speed has become 0 ...
    let moving_accel = leader.accel - (closing_speed * closing_speed) / double_gap;
    // ... or it stops first, and the follower stops behind it. If the gap opens and the leader does not brake,
    // `leader_stops_first` is true as well, but both accelerations are 0.
    let stopping_term = leader_speed * leader_speed - double_gap * leader.accel;
    let stopping_accel = speed * speed * leader.accel / at_least(stopping_term, MIN_STOPPING_TERM);
    let leader_stops_first =
        (leader_speed * leader.closing_speed).simd_lt(-(double_gap * leader.accel));
    select(leader_stops_first, stopping_accel, moving_accel)
}

/// Acceleration of the IIDM with softer braking at small gaps [m/s^2].
///
/// Where the IIDM brakes harder than the constant-acceleration heuristic, the excess is limited to about the
/// comfortable deceleration. A cut-in by a faster vehicle thus causes no hard braking. `coolness` is the weight of the
/// softer braking, `iidm` the result of `iidm_accel`, and `cah` the result of `cah_accel` [m/s^2].
#[inline(always)]
fn blend_iidm_with_cah<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    iidm: F32<S>,
    cah: F32<S>,
) -> F32<S> {
    let is_mild = iidm.simd_ge(cah);
    if is_mild.all_true() {
        return iidm;
    }
    let excess = at_most(iidm - cah, 0.0);
    // tanh(x) is (exp(2 x) - 1) / (exp(2 x) + 1), here with x = excess / decel.
    let exp_2x = exp(2.0 * excess / vehicle.decel);
    let softened = cah + vehicle.decel * ((exp_2x - 1.0) / (exp_2x + 1.0));
    // At small gaps the braking of the IIDM grows without bound; no vehicle brakes harder than 1 g.
    let bounded = at_least(iidm, -constants.gravity);
    let blend = (1.0 - constants.coolness) * bounded + constants.coolness * softened;
    select(is_mild, iidm, blend)
}

/// Acceleration of the improved intelligent driver model, IIDM [m/s^2].
#[inline(always)]
fn iidm_accel<S: Simd>(
    constants: &ModelConstants,
    follower: &Follower<'_, S>,
    leader: &Leader<S>,
) -> F32<S> {
    let (vehicle, one) = (follower.vehicle, splat(follower.speed.simd, 1.0));
    // Desired gap over gap.
    let z = desired_gap(
        vehicle,
        follower.speed,
        follower.time_gap,
        leader.closing_speed,
    ) / at_least(leader.gap, constants.min_effective_gap);
    let speed_ratio = follower.speed / follower.desired_speed;
    // Below the desired speed the exponent is 4, above it `overspeed_exponent`, which is `following.free_exponent`
    // (`model.toml`) times a / b. As `free_exponent` is 4 as well, both branches have the same slope at the desired
    // speed: change the two numbers together. Other powers are exp(exponent * log(base)), with the same bits on
    // every machine.
    let square = speed_ratio * speed_ratio;
    let free_accel_below = vehicle.accel * (one - square * square);
    let interaction = vehicle.accel * (one - z * z);
    let exponent = at_most(
        2.0 * vehicle.accel / at_least(free_accel_below, MIN_FREE_ACCEL),
        MAX_EXPONENT,
    );
    let blended = free_accel_below * (one - exp(exponent * log(clamp_to(z, MIN_GAP_RATIO, 1.0))));
    let accel_below = select(z.simd_ge(one), interaction, blended);
    let is_below = speed_ratio.simd_le(one);
    if is_below.all_true() {
        return accel_below;
    }
    let decay = exp(-vehicle.overspeed_exponent * log(at_least(speed_ratio, 1.0)));
    let free_accel_above = -vehicle.decel * (one - decay);
    let accel_above = select(
        z.simd_ge(one),
        free_accel_above + interaction,
        free_accel_above,
    );
    select(is_below, accel_below, accel_above)
}

/// Acceleration, never positive, that a leader imposes on a follower [m/s^2].
///
/// This is `iidm_accel` at the desired speed, where the free acceleration is 0. It is not blended with `cah_accel`: a
/// driver accepts a small gap after a cut-in for itself, but should not impose such a gap on another driver.
///
/// `vehicle` has the parameters of the driver that judges the gap: the follower, or a driver ahead of it that assumes
/// the follower to be like itself. `time_gap` is the time gap behind the leader that this driver asks for [s]. `speed`
/// is the speed of the follower [m/s].
#[inline(always)]
pub fn imposed_accel<S: Simd>(
    constants: &ModelConstants,
    vehicle: &VehicleParams<S>,
    speed: F32<S>,
    time_gap: F32<S>,
    leader: &Leader<S>,
) -> F32<S> {
    // Desired gap over gap.
    let z = desired_gap(vehicle, speed, time_gap, leader.closing_speed)
        / at_least(leader.gap, constants.min_effective_gap);
    at_most(vehicle.accel * (1.0 - z * z), 0.0)
}
