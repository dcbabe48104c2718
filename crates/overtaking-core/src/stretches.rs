//! What margins and measures come to over stretches of frames of each simulation.
//!
//! `tests/reference/labels` says the same one frame after the other.

mod behind;
mod encounters;
mod follow;
mod formulas;
mod linear;
mod one;
mod row;
mod sums;
mod worst;

use std::ops::Range;

use fearless_simd::{Level, Simd};
use rayon::prelude::*;

pub use self::encounters::{Along, ENCOUNTERS, Pair, encounters};
pub use self::formulas::Numbers;
pub use self::linear::{Limited, bits, limited};
use self::one::One;
pub use self::sums::SUMS;
use self::worst::WORST;
use crate::lanes::dispatch;
use crate::signals::{NEVER, Recording, Seen};

/// Simulations that a thread takes at a time; each is a matter of some microseconds.
const SHARE: usize = 32;

/// Stretches that are asked about, in the order of `Asked::spans`.
pub const SPANS: [&str; 5] = ["conduct", "settled", "passed", "manoeuvre", "counted"];

/// Frames and slots that are asked about, in the order of `Asked::moments`.
pub const MOMENTS: [&str; 4] = ["line_crossed", "return_end", "target_slot", "original_lane"];

/// What is asked of each simulation.
pub struct Asked<'a> {
    /// First and last frame, both within the stretch, (stretch, end, simulation); empty where the last is before.
    pub spans: &'a [i32],
    /// A frame, -1 for none, or a slot, 255 for none, (moment, simulation).
    pub moments: &'a [i32],
}

/// Smallest margins and worst measures, in the order of the rows of the result.
#[must_use]
pub fn measures() -> Vec<&'static str> {
    MARGINS.into_iter().chain(WORST).collect()
}

/// Margins whose smallest value is looked for, `ENDLESS` where none counts.
const MARGINS: [&str; 4] = ["stop_lit", "stop_unlit", "follow", "braking"];

/// Frames, -1 where there is none, in the order of the rows of the result: the first and the last with a negative
/// margin, and the number of frames of the longest run of them; the longest run in which the return was due; when another came where the ego's rear was.
pub const FRAMES: [&str; 16] = [
    "stop_lit.first",
    "stop_lit.last",
    "stop_lit.longest",
    "stop_unlit.first",
    "stop_unlit.last",
    "stop_unlit.longest",
    "follow.first",
    "follow.last",
    "follow.longest",
    "braking.first",
    "braking.last",
    "braking.longest",
    "due.first",
    "due.length",
    "entry.arrival",
    "return.arrival",
];

/// Where the answers go, (row, simulation).
pub struct Answers<'a> {
    /// A row for each of `measures`.
    pub measures: &'a mut [f32],
    /// A row for each of `FRAMES`.
    pub frames: &'a mut [i32],
    /// A row for each of `SUMS`.
    pub sums: &'a mut [i64],
}

/// The answers about one simulation.
struct Answer {
    measures: [f32; MARGINS.len() + WORST.len()],
    frames: [i32; FRAMES.len()],
    sums: [i64; SUMS.len()],
}

/// Answer all of this about a batch.
pub fn stretches(
    recording: &Recording<'_>,
    seen: &Seen<'_>,
    numbers: &Numbers,
    asked: &Asked<'_>,
    level: Level,
    out: Answers<'_>,
) {
    let count = recording.num_frames.len();
    let found: Vec<Answer> = (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .map(|simulation| {
            let one = One::new(recording, seen, numbers, simulation);
            dispatch!(level, |simd| answer(simd, &one, asked, simulation, count))
        })
        .collect();
    transpose(&found, out.measures, |one| &one.measures);
    transpose(&found, out.frames, |one| &one.frames);
    transpose(&found, out.sums, |one| &one.sums);
}

/// Write a row for each value of the answers.
fn transpose<T: Copy>(found: &[Answer], out: &mut [T], values: impl Fn(&Answer) -> &[T]) {
    for (name, row) in out.chunks_mut(found.len().max(1)).enumerate() {
        for (value, one) in row.iter_mut().zip(found) {
            *value = values(one)[name];
        }
    }
}

fn answer<S: Simd>(
    simd: S,
    one: &One<'_>,
    asked: &Asked<'_>,
    simulation: usize,
    count: usize,
) -> Answer {
    let span = |which: usize| {
        let row = 2 * which * count + simulation;
        one.span(asked.spans[row], asked.spans[row + count])
    };
    let [crossed, returned, target, original_lane] =
        [0, 1, 2, 3].map(|which| asked.moments[which * count + simulation]);
    let (conduct, target) = (span(0), target as u8);
    let [stop_lit, stop_unlit] = one.stops(simd, conduct.clone());
    let margins = [
        stop_lit,
        stop_unlit,
        one.follow(simd, span(1)),
        one.braking(simd, span(3)),
    ];
    let (due, length) = one.due(simd, target, original_lane as u8, span(2));
    let mut measures = [0.0; MARGINS.len() + WORST.len()];
    measures[..MARGINS.len()].copy_from_slice(&margins.map(|each| each.low));
    measures[MARGINS.len()..].copy_from_slice(&one.worst(simd, conduct));
    let mut frames = [NEVER; FRAMES.len()];
    for (ends, margin) in frames.as_chunks_mut::<3>().0.iter_mut().zip(margins) {
        *ends = [margin.first, margin.last, margin.longest];
    }
    frames[12..].copy_from_slice(&[
        due,
        length,
        one.entry_arrival(crossed),
        one.arrival(target, returned),
    ]);
    Answer {
        measures,
        frames,
        sums: one.sums(span(4)),
    }
}

/// A margin over a stretch: its smallest value, and the frames in which it was negative.
#[derive(Clone, Copy)]
struct Lowest {
    low: f32,
    first: i32,
    last: i32,
    /// Number of frames of the longest unbroken run of negative ones, and of the one that goes on.
    longest: i32,
    run: i32,
}

/// Larger than any margin.
const ENDLESS: f32 = 3.0e38;

impl Lowest {
    const NOTHING: Self = Self {
        low: ENDLESS,
        first: NEVER,
        last: NEVER,
        longest: 0,
        run: 0,
    };

    /// Take the margin of a frame that is after those that were taken.
    fn take(&mut self, margin: f32, frame: usize) {
        if margin < self.low {
            self.low = margin;
        }
        if margin < 0.0 {
            let frame = frame as i32;
            let goes_on = self.run > 0 && frame == self.last + 1;
            self.run = if goes_on { self.run + 1 } else { 1 };
            self.longest = self.longest.max(self.run);
            self.last = frame;
            if self.first == NEVER {
                self.first = frame;
            }
        }
    }

    /// Note frames after those that were taken, all with a negative margin; the smallest is left to the caller.
    fn take_all(&mut self, frames: Range<usize>) {
        let (begin, end) = (frames.start as i32, frames.end as i32);
        let before = if self.last + 1 == begin { self.run } else { 0 };
        self.run = before + end - begin;
        self.longest = self.longest.max(self.run);
        self.last = end - 1;
        if self.first == NEVER {
            self.first = begin;
        }
    }
}

impl One<'_> {
    /// The frames of a stretch that were recorded.
    fn span(&self, start: i32, stop: i32) -> Range<usize> {
        let end = (stop.max(-1) + 1) as usize;
        let end = end.min(self.recorded);
        (start.max(0) as usize).min(end)..end
    }
}
