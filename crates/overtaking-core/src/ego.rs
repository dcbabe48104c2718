//! Overtaking as a state machine, of the ego and on two-way roads of everybody; see `overtaking.sim.reference.ego`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::gaps::intend;
use crate::intent::{Intent, in_stage};
use crate::lanes::{V, at_least, choose, max, min, put, splat};
use crate::mobil::turn_to_lane;
use crate::moment::Mind;
use crate::neighbours::Neighbours;
use crate::orders::{self, Orders};
use crate::perception::Beliefs;
use crate::plight::{Plight, goes_on, weigh};
use crate::recording::{Kind, Recorder};
use crate::state::{EGO, FAST_LEAD, FAST_REAR, LEAD, SLOW_LEAD, SLOW_REAR, State, stage};
use crate::world::{SUBSTEPS, World};

/// One decision of every ego of the block; what it intends holds until it looks around again.
#[inline(always)]
pub fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    recorder: &mut Recorder<'_, N>,
    step: u32,
    orders: Option<&Orders<S>>,
) {
    let (near, believed) = (mind.near, mind.believed);
    let two_way = w.road.ways.has_oncoming_traffic;
    // Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    let plight = if two_way {
        Some(face(state, w, &mind, EGO))
    } else {
        None
    };
    let intent = match orders {
        None => intend(state, w, &mind, EGO, plight.as_ref()),
        Some(orders) => orders::obey(state, w, orders),
    };
    wait(state, w, EGO, believed);
    let oncoming = two_way.then_some(&mind.met.coming);
    let (out, back) = ([LEAD, FAST_LEAD, FAST_REAR], [LEAD, SLOW_LEAD, SLOW_REAR]);
    recorder.percepts(
        state,
        w,
        near,
        believed,
        intent.go_out,
        Kind::PullOut,
        out,
        step,
        oncoming,
    );
    recorder.percepts(
        state,
        w,
        near,
        believed,
        intent.abort,
        Kind::Abort,
        back,
        step,
        None,
    );
    recorder.percepts(
        state,
        w,
        near,
        believed,
        intent.remain,
        Kind::Abort,
        out,
        step,
        None,
    );
    recorder.percepts(
        state,
        w,
        near,
        believed,
        intent.go_back,
        Kind::Return,
        back,
        step,
        None,
    );
    let next = next_stage(state, w, near, EGO, &intent);
    act(state, w, &mind, EGO, &intent, step / SUBSTEPS);
    put(&mut state.attempted, intent.go_out, splat(w.simd, 1.0));
    if let Some(orders) = orders {
        orders::show(state, orders);
    }
    end(state, w, &intent, next, step);
    enter(state, w, EGO, next);
}

/// One decision of vehicle `i`, not the ego, on a two-way road; who has overtaken may do so again.
#[inline(always)]
pub fn decide_other<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    i: usize,
    step: u32,
) {
    let settled = state.stage[i].simd_eq(stage::FOLLOW) & state.signalled[i].simd_eq(0.0);
    let still = settled & state.wanted[i].simd_eq(0.0) & state.indicator[i].simd_eq(0.0);
    if (still & !mind.looks).all_true() {
        wait(state, w, i, mind.believed);
        return; // A driver begins no manoeuvre without a look around.
    }
    let plight = face(state, w, &mind, i);
    let intent = intend(state, w, &mind, i, Some(&plight));
    wait(state, w, i, mind.believed);
    let next = next_stage(state, w, mind.near, i, &intent);
    act(state, w, &mind, i, &intent, step / SUBSTEPS);
    let done = next.simd_eq(stage::DONE);
    put(&mut state.waited[i], done, splat(w.simd, 0.0));
    enter(
        state,
        w,
        i,
        choose(done, splat(w.simd, stage::FOLLOW), next),
    );
}

/// How driver `i` stands to oncoming traffic, remembered.
#[inline(always)]
fn face<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: &Mind<'_, S>,
    i: usize,
) -> Plight<S> {
    let plight = weigh(state, w, i, mind);
    let (one, zero) = (splat(w.simd, 1.0), splat(w.simd, 0.0));
    state.yields[i] = choose(plight.yields, one, zero);
    state.hurries[i] = choose(plight.hurries, one, zero);
    plight
}

/// Go on to the next stage, or stay.
#[inline(always)]
fn enter<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    next: V<S>,
) {
    let changed = next.simd_ne(state.stage[i]);
    put(&mut state.stage_time[i], changed, splat(w.simd, 0.0));
    state.stage[i] = next;
}

/// Count the time behind a slower leader.
#[inline(always)]
fn wait<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
    believed: &Beliefs<S>,
) {
    let speed = state.vx[i];
    let queues = believed.gap[LEAD].simd_lt(w.c.waiting_time_gap * speed);
    let waits = in_stage(state, i, stage::FOLLOW)
        & believed.detected[LEAD]
        & queues
        & state
            .desired_speed(w, i)
            .simd_gt(speed - believed.closing[LEAD]);
    let longer = state.waited[i] + w.c.decision;
    put(&mut state.waited[i], waits, longer);
}

#[inline(always)]
fn next_stage<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
    i: usize,
    intent: &Intent<S>,
) -> V<S> {
    let centre = 0.5 * (near.lane_low + near.lane_high);
    let settled = (state.d[i] - centre).abs().simd_lt(w.c.settled_offset);
    let finished = intent.arrived & settled;
    let [pull_out, pass, back, done, abort, follow] = [
        stage::PULL_OUT,
        stage::PASS,
        stage::RETURN,
        stage::DONE,
        stage::ABORT,
        stage::FOLLOW,
    ];
    let next = choose(intent.go_out, splat(w.simd, pull_out), state.stage[i]);
    let next = choose(
        in_stage(state, i, pull_out) & intent.arrived,
        splat(w.simd, pass),
        next,
    );
    let next = choose(intent.abort, splat(w.simd, abort), next);
    let returning = choose(intent.passed, splat(w.simd, back), splat(w.simd, abort));
    let returns = intent.go_back & in_stage(state, i, pass);
    let next = choose(returns, returning, next);
    let next = choose(
        in_stage(state, i, back) & finished,
        splat(w.simd, done),
        next,
    );
    let next = choose(
        in_stage(state, i, abort) & finished,
        splat(w.simd, follow),
        next,
    );
    choose(intent.remain, splat(w.simd, pass), next)
}

/// Move over and show it.
#[inline(always)]
fn act<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: &Mind<'_, S>,
    i: usize,
    intent: &Intent<S>,
    decision: u32,
) {
    let (c, zero) = (w.c, splat(w.simd, 0.0));
    let (faster, slower) = (intent.go_out | intent.remain, intent.go_back | intent.abort);
    put(&mut state.target[i], intent.go_out, mind.near.slot[LEAD]);
    if w.road.ways.has_oncoming_traffic {
        let beside = goes_on(state, w, i, mind);
        put(&mut state.target[i], beside, mind.near.slot[SLOW_LEAD]);
    }
    let broken_off = intent.abort | intent.remain;
    let sides = (faster, slower, broken_off);
    let hasty = if w.road.ways.has_oncoming_traffic {
        let hurried = state.hurries[i].simd_gt(0.0) | state.yields[i].simd_gt(0.0);
        let turned = c.min_change_distance / at_least(state.vx[i], c.slip_speed);
        Some(choose(
            hurried,
            max(w.q.urgent_change_duration, turned),
            zero,
        ))
    } else {
        None
    };
    turn_to_lane(state, w, i, sides, mind.believed, hasty, decision);
    let moved = faster | slower;
    let kept = choose(state.signalled[i].simd_gt(0.0), state.indicator[i], zero);
    let used = w.p[i].uses_indicator;
    let shown = choose(intent.start, used, choose(intent.back, -used, kept));
    put(&mut state.indicator[i], intent.arrived & !moved, shown);
    put(&mut state.signalled[i], moved, zero);
}

/// End the simulation some time after the overtake, or at the deadline if the ego follows then.
#[inline(always)]
fn end<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    intent: &Intent<S>,
    next: V<S>,
    step: u32,
) {
    let c = w.c;
    let now = splat(w.simd, step as f32);
    let over = next.simd_eq(stage::DONE) & state.stage[EGO].simd_ne(stage::DONE);
    let after = now + (c.after_overtake / c.step).round_ties_even();
    let sooner = min(state.end_step, after);
    put(&mut state.end_step, over, sooner);
    let idle = in_stage(state, EGO, stage::FOLLOW) & !intent.start & now.simd_ge(w.q.deadline_step);
    let sooner = min(state.end_step, now);
    put(&mut state.end_step, idle, sooner);
}
