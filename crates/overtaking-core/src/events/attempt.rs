//! Attempts to overtake, from the movement to the left to the return or the end; what is none is a drift.

use super::movements::Movement;
use super::scene::Scene;

/// Drifts that are counted.
const MOST: i32 = 255;

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

/// The attempts and drifts of a simulation.
pub(super) struct Lefts {
    /// The last attempt.
    pub(super) attempt: Option<Attempt>,
    pub(super) num_attempts: i32,
    /// Where the first drift begins.
    pub(super) drift: Option<usize>,
    pub(super) num_drifts: i32,
}

/// What the movements of a simulation to the left are.
pub(super) fn lefts(scene: &Scene<'_>) -> Lefts {
    let mut found = Lefts {
        attempt: None,
        num_attempts: 0,
        drift: None,
        num_drifts: 0,
    };
    let (mut after, mut next) = (0, 0);
    while let Some(movement) = scene.movement_left(next) {
        next = movement.end + 1;
        if movement.begin < after {
            continue;
        }
        let crosses = (movement.begin..=movement.end).any(|frame| scene.is_out(frame));
        let comes_to = Outcome::of(scene, movement, crosses);
        let target = scene.lately_ahead(movement.begin);
        if let (Outcome::Leaves | Outcome::Returns, Some(target)) = (comes_to, target) {
            let one = attempt(scene, target, movement.begin);
            let back = one.back;
            (found.attempt, found.num_attempts) = (Some(one), found.num_attempts + 1);
            match back {
                Some(frame) => after = frame,
                None => break,
            }
        } else if comes_to != Outcome::Leaves && (crosses || scene.is_wide(movement, 1.0)) {
            found.drift = found.drift.or(Some(movement.begin));
            found.num_drifts = (found.num_drifts + 1).min(MOST);
        }
    }
    found
}

/// What a movement to the left comes to.
#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    /// The ego leaves its lane for a driving lane.
    Leaves,
    /// It moves as only drivers move it, and comes back.
    Returns,
    Nothing,
}

impl Outcome {
    fn of(scene: &Scene<'_>, one: Movement, crosses: bool) -> Self {
        if !scene.has_left(one.begin) {
            return Self::Nothing;
        }
        if crosses {
            return Self::Leaves;
        }
        if !scene.is_fast(one) {
            return Self::Nothing;
        }
        let until = (one.end + scene.limits.follow_up + 1).min(scene.driven);
        let crossed = (one.begin..until).find(|&frame| scene.is_out(frame));
        let undone = undone(scene, one.begin, until);
        match (crossed, undone) {
            (None, None) => Self::Nothing,
            (Some(crossed), undone) if undone.is_none_or(|frame| crossed <= frame) => Self::Leaves,
            _ => Self::Returns,
        }
    }
}

/// The phases of the attempt that begins at a frame.
fn attempt(scene: &Scene<'_>, target: u8, begun: usize) -> Attempt {
    let (lane, other) = (scene.lane[begun], scene.beside(target));
    let (left, right) = (scene.left_line(lane), scene.right_line(lane));
    let crossed = (begun..scene.driven).find(|&frame| scene.left_edge[frame] > left);
    let undone = undone(scene, begun, scene.driven)
        .filter(|&frame| crossed.is_none_or(|crossed| frame < crossed));
    let end = undone.unwrap_or(scene.driven);
    let from = |start: Option<usize>| start.unwrap_or(end)..end;
    let is_home = |frame: usize| scene.right_edge[frame] >= right && scene.left_edge[frame] <= left;
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

/// Where a movement that began at a frame is undone, before another.
fn undone(scene: &Scene<'_>, begun: usize, until: usize) -> Option<usize> {
    let limits = scene.limits;
    let shift = |frame: usize| scene.lateral_position[frame] - scene.lateral_position[begun];
    let moved = (begun..until).find(|&frame| shift(frame) >= limits.least_shift)?;
    (moved..until).find(|&frame| shift(frame) <= limits.settled_shift)
}

/// Where the movement back begins, after the ego was farthest to the left.
fn turning(scene: &Scene<'_>, begun: usize, end: Option<usize>) -> Option<usize> {
    let until = end.map_or(scene.driven, |frame| (frame + 1).min(scene.driven));
    let mut farthest = begun;
    for frame in begun + 1..until {
        if scene.lateral_position[frame] > scene.lateral_position[farthest] {
            farthest = frame;
        }
    }
    // A short way back can be too short to be a movement of its own.
    scene.wide_right(farthest, until).or(end.map(|_| farthest))
}
