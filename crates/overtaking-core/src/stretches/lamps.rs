//! What was shown around a crossing of a line, and when another vehicle came to a place.

use super::NEVER;

const METRES: f32 = 1e-3;

/// A crossing that is announced by a lamp.
pub struct Announced<'a> {
    /// Lamps of the ego, a row of frames for each simulation.
    pub lights: Vec<&'a [u8]>,
    /// Frame of the crossing, negative without one.
    pub crossed: &'a [i32],
    /// First frame that counts.
    pub first: &'a [i32],
    /// Last frame that counts.
    pub last: &'a [i32],
    /// Frames before the crossing in which the lamp must be on.
    pub before: i32,
    /// Frames after it.
    pub after: i32,
    /// Its bit.
    pub bit: u8,
}

impl Announced<'_> {
    /// Frames of one simulation without the lamp: their number, the first and the last.
    #[must_use]
    pub fn dark(&self, simulation: usize) -> [i32; 3] {
        let crossed = self.crossed[simulation];
        let mut found = [0, NEVER, NEVER];
        if crossed < 0 {
            return found;
        }
        let lights = self.lights[simulation];
        let begin = (crossed - self.before).max(self.first[simulation]);
        let end = (crossed + self.after).min(self.last[simulation]);
        for frame in begin.max(0)..=end.min(lights.len() as i32 - 1) {
            if lights[frame as usize] & self.bit == 0 {
                let first = if found[0] == 0 { frame } else { found[1] };
                found = [found[0] + 1, first, frame];
            }
        }
        found
    }
}

/// First frame in which a vehicle is at a place or past it, `NEVER` without one.
///
/// `s` and `present` are its recorded frames, `place` is along the road [mm], and `halves` lie between its
/// centre and its front [m].
#[must_use]
pub fn arrival(s: &[i32], present: Option<&[bool]>, begin: usize, place: i32, halves: f32) -> i32 {
    let is_past = |frame: &usize| {
        let way = s[*frame].wrapping_sub(place) as f32 * METRES;
        way + halves >= 0.0 && present.is_none_or(|row| row[*frame])
    };
    (begin..s.len())
        .find(is_past)
        .map_or(NEVER, |frame| frame as i32)
}
