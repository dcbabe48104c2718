//! Who drives around each vehicle; see `overtaking.sim.reference.neighbours`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::environment::lane_value;
use crate::lanes::{M, V, at_most, choose, pick_each, splat};
use crate::state::{NOBODY, ROLES, State};
use crate::world::World;

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
    if !w.is_ring {
        return distance;
    }
    distance - w.q.ring_length * (distance * w.q.inverse_ring_length).round_ties_even()
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
    let lane = state.lane[i];
    let (low, high) = lane_borders(w, lane, 0.0);
    let (slower, _) = lane_borders(w, lane, -1.0);
    let (_, faster) = lane_borders(w, lane, 1.0);
    let bands = [(low, high), (high, faster), (slower, low)];
    near.slot = [splat(w.simd, NOBODY); ROLES];
    for k in 0..WATCHED {
        let ends = nearest_in::<S, N, WATCHED, TWO_WAY>(state, w, bodies, i, bands[k], SHIFTS[k]);
        for (end, (slot, distance)) in ends.into_iter().enumerate().take(WATCHED.min(2)) {
            let role = 2 * k + end;
            let [half_length, place] =
                pick_each!(w.count, slot, |j| [w.p[j].half_length, state.d[j]]);
            let zero = splat(w.simd, 0.0);
            near.slot[role] = slot;
            near.gap[role] = distance - (half_length + w.p[i].half_length);
            near.distance[role] = distance;
            near.aside[role] = choose(slot.simd_ge(0.0), place - state.d[i], zero);
            near.half_length[role] = half_length;
        }
    }
    (near.lane_low, near.lane_high) = (low, high);
}

/// Slot and distance of the nearest vehicle ahead and behind of vehicle `i` in one lane, between these borders and
/// `shift` lanes from its own; only ahead if `WATCHED` is 1.
///
/// The search takes one lane at a time: AVX2 has enough registers for the state of one lane, but not of three.
#[inline(always)]
fn nearest_in<S: Simd, const N: usize, const WATCHED: usize, const TWO_WAY: bool>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    bodies: &[Body<S>; N],
    i: usize,
    (low, high): (V<S>, V<S>),
    shift: f32,
) -> [(V<S>, V<S>); 2] {
    let (low, high) = (low + w.c.corridor_margin, high - w.c.corridor_margin);
    let lane = state.lane[i] + shift;
    let (nobody, far) = (splat(w.simd, NOBODY), splat(w.simd, FAR));
    let [mut ahead, mut behind] = [(nobody, far); 2];
    for j in 0..w.count {
        if i == j {
            continue;
        }
        let (other, number) = (&bodies[j], splat(w.simd, j as i32 as f32));
        let way = along(w, state.s[j] - state.s[i]);
        let overlaps = other.high_side.simd_gt(low) & other.low_side.simd_lt(high);
        let shows = other.shows & state.lane[j].simd_eq(lane);
        let mut inside = other.valid & (overlaps | shows);
        if TWO_WAY {
            inside &= w.p[j].travel_sign.simd_eq(w.p[i].travel_sign);
        }
        let is_ahead = way.simd_ge(0.0);
        let front = inside & is_ahead & way.simd_lt(ahead.1);
        ahead = (choose(front, number, ahead.0), choose(front, way, ahead.1));
        if WATCHED > 1 {
            let back = inside & !is_ahead & (-way).simd_lt(behind.1);
            behind = (choose(back, number, behind.0), choose(back, -way, behind.1));
        }
    }
    [ahead, behind]
}
