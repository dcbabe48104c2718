//! What happens in a step, and what only at every fifth: a decision; see `overtaking.sim.reference.run`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::collisions::{Pairs, collide, leave_road, near_pairs};
use crate::dynamics::Motion;
use crate::giving_way::give_way;
use crate::lanes::{M, V, min, outlined, splat};
use crate::moment::{Mind, Minds};
use crate::neighbours::{Body, find_neighbours};
use crate::oncoming::look_ahead;
use crate::orders::Orders;
use crate::plight::held_back;
use crate::recording::Recorder;
use crate::state::{EGO, Each, State};
use crate::world::{SUBSTEPS, Stride, World};
use crate::{control, dynamics, ego, environment, mobil, perception, steering};

/// Everything that happens 20 times a second: weather, perception, decisions.
///
/// Each part is a function of its own with the features of the CPU switched on; inlining them all into
/// one makes the compiler slow and the code no faster.
pub fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    minds: &mut Minds<S, N>,
    recorder: &mut Recorder<'_, N>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&Orders<S>>,
) {
    perceive(state, w, minds, step, orders.is_some());
    drive_others(state, w, minds, step);
    drive_ego(state, w, minds.of_ego(), recorder, pairs, step, orders);
}

/// What happens before anyone decides: weather, perception.
///
/// Another driver of the ego may decide `any_time`, and its neighbours on both sides are looked for, too,
/// when the model's driver would not look at them.
pub fn perceive<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    minds: &mut Minds<S, N>,
    step: u32,
    any_time: bool,
) {
    let decision = step / SUBSTEPS;
    surroundings(state, w, step);
    let Minds {
        bodies,
        near,
        believed,
        looks,
        met,
        traffic,
        waits,
        ..
    } = minds;
    let two_way = w.road.ways.has_oncoming_traffic;
    outlined!(w.simd, {
        for i in 0..w.count {
            bodies[i] = Body::new(state, w, i);
        }
        if two_way {
            traffic.survey(state, w, bodies);
        }
    });
    for i in 0..w.count {
        let (near, believed) = (&mut near[i], &mut believed[i]);
        let looks = &mut looks[i];
        let mut everywhere = false;
        outlined!(w.simd, {
            everywhere = turn_head(state, w, (i, decision, any_time), looks);
        });
        // The four loops are compiled apart: together they do not have registers enough.
        match (everywhere, two_way) {
            (false, false) => outlined!(w.simd, {
                find_neighbours::<S, N, 1, false>(state, w, bodies, i, near);
            }),
            (true, false) => outlined!(w.simd, {
                find_neighbours::<S, N, 3, false>(state, w, bodies, i, near);
            }),
            (false, true) => outlined!(w.simd, {
                find_neighbours::<S, N, 1, true>(state, w, bodies, i, near);
            }),
            (true, true) => outlined!(w.simd, {
                find_neighbours::<S, N, 3, true>(state, w, bodies, i, near);
            }),
        }
        if two_way {
            let met = &mut met[i];
            outlined!(w.simd, {
                let asked = i == EGO || (*looks | traffic.out[i]).any_true();
                let seen = (&*bodies, &*traffic);
                look_ahead(state, w, seen, near, i, decision as usize, asked, met);
            });
        }
        // Written in place: what a function with other features returns goes through memory twice.
        outlined!(w.simd, {
            let decision = decision as usize;
            perception::perceive(state, w, bodies, near, i, decision, *looks, believed);
        });
    }
    outlined!(
        w.simd,
        *waits = mobil::must_wait(state, w, bodies, EGO, state.wanted[EGO])
    );
}

/// Where the driver of vehicle `i` looks at a decision; whether in any simulation it is at all lanes.
#[inline(always)]
fn turn_head<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    (i, decision, any_time): (usize, u32, bool),
    looks: &mut M<S>,
) -> bool {
    if decision == 0 {
        let drawn = w.p[i].valid.simd_gt(0.0);
        perception::draw_check(state, w, i, drawn, decision);
    }
    *looks = perception::looks_around(state, w, i, decision);
    if w.road.ways.has_oncoming_traffic {
        // Who is in the lane of others looks all the time.
        *looks |= state.lane[i].simd_ge(1.0);
    }
    let changing = state.path_time[i].simd_lt(state.path_duration[i]);
    // Who is told or forced to change lanes may do so at any time; what it passes by is recorded.
    let forced = w.q.forced_decision.simd_gt(0.0);
    let told = (w.p[EGO].gap_demand_factor.simd_le(0.0) | forced).any_true();
    let is_asked = i == EGO && (any_time || told);
    is_asked || (*looks | changing).any_true()
}

/// What everybody but the ego decides.
pub fn drive_others<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    minds: &Minds<S, N>,
    step: u32,
) {
    let Minds {
        bodies,
        near,
        believed,
        looks,
        met,
        ..
    } = minds;
    let mut leader = [splat(w.simd, 0.0); N];
    for i in 1..w.count {
        leader[i] = outlined!(
            w.simd,
            control::behind_leader(state, w, i, (&near[i], &believed[i]), met[i].passed)
        );
    }
    if w.road.ways.has_oncoming_traffic {
        for i in 1..w.count {
            outlined!(w.simd, {
                leader[i] = min(leader[i], give_way(state, w, i, &met[i]));
                leader[i] = min(leader[i], held_back(state, w, i, &minds.of_other(i)));
            });
        }
    }
    for i in 1..w.count {
        outlined!(w.simd, {
            let mind = (&near[i], &believed[i]);
            let wanted = control::wanted(state, w, i, mind, met[i].passed, leader[i]);
            control::press(state, w, i, wanted);
        });
    }
    if w.road.ways.has_oncoming_traffic {
        for i in 1..w.count {
            let mind = minds.of_other(i);
            outlined!(w.simd, ego::decide_other(state, w, mind, i, step));
        }
        return;
    }
    for i in (1..w.count).filter(|i| looks[*i].any_true()) {
        outlined!(w.simd, {
            mobil::change_lanes(
                state,
                w,
                bodies,
                i,
                &believed[i],
                leader[i],
                looks[i],
                step / SUBSTEPS,
            );
        });
    }
}

/// What the ego decides, or another driver orders, and who may collide until the next decision.
pub fn drive_ego<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    mind: Mind<'_, S>,
    recorder: &mut Recorder<'_, N>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&Orders<S>>,
) {
    outlined!(w.simd, {
        let two_way = w.road.ways.has_oncoming_traffic;
        // The ego flashes under another driver, too.
        let gives_way = if two_way {
            Some(give_way(state, w, EGO, mind.met))
        } else {
            None
        };
        let passed = mind.met.passed;
        // No closure: the compiler would leave it outside, without the features of the CPU.
        let wanted = if let Some(ordered) = orders.and_then(Orders::accel) {
            ordered
        } else {
            let mut leader =
                control::behind_leader(state, w, EGO, (mind.near, mind.believed), passed);
            if let Some(most) = gives_way {
                leader = min(min(leader, most), held_back(state, w, EGO, &mind));
            }
            let mind = (mind.near, mind.believed);
            control::wanted(state, w, EGO, mind, passed, leader)
        };
        control::press(state, w, EGO, wanted);
    });
    outlined!(w.simd, ego::decide(state, w, mind, recorder, step, orders));
    outlined!(w.simd, {
        if w.road.ways.has_oncoming_traffic {
            near_pairs::<S, N, true>(state, w, pairs);
        } else {
            near_pairs::<S, N, false>(state, w, pairs);
        }
    });
}

/// Time, memory, weather and wind of a decision.
fn surroundings<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    step: u32,
) {
    let decision = step / SUBSTEPS;
    outlined!(w.simd, {
        for i in 0..w.count {
            if w.road.lets_overtake(i) {
                state.stage_time[i] += w.c.decision;
            }
            state.since_change[i] += w.c.decision;
            state.wanted_time[i] += w.c.decision;
        }
        leave_road(state, w, step);
    });
    outlined!(w.simd, perception::remember(state, w, decision as usize));
    outlined!(
        w.simd,
        environment::move_random_processes(state, w, decision)
    );
    if w.road.varies_along_road() {
        for i in 0..w.count {
            outlined!(w.simd, {
                environment::course(state, w, i);
                if step == 0 {
                    steering::hold_bend(state, w, i);
                }
            });
        }
    }
    outlined!(w.simd, environment::grip(state, w));
    outlined!(w.simd, environment::wind(state, w));
    for i in 0..w.count {
        outlined!(w.simd, steering::hold_against_wind(state, w, i, step));
    }
    if outlined!(w.simd, w.q.push_accel.simd_ne(0.0).any_true()) {
        outlined!(w.simd, environment::push(state, w, decision));
    }
    grip_again(state, w);
}

/// Work out anew what follows from friction and vehicles, as one of them has changed.
pub fn grip_again<S: Simd, const N: usize>(state: &mut State<'_, S, N>, w: &World<'_, S, N>) {
    outlined!(w.simd, {
        for i in 0..w.count {
            state.reach[i] = steering::reach(state, w, i);
        }
    });
}

/// Steer, move, collide: one step.
#[allow(clippy::too_many_arguments)]
pub fn advance<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    pairs: &Pairs<S>,
    before: &mut (Each<S, N>, Each<S, N>),
    step: u32,
    stride: &Stride,
    wheel: Option<V<S>>,
) {
    // A step on roads that are straight and level is compiled by itself, and pays nothing for bends.
    if w.road.varies_along_road() {
        outlined!(w.simd, {
            go_on::<S, N, true>(state, w, pairs, before, stride, wheel);
        });
    } else {
        outlined!(w.simd, {
            go_on::<S, N, false>(state, w, pairs, before, stride, wheel);
        });
    }
    if !pairs.is_empty() {
        outlined!(w.simd, collide(state, w, pairs, before, step, stride));
    }
}

/// Steer and move.
#[inline(always)]
fn go_on<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    w: &World<'_, S, N>,
    pairs: &Pairs<S>,
    before: &mut (Each<S, N>, Each<S, N>),
    stride: &Stride,
    wheel: Option<V<S>>,
) {
    if !pairs.is_empty() {
        for i in 0..w.count {
            (before.0[i], before.1[i]) = (state.s[i], state.d[i]);
        }
    }
    // Short passes over all vehicles, so that the CPU works on several of them at once.
    let mut angle = [splat(w.simd, 0.0); N];
    let mut first = EGO;
    if let Some(ordered) = wheel {
        angle[EGO] = steering::steer_as_ordered::<S, N, VARIES>(state, w, ordered, stride);
        first += 1;
    }
    for i in first..w.count {
        angle[i] = steering::steer::<S, N, VARIES>(state, w, i, stride);
    }
    let mut motion = [Motion::none(w.simd); N];
    for i in 0..w.count {
        motion[i] = dynamics::accelerate::<S, N, VARIES>(state, w, i, angle[i], stride);
    }
    for i in 0..w.count {
        dynamics::integrate::<S, N, VARIES>(state, w, i, motion[i], stride);
    }
}
