//! Who is around the ego, how far and how fast, from recorded states; `tests/reference/labels/signals.py` says the
//! same one frame after the other.
//!
//! Here sixteen frames of one simulation lie side by side. Gaps to all neighbours, the lane to the left and the
//! frames of the target are worked out apart, as few ask for them.

mod alongside;
mod around;
mod chunk;
mod target;

use fearless_simd::{Level, Simd};

pub use self::alongside::{Alongside, alongside};
pub use self::around::{Around, around};
use self::chunk::{Chunk, Frames, Lamps, in_chunks};
pub use self::target::{Target, target};
use crate::lanes::{LANES, dispatch};
use crate::names::Constants;

/// Slot of a neighbour that does not exist.
pub const NO_VEHICLE: u8 = 255;
/// Frame of what did not happen.
pub(crate) const NEVER: i32 = -1;
pub(crate) const METRES: f32 = 1e-3;
/// Places around the ego: leader and follower in its lane, in the left and in the right one.
pub const PLACES: usize = 6;

/// A batch of recordings: a slice of frames for each simulation and vehicle, or values that lead with the simulation.
pub struct Recording<'a> {
    /// Recorded frames of each simulation.
    pub num_frames: &'a [i32],
    /// Vehicle slots of a simulation.
    pub slots: usize,
    /// Frames that a simulation has room for.
    pub frames: usize,
    /// Position along the road [mm].
    pub s: Vec<&'a [i32]>,
    /// Lateral position [mm].
    pub d: Vec<&'a [i32]>,
    /// Speed [mm/s].
    pub speed: Vec<&'a [i32]>,
    /// World heading [0.1 mrad].
    pub heading: Vec<&'a [i16]>,
    /// Longitudinal acceleration [mm/s^2].
    pub accel: Vec<&'a [i16]>,
    /// Lane index.
    pub lane: Vec<&'a [u8]>,
    /// Slot that the ego has collided with so far, a slice of frames for each simulation.
    pub hit: Vec<&'a [u8]>,
    /// Whether there is a state; `None` where every vehicle has all frames.
    pub present: Option<Vec<&'a [bool]>>,
    /// Whether a slot holds a vehicle, (simulation, slot).
    pub valid: &'a [bool],
    /// Length, (simulation, slot) [m].
    pub length: &'a [f32],
    /// Width, (simulation, slot) [m].
    pub width: &'a [f32],
    /// Driving lanes.
    pub num_lanes: usize,
    /// Driving side.
    pub side: f32,
    /// Direction of the road [rad].
    pub direction: f32,
    /// Time between frames [ms].
    pub interval_ms: i32,
    /// Frames on either side over which a lateral speed is measured.
    pub half_window: usize,
}

impl Recording<'_> {
    /// Recorded frames of a simulation.
    pub(crate) fn recorded(&self, simulation: usize) -> usize {
        (self.num_frames[simulation].max(0) as usize).min(self.frames)
    }

    /// The same, and as many more as lie side by side with the last one.
    fn rest(&self, simulation: usize) -> usize {
        let recorded = self.recorded(simulation);
        recorded.next_multiple_of(LANES).min(self.frames)
    }

    /// Where the vehicles of a simulation lie among all.
    pub(crate) fn vehicles(&self, simulation: usize) -> std::ops::Range<usize> {
        simulation * self.slots..(simulation + 1) * self.slots
    }

    /// Whether a row of a vehicle has something in a frame.
    fn is_present(&self, slot: usize, frame: usize) -> bool {
        self.present.as_ref().is_none_or(|rows| rows[slot][frame])
    }
}

/// Signals that were worked out, of a batch or of one simulation: arrays (simulation, frame), and neighbours
/// (simulation, place, frame). See `EgoSignals`.
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Seen<'a> {
    pub lane: &'a [u8],
    pub lateral_position: &'a [f32],
    pub lateral_speed: &'a [f32],
    pub speed: &'a [f32],
    pub right_edge: &'a [f32],
    pub left_edge: &'a [f32],
    pub neighbour_slot: &'a [u8],
    pub friction: &'a [f32],
    pub sight_lit: &'a [f32],
    pub sight_unlit: &'a [f32],
}

impl<'a> Seen<'a> {
    /// Those of one simulation.
    pub(crate) fn of(&self, simulation: usize, frames: usize) -> Self {
        let own = simulation * frames..(simulation + 1) * frames;
        Self {
            lane: &self.lane[own.clone()],
            lateral_position: &self.lateral_position[own.clone()],
            lateral_speed: &self.lateral_speed[own.clone()],
            speed: &self.speed[own.clone()],
            right_edge: &self.right_edge[own.clone()],
            left_edge: &self.left_edge[own.clone()],
            neighbour_slot: &self.neighbour_slot[own.start * PLACES..own.end * PLACES],
            friction: &self.friction[own.clone()],
            sight_lit: &self.sight_lit[own.clone()],
            sight_unlit: &self.sight_unlit[own],
        }
    }

    /// A neighbour of one simulation, frame by frame.
    pub(crate) fn neighbour(&self, place: usize) -> &'a [u8] {
        let frames = self.lane.len();
        &self.neighbour_slot[place * frames..(place + 1) * frames]
    }
}

/// What signals need beside the states; slices lead with the simulation.
pub struct Surroundings<'a> {
    /// Mean film of each lane, (simulation, lane) [mm].
    pub film: &'a [f32],
    /// Tread wear of the ego.
    pub wear: &'a [f32],
    /// 1 for truck tyres.
    pub truck: &'a [f32],
    /// Extinction of fog [1/m].
    pub fog: &'a [f32],
    /// Extinction of rain at rest [1/m].
    pub rain: &'a [f32],
    /// Optical depth at which contrast is lost, never negative.
    pub contrast_depth: &'a [f32],
    /// Logarithm of a lamp's intensity over the threshold.
    pub lamp_depth: &'a [f32],
    /// Its range in clear air [m].
    pub lamp_clear: &'a [f32],
    /// Farthest sight of something unlit [m].
    pub unlit_limit: &'a [f32],
    /// Farthest sight of anything [m].
    pub attention: f32,
    /// Constants of the model.
    pub constants: &'a Constants,
}

/// Slices of outputs that are cut into simulations.
macro_rules! signal_outputs {
    ($(#[$about:meta])* $name:ident: $($(#[$doc:meta])* $field:ident: $kind:ty, $rows:expr;)*) => {
        $(#[$about])*
        pub struct $name<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
        }

        impl $name<'_> {
            /// Rows of frames that each slice has for a simulation, by name.
            pub const ROWS: &'static [(&'static str, usize)] = &[$((stringify!($field), $rows)),*];

            /// Zero some frames of every row: nothing was recorded there.
            fn clear(&mut self, unused: std::ops::Range<usize>, frames: usize) {
                $(for row in self.$field.chunks_mut(frames.max(1)) {
                    row[unused.clone()].fill(Default::default());
                })*
            }

            /// Have each simulation filled, on all threads: its number, how many frames have to be, and where.
            ///
            /// Behind these frames are zeros. `filled` says how far each was filled before: behind that are zeros
            /// already.
            fn fill(
                &mut self,
                recording: &Recording<'_>,
                filled: &mut [i32],
                work: impl Fn(usize, usize, &mut $name<'_>) + Sync,
            ) {
                use rayon::prelude::*;
                self.simulations(recording.num_frames.len(), recording.frames)
                    .into_par_iter()
                    .zip(filled)
                    .enumerate()
                    .for_each(|(simulation, (mut out, filled))| {
                        let rest = recording.rest(simulation);
                        let before = (*filled).clamp(rest as i32, recording.frames as i32);
                        out.clear(rest..before as usize, recording.frames);
                        *filled = rest as i32;
                        work(simulation, rest, &mut out);
                    });
            }

            fn simulations(&mut self, count: usize, frames: usize) -> Vec<$name<'_>> {
                $(let mut $field = self.$field.chunks_mut(($rows * frames).max(1));)*
                let next = |_| Some($name { $($field: $field.next()?,)* });
                (0..count).map(next).collect::<Option<Vec<_>>>().unwrap_or_default()
            }
        }
    };
}
use signal_outputs;

signal_outputs! {
    /// Where signals go: a row of frames, or `PLACES` of them, for each simulation.
    Signals:
    /// Lane of the ego.
    lane: u8, 1;
    /// Position across it, to the left [m].
    lateral_position: f32, 1;
    /// Speed to the left [m/s].
    lateral_speed: f32, 1;
    /// Speed [m/s].
    speed: f32, 1;
    /// Acceleration [m/s^2].
    accel: f32, 1;
    /// Right-most corner [m].
    right_edge: f32, 1;
    /// Left-most corner [m].
    left_edge: f32, 1;
    /// Neighbours.
    neighbour_slot: u8, PLACES;
    /// Friction.
    friction: f32, 1;
    /// Sight of something lit [m].
    sight_lit: f32, 1;
    /// Sight of something unlit [m].
    sight_unlit: f32, 1;
}

impl Signals<'_> {
    /// The same to read, but for the acceleration.
    #[must_use]
    pub fn seen(&self) -> Seen<'_> {
        Seen {
            lane: self.lane,
            lateral_position: self.lateral_position,
            lateral_speed: self.lateral_speed,
            speed: self.speed,
            right_edge: self.right_edge,
            left_edge: self.left_edge,
            neighbour_slot: self.neighbour_slot,
            friction: self.friction,
            sight_lit: self.sight_lit,
            sight_unlit: self.sight_unlit,
        }
    }
}

/// Work out the signals of a batch. `filled` is how many frames of each simulation are not zero in `out`, before and
/// after.
pub fn signals(
    recording: &Recording<'_>,
    around: &Surroundings<'_>,
    level: Level,
    out: &mut Signals<'_>,
    filled: &mut [i32],
) {
    out.fill(recording, filled, |simulation, rest, out| {
        let ego = simulation * recording.slots;
        lateral_speed(recording, ego, &mut out.lateral_speed[..rest]);
        dispatch!(level, |simd| {
            let mut lamps = Lamps::NONE;
            in_chunks!(Frames::new(simd, recording, simulation), rest, |frames| {
                let chunk = Chunk { frames, around };
                let body = frames.footprint(ego);
                chunk.own(body, &mut lamps, out);
                chunk.nearest(out);
            });
        });
    });
}

/// Speed to the left of a vehicle that is in all frames: a central difference, one-sided at the ends.
fn lateral_speed(recording: &Recording<'_>, slot: usize, out: &mut [f32]) {
    let (d, half) = (recording.d[slot], recording.half_window);
    let recorded = recording.recorded(slot / recording.slots);
    let last = recorded.saturating_sub(1);
    let at = |frame: usize| {
        let later = (frame + half).min(last);
        let earlier = frame.saturating_sub(half).min(last);
        let moved = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * recording.interval_ms).max(1) as f32;
        recording.side * (moved / elapsed)
    };
    let begin = half.min(out.len());
    let end = recorded.saturating_sub(half).clamp(begin, out.len());
    for (frame, speed) in out[..begin].iter_mut().enumerate() {
        *speed = at(frame);
    }
    // In between the time is always the same, and nothing is at an end.
    let elapsed = (2 * half as i32 * recording.interval_ms).max(1) as f32;
    let pairs = d.iter().zip(d.iter().skip(2 * half));
    for (speed, (earlier, later)) in out[begin..end].iter_mut().zip(pairs) {
        *speed = recording.side * (later.wrapping_sub(*earlier) as f32 / elapsed);
    }
    for (frame, speed) in out[end..].iter_mut().enumerate() {
        *speed = at(end + frame);
    }
}

/// Gap between the bumpers of two bodies, from their places along the road [m].
pub(crate) fn gap_between(one: i32, other: i32, half_lengths: f32) -> f32 {
    one.wrapping_sub(other).wrapping_abs() as f32 * METRES - half_lengths
}
