//! Movements across the road: unbroken ones, how far they lead, and how fast.

use super::scene::Scene;

/// Frames of an unbroken movement, both within it.
#[derive(Clone, Copy)]
pub(super) struct Movement {
    pub(super) begin: usize,
    pub(super) end: usize,
}

impl Scene<'_> {
    /// The first movement to the left that begins at a frame or later.
    pub(super) fn movement_left(&self, from: usize) -> Option<Movement> {
        let least = self.limits.least_speed;
        self.movement(from, |frame| {
            let speed = self.lateral_speed[frame];
            // However slowly: who goes over the line leaves the lane.
            speed > least || (speed > 0.0 && self.is_out(frame))
        })
    }

    /// Where the first wide movement to the right begins, from a frame on and before another.
    pub(super) fn wide_right(&self, from: usize, until: usize) -> Option<usize> {
        let least = -self.limits.least_speed;
        let mut next = from;
        loop {
            let one = self.movement(next, |frame| self.lateral_speed[frame] < least)?;
            if one.begin >= until {
                return None;
            }
            if self.is_wide(one, -1.0) {
                return Some(one.begin);
            }
            next = one.end + 1;
        }
    }

    /// The first unbroken run of frames that begins at a frame or later; runs end with the drive.
    fn movement(&self, from: usize, moving: impl Fn(usize) -> bool) -> Option<Movement> {
        let begins = |frame: &usize| moving(*frame) && (*frame == 0 || !moving(*frame - 1));
        let begin = (from..self.driven).find(begins)?;
        let after = (begin + 1..self.driven).find(|&frame| !moving(frame));
        Some(Movement {
            begin,
            end: after.unwrap_or(self.driven) - 1,
        })
    }

    /// Whether a movement to the left advances by more than gusts and wandering do in as many frames.
    pub(super) fn is_fast(&self, one: Movement) -> bool {
        (one.begin..=one.end).any(|frame| {
            let later = (frame + self.limits.advance).min(one.end);
            self.lateral_position[later] - self.lateral_position[frame] >= self.least_advance
        })
    }

    /// Whether a movement lasts and leads far enough to be noticed.
    pub(super) fn is_wide(&self, one: Movement, sign: f32) -> bool {
        one.end - one.begin + 1 >= self.limits.least_frames
            && sign * (self.lateral_position[one.end] - self.median_before(one.begin))
                >= self.limits.least_shift
    }

    /// Where the ego was in the median over the frames before one of them, and in it.
    fn median_before(&self, frame: usize) -> f32 {
        let earliest = frame.saturating_sub(self.limits.window);
        // Before the recording it was where it was at first.
        let missing = self.limits.window - (frame - earliest);
        let mut places = vec![self.lateral_position[0]; missing];
        places.extend_from_slice(&self.lateral_position[earliest..=frame]);
        let middle = places.len() / 2;
        let is_odd = !places.len().is_multiple_of(2);
        let (lower, upper, _) = places.select_nth_unstable_by(middle, f32::total_cmp);
        if is_odd {
            return *upper;
        }
        let below = lower.iter().copied().max_by(f32::total_cmp);
        (below.unwrap_or(*upper) + *upper) / 2.0
    }
}
