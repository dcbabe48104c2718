//! Sums of recorded integers over the frames of a simulation.

use rayon::prelude::*;

use super::around::Around;
use super::{NO_VEHICLE, PLACES, SHARE};

/// Recorded integers, by simulation and slot.
pub struct Means<'a> {
    /// Last frame that counts, -1 for none.
    pub last: &'a [i32],
    /// Frames that there is room for.
    pub frames: usize,
    /// The neighbours of the ego.
    pub around: Around<'a>,
    /// Driving lanes.
    pub num_lanes: usize,
    /// Whether a slot holds a vehicle, (simulation, slot).
    pub valid: &'a [bool],
    /// Whether there is a state; `None` where every vehicle has all frames.
    pub present: Option<Vec<&'a [bool]>>,
    /// Lane of each slot.
    pub lane: Vec<&'a [u8]>,
}

/// Sums of a simulation, in the order of the rows of the result.
pub const MEANS: [&str; 7] = [
    "frames",
    "led",
    "ego_speed",
    "target_speed",
    "speed_difference",
    "distance",
    "left_count",
];

/// Sum up each simulation: a row of `out` for each of `MEANS`.
pub fn means(given: &Means<'_>, out: &mut [i64]) {
    let count = given.last.len();
    let sums: Vec<_> = (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .map(|simulation| one(given, simulation))
        .collect();
    for (name, row) in out.chunks_mut(count.max(1)).enumerate() {
        for (value, one) in row.iter_mut().zip(&sums) {
            *value = one[name];
        }
    }
}

fn one(given: &Means<'_>, simulation: usize) -> [i64; MEANS.len()] {
    let end = ((given.last[simulation].max(-1) + 1) as usize).min(given.frames);
    let leaders = &given.around.vehicle[simulation * PLACES * given.frames..][..end];
    let ego = simulation * given.around.slots;
    let (own_s, own_speed) = (&given.around.s[ego][..end], &given.around.speed[ego][..end]);
    let wide = |values: &[i32]| values.iter().map(|&each| i64::from(each)).sum();
    let mut led = [0; 4];
    for (frame, &leader) in leaders.iter().enumerate() {
        if leader == NO_VEHICLE {
            continue;
        }
        let slot = ego + usize::from(leader);
        let speed = given.around.speed[slot][frame];
        let ahead = given.around.s[slot][frame].wrapping_sub(own_s[frame]);
        let faster = own_speed[frame].wrapping_sub(speed);
        let each = [1, speed, faster.wrapping_abs(), ahead.wrapping_abs()];
        for (sum, value) in led.iter_mut().zip(each) {
            *sum += i64::from(value);
        }
    }
    let left = (ego + 1..ego + given.around.slots).map(|slot| given.num_left(ego, slot, end));
    let [led, speeds, differences, distances] = led;
    [
        end as i64,
        led,
        wide(own_speed),
        speeds,
        differences,
        distances,
        left.sum(),
    ]
}

impl Means<'_> {
    /// Number of frames before one in which a vehicle is in the lane to the left of the ego.
    fn num_left(&self, ego: usize, slot: usize, end: usize) -> i64 {
        if !self.valid[slot] {
            return 0;
        }
        let (own, other) = (&self.lane[ego][..end], &self.lane[slot][..end]);
        // 255 is beyond the slow edge, and no lane is to the left of that.
        let is_left = |own: u8, lane: u8| {
            (lane == own.wrapping_add(1)) & (own != u8::MAX) & (usize::from(lane) < self.num_lanes)
        };
        let lanes = own.iter().zip(other);
        let left = lanes.map(|(&own, &lane)| is_left(own, lane));
        match &self.present {
            None => left.map(i64::from).sum(),
            Some(rows) => {
                let there = left.zip(rows[slot]).map(|(left, &present)| left & present);
                there.map(i64::from).sum()
            }
        }
    }
}
