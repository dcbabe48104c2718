//! Signals of other vehicles: gaps to all neighbours, occupancy of the left lane, and the overtaken vehicle.
//!
//! They are computed apart from `ego_signals`, because few callers read them. Left is the overtaking side. A slot is
//! the number of a vehicle in its simulation; the ego has slot 0. A role is one of six: leader or follower in the ego's
//! lane, in the lane to the left or in the lane to the right.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use overtaking_core::dispatch;
use rayon::prelude::*;

use crate::ego_signals::lateral_speed;
use crate::frame_block::{Footprint, FrameBlock, for_each_frame_block};
use crate::recording::{
    METRES_PER_MM, NO_VEHICLE, NUM_ROLES, PackedRecording, SignalViews, is_ahead, signal_outputs,
    span_frames,
};
use crate::vectors::{F32, SIMD_LANES, select, splat};

/// Distance ahead of and behind the ego over which the occupancy of the left lane is measured, a choice [mm]. It has
/// the value of `OCCUPANCY_REACH_MM` in `overtaking.labels.snapshots`.
const OCCUPANCY_REACH_MM: i32 = 100_000;
/// Smallest number of simulations that a thread takes at a time, a choice: one takes less than a microsecond.
const SIMULATIONS_PER_TASK: usize = 64;

// Declares `NeighbourSignals`, and with the token `$` the macro `with_neighbour_signals`, which lists its fields.
signal_outputs! {
    ($) with_neighbour_signals
    /// Arrays for gaps to the neighbours and for the left lane.
    NeighbourSignals:
    /// Gap between the bumpers [m].
    gap: f32, NUM_ROLES;
    /// Speed at which the gap shrinks [m/s].
    closing_speed: f32, NUM_ROLES;
    /// Gap between the sides, negative where the vehicles overlap across the road [m].
    lateral_gap: f32, NUM_ROLES;
    /// Share of the left lane within `OCCUPANCY_REACH_MM` that vehicles cover [1].
    left_occupancy: f32, 1;
    /// Number of vehicles in the left lane, at any distance as in the study of Pinto, Dutra and Fonseca.
    left_count: u8, 1;
}

signal_outputs! {
    ($) with_target_signals
    /// Arrays for the signals of the overtaken vehicle, the target.
    TargetSignals:
    /// Whether the target has a state in a frame.
    valid: bool, 1;
    /// Centre of the ego minus centre of the target, along the road [m].
    ego_lead: f32, 1;
    /// Whether both overlap along the road.
    overlaps: bool, 1;
    /// Gap between the bumpers [m].
    gap: f32, 1;
    /// Lateral position, positive to the left [m].
    lateral_position: f32, 1;
    /// Gap between the sides, negative where both overlap across the road [m].
    lateral_gap: f32, 1;
    /// Lane index.
    lane: u8, 1;
    /// Speed [m/s].
    speed: f32, 1;
    /// Acceleration [m/s^2].
    accel: f32, 1;
    /// Lateral speed, positive to the left [m/s].
    lateral_speed: f32, 1;
}

/// Compute gaps to the neighbours of the ego and the occupancy of its left lane.
///
/// `neighbour_slot` has shape (simulation, role, frame), as `ego_signals` fills it.
pub fn neighbour_signals(
    recording: &PackedRecording<'_>,
    neighbour_slot: &[u8],
    level: Level,
    out: &mut NeighbourSignals<'_>,
) {
    let len = NUM_ROLES * recording.max_frames;
    // The arrays come with undefined contents, so no frame of them is known to be zero.
    let mut zero_from = vec![i32::MAX; recording.num_frames.len()];
    out.fill(
        recording,
        &mut zero_from,
        |simulation, num_computed, out| {
            let neighbour_slot = &neighbour_slot[simulation * len..(simulation + 1) * len];
            dispatch!(level, |simd| for_each_frame_block!(
                FrameBlock::new(simd, recording, simulation),
                num_computed,
                |block| {
                    block.neighbour_gaps(neighbour_slot, out);
                    block.left_lane(out);
                }
            ));
        },
    );
}

impl<S: Simd> FrameBlock<'_, S> {
    /// Write the gaps to all neighbours, zero for a role without a vehicle.
    #[inline(always)]
    fn neighbour_gaps(&self, neighbour_slot: &[u8], out: &mut NeighbourSignals<'_>) {
        let (recording, ego, zero) = (self.recording, self.row(0), splat(self.simd, 0.0));
        let max_frames = recording.max_frames;
        let (ego_s, ego_speed) = (self.load(recording.s[ego]), self.load(recording.speed[ego]));
        let ego_footprint = self.footprint(ego);
        // Gap, closing speed and lateral gap of each role.
        let mut results = [[zero; 3]; NUM_ROLES];
        for slot in 1..recording.num_slots {
            let row = self.row(slot);
            let other_lead = self.load(recording.s[row]) - ego_s;
            let distance: F32<S> = other_lead
                .simd_ge(0)
                .select(other_lead, -other_lead)
                .to_float();
            let half_length_sum = recording.length[ego] * 0.5 + recording.length[row] * 0.5;
            // Speed of the ego minus speed of the other vehicle [mm/s].
            let ego_excess = ego_speed - self.load(recording.speed[row]);
            let lateral_gap = lateral_gap(&ego_footprint, &self.footprint(row));
            for (role, result) in results.iter_mut().enumerate() {
                let slots = &neighbour_slot[role * max_frames..][..max_frames];
                let is_neighbour = self.load(slots).simd_eq(slot as i32);
                let closing_speed = if is_ahead(role) {
                    ego_excess
                } else {
                    -ego_excess
                };
                let closing_speed: F32<S> = closing_speed.to_float();
                let values = [
                    distance * METRES_PER_MM - half_length_sum,
                    closing_speed * METRES_PER_MM,
                    lateral_gap,
                ];
                for (result, value) in result.iter_mut().zip(values) {
                    *result = select(is_neighbour, value, *result);
                }
            }
        }
        for (role, [gap, closing_speed, lateral_gap]) in results.into_iter().enumerate() {
            let frames = role * max_frames..(role + 1) * max_frames;
            self.store(&mut out.gap[frames.clone()], gap);
            self.store(&mut out.closing_speed[frames.clone()], closing_speed);
            self.store(&mut out.lateral_gap[frames], lateral_gap);
        }
    }

    /// Write the occupancy of the left lane.
    ///
    /// Lengths are summed in whole half-millimetres, so that the sum does not depend on the order of the vehicles.
    #[inline(always)]
    fn left_lane(&self, out: &mut NeighbourSignals<'_>) {
        let (recording, ego) = (self.recording, self.row(0));
        let (ego_s, ego_lane) = (self.load(recording.s[ego]), self.load(recording.lane[ego]));
        // In half-millimetres.
        let reach = self.int(2 * OCCUPANCY_REACH_MM);
        let (mut total, mut count) = (self.int(0), self.int(0));
        for slot in 1..recording.num_slots {
            let row = self.row(slot);
            if !recording.valid[row] {
                continue;
            }
            let lane = self.load(recording.lane[row]);
            let is_in_left_lane = self.has_state(row)
                & lane.simd_eq(ego_lane + 1)
                & lane.simd_lt(recording.num_lanes as i32);
            // Half of a length has as many half-millimetres as the whole length has millimetres.
            let half_length = recording.length[row] * 1000.0;
            let half_length = self.int(half_length.round_ties_even() as i32);
            // A vehicle beyond twice the reach covers nothing. The limit keeps the doubled number within 32 bits.
            let other_lead = self.load(recording.s[row]) - ego_s;
            let other_lead = other_lead.max(-reach).min(reach) * 2;
            let front = (other_lead + half_length).min(reach);
            let rear = (other_lead - half_length).max(-reach);
            let covered = (front - rear).max(self.int(0));
            total = is_in_left_lane.select(total + covered, total);
            count = is_in_left_lane.select(count + 1, count);
        }
        let total: F32<S> = total.to_float();
        // The whole stretch is twice the reach: `4 * OCCUPANCY_REACH_MM` half-millimetres.
        let share = total * (1.0 / (4 * OCCUPANCY_REACH_MM) as f32);
        self.store(out.left_occupancy, share);
        self.store_bytes(out.left_count, count);
    }
}

/// Compute the signals of the targets.
///
/// `target_slot` has the slot of the target of each simulation, `NO_VEHICLE` without one.
pub fn target_signals(
    recording: &PackedRecording<'_>,
    signals: &SignalViews<'_>,
    target_slot: &[u8],
    level: Level,
    out: &mut TargetSignals<'_>,
) {
    // As in `neighbour_signals`, no frame of the arrays is known to be zero.
    let mut zero_from = vec![i32::MAX; target_slot.len()];
    out.fill(
        recording,
        &mut zero_from,
        |simulation, num_computed, out| {
            let signals = signals.of_simulation(simulation, recording.max_frames);
            let has_target = target_slot[simulation] != NO_VEHICLE;
            // Without a target the arrays hold signals of the ego, and `valid` is false in every frame.
            let slot = if has_target {
                usize::from(target_slot[simulation])
            } else {
                0
            };
            let row = recording.row(simulation, slot);
            let speeds = &mut out.lateral_speed[..num_computed];
            if recording.is_recorded.is_some() {
                lateral_speed_between_gaps(recording, row, speeds);
            } else {
                lateral_speed(recording, row, speeds);
            }
            dispatch!(level, |simd| for_each_frame_block!(
                FrameBlock::new(simd, recording, simulation),
                num_computed,
                |block| {
                    block.target_along_road(row, out);
                    block.target_across_road(row, &signals, out);
                }
            ));
            let num_recorded = recording.num_recorded(simulation);
            for frame in 0..num_computed {
                let has_state = has_target && recording.has_state(row, frame);
                out.valid[frame] = has_state && frame < num_recorded;
                out.overlaps[frame] = out.valid[frame] && out.gap[frame] < 0.0;
            }
        },
    );
}

/// Lateral speed of a vehicle without a state in some frames, positive to the left: a central difference, one-sided
/// beside such a frame [m/s].
fn lateral_speed_between_gaps(recording: &PackedRecording<'_>, row: usize, out: &mut [f32]) {
    let (d, half) = (recording.d[row], recording.half_window);
    let num_recorded = recording.num_recorded(row / recording.num_slots);
    let has_state = |frame: &usize| *frame < num_recorded && recording.has_state(row, *frame);
    for (frame, speed) in out.iter_mut().enumerate() {
        let later = frame + (frame + 1..=frame + half).take_while(has_state).count();
        let earlier_frames = (frame.saturating_sub(half)..frame).rev();
        let earlier = frame - earlier_frames.take_while(has_state).count();
        // Wraps as NumPy does. Millimetres in milliseconds are metres in seconds.
        let d_change = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * recording.interval_ms).max(1) as f32;
        *speed = recording.overtaking_sign * (d_change / elapsed);
    }
}

impl<S: Simd> FrameBlock<'_, S> {
    /// Write the position and motion of the target along the road.
    #[inline(always)]
    fn target_along_road(&self, row: usize, out: &mut TargetSignals<'_>) {
        let (recording, ego) = (self.recording, self.row(0));
        let ego_lead = self.load(recording.s[ego]) - self.load(recording.s[row]);
        let ego_lead: F32<S> = ego_lead.to_float();
        let ego_lead = ego_lead * METRES_PER_MM;
        let half_length_sum = 0.5 * (recording.length[ego] + recording.length[row]);
        let speed: F32<S> = self.load(recording.speed[row]).to_float();
        let accel: F32<S> = self.load(recording.accel[row]).to_float();
        self.store(out.ego_lead, ego_lead);
        self.store(out.gap, ego_lead.abs() - half_length_sum);
        self.store(out.speed, speed * METRES_PER_MM);
        self.store(out.accel, accel * METRES_PER_MM);
    }

    /// Write the lateral position of the target, its lane, and the gap between its side and the ego's.
    #[inline(always)]
    fn target_across_road(
        &self,
        row: usize,
        signals: &SignalViews<'_>,
        out: &mut TargetSignals<'_>,
    ) {
        let footprint = self.footprint(row);
        let lateral_gap = lateral_gap(&self.ego_footprint(signals), &footprint);
        self.store(out.lateral_position, footprint.lateral_position);
        self.store(out.lateral_gap, lateral_gap);
        self.store_bytes(out.lane, self.load(self.recording.lane[row]));
    }

    /// The footprint of the ego, from its signals.
    #[inline(always)]
    fn ego_footprint(&self, signals: &SignalViews<'_>) -> Footprint<S> {
        let left_edge = self.load_signal(signals.left_edge);
        let right_edge = self.load_signal(signals.right_edge);
        Footprint {
            lateral_position: self.load_signal(signals.lateral_position),
            half_width: (left_edge - right_edge) * 0.5,
        }
    }
}

/// Gap between the sides of the ego and another vehicle; negative where they overlap across the road [m].
#[inline(always)]
fn lateral_gap<S: Simd>(ego: &Footprint<S>, other: &Footprint<S>) -> F32<S> {
    let distance = (ego.lateral_position - other.lateral_position).abs();
    distance - (ego.half_width + other.half_width)
}

/// Frames in which the ego and its target overlap along the road, ordered by simulation and time.
#[derive(Default)]
pub struct FramesAlongside {
    /// Position of the simulation in the batch.
    pub simulation: Vec<i64>,
    /// Frame.
    pub frame: Vec<i64>,
    /// Lane index of the target.
    pub lane: Vec<u8>,
    /// Gap between the sides [m].
    pub lateral_gap: Vec<f32>,
    /// Acceleration of the target [m/s^2].
    pub accel: Vec<f32>,
}

/// Find the frames of a batch in which ego and target overlap along the road.
///
/// # Arguments
/// * `target_slot` - Slots of the targets by simulation, `NO_VEHICLE` without one.
/// * `span` - First and last frames of the search, (end, simulation); both belong to it.
#[must_use]
pub fn frames_alongside(
    recording: &PackedRecording<'_>,
    signals: &SignalViews<'_>,
    target_slot: &[u8],
    span: &[i32],
    level: Level,
) -> FramesAlongside {
    let num_simulations = target_slot.len();
    (0..num_simulations)
        .into_par_iter()
        .with_min_len(SIMULATIONS_PER_TASK)
        .fold(FramesAlongside::default, |mut frames, simulation| {
            let slot = target_slot[simulation];
            if slot != NO_VEHICLE {
                let row = recording.row(simulation, usize::from(slot));
                let signals = signals.of_simulation(simulation, recording.max_frames);
                let num_recorded = recording.num_recorded(simulation);
                let frames_of_span = span_frames(span, simulation, num_simulations, num_recorded);
                let end = frames_of_span.end;
                for first_frame in frames_of_span.step_by(SIMD_LANES) {
                    dispatch!(level, |simd| {
                        let block = FrameBlock {
                            first_frame,
                            ..FrameBlock::new(simd, recording, simulation)
                        };
                        frames.append_overlaps(block, row, &signals, end);
                    });
                }
            }
            frames
        })
        .reduce(FramesAlongside::default, FramesAlongside::followed_by)
}

impl FramesAlongside {
    /// Append the frames of a block, before `end`, in which the vehicle of a row overlaps the ego along the road.
    fn append_overlaps<S: Simd>(
        &mut self,
        block: FrameBlock<'_, S>,
        row: usize,
        signals: &SignalViews<'_>,
        end: usize,
    ) {
        let (recording, first_frame) = (block.recording, block.first_frame);
        let ego = block.row(0);
        let [gap, lateral_gap] = block.simd.vectorize(
            #[inline(always)]
            || {
                let ego_lead = block.load(recording.s[ego]) - block.load(recording.s[row]);
                let ego_lead: F32<S> = ego_lead.to_float();
                let half_length_sum = 0.5 * (recording.length[ego] + recording.length[row]);
                let gap = (ego_lead * METRES_PER_MM).abs() - half_length_sum;
                let gap: [f32; SIMD_LANES] = gap.to_array();
                let lateral_gap = lateral_gap(&block.ego_footprint(signals), &block.footprint(row));
                let lateral_gap: [f32; SIMD_LANES] = lateral_gap.to_array();
                [gap, lateral_gap]
            },
        );
        for frame in first_frame..end.min(first_frame + SIMD_LANES) {
            let simd_lane = frame - first_frame;
            if gap[simd_lane] < 0.0 && recording.has_state(row, frame) {
                self.simulation.push(block.simulation as i64);
                self.frame.push(frame as i64);
                self.lane.push(recording.lane[row][frame]);
                self.lateral_gap.push(lateral_gap[simd_lane]);
                self.accel
                    .push(f32::from(recording.accel[row][frame]) * METRES_PER_MM);
            }
        }
    }

    /// These frames, then later ones.
    fn followed_by(mut self, mut later: Self) -> Self {
        self.simulation.append(&mut later.simulation);
        self.frame.append(&mut later.frame);
        self.lane.append(&mut later.lane);
        self.lateral_gap.append(&mut later.lateral_gap);
        self.accel.append(&mut later.accel);
        self
    }
}
