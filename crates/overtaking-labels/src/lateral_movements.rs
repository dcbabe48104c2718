//! Movements of the ego across the road: unbroken runs of frames with lateral motion, their width and their speed.
//!
//! Left is the overtaking side, and lateral positions and speeds are positive to the left.

use crate::recording::{NO_VEHICLE, PackedRecording, SignalViews};
use crate::track::Track;

/// A full turn in the unit of recorded headings [0.1 mrad].
const FULL_TURN: i32 = 62_832;

/// Hand the numbers of `EventThresholds` to a macro: meaning, name and type.
#[macro_export]
macro_rules! with_event_thresholds {
    ($then:ident!) => {
        $then! {
            /// Fewest frames of a wide movement.
            min_frames: usize,
            /// Frames before a movement whose median position is the position from which it starts.
            window: usize,
            /// Lateral speed above which the ego moves across the road [m/s].
            min_speed: f32,
            /// Smallest shift of a wide movement [m].
            min_shift: f32,
            /// Shift at which a movement counts as undone, after it has reached `min_shift` [m].
            settled_shift: f32,
            /// Number of lanes, from lane 0 on, that have a driving lane to their left.
            lanes_with_left: usize,
            /// Distance beyond a line above which a corner counts as over the line [m].
            over_line: f32,
            /// Frames within which a fast movement advances by `min_advance`.
            advance: usize,
            /// Frames after a fast movement in which the ego may still leave its lane or come back.
            follow_up: usize,
            /// Time gap below which the ego follows its leader closely [s].
            follow_time_gap: f32,
            /// Direction of the road [0.1 mrad].
            direction: i32,
            /// Angle to the road beyond which a vehicle has spun [0.1 mrad].
            spin_angle: i32,
        }
    };
}

macro_rules! declare_event_thresholds {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Thresholds of `event_detection.toml`, and the lanes of the road; times are numbers of frames.
        pub struct EventThresholds<'a> {
            /// Smallest shift to the left of a fast movement within `advance` frames, for each ego [m]. Gusts and
            /// wandering in the lane cause smaller shifts.
            pub min_advance: &'a [f32],
            /// Lane borders from right to left [m].
            pub borders: Vec<f32>,
            $($(#[$doc])* pub $field: $kind,)*
        }
    };
}
with_event_thresholds! { declare_event_thresholds! }

impl EventThresholds<'_> {
    /// First frame in which a vehicle stands across the road, after a frame in which it did not.
    fn first_spin(&self, headings: &[i16]) -> Option<usize> {
        let direction = (self.direction + FULL_TURN / 2).rem_euclid(FULL_TURN) - FULL_TURN / 2;
        first_change(headings, |heading| {
            // Heading and direction each lie within half a turn of zero, or little more. Their difference is therefore
            // at most one and a half turns, and one subtraction of a full turn makes it an angle.
            let angle = (i32::from(heading) - direction).abs();
            angle.min((angle - FULL_TURN).abs()) > self.spin_angle
        })
    }
}

/// First frame in which a condition holds.
fn first_frame<T: Copy>(row: &[T], holds: impl Fn(T) -> bool) -> Option<usize> {
    // In most rows the condition holds in no frame. Without branches in a chunk, whose size is a choice, the compiler
    // tests many frames at once.
    const CHUNK: usize = 64;
    let holds_in_any = |chunk: &[T]| chunk.iter().fold(false, |any, &value| any | holds(value));
    let begin = CHUNK * row.chunks(CHUNK).position(holds_in_any)?;
    let offset = row[begin..].iter().position(|&value| holds(value))?;
    Some(begin + offset)
}

/// First frame in which a condition holds after a frame in which it does not hold. So a vehicle that is beside the
/// lanes when the recording begins does not count as leaving them.
fn first_change<T: Copy>(row: &[T], holds: impl Fn(T) -> bool) -> Option<usize> {
    let start = row.iter().position(|&value| !holds(value))?;
    Some(start + first_frame(&row[start..], holds)?)
}

/// The ego of one simulation up to its first accident.
pub(crate) struct EgoDrive<'a> {
    /// The simulation.
    pub(crate) track: Track<'a>,
    /// Thresholds of the events.
    pub(crate) thresholds: &'a EventThresholds<'a>,
    /// `EventThresholds::min_advance` of this ego [m].
    min_advance: f32,
    /// Number of frames before the first accident.
    pub(crate) num_driven: usize,
    /// Frame of the first collision.
    pub(crate) collision: Option<usize>,
    /// Frame in which the ego leaves the lanes.
    pub(crate) road_departure: Option<usize>,
    /// Frame in which the ego stands across the road.
    pub(crate) spin: Option<usize>,
    /// Slot of the vehicle with which the ego has collided so far, frame by frame; `NO_VEHICLE` before a collision.
    pub(crate) collided_with: &'a [u8],
}

/// An unbroken movement from its first to its last frame; both belong to it.
#[derive(Clone, Copy)]
pub(crate) struct Movement {
    pub(crate) first: usize,
    pub(crate) last: usize,
}

impl<'a> EgoDrive<'a> {
    /// The ego of one simulation of a batch.
    pub(crate) fn new(
        recording: &'a PackedRecording<'a>,
        signals: &SignalViews<'a>,
        thresholds: &'a EventThresholds<'a>,
        simulation: usize,
    ) -> Self {
        let track = Track::new(recording, signals, simulation);
        let num_frames = track.num_frames;
        let collided_with = recording.collided_with[simulation];
        let collision = first_frame(&collided_with[..num_frames], |slot| slot != NO_VEHICLE);
        // `num_lanes` stands for the overtaking side of the road and 255 for the kerb side; both lie beyond the lanes.
        let num_lanes = thresholds.borders.len() - 1;
        let road_departure = first_change(&track.signals.lane[..num_frames], |lane| {
            usize::from(lane) >= num_lanes
        });
        let ego = recording.row(simulation, 0);
        let spin = thresholds.first_spin(&recording.heading[ego][..num_frames]);
        let accident = [collision, road_departure, spin]
            .into_iter()
            .flatten()
            .min();
        Self {
            track,
            thresholds,
            min_advance: thresholds.min_advance[simulation],
            num_driven: accident.unwrap_or(num_frames),
            collision,
            road_departure,
            spin,
            collided_with,
        }
    }

    /// Left border of a lane; the last border for a place beyond the lanes on either side, where no attempt begins [m].
    pub(crate) fn left_line(&self, lane: u8) -> f32 {
        let borders = &self.thresholds.borders;
        borders[(usize::from(lane) + 1).min(borders.len() - 1)]
    }

    /// Right border of a lane; beyond the lanes as `left_line` [m].
    pub(crate) fn right_line(&self, lane: u8) -> f32 {
        let borders = &self.thresholds.borders;
        borders[usize::from(lane).min(borders.len() - 1)]
    }

    /// Whether a driving lane lies to the left of the ego's lane.
    pub(crate) fn has_left_lane(&self, frame: usize) -> bool {
        usize::from(self.track.signals.lane[frame]) < self.thresholds.lanes_with_left
    }

    /// Whether a corner of the ego is over the left line of a lane in which its whole left side has been.
    pub(crate) fn is_over_left_line(&self, frame: usize) -> bool {
        self.has_corner_over_line(frame) && self.has_been_inside(frame)
    }

    /// Whether a corner of the ego is beyond the left line of its lane by more than `over_line`.
    fn has_corner_over_line(&self, frame: usize) -> bool {
        let signals = &self.track.signals;
        let line = self.left_line(signals.lane[frame]);
        signals.left_edge[frame] > line + self.thresholds.over_line
    }

    /// Whether the whole left side was inside the lane for `min_frames` successive frames since the centre entered it.
    ///
    /// If the recording begins in this lane, it suffices that the left side was inside in the first frame, or that the
    /// ego moved to the left there: a recording can begin while the ego leaves its lane.
    fn has_been_inside(&self, frame: usize) -> bool {
        let (lane, thresholds) = (self.track.signals.lane, self.thresholds);
        let mut num_inside = 0;
        for earlier in (0..frame).rev() {
            if lane[earlier] != lane[frame] {
                return false;
            }
            num_inside = if self.has_corner_over_line(earlier) {
                0
            } else {
                num_inside + 1
            };
            if num_inside >= thresholds.min_frames {
                return true;
            }
        }
        num_inside > 0 || self.track.signals.lateral_speed[0] > thresholds.min_speed
    }

    /// The last leader within `window` frames in the present lane, if that vehicle still has a state.
    pub(crate) fn recent_leader(&self, frame: usize) -> Option<u8> {
        let lane = self.track.signals.lane;
        let earliest = frame.saturating_sub(self.thresholds.window);
        (earliest..=frame)
            .rev()
            .take_while(|&earlier| lane[earlier] == lane[frame])
            .find_map(|earlier| self.track.leader(earlier))
            .filter(|&slot| self.track.has_state(usize::from(slot), frame))
    }

    /// The first movement to the left that begins at a frame or later.
    pub(crate) fn next_left_movement(&self, search_from: usize) -> Option<Movement> {
        let (lateral_speed, min_speed) =
            (self.track.signals.lateral_speed, self.thresholds.min_speed);
        self.next_movement(search_from, |frame| {
            let speed = lateral_speed[frame];
            // Over the line any speed to the left counts, because the ego is leaving its lane.
            speed > min_speed || (speed > 0.0 && self.is_over_left_line(frame))
        })
    }

    /// First frame of the first wide movement to the right that begins within some frames.
    pub(crate) fn first_wide_right(&self, search_from: usize, end: usize) -> Option<usize> {
        let (lateral_speed, max_speed) =
            (self.track.signals.lateral_speed, -self.thresholds.min_speed);
        let mut search_from = search_from;
        loop {
            let movement =
                self.next_movement(search_from, |frame| lateral_speed[frame] < max_speed)?;
            if movement.first >= end {
                return None;
            }
            if self.is_wide(movement, -1.0) {
                return Some(movement.first);
            }
            search_from = movement.last + 1;
        }
    }

    /// The first unbroken run of frames with movement that begins at a frame or later; an accident ends it.
    fn next_movement(
        &self,
        search_from: usize,
        is_moving: impl Fn(usize) -> bool,
    ) -> Option<Movement> {
        let begins = |frame: &usize| is_moving(*frame) && (*frame == 0 || !is_moving(*frame - 1));
        let first = (search_from..self.num_driven).find(begins)?;
        let end = (first + 1..self.num_driven).find(|&frame| !is_moving(frame));
        Some(Movement {
            first,
            last: end.unwrap_or(self.num_driven) - 1,
        })
    }

    /// Whether a movement to the left advances faster than gusts and wandering move a vehicle.
    pub(crate) fn is_fast(&self, movement: Movement) -> bool {
        let lateral_position = self.track.signals.lateral_position;
        (movement.first..=movement.last).any(|frame| {
            let later = (frame + self.thresholds.advance).min(movement.last);
            lateral_position[later] - lateral_position[frame] >= self.min_advance
        })
    }

    /// Whether a movement has `min_frames` and leads `min_shift` away from the earlier position.
    ///
    /// `sign` is 1 for a movement to the left, -1 for one to the right.
    pub(crate) fn is_wide(&self, movement: Movement, sign: f32) -> bool {
        let position = self.track.signals.lateral_position[movement.last];
        movement.last - movement.first + 1 >= self.thresholds.min_frames
            && sign * (position - self.median_position(movement.first)) >= self.thresholds.min_shift
    }

    /// Median lateral position over the `window` frames before a frame and the frame itself [m].
    fn median_position(&self, frame: usize) -> f32 {
        let lateral_position = self.track.signals.lateral_position;
        let earliest = frame.saturating_sub(self.thresholds.window);
        // Frames before the recording count with the first recorded position.
        let num_missing = self.thresholds.window - (frame - earliest);
        let mut positions = vec![lateral_position[0]; num_missing];
        positions.extend_from_slice(&lateral_position[earliest..=frame]);
        let middle = positions.len() / 2;
        let is_odd = !positions.len().is_multiple_of(2);
        let (lower, upper, _) = positions.select_nth_unstable_by(middle, f32::total_cmp);
        if is_odd {
            return *upper;
        }
        let below = lower.iter().copied().max_by(f32::total_cmp);
        (below.unwrap_or(*upper) + *upper) / 2.0
    }
}
