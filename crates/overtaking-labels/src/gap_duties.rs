//! Duties towards the vehicles around the ego: its distance to the leader, its return to the original lane, and the
//! braking that it forces on its follower.
//!
//! The *lawful gap* is the gap that the law asks of the following vehicle, `LawNumbers::lawful_gap`. Right is the kerb
//! side. A slot is the number of a vehicle in its simulation; the ego has slot 0. Blocks have sixteen frames.

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
        // A cut-in before the span can still excuse its first frames.
        cut_ins.add_from(0..span.start);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut smallest = splat(simd, minimum.min_margin);
                for first_frame in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, first_frame, span.end);
                    cut_ins.add_from(first_frame..first_frame + block.len);
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
                    // A loop over single frames is slow; only negative margins need it.
                    if margin.simd_lt(0.0).any_true() {
                        block.for_each_frame(margin, |margin, frame| minimum.take(margin, frame));
                    }
                }
                // `take` saw only the blocks with a negative margin.
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
        target_slot: u8,
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
                    let margin = self.return_margin(block, target_slot);
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

    /// The smaller of the gaps to both vehicles in the right lane, each minus the gap that a return needs [m]. Without
    /// a target far enough behind the ego, it is -1; any negative number would do.
    #[inline(always)]
    fn return_margin<S: Simd>(&self, block: SpanBlock<S>, target_slot: u8) -> F32<S> {
        let (law, signals) = (self.law, &self.track.signals);
        let speed = block.load(signals.speed);
        let decel = law.assumed_decel(block.load(signals.friction));
        // Margins are at most this distance, which is also the margin of an empty lane.
        let mut margin = splat(block.simd, law.return_range);
        for role in [RIGHT_LEADER, RIGHT_FOLLOWER] {
            let Some(neighbour) = self.track.neighbour(block, role) else {
                continue;
            };
            let closing_speed = neighbour.closing_speed;
            let needed_gap = if role == RIGHT_LEADER {
                let lawful_gap = law.lawful_gap(speed, closing_speed, decel);
                // An ego that would soon have to pull out again may stay in its lane.
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
        let is_target_far_behind = self.is_target_far_behind(block, target_slot, speed, decel);
        select(is_target_far_behind, margin, splat(block.simd, -1.0))
    }

    /// Whether the target follows behind the ego with the lawful gap and with the time gap that a return needs.
    #[inline(always)]
    fn is_target_far_behind<S: Simd>(
        &self,
        block: SpanBlock<S>,
        target_slot: u8,
        speed: F32<S>,
        decel: F32<S>,
    ) -> Mask<S> {
        let track = &self.track;
        let slot = match target_slot {
            // The slot of the ego: its lead over itself is 0, so the result is false.
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

    /// Allowed braking minus the braking (DRAC) forced on the follower, for some time after each lane change [m/s^2].
    pub(crate) fn forced_braking_margin<S: Simd>(
        &self,
        simd: S,
        span: Range<usize>,
    ) -> MarginMinimum {
        let mut minimum = MarginMinimum::UNCONSTRAINED;
        // From frame 1 on, because a lane change needs a frame before it.
        let (mut search_from, mut scanned_until) = (span.start.max(1), 0);
        let lane = self.track.signals.lane;
        while let Some(change) = next_lane_change(lane, search_from..span.end) {
            let end = span.end.min(change + self.law.obstruction_frames + 1);
            // The times after two lane changes can overlap, and each frame must count once.
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
            // The DRAC is infinite where no gap is left.
            let braking = at_most(braking, self.law.max_braking);
            let margin = self.law.allowed_braking - braking;
            let margin = select(follower.exists, margin, splat(simd, UNCONSTRAINED));
            block.for_each_frame(margin, |margin, frame| minimum.take(margin, frame));
        }
    }
}

/// First of `frames` in which the lane differs from the frame before. `frames` begins at 1 or later.
fn next_lane_change(lane: &[u8], frames: Range<usize>) -> Option<usize> {
    // Most frames keep their lane, so sixteen of them are compared at once.
    let has_one_lane = |frames: Range<usize>| {
        let first_lane = lane[frames.start];
        lane[frames]
            .iter()
            .fold(true, |all, &lane| all & (lane == first_lane))
    };
    let mut begin = frames.start;
    while begin + SIMD_LANES <= frames.end && has_one_lane(begin - 1..begin + SIMD_LANES) {
        begin += SIMD_LANES;
    }
    (begin..frames.end).find(|&frame| lane[frame] != lane[frame - 1])
}

/// Vehicles that have cut in ahead of the ego: from another lane they became the leader of an ego that kept its lane.
struct RecentCutIns<'a> {
    /// The simulation.
    scan: &'a TrackScan<'a>,
    /// Slot of the leader in each frame.
    leader_slots: &'a [u8],
    /// Slot and frame of each cut-in, in order of time.
    cut_ins: Vec<(u8, usize)>,
}

impl<'a> RecentCutIns<'a> {
    /// No cut-ins yet.
    fn new(scan: &'a TrackScan<'a>) -> Self {
        Self {
            scan,
            leader_slots: scan.track.signals.neighbour(LEADER),
            cut_ins: Vec::new(),
        }
    }

    /// Add the cut-ins of some frames, which are later than all frames so far.
    #[inline(always)]
    fn add_from(&mut self, frames: Range<usize>) {
        let start = frames.start.max(1);
        let leaders = self.leader_slots[start - 1..frames.end.max(start)].iter();
        // In most blocks the leader stays the same. This loop has no branch for each frame, so it is fast.
        let leader_changes = leaders
            .clone()
            .zip(leaders.skip(1))
            .fold(false, |any, (before, after)| any | (before != after));
        if leader_changes {
            frames
                .filter(|&frame| frame > 0)
                .for_each(|frame| self.add_if_cut_in(frame));
        }
    }

    /// Add the leader of a frame if it cuts in there.
    fn add_if_cut_in(&mut self, frame: usize) {
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

    /// Whether the time to regain the gap has ended before a frame, for all cut-ins so far.
    fn are_all_over(&self, frame: usize) -> bool {
        let last_cut_in = self.cut_ins.last();
        last_cut_in.is_none_or(|&(_, cut_in)| cut_in + self.scan.law.regain_frames < frame)
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

    /// Whether the time in which the ego may regain its gap after a cut-in of the vehicle is not over yet.
    fn has_cut_in_recently(&self, vehicle_slot: u8, frame: usize) -> bool {
        // The cut-ins of a whole block are added before its frames are judged, so a cut-in can be later than `frame`.
        let is_recent =
            |cut_in: usize| cut_in <= frame && frame - cut_in <= self.scan.law.regain_frames;
        let mut cut_ins = self.cut_ins.iter();
        cut_ins.any(|&(slot, cut_in)| slot == vehicle_slot && is_recent(cut_in))
    }
}
