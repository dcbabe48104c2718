//! How drivers give way to who comes in their lane, or passes them; see `overtaking.sim.reference.giving_way`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, V, at_least, choose, clamp_to, put, splat};
use crate::neighbours::lane_borders;
use crate::oncoming::Encounters;
use crate::state::State;
use crate::steering::begin_path;
use crate::traffic::is_out;
use crate::world::World;

const FAR: f32 = 1e9;
/// Keeps braking finite for who is there already [s].
const SHORTEST: f32 = 0.1;

/// The acceleration that driver `i` does not go beyond for who comes in its lane; it may move aside, too.
#[inline(always)]
pub fn give_way<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    met: &Encounters<S>,
) -> V<S> {
    let c = w.c;
    let splat = |value: f32| splat(w.simd, value);
    let out = is_out(state, i);
    let meets = met.faces & state.crashed[i].simd_eq(0.0) & !out;
    let time = met.faced_in;
    let lifts = meets & time.simd_lt(c.oncoming_flash_time);
    let brakes = meets & time.simd_lt(c.oncoming_brake_time);
    state.flashes[i] = choose(lifts, splat(1.0), splat(0.0));
    let halved = 2.0 * at_least(time, SHORTEST);
    let braking = clamp_to(
        state.vx[i] / halved,
        c.oncoming_min_decel,
        c.oncoming_max_decel,
    );
    move_aside(state, w, i, brakes, met.passed, out);
    choose(
        brakes,
        -braking,
        choose(lifts, splat(-c.oncoming_lift_decel), splat(FAR)),
    )
}

/// Move towards the edge of the lane for who comes in it, or passes; and back afterwards. Who is `out` keeps
/// to the way of that.
#[inline(always)]
fn move_aside<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    brakes: M<S>,
    passed: M<S>,
    out: M<S>,
) {
    let (c, p) = (w.c, &w.p[i]);
    let splat = |value: f32| splat(w.simd, value);
    let room = choose(passed, p.edge_shift_when_passed, splat(0.0));
    let wanted = choose(brakes, splat(c.edge_shift), room);
    let arrived = state.path_time[i].simd_ge(state.path_duration[i]);
    let moved = wanted.simd_gt(state.aside[i]) | (arrived & wanted.simd_lt(state.aside[i]));
    let moved = moved & state.crashed[i].simd_eq(0.0) & p.valid.simd_gt(0.0) & !out;
    if moved.any_true() {
        let (low, high) = lane_borders(w, state.lane[i], 0.0);
        let duration = choose(
            brakes,
            splat(c.edge_shift_duration),
            splat(2.0 * c.edge_shift_duration),
        );
        begin_path(state, i, moved, 0.5 * (low + high) - wanted, duration);
        put(&mut state.aside[i], moved, wanted);
    }
    put(&mut state.aside[i], out, splat(0.0));
}
