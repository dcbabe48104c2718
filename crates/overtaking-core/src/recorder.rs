//! Recorded integers of a block, rounded from its states, and the hash over them; the twin of
//! `overtaking.sim.reference.recorder`.
//!
//! The ego is the vehicle under study. A *percept* records its beliefs about three vehicles at a manoeuvre, beside the
//! true values: the leader, and the leader and the follower in the lane that the ego enters. A *frame* is a recorded
//! instant, a *word* a recorded integer that is hashed, a *tile* sixteen frames that are written to the outputs
//! together. A vehicle's *slot* is its number in the simulation; some slots of a simulation may be empty. The slot 255
//! stands for no vehicle. In the state, left is the overtaking side.
//!
//! A block consists of up to sixteen simulations that are computed together. `N` is the number of slots. Values of type
//! `F32<S>` and `Mask<S>` have one element for each; `lane` is the index of a simulation in them, a SIMD lane, except
//! in `state_words`.

pub(crate) mod frame_tiles;
pub(crate) mod output;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::decision_context::DriverContext;
use crate::gap_acceptance::Intent;
use crate::math::vectors::{CopyLane, F32, Mask, SIMD_LANES, clamp_to, select, splat};
use crate::names::lights;
use crate::oncoming::OncomingVehicle;
use crate::params::{Params, RoadPose};
use crate::recorder::frame_tiles::{
    FRAMES_PER_TILE, FrameTile, NUM_PACKED_WORDS, NUM_STATE_WORDS, Row, pack_words, put_tile,
    transpose,
};
use crate::recorder::output::{MAX_PERCEPTS, Output};
use crate::state::{
    EGO_SLOT, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
    is_leader_role,
};
use crate::vehicle_handle::VehicleHandle;

/// Kinds of manoeuvres of the ego at which a percept is recorded.
#[derive(Clone, Copy)]
pub enum ManoeuvreKind {
    /// The ego starts to pull out.
    PullOut = 0,
    /// The ego starts to return.
    Return = 1,
    /// The ego cancels a lane change that is under way.
    Cancel = 2,
}

/// A manoeuvre of the ego at which a percept is recorded.
struct RecordedManoeuvre<'a, S: Simd> {
    /// Simulations in which the ego makes the manoeuvre at this step.
    is_made: Mask<S>,
    /// Kind of the manoeuvre.
    kind: ManoeuvreKind,
    /// Roles of the leader, and of the leader and the follower in the lane that the ego enters.
    roles: [usize; 3],
    /// Oncoming vehicle, which is recorded in place of the leader in the left lane; `None` to record that leader.
    oncoming: Option<&'a OncomingVehicle<S>>,
    /// Time of the manoeuvre in steps of 10 ms, in which the simulation counts time.
    step: u32,
}

/// Collects the recorded integers of a block and hashes them.
pub struct Recorder<'a, const N: usize> {
    /// Output of the simulation in each lane; `None` in free lanes.
    out: [Option<Output<'a>>; SIMD_LANES],
    /// The four accumulators of the hash of each simulation.
    hash: [[u32; SIMD_LANES]; 4],
    /// Number of frames that each simulation has recorded.
    num_frames: [usize; SIMD_LANES],
    /// First frame of the present tile; the frames before it are in the outputs.
    tile_start: usize,
}

/// Hash and counters of a recorder, as in `Recorder`. They outlive the recorder, which borrows the outputs.
#[derive(Clone, Copy)]
pub struct RecorderProgress {
    hash: [[u32; SIMD_LANES]; 4],
    num_frames: [usize; SIMD_LANES],
    tile_start: usize,
}

impl<'a, const N: usize> Recorder<'a, N> {
    /// A recorder that continues a recording, in lane 0; `output` holds the frames up to `progress`.
    pub fn resume(output: Output<'a>, progress: RecorderProgress) -> Self {
        let mut output = Some(output);
        Self {
            out: core::array::from_fn(|_| output.take()),
            hash: progress.hash,
            num_frames: progress.num_frames,
            tile_start: progress.tile_start,
        }
    }

    /// Hash and counters, from which `resume` continues.
    pub fn progress(&self) -> RecorderProgress {
        RecorderProgress {
            hash: self.hash,
            num_frames: self.num_frames,
            tile_start: self.tile_start,
        }
    }

    /// A recorder of the simulations in the first lanes, at most sixteen.
    pub fn new(mut outputs: Vec<Output<'a>>) -> Self {
        outputs.iter_mut().for_each(clear);
        let mut outputs = outputs.into_iter();
        Self {
            out: core::array::from_fn(|_| outputs.next()),
            hash: hash_start(),
            num_frames: [0; SIMD_LANES],
            tile_start: 0,
        }
    }

    /// Move the recording in `source_lane` of another recorder, which has written as many tiles, into `lane`.
    pub fn take_over(&mut self, lane: usize, source: &mut Self, source_lane: usize) {
        debug_assert_eq!(self.tile_start, source.tile_start);
        self.out[lane] = source.out[source_lane].take();
        self.hash.copy_lane(lane, &source.hash, source_lane);
        self.num_frames[lane] = source.num_frames[source_lane];
    }

    /// Record and hash one frame of the simulations that still run.
    #[inline(always)]
    pub fn record_frame<S: Simd>(
        &mut self,
        state: &State<S, N>,
        params: &Params<S, N>,
        is_running: Mask<S>,
        frame: usize,
        tile: &mut FrameTile<N>,
    ) {
        let simd = params.simd;
        let [h0, h1, h2, h3] = self.hash;
        let mut hash = [
            u32x16::simd_from(simd, h0),
            u32x16::simd_from(simd, h1),
            u32x16::simd_from(simd, h2),
            u32x16::simd_from(simd, h3),
        ];
        let row = frame - self.tile_start; // Of the tile, 0 to 15.
        for slot in 0..params.num_slots_in_use {
            let valid = params.vehicles[slot].valid.simd_gt(0.0);
            let words = state.vehicle(params, slot).state_words();
            // Each word goes to the next of four accumulators. Empty slots are not hashed, so the hash is the same for
            // any number of slots.
            for (k, word) in words.into_iter().enumerate() {
                hash[k % 4] = mix(hash[k % 4], word, is_running & valid);
            }
            // Narrow integers of a vehicle share a word of the tile.
            for (k, word) in pack_words(simd, &words).into_iter().enumerate() {
                tile.0[(slot * NUM_PACKED_WORDS + k) * FRAMES_PER_TILE + row] =
                    Row(word.to_array());
            }
            // Frame k of the tile prefetches the memory of lane k, so after sixteen frames all lanes are in the cache.
            if valid.test(row) {
                self.prefetch_rows(slot, row);
            }
        }
        let stage: i32x16<S> = state.overtake.stage[EGO_SLOT].to_int();
        let has_no_partner = state.first_contact.partner[EGO_SLOT].simd_lt(0.0);
        let partner: i32x16<S> = state.first_contact.partner[EGO_SLOT].to_int();
        let partner = has_no_partner.select(i32x16::splat(simd, NO_VEHICLE), partner);
        let frame_word = i32x16::splat(simd, frame as i32);
        let zero = i32x16::splat(simd, 0);
        for (k, word) in [stage, partner, frame_word, zero].into_iter().enumerate() {
            hash[k] = mix(hash[k], word, is_running);
        }
        for (stored_word, word) in self.hash.iter_mut().zip(hash) {
            *stored_word = word.to_array();
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| is_running.test(lane)) {
                out.stage[frame] = stage[lane] as u8;
                out.collided_with[frame] = partner[lane] as u8;
                self.num_frames[lane] = frame + 1;
            }
        }
        if row + 1 == FRAMES_PER_TILE {
            // A function of its own, compiled for the SIMD features of the CPU.
            simd.vectorize(
                #[inline(always)]
                || self.write_tile(params, tile),
            );
            self.tile_start = frame + 1;
        }
    }

    /// Load the memory for the tile of the vehicle in `slot` in one lane into the cache.
    ///
    /// Without this the CPU would wait for each cache line of the memory when the tile is written. It can load only few
    /// lines at a time, so each call requests the lines of one vehicle.
    #[inline(always)]
    fn prefetch_rows(&self, slot: usize, lane: usize) {
        if let Some(out) = self.out[lane].as_ref() {
            frame_tiles::prefetch_rows(out, slot * out.frames + self.tile_start);
        }
    }

    /// Move the frames of the tile to the outputs, where the frames of one vehicle are adjacent.
    ///
    /// The tile may hold frames after the end of a simulation; `finish` clears them in the outputs.
    #[inline(always)]
    pub fn write_tile<S: Simd>(&mut self, params: &Params<S, N>, tile: &FrameTile<N>) {
        let start = self.tile_start;
        if self
            .num_frames
            .iter()
            .all(|num_frames| *num_frames <= start)
        {
            return;
        }
        for slot in 0..params.num_slots_in_use {
            let exists = params.vehicles[slot].valid.simd_gt(0.0);
            for k in 0..NUM_PACKED_WORDS {
                let first = (slot * NUM_PACKED_WORDS + k) * FRAMES_PER_TILE;
                let rows = transpose(params.simd, &tile.0[first..first + SIMD_LANES]);
                for (lane, (out, Row(row))) in self.out.iter_mut().zip(&rows).enumerate() {
                    if let Some(out) = out.as_mut().filter(|_| exists.test(lane)) {
                        put_tile(out, slot, k, start, row);
                    }
                }
            }
        }
    }

    /// Record a percept at each manoeuvre that the ego starts or cancels.
    #[inline(always)]
    pub fn record_manoeuvres<S: Simd>(
        &mut self,
        state: &mut State<S, N>,
        params: &Params<S, N>,
        context: &DriverContext<S>,
        intent: &Intent<S>,
        step: u32,
    ) {
        let left = [LEADER, LEFT_LEADER, LEFT_FOLLOWER];
        let right = [LEADER, RIGHT_LEADER, RIGHT_FOLLOWER];
        // On two-way roads the ego enters the opposing lane: its new leader is the oncoming vehicle, its new follower a
        // vehicle that overtakes behind it.
        let has_oncoming_traffic = params.road.directions.has_oncoming_traffic;
        let oncoming = has_oncoming_traffic.then_some(&context.oncoming.nearest);
        for (is_made, kind, roles, oncoming) in [
            (
                intent.starts_pull_out,
                ManoeuvreKind::PullOut,
                left,
                oncoming,
            ),
            // A cancelled lane change leads back to the lane that the ego has left. On two-way roads no driver cancels
            // a return.
            (intent.cancels_pull_out, ManoeuvreKind::Cancel, right, None),
            (intent.cancels_return, ManoeuvreKind::Cancel, left, None),
            (intent.starts_return, ManoeuvreKind::Return, right, None),
        ] {
            let manoeuvre = RecordedManoeuvre {
                is_made,
                kind,
                roles,
                oncoming,
                step,
            };
            self.record_percept(state, params, context, &manoeuvre);
        }
    }

    /// Record the percept of a manoeuvre, up to `MAX_PERCEPTS` in a simulation.
    #[inline(always)]
    fn record_percept<S: Simd>(
        &mut self,
        state: &mut State<S, N>,
        params: &Params<S, N>,
        context: &DriverContext<S>,
        manoeuvre: &RecordedManoeuvre<'_, S>,
    ) {
        let RecordedManoeuvre {
            is_made,
            kind,
            roles,
            oncoming,
            step,
        } = *manoeuvre;
        let now = splat(params.simd, step as f32);
        let has_space = state.num_percepts.simd_lt(MAX_PERCEPTS as f32);
        let is_recorded = is_made & has_space & now.simd_le(state.end_step);
        if !is_recorded.any_true() {
            return;
        }
        for (position, role) in roles.into_iter().enumerate() {
            let percept = match oncoming.filter(|_| role == LEFT_LEADER) {
                Some(oncoming) => oncoming_percept(state, params, oncoming),
                None => neighbour_percept(state, params, context, role),
            };
            let gap = to_recorded_integers(percept.gap, INTEGERS_PER_UNIT, INT32_LIMIT);
            let closing_speed =
                to_recorded_integers(percept.closing_speed, INTEGERS_PER_UNIT, INT32_LIMIT);
            let true_gap = to_recorded_integers(percept.true_gap, INTEGERS_PER_UNIT, INT32_LIMIT);
            let true_closing_speed =
                to_recorded_integers(percept.true_closing_speed, INTEGERS_PER_UNIT, INT32_LIMIT);
            for (lane, out) in self.out.iter_mut().enumerate() {
                let Some(out) = out.as_mut().filter(|_| is_recorded.test(lane)) else {
                    continue;
                };
                let index = state.num_percepts[lane] as usize * 3 + position;
                let slot = percept.slot[lane];
                let exists = slot >= 0.0;
                out.percept_slot[index] = if exists { slot as u8 } else { 255 };
                out.percept_is_detected[index] = u8::from(percept.is_detected.test(lane));
                out.percept_gap[index] = gap[lane];
                out.percept_closing_speed[index] = closing_speed[lane];
                out.percept_true_gap[index] = if exists { true_gap[lane] } else { 0 };
                out.percept_true_closing_speed[index] =
                    if exists { true_closing_speed[lane] } else { 0 };
            }
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| is_recorded.test(lane)) {
                let index = state.num_percepts[lane] as usize;
                out.percept_valid[index] = 1;
                out.percept_kind[index] = kind as u8;
                out.percept_time[index] = step as i32 * 10; // Steps last 10 ms.
            }
        }
        state.num_percepts = select(is_recorded, state.num_percepts + 1.0, state.num_percepts);
    }

    /// Finish the output of a simulation that has ended: clear the frames after its end, write contacts and hash.
    ///
    /// The lane is free afterwards.
    pub fn finish<S: Simd>(&mut self, lane: usize, state: &State<S, N>, params: &Params<S, N>) {
        let Some(mut out) = self.out[lane].take() else {
            return;
        };
        let mut hash = self.hash.map(|word| word[lane]);
        clear_after_last_frame(&mut out, self.num_frames[lane], lane, params);
        put_contacts(&mut out, &mut hash, lane, state, params);
        mix_percepts(&mut hash, &out);
        out.num_frames[0] = self.num_frames[lane] as i32;
        out.trace_hash.copy_from_slice(&digest(hash));
    }
}

/// The part of a percept about one vehicle.
struct Percept<S: Simd> {
    /// Slot of the vehicle, or `NO_SLOT`.
    slot: F32<S>,
    /// Whether the ego has detected it.
    is_detected: Mask<S>,
    /// Believed gap [m].
    gap: F32<S>,
    /// Believed closing speed [m/s].
    closing_speed: F32<S>,
    /// True gap [m].
    true_gap: F32<S>,
    /// True closing speed [m/s].
    true_closing_speed: F32<S>,
}

/// The part of a percept about the neighbour in `role`.
#[inline(always)]
fn neighbour_percept<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    context: &DriverContext<S>,
    role: usize,
) -> Percept<S> {
    let (neighbours, beliefs) = (&context.neighbours, &context.beliefs);
    let slot = neighbours.slot[role];
    let (ego_speed, _) = state.vehicle(params, EGO_SLOT).road_velocity(); // Along and across the road.
    let speed = state.road_speed_at(params, slot);
    Percept {
        slot,
        is_detected: beliefs.is_detected[role],
        gap: beliefs.gap[role],
        closing_speed: beliefs.closing_speed[role],
        true_gap: neighbours.gap[role],
        true_closing_speed: if is_leader_role(role) {
            ego_speed - speed
        } else {
            speed - ego_speed
        },
    }
}

/// The part of a percept about an oncoming vehicle.
#[inline(always)]
fn oncoming_percept<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    oncoming: &OncomingVehicle<S>,
) -> Percept<S> {
    let (ego_speed, _) = state.vehicle(params, EGO_SLOT).road_velocity(); // Along and across the road.
    Percept {
        slot: oncoming.slot,
        is_detected: oncoming.is_detected,
        gap: oncoming.believed_gap,
        closing_speed: oncoming.closing_speed,
        true_gap: oncoming.gap,
        // Each speed counts along the vehicle's own direction of travel.
        true_closing_speed: ego_speed + state.road_speed_at(params, oncoming.slot),
    }
}

/// Clear the outputs that a simulation may leave unwritten, except the state fields.
fn clear(out: &mut Output<'_>) {
    out.percept_valid.fill(0);
    out.percept_slot.fill(255);
    out.collided_with.fill(255);
    for slice in [
        &mut *out.percept_kind,
        &mut *out.percept_is_detected,
        &mut *out.stage,
    ] {
        slice.fill(0);
    }
    for slice in [
        &mut *out.percept_time,
        &mut *out.percept_gap,
        &mut *out.percept_closing_speed,
        &mut *out.percept_true_gap,
        &mut *out.percept_true_closing_speed,
    ] {
        slice.fill(0);
    }
}

/// Clear the state fields after the last frame, and all state fields of empty slots.
///
/// To save time, the function clears only frames that may have been written; `written` counts them, and the others are
/// zero.
fn clear_after_last_frame<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    recorded_frames: usize,
    lane: usize,
    params: &Params<S, N>,
) {
    let max_frames = out.frames;
    for slot in 0..out.slots {
        let is_used = params.vehicles[slot].valid[lane] > 0.0;
        let num_frames = if is_used { recorded_frames } else { 0 };
        let num_written = (out.written[slot].max(0) as usize).clamp(num_frames, max_frames);
        out.written[slot] = num_frames as i32;
        let first = slot * max_frames;
        frame_tiles::clear(out, first + num_frames..first + num_written);
    }
}

/// Write the first contact of each vehicle, and add it to the hash.
fn put_contacts<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    hash: &mut [u32; 4],
    lane: usize,
    state: &State<S, N>,
    params: &Params<S, N>,
) {
    for slot in 0..out.slots {
        let partner = state.first_contact.partner[slot][lane];
        let partner_word = if partner < 0.0 { 255 } else { partner as u8 };
        let time = to_recorded_integers(
            state.first_contact.time[slot],
            INTEGERS_PER_UNIT,
            INT32_LIMIT,
        )[lane];
        let impulse =
            to_recorded_integers(state.first_contact.impulse[slot], 1.0, INT32_LIMIT)[lane];
        let speed = to_recorded_integers(
            state.first_contact.closing_speed[slot],
            INTEGERS_PER_UNIT,
            INT32_LIMIT,
        )[lane];
        out.contact_partner[slot] = partner_word;
        out.contact_time[slot] = time;
        out.contact_impulse[slot] = impulse;
        out.contact_speed[slot] = speed;
        // Empty slots are not hashed, so the hash is the same for any number of slots.
        if params.vehicles[slot].valid[lane] == 0.0 {
            continue;
        }
        let words = [
            u32::from(partner_word),
            time as u32,
            impulse as u32,
            speed as u32,
        ];
        for (hash, word) in hash.iter_mut().zip(words) {
            *hash = mix_word(*hash, word);
        }
    }
}

/// Add the percepts to the hash.
fn mix_percepts(hash: &mut [u32; 4], out: &Output<'_>) {
    for index in 0..MAX_PERCEPTS {
        if out.percept_valid[index] == 0 {
            continue;
        }
        let mut words = vec![
            u32::from(out.percept_kind[index]),
            out.percept_time[index] as u32,
        ];
        for k in index * 3..index * 3 + 3 {
            words.extend([
                u32::from(out.percept_slot[k]),
                u32::from(out.percept_is_detected[k]),
                out.percept_gap[k] as u32,
                out.percept_closing_speed[k] as u32,
                out.percept_true_gap[k] as u32,
                out.percept_true_closing_speed[k] as u32,
            ]);
        }
        for (k, word) in words.into_iter().enumerate() {
            // Each word goes to the next of four accumulators.
            hash[k % 4] = mix_word(hash[k % 4], word);
        }
    }
}

/// Recorded slot without a vehicle, and recorded lane of a vehicle beyond the kerb edge.
pub const NO_VEHICLE: i32 = 255;
/// Largest recorded integer of 16 bits.
const INT16_LIMIT: f32 = 32767.0;
/// Largest recorded integer of 32 bits, well below 2^31, so that no float32 rounds up to it.
pub const INT32_LIMIT: f32 = 2.0e9;
/// 1 / (2 pi).
const TURNS_PER_RADIAN: f32 = 0.159_154_94;
/// Recorded integers per m, s, m/s or m/s^2.
pub const INTEGERS_PER_UNIT: f32 = 1000.0;
/// Recorded integers per rad or rad/s.
const INTEGERS_PER_RADIAN: f32 = 10000.0;

/// `value` as a multiple of 1 / `scale`, rounded half to even and clamped to +- `limit`.
#[inline(always)]
pub fn to_recorded_integers<S: Simd>(value: F32<S>, scale: f32, limit: f32) -> i32x16<S> {
    clamp_to(value * scale, -limit, limit)
        .round_ties_even()
        .to_int()
}

/// The same angle between -pi and pi [rad].
#[inline(always)]
fn wrap_angle<S: Simd>(angle: F32<S>) -> F32<S> {
    let turns = (angle * TURNS_PER_RADIAN).round_ties_even();
    angle - turns * core::f32::consts::TAU
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The recorded integers of the vehicle: x, y, s, d, speed, heading, wheel angle, longitudinal and lateral
    /// acceleration, yaw rate, lane, lights.
    ///
    /// The macro `with_states` lists the fields in the same order. `overtaking_sign` converts lateral values from the
    /// overtaking side to the real left, which differs in left-hand traffic. On a curved road Python replaces x, y and
    /// heading.
    #[inline(always)]
    pub fn state_words(self) -> [i32x16<S>; NUM_STATE_WORDS] {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (road, vehicle) = (&params.road, self.vehicle());
        let RoadPose {
            x0,
            y0,
            heading,
            cosine,
            sine,
        } = road.pose;
        let (s, mirrored_d) = self.road_position();
        let d = road.overtaking_sign * mirrored_d;
        // Lanes are counted from the kerb side. On the left of all lanes of the road's direction, in the opposing lane
        // or beside the road, the index is the number of these lanes.
        let mut lane = i32x16::splat(params.simd, NO_VEHICLE);
        for index in 0..=road.directions.num_own_lanes {
            let is_beyond_line = mirrored_d.simd_ge(road.boundaries[index]);
            lane = is_beyond_line.select(i32x16::splat(params.simd, index as i32), lane);
        }
        let speed = (state.motion.vx[slot] * state.motion.vx[slot]
            + state.motion.vy[slot] * state.motion.vy[slot])
            .sqrt();
        // A two-wheeler leans; its state holds a lateral acceleration instead of an angle.
        let wheel_angle = select(
            vehicle.two_wheeler.simd_gt(0.0),
            splat(params.simd, 0.0),
            state.controls.wheel_angle[slot],
        );
        let mut world_heading = heading + road.overtaking_sign * state.motion.heading[slot];
        if road.directions.has_oncoming_traffic {
            // Vehicles against the road head the other way. Their angles and lateral accelerations are positive to
            // their own left, `d` to the left of the road.
            let half_turn = splat(params.simd, core::f32::consts::PI);
            world_heading += select(
                vehicle.travel_sign.simd_lt(0.0),
                half_turn,
                splat(params.simd, 0.0),
            );
        }
        [
            to_recorded_integers(x0 + s * cosine - d * sine, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(y0 + s * sine + d * cosine, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(s, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(d, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(speed, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(wrap_angle(world_heading), INTEGERS_PER_RADIAN, INT16_LIMIT),
            to_recorded_integers(
                road.overtaking_sign * wheel_angle,
                INTEGERS_PER_RADIAN,
                INT16_LIMIT,
            ),
            to_recorded_integers(state.motion.accel_lon[slot], INTEGERS_PER_UNIT, INT16_LIMIT),
            to_recorded_integers(
                road.overtaking_sign * state.motion.accel_lat[slot],
                INTEGERS_PER_UNIT,
                INT16_LIMIT,
            ),
            to_recorded_integers(
                road.overtaking_sign * state.motion.yaw_rate[slot],
                INTEGERS_PER_RADIAN,
                INT16_LIMIT,
            ),
            lane,
            self.recorded_lights(),
        ]
    }

    /// Sum of the bits of `lights` that are on.
    #[inline(always)]
    pub(crate) fn recorded_lights(self) -> i32x16<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let towards_left = params.road.overtaking_sign * state.controls.indicator[slot];
        let left = towards_left.simd_gt(0.0).select(
            i32x16::splat(params.simd, lights::INDICATOR_LEFT),
            i32x16::splat(params.simd, 0),
        );
        let right = towards_left.simd_lt(0.0).select(
            i32x16::splat(params.simd, lights::INDICATOR_RIGHT),
            i32x16::splat(params.simd, 0),
        );
        // A wreck requests no braking, but slides with locked wheels; that it shows stop lamps is a choice.
        let shows_stop_lamps = state.controls.requested_accel[slot]
            .simd_lt(-params.constants.stop_lamp_decel)
            | state.motion.is_wreck[slot].simd_gt(0.0);
        // Low beam and fog lamps, which stay as they are.
        let initial_lights: i32x16<S> = self.vehicle().initial_lights.to_int();
        let lamps = initial_lights
            + left
            + right
            + shows_stop_lamps.select(
                i32x16::splat(params.simd, lights::BRAKE),
                i32x16::splat(params.simd, 0),
            );
        if !params.road.directions.has_oncoming_traffic {
            return lamps;
        }
        // Drivers flash the high beam only at oncoming vehicles.
        let flashes = state.controls.flashes_high_beam[slot].simd_gt(0.0);
        lamps
            + flashes.select(
                i32x16::splat(params.simd, lights::HIGH_BEAM),
                i32x16::splat(params.simd, 0),
            )
    }
}

// Primes of xxHash32.
const PRIME_1: u32 = 2_654_435_761;
const PRIME_2: u32 = 2_246_822_519;
const PRIME_3: u32 = 3_266_489_917;

/// The four accumulators of each simulation at the start, the start values of xxHash32 with seed 0.
pub fn hash_start() -> [[u32; SIMD_LANES]; 4] {
    [
        PRIME_1.wrapping_add(PRIME_2),
        PRIME_2,
        0,
        0u32.wrapping_sub(PRIME_1),
    ]
    .map(|word| [word; SIMD_LANES])
}

/// Mix a word into one accumulator of each simulation where `mask` holds: a round of xxHash32 (Collet 2012).
#[inline(always)]
pub fn mix<S: Simd>(hash: u32x16<S>, word: i32x16<S>, mask: Mask<S>) -> u32x16<S> {
    let word: u32x16<S> = word.bitcast();
    let sum = hash + word * PRIME_2;
    let mixed = ((sum << 13) | (sum >> 19)) * PRIME_1;
    mask.select(mixed, hash)
}

/// Mix a word into one accumulator of a single simulation, as `mix`.
#[inline(always)]
pub fn mix_word(hash: u32, word: u32) -> u32 {
    hash.wrapping_add(word.wrapping_mul(PRIME_2))
        .rotate_left(13)
        .wrapping_mul(PRIME_1)
}

/// The hash of a simulation, from its four accumulators.
///
/// Each word combines two accumulators and ends with the final mix of xxHash32, by which each bit of the input changes
/// about half of the bits of the word.
pub fn digest(hash: [u32; 4]) -> [u32; 4] {
    core::array::from_fn(|k| {
        let word = hash[k].wrapping_add(hash[(k + 1) % 4].rotate_left(7));
        let word = (word ^ (word >> 15)).wrapping_mul(PRIME_2);
        let word = (word ^ (word >> 13)).wrapping_mul(PRIME_3);
        word ^ (word >> 16)
    })
}
