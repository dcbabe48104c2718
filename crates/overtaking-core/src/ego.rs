//! Decisions about overtaking, of the ego and on two-way roads of everybody; see `overtaking.sim.reference.ego`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::elementary::exp;
use crate::following::{forced_braking, needed_braking};
use crate::lanes::{M, V, at_least, at_most, choose, min, pick, put, splat};
use crate::mobil::{change_of, soon, time_left, turn_to_lane};
use crate::names::Vehicle;
use crate::neighbours::Neighbours;
use crate::orders::{self, Orders};
use crate::passing::{goes_on, may_meet, room_left, weigh};
use crate::perception::Beliefs;
use crate::recording::{Kind, Recorder};
use crate::state::{
    EGO, FAST_LEAD, FAST_REAR, LEAD, REAR, SLOW_LEAD, SLOW_REAR, State, World, stage,
};
use crate::step::{Mind, SUBSTEPS};

const PULL_OUT_NOW: f32 = 1.0;
const ABORT_NOW: f32 = 2.0;
const RETURN_NOW: f32 = 3.0;
const STAY: f32 = 4.0;
/// Keeps what is imposed finite for who demands nothing.
const LEAST_DEMAND: f32 = 1e-6;

/// What a driver knows when it decides.
struct View<'a, S: Simd> {
    /// Its slot.
    i: usize,
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
    let demand = own.gap_acceptance * impatience;
    let never = mind.looks & !mind.looks;
    let (mut told, mut ordered, mut command) = (never, never, splat(w.simd, 0.0));
    if i == EGO {
        told = is_told(w);
        let faster = faster(state, w, near);
        ordered = told & believed.detected[LEAD] & faster.simd_gt(own.passing_gain);
        command = w.q.command;
    }
    let bounded = own.safe_decel / at_least(demand, LEAST_DEMAND);
    View {
        i,
        own,
        desired: state.desired_speed(w, i),
        speed: state.vx[i],
        gap: &believed.gap,
        closing: &believed.closing,
        detected: &believed.detected,
        leader_speed: state.vx[i] - believed.closing[LEAD],
        demand,
        imposes: min(at_most(bounded, w.c.most_imposed), own.hardest_decel),
        impatience,
        room_left: if w.road.ways.two_way {
            room_left(w, near.slot[LEAD])
        } else {
            splat(w.simd, 1.0)
        },
        told,
        ordered,
        command,
    }
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
    let slower = (view.desired - view.leader_speed).simd_gt(own.passing_gain * view.impatience);
    let soon = view.gap[LEAD].simd_lt(own.pull_out_time * view.closing[LEAD]);
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
    let rear = rear & gap.simd_gt(c.smallest_rear_gap * view.demand);
    // The lane of oncoming traffic is free while the driver sees no other vehicle overtake there.
    if w.road.ways.two_way {
        return rear & !view.detected[FAST_LEAD];
    }
    let gain = ((view.speed - view.closing[FAST_LEAD]) - view.leader_speed)
        .simd_gt(own.passing_gain * view.impatience);
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
    if w.road.ways.two_way {
        return rear & front & view.gap[SLOW_LEAD].simd_gt(w.c.squeeze_gap);
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
    let bad = imposed.simd_lt(-(c.abort_imposed * view.imposes))
        | braking.simd_lt(-(c.abort_factor * own.decel));
    let steady = splat(w.simd, 0.0);
    let back = needed_braking(c, view.speed, view.gap[lead], view.closing[lead], steady);
    bad & back.simd_ge(-own.hardest_decel) & view.gap[rear].simd_gt(c.smallest_rear_gap)
}

/// What oncoming traffic lets a driver do.
struct Meeting<S: Simd> {
    /// The other lane is believed to be free for long enough to pass.
    may_go: M<S>,
    /// Little time is left to be past.
    hurries: M<S>,
    /// It is in a hurry, and there is room to squeeze back in.
    squeezes: M<S>,
    /// It gives up, and there is room to fall in behind the other.
    falls_in: M<S>,
    /// How much more room it leaves to the passed vehicle than to a car.
    room_left: V<S>,
}

/// What oncoming traffic lets a driver do, remembered.
#[inline(always)]
fn meet<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    mind: &Mind<'_, S>,
) -> Meeting<S> {
    let (c, i, coming) = (w.c, view.i, &mind.met.coming);
    let leader = (view.gap[LEAD], view.leader_speed);
    let may_go = may_meet(state, w, i, mind.near, coming, leader, view.impatience);
    let plight = weigh(state, w, i, mind);
    let (one, zero) = (splat(w.simd, 1.0), splat(w.simd, 0.0));
    state.yields[i] = choose(plight.yields, one, zero);
    state.hurries[i] = choose(plight.hurries, one, zero);
    let rear = view.gap[SLOW_REAR];
    let closing = view.closing[SLOW_LEAD];
    // It brakes on the way: who waits until it need not never gets behind a slow vehicle in time.
    let ahead = needed_braking(c, view.speed, view.gap[SLOW_LEAD], closing, zero);
    let crossing = 0.5 * w.q.hasty_change;
    let front = view.gap[SLOW_LEAD] - crossing * closing;
    let beside = rear - crossing * at_least(view.closing[SLOW_REAR], 0.0);
    Meeting {
        may_go: may_go & !mind.met.leader_goes,
        hurries: plight.hurries,
        squeezes: plight.pressed
            & min(beside, front).simd_gt(c.squeeze_gap)
            & ahead.simd_ge(-(c.abort_factor * view.own.decel)),
        falls_in: plight.yields & plight.fits & rear.simd_gt(c.smallest_rear_gap),
        room_left: room_left(w, state.target[i]),
    }
}

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
    let view = look(state, w, &mind, EGO);
    wait(state, w, EGO, mind.believed);
    let two_way = w.road.ways.two_way;
    // Oncoming traffic changes the pedals and the haste of the ego, also under another driver.
    let meets = if two_way {
        Some(meet(state, w, &view, &mind))
    } else {
        None
    };
    let intent = match orders {
        None => intend(state, w, &view, mind.looks, mind.waits, meets.as_ref()),
        Some(orders) => orders::obey(state, w, orders),
    };
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
    act(state, w, &mind, &view, &intent, step / SUBSTEPS);
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
    let view = look(state, w, &mind, i);
    wait(state, w, i, mind.believed);
    let meets = meet(state, w, &view, &mind);
    let intent = intend(state, w, &view, mind.looks, mind.waits, Some(&meets));
    let next = next_stage(state, w, mind.near, i, &intent);
    act(state, w, &mind, &view, &intent, step / SUBSTEPS);
    let done = next.simd_eq(stage::DONE);
    put(&mut state.waited[i], done, splat(w.simd, 0.0));
    enter(
        state,
        w,
        i,
        choose(done, splat(w.simd, stage::FOLLOW), next),
    );
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

/// Whether the ego is told to change lanes, as in the study: it demands no gap.
#[inline(always)]
pub fn is_told<S: Simd, const N: usize>(w: &World<'_, S, N>) -> M<S> {
    w.p[EGO].gap_acceptance.simd_le(0.0)
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

/// Whether driver `i` is sound and in a stage.
#[inline(always)]
pub fn in_stage<S: Simd, const N: usize>(state: &State<'_, S, N>, i: usize, which: f32) -> M<S> {
    state.crashed[i].simd_eq(0.0) & state.stage[i].simd_eq(which)
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
fn intend<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    view: &View<'_, S>,
    looks: M<S>,
    waits: M<S>,
    meets: Option<&Meeting<S>>,
) -> Intent<S> {
    let (c, i, command) = (w.c, view.i, view.command);
    let told = view.told;
    let heeds = looks & !told;
    let arrived = has_arrived(state, i);
    let free = in_stage(state, i, stage::FOLLOW)
        & arrived
        & state.since_change[i].simd_ge(c.abort_cooldown)
        & state.lane[i].simd_lt((w.road.num_lanes - 1) as f32);
    let held = state.wanted[i];
    let mut seen = wants_to_pass(w, view) & may_pull_out(w, view);
    if let Some(meets) = meets {
        seen &= meets.may_go;
    }
    let seen = chosen(told, view.ordered, seen);
    let wanted = chosen(looks | told, seen, held.simd_gt(0.0)) & command.simd_ne(STAY);
    let forced = command.simd_eq(PULL_OUT_NOW) & state.attempted.simd_eq(0.0);
    let start = free & (wanted | forced);

    let slower_lane = in_stage(state, i, stage::PASS) & state.lane[i].simd_ge(1.0);
    let passed = has_passed(state, w, i);
    let stuck = state.stage_time[i].simd_gt(c.give_up_after) & is_behind(state, w, i);
    let mut rested = state.since_change[i].simd_ge(c.abort_cooldown);
    let room_left = meets.map_or(splat(w.simd, 1.0), |meets| meets.room_left);
    let mut may = may_return(w, view, room_left) & (passed | stuck);
    if let Some(meets) = meets {
        let hurried = meets.squeezes & passed;
        may |= hurried;
        rested |= hurried;
    }
    let seen = chosen(told, passed, may) & rested;
    let wanted = chosen(looks | told, seen, held.simd_lt(0.0));
    let back = slower_lane & (wanted | command.simd_eq(RETURN_NOW));
    signal(state, w, i, start, back);
    let ready = state.signalled[i].simd_gt(view.own.signal_time);
    let danger = heeds & must_abort(w, view, SLOW_LEAD, SLOW_REAR);
    let mut abort = can_abort(state, w, i) & (danger | command.simd_eq(ABORT_NOW));
    let danger = heeds & must_abort(w, view, FAST_LEAD, FAST_REAR) & command.simd_ne(RETURN_NOW);
    let sure = (looks & !waits) | told;
    let mut remain = can_remain(state, w, i) & danger;
    let mut back_now = ready;
    if let Some(meets) = meets {
        back_now = (back_now | meets.hurries) & !meets.falls_in;
        abort |= meets.falls_in;
        // The other lane is no place to stay.
        remain &= !remain;
    }
    Intent {
        start,
        back,
        go_out: start & ready & (sure | command.simd_eq(PULL_OUT_NOW)),
        go_back: back & back_now & (sure | command.simd_eq(RETURN_NOW)),
        abort,
        remain,
        passed,
        arrived,
    }
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
    (state.s[i] - target_s).simd_gt(bodies + w.c.clear_ahead)
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

/// One mask where another holds, and a third elsewhere.
#[inline(always)]
fn chosen<S: Simd>(mask: M<S>, there: M<S>, elsewhere: M<S>) -> M<S> {
    (mask & there) | (!mask & elsewhere)
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
    view: &View<'_, S>,
    intent: &Intent<S>,
    decision: u32,
) {
    let (i, zero) = (view.i, splat(w.simd, 0.0));
    let (faster, slower) = (intent.go_out | intent.remain, intent.go_back | intent.abort);
    put(&mut state.target[i], intent.go_out, mind.near.slot[LEAD]);
    if w.road.ways.two_way {
        let beside = goes_on(state, w, i, mind);
        put(&mut state.target[i], beside, mind.near.slot[SLOW_LEAD]);
    }
    let broken_off = intent.abort | intent.remain;
    let sides = (faster, slower, broken_off);
    let left = time_left(view.gap[LEAD], view.closing[LEAD]);
    let hasty = if w.road.ways.two_way {
        let hurried = state.hurries[i].simd_gt(0.0) | state.yields[i].simd_gt(0.0);
        Some(choose(hurried, w.q.hasty_change, zero))
    } else {
        None
    };
    turn_to_lane(state, w, i, sides, left, hasty, decision);
    let moved = faster | slower;
    let kept = choose(state.signalled[i].simd_gt(0.0), state.indicator[i], zero);
    let used = view.own.uses_indicator;
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
