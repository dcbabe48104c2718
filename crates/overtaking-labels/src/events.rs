//! Events of each simulation: attempts to overtake from the movement to the left to the return, drifts, accidents.
//!
//! `docs/explanation/events.md` defines every event; `overtaking.model.overtake_events.OvertakeEvents` lists them.
//! Left is the overtaking side. A slot is the number of a vehicle in its simulation. A movement is *wide* if it lasts
//! for `min_frames` and leads `min_shift` away. Frames from `EgoDrive::num_driven` on follow an accident; they do not
//! count.

use rayon::prelude::*;

use crate::lateral_movements::{EgoDrive, EventThresholds, Movement};
use crate::recording::{NEVER, NO_VEHICLE, PackedRecording, SignalViews};

/// Simulations that a thread takes at a time; one takes about a microsecond, less than the pool needs to hand it over.
const SIMULATIONS_PER_TASK: usize = 32;
/// Largest number of drifts, which is recorded in a byte.
const MAX_DRIFTS: i32 = 255;

/// Names of the events of a simulation, in the order of an `EventRow`.
pub const EVENT_NAMES: [&str; 21] = [
    "first",
    "last",
    "target_slot",
    "original_lane",
    "following_begin",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "overlap_end",
    "return_begin",
    "return_end",
    "abort",
    "abort_end",
    "collision",
    "road_departure",
    "spin",
    "num_attempts",
    "num_passed",
    "collision_slot",
    "drift",
    "num_drifts",
];

/// The events of one simulation: frames, slots, a lane and counts, in the order of `EVENT_NAMES`.
type EventRow = [i32; EVENT_NAMES.len()];

/// Find the events of a batch: `out` has a row for each of `EVENT_NAMES` and a column for each simulation.
pub fn events(
    recording: &PackedRecording<'_>,
    signals: &SignalViews<'_>,
    thresholds: &EventThresholds<'_>,
    out: &mut [i32],
) {
    let num_simulations = recording.num_frames.len();
    let events: Vec<EventRow> = (0..num_simulations)
        .into_par_iter()
        .with_min_len(SIMULATIONS_PER_TASK)
        .map(|simulation| events_of(&EgoDrive::new(recording, signals, thresholds, simulation)))
        .collect();
    for (name, row) in out.chunks_mut(num_simulations.max(1)).enumerate() {
        for (value, events) in row.iter_mut().zip(&events) {
            *value = events[name];
        }
    }
}

/// The events of one simulation.
fn events_of(drive: &EgoDrive<'_>) -> EventRow {
    let (track, thresholds) = (&drive.track, drive.thresholds);
    let movements = left_movements(drive);
    let attempt = movements.attempt.as_ref();
    let last = track.num_frames.saturating_sub(1);
    let likely_target = || {
        let target = track.likely_target(thresholds.follow_time_gap);
        target.unwrap_or(NO_VEHICLE)
    };
    let target = attempt.map_or_else(likely_target, |attempt| attempt.target);
    let begin = attempt.map_or(last, |attempt| attempt.begin);
    // Without a return, passed vehicles count until the end of the recording, even after an accident.
    let num_passed = attempt.map_or(0, |attempt| {
        track.num_passed(attempt.begin, attempt.return_end.unwrap_or(last))
    });
    let first_lane = || track.signals.lane.first().copied().unwrap_or(0);
    let lane = attempt.map_or_else(first_lane, |attempt| attempt.lane);
    let following_begin = track.following_begin(target, begin, thresholds.follow_time_gap);
    let frame_of = |event: fn(&Attempt) -> Option<usize>| frame_or_never(attempt.and_then(event));
    let collision_slot = drive
        .collision
        .map_or(NO_VEHICLE, |frame| drive.collided_with[frame]);
    [
        // `first`: every recording begins at frame 0, and the table of events lists it beside the others.
        0,
        last as i32,
        i32::from(target),
        i32::from(lane),
        following_begin as i32,
        frame_of(|attempt| Some(attempt.begin)),
        frame_of(|attempt| attempt.line_crossed),
        frame_of(|attempt| attempt.overlap_begin),
        frame_of(|attempt| attempt.overlap_end),
        frame_of(|attempt| attempt.return_begin),
        frame_of(|attempt| attempt.return_end),
        frame_of(|attempt| attempt.abort),
        frame_of(|attempt| attempt.abort_end),
        frame_or_never(drive.collision),
        frame_or_never(drive.road_departure),
        frame_or_never(drive.spin),
        movements.num_attempts,
        num_passed,
        i32::from(collision_slot),
        frame_or_never(movements.first_drift),
        movements.num_drifts,
    ]
}

/// The frame of an event, `NEVER` if it did not happen.
fn frame_or_never(event: Option<usize>) -> i32 {
    event.map_or(NEVER, |frame| frame as i32)
}

/// One attempt to overtake; events that did not happen are `None`.
struct Attempt {
    /// Slot of the vehicle that the ego means to overtake.
    target: u8,
    /// Lane in which it begins.
    lane: u8,
    /// Frame in which the ego begins to move to the left.
    begin: usize,
    /// A corner of the ego crosses the left line of its lane.
    line_crossed: Option<usize>,
    /// Ego and target begin to overlap along the road.
    overlap_begin: Option<usize>,
    /// The ego's rear is ahead of the target's front.
    overlap_end: Option<usize>,
    /// The ego begins to move back after the pass.
    return_begin: Option<usize>,
    /// The ego is back in its lane, ahead of the target.
    return_end: Option<usize>,
    /// The ego begins to move back without having passed.
    abort: Option<usize>,
    /// The ego is back in its lane, behind the target, or back where it began.
    abort_end: Option<usize>,
}

/// Attempts and drifts of a simulation.
struct LeftMovements {
    /// The attempt that the events describe: the first one that is not aborted, else the last one.
    attempt: Option<Attempt>,
    /// Number of attempts, among them the aborted ones.
    num_attempts: i32,
    /// Frame in which the first drift begins.
    first_drift: Option<usize>,
    /// Number of drifts: movements over the left line or of a wide shift that neither are an attempt nor lead into
    /// another lane.
    num_drifts: i32,
}

/// Classify the movements of a simulation to the left as attempts and drifts.
fn left_movements(drive: &EgoDrive<'_>) -> LeftMovements {
    let mut movements = LeftMovements {
        attempt: None,
        num_attempts: 0,
        first_drift: None,
        num_drifts: 0,
    };
    // Movements before the end of an aborted attempt belong to that attempt.
    let (mut abort_end, mut search_from) = (0, 0);
    while let Some(movement) = drive.next_left_movement(search_from) {
        search_from = movement.last + 1;
        if movement.first < abort_end {
            continue;
        }
        let crosses_line =
            (movement.first..=movement.last).any(|frame| drive.is_over_left_line(frame));
        let outcome = MovementOutcome::classify(drive, movement, crosses_line);
        let target = drive.recent_leader(movement.first);
        if let (MovementOutcome::LeavesLane | MovementOutcome::ComesBack, Some(target)) =
            (outcome, target)
        {
            let attempt = trace_attempt(drive, target, movement.first);
            let end = attempt.abort_end;
            movements.attempt = Some(attempt);
            movements.num_attempts += 1;
            match end {
                Some(frame) => abort_end = frame,
                // The events describe the first attempt that is not aborted, so the search ends.
                None => break,
            }
        } else if outcome != MovementOutcome::LeavesLane
            // 1 is the sign of movements to the left.
            && (crosses_line || drive.is_wide(movement, 1.0))
        {
            movements.first_drift = movements.first_drift.or(Some(movement.first));
            movements.num_drifts = (movements.num_drifts + 1).min(MAX_DRIFTS);
        }
    }
    movements
}

/// Outcome of a movement to the left.
#[derive(Clone, Copy, PartialEq)]
enum MovementOutcome {
    /// The ego leaves its lane for a driving lane.
    LeavesLane,
    /// The ego advances faster than gusts move it, and comes back.
    ComesBack,
    /// Gusts and wandering explain the movement, or there is no lane to the left.
    Negligible,
}

impl MovementOutcome {
    /// The outcome of a movement; `crosses_line` says whether the ego is over its left line during it.
    fn classify(drive: &EgoDrive<'_>, movement: Movement, crosses_line: bool) -> Self {
        if !drive.has_left_lane(movement.first) {
            return Self::Negligible;
        }
        if crosses_line {
            return Self::LeavesLane;
        }
        if !drive.is_fast(movement) {
            return Self::Negligible;
        }
        let end = (movement.last + drive.thresholds.follow_up + 1).min(drive.num_driven);
        let crossed = (movement.first..end).find(|&frame| drive.is_over_left_line(frame));
        let undone = undone_frame(drive, movement.first, end);
        match (crossed, undone) {
            (None, None) => Self::Negligible,
            (Some(crossed), undone) if undone.is_none_or(|frame| crossed <= frame) => {
                Self::LeavesLane
            }
            _ => Self::ComesBack,
        }
    }
}

/// Find the events of the attempt that begins at a frame.
fn trace_attempt(drive: &EgoDrive<'_>, target: u8, begin: usize) -> Attempt {
    let signals = &drive.track.signals;
    let (lane, position) = (signals.lane[begin], drive.track.relative_position(target));
    let (left_line, right_line) = (drive.left_line(lane), drive.right_line(lane));
    // The distance `over_line` only recognises movements; the event is the frame in which a corner passes the line.
    let crossed = (begin..drive.num_driven).find(|&frame| signals.left_edge[frame] > left_line);
    // Before the crossing, the ego aborts if it comes back to where it began; after it, if it comes back into its lane
    // behind the target.
    let undone = undone_frame(drive, begin, drive.num_driven)
        .filter(|&frame| crossed.is_none_or(|crossed| frame < crossed));
    let end = undone.unwrap_or(drive.num_driven);
    // Without the event, the range is empty.
    let frames_from = |event: Option<usize>| event.unwrap_or(end)..end;
    let is_in_lane = |frame: usize| {
        signals.right_edge[frame] >= right_line && signals.left_edge[frame] <= left_line
    };
    let overlap_begin = (begin..end).find(|&frame| position.overlaps(frame));
    let overlap_end = frames_from(overlap_begin).find(|&frame| position.is_past(frame));
    let passed = crossed
        .zip(overlap_end)
        .map(|(crossed, overlap_end)| crossed.max(overlap_end));
    let return_end =
        frames_from(passed).find(|&frame| is_in_lane(frame) && position.is_past(frame));
    let back_behind =
        frames_from(crossed).find(|&frame| is_in_lane(frame) && position.is_behind(frame));
    let back_behind = back_behind.filter(|&frame| return_end.is_none_or(|end| frame <= end));
    let abort_end = earlier(undone, back_behind);
    let return_end = return_end.filter(|_| abort_end.is_none());
    let turn = turning_frame(drive, begin, earlier(return_end, abort_end));
    // A movement back before the pass is an abort, even if the recording ends before `abort_end`.
    let is_aborted = abort_end.is_some() || overlap_end.is_none();
    let is_within_attempt = |frame: &usize| abort_end.is_none_or(|end| *frame <= end);
    Attempt {
        target,
        lane,
        begin,
        line_crossed: crossed.filter(is_within_attempt),
        overlap_begin: overlap_begin.filter(is_within_attempt),
        overlap_end: overlap_end.filter(is_within_attempt),
        return_begin: turn.filter(|_| !is_aborted),
        return_end,
        abort: turn.filter(|_| is_aborted),
        abort_end,
    }
}

/// The earlier of two events.
fn earlier(first: Option<usize>, second: Option<usize>) -> Option<usize> {
    first.into_iter().chain(second).min()
}

/// First frame before `end` in which the ego is back where its movement began, after a shift of `min_shift`.
fn undone_frame(drive: &EgoDrive<'_>, begin: usize, end: usize) -> Option<usize> {
    let (lateral_position, thresholds) = (drive.track.signals.lateral_position, drive.thresholds);
    let shift = |frame: usize| lateral_position[frame] - lateral_position[begin];
    let shifted = (begin..end).find(|&frame| shift(frame) >= thresholds.min_shift)?;
    (shifted..end).find(|&frame| shift(frame) <= thresholds.settled_shift)
}

/// First frame of the movement back, after the ego was farthest to the left.
fn turning_frame(drive: &EgoDrive<'_>, begin: usize, last: Option<usize>) -> Option<usize> {
    let lateral_position = drive.track.signals.lateral_position;
    let end = last.map_or(drive.num_driven, |frame| (frame + 1).min(drive.num_driven));
    let mut farthest = begin;
    for frame in begin + 1..end {
        if lateral_position[frame] > lateral_position[farthest] {
            farthest = frame;
        }
    }
    // A short way back makes no wide movement; it begins where the ego is farthest to the left.
    drive
        .first_wide_right(farthest, end)
        .or(last.map(|_| farthest))
}
