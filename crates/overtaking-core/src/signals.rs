//! Who is around the ego, how far and how fast, from recorded states; see `overtaking.labels.signals.reference`.
//!
//! Here sixteen frames of one simulation lie side by side. Gaps to all neighbours and the lane to the left are
//! worked out apart, as few ask for them in all frames.

mod chunk;
mod left;
mod neighbours;
mod target;

use fearless_simd::Simd;

use self::chunk::{Chunk, Frames, in_chunks};
pub use self::left::{LeftLane, left_lane};
pub(crate) use self::neighbours::gap_between;
pub use self::neighbours::{Along, Neighbours, neighbour_at, neighbours};
pub use self::target::{Instants, Target, Targets, alongside, target};
use crate::engine::supported;
use crate::fields::Constants;
use crate::lanes::{LANES, dispatch};

/// Places around the ego: leader and follower in its lane, in the left and in the right one.
pub const PLACES: usize = 6;

/// Recorded states, a slice of frames for each simulation and vehicle.
pub struct Recording<'a> {
    /// Recorded frames of each simulation.
    pub num_frames: &'a [i32],
    /// Vehicle slots of a simulation.
    pub slots: usize,
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
    /// Whether there is a state; `None` where every vehicle has all frames.
    pub present: Option<Vec<&'a [bool]>>,
}

impl Recording<'_> {
    /// Recorded frames of a simulation, of which there is room for some.
    fn recorded(&self, simulation: usize, frames: usize) -> usize {
        (self.num_frames[simulation].max(0) as usize).min(frames)
    }

    /// The same, and as many more as lie side by side with the last one.
    fn rest(&self, simulation: usize, frames: usize) -> usize {
        let recorded = self.recorded(simulation, frames);
        recorded.next_multiple_of(LANES).min(frames)
    }

    /// Whether a row of a vehicle has something in a frame.
    fn is_present(&self, slot: usize, frame: usize) -> bool {
        self.present.as_ref().is_none_or(|rows| rows[slot][frame])
    }
}

/// The vehicles of a batch, and how road and clock measure them; slices lead with the simulation.
pub struct Bodies<'a> {
    /// Whether a slot holds a vehicle, (simulation, slot).
    pub valid: &'a [bool],
    /// Length, (simulation, slot) [m].
    pub length: &'a [f32],
    /// Width, (simulation, slot) [m].
    pub width: &'a [f32],
    /// Driving side.
    pub side: f32,
    /// Direction of the road [rad].
    pub heading: f32,
    /// Time between frames [ms].
    pub interval_ms: i32,
    /// Frames on either side over which a lateral speed is measured.
    pub half_window: usize,
}

/// What signals need beside the states; slices lead with the simulation.
pub struct Surroundings<'a> {
    /// The vehicles.
    pub bodies: Bodies<'a>,
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
    /// Driving lanes.
    pub num_lanes: usize,
}

/// Slices of outputs that are cut into simulations.
macro_rules! signal_outputs {
    ($(#[$about:meta])* $name:ident: $($(#[$doc:meta])* $field:ident: $kind:ty, $rows:expr;)*) => {
        $(#[$about])*
        pub struct $name<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
        }

        impl<'a> $name<'a> {
            /// Rows of frames that each slice has for a simulation, by name.
            pub const ROWS: &'static [(&'static str, usize)] = &[$((stringify!($field), $rows)),*];

            /// Zero every row from a frame on: nothing was recorded there.
            fn clear_from(&mut self, first: usize, frames: usize) {
                $(for row in self.$field.chunks_mut(frames.max(1)) {
                    row[first..].fill(Default::default());
                })*
            }

            /// Have each simulation filled, on all threads: its number, how many frames have to be, and where.
            ///
            /// Behind these frames are zeros.
            fn fill(
                self,
                recording: &Recording<'_>,
                frames: usize,
                work: impl Fn(usize, usize, &mut $name<'a>) + Sync,
            ) {
                use rayon::prelude::*;
                self.into_simulations(recording.num_frames.len(), frames)
                    .into_par_iter()
                    .enumerate()
                    .for_each(|(simulation, mut out)| {
                        let rest = recording.rest(simulation, frames);
                        out.clear_from(rest, frames);
                        work(simulation, rest, &mut out);
                    });
            }

            fn into_simulations(self, count: usize, frames: usize) -> Vec<Self> {
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
    lateral: f32, 1;
    /// Speed to the left [m/s].
    lateral_speed: f32, 1;
    /// Speed [m/s].
    speed: f32, 1;
    /// Acceleration [m/s^2].
    accel: f32, 1;
    /// Right-most corner [m].
    right_reach: f32, 1;
    /// Left-most corner [m].
    left_reach: f32, 1;
    /// Neighbours.
    vehicle: u8, PLACES;
    /// Friction.
    friction: f32, 1;
    /// Sight of something lit [m].
    sight_lit: f32, 1;
    /// Sight of something unlit [m].
    sight_unlit: f32, 1;
}

/// Work out the signals of a batch.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn signals(
    recording: &Recording<'_>,
    around: &Surroundings<'_>,
    frames: usize,
    forced: Option<&str>,
    out: Signals<'_>,
) -> Result<(), String> {
    let level = supported(forced)?;
    out.fill(recording, frames, |simulation, rest, out| {
        let (ego, bodies) = (simulation * recording.slots, &around.bodies);
        let recorded = recording.recorded(simulation, frames);
        lateral_speed(
            recording.d[ego],
            recorded,
            bodies,
            &mut out.lateral_speed[..rest],
        );
        dispatch!(level, |simd| {
            let mut lamp = None;
            in_chunks!(
                Frames::new(simd, recording, bodies, simulation, frames),
                0..rest,
                |frames| {
                    let chunk = Chunk { frames, around };
                    let body = frames.footprint(ego);
                    chunk.own(body, &mut lamp, out);
                    chunk.nearest(out);
                }
            );
        });
    });
    Ok(())
}

/// Speed to the left: a central difference, one-sided at the ends.
fn lateral_speed(d: &[i32], recorded: usize, bodies: &Bodies<'_>, out: &mut [f32]) {
    let last = recorded.saturating_sub(1);
    let half = bodies.half_window;
    let at = |frame: usize| {
        let later = (frame + half).min(last);
        let earlier = frame.saturating_sub(half).min(last);
        let moved = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * bodies.interval_ms).max(1) as f32;
        bodies.side * (moved / elapsed)
    };
    let begin = half.min(out.len());
    let end = recorded.saturating_sub(half).clamp(begin, out.len());
    for (frame, speed) in out[..begin].iter_mut().enumerate() {
        *speed = at(frame);
    }
    // In between the time is always the same, and nothing is at an end.
    let elapsed = (2 * half as i32 * bodies.interval_ms).max(1) as f32;
    let pairs = d.iter().zip(d.iter().skip(2 * half));
    for (speed, (earlier, later)) in out[begin..end].iter_mut().zip(pairs) {
        *speed = bodies.side * (later.wrapping_sub(*earlier) as f32 / elapsed);
    }
    for (frame, speed) in out[end..].iter_mut().enumerate() {
        *speed = at(end + frame);
    }
}
