//! Vehicles that a program drives by pedals and wheel angles; see `overtaking.sim.reference.pedal_driving`.
//!
//! There is one simulation, and every lane of a SIMD vector holds it. Only `update_weather` has different numbers in
//! the lanes: the wind in the axes of different vehicles. A *tick* is the time between two decisions, 50 ms. A slot is
//! the number of a vehicle in its simulation.

use std::array;
use std::sync::Arc;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

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
use crate::run::engine::Inputs;
use crate::state::{NO_SLOT, State, new_history};
use crate::vehicle_dynamics;
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Declare the fields that a tick changes, and the functions that copy them between the state and a table with one row
/// per field.
macro_rules! table_fields {
    ($($group:ident.$field:ident),* $(,)?) => {
        /// Fields that a tick changes, in the order of the rows of a table.
        pub const TABLE_FIELDS: &[&str] = &[$(stringify!($field)),*];

        /// Read the table, (field, vehicle), into every lane of the state. A simulation has at least one vehicle.
        #[inline(always)]
        fn read_table<S: Simd, const N: usize>(state: &mut State<S, N>, table: &[f32], simd: S) {
            let mut rows = table.chunks_exact(table.len() / TABLE_FIELDS.len());
            $(for (field, value) in state.$group.$field.iter_mut().zip(rows.next().unwrap_or_default()) {
                *field = splat(simd, *value);
            })*
        }

        /// Write the state to the table, each column from one lane.
        ///
        /// `lane_of` maps the slot of a vehicle to the lane with its numbers; the columns of vehicles without a lane
        /// stay unchanged.
        #[inline(always)]
        fn write_table<S: Simd, const N: usize>(
            state: &State<S, N>,
            table: &mut [f32],
            lane_of: impl Fn(usize) -> Option<usize>,
        ) {
            let mut rows = table.chunks_exact_mut(table.len() / TABLE_FIELDS.len());
            $(for (slot, value) in rows.next().unwrap_or_default().iter_mut().enumerate() {
                if let Some(lane) = lane_of(slot) {
                    *value = state.$group.$field[slot][lane];
                }
            })*
        }
    };
}

// The vehicles have no model driver, but `update_random_processes` draws the errors of drivers together with the gusts.
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

/// Pedals and steering of all vehicles, which hold for all steps of a call.
#[derive(Clone, Copy)]
pub struct PedalControls<'a> {
    /// Share of the engine force that is available at the present speed, 0 to 1, (vehicle).
    pub throttle: &'a [f32],
    /// Share of the full braking force, 0 to 1, (vehicle).
    pub brake: &'a [f32],
    /// Requested angle of the front wheels [rad], (vehicle).
    pub wheel_angle: &'a [f32],
    /// Rate at which the wheels turn [rad/s].
    pub wheel_rate: f32,
}

/// A part of a tick.
#[derive(Clone, Copy)]
pub enum TickPart<'a> {
    /// Draw gusts, and compute friction and wind until the next decision.
    Weather {
        /// Index of the decision, which the random numbers depend on.
        decision_index: u32,
    },
    /// Move all vehicles.
    Motion {
        /// Pedals and steering during these steps.
        controls: PedalControls<'a>,
        /// Number of steps, each as long as the constant `step`.
        num_steps: u32,
    },
}

/// Number of slots of the state for tables with at most this many vehicles. Larger tables get `MAX_VEHICLES` slots: a
/// third size would take long to compile.
const FEW_SLOTS: usize = SLOT_CAPACITIES[0];

/// Compute a part of a tick for the vehicles of a table, (field, vehicle), whose rows are `TABLE_FIELDS`.
///
/// # Errors
/// There are more than `MAX_VEHICLES` vehicles, or arrays have another length.
pub fn compute_part_of_tick(
    level: Level,
    inputs: &Inputs<'_>,
    part: TickPart<'_>,
    table: &mut [f32],
) -> Result<(), String> {
    if table.len() != inputs.num_slots * TABLE_FIELDS.len()
        || !has_controls_for(part, inputs.num_slots)
    {
        return Err(format!("expected numbers of {} vehicles", inputs.num_slots));
    }
    if inputs.num_slots > MAX_VEHICLES {
        return Err(format!(
            "{} vehicles are more than {MAX_VEHICLES}",
            inputs.num_slots
        ));
    }
    if inputs.num_slots <= FEW_SLOTS {
        dispatch!(level, |simd| compute_part::<_, FEW_SLOTS>(
            simd, inputs, part, table
        ));
    } else {
        dispatch!(level, |simd| compute_part::<_, MAX_VEHICLES>(
            simd, inputs, part, table
        ));
    }
    Ok(())
}

/// Exchange momentum between the bodies of each pair that touched during the last step.
///
/// `bodies` has shape (field, body), rows as `BODY_FIELDS`. It holds the motion after the step and is changed in place.
/// `old_positions` are `s` and `d` before the step [m], (2, body). Pairs are resolved in their order. Returns for each
/// body the first other body that it touched.
///
/// # Errors
/// Arrays have another length, or a pair names a body that does not exist.
pub fn resolve_contacts(
    level: Level,
    inputs: &Inputs<'_>,
    bodies: &mut [f32],
    old_positions: &[f32],
    pairs: &[[usize; 2]],
) -> Result<Vec<Option<usize>>, String> {
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

/// Whether a part of a tick has pedals and steering for each vehicle, if it needs any.
fn has_controls_for(part: TickPart<'_>, num_vehicles: usize) -> bool {
    match part {
        TickPart::Weather { .. } => true,
        TickPart::Motion { controls, .. } => {
            [controls.throttle, controls.brake, controls.wheel_angle]
                .iter()
                .all(|values| values.len() == num_vehicles)
        }
    }
}

/// Compute a part of a tick with `N` vehicle slots.
fn compute_part<S: Simd, const N: usize>(
    simd: S,
    inputs: &Inputs<'_>,
    part: TickPart<'_>,
    table: &mut [f32],
) {
    let params = params_in_all_lanes::<S, N>(simd, inputs);
    match part {
        TickPart::Weather { decision_index } => update_weather(params, decision_index, table),
        TickPart::Motion {
            controls,
            num_steps,
        } => drive(&params, controls, num_steps, table),
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
        // Only perception and lane changes of model drivers read it.
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

/// Partner of a body that has touched a body of an earlier pair: neither `NO_SLOT` nor 0 or 1, the slots of this pair.
const SLOT_OF_ANOTHER_PAIR: f32 = 2.0;

/// Resolve the contacts of pairs, one pair after the other in the first two slots.
///
/// So the number of bodies is not limited by the number of slots.
fn resolve_pairs<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    bodies: &mut [f32],
    old_positions: &[f32],
    pairs: &[[usize; 2]],
    first_contacts: &mut [Option<Contact>],
) {
    let num_bodies = first_contacts.len();
    let mut params = params_in_all_lanes::<S, FEW_SLOTS>(simd, inputs);
    let mut state = State::at_start(&params, new_history());
    let zero = splat(simd, 0.0);
    // Contacts are resolved in running simulations only, and this one has no end.
    state.end_step = splat(simd, f32::MAX);
    let mut old_s = [zero; FEW_SLOTS];
    let mut old_d = [zero; FEW_SLOTS];
    for pair in pairs {
        for (slot, body) in pair.iter().copied().enumerate() {
            // In the order of `BODY_FIELDS`.
            let [
                s,
                d,
                heading,
                vx,
                vy,
                yaw_rate,
                half_length,
                half_width,
                inverse_mass,
                inverse_inertia,
            ] = array::from_fn(|row| splat(simd, bodies[row * num_bodies + body]));
            let motion = &mut state.motion;
            (motion.s[slot], motion.d[slot]) = (s, d);
            motion.heading[slot] = heading;
            (motion.sin_heading[slot], motion.cos_heading[slot]) = sincos(heading);
            (motion.vx[slot], motion.vy[slot]) = (vx, vy);
            motion.yaw_rate[slot] = yaw_rate;
            let vehicle = &mut params.vehicles[slot];
            (vehicle.half_length, vehicle.half_width) = (half_length, half_width);
            (vehicle.inverse_mass, vehicle.inverse_inertia) = (inverse_mass, inverse_inertia);
            // The positions of all bodies have the same axes, also on a road with oncoming traffic.
            vehicle.travel_sign = splat(simd, 1.0);
            old_s[slot] = splat(simd, old_positions[body]);
            old_d[slot] = splat(simd, old_positions[num_bodies + body]);
            // A contact in this pair replaces the first contact only if it was earlier in the step.
            let (partner, time) = match first_contacts[body] {
                Some(contact) => (SLOT_OF_ANOTHER_PAIR, contact.time),
                None => (NO_SLOT, 0.0),
            };
            state.first_contact.partner[slot] = splat(simd, partner);
            state.first_contact.time[slot] = splat(simd, time);
        }
        simd.vectorize(
            #[inline(always)]
            || {
                let pair = VehiclePair {
                    first: 0,
                    second: 1,
                    // True in every lane.
                    is_near: zero.simd_eq(0.0),
                };
                let swept = SweptStep {
                    // Contact times then count from the start of the step.
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

/// Draw gusts, and compute friction and wind of all vehicles until the next decision.
///
/// The formulas of the wind hold in the axes of one vehicle, and the vehicles may head in any direction. So a pass of
/// the loop computes all vehicles with a different wind in each lane: lane `k` has the wind in the axes of the vehicle
/// in slot `first_slot + k`. Only the numbers of that vehicle are read from the lane.
fn update_weather<S: Simd, const N: usize>(
    mut params: Params<S, N>,
    decision_index: u32,
    table: &mut [f32],
) {
    // Every pass starts from the numbers before the tick.
    let old_table = table.to_vec();
    let ground_frame_weather = params.simulations;
    // Reused, to allocate it once; nothing here reads it.
    let mut history = new_history();
    for first_slot in (0..params.num_slots_in_use).step_by(SIMD_LANES) {
        history = params.simd.vectorize(
            #[inline(always)]
            || {
                let mut state = State::at_start(&params, history);
                read_table(&mut state, &old_table, params.simd);
                set_wind_in_vehicle_axes(
                    &mut params.simulations,
                    &ground_frame_weather,
                    &state,
                    first_slot,
                );
                road_conditions::update_random_processes(&mut state, &params, decision_index);
                road_conditions::update_friction(&mut state, &params);
                road_conditions::update_wind(&mut state, &params);
                write_table(&state, table, |slot| {
                    slot.checked_sub(first_slot)
                        .filter(|lane| *lane < SIMD_LANES)
                });
                state.attention.history
            },
        );
    }
}

/// Set the wind in lane `k` of `weather` to the wind in the axes of the vehicle in slot `first_slot + k`.
#[inline(always)]
fn set_wind_in_vehicle_axes<S: Simd, const N: usize>(
    weather: &mut SimulationParams<S>,
    ground_frame_weather: &SimulationParams<S>,
    state: &State<S, N>,
    first_slot: usize,
) {
    for (lane, heading) in state.motion.heading[first_slot..]
        .iter()
        .take(SIMD_LANES)
        .enumerate()
    {
        let (sine, cosine) = sincos(*heading);
        let (along, across) = (
            ground_frame_weather.wind_along,
            ground_frame_weather.wind_across,
        );
        weather.wind_along.as_mut_slice()[lane] = (along * cosine + across * sine)[lane];
        weather.wind_across.as_mut_slice()[lane] = (across * cosine - along * sine)[lane];
    }
}

/// The value of `VARIES`, a parameter of the dynamics: pedal-driven vehicles move on straight and level ground.
const ROAD_VARIES: bool = false;

/// Move every vehicle by some steps, without detection of contacts.
fn drive<S: Simd, const N: usize>(
    params: &Params<S, N>,
    controls: PedalControls<'_>,
    num_steps: u32,
    table: &mut [f32],
) {
    params.simd.vectorize(
        #[inline(always)]
        || {
            let mut state = State::at_start(params, new_history());
            read_table(&mut state, table, params.simd);
            for slot in 0..params.num_slots_in_use {
                let motion = &mut state.motion;
                (motion.sin_heading[slot], motion.cos_heading[slot]) = sincos(motion.heading[slot]);
            }
            for _ in 0..num_steps {
                for slot in 0..params.num_slots_in_use {
                    // The step of 10 ms, the constant `step`.
                    let step_length = &params.derived.fine;
                    let (vx, accel) = (state.motion.vx[slot], state.motion.accel_lon[slot]);
                    // Speed in the middle of the step.
                    let speed = at_least(vx + step_length.half * accel, 0.0);
                    apply_throttle_and_brake(&mut state, params, slot, controls, speed);
                    let mid_angle = turn_wheels(&mut state, params, slot, controls, speed);
                    let motion = vehicle_dynamics::compute_step::<S, N, ROAD_VARIES>(
                        &mut state,
                        params,
                        slot,
                        mid_angle,
                        step_length,
                    );
                    vehicle_dynamics::update_position::<S, N, ROAD_VARIES>(
                        &mut state,
                        params,
                        slot,
                        motion,
                        step_length,
                    );
                }
            }
            write_table(&state, table, |_| Some(0));
        },
    );
}

/// Set the acceleration that the pedals request of `vehicle_dynamics` at a speed.
///
/// The dynamics add the resistance to the requested force and apply the limits of engine, brakes and friction. The
/// resistance is subtracted here, so that a vehicle without a foot on a pedal coasts.
#[inline(always)]
fn apply_throttle_and_brake<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let air_speed = speed - state.friction_and_wind.tail_wind[slot];
    let resistance = vehicle.drag * air_speed * air_speed.abs() + vehicle.rolling;
    // `slip_speed` is the least divisor wherever a formula divides by speed [m/s].
    let engine_force = min(
        vehicle.launch_force,
        vehicle.power / at_least(speed, constants.slip_speed),
    );
    let force = controls.throttle[slot] * engine_force
        - controls.brake[slot] * vehicle.max_brake_force
        - resistance;
    state.controls.requested_accel[slot] = force * vehicle.inverse_mass;
}

/// Turn the front wheels towards an angle; a two-wheeler leans into the curve of that angle.
///
/// `Controls::wheel_angle` of a two-wheeler is the lateral acceleration that its lean balances [m/s^2]. Its lean follows
/// with a lag, so `wheel_rate` does not limit it.
///
/// Returns the wheel angle [rad], or the lateral acceleration of a two-wheeler [m/s^2], in the middle of the step.
#[inline(always)]
fn turn_wheels<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    controls: PedalControls<'_>,
    speed: F32<S>,
) -> F32<S> {
    let (constants, vehicle) = (&params.constants, &params.vehicles[slot]);
    let friction = &state.friction_and_wind;
    // As `Controls::wheel_angle`, in rad or m/s^2.
    let start = state.controls.wheel_angle[slot];
    let requested_angle: F32<S> = splat(params.simd, controls.wheel_angle[slot]);
    let max_turn = controls.wheel_rate * constants.step;
    let turn = clamp_to(requested_angle - start, -max_turn, max_turn);
    // v^2 tan(angle) / wheelbase, the lateral acceleration on that curve.
    let (sine, cosine) = sincos(requested_angle);
    let accel_lat = speed * speed * sine / (cosine * vehicle.wheelbase);
    let max_accel = constants.gravity * 0.5 * (friction.mu_left[slot] + friction.mu_right[slot]);
    let lean_error = clamp(accel_lat, -max_accel, max_accel) - start;
    let lean_change = lean_error * params.derived.fine.leaning;
    let change = select(vehicle.two_wheeler.simd_gt(0.0), lean_change, turn);
    state.controls.wheel_angle[slot] = start + change;
    start + 0.5 * change
}
