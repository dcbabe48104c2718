//! What happened in each simulation, from its signals; `tests/reference/labels/events.py` says the same.

mod attempt;
mod movements;
mod scene;

use rayon::prelude::*;

use self::attempt::{Attempt, lefts};
pub use self::scene::Limits;
use self::scene::Scene;
use crate::signals::{NEVER, NO_VEHICLE, Recording, Seen};

/// Simulations that a thread takes at a time; each is a matter of a microsecond.
const SHARE: usize = 32;

/// What there is to say of a simulation, in the order of `Found`.
pub const NAMES: [&str; 21] = [
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

/// Values of one simulation, by the places of `NAMES`.
type Found = [i32; NAMES.len()];

/// Find the events of a batch: a row of `out` for each of `NAMES`, a column for each simulation.
pub fn events(recording: &Recording<'_>, seen: &Seen<'_>, limits: &Limits<'_>, out: &mut [i32]) {
    let count = recording.num_frames.len();
    let found: Vec<Found> = (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .map(|simulation| of(&Scene::new(recording, seen, limits, simulation)))
        .collect();
    for (name, row) in out.chunks_mut(count.max(1)).enumerate() {
        for (value, one) in row.iter_mut().zip(&found) {
            *value = one[name];
        }
    }
}

/// The events of one simulation.
fn of(scene: &Scene<'_>) -> Found {
    let lefts = lefts(scene);
    let attempt = lefts.attempt.as_ref();
    let last = scene.recorded.saturating_sub(1);
    let prospect = || scene.prospect().unwrap_or(NO_VEHICLE);
    let target = attempt.map_or_else(prospect, |one| one.target);
    let until = attempt.map_or(last, |one| one.begun);
    let passed = attempt.map_or(0, |one| {
        scene.num_passed(one.begun, one.return_end.unwrap_or(last))
    });
    let lane = attempt.map_or_else(|| scene.lane.first().copied().unwrap_or(0), |one| one.lane);
    let at = |event: fn(&Attempt) -> Option<usize>| frame(attempt.and_then(event));
    [
        0,
        last as i32,
        i32::from(target),
        i32::from(lane),
        scene.follow(target, until) as i32,
        at(|one| Some(one.begun)),
        at(|one| one.line_crossed),
        at(|one| one.overlap_begin),
        at(|one| one.overlap_end),
        at(|one| one.return_begin),
        at(|one| one.return_end),
        at(|one| one.abort),
        at(|one| one.back),
        frame(scene.collision),
        frame(scene.departure),
        frame(scene.spin),
        lefts.num_attempts,
        passed,
        i32::from(scene.collision.map_or(NO_VEHICLE, |frame| scene.hit[frame])),
        frame(lefts.drift),
        lefts.num_drifts,
    ]
}

/// A frame as it is written down.
fn frame(event: Option<usize>) -> i32 {
    event.map_or(NEVER, |frame| frame as i32)
}
