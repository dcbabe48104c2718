//! One simulation, frame by frame, and the small questions to it.

use crate::signals::{METRES, NO_VEHICLE, Recording, Seen, gap_between};

/// Keeps time gaps finite [m/s].
const LEAST_SPEED: f32 = 0.1;
const LEADER: usize = 0;
/// A full turn, as headings are recorded [0.1 mrad].
const TURN: i32 = 62_832;

/// What makes a movement one, and where the lanes lie.
pub struct Limits<'a> {
    /// Advance that is more than gusts and wandering, of each ego [m].
    pub least_advance: &'a [f32],
    /// Lane borders from the right to the left [m].
    pub borders: Vec<f32>,
    /// Frames that a movement lasts at least.
    pub least_frames: usize,
    /// Frames before a movement that say where the ego was.
    pub window: usize,
    /// Least speed of a movement [m/s].
    pub least_speed: f32,
    /// Least way of a movement [m].
    pub least_shift: f32,
    /// Way within which a movement counts as undone [m].
    pub settled_shift: f32,
    /// Lanes, from the slowest on, that have a driving lane to their left.
    pub lanes_with_left: usize,
    /// How far over the line a corner is before it counts as over it [m].
    pub over_line: f32,
    /// Frames in which a fast movement makes its advance.
    pub advance: usize,
    /// Frames after a fast movement in which it leads out of the lane or is undone.
    pub follow_up: usize,
    /// Time gap that is close [s].
    pub follow_time_gap: f32,
    /// Direction of the road [0.1 mrad].
    pub direction: i32,
    /// Angle to the road beyond which a vehicle has spun [0.1 mrad].
    pub spin_angle: i32,
}

impl Limits<'_> {
    /// First frame in which a vehicle is across the road, after a frame in which it is not.
    fn spin(&self, headings: &[i16]) -> Option<usize> {
        let direction = (self.direction + TURN / 2).rem_euclid(TURN) - TURN / 2;
        first_change(headings, |heading| {
            // Both lie within half a turn of zero, or little more, so the difference within one and a half.
            let turned = (i32::from(heading) - direction).abs();
            turned.min((turned - TURN).abs()) > self.spin_angle
        })
    }
}

/// The first frame in which something holds; many are asked together, as it mostly holds in none.
fn first<T: Copy>(row: &[T], holds: impl Fn(T) -> bool) -> Option<usize> {
    const TOGETHER: usize = 64;
    let any = |few: &[T]| few.iter().fold(false, |any, &one| any | holds(one));
    let begin = TOGETHER * row.chunks(TOGETHER).position(any)?;
    let step = row[begin..].iter().position(|&one| holds(one))?;
    Some(begin + step)
}

/// The first frame in which a condition holds after a frame in which it does not hold. A recording may begin with a
/// vehicle beside the lanes, which is no departure from them.
fn first_change<T: Copy>(row: &[T], holds: impl Fn(T) -> bool) -> Option<usize> {
    let start = row.iter().position(|&value| !holds(value))?;
    Some(start + first(&row[start..], holds)?)
}

/// One simulation.
pub(super) struct Scene<'a> {
    pub(super) limits: &'a Limits<'a>,
    /// Frames that were recorded, and that there is room for.
    pub(super) recorded: usize,
    /// Frames before any accident.
    pub(super) driven: usize,
    pub(super) collision: Option<usize>,
    pub(super) departure: Option<usize>,
    pub(super) spin: Option<usize>,
    pub(super) hit: &'a [u8],
    pub(super) lane: &'a [u8],
    pub(super) lateral_position: &'a [f32],
    pub(super) lateral_speed: &'a [f32],
    pub(super) right_edge: &'a [f32],
    pub(super) left_edge: &'a [f32],
    pub(super) least_advance: f32,
    speed: &'a [f32],
    leader: &'a [u8],
    s: &'a [&'a [i32]],
    present: Option<&'a [&'a [bool]]>,
    valid: &'a [bool],
    length: &'a [f32],
}

impl<'a> Scene<'a> {
    /// A simulation of a batch.
    pub(super) fn new(
        recording: &'a Recording<'a>,
        seen: &Seen<'a>,
        limits: &'a Limits<'a>,
        simulation: usize,
    ) -> Self {
        let recorded = recording.recorded(simulation);
        let (seen, slots) = (
            seen.of(simulation, recording.frames),
            recording.vehicles(simulation),
        );
        let (lane, hit) = (seen.lane, recording.hit[simulation]);
        let collision = first(&hit[..recorded], |other| other != NO_VEHICLE);
        let beyond = limits.borders.len() - 1;
        let departure = first_change(&lane[..recorded], |each| usize::from(each) >= beyond);
        let spin = limits.spin(&recording.heading[slots.start][..recorded]);
        let accident = [collision, departure, spin].into_iter().flatten().min();
        Self {
            limits,
            recorded,
            driven: accident.unwrap_or(recorded),
            collision,
            departure,
            spin,
            hit,
            lane,
            lateral_position: seen.lateral_position,
            lateral_speed: seen.lateral_speed,
            right_edge: seen.right_edge,
            left_edge: seen.left_edge,
            least_advance: limits.least_advance[simulation],
            speed: seen.speed,
            leader: seen.neighbour(LEADER),
            s: &recording.s[slots.clone()],
            present: recording.present.as_ref().map(|rows| &rows[slots.clone()]),
            valid: &recording.valid[slots.clone()],
            length: &recording.length[slots],
        }
    }

    /// Left border of a lane; the last border for what is beyond the lanes.
    pub(super) fn left_line(&self, lane: u8) -> f32 {
        let borders = &self.limits.borders;
        borders[(usize::from(lane) + 1).min(borders.len() - 1)]
    }

    /// Right border of a lane; the last border for what is beyond the lanes.
    pub(super) fn right_line(&self, lane: u8) -> f32 {
        let borders = &self.limits.borders;
        borders[usize::from(lane).min(borders.len() - 1)]
    }

    /// Whether there is a driving lane to the left of the ego's lane.
    pub(super) fn has_left(&self, frame: usize) -> bool {
        usize::from(self.lane[frame]) < self.limits.lanes_with_left
    }

    /// Whether a corner of the ego is over the left line of a lane in which the whole left side has been.
    pub(super) fn is_out(&self, frame: usize) -> bool {
        self.is_over(frame) && self.has_been_inside(frame)
    }

    fn is_over(&self, frame: usize) -> bool {
        self.left_edge[frame] > self.left_line(self.lane[frame]) + self.limits.over_line
    }

    /// Whether the whole left side was in the lane for long enough since the centre came, or at first; a recording may
    /// also begin while the ego leaves its lane.
    fn has_been_inside(&self, frame: usize) -> bool {
        let mut inside = 0;
        for earlier in (0..frame).rev() {
            if self.lane[earlier] != self.lane[frame] {
                return false;
            }
            inside = if self.is_over(earlier) { 0 } else { inside + 1 };
            if inside >= self.limits.least_frames {
                return true;
            }
        }
        inside > 0 || self.lateral_speed[0] > self.limits.least_speed
    }

    fn leader(&self, frame: usize) -> Option<u8> {
        let leader = self.leader[frame];
        (frame < self.recorded && leader != NO_VEHICLE).then_some(leader)
    }

    /// The leader, or who was it until a moment ago and is still recorded.
    pub(super) fn lately_ahead(&self, frame: usize) -> Option<u8> {
        let earliest = frame.saturating_sub(self.limits.window);
        (earliest..=frame)
            .rev()
            .take_while(|&each| self.lane[each] == self.lane[frame])
            .find_map(|each| self.leader(each))
            .filter(|&slot| self.is_present(usize::from(slot), frame))
    }

    fn is_present(&self, slot: usize, frame: usize) -> bool {
        self.present.is_none_or(|rows| rows[slot][frame])
    }

    /// The leader that the ego is close behind.
    fn followed(&self, frame: usize) -> Option<u8> {
        let speed = self.speed[frame];
        let moving = if speed > LEAST_SPEED {
            speed
        } else {
            LEAST_SPEED
        };
        let leader = self.leader(frame)?;
        (self.gap(leader, frame) / moving < self.limits.follow_time_gap).then_some(leader)
    }

    /// Gap between the ego and another vehicle [m].
    fn gap(&self, slot: u8, frame: usize) -> f32 {
        let slot = usize::from(slot);
        let halves = self.length[0] * 0.5 + self.length[slot] * 0.5;
        gap_between(self.s[0][frame], self.s[slot][frame], halves)
    }

    /// Whom an ego that attempts nothing might have overtaken.
    pub(super) fn prospect(&self) -> Option<u8> {
        let frames = 0..self.recorded;
        let followed = frames.clone().find_map(|frame| self.followed(frame));
        followed.or_else(|| frames.clone().find_map(|frame| self.leader(frame)))
    }

    /// First frame close behind the target, up to a frame; else the first one.
    pub(super) fn follow(&self, target: u8, until: usize) -> usize {
        let end = self.recorded.min(until + 1);
        (0..end)
            .find(|&frame| self.followed(frame) == Some(target))
            .unwrap_or(0)
    }

    /// Where the ego is along the road, seen from another vehicle.
    pub(super) fn beside(&self, slot: u8) -> Beside<'a> {
        let slot = usize::from(slot);
        Beside {
            own: self.s[0],
            other: self.s[slot],
            half: 0.5 * (self.length[0] + self.length[slot]),
            present: self.present.map(|rows| rows[slot]),
        }
    }

    /// Vehicles ahead of the ego at one frame and behind it at another.
    pub(super) fn num_passed(&self, begin: usize, end: usize) -> i32 {
        let there = |slot: usize, frame: usize| {
            self.valid[slot] && frame < self.recorded && self.is_present(slot, frame)
        };
        let lead = |slot: usize, frame: usize| self.s[0][frame].wrapping_sub(self.s[slot][frame]);
        let passed = |slot: &usize| {
            there(*slot, begin)
                && there(*slot, end)
                && lead(*slot, begin) < 0
                && lead(*slot, end) > 0
        };
        (0..self.s.len()).filter(passed).count() as i32
    }
}

/// The ego seen from another vehicle, frame by frame.
pub(super) struct Beside<'a> {
    own: &'a [i32],
    other: &'a [i32],
    half: f32,
    present: Option<&'a [bool]>,
}

impl Beside<'_> {
    fn is_there(&self, frame: usize) -> bool {
        self.present.is_none_or(|row| row[frame])
    }

    /// Centre of the ego minus that of the other along the road [m].
    fn lead(&self, frame: usize) -> f32 {
        self.own[frame].wrapping_sub(self.other[frame]) as f32 * METRES
    }

    /// Whether the two overlap along the road.
    pub(super) fn overlaps(&self, frame: usize) -> bool {
        self.is_there(frame) && self.lead(frame).abs() - self.half < 0.0
    }

    /// Whether the ego is wholly ahead.
    pub(super) fn is_past(&self, frame: usize) -> bool {
        let lead = self.lead(frame);
        self.is_there(frame) && lead > 0.0 && lead.abs() - self.half >= 0.0
    }

    /// Whether the centre of the ego is behind.
    pub(super) fn is_ahead(&self, frame: usize) -> bool {
        self.is_there(frame) && self.lead(frame) < 0.0
    }
}
