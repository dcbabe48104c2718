//! Duties towards the vehicles around the ego: its distance to the leader, its return to the original lane, and the
//! braking that it forces on its follower.

use std::ops::Range;

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use overtaking_core::neighbour_role::{FOLLOWER, LEADER, RIGHT_FOLLOWER, RIGHT_LEADER};

use crate::frame_block::{SpanBlock, min_of_lanes};
use crate::recording::{METRES_PER_MM, NEVER, NO_VEHICLE};
use crate::safety_measures::drac;
use crate::span_scans::{MarginMinimum, TrackScan, UNCONSTRAINED};
use crate::vectors::{F32, Mask, SIMD_LANES, at_most, max, min, select, splat};

/// Gap to the leader minus the lawful gap, in a block of frames.
struct LeaderMargin<S: Simd> {
    /// The margin; undefined in frames without a leader [m].
    margin: F32<S>,
    /// Whether a frame has a leader.
    has_leader: Mask<S>,
}

/// A run of consecutive frames.
pub(crate) struct FrameRun {
    /// Its first frame, `NEVER` if it is empty.
    pub(crate) first_frame: i32,
    /// Number of its frames.
    pub(crate) length: i32,
}

impl TrackScan<'_> {
    /// Gap to the leader minus the lawful gap, except while the ego may regain a gap that a cut-in has taken [m].
    pub(crate) fn following_margin<S: Simd>(&self, simd: S, span: Range<usize>) -> MarginMinimum {
        let mut cut_ins = RecentCutIns::new(self);
        let mut minimum = MarginMinimum::UNCONSTRAINED;
        if span.is_empty() {
            return minimum;
        }
        cut_ins.note_all(0..span.start);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut smallest = splat(simd, minimum.min_margin);
                for first_frame in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, first_frame, span.end);
                    cut_ins.note_all(first_frame..first_frame + block.len);
                    let Some(LeaderMargin { margin, has_leader }) = self.leader_margin(block)
                    else {
                        continue;
                    };
                    let margin = if cut_ins.are_all_over(first_frame) {
                        select(has_leader, margin, splat(simd, UNCONSTRAINED))
                    } else {
                        cut_ins.without_recent(block, margin)
                    };
                    smallest = min(margin, smallest);
                    if margin.simd_lt(0.0).any_true() {
                        block.for_each_frame(margin, |margin, frame| minimum.take(margin, frame));
                    }
                }
                minimum.min_margin = min_of_lanes(smallest);
            },
        );
        minimum
    }

    /// Gap to the leader minus the lawful gap; `None` if no frame has a leader.
    #[inline(always)]
    fn leader_margin<S: Simd>(&self, block: SpanBlock<S>) -> Option<LeaderMargin<S>> {
        let leader = self.track.neighbour(block, LEADER)?;
        let signals = &self.track.signals;
        let decel = self.law.assumed_decel(block.load(signals.friction));
        let speed = block.load(signals.speed);
        let lawful_gap = self.law.lawful_gap(speed, leader.closing_speed, decel);
        Some(LeaderMargin {
            margin: leader.gap - lawful_gap,
            has_leader: leader.exists,
        })
    }

    /// The longest run of frames in which the ego could have returned to `original_lane`.
    pub(crate) fn return_opportunity<S: Simd>(
        &self,
        simd: S,
        target: u8,
        original_lane: u8,
        span: Range<usize>,
    ) -> FrameRun {
        let mut longest_run = FrameRun {
            first_frame: NEVER,
            length: 0,
        };
        let mut current_length = 0;
        let (lane, num_lanes) = (self.track.signals.lane, self.track.num_lanes);
        let is_in_other_lane =
            |frame: usize| lane[frame] != original_lane && usize::from(lane[frame]) < num_lanes;
        simd.vectorize(
            #[inline(always)]
            || {
                for begin in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, begin, span.end);
                    if !(begin..begin + block.len).any(is_in_other_lane) {
                        current_length = 0;
                        continue;
                    }
                    let margin = self.return_margin(block, target);
                    block.for_each_frame(margin, |margin, frame| {
                        current_length = if is_in_other_lane(frame) && margin >= 0.0 {
                            current_length + 1
                        } else {
                            0
                        };
                        if current_length > longest_run.length {
                            longest_run = FrameRun {
                                first_frame: frame as i32 + 1 - current_length,
                                length: current_length,
                            };
                        }
                    });
                }
            },
        );
        longest_run
    }

    /// Gaps in the right lane minus the gaps that a return needs, -1 while the target is not far enough behind [m].
    #[inline(always)]
    fn return_margin<S: Simd>(&self, block: SpanBlock<S>, target: u8) -> F32<S> {
        let (law, signals) = (self.law, &self.track.signals);
        let speed = block.load(signals.speed);
        let decel = law.assumed_decel(block.load(signals.friction));
        let mut margin = splat(block.simd, law.return_range);
        for role in [RIGHT_LEADER, RIGHT_FOLLOWER] {
            let Some(neighbour) = self.track.neighbour(block, role) else {
                continue;
            };
            let closing_speed = neighbour.closing_speed;
            let needed_gap = if role == RIGHT_LEADER {
                let lawful_gap = law.lawful_gap(speed, closing_speed, decel);
                max(lawful_gap, law.free_time * closing_speed)
            } else {
                let follower_speed = speed + closing_speed;
                law.lawful_gap(follower_speed, closing_speed, decel)
            };
            margin = select(
                neighbour.exists,
                min(margin, neighbour.gap - needed_gap),
                margin,
            );
        }
        let has_passed = self.target_is_far_behind(block, target, speed, decel);
        select(has_passed, margin, splat(block.simd, -1.0))
    }

    /// Whether the target is behind the ego by the time gap and the lawful gap of a return.
    #[inline(always)]
    fn target_is_far_behind<S: Simd>(
        &self,
        block: SpanBlock<S>,
        target: u8,
        speed: F32<S>,
        decel: F32<S>,
    ) -> Mask<S> {
        let track = &self.track;
        let slot = match target {
            // The ego's own slot, whose lead of 0 is never positive.
            NO_VEHICLE => 0,
            slot => usize::from(slot),
        };
        let ego_lead = block.load_ints(track.s[0]) - block.load_ints(track.s[slot]);
        let ego_lead: F32<S> = ego_lead.to_float();
        let target_speed: F32<S> = block.load_ints(track.speed[slot]).to_float();
        let (ego_lead, target_speed) = (ego_lead * METRES_PER_MM, target_speed * METRES_PER_MM);
        let gap = ego_lead.abs() - 0.5 * (track.length[0] + track.length[slot]);
        let lawful_gap = self
            .law
            .lawful_gap(target_speed, target_speed - speed, decel);
        let needed_gap = max(self.law.time_gap * target_speed, lawful_gap);
        ego_lead.simd_gt(0.0) & gap.simd_ge(needed_gap)
    }

    /// Allowed braking minus the braking forced on the follower, after each lane change [m/s^2].
    pub(crate) fn forced_braking_margin<S: Simd>(
        &self,
        simd: S,
        span: Range<usize>,
    ) -> MarginMinimum {
        let mut minimum = MarginMinimum::UNCONSTRAINED;
        let (mut search_from, mut scanned_until) = (span.start.max(1), 0);
        let lane = self.track.signals.lane;
        while let Some(change) = next_lane_change(lane, search_from..span.end) {
            let end = span.end.min(change + self.law.obstruction_frames + 1);
            // The times after two lane changes can overlap; each frame is taken once.
            let frames = change.max(scanned_until)..end;
            simd.vectorize(
                #[inline(always)]
                || self.scan_forced_braking(simd, frames.clone(), &mut minimum),
            );
            (search_from, scanned_until) = (change + 1, end);
        }
        minimum
    }

    /// Take the margins of forced braking in some frames after a lane change.
    #[inline(always)]
    fn scan_forced_braking<S: Simd>(
        &self,
        simd: S,
        frames: Range<usize>,
        minimum: &mut MarginMinimum,
    ) {
        for first_frame in frames.clone().step_by(SIMD_LANES) {
            let block = SpanBlock::new(simd, first_frame, frames.end);
            let Some(follower) = self.track.neighbour(block, FOLLOWER) else {
                continue;
            };
            let braking = drac(follower.gap, follower.closing_speed);
            let braking = at_most(braking, self.law.max_braking);
            let margin = self.law.allowed_braking - braking;
            let margin = select(follower.exists, margin, splat(simd, UNCONSTRAINED));
            block.for_each_frame(margin, |margin, frame| minimum.take(margin, frame));
        }
    }
}

/// First of some frames in which the lane differs from the frame before; the frames begin at 1 or later.
fn next_lane_change(lane: &[u8], frames: Range<usize>) -> Option<usize> {
    // Most frames keep their lane, so sixteen of them are compared at once.
    let has_one_lane = |frames: Range<usize>| {
        let first = lane[frames.start];
        lane[frames]
            .iter()
            .fold(true, |all, &lane| all & (lane == first))
    };
    let mut begin = frames.start;
    while begin + SIMD_LANES <= frames.end && has_one_lane(begin - 1..begin + SIMD_LANES) {
        begin += SIMD_LANES;
    }
    (begin..frames.end).find(|&frame| lane[frame] != lane[frame - 1])
}

/// Vehicles that have cut in ahead of the ego.
struct RecentCutIns<'a> {
    /// The simulation.
    scan: &'a TrackScan<'a>,
    /// Slot of the leader in each frame.
    leader_slots: &'a [u8],
    /// Slot and frame of each cut-in, in order of time.
    cut_ins: Vec<(u8, usize)>,
}

impl<'a> RecentCutIns<'a> {
    /// Before the first frame.
    fn new(scan: &'a TrackScan<'a>) -> Self {
        Self {
            scan,
            leader_slots: scan.track.signals.neighbour(LEADER),
            cut_ins: Vec::new(),
        }
    }

    /// Note the cut-ins within some frames.
    #[inline(always)]
    fn note_all(&mut self, frames: Range<usize>) {
        let start = frames.start.max(1);
        let leaders = self.leader_slots[start - 1..frames.end.max(start)].iter();
        // In most blocks the leader stays the same, which this loop finds without a branch for each frame.
        let leader_changes = leaders
            .clone()
            .zip(leaders.skip(1))
            .fold(false, |any, (before, after)| any | (before != after));
        if leader_changes {
            frames
                .filter(|&frame| frame > 0)
                .for_each(|frame| self.note(frame));
        }
    }

    /// Note a cut-in: a vehicle from another lane becomes the leader while the ego keeps its lane.
    fn note(&mut self, frame: usize) {
        let track = &self.scan.track;
        let (leader, before, ego_lane) = (self.leader_slots[frame], frame - 1, track.signals.lane);
        if leader == self.leader_slots[before]
            || leader == NO_VEHICLE
            || ego_lane[frame] != ego_lane[before]
        {
            return;
        }
        let slot = usize::from(leader);
        if track.has_state(slot, before) && track.lane[slot][before] != ego_lane[before] {
            self.cut_ins.push((leader, frame));
        }
    }

    /// Whether, from a frame on, the time to regain the gap is over for every cut-in so far.
    fn are_all_over(&self, frame: usize) -> bool {
        let last = self.cut_ins.last();
        last.is_none_or(|&(_, cut_in)| cut_in + self.scan.law.regain_frames < frame)
    }

    /// The margins of frames whose leader has not cut in recently, `UNCONSTRAINED` in the others.
    fn without_recent<S: Simd>(&self, block: SpanBlock<S>, margin: F32<S>) -> F32<S> {
        let mut margins = [UNCONSTRAINED; SIMD_LANES];
        block.for_each_frame(margin, |margin, frame| {
            let leader = self.leader_slots[frame];
            if leader != NO_VEHICLE && !self.has_cut_in_recently(leader, frame) {
                margins[frame - block.first_frame] = margin;
            }
        });
        F32::simd_from(block.simd, margins)
    }

    /// Whether the ego may still regain the gap that a vehicle has taken by cutting in.
    fn has_cut_in_recently(&self, vehicle: u8, frame: usize) -> bool {
        let is_recent =
            |cut_in: usize| cut_in <= frame && frame - cut_in <= self.scan.law.regain_frames;
        let mut cut_ins = self.cut_ins.iter();
        cut_ins.any(|&(slot, cut_in)| slot == vehicle && is_recent(cut_in))
    }
}
