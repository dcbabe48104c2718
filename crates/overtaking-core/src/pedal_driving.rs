//! Vehicles with somebody else at pedals and wheel, for a tick; see `overtaking.sim.reference.pedal_driving`.
//!
//! Here the lanes of a vector are not simulations: all of them hold the same one.

use std::sync::Arc;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::sincos;
use crate::math::vectors::{
    F32, SIMD_LANES, at_least, clamp, clamp_to, dispatch, min, select, splat,
};
use crate::names::SimulationParams;
use crate::params::{DerivedConstants, Params};
use crate::road_conditions;
use crate::run::block::load;
use crate::run::engine::{Inputs, find_level};
use crate::state::{State, new_history};
use crate::vehicle_dynamics;
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Take fields out of a table with a row for each, and put them back.
macro_rules! table_fields {
    ($($group:ident.$field:ident),* $(,)?) => {
        /// What changes while somebody drives, in the order of the rows of a table.
        pub const TABLE_FIELDS: &[&str] = &[$(stringify!($field)),*];

        #[inline(always)]
        fn read_table<S: Simd, const N: usize>(state: &mut State<S, N>, table: &[f32], simd: S) {
            let mut rows = table.chunks_exact(table.len() / TABLE_FIELDS.len());
            $(for (mine, value) in state.$group.$field.iter_mut().zip(rows.next().unwrap_or_default()) {
                *mine = splat(simd, *value);
            })*
        }

        /// Put back what lane `of` a vehicle says of it.
        #[inline(always)]
        fn write_table<S: Simd, const N: usize>(
            state: &State<S, N>,
            table: &mut [f32],
            of: impl Fn(usize) -> Option<usize>,
        ) {
            let mut rows = table.chunks_exact_mut(table.len() / TABLE_FIELDS.len());
            $(for (i, value) in rows.next().unwrap_or_default().iter_mut().enumerate() {
                if let Some(lane) = of(i) {
                    *value = state.$group.$field[i][lane];
                }
            })*
        }
    };
}

table_fields! {
    motion.s, motion.d, motion.heading, motion.vx, motion.vy, motion.yaw_rate, controls.wheel_angle,
    controls.requested_accel, motion.accel_lon, motion.accel_lat, noise.gust, noise.distance_error,
    noise.speed_error, noise.lane_wander, friction_and_wind.mu_left, friction_and_wind.mu_right,
    friction_and_wind.wind_force, friction_and_wind.wind_moment, friction_and_wind.tail_wind,
}

/// What drivers do, a number for each vehicle.
#[derive(Clone, Copy)]
pub struct PedalControls<'a> {
    /// Part of the engine's force.
    pub throttle: &'a [f32],
    /// Part of the braking force.
    pub brake: &'a [f32],
    /// Wanted angle of the front wheels [rad].
    pub wheel_angle: &'a [f32],
    /// How fast they turn [rad/s].
    pub wheel_rate: f32,
}

/// What happens to the vehicles of a table.
#[derive(Clone, Copy)]
pub enum Deed<'a> {
    /// Weather: gusts, friction and wind of the decision with this number.
    Weather(u32),
    /// Motion: so many steps.
    Drive(PedalControls<'a>, u32),
}

/// Room for few vehicles. More have room for the most, as a third size would be compiled for little.
const FEW: usize = SLOT_CAPACITIES[0];

/// Let something happen to vehicles.
///
/// # Errors
/// There are too many, arrays are too short, or this CPU lacks the SIMD level.
pub fn act(
    inputs: &Inputs<'_>,
    deed: Deed<'_>,
    forced: Option<&str>,
    table: &mut [f32],
) -> Result<(), String> {
    let Some(level) = find_level(forced) else {
        return Err(format!(
            "SIMD level {} is not supported by this CPU",
            forced.unwrap_or("?")
        ));
    };
    if table.len() != inputs.num_slots * TABLE_FIELDS.len() || !controls_fit(deed, inputs.num_slots)
    {
        return Err(format!("expected numbers of {} vehicles", inputs.num_slots));
    }
    if inputs.num_slots > MAX_VEHICLES {
        return Err(format!(
            "{} vehicles are more than {MAX_VEHICLES}",
            inputs.num_slots
        ));
    }
    if inputs.num_slots <= FEW {
        dispatch!(level, |simd| with_state::<_, FEW>(
            simd, inputs, deed, table
        ));
    } else {
        dispatch!(level, |simd| with_state::<_, MAX_VEHICLES>(
            simd, inputs, deed, table
        ));
    }
    Ok(())
}

fn controls_fit(deed: Deed<'_>, vehicles: usize) -> bool {
    match deed {
        Deed::Weather(_) => true,
        Deed::Drive(controls, _) => [controls.throttle, controls.brake, controls.wheel_angle]
            .iter()
            .all(|values| values.len() == vehicles),
    }
}

fn with_state<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    deed: Deed<'_>,
    table: &mut [f32],
) {
    let (p, q) = load(
        simd,
        inputs.vehicle,
        inputs.simulation,
        inputs,
        &[0; SIMD_LANES],
    );
    let world = Params::<S, N> {
        simd,
        constants: Arc::clone(&inputs.constants),
        derived: DerivedConstants::of(&inputs.constants),
        road: Arc::clone(&inputs.road),
        vehicles: p,
        simulations: q,
        num_slots_in_use: inputs.num_slots,
        is_ring: false,
        key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
        scenario_index_low: [inputs.scenario_index[0] as u32; SIMD_LANES],
        scenario_index_high: [(inputs.scenario_index[0] >> 32) as u32; SIMD_LANES],
    };
    match deed {
        Deed::Weather(decision) => update_weather(world, decision, table),
        Deed::Drive(controls, steps) => drive(&world, controls, steps, table),
    }
}

/// Gusts, friction and wind of a decision.
///
/// Vehicles head anywhere, so the wind has other axes for each. Lane `k` has it as one of them feels it,
/// and only that one takes its numbers from there.
fn update_weather<S: Simd, const N: usize>(
    mut params: Params<S, N>,
    decision: u32,
    table: &mut [f32],
) {
    let old_table = table.to_vec();
    let steady = params.simulations;
    let mut history = new_history();
    for first in (0..params.num_slots_in_use).step_by(SIMD_LANES) {
        history = params.simd.vectorize(
            #[inline(always)]
            || {
                let mut state = State::at_start(&params, history);
                read_table(&mut state, &old_table, params.simd);
                wind_in_vehicle_axes(&mut params.simulations, &steady, &state, first);
                road_conditions::update_random_processes(&mut state, &params, decision);
                road_conditions::update_friction(&mut state, &params);
                road_conditions::update_wind(&mut state, &params);
                write_table(&state, table, |i| {
                    i.checked_sub(first).filter(|lane| *lane < SIMD_LANES)
                });
                state.attention.history
            },
        );
    }
}

/// The wind in the axes of the vehicles from `first` on, one in each lane.
#[inline(always)]
fn wind_in_vehicle_axes<S: Simd, const N: usize>(
    turned: &mut SimulationParams<S>,
    steady: &SimulationParams<S>,
    state: &State<S, N>,
    first: usize,
) {
    for (lane, psi) in state.motion.heading[first..]
        .iter()
        .take(SIMD_LANES)
        .enumerate()
    {
        let (sine, cosine) = sincos(*psi);
        let along = steady.wind_along * cosine + steady.wind_across * sine;
        let across = steady.wind_across * cosine - steady.wind_along * sine;
        turned.wind_along.as_mut_slice()[lane] = along[lane];
        turned.wind_across.as_mut_slice()[lane] = across[lane];
    }
}

fn drive<S: Simd, const N: usize>(
    params: &Params<S, N>,
    controls: PedalControls<'_>,
    steps: u32,
    table: &mut [f32],
) {
    params.simd.vectorize(
        #[inline(always)]
        || {
            let mut state = State::at_start(params, new_history());
            read_table(&mut state, table, params.simd);
            for i in 0..params.num_slots_in_use {
                (state.motion.sin_heading[i], state.motion.cos_heading[i]) =
                    sincos(state.motion.heading[i]);
            }
            for _ in 0..steps {
                for i in 0..params.num_slots_in_use {
                    let stride = &params.derived.fine;
                    let speed = at_least(
                        state.motion.vx[i] + stride.half * state.motion.accel_lon[i],
                        0.0,
                    );
                    apply_throttle_and_brake(&mut state, params, i, controls, speed);
                    let angle = turn_wheels(&mut state, params, i, controls, speed);
                    let motion = vehicle_dynamics::compute_step::<S, N, false>(
                        &mut state, params, i, angle, stride,
                    );
                    vehicle_dynamics::update_position::<S, N, false>(
                        &mut state, params, i, motion, stride,
                    );
                }
            }
            write_table(&state, table, |_| Some(0));
        },
    );
}

/// From pedals, at a speed, to the acceleration that is asked for.
#[inline(always)]
fn apply_throttle_and_brake<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[i]);
    let air = speed - state.friction_and_wind.tail_wind[i];
    let resistance = vehicle.drag * air * air.abs() + vehicle.rolling;
    let engine = min(
        vehicle.launch_force,
        vehicle.power / at_least(speed, constants.slip_speed),
    );
    let force =
        controls.throttle[i] * engine - controls.brake[i] * vehicle.max_brake_force - resistance;
    state.controls.requested_accel[i] = force * vehicle.inverse_mass;
}

/// Turn the front wheels, or lean into the curve that they stand for; the angle in the middle of the step.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) -> F32<S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[i]);
    let angle: F32<S> = splat(params.simd, controls.wheel_angle[i]);
    let max_turn = controls.wheel_rate * constants.step;
    let turn = clamp_to(angle - state.controls.wheel_angle[i], -max_turn, max_turn);
    let (sine, cosine) = sincos(angle);
    let curve = speed * speed * sine / (cosine * vehicle.wheelbase);
    let grip = constants.gravity
        * 0.5
        * (state.friction_and_wind.mu_left[i] + state.friction_and_wind.mu_right[i]);
    let lean =
        (clamp(curve, -grip, grip) - state.controls.wheel_angle[i]) * params.derived.fine.leaning;
    let moved = select(vehicle.two_wheeler.simd_gt(0.0), lean, turn);
    let old_angle = state.controls.wheel_angle[i];
    state.controls.wheel_angle[i] = old_angle + moved;
    old_angle + 0.5 * moved
}
