//! Drivers of the model in one simulation whose vehicles another simulator moves, such as CARLA.
//!
//! All lanes of a vector hold the same simulation, and results are read from the first lane. A *tick* is the time
//! between two decisions.

use std::mem::swap;
use std::sync::Arc;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::collisions::end_after_ego_accident;
use crate::decision_context::DecisionContext;
use crate::math::elementary::sincos;
use crate::math::vectors::{F32, splat, with_cpu_features};
use crate::names::ModelConstants;
use crate::params::StepLength;
use crate::recorder::frame_tiles::FrameTile;
use crate::recorder::output::Output;
use crate::recorder::{Recorder, RecorderProgress};
use crate::run::block::Block;
use crate::run::engine::Inputs;
use crate::run::step::decide;
use crate::state::{EGO_SLOT, new_history};
use crate::steering::steer;
use crate::{MAX_VEHICLES, SLOT_CAPACITIES};

/// Fields of the motion of vehicles, in the order of the rows of a table, (field, slot).
pub const MOTION_FIELDS: &[&str] = &[
    "s",
    "d",
    "heading",
    "vx",
    "vy",
    "yaw_rate",
    "accel_lon",
    "accel_lat",
];

/// Fields of the table of `DriverOutput`, in the order of its rows, (field, slot).
pub const DRIVER_OUTPUT_FIELDS: &[&str] = &[
    "requested_accel",
    "wheel_angle",
    "curvature",
    "lateral_speed",
    "is_wreck",
];

/// Requests of the drivers to their vehicles after a decision.
pub struct DriverOutput {
    /// Rows `DRIVER_OUTPUT_FIELDS`, (field, slot).
    pub table: Vec<f32>,
    /// Lamps of each vehicle in the last recorded frame, a sum of bits of `lights`.
    pub lights: Vec<u8>,
    /// Last step of the simulation.
    pub end_step: f32,
}

/// The contact of a vehicle with another one.
#[derive(Clone, Copy)]
pub struct VehicleContact {
    /// Slot of the vehicle.
    pub slot: usize,
    /// Slot of the other vehicle.
    pub other_slot: usize,
    /// Time of the contact [s].
    pub time: f32,
    /// Size of the impulse [N s].
    pub impulse: f32,
    /// Closing speed [m/s].
    pub closing_speed: f32,
}

/// One simulation whose vehicles another simulator moves.
///
/// Calls that record get the output arrays of the simulation, always the same ones. Motion has the rows
/// `MOTION_FIELDS`.
pub trait ExternallyMoved: Send + Sync {
    /// Record the first contact of each vehicle, which becomes a wreck. `step` may be before the first decision.
    fn note_contacts(&mut self, contacts: &[VehicleContact], step: i32);

    /// Let all drivers decide on this motion, and record a frame if one is due.
    fn decide(&mut self, motion: &[f32], step: u32, output: Output<'_>) -> DriverOutput;

    /// Turn the front wheels for one tick; returns the angle or lean of each vehicle, (slot).
    ///
    /// `wind_trim` is the part of the angle or lean that holds against crosswind, (slot).
    fn steer(&mut self, wind_trim: &[f32]) -> Vec<f32>;

    /// Record a frame of motion for which other drivers have decided. `indicator` is 1 for left and -1 for right.
    fn record(
        &mut self,
        motion: &[f32],
        ego_stage: f32,
        ego_indicator: f32,
        step: u32,
        output: Output<'_>,
    );

    /// Set the last step of the simulation.
    fn end_at(&mut self, step: u32);

    /// Last step of the simulation.
    fn end_step(&self) -> f32;

    /// Whether the ego has collided or left the road.
    fn is_ego_wrecked(&self) -> bool;

    /// Write the last frames, contacts and hash; nothing can be recorded afterwards.
    fn finish(&mut self, output: Output<'_>);
}

/// Prepare the simulation of a batch of one, with wheels that turn for one tick [s] at a time.
///
/// The function is generic for the reason that `simulate` states.
///
/// # Errors
/// There are more than `MAX_VEHICLES` slots.
pub fn externally_moved<S: Simd>(
    simd: S,
    inputs: &Inputs<'_>,
    tick: f32,
    output: Output<'_>,
) -> Result<Box<dyn ExternallyMoved>, String> {
    let num_slots = inputs.num_slots;
    match SLOT_CAPACITIES
        .into_iter()
        .find(|slots| num_slots <= *slots)
    {
        Some(8) => Ok(ExternalMotion::<S, 8>::begin(simd, inputs, tick, output)),
        Some(16) => Ok(ExternalMotion::<S, 16>::begin(simd, inputs, tick, output)),
        Some(32) => Ok(ExternalMotion::<S, 32>::begin(simd, inputs, tick, output)),
        _ => Err(format!("{num_slots} slots are more than {MAX_VEHICLES}")),
    }
}

/// The simulation with up to `N` vehicle slots.
struct ExternalMotion<S: Simd, const N: usize> {
    block: Box<Block<'static, S, N>>,
    context: DecisionContext<S, N>,
    tile: FrameTile<N>,
    recorded: RecorderProgress,
    num_slots: usize,
    steps_per_frame: u32,
    /// Constants while the wheels turn.
    steering_constants: Arc<ModelConstants>,
    tick: StepLength,
    lights: [u8; N],
}

impl<S: Simd, const N: usize> ExternalMotion<S, N> {
    /// Place the simulation before its first decision.
    fn begin(
        simd: S,
        inputs: &Inputs<'_>,
        tick: f32,
        output: Output<'_>,
    ) -> Box<dyn ExternallyMoved> {
        // Two-wheelers of the other simulator lean within a tick: half a tick late on average.
        let steering_constants = ModelConstants {
            two_wheeler_lag: 0.5 * tick,
            ..*inputs.constants
        };
        Box::new(Self {
            block: Block::new(simd, inputs, &[0], None, new_history()),
            context: DecisionContext::new(simd),
            tile: FrameTile::default(),
            recorded: Recorder::<N>::new(vec![output]).progress(),
            num_slots: inputs.num_slots,
            steps_per_frame: inputs.steps_per_frame,
            tick: StepLength::new(&steering_constants, tick),
            steering_constants: Arc::new(steering_constants),
            lights: [0; N],
        })
    }

    /// Write the motion of all vehicles to the state.
    fn set_motion(&mut self, motion: &[f32]) {
        let Block { params, state, .. } = &mut *self.block;
        for slot in 0..params.num_slots_in_use {
            if params.vehicles[slot].valid[0] == 0.0 {
                continue;
            }
            let number = |row: usize| splat(params.simd, motion[row * self.num_slots + slot]);
            let moved = &mut state.motion;
            (moved.s[slot], moved.d[slot]) = (number(0), number(1));
            moved.heading[slot] = number(2);
            (moved.sin_heading[slot], moved.cos_heading[slot]) = sincos(number(2));
            (moved.vx[slot], moved.vy[slot]) = (number(3), number(4));
            moved.yaw_rate[slot] = number(5);
            (moved.accel_lon[slot], moved.accel_lat[slot]) = (number(6), number(7));
        }
    }

    /// Record a frame, if one is due at this step.
    fn record_due_frame(&mut self, recorder: &mut Recorder<'_, N>, step: u32) {
        if !step.is_multiple_of(self.steps_per_frame) {
            return;
        }
        let Block { params, state, .. } = &*self.block;
        let (simd, frame) = (params.simd, (step / self.steps_per_frame) as usize);
        let (tile, lights) = (&mut self.tile, &mut self.lights);
        with_cpu_features!(simd, {
            let is_running = splat(simd, step as f32).simd_le(state.end_step);
            recorder.record_frame(state, params, is_running, frame, tile);
            for slot in 0..params.num_slots_in_use {
                let bits = state.vehicle(params, slot).recorded_lights()[0] as u8;
                lights[slot] = if is_running.test(0) { bits } else { 0 };
            }
        });
    }

    /// The first lane of the number of each slot.
    fn row(&self, number: impl Fn(usize) -> F32<S>) -> impl Iterator<Item = f32> {
        (0..self.num_slots).map(move |slot| number(slot)[0])
    }
}

impl<S: Simd, const N: usize> ExternallyMoved for ExternalMotion<S, N> {
    fn note_contacts(&mut self, contacts: &[VehicleContact], step: i32) {
        let Block { params, state, .. } = &mut *self.block;
        let simd = params.simd;
        let was_sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
        for contact in contacts {
            let (slot, first) = (contact.slot, &mut state.first_contact);
            if first.partner[slot][0] >= 0.0 {
                continue;
            }
            first.partner[slot] = splat(simd, contact.other_slot as f32);
            first.time[slot] = splat(simd, contact.time);
            first.impulse[slot] = splat(simd, contact.impulse);
            first.closing_speed[slot] = splat(simd, contact.closing_speed);
            state.motion.is_wreck[slot] = splat(simd, 1.0);
        }
        let has_crashed = was_sound & state.motion.is_wreck[EGO_SLOT].simd_gt(0.0);
        end_after_ego_accident(state, params, has_crashed, step);
    }

    fn decide(&mut self, motion: &[f32], step: u32, output: Output<'_>) -> DriverOutput {
        self.set_motion(motion);
        let mut recorder = Recorder::resume(output, self.recorded);
        let Block {
            params,
            state,
            pairs,
            ..
        } = &mut *self.block;
        decide(
            state,
            params,
            &mut self.context,
            Some(&mut recorder),
            pairs,
            step,
            None,
        );
        self.record_due_frame(&mut recorder, step);
        self.recorded = recorder.progress();
        let Block { params, state, .. } = &*self.block;
        let table = self
            .row(|slot| state.controls.requested_accel[slot])
            .chain(self.row(|slot| state.controls.wheel_angle[slot]))
            .chain(self.row(|slot| state.road.curvature[slot]))
            .chain(self.row(|slot| state.vehicle(params, slot).road_velocity().1))
            .chain(self.row(|slot| state.motion.is_wreck[slot]))
            .collect();
        DriverOutput {
            table,
            lights: self.lights[..self.num_slots].to_vec(),
            end_step: state.end_step[0],
        }
    }

    fn steer(&mut self, wind_trim: &[f32]) -> Vec<f32> {
        let Block { params, state, .. } = &mut *self.block;
        let (simd, tick) = (params.simd, &self.tick);
        swap(&mut params.constants, &mut self.steering_constants);
        let params_of_tick = &*params;
        with_cpu_features!(simd, {
            for slot in 0..params_of_tick.num_slots_in_use {
                state.controls.wind_trim[slot] = splat(simd, wind_trim[slot]);
                if params_of_tick.road.varies_along_road() {
                    steer::<S, N, true>(state, params_of_tick, slot, tick);
                } else {
                    steer::<S, N, false>(state, params_of_tick, slot, tick);
                }
            }
        });
        swap(&mut params.constants, &mut self.steering_constants);
        let state = &self.block.state;
        self.row(|slot| state.controls.wheel_angle[slot]).collect()
    }

    fn record(
        &mut self,
        motion: &[f32],
        ego_stage: f32,
        ego_indicator: f32,
        step: u32,
        output: Output<'_>,
    ) {
        self.set_motion(motion);
        let Block { params, state, .. } = &mut *self.block;
        state.overtake.stage[EGO_SLOT] = splat(params.simd, ego_stage);
        state.controls.indicator[EGO_SLOT] = splat(params.simd, ego_indicator);
        let mut recorder = Recorder::resume(output, self.recorded);
        self.record_due_frame(&mut recorder, step);
        self.recorded = recorder.progress();
    }

    fn end_at(&mut self, step: u32) {
        let Block { params, state, .. } = &mut *self.block;
        state.end_step = splat(params.simd, step as f32);
    }

    fn end_step(&self) -> f32 {
        self.block.state.end_step[0]
    }

    fn is_ego_wrecked(&self) -> bool {
        self.block.state.motion.is_wreck[EGO_SLOT][0] > 0.0
    }

    fn finish(&mut self, output: Output<'_>) {
        let Block { params, state, .. } = &*self.block;
        let mut recorder = Recorder::resume(output, self.recorded);
        let tile = &self.tile;
        with_cpu_features!(params.simd, {
            recorder.write_tile(params, tile);
            recorder.finish(0, state, params);
        });
    }
}
