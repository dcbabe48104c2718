//! Attempts to overtake, from the movement to the left to the return or the end.

use super::movements::Movement;
use super::scene::Scene;

/// One attempt; what did not happen is `None`.
pub(super) struct Attempt {
    pub(super) target: u8,
    pub(super) lane: u8,
    pub(super) begun: usize,
    pub(super) line_crossed: Option<usize>,
    pub(super) overlap_begin: Option<usize>,
    pub(super) overlap_end: Option<usize>,
    pub(super) return_begin: Option<usize>,
    pub(super) return_end: Option<usize>,
    pub(super) abort: Option<usize>,
    pub(super) back: Option<usize>,
}

/// The last attempt of a simulation, and how many there were.
pub(super) fn decisive(scene: &Scene<'_>) -> (Option<Attempt>, i32) {
    let (mut last, mut count, mut after, mut next) = (None, 0, 0, 0);
    while let Some(movement) = scene.movement_left(next) {
        next = movement.end + 1;
        if movement.begin < after || !is_attempt(scene, movement) {
            continue;
        }
        let Some(target) = scene.lately_ahead(movement.begin) else {
            continue;
        };
        let found = attempt(scene, target, movement.begin);
        let back = found.back;
        (last, count) = (Some(found), count + 1);
        match back {
            Some(frame) => after = frame,
            None => break,
        }
    }
    (last, count)
}

/// Whether a movement to the left was meant or crosses the line.
fn is_attempt(scene: &Scene<'_>, one: Movement) -> bool {
    (one.begin..=one.end).any(|frame| scene.treads(frame)) || scene.is_meant(one, 1.0)
}

/// The phases of the attempt that begins at a frame.
fn attempt(scene: &Scene<'_>, target: u8, begun: usize) -> Attempt {
    let (lane, other) = (scene.lane[begun], scene.beside(target));
    let (left, right) = (scene.left_line(lane), scene.right_line(lane));
    let crossed = (begun..scene.driven).find(|&frame| scene.left_reach[frame] > left);
    let undone = undone(scene, begun, crossed);
    let end = undone.unwrap_or(scene.driven);
    let from = |start: Option<usize>| start.unwrap_or(end)..end;
    let is_home =
        |frame: usize| scene.right_reach[frame] >= right && scene.left_reach[frame] <= left;
    let overlap_begin = (begun..end).find(|&frame| other.overlaps(frame));
    let overlap_end = from(overlap_begin).find(|&frame| other.is_past(frame));
    let out = crossed.zip(overlap_end).map(|(one, two)| one.max(two));
    let return_end = from(out).find(|&frame| is_home(frame) && other.is_past(frame));
    let behind = from(crossed).find(|&frame| is_home(frame) && other.is_ahead(frame));
    let returned = behind.filter(|&frame| return_end.is_none_or(|end| frame <= end));
    let back = earlier(undone, returned);
    let return_end = return_end.filter(|_| back.is_none());
    let turned = turning(scene, begun, earlier(return_end, back));
    let gave_up = back.is_some() || overlap_end.is_none();
    let in_time = |frame: &usize| back.is_none_or(|back| *frame <= back);
    Attempt {
        target,
        lane,
        begun,
        line_crossed: crossed.filter(in_time),
        overlap_begin: overlap_begin.filter(in_time),
        overlap_end: overlap_end.filter(in_time),
        return_begin: turned.filter(|_| !gave_up),
        return_end,
        abort: turned.filter(|_| gave_up),
        back,
    }
}

fn earlier(one: Option<usize>, other: Option<usize>) -> Option<usize> {
    one.into_iter().chain(other).min()
}

/// Where a movement is undone that never came to the line.
fn undone(scene: &Scene<'_>, begun: usize, crossed: Option<usize>) -> Option<usize> {
    let limits = scene.limits;
    let shift = |frame: usize| scene.lateral[frame] - scene.lateral[begun];
    let moved = (begun..scene.driven).find(|&frame| shift(frame) >= limits.least_shift)?;
    let settled = (moved..scene.driven).find(|&frame| shift(frame) <= limits.settled_shift)?;
    crossed
        .is_none_or(|frame| settled < frame)
        .then_some(settled)
}

/// Where the movement back begins, after the ego was farthest to the left.
fn turning(scene: &Scene<'_>, begun: usize, end: Option<usize>) -> Option<usize> {
    let until = end.map_or(scene.driven, |frame| (frame + 1).min(scene.driven));
    let mut farthest = begun;
    for frame in begun + 1..until {
        if scene.lateral[frame] > scene.lateral[farthest] {
            farthest = frame;
        }
    }
    // A short way back can be too short to be a movement of its own.
    scene.meant_right(farthest, until).or(end.map(|_| farthest))
}
