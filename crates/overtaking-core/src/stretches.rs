//! What margins and measures come to over a stretch of frames of each simulation.
//!
//! `overtaking.labels.law.reference` and `overtaking.labels.features.reference` say the same of all frames at once.

mod around;
mod behind;
mod encounters;
mod extremes;
mod follow;
mod formulas;
mod lamps;
mod means;
mod row;
mod stops;
mod worst;

use fearless_simd::Level;
use rayon::prelude::*;

use crate::engine::supported;

pub use self::around::Around;
pub use self::behind::{Duty, Obstruction, duty, obstruction};
pub use self::encounters::{ENCOUNTERS, Encounters, encounters};
pub use self::extremes::{Extreme, beyond, extreme_float};
pub use self::follow::{Follow, follow};
pub use self::formulas::{Grip, Law, Measures};
pub use self::lamps::{Announced, arrival};
pub use self::means::{MEANS, Means, means};
pub use self::stops::{Stops, stops};
pub use self::worst::{WORST, Worst, worst};

const NEVER: i32 = -1;
const NO_VEHICLE: u8 = 255;
/// Places around the ego in a row of neighbours.
const PLACES: usize = 6;
/// Simulations that a thread takes at a time; each is a matter of a microsecond.
const SHARE: usize = 32;

/// From one frame of each simulation to another, both within it; empty where `stop` is before `start`.
#[derive(Clone, Copy)]
pub struct Spans<'a> {
    /// First frame.
    pub start: &'a [i32],
    /// Last frame.
    pub stop: &'a [i32],
    /// Frames that a simulation has room for.
    pub frames: usize,
    level: Level,
}

impl<'a> Spans<'a> {
    /// Stretches in which to work at a SIMD level, or at the best one.
    ///
    /// # Errors
    /// The level is unknown or not supported by this CPU.
    pub fn new(
        start: &'a [i32],
        stop: &'a [i32],
        frames: usize,
        forced: Option<&str>,
    ) -> Result<Self, String> {
        let level = supported(forced)?;
        Ok(Self {
            start,
            stop,
            frames,
            level,
        })
    }

    /// The frames of one simulation.
    fn of(&self, simulation: usize) -> std::ops::Range<usize> {
        let end = (i64::from(self.stop[simulation]) + 1).clamp(0, self.frames as i64) as usize;
        let start = self.start[simulation].max(0) as usize;
        start.min(end)..end
    }

    /// Where one simulation lies in an array (simulation, frame).
    fn own(&self, simulation: usize) -> std::ops::Range<usize> {
        simulation * self.frames..(simulation + 1) * self.frames
    }

    /// Where a neighbour of one simulation lies in an array (simulation, place, frame).
    fn place(&self, simulation: usize, place: usize) -> std::ops::Range<usize> {
        let row = simulation * PLACES + place;
        row * self.frames..(row + 1) * self.frames
    }
}

/// A margin over a stretch: its smallest value, and the frames in which it was negative.
#[derive(Clone, Copy)]
pub struct Lowest {
    low: f32,
    first: i32,
    last: i32,
}

/// Larger than any margin.
const ENDLESS: f32 = 3.0e38;

impl Lowest {
    const NOTHING: Self = Self {
        low: ENDLESS,
        first: NEVER,
        last: NEVER,
    };

    /// Take the margin of a frame that is not before those that were taken.
    fn take(&mut self, margin: f32, frame: usize) {
        if margin < self.low {
            self.low = margin;
        }
        if margin < 0.0 {
            self.last = frame as i32;
            if self.first == NEVER {
                self.first = self.last;
            }
        }
    }
}

/// Where the smallest margins go, one for each simulation.
pub struct Found<'a> {
    /// Smallest margin, `ENDLESS` where none counts.
    pub low: &'a mut [f32],
    /// First frame with a negative one.
    pub first: &'a mut [i32],
    /// Last frame with a negative one.
    pub last: &'a mut [i32],
}

impl Found<'_> {
    fn set_ends(&mut self, simulation: usize, first: i32, last: i32) {
        (self.first[simulation], self.last[simulation]) = (first, last);
    }

    /// Fill it with what is found of each simulation.
    fn fill(&mut self, of: impl Fn(usize) -> Lowest + Sync) {
        let rows = self.low.par_iter_mut().zip(self.first.par_iter_mut());
        rows.zip(self.last.par_iter_mut())
            .with_min_len(SHARE)
            .enumerate()
            .for_each(|(simulation, ((low, first), last))| {
                let found = of(simulation);
                (*low, *first, *last) = (found.low, found.first, found.last);
            });
    }
}
