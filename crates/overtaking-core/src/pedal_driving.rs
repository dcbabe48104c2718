//! Vehicles that a program drives by pedals and wheel angles; see `overtaking.sim.reference.pedal_driving`.
//!
//! There is one simulation, which all lanes of a vector hold, but for the wind: see `update_weather`.

use std::sync::Arc;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::collisions::{SweptStep, VehiclePair, resolve_pair};
use crate::decision_context::RoadPositions;
use crate::math::elementary::sincos;
use crate::math::vectors::{
    F32, SIMD_LANES, at_least, clamp, clamp_to, dispatch, min, select, splat,
};
use crate::names::SimulationParams;
use crate::params::{DerivedConstants, Params};
use crate::road_conditions;
use crate::run::block::load;
use crate::run::engine::{Inputs, require_level};
use crate::state::{NO_SLOT, State, new_history};
use crate::vehicle_dynamics;
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Declare the fields that a tick changes, and how they pass between a table with a row for each and the state.
macro_rules! table_fields {
    ($($group:ident.$field:ident),* $(,)?) => {
        /// Fields that a tick changes, in the order of the rows of a table.
        pub const TABLE_FIELDS: &[&str] = &[$(stringify!($field)),*];

        #[inline(always)]
        fn read_table<S: Simd, const N: usize>(state: &mut State<S, N>, table: &[f32], simd: S) {
            let mut rows = table.chunks_exact(table.len() / TABLE_FIELDS.len());
            $(for (mine, value) in state.$group.$field.iter_mut().zip(rows.next().unwrap_or_default()) {
                *mine = splat(simd, *value);
            })*
        }

        /// Write the state to the table: the numbers of each vehicle from the lane that `lane_of` names, `None` to
        /// leave the vehicle as it is.
        #[inline(always)]
        fn write_table<S: Simd, const N: usize>(
            state: &State<S, N>,
            table: &mut [f32],
            lane_of: impl Fn(usize) -> Option<usize>,
        ) {
            let mut rows = table.chunks_exact_mut(table.len() / TABLE_FIELDS.len());
            $(for (i, value) in rows.next().unwrap_or_default().iter_mut().enumerate() {
                if let Some(lane) = lane_of(i) {
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

/// Fields of bodies that may touch, in the order of the rows of a table.
pub const BODY_FIELDS: &[&str] = &[
    "s",
    "d",
    "heading",
    "vx",
    "vy",
    "yaw_rate",
    "half_length",
    "half_width",
    "inverse_mass",
    "inverse_inertia",
];

/// Pedals and steering, a number for each vehicle.
#[derive(Clone, Copy)]
pub struct PedalControls<'a> {
    /// Share of the engine force that is available at the present speed.
    pub throttle: &'a [f32],
    /// Share of the full braking force.
    pub brake: &'a [f32],
    /// Requested angle of the front wheels [rad].
    pub wheel_angle: &'a [f32],
    /// Rate at which the wheels turn [rad/s].
    pub wheel_rate: f32,
}

/// A part of a tick.
#[derive(Clone, Copy)]
pub enum TickPart<'a> {
    /// Gusts, friction and wind of the decision with this number.
    Weather(u32),
    /// Motion for this number of steps.
    Motion(PedalControls<'a>, u32),
}

/// Slots for few vehicles. More vehicles get `MAX_VEHICLES` slots: a third size would take long to compile.
const FEW: usize = SLOT_CAPACITIES[0];

/// Compute a part of a tick for the vehicles of a table, (field, vehicle), whose rows are `TABLE_FIELDS`.
///
/// # Errors
/// There are too many vehicles, arrays have another length, or this CPU lacks the SIMD level.
pub fn compute_part_of_tick(
    inputs: &Inputs<'_>,
    part: TickPart<'_>,
    forced: Option<&str>,
    table: &mut [f32],
) -> Result<(), String> {
    let level = require_level(forced)?;
    if table.len() != inputs.num_slots * TABLE_FIELDS.len() || !controls_fit(part, inputs.num_slots)
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
        dispatch!(level, |simd| with_params::<_, FEW>(
            simd, inputs, part, table
        ));
    } else {
        dispatch!(level, |simd| with_params::<_, MAX_VEHICLES>(
            simd, inputs, part, table
        ));
    }
    Ok(())
}

/// Exchange momentum between the bodies of each pair that touched during the last step.
///
/// `bodies` has shape (field, body), rows as `BODY_FIELDS`; it holds the motion after the step, and is changed.
/// `old_positions` are `s` and `d` before the step, (2, body). Pairs are resolved in their order. Returns for each body
/// the first other body that it touched.
///
/// # Errors
/// Arrays have another length, a pair names a body that does not exist, or this CPU lacks the SIMD level.
pub fn resolve_contacts(
    inputs: &Inputs<'_>,
    bodies: &mut [f32],
    old_positions: &[f32],
    pairs: &[[usize; 2]],
    forced: Option<&str>,
) -> Result<Vec<Option<usize>>, String> {
    let level = require_level(forced)?;
    let num_bodies = bodies.len() / BODY_FIELDS.len();
    let is_known = |body: &usize| *body < num_bodies;
    if bodies.len() != num_bodies * BODY_FIELDS.len()
        || old_positions.len() != 2 * num_bodies
        || !pairs.as_flattened().iter().all(is_known)
    {
        return Err(format!("expected numbers of {num_bodies} bodies"));
    }
    let mut first_contacts = vec![None; num_bodies];
    dispatch!(level, |simd| resolve_pairs(
        simd,
        inputs,
        bodies,
        old_positions,
        pairs,
        &mut first_contacts
    ));
    let partner = |contact: Option<Contact>| contact.map(|contact| contact.partner);
    Ok(first_contacts.into_iter().map(partner).collect())
}

fn controls_fit(part: TickPart<'_>, num_vehicles: usize) -> bool {
    match part {
        TickPart::Weather(_) => true,
        TickPart::Motion(controls, _) => [controls.throttle, controls.brake, controls.wheel_angle]
            .iter()
            .all(|values| values.len() == num_vehicles),
    }
}

fn with_params<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    part: TickPart<'_>,
    table: &mut [f32],
) {
    let params = params_in_all_lanes::<S, N>(simd, inputs);
    match part {
        TickPart::Weather(decision) => update_weather(params, decision, table),
        TickPart::Motion(controls, steps) => drive(&params, controls, steps, table),
    }
}

/// Parameters of the one simulation of a batch, in every lane.
fn params_in_all_lanes<S: Simd, const N: usize>(simd: S, inputs: &Inputs<'_>) -> Params<S, N> {
    let (vehicles, simulations) = load(
        simd,
        inputs.vehicle,
        inputs.simulation,
        inputs,
        &[0; SIMD_LANES],
    );
    Params {
        simd,
        constants: Arc::clone(&inputs.constants),
        derived: DerivedConstants::from_constants(&inputs.constants),
        road: Arc::clone(&inputs.road),
        vehicles,
        simulations,
        num_slots_in_use: inputs.num_slots,
        is_ring: false,
        key: [inputs.seed as u32, (inputs.seed >> 32) as u32],
        scenario_index_low: [inputs.scenario_index[0] as u32; SIMD_LANES],
        scenario_index_high: [(inputs.scenario_index[0] >> 32) as u32; SIMD_LANES],
    }
}

/// The first contact of a body during a step.
#[derive(Clone, Copy)]
struct Contact {
    /// The other body.
    partner: usize,
    /// Time since the step began [s].
    time: f32,
}

/// Slot that stands for a partner in an earlier pair: the two bodies of a pair have slots 0 and 1.
const SLOT_OF_ANOTHER_PAIR: f32 = 2.0;

/// Resolve the contacts of pairs, one pair after the other in the first two slots.
///
/// A body has as many partners as it touches, and their number is not limited by the slots.
fn resolve_pairs<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    bodies: &mut [f32],
    old_positions: &[f32],
    pairs: &[[usize; 2]],
    first_contacts: &mut [Option<Contact>],
) {
    let num_bodies = first_contacts.len();
    let mut params = params_in_all_lanes::<S, FEW>(simd, inputs);
    let mut state = State::at_start(&params, new_history());
    let zero = splat(simd, 0.0);
    // These vehicles have no last step.
    state.end_step = splat(simd, f32::MAX);
    let mut old_s = [zero; FEW];
    let mut old_d = [zero; FEW];
    for pair in pairs {
        for (slot, body) in pair.iter().copied().enumerate() {
            let number = |row: usize| splat(simd, bodies[row * num_bodies + body]);
            let motion = &mut state.motion;
            (motion.s[slot], motion.d[slot]) = (number(0), number(1));
            motion.heading[slot] = number(2);
            (motion.sin_heading[slot], motion.cos_heading[slot]) = sincos(number(2));
            (motion.vx[slot], motion.vy[slot]) = (number(3), number(4));
            motion.yaw_rate[slot] = number(5);
            let vehicle = &mut params.vehicles[slot];
            (vehicle.half_length, vehicle.half_width) = (number(6), number(7));
            (vehicle.inverse_mass, vehicle.inverse_inertia) = (number(8), number(9));
            // All positions are in one frame, whatever the directions of the road.
            vehicle.travel_sign = splat(simd, 1.0);
            old_s[slot] = splat(simd, old_positions[body]);
            old_d[slot] = splat(simd, old_positions[num_bodies + body]);
            let earlier = first_contacts[body];
            let partner = earlier.map_or(NO_SLOT, |_| SLOT_OF_ANOTHER_PAIR);
            state.first_contact.partner[slot] = splat(simd, partner);
            state.first_contact.time[slot] =
                splat(simd, earlier.map_or(0.0, |contact| contact.time));
        }
        simd.vectorize(
            #[inline(always)]
            || {
                let pair = VehiclePair {
                    first: 0,
                    second: 1,
                    is_near: zero.simd_eq(0.0),
                };
                let swept = SweptStep {
                    index: 0,
                    length: params.derived.fine.length,
                    start: &RoadPositions { s: old_s, d: old_d },
                };
                resolve_pair(&mut state, &params, &pair, &swept);
            },
        );
        for (slot, body) in pair.iter().copied().enumerate() {
            let motion = &state.motion;
            let rows = [
                motion.s[slot],
                motion.d[slot],
                motion.heading[slot],
                motion.vx[slot],
                motion.vy[slot],
                motion.yaw_rate[slot],
            ];
            for (row, number) in rows.into_iter().enumerate() {
                bodies[row * num_bodies + body] = number[0];
            }
            let other_slot = 1 - slot;
            if state.first_contact.partner[slot][0] == other_slot as f32 {
                first_contacts[body] = Some(Contact {
                    partner: pair[other_slot],
                    time: state.first_contact.time[slot][0],
                });
            }
        }
    }
}

/// Gusts, friction and wind of a decision.
///
/// Vehicles head anywhere, so the wind has other axes for each. Each lane has the wind in the axes of one vehicle,
/// and the numbers of that vehicle are taken from this lane.
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

/// Set the acceleration that the pedals ask for at a speed.
#[inline(always)]
fn apply_throttle_and_brake<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let air = speed - state.friction_and_wind.tail_wind[slot];
    let resistance = vehicle.drag * air * air.abs() + vehicle.rolling;
    let engine = min(
        vehicle.launch_force,
        vehicle.power / at_least(speed, constants.slip_speed),
    );
    let force = controls.throttle[slot] * engine
        - controls.brake[slot] * vehicle.max_brake_force
        - resistance;
    state.controls.requested_accel[slot] = force * vehicle.inverse_mass;
}

/// Turn the front wheels, or lean into the curve that they stand for.
///
/// Returns the angle, or the lean, in the middle of the step.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) -> F32<S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let angle: F32<S> = splat(params.simd, controls.wheel_angle[slot]);
    let max_turn = controls.wheel_rate * constants.step;
    let turn = clamp_to(
        angle - state.controls.wheel_angle[slot],
        -max_turn,
        max_turn,
    );
    let (sine, cosine) = sincos(angle);
    let curve = speed * speed * sine / (cosine * vehicle.wheelbase);
    let grip = constants.gravity
        * 0.5
        * (state.friction_and_wind.mu_left[slot] + state.friction_and_wind.mu_right[slot]);
    let lean = (clamp(curve, -grip, grip) - state.controls.wheel_angle[slot])
        * params.derived.fine.leaning;
    let moved = select(vehicle.two_wheeler.simd_gt(0.0), lean, turn);
    let old_angle = state.controls.wheel_angle[slot];
    state.controls.wheel_angle[slot] = old_angle + moved;
    old_angle + 0.5 * moved
}
