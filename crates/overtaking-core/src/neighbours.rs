//! Who drives around each vehicle; see `overtaking.sim.reference.neighbours`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::environment::lane_value;
use crate::lanes::{M, V, at_most, choose, splat};
use crate::state::{NOBODY, ROLES, State, World};

const FAR: f32 = 1e9;
/// The own, the faster and the slower lane, from the own.
const SHIFTS: [f32; 3] = [0.0, 1.0, -1.0];

/// Nearest vehicles of one vehicle by role.
#[derive(Clone, Copy)]
pub struct Neighbours<S: Simd> {
    pub slot: [V<S>; ROLES],
    pub gap: [V<S>; ROLES],
    /// Distance of the centres along the road [m].
    pub distance: [V<S>; ROLES],
    /// How far it is towards the fast side [m].
    pub aside: [V<S>; ROLES],
    /// Half of its length [m].
    pub half_length: [V<S>; ROLES],
    pub lane_low: V<S>,
    pub lane_high: V<S>,
}

impl<S: Simd> Neighbours<S> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let (none, far, zero) = (splat(simd, NOBODY), splat(simd, FAR), splat(simd, 0.0));
        Self {
            slot: [none; ROLES],
            gap: [far; ROLES],
            distance: [far; ROLES],
            aside: [zero; ROLES],
            half_length: [zero; ROLES],
            lane_low: zero,
            lane_high: zero,
        }
    }
}

/// What everybody else sees of a vehicle, whoever looks.
#[derive(Clone, Copy)]
pub struct Body<S: Simd> {
    valid: M<S>,
    low_side: V<S>,
    high_side: V<S>,
    /// Whether it changes lanes and can be seen to.
    pub shows: M<S>,
    /// Its lane, and to which side it signals without moving over yet.
    pub lane: V<S>,
    pub claims: V<S>,
    /// One over the intensity of the lamps that a follower sees: tail lamps, or stop lamps [1/cd].
    pub inverse_rear_lamp: V<S>,
}

impl<S: Simd> Body<S> {
    /// Nobody.
    pub fn nothing(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        Self {
            valid: never,
            low_side: zero,
            high_side: zero,
            shows: never,
            lane: zero,
            claims: zero,
            inverse_rear_lamp: zero,
        }
    }

    /// Vehicle `j`.
    #[inline(always)]
    pub fn new<const N: usize>(state: &State<'_, S, N>, w: &World<'_, S, N>, j: usize) -> Self {
        let (c, p) = (w.c, &w.p[j]);
        let moves = state.path_time[j].simd_gt(c.visible_fraction * state.path_duration[j]);
        let (sound, zero) = (state.crashed[j].simd_eq(0.0), splat(w.simd, 0.0));
        let changing = state.path_time[j].simd_lt(state.path_duration[j]);
        let waits = sound & !changing;
        let changing = sound & changing;
        let braking = state.accel[j].simd_lt(-c.stop_lamp_decel);
        let lamp = p.inverse_tail_lamp;
        Self {
            valid: p.valid.simd_gt(0.0),
            low_side: state.d[j] - p.half_width,
            high_side: state.d[j] + p.half_width,
            lane: state.lane[j],
            claims: choose(waits, state.indicator[j], zero),
            shows: changing & (state.indicator[j].simd_ne(0.0) | moves),
            inverse_rear_lamp: choose(braking, at_most(lamp, c.inverse_stop_lamp), lamp),
        }
    }
}

/// Borders of the lane `shift` lanes from a vehicle's own [m].
#[inline(always)]
pub fn lane_borders<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    lane: V<S>,
    shift: f32,
) -> (V<S>, V<S>) {
    let borders = &w.road.boundaries[..=w.road.num_lanes];
    (
        lane_value(borders, lane + shift),
        lane_value(borders, lane + (shift + 1.0)),
    )
}

/// A distance along the road; on a ring that to the nearest image [m].
#[inline(always)]
pub fn along<S: Simd, const N: usize>(w: &World<'_, S, N>, distance: V<S>) -> V<S> {
    distance - w.q.ring * (distance * w.q.inverse_ring).round_ties_even()
}

/// The nearest vehicle ahead and behind of vehicle `i`, in the own, the faster and the slower lane; if the
/// number of lanes `WATCHED` is 1, only the one ahead in the own lane: no driver looks at the others.
#[inline(always)]
pub fn find_neighbours<S: Simd, const N: usize, const WATCHED: usize, const TWO_WAY: bool>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    i: usize,
    near: &mut Neighbours<S>,
) {
    let c = w.c;
    let lane = state.lane[i];
    let (low, high) = lane_borders(w, lane, 0.0);
    let (slower, _) = lane_borders(w, lane, -1.0);
    let (_, faster) = lane_borders(w, lane, 1.0);
    let bands = [(low, high), (high, faster), (slower, low)];
    let mut slot = [splat(w.simd, NOBODY); ROLES];
    let mut nearest = [splat(w.simd, FAR); ROLES];
    let mut aside = [splat(w.simd, 0.0); ROLES];
    let mut half_length = [w.p[0].half_length; ROLES];
    for j in 0..w.count {
        if i == j {
            continue;
        }
        let ahead = along(w, state.s[j] - state.s[i]);
        let beside = state.d[j] - state.d[i];
        let other = &bodies[j];
        let shift = state.lane[j] - lane;
        let there = if TWO_WAY {
            other.valid & w.p[j].direction.simd_eq(w.p[i].direction)
        } else {
            other.valid
        };
        for k in 0..WATCHED {
            let (low, high) = bands[k];
            let overlaps = other.high_side.simd_gt(low + c.corridor_margin)
                & other.low_side.simd_lt(high - c.corridor_margin);
            let inside = there & (overlaps | (other.shows & shift.simd_eq(SHIFTS[k])));
            let front = inside & ahead.simd_ge(0.0) & ahead.simd_lt(nearest[2 * k]);
            nearest[2 * k] = choose(front, ahead, nearest[2 * k]);
            slot[2 * k] = choose(front, splat(w.simd, j as f32), slot[2 * k]);
            aside[2 * k] = choose(front, beside, aside[2 * k]);
            half_length[2 * k] = choose(front, w.p[j].half_length, half_length[2 * k]);
            if WATCHED == 1 {
                continue;
            }
            let back = inside & ahead.simd_lt(0.0) & (-ahead).simd_lt(nearest[2 * k + 1]);
            nearest[2 * k + 1] = choose(back, -ahead, nearest[2 * k + 1]);
            slot[2 * k + 1] = choose(back, splat(w.simd, j as f32), slot[2 * k + 1]);
            aside[2 * k + 1] = choose(back, beside, aside[2 * k + 1]);
            half_length[2 * k + 1] = choose(back, w.p[j].half_length, half_length[2 * k + 1]);
        }
    }
    near.slot = slot;
    for role in 0..2 * WATCHED {
        near.gap[role] = nearest[role] - (half_length[role] + w.p[i].half_length);
        near.distance[role] = nearest[role];
        near.aside[role] = aside[role];
        near.half_length[role] = half_length[role];
    }
    (near.lane_low, near.lane_high) = (low, high);
}
