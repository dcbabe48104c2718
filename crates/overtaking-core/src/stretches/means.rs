//! Sums of recorded integers over the frames of a simulation.

use rayon::prelude::*;

use super::{NO_VEHICLE, PLACES, SHARE};

/// Recorded integers, by simulation and slot.
pub struct Means<'a> {
    /// Last frame that counts, -1 for none.
    pub last: &'a [i32],
    /// Frames that there is room for.
    pub frames: usize,
    /// Slots of a simulation.
    pub slots: usize,
    /// Neighbours, (simulation, place, frame).
    pub vehicle: &'a [u8],
    /// Vehicles in the lane to the left, (simulation, frame).
    pub left_count: &'a [u8],
    /// Position of each slot along the road [mm].
    pub s: Vec<&'a [i32]>,
    /// Its speed [mm/s].
    pub speed: Vec<&'a [i32]>,
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
    let leaders = &given.vehicle[simulation * PLACES * given.frames..][..end];
    let left = &given.left_count[simulation * given.frames..][..end];
    let ego = simulation * given.slots;
    let (own_s, own_speed) = (&given.s[ego][..end], &given.speed[ego][..end]);
    let wide = |values: &[i32]| values.iter().map(|&each| i64::from(each)).sum();
    let mut led = [0; 4];
    for (frame, &leader) in leaders.iter().enumerate() {
        if leader == NO_VEHICLE {
            continue;
        }
        let slot = ego + usize::from(leader);
        let speed = given.speed[slot][frame];
        let ahead = given.s[slot][frame].wrapping_sub(own_s[frame]);
        let faster = own_speed[frame].wrapping_sub(speed);
        let each = [1, speed, faster.wrapping_abs(), ahead.wrapping_abs()];
        for (sum, value) in led.iter_mut().zip(each) {
            *sum += i64::from(value);
        }
    }
    let counts = left.iter().map(|&each| i64::from(each)).sum();
    let [led, speeds, differences, distances] = led;
    [
        end as i64,
        led,
        wide(own_speed),
        speeds,
        differences,
        distances,
        counts,
    ]
}
