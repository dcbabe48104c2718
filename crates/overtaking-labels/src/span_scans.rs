//! Margins, measures and sums over spans of frames: the inputs of rules and features that are computed in one pass.
//!
//! A margin is negative where a rule is broken. A span is a range of frames (recorded instants), a slot the number of a
//! vehicle in its simulation; the ego has slot 0. Left is the overtaking side.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use overtaking_core::dispatch;
use overtaking_core::neighbour_role::LEADER;
use rayon::prelude::*;

use crate::frame_block::{SpanBlock, min_of_lanes};
use crate::gap_duties::FrameRun;
use crate::recording::{
    BEYOND_KERB_EDGE, NEVER, NO_VEHICLE, PackedRecording, SignalViews, span_frames,
};
use crate::safety_measures::{LawNumbers, WORST_MEASURES};
use crate::track::Track;
use crate::vectors::{SIMD_LANES, at_least, min, splat};

/// Smallest number of simulations that a thread takes at a time, a choice: one takes some microseconds.
pub(crate) const SIMULATIONS_PER_TASK: usize = 32;

/// Names of the spans, in the order of `SpanQuery::spans`; `overtaking.labels.law.case.scans` defines them.
///
/// `manoeuvre` is the overtake with some seconds before and after it. `judged` is the manoeuvre, or the whole recording
/// without an attempt. `after_gap_recovery` is `judged` without the first seconds of the recording, in which the ego
/// may restore its gap. `after_passing` is the manoeuvre from the frame in which the target was passed. `summed` is
/// empty if the ego makes an attempt. Else it has all frames up to a collision; some features of the study of Pinto,
/// Dutra and Fonseca are means over them.
pub const SPAN_NAMES: [&str; 5] = [
    "judged",
    "after_gap_recovery",
    "after_passing",
    "manoeuvre",
    "summed",
];

/// Names of two frames, a slot and a lane, in the order of `SpanQuery::moments`; fields of `OvertakeEvents`.
pub const MOMENT_NAMES: [&str; 4] = ["line_crossed", "return_end", "target_slot", "original_lane"];

/// Spans and moments of each simulation, and the numbers by which they are judged.
pub struct SpanQuery<'a> {
    /// First and last frame of each span, (span, end, simulation); empty if the last frame is before the first.
    pub spans: &'a [i32],
    /// Frames (-1: no event), a slot (255: no vehicle) and a lane, (moment, simulation).
    pub moments: &'a [i32],
    /// Numbers of the law.
    pub law: &'a LawNumbers,
}

/// Margins whose smallest value is searched, `UNCONSTRAINED` if no frame counts: sight distance to lit and to unlit
/// vehicles minus stopping distance [m], gap to the leader minus the lawful gap [m], and allowed braking minus the
/// braking that the ego forces on its follower [m/s^2].
const MARGIN_NAMES: [&str; 4] = ["stop_lit", "stop_unlit", "following", "braking"];
/// Number of rows of `SpanOutputs::measures`.
const NUM_MEASURES: usize = MARGIN_NAMES.len() + WORST_MEASURES.len();

/// Names of the rows of `SpanOutputs::measures`: smallest margins, then worst measures.
#[must_use]
pub fn measure_names() -> Vec<&'static str> {
    MARGIN_NAMES.into_iter().chain(WORST_MEASURES).collect()
}

/// Names of the rows of `SpanOutputs::frames`.
///
/// Each margin has its first and last negative frame, -1 without one, and the length of the longest run of negative
/// frames. `return_opportunity` is the longest run of frames in which the ego could return to its lane. An arrival is the
/// first frame in which another vehicle reaches the position that the ego's rear had at an instant, -1 if it never does:
/// for `entry` the follower on the left as the ego crosses the line, for `return` the target as the return ends.
pub const FRAME_NAMES: [&str; 16] = [
    "stop_lit.first",
    "stop_lit.last",
    "stop_lit.longest",
    "stop_unlit.first",
    "stop_unlit.last",
    "stop_unlit.longest",
    "following.first",
    "following.last",
    "following.longest",
    "braking.first",
    "braking.last",
    "braking.longest",
    "return_opportunity.first",
    "return_opportunity.length",
    "entry.arrival",
    "return.arrival",
];

/// Names of the rows of `SpanOutputs::sums`.
///
/// `frames` counts the frames of a span, and `frames_with_leader` the frames with a leader. `ego_speed` [mm/s] and
/// `left_count` (vehicles in the lane to the left) are summed over all frames. The others are summed over the frames with
/// a leader: its speed (`target_speed`) and the absolute difference of the speeds [mm/s], and the absolute distance of
/// the centres [mm].
pub const SUM_NAMES: [&str; 7] = [
    "frames",
    "frames_with_leader",
    "ego_speed",
    "target_speed",
    "speed_difference",
    "distance",
    "left_count",
];

/// Arrays for the results, (row, simulation).
pub struct SpanOutputs<'a> {
    /// A row for each of `measure_names`.
    pub measures: &'a mut [f32],
    /// A row for each of `FRAME_NAMES`.
    pub frames: &'a mut [i32],
    /// A row for each of `SUM_NAMES`.
    pub sums: &'a mut [i64],
}

/// The results of one simulation.
struct SpanResult {
    /// In the order of `measure_names`.
    measures: [f32; NUM_MEASURES],
    /// In the order of `FRAME_NAMES`.
    frames: [i32; FRAME_NAMES.len()],
    /// In the order of `SUM_NAMES`.
    sums: [i64; SUM_NAMES.len()],
}

/// Compute margins, measures and sums of a batch.
pub fn scan_spans(
    recording: &PackedRecording<'_>,
    signals: &SignalViews<'_>,
    query: &SpanQuery<'_>,
    level: Level,
    out: SpanOutputs<'_>,
) {
    let num_simulations = recording.num_frames.len();
    let results: Vec<SpanResult> = (0..num_simulations)
        .into_par_iter()
        .with_min_len(SIMULATIONS_PER_TASK)
        .map(|simulation| {
            let track = Track::new(recording, signals, simulation);
            let scan = TrackScan {
                track,
                law: query.law,
            };
            dispatch!(level, |simd| scan.results(
                simd,
                query,
                simulation,
                num_simulations
            ))
        })
        .collect();
    transpose(&results, out.measures, |result| &result.measures);
    transpose(&results, out.frames, |result| &result.frames);
    transpose(&results, out.sums, |result| &result.sums);
}

/// Write a row for each value of the results.
fn transpose<T: Copy>(
    results: &[SpanResult],
    out: &mut [T],
    values_of: impl Fn(&SpanResult) -> &[T],
) {
    for (index, row) in out.chunks_mut(results.len().max(1)).enumerate() {
        for (value, result) in row.iter_mut().zip(results) {
            *value = values_of(result)[index];
        }
    }
}

/// One simulation, and the numbers of the law by which its margins are computed.
pub(crate) struct TrackScan<'a> {
    /// The simulation.
    pub(crate) track: Track<'a>,
    /// Numbers of the law.
    pub(crate) law: &'a LawNumbers,
}

impl TrackScan<'_> {
    /// All results of the simulation, which has number `simulation` among those of the query.
    fn results<S: Simd>(
        &self,
        simd: S,
        query: &SpanQuery<'_>,
        simulation: usize,
        num_simulations: usize,
    ) -> SpanResult {
        let track = &self.track;
        // In the order of `SPAN_NAMES` and of `MOMENT_NAMES`.
        let [judged, after_gap_recovery, after_passing, manoeuvre, summed] =
            [0, 1, 2, 3, 4].map(|span| {
                let ends = &query.spans[2 * span * num_simulations..];
                span_frames(ends, simulation, num_simulations, track.num_frames)
            });
        let [line_crossed, return_end, target_slot, original_lane] =
            [0, 1, 2, 3].map(|moment| query.moments[moment * num_simulations + simulation]);
        // Slots and lanes are bytes; 255 stands for no vehicle and for a place beyond the lanes.
        let target_slot = target_slot as u8;
        let [stop_lit, stop_unlit] = self.stopping_margins(simd, judged.clone());
        let margins = [
            stop_lit,
            stop_unlit,
            self.following_margin(simd, after_gap_recovery),
            self.forced_braking_margin(simd, manoeuvre),
        ];
        let FrameRun {
            first_frame: opportunity_first,
            length: opportunity_length,
        } = self.return_opportunity(simd, target_slot, original_lane as u8, after_passing);
        let mut measures = [0.0; NUM_MEASURES];
        let (smallest, worst) = measures.split_at_mut(margins.len());
        smallest.copy_from_slice(&margins.map(|margin| margin.min_margin));
        worst.copy_from_slice(&self.worst_measures(simd, judged));
        let mut frames = [NEVER; FRAME_NAMES.len()];
        for (rows, margin) in frames.as_chunks_mut::<3>().0.iter_mut().zip(margins) {
            *rows = [margin.first_frame, margin.last_frame, margin.longest_run];
        }
        frames[3 * margins.len()..].copy_from_slice(&[
            opportunity_first,
            opportunity_length,
            track.left_follower_arrival(line_crossed),
            track.arrival_frame(target_slot, return_end),
        ]);
        SpanResult {
            measures,
            frames,
            sums: track.recorded_sums(summed),
        }
    }

    /// Sight distances to lit and to unlit vehicles, minus the stopping distance [m].
    fn stopping_margins<S: Simd>(&self, simd: S, span: Range<usize>) -> [MarginMinimum; 2] {
        let (signals, law) = (&self.track.signals, self.law);
        let sights = [signals.sight_lit, signals.sight_unlit];
        simd.vectorize(
            #[inline(always)]
            || {
                let mut minima = [MarginMinimum::UNCONSTRAINED; 2];
                let mut smallest = [splat(simd, UNCONSTRAINED); 2];
                for first_frame in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, first_frame, span.end);
                    let speed = block.load(signals.speed);
                    let friction = block.load(signals.friction);
                    let decel = law.decel_per_friction * at_least(friction, law.friction_floor);
                    let stopping_distance =
                        speed * law.stop_reaction_time + speed * speed / (2.0 * decel);
                    let results = smallest.iter_mut().zip(&mut minima);
                    for (sight, (smallest, minimum)) in sights.iter().zip(results) {
                        // Lanes beyond the span repeat its last frame, so they do not change the minimum.
                        let margin = block.load(sight) - stopping_distance;
                        *smallest = min(margin, *smallest);
                        // Only blocks with a negative margin count frames one by one, which is slow.
                        if margin.simd_lt(0.0).any_true() {
                            block.for_each_frame(margin, |margin, frame| {
                                minimum.take(margin, frame);
                            });
                        }
                    }
                }
                // `take` saw only the blocks with a negative margin.
                for (minimum, smallest) in minima.iter_mut().zip(smallest) {
                    minimum.min_margin = min_of_lanes(smallest);
                }
                minima
            },
        )
    }
}

impl Track<'_> {
    /// Sums of recorded integers over a span, in the order of `SUM_NAMES`.
    ///
    /// Differences wrap as NumPy's do, so that any recording gives the same sums in the Python reference.
    fn recorded_sums(&self, span: Range<usize>) -> [i64; SUM_NAMES.len()] {
        let leaders = self.signals.neighbour(LEADER);
        let (mut ego_speeds, mut sums_with_leader) = (0, [0; 4]);
        for frame in span.clone() {
            let ego_speed = self.speed[0][frame];
            ego_speeds += i64::from(ego_speed);
            if leaders[frame] == NO_VEHICLE {
                continue;
            }
            let slot = usize::from(leaders[frame]);
            let speed = self.speed[slot][frame];
            let leader_lead = self.s[slot][frame].wrapping_sub(self.s[0][frame]);
            let speed_difference = ego_speed.wrapping_sub(speed);
            let values = [
                1,
                speed,
                speed_difference.wrapping_abs(),
                leader_lead.wrapping_abs(),
            ];
            for (sum, value) in sums_with_leader.iter_mut().zip(values) {
                *sum += i64::from(value);
            }
        }
        let [num_with_leader, leader_speeds, speed_differences, distances] = sums_with_leader;
        let left_counts =
            (1..self.s.len()).map(|slot| self.num_frames_in_left_lane(slot, span.clone()));
        [
            span.len() as i64,
            num_with_leader,
            ego_speeds,
            leader_speeds,
            speed_differences,
            distances,
            left_counts.sum(),
        ]
    }

    /// Number of frames of a span in which a vehicle is in the lane to the left of the ego.
    fn num_frames_in_left_lane(&self, slot: usize, span: Range<usize>) -> i64 {
        if !self.valid[slot] {
            return 0;
        }
        let lanes = self.lane[0][span.clone()]
            .iter()
            .zip(&self.lane[slot][span.clone()]);
        // Lanes count towards the overtaking side, which is called left. An ego beyond the kerb-side edge has no left
        // lane; its 255 plus 1 would wrap to lane 0.
        let is_in_left_lane = lanes.map(|(&ego_lane, &lane)| {
            (lane == ego_lane.wrapping_add(1))
                & (ego_lane != BEYOND_KERB_EDGE)
                & (usize::from(lane) < self.num_lanes)
        });
        match self.is_recorded {
            None => is_in_left_lane.map(i64::from).sum(),
            Some(rows) => {
                let pairs = is_in_left_lane.zip(&rows[slot][span]);
                pairs
                    .map(|(is_in_left_lane, &has_state)| i64::from(is_in_left_lane & has_state))
                    .sum()
            }
        }
    }
}

/// Larger than any margin; the smallest margin of a span in which none counts. It has the value of `UNCONSTRAINED` in
/// `overtaking.labels.law.margins`.
pub(crate) const UNCONSTRAINED: f32 = 3.0e38;

/// A margin over a span: its smallest value, and the frames in which it is negative.
#[derive(Clone, Copy)]
pub(crate) struct MarginMinimum {
    /// The smallest margin.
    pub(crate) min_margin: f32,
    /// First negative frame, `NEVER` without one.
    pub(crate) first_frame: i32,
    /// Last negative frame, `NEVER` without one.
    pub(crate) last_frame: i32,
    /// Number of frames of the longest unbroken run of negative margins.
    pub(crate) longest_run: i32,
    /// Number of frames of the run that ends in `last_frame`.
    current_run: i32,
}

impl MarginMinimum {
    /// The minimum over no frame.
    pub(crate) const UNCONSTRAINED: Self = Self {
        min_margin: UNCONSTRAINED,
        first_frame: NEVER,
        last_frame: NEVER,
        longest_run: 0,
        current_run: 0,
    };

    /// Take the margin of a frame that is later than all frames so far.
    pub(crate) fn take(&mut self, margin: f32, frame: usize) {
        if margin < self.min_margin {
            self.min_margin = margin;
        }
        if margin < 0.0 {
            let frame = frame as i32;
            let continues = self.current_run > 0 && frame == self.last_frame + 1;
            self.current_run = if continues { self.current_run + 1 } else { 1 };
            self.longest_run = self.longest_run.max(self.current_run);
            self.last_frame = frame;
            if self.first_frame == NEVER {
                self.first_frame = frame;
            }
        }
    }

    /// Take consecutive frames that are later than all frames so far, each with a negative margin. The caller sets
    /// `min_margin`.
    pub(crate) fn take_negative_frames(&mut self, frames: Range<usize>) {
        let (begin, end) = (frames.start as i32, frames.end as i32);
        // Without a frame so far, `last_frame` is -1: a run from frame 0 then adds `current_run`, which is 0.
        let run_before = if self.last_frame + 1 == begin {
            self.current_run
        } else {
            0
        };
        self.current_run = run_before + end - begin;
        self.longest_run = self.longest_run.max(self.current_run);
        self.last_frame = end - 1;
        if self.first_frame == NEVER {
            self.first_frame = begin;
        }
    }
}
