//! Sums of recorded integers over the frames of a simulation.

use std::ops::Range;

use super::one::{LEADER, One};
use crate::signals::NO_VEHICLE;

/// Sums of a simulation, in the order of the rows of the result.
pub const SUMS: [&str; 7] = [
    "frames",
    "led",
    "ego_speed",
    "target_speed",
    "speed_difference",
    "distance",
    "left_count",
];

impl One<'_> {
    /// Sums over some frames, those of the vehicle ahead where there is one.
    pub(super) fn sums(&self, span: Range<usize>) -> [i64; SUMS.len()] {
        let leaders = self.seen.neighbour(LEADER);
        let (mut own, mut led) = (0, [0; 4]);
        for frame in span.clone() {
            let own_speed = self.speed[0][frame];
            own += i64::from(own_speed);
            if leaders[frame] == NO_VEHICLE {
                continue;
            }
            let slot = usize::from(leaders[frame]);
            let speed = self.speed[slot][frame];
            let ahead = self.s[slot][frame].wrapping_sub(self.s[0][frame]);
            let faster = own_speed.wrapping_sub(speed);
            let each = [1, speed, faster.wrapping_abs(), ahead.wrapping_abs()];
            for (sum, value) in led.iter_mut().zip(each) {
                *sum += i64::from(value);
            }
        }
        let [led, speeds, differences, distances] = led;
        let left = (1..self.s.len()).map(|slot| self.num_left(slot, span.clone()));
        [
            span.len() as i64,
            led,
            own,
            speeds,
            differences,
            distances,
            left.sum(),
        ]
    }

    /// Number of some frames in which a vehicle is in the lane to the left of the ego.
    fn num_left(&self, slot: usize, span: Range<usize>) -> i64 {
        if !self.valid[slot] {
            return 0;
        }
        let lanes = self.lane[0][span.clone()]
            .iter()
            .zip(&self.lane[slot][span.clone()]);
        // 255 is beyond the slow edge, and no lane is to the left of that.
        let left = lanes.map(|(&own, &lane)| {
            (lane == own.wrapping_add(1)) & (own != u8::MAX) & (usize::from(lane) < self.num_lanes)
        });
        match self.present {
            None => left.map(i64::from).sum(),
            Some(rows) => {
                let there = left.zip(&rows[slot][span]);
                there
                    .map(|(left, &present)| i64::from(left & present))
                    .sum()
            }
        }
    }
}
