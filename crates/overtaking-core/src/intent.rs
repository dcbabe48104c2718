//! What a driver intends at a decision, and which moves are open to it; see `overtaking.sim.reference.intent`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, at_least, choose, pick, splat};
use crate::mobil::change_of;
use crate::state::{State, stage};
use crate::world::World;

/// What a driver sets out to do at a decision.
pub struct Intent<S: Simd> {
    /// Wants to pull out, or to change back, and shows it.
    pub start: M<S>,
    pub back: M<S>,
    /// Does it now.
    pub go_out: M<S>,
    pub go_back: M<S>,
    pub abort: M<S>,
    /// Gives up changing back now.
    pub remain: M<S>,
    /// The target is behind.
    pub passed: M<S>,
    /// The last lane change is over.
    pub arrived: M<S>,
}

/// Whether driver `i` is sound and in a stage.
#[inline(always)]
pub fn in_stage<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize, which: f32) -> M<S> {
    state.crashed[i].simd_eq(0.0) & state.stage[i].simd_eq(which)
}

/// Whether the last lane change of driver `i` is over.
#[inline(always)]
pub fn has_arrived<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize) -> M<S> {
    state.path_time[i].simd_ge(state.path_duration[i])
}

/// Whether the front of the target of driver `i` is visibly behind the own rear.
#[inline(always)]
pub fn has_passed<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    let target = state.target[i];
    let target_s = pick!(w.count, target, |j| state.s[j]);
    let bodies = w.p[i].half_length + pick!(w.count, target, |j| w.p[j].half_length);
    (state.s[i] - target_s).simd_gt(bodies + w.c.return_clearance)
}

/// Whether the target of driver `i` is ahead.
#[inline(always)]
pub fn is_behind<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    state.s[i].simd_lt(pick!(w.count, state.target[i], |j| state.s[j]))
}

/// Whether going back is shorter than going on.
#[inline(always)]
fn is_early<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    state.path_time[i].simd_lt(w.c.abort_until * state.path_duration[i])
}

/// Whether driver `i` pulls out, and going back is shorter than going on.
#[inline(always)]
pub fn can_abort<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    in_stage(state, i, stage::PULL_OUT) & is_early(state, w, i)
}

/// Whether driver `i` changes back by a whole lane, and going back is shorter than going on.
#[inline(always)]
pub fn can_remain<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> M<S> {
    let comes_back = in_stage(state, i, stage::RETURN) | in_stage(state, i, stage::ABORT);
    comes_back & is_early(state, w, i) & change_of(state, w, i).1
}

/// Remember the side that is wanted, and for how long it has been shown.
#[inline(always)]
pub fn signal<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    start: M<S>,
    back: M<S>,
) {
    let (zero, one) = (splat(w.simd, 0.0), splat(w.simd, 1.0));
    state.wanted[i] = choose(start, one, choose(back, -one, zero));
    let longer = state.signalled[i] + w.c.decision;
    let fading = at_least(state.signalled[i] - w.c.decision, 0.0);
    state.signalled[i] = choose(start | back, longer, fading);
}
