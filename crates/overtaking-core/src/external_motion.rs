//! Drivers of the model in one simulation whose vehicles another simulator moves, such as CARLA.
//!
//! The other simulator reports the motion of the vehicles; the drivers of the model perceive, decide and steer. All
//! lanes of a vector hold the same simulation, and results are read from the first lane. A *tick* is the time between
//! two decisions.

use std::array;
use std::mem::swap;
use std::sync::Arc;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::collisions::end_after_ego_accident;
use crate::decision_context::DecisionContext;
use crate::math::elementary::sincos;
use crate::math::vectors::{F32, splat, with_cpu_features};
use crate::names::ModelConstants;
use crate::overtake::EgoDecision;
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

/// Fields of `Motion` that the other simulator sets, in the order of the rows of a motion table, (field, slot).
///
/// Position `s` along and `d` across the road [m]; heading, the angle to the road [rad]; velocity [m/s], yaw rate
/// [rad/s] and acceleration [m/s^2] in the vehicle's axes, ahead and to the side. Lateral numbers and angles are
/// positive towards the overtaking side.
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
///
/// Requested acceleration [m/s^2]; wheel angle [rad], of a two-wheeler the lateral acceleration [m/s^2]; curvature of
/// the road at the vehicle [1/m]; speed across the road [m/s]; 1 for a wreck, else 0. The three lateral numbers are
/// positive towards the overtaking side.
pub const DRIVER_OUTPUT_FIELDS: &[&str] = &[
    "requested_accel",
    "wheel_angle",
    "curvature",
    "lateral_speed",
    "is_wreck",
];

/// Requests of the drivers to their vehicles after a decision.
pub struct DriverOutput {
    /// Rows as `DRIVER_OUTPUT_FIELDS`, (field, slot).
    pub table: Vec<f32>,
    /// Lamps of each vehicle in the last recorded frame as bits of `lights`, (slot).
    pub lights: Vec<u8>,
    /// Last step of the simulation, which an accident of the ego brings forward.
    pub end_step: f32,
}

/// The contact of a vehicle with another one, for which the other vehicle has a second `VehicleContact`.
#[derive(Clone, Copy)]
pub struct VehicleContact {
    /// Slot of the vehicle.
    pub slot: usize,
    /// Slot of the other vehicle.
    pub other_slot: usize,
    /// Time of the contact since the start of the simulation [s].
    pub time: f32,
    /// Size of the impulse [N s].
    pub impulse: f32,
    /// Closing speed before the contact [m/s].
    pub closing_speed: f32,
}

/// One simulation whose vehicles another simulator moves.
///
/// Steps are numbered from 0 and last 10 ms. `motion` is a table, (field, slot), with rows as `MOTION_FIELDS`; `output`
/// is the memory of the recording, the same in every call.
pub trait ExternallyMoved: Send + Sync {
    /// Record the first contact of each vehicle and make the vehicle a wreck. `step` may be before the first decision.
    fn record_contacts(&mut self, contacts: &[VehicleContact], step: i32);

    /// Let all drivers perceive this motion and decide, and record a frame if one is due at this step.
    fn decide(&mut self, motion: &[f32], step: u32, output: Output<'_>) -> DriverOutput;

    /// Turn the front wheels for one tick.
    ///
    /// `wind_trim` is the part of the wheel angle that compensates crosswind, (slot). Returns the wheel angles, (slot).
    /// Both are in rad. For two-wheelers, which lean, both are lateral accelerations [m/s^2].
    fn steer(&mut self, wind_trim: &[f32]) -> Vec<f32>;

    /// Record a frame, if one is due at this step, in which the drivers of the other simulator drive all vehicles.
    ///
    /// `ego_stage` is a code of `stage`. `ego_indicator` is 1 towards the overtaking side, -1 towards the kerb side,
    /// and 0 off.
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

/// Prepare a simulation with the drivers of the model from a batch of one simulation.
///
/// `tick` is the time between two decisions [s], in which one call of `steer` turns the wheels. The function is
/// generic, so the crate that calls it compiles it, as with `simulate`.
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
    /// State and parameters of the simulation.
    block: Box<Block<'static, S, N>>,
    /// Perception of the drivers at the present decision.
    context: DecisionContext<S, N>,
    /// Recorded frames that are not yet in `output`.
    tile: FrameTile<N>,
    /// Progress of the recorder after the last frame: a recorder borrows `output`, so it lives for one call only.
    recorder_progress: RecorderProgress,
    num_slots: usize,
    steps_per_frame: u32,
    /// Constants while the wheels turn; see `begin`.
    steering_constants: Arc<ModelConstants>,
    /// A step as long as a tick.
    tick: StepLength,
    /// Lamps in the last recorded frame.
    lights: [u8; N],
}

impl<S: Simd, const N: usize> ExternalMotion<S, N> {
    /// Begin before the first decision.
    fn begin(
        simd: S,
        inputs: &Inputs<'_>,
        tick: f32,
        output: Output<'_>,
    ) -> Box<dyn ExternallyMoved> {
        // Two-wheelers of the other simulator lean within a tick, on average half a tick late. This replaces the lag of
        // the model.
        let steering_constants = ModelConstants {
            two_wheeler_lag: 0.5 * tick,
            ..*inputs.constants
        };
        Box::new(Self {
            // Simulation 0 of the batch in every lane, without a recorder.
            block: Block::new(simd, inputs, &[0], None, new_history()),
            context: DecisionContext::new(simd),
            tile: FrameTile::default(),
            recorder_progress: Recorder::<N>::new(vec![output]).progress(),
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
            // In the order of `MOTION_FIELDS`.
            let [s, d, heading, vx, vy, yaw_rate, accel_lon, accel_lat] =
                array::from_fn(|row| splat(params.simd, motion[row * self.num_slots + slot]));
            let vehicle_motion = &mut state.motion;
            (vehicle_motion.s[slot], vehicle_motion.d[slot]) = (s, d);
            vehicle_motion.heading[slot] = heading;
            (
                vehicle_motion.sin_heading[slot],
                vehicle_motion.cos_heading[slot],
            ) = sincos(heading);
            (vehicle_motion.vx[slot], vehicle_motion.vy[slot]) = (vx, vy);
            vehicle_motion.yaw_rate[slot] = yaw_rate;
            vehicle_motion.accel_lon[slot] = accel_lon;
            vehicle_motion.accel_lat[slot] = accel_lat;
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

    /// A row of a table: `value_of(slot)` in the first lane, for each slot.
    fn row(&self, value_of: impl Fn(usize) -> F32<S>) -> impl Iterator<Item = f32> {
        (0..self.num_slots).map(move |slot| value_of(slot)[0])
    }
}

impl<S: Simd, const N: usize> ExternallyMoved for ExternalMotion<S, N> {
    fn record_contacts(&mut self, contacts: &[VehicleContact], step: i32) {
        let Block { params, state, .. } = &mut *self.block;
        let simd = params.simd;
        let was_sound = state.motion.is_wreck[EGO_SLOT].simd_eq(0.0);
        for contact in contacts {
            let (slot, first_contact) = (contact.slot, &mut state.first_contact);
            let has_earlier_contact = first_contact.partner[slot][0] >= 0.0;
            if has_earlier_contact {
                continue;
            }
            first_contact.partner[slot] = splat(simd, contact.other_slot as f32);
            first_contact.time[slot] = splat(simd, contact.time);
            first_contact.impulse[slot] = splat(simd, contact.impulse);
            first_contact.closing_speed[slot] = splat(simd, contact.closing_speed);
            state.motion.is_wreck[slot] = splat(simd, 1.0);
        }
        let has_crashed = was_sound & state.motion.is_wreck[EGO_SLOT].simd_gt(0.0);
        end_after_ego_accident(state, params, has_crashed, step);
    }

    fn decide(&mut self, motion: &[f32], step: u32, output: Output<'_>) -> DriverOutput {
        self.set_motion(motion);
        let mut recorder = Recorder::resume(output, self.recorder_progress);
        let Block { params, state, .. } = &mut *self.block;
        let ego_decision = EgoDecision { step, action: None };
        let context = &mut self.context;
        decide(state, params, context, Some(&mut recorder), &ego_decision);
        self.record_due_frame(&mut recorder, step);
        self.recorder_progress = recorder.progress();
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
        // Two-wheelers lean with another lag than in the model, see `begin`.
        swap(&mut params.constants, &mut self.steering_constants);
        let steering_params = &*params;
        with_cpu_features!(simd, {
            for slot in 0..steering_params.num_slots_in_use {
                state.controls.wind_trim[slot] = splat(simd, wind_trim[slot]);
                if steering_params.road.varies_along_road() {
                    steer::<S, N, true>(state, steering_params, slot, tick);
                } else {
                    steer::<S, N, false>(state, steering_params, slot, tick);
                }
            }
        });
        // Decisions use the constants of the model again.
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
        let mut recorder = Recorder::resume(output, self.recorder_progress);
        self.record_due_frame(&mut recorder, step);
        self.recorder_progress = recorder.progress();
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
        let mut recorder = Recorder::resume(output, self.recorder_progress);
        let tile = &self.tile;
        with_cpu_features!(params.simd, {
            recorder.write_tile(params, tile);
            recorder.finish(0, state, params);
        });
    }
}
