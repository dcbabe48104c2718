//! Gap acceptance: what a driver sets out to do, from what it believes of the gaps around it; see
//! `overtaking.sim.reference.gaps`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::exp;
use crate::following::{forced_braking, needed_braking};
use crate::intent::{
    Intent, can_abort, can_remain, has_arrived, has_passed, in_stage, is_behind, signal,
};
use crate::lanes::{M, V, at_least, at_most, min, pick, splat};
use crate::mobil::soon;
use crate::moment::Mind;
use crate::names::Vehicle;
use crate::neighbours::Neighbours;
use crate::passing::{may_meet, room_left};
use crate::plight::Plight;
use crate::state::{EGO, FAST_LEAD, FAST_REAR, LEAD, REAR, SLOW_LEAD, SLOW_REAR, State, stage};
use crate::world::World;

/// Decisions that are forced on the ego, as `overtaking.model.scenario.ForcedDecision`; 0 is none.
mod forced_decision {
    pub const PULL_OUT: f32 = 1.0;
    pub const CANCEL: f32 = 2.0;
    pub const RETURN: f32 = 3.0;
    pub const STAY: f32 = 4.0;
}

/// Keeps what is imposed finite for who demands nothing.
const LEAST_DEMAND: f32 = 1e-6;

/// What a driver knows when it decides.
struct View<'a, S: Simd> {
    own: &'a Vehicle<S>,
    /// Speed that it wants where it is.
    desired: V<S>,
    speed: V<S>,
    gap: &'a [V<S>; 6],
    closing: &'a [V<S>; 6],
    detected: &'a [M<S>; 6],
    leader_speed: V<S>,
    demand: V<S>,
    imposes: V<S>,
    impatience: V<S>,
    /// How much more room it leaves to the leader than to a car.
    room_left: V<S>,
    /// Is told to change lanes: needs no gap, ignores vehicles beside it and never aborts.
    told: M<S>,
    /// Is told to pull out now: a vehicle in sight ahead is slower.
    ordered: M<S>,
    /// Decision that is forced on the ego, 0 for none.
    command: V<S>,
}

/// What driver `i` believes, and how much it demands after its wait.
#[inline(always)]
fn look<'a, S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &'a World<'_, S, N>,
    mind: &Mind<'a, S>,
    i: usize,
) -> View<'a, S> {
    let (near, believed, own) = (mind.near, mind.believed, &w.p[i]);
    let impatience = at_least(
        exp(-(state.waited[i] * own.inverse_patience)),
        w.c.patience_floor,
    );
    let demand = own.gap_demand_factor * impatience;
    let never = mind.looks & !mind.looks;
    let (mut told, mut ordered, mut command) = (never, never, splat(w.simd, 0.0));
    if i == EGO {
        told = is_told(w);
        let faster = faster(state, w, near);
        ordered = told & believed.detected[LEAD] & faster.simd_gt(own.min_speed_gain);
        command = w.q.forced_decision;
    }
    let bounded = own.safe_decel / at_least(demand, LEAST_DEMAND);
    View {
        own,
        desired: state.desired_speed(w, i),
        speed: state.vx[i],
        gap: &believed.gap,
        closing: &believed.closing,
        detected: &believed.detected,
        leader_speed: state.vx[i] - believed.closing[LEAD],
        demand,
        imposes: min(
            at_most(bounded, w.c.max_imposed_decel),
            own.max_assumed_decel,
        ),
        impatience,
        room_left: if w.road.ways.has_oncoming_traffic {
            room_left(w, near.slot[LEAD])
        } else {
            splat(w.simd, 1.0)
        },
        told,
        ordered,
        command,
    }
}

/// Whether the ego is told to change lanes, as in the study: it demands no gap.
#[inline(always)]
pub fn is_told<S: Simd, const N: usize>(w: &World<'_, S, N>) -> M<S> {
    w.p[EGO].gap_demand_factor.simd_le(0.0)
}

/// By how much the ego is in truth faster than its leader, which decides where it is told.
#[inline(always)]
pub fn faster<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    near: &Neighbours<S>,
) -> V<S> {
    state.vx[EGO] - pick!(w.count, near.slot[LEAD], |j| state.vx[j])
}

#[inline(always)]
fn own_braking<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    gap: V<S>,
    closing: V<S>,
) -> V<S> {
    let time_gap = view.own.time_gap * view.demand;
    forced_braking(w.c, view.own, view.speed, gap, closing, time_gap)
}

#[inline(always)]
fn their_braking<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    gap: V<S>,
    closing: V<S>,
) -> V<S> {
    let time_gap = view.own.time_gap * view.demand;
    forced_braking(w.c, view.own, view.speed + closing, gap, closing, time_gap)
}

#[inline(always)]
fn wants_to_pass<S: Simd, const N: usize>(w: &World<'_, S, N>, view: &View<'_, S>) -> M<S> {
    let own = view.own;
    let slower = (view.desired - view.leader_speed).simd_gt(own.min_speed_gain * view.impatience);
    let soon = view.gap[LEAD].simd_lt(own.pull_out_ttc * view.closing[LEAD]);
    let kept = own.time_gap * view.room_left;
    let near = w.c.close_time_gap * kept * view.speed + own.min_gap;
    let close = view.gap[LEAD].simd_lt(near);
    view.detected[LEAD] & slower & (soon | close)
}

#[inline(always)]
fn may_pull_out<S: Simd, const N: usize>(w: &World<'_, S, N>, view: &View<'_, S>) -> M<S> {
    let (c, own) = (w.c, view.own);
    let front =
        own_braking(w, view, view.gap[FAST_LEAD], view.closing[FAST_LEAD]).simd_ge(-own.decel);
    let (gap, closing) = (view.gap[FAST_REAR], view.closing[FAST_REAR]);
    let (later, faster) = soon(w, gap, closing);
    let now = their_braking(w, view, gap, closing);
    let rear = min(now, their_braking(w, view, later, faster)).simd_ge(-view.imposes);
    let rear = rear & gap.simd_gt(c.min_rear_gap * view.demand);
    // The lane of oncoming traffic is free while the driver sees no other vehicle overtake there.
    if w.road.ways.has_oncoming_traffic {
        return rear & !view.detected[FAST_LEAD];
    }
    let gain = ((view.speed - view.closing[FAST_LEAD]) - view.leader_speed)
        .simd_gt(own.min_speed_gain * view.impatience);
    let far = view.gap[FAST_LEAD].simd_gt(view.gap[LEAD] + c.waiting_time_gap * view.speed);
    front & rear & (gain | far | !view.detected[FAST_LEAD])
}

/// Whether the slower lane has room; `room_left` is how much more is left behind than to a car.
#[inline(always)]
fn may_return<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    room_left: V<S>,
) -> M<S> {
    let own = view.own;
    let (closing, ahead) = (view.closing[SLOW_REAR], view.closing[SLOW_LEAD]);
    let crossing = 0.5 * own.lane_change_duration;
    let gap = view.gap[SLOW_REAR] - crossing * at_most(closing, 0.0);
    let wanted = own.return_time_gap * (view.speed + closing) * view.impatience;
    let left = gap.simd_ge(wanted * room_left);
    let rear = left & their_braking(w, view, gap, closing).simd_ge(-view.imposes);
    let room = view.gap[SLOW_LEAD] - own.lane_change_duration * at_least(ahead, 0.0);
    let front = own_braking(w, view, room, ahead).simd_ge(-own.decel);
    let worth = view.gap[SLOW_LEAD].simd_gt(w.c.stay_time * view.closing[SLOW_LEAD]);
    // On a two-way road one returns even if one will soon catch up with the next vehicle.
    if w.road.ways.has_oncoming_traffic {
        return rear & front & view.gap[SLOW_LEAD].simd_gt(w.c.min_return_gap);
    }
    rear & front & worth
}

#[inline(always)]
fn must_abort<S: Simd, const N: usize>(
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    lead: usize,
    rear: usize,
) -> M<S> {
    let (c, own) = (w.c, view.own);
    let imposed = their_braking(w, view, view.gap[REAR], view.closing[REAR]);
    let braking = own_braking(w, view, view.gap[LEAD], view.closing[LEAD]);
    let bad = imposed.simd_lt(-(c.abort_imposed_factor * view.imposes))
        | braking.simd_lt(-(c.abort_factor * own.decel));
    let steady = splat(w.simd, 0.0);
    let back = needed_braking(c, view.speed, view.gap[lead], view.closing[lead], steady);
    bad & back.simd_ge(-own.max_assumed_decel) & view.gap[rear].simd_gt(c.min_rear_gap)
}

/// Whether the lane beside has room enough for a driver in a hurry when the line is crossed.
#[inline(always)]
fn may_squeeze<S: Simd, const N: usize>(w: &World<'_, S, N>, view: &View<'_, S>) -> M<S> {
    let (c, closing) = (w.c, view.closing[SLOW_LEAD]);
    let crossing = 0.5 * w.q.urgent_change_duration;
    let front = view.gap[SLOW_LEAD] - crossing * closing;
    let rear = view.gap[SLOW_REAR] - crossing * at_least(view.closing[SLOW_REAR], 0.0);
    let squeezed = min(rear, front).simd_gt(c.min_return_gap);
    // It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    let steady = splat(w.simd, 0.0);
    let ahead = needed_braking(c, view.speed, view.gap[SLOW_LEAD], closing, steady);
    squeezed & ahead.simd_ge(-(c.abort_factor * view.own.decel))
}

/// What driver `i` wants, and what of it is done now that it has signalled long enough.
#[inline(always)]
pub fn intend<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: &Mind<'_, S>,
    i: usize,
    plight: Option<&Plight<S>>,
) -> Intent<S> {
    let view = &look(state, w, mind, i);
    let (c, looks, told, command) = (w.c, mind.looks, view.told, view.command);
    let heeds = looks & !told;
    let arrived = has_arrived(state, i);
    let free = in_stage(state, i, stage::FOLLOW)
        & arrived
        & state.since_change[i].simd_ge(c.abort_cooldown)
        & state.lane[i].simd_lt((w.road.num_lanes - 1) as f32);
    let held = state.wanted[i];
    let mut seen = wants_to_pass(w, view) & may_pull_out(w, view);
    if plight.is_some() {
        let (coming, leader) = (&mind.met.coming, (view.gap[LEAD], view.leader_speed));
        seen &= may_meet(state, w, i, mind.near, coming, leader, view.impatience);
        seen &= !mind.met.leader_goes;
    }
    let seen = chosen(told, view.ordered, seen);
    let wanted =
        chosen(looks | told, seen, held.simd_gt(0.0)) & command.simd_ne(forced_decision::STAY);
    let forced = command.simd_eq(forced_decision::PULL_OUT) & state.attempted.simd_eq(0.0);
    let start = free & (wanted | forced);

    let slower_lane = in_stage(state, i, stage::PASS) & state.lane[i].simd_ge(1.0);
    let passed = has_passed(state, w, i);
    let stuck = state.stage_time[i].simd_gt(c.give_up_after) & is_behind(state, w, i);
    let mut rested = state.since_change[i].simd_ge(c.abort_cooldown);
    let mut room = splat(w.simd, 1.0);
    if plight.is_some() {
        room = room_left(w, state.target[i]);
    }
    let mut may = may_return(w, view, room) & (passed | stuck);
    if let Some(plight) = plight {
        let hurried = plight.pressed & may_squeeze(w, view) & passed;
        may |= hurried;
        rested |= hurried;
    }
    let seen = chosen(told, passed, may) & rested;
    let wanted = chosen(looks | told, seen, held.simd_lt(0.0));
    let back = slower_lane & (wanted | command.simd_eq(forced_decision::RETURN));
    signal(state, w, i, start, back);
    let ready = state.signalled[i].simd_gt(view.own.indicator_lead_time);
    let danger = heeds & must_abort(w, view, SLOW_LEAD, SLOW_REAR);
    let mut abort = can_abort(state, w, i) & (danger | command.simd_eq(forced_decision::CANCEL));
    let danger = heeds
        & must_abort(w, view, FAST_LEAD, FAST_REAR)
        & command.simd_ne(forced_decision::RETURN);
    let sure = (looks & !mind.waits) | told;
    let mut remain = can_remain(state, w, i) & danger;
    let mut back_now = ready;
    if let Some(plight) = plight {
        let behind = view.gap[SLOW_REAR].simd_gt(c.min_rear_gap);
        let falls_in = plight.yields & plight.fits & behind;
        back_now = (back_now | plight.hurries) & !falls_in;
        abort |= falls_in;
        // The other lane is no place to stay.
        remain &= !remain;
    }
    Intent {
        start,
        back,
        go_out: start & ready & (sure | command.simd_eq(forced_decision::PULL_OUT)),
        go_back: back & back_now & (sure | command.simd_eq(forced_decision::RETURN)),
        abort,
        remain,
        passed,
        arrived,
    }
}

/// One mask where another holds, and a third elsewhere.
#[inline(always)]
fn chosen<S: Simd>(mask: M<S>, there: M<S>, elsewhere: M<S>) -> M<S> {
    (mask & there) | (!mask & elsewhere)
}
