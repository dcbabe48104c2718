//! One simulation as slices: the recorded states of its vehicles, and the signals (time series) of the ego.
//!
//! A frame is a recorded instant, and a block is at most sixteen frames. A slot is the number of a vehicle in its
//! simulation; the ego has slot 0. Left is the overtaking side. Differences of recorded integers wrap around, as
//! NumPy's do in the Python reference.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};
use overtaking_core::neighbour_role::{LEADER, LEFT_FOLLOWER};

use crate::frame_block::SpanBlock;
use crate::recording::{
    METRES_PER_MM, NEVER, NO_VEHICLE, PackedRecording, SignalViews, gap_between, is_ahead,
};
use crate::vectors::{F32, Mask, SIMD_LANES};

/// Slower egos count with this speed in time gaps, so that the time gap of a standing ego is finite [m/s].
const MIN_SPEED: f32 = 0.1;

/// One simulation. Recorded states have a row of frames for each slot.
#[derive(Clone, Copy)]
pub(crate) struct Track<'a> {
    /// Number of recorded frames.
    pub(crate) num_frames: usize,
    /// Positions along the road [mm].
    pub(crate) s: &'a [&'a [i32]],
    /// Speeds [mm/s].
    pub(crate) speed: &'a [&'a [i32]],
    /// Accelerations [mm/s^2].
    pub(crate) accel: &'a [&'a [i16]],
    /// Lane indices.
    pub(crate) lane: &'a [&'a [u8]],
    /// Whether a vehicle has a state in a frame; `None` if every vehicle has one in every frame.
    pub(crate) is_recorded: Option<&'a [&'a [bool]]>,
    /// Whether each slot holds a vehicle.
    pub(crate) valid: &'a [bool],
    /// Lengths [m].
    pub(crate) length: &'a [f32],
    /// Number of driving lanes.
    pub(crate) num_lanes: usize,
    /// Signals of the ego, in m and m/s.
    pub(crate) signals: SignalViews<'a>,
}

impl<'a> Track<'a> {
    /// One simulation of a batch.
    pub(crate) fn new(
        recording: &'a PackedRecording<'a>,
        signals: &SignalViews<'a>,
        simulation: usize,
    ) -> Self {
        let rows = recording.rows_of(simulation);
        let is_recorded = recording.is_recorded.as_ref();
        Self {
            num_frames: recording.num_recorded(simulation),
            s: &recording.s[rows.clone()],
            speed: &recording.speed[rows.clone()],
            accel: &recording.accel[rows.clone()],
            lane: &recording.lane[rows.clone()],
            is_recorded: is_recorded.map(|states| &states[rows.clone()]),
            valid: &recording.valid[rows.clone()],
            length: &recording.length[rows],
            num_lanes: recording.num_lanes,
            signals: signals.of_simulation(simulation, recording.max_frames),
        }
    }

    /// Slot of the leader of the ego in a recorded frame.
    pub(crate) fn leader(&self, frame: usize) -> Option<u8> {
        let slot = self.signals.neighbour(LEADER)[frame];
        (frame < self.num_frames && slot != NO_VEHICLE).then_some(slot)
    }

    /// Whether a vehicle has a state in a frame.
    pub(crate) fn has_state(&self, slot: usize, frame: usize) -> bool {
        self.is_recorded.is_none_or(|rows| rows[slot][frame])
    }

    /// Slot of the leader, if the time gap to it is less than `max_time_gap` [s].
    fn close_leader(&self, frame: usize, max_time_gap: f32) -> Option<u8> {
        let speed = self.signals.speed[frame];
        let speed = if speed > MIN_SPEED { speed } else { MIN_SPEED };
        let leader = self.leader(frame)?;
        (self.gap(leader, frame) / speed < max_time_gap).then_some(leader)
    }

    /// Gap between the bumpers of the ego and another vehicle [m].
    fn gap(&self, slot: u8, frame: usize) -> f32 {
        let slot = usize::from(slot);
        let half_length_sum = self.length[0] * 0.5 + self.length[slot] * 0.5;
        gap_between(self.s[0][frame], self.s[slot][frame], half_length_sum)
    }

    /// Slot of the vehicle that an ego without an attempt might have overtaken: its first close leader, else its first
    /// leader.
    pub(crate) fn likely_target(&self, max_time_gap: f32) -> Option<u8> {
        let frames = 0..self.num_frames;
        let close = frames
            .clone()
            .find_map(|frame| self.close_leader(frame, max_time_gap));
        close.or_else(|| frames.clone().find_map(|frame| self.leader(frame)))
    }

    /// First frame, up to `last`, in which the target is the leader and closer than `max_time_gap`; 0 without one.
    pub(crate) fn following_begin(&self, target: u8, last: usize, max_time_gap: f32) -> usize {
        let end = self.num_frames.min(last + 1);
        (0..end)
            .find(|&frame| self.close_leader(frame, max_time_gap) == Some(target))
            .unwrap_or(0)
    }

    /// The ego relative to another vehicle, frame by frame.
    pub(crate) fn relative_position(&self, slot: u8) -> RelativePosition<'a> {
        let slot = usize::from(slot);
        RelativePosition {
            ego_s: self.s[0],
            other_s: self.s[slot],
            half_length_sum: 0.5 * (self.length[0] + self.length[slot]),
            is_recorded: self.is_recorded.map(|rows| rows[slot]),
        }
    }

    /// Number of vehicles whose centre is ahead of the ego's in frame `begin` and behind it in frame `end`.
    pub(crate) fn num_passed(&self, begin: usize, end: usize) -> i32 {
        let exists = |slot: usize, frame: usize| {
            self.valid[slot] && frame < self.num_frames && self.has_state(slot, frame)
        };
        let ego_lead =
            |slot: usize, frame: usize| self.s[0][frame].wrapping_sub(self.s[slot][frame]);
        let is_passed = |slot: &usize| {
            exists(*slot, begin)
                && exists(*slot, end)
                && ego_lead(*slot, begin) < 0
                && ego_lead(*slot, end) > 0
        };
        (0..self.s.len()).filter(is_passed).count() as i32
    }

    /// `arrival_frame` of the vehicle that is the follower in the left lane at `frame`; `NEVER` without a follower, and
    /// if `frame` is `NEVER`.
    pub(crate) fn left_follower_arrival(&self, frame: i32) -> i32 {
        let slots = self.signals.neighbour(LEFT_FOLLOWER);
        let begin = usize::try_from(frame).ok();
        begin.map_or(NEVER, |begin| self.arrival_frame(slots[begin], frame))
    }

    /// First frame, from `frame` on, in which the front of a vehicle reaches the position of the ego's rear at `frame`;
    /// `NEVER` if it does not, without a vehicle, and if `frame` is `NEVER`.
    pub(crate) fn arrival_frame(&self, vehicle: u8, frame: i32) -> i32 {
        let (Ok(begin), slot) = (usize::try_from(frame), usize::from(vehicle)) else {
            return NEVER;
        };
        if vehicle == NO_VEHICLE {
            return NEVER;
        }
        let ego_s = self.s[0][begin];
        let half_length_sum = 0.5 * (self.length[0] + self.length[slot]);
        let has_arrived = |frame: &usize| {
            let vehicle_lead = self.s[slot][*frame].wrapping_sub(ego_s) as f32 * METRES_PER_MM;
            vehicle_lead + half_length_sum >= 0.0 && self.has_state(slot, *frame)
        };
        (begin..self.num_frames)
            .find(has_arrived)
            .map_or(NEVER, |frame| frame as i32)
    }

    /// The neighbour in `role` in a block of frames; `None` if no frame has one.
    #[inline(always)]
    pub(crate) fn neighbour<S: Simd>(
        &self,
        block: SpanBlock<S>,
        role: usize,
    ) -> Option<NeighbourFrames<S>> {
        let slots = block.array(self.signals.neighbour(role));
        if slots == [NO_VEHICLE; SIMD_LANES] {
            return None;
        }
        // 1 with a neighbour, else 0: a comparison of floats makes the mask below.
        let exists = slots.map(|slot| f32::from(u8::from(slot != NO_VEHICLE)));
        let slots = SlotsPerFrame::new(slots);
        let neighbour_lead = slots.gather(block, self.s) - block.load_ints(self.s[0]);
        // Speed of the ego minus speed of the neighbour [mm/s].
        let ego_excess = block.load_ints(self.speed[0]) - slots.gather(block, self.speed);
        let closing_speed = if is_ahead(role) {
            ego_excess
        } else {
            -ego_excess
        };
        let distance: F32<S> = neighbour_lead
            .simd_ge(0)
            .select(neighbour_lead, -neighbour_lead)
            .to_float();
        let half_length_sum = self.length[0] * 0.5 + slots.values(block.simd, self.length) * 0.5;
        let closing_speed: F32<S> = closing_speed.to_float();
        Some(NeighbourFrames {
            exists: F32::simd_from(block.simd, exists).simd_gt(0.5),
            slots,
            gap: distance * METRES_PER_MM - half_length_sum,
            closing_speed: closing_speed * METRES_PER_MM,
        })
    }
}

/// A neighbour of the ego in a block of frames; its numbers are undefined in frames without one.
pub(crate) struct NeighbourFrames<S: Simd> {
    /// Whether a frame has a neighbour.
    pub(crate) exists: Mask<S>,
    /// Slots of the neighbour; the ego's slot in frames without one.
    pub(crate) slots: SlotsPerFrame,
    /// Gap between the bumpers [m].
    pub(crate) gap: F32<S>,
    /// Speed at which the gap shrinks [m/s].
    pub(crate) closing_speed: F32<S>,
}

/// One slot in each frame of a block.
#[derive(Clone, Copy)]
pub(crate) struct SlotsPerFrame {
    /// The slot in each frame.
    slots: [u8; SIMD_LANES],
    /// The slot of all frames if they have the same one: their numbers are then in one row, which loads faster.
    common: Option<usize>,
}

impl SlotsPerFrame {
    /// Slots of a block, with the ego's slot in place of `NO_VEHICLE`.
    fn new(slots: [u8; SIMD_LANES]) -> Self {
        let slots = slots.map(|slot| if slot == NO_VEHICLE { 0 } else { slot });
        let common = (slots == [slots[0]; SIMD_LANES]).then_some(usize::from(slots[0]));
        Self { slots, common }
    }

    /// A number of the vehicle in each frame; `by_slot` has one number for each vehicle.
    #[inline(always)]
    pub(crate) fn values<S: Simd>(&self, simd: S, by_slot: &[f32]) -> F32<S> {
        match self.common {
            Some(slot) => F32::splat(simd, by_slot[slot]),
            None => F32::simd_from(simd, self.slots.map(|slot| by_slot[usize::from(slot)])),
        }
    }

    /// A recorded quantity of the vehicle in each frame; `rows` has one row for each vehicle.
    #[inline(always)]
    pub(crate) fn gather<S: Simd, T: Copy + Into<i32>>(
        &self,
        block: SpanBlock<S>,
        rows: &[&[T]],
    ) -> i32x16<S> {
        if let Some(slot) = self.common {
            return block.load_ints(rows[slot]);
        }
        let mut values = [0; SIMD_LANES];
        for (simd_lane, (value, slot)) in values.iter_mut().zip(self.slots).enumerate() {
            let frame = block.first_frame + simd_lane.min(block.len - 1);
            *value = rows[usize::from(slot)][frame].into();
        }
        i32x16::simd_from(block.simd, values)
    }
}

/// The ego relative to another vehicle along the road, frame by frame.
pub(crate) struct RelativePosition<'a> {
    /// Positions of the ego along the road [mm].
    ego_s: &'a [i32],
    /// Positions of the other vehicle [mm].
    other_s: &'a [i32],
    /// Half of both lengths together [m].
    half_length_sum: f32,
    /// Whether the other vehicle has a state; `None` if it has one in every frame.
    is_recorded: Option<&'a [bool]>,
}

impl RelativePosition<'_> {
    /// Whether the other vehicle has a state in a frame.
    fn other_has_state(&self, frame: usize) -> bool {
        self.is_recorded.is_none_or(|row| row[frame])
    }

    /// Centre of the ego minus centre of the other vehicle [m].
    fn ego_lead(&self, frame: usize) -> f32 {
        self.ego_s[frame].wrapping_sub(self.other_s[frame]) as f32 * METRES_PER_MM
    }

    /// Whether the two vehicles overlap along the road.
    pub(crate) fn overlaps(&self, frame: usize) -> bool {
        self.other_has_state(frame) && self.ego_lead(frame).abs() - self.half_length_sum < 0.0
    }

    /// Whether the ego's rear is ahead of the other's front.
    pub(crate) fn is_past(&self, frame: usize) -> bool {
        let ego_lead = self.ego_lead(frame);
        self.other_has_state(frame)
            && ego_lead > 0.0
            && ego_lead.abs() - self.half_length_sum >= 0.0
    }

    /// Whether the ego's centre is behind the other's centre.
    pub(crate) fn is_behind(&self, frame: usize) -> bool {
        self.other_has_state(frame) && self.ego_lead(frame) < 0.0
    }
}
