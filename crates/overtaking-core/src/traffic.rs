//! Who is where on a two-way road; see `overtaking.sim.reference.traffic`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, V, choose, splat};
use crate::neighbours::{Body, lane_borders};
use crate::state::{NOBODY, State, stage};
use crate::world::World;

const FAR: f32 = 1e9;

/// Slot of an oncomer, and the distance of the centres [m].
type Met<S> = (V<S>, V<S>);

/// A vehicle as who comes the other way sees it.
#[derive(Clone, Copy)]
struct Turned<S: Simd> {
    s: V<S>,
    low_side: V<S>,
    high_side: V<S>,
    lane: V<S>,
    /// Whether it is on the road, in any lane.
    on_road: M<S>,
}

impl<S: Simd> Turned<S> {
    /// Whether it is in a lane, or on a road, between edges.
    #[inline(always)]
    fn overlaps(&self, (low, high): (V<S>, V<S>)) -> M<S> {
        self.high_side.simd_gt(low) & self.low_side.simd_lt(high)
    }
}

/// What everybody on a two-way road looks for in everybody else; sets of slots have a bit for each.
#[derive(Clone, Copy)]
pub struct Traffic<S: Simd, const N: usize> {
    turned: [Turned<S>; N],
    /// Who drives along the road, and who against it, in any simulation.
    directions: [u32; 2],
    /// Who may be in the lane that those who come drive in, in any simulation.
    strays: u32,
    /// Who overtakes, in which simulations and in any.
    pub out: [M<S>; N],
    overtakers: u32,
}

impl<S: Simd, const N: usize> Traffic<S, N> {
    /// An empty road.
    pub fn nobody(simd: S) -> Self {
        let zero = splat(simd, 0.0);
        let never = zero.simd_lt(zero);
        let turned = Turned {
            s: zero,
            low_side: zero,
            high_side: zero,
            lane: zero,
            on_road: never,
        };
        Self {
            turned: [turned; N],
            directions: [0; 2],
            strays: 0,
            out: [never; N],
            overtakers: 0,
        }
    }

    /// Look at everybody.
    #[inline(always)]
    pub fn survey(&mut self, state: &State<'_, S, N>, w: &World<'_, S, N>, bodies: &[Body<S>; N]) {
        let (c, road) = (w.c, w.road);
        let low = splat(w.simd, road.boundaries[0] + c.corridor_margin);
        let home = (low, splat(w.simd, road.boundaries[1] - c.corridor_margin));
        let edge = road.boundaries[road.num_lanes] - c.corridor_margin;
        let whole = (low, splat(w.simd, edge));
        (self.directions, self.strays, self.overtakers) = ([0; 2], 0, 0);
        for j in 0..w.count {
            let other = &w.p[j];
            let valid = other.valid.simd_gt(0.0);
            let d = road.ways.edge_sum - state.d[j];
            let turned = Turned {
                s: road.ways.length - state.s[j],
                low_side: d - other.half_width,
                high_side: d + other.half_width,
                lane: (road.num_lanes - 1) as f32 - state.lane[j],
                on_road: valid,
            };
            let strays = turned.overlaps(home) | (bodies[j].shows & turned.lane.simd_eq(0.0));
            let along = other.travel_sign.simd_gt(0.0);
            self.directions[0] |= u32::from((valid & along).any_true()) << j;
            self.directions[1] |= u32::from((valid & !along).any_true()) << j;
            self.strays |= u32::from((valid & strays).any_true()) << j;
            self.out[j] = is_out(state, j);
            self.overtakers |= u32::from(self.out[j].any_true()) << j;
            self.turned[j] = Turned {
                on_road: valid & turned.overlaps(whole),
                ..turned
            };
        }
    }

    /// The nearest oncomer of vehicle `i` in any lane, and in its own. One that is visibly on its way into the own
    /// lane is there.
    #[inline(always)]
    pub fn nearest(
        &self,
        state: &State<'_, S, N>,
        w: &World<'_, S, N>,
        bodies: &[Body<S>; N],
        i: usize,
    ) -> [Met<S>; 2] {
        let nobody = (splat(w.simd, NOBODY), splat(w.simd, FAR));
        let [mut coming, mut facing] = [nobody; 2];
        let [along, against] = self.directions;
        let mut opposed = 0;
        for (own, other) in [(along, against), (against, along)] {
            if own >> i & 1 == 1 {
                opposed |= other;
            }
        }
        for j in (0..w.count).filter(|j| opposed >> *j & 1 == 1) {
            let other = &self.turned[j];
            let ahead = other.s - state.s[i];
            let there = w.p[j].travel_sign.simd_ne(w.p[i].travel_sign) & ahead.simd_ge(0.0);
            let nearer = there & other.on_road & ahead.simd_lt(coming.1);
            coming.0 = choose(nearer, splat(w.simd, j as i32 as f32), coming.0);
            coming.1 = choose(nearer, ahead, coming.1);
        }
        // Who keeps to its lane meets those alone who have left theirs.
        let at_home = state.lane[i].simd_eq(0.0).all_true();
        let opposed = if at_home {
            opposed & self.strays
        } else {
            opposed
        };
        if opposed == 0 {
            return [chosen(w, i, coming), facing];
        }
        let (low, high) = lane_borders(w, state.lane[i], 0.0);
        let (low, high) = (low + w.c.corridor_margin, high - w.c.corridor_margin);
        for j in (0..w.count).filter(|j| opposed >> *j & 1 == 1) {
            let other = &self.turned[j];
            let ahead = other.s - state.s[i];
            let there = w.p[j].valid.simd_gt(0.0)
                & w.p[j].travel_sign.simd_ne(w.p[i].travel_sign)
                & ahead.simd_ge(0.0);
            let comes = bodies[j].shows & other.lane.simd_eq(state.lane[i]);
            let nearer = there & (comes | other.overlaps((low, high))) & ahead.simd_lt(facing.1);
            facing.0 = choose(nearer, splat(w.simd, j as i32 as f32), facing.0);
            facing.1 = choose(nearer, ahead, facing.1);
        }
        [chosen(w, i, coming), chosen(w, i, facing)]
    }

    /// The nearest oncomer of vehicle `i` in any lane, but for who is in a slot.
    #[inline(always)]
    pub fn nearest_but(
        state: &State<'_, S, N>,
        w: &World<'_, S, N>,
        i: usize,
        slot: V<S>,
    ) -> Met<S> {
        let bodies = core::array::from_fn(|j| {
            if j < w.count {
                Body::new(state, w, j)
            } else {
                Body::nothing(w.simd)
            }
        });
        let mut traffic = Self::nobody(w.simd);
        traffic.survey(state, w, &bodies);
        for j in 0..w.count {
            traffic.turned[j].on_road &= slot.simd_ne(j as i32 as f32);
        }
        let [coming, _] = traffic.nearest(state, w, &bodies, i);
        coming
    }

    /// Whether somebody is passing vehicle `i`, as its driver notices it.
    #[inline(always)]
    pub fn is_passed(&self, state: &State<'_, S, N>, w: &World<'_, S, N>, i: usize) -> M<S> {
        let p = &w.p[i];
        let mut passed = self.out[i] & !self.out[i];
        for j in (0..w.count).filter(|j| self.overtakers >> *j & 1 == 1) {
            let other = &w.p[j];
            let apart = (state.s[i] - state.s[j]).abs() - (p.half_length + other.half_length);
            let same = p.travel_sign.simd_eq(other.travel_sign) & self.out[j];
            let beside = apart.simd_lt(w.c.passed_awareness_margin) & same;
            passed |= beside & state.lane[j].simd_gt(state.lane[i]);
        }
        passed & state.crashed[i].simd_eq(0.0)
    }
}

/// Whom vehicle `i` meets, where there is a vehicle `i`.
#[inline(always)]
fn chosen<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    i: usize,
    (slot, distance): Met<S>,
) -> Met<S> {
    let valid = w.p[i].valid.simd_gt(0.0);
    (
        choose(valid, slot, splat(w.simd, NOBODY)),
        choose(valid, distance, splat(w.simd, FAR)),
    )
}

/// Whether vehicle `i` is overtaking, or on its way back from there.
#[inline(always)]
pub fn is_out<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    let away = state.stage[i].simd_ne(stage::FOLLOW) & state.stage[i].simd_ne(stage::DONE);
    away & state.crashed[i].simd_eq(0.0)
}
