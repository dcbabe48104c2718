//! What happens in a step, and what only at every fifth: a decision; see `overtaking.sim.reference.simulation`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::acceleration;
use crate::acceleration::accel_for_oncoming;
use crate::collisions::{Pairs, pairs_that_may_touch, resolve_contacts, wreck_off_road_vehicles};
use crate::decision_context::{DecisionContext, DriverContext};
use crate::ego_action::EgoAction;
use crate::lane_change;
use crate::math::vectors::{F32, Mask, min, splat, with_cpu_features};
use crate::neighbour_search::{VisibleBody, find_neighbours};
use crate::oncoming::observe_oncoming;
use crate::overtake;
use crate::params::{Params, SUBSTEPS, StepLength};
use crate::pass_continuation::accel_limit_while_passing;
use crate::recorder::Recorder;
use crate::road_conditions;
use crate::state::{EGO_SLOT, PerVehicle, State};
use crate::vehicle_dynamics;
use crate::vehicle_dynamics::MotionStep;
use crate::{perception, steering};

/// Everything that happens 20 times a second: weather, perception, decisions.
///
/// Each part is a function of its own with the features of the CPU switched on; inlining them all into
/// one makes the compiler slow and the code no faster.
pub fn decide<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    minds: &mut DecisionContext<S, N>,
    recorder: &mut Recorder<'_, N>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&EgoAction<S>>,
) {
    perceive(state, params, minds, step, orders.is_some());
    drive_others(state, params, minds, step);
    drive_ego(state, params, minds.of_ego(), recorder, pairs, step, orders);
}

/// What happens before anyone decides: weather, perception.
///
/// Another driver of the ego may decide `any_time`, and its neighbours on both sides are looked for, too,
/// when the model's driver would not look at them.
pub fn perceive<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    minds: &mut DecisionContext<S, N>,
    step: u32,
    any_time: bool,
) {
    let decision = step / SUBSTEPS;
    update_surroundings(state, params, step);
    let DecisionContext {
        bodies,
        neighbours: near,
        beliefs: believed,
        checks_mirrors: looks,
        oncoming: met,
        oncoming_search: traffic,
        gives_way: waits,
        ..
    } = minds;
    let two_way = params.road.directions.has_oncoming_traffic;
    with_cpu_features!(params.simd, {
        for i in 0..params.num_slots_in_use {
            bodies[i] = VisibleBody::new(state, params, i);
        }
        if two_way {
            traffic.update(state, params, bodies);
        }
    });
    for i in 0..params.num_slots_in_use {
        let (near, believed) = (&mut near[i], &mut believed[i]);
        let looks = &mut looks[i];
        let mut everywhere = false;
        with_cpu_features!(params.simd, {
            everywhere = update_gaze(state, params, (i, decision, any_time), looks);
        });
        // The four loops are compiled apart: together they do not have registers enough.
        match (everywhere, two_way) {
            (false, false) => with_cpu_features!(params.simd, {
                find_neighbours::<S, N, 1, false>(state, params, bodies, i, near);
            }),
            (true, false) => with_cpu_features!(params.simd, {
                find_neighbours::<S, N, 3, false>(state, params, bodies, i, near);
            }),
            (false, true) => with_cpu_features!(params.simd, {
                find_neighbours::<S, N, 1, true>(state, params, bodies, i, near);
            }),
            (true, true) => with_cpu_features!(params.simd, {
                find_neighbours::<S, N, 3, true>(state, params, bodies, i, near);
            }),
        }
        if two_way {
            let met = &mut met[i];
            with_cpu_features!(params.simd, {
                let asked = i == EGO_SLOT || (*looks | traffic.overtakes[i]).any_true();
                let seen = (&*bodies, &*traffic);
                observe_oncoming(state, params, seen, near, i, decision as usize, asked, met);
            });
        }
        // Written in place: what a function with other features returns goes through memory twice.
        with_cpu_features!(params.simd, {
            let decision = decision as usize;
            perception::form_beliefs(state, params, bodies, near, i, decision, *looks, believed);
        });
    }
    with_cpu_features!(
        params.simd,
        *waits = lane_change::gives_way(
            state,
            params,
            bodies,
            EGO_SLOT,
            state.lane_choice.wanted_side[EGO_SLOT]
        )
    );
}

/// Where the driver of vehicle `i` looks at a decision; whether in any simulation it is at all lanes.
#[inline(always)]
fn update_gaze<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    (i, decision, any_time): (usize, u32, bool),
    looks: &mut Mask<S>,
) -> bool {
    if decision == 0 {
        let drawn = params.vehicles[i].valid.simd_gt(0.0);
        perception::draw_shoulder_check(state, params, i, drawn, decision);
    }
    *looks = perception::checks_mirrors_now(state, params, i, decision);
    if params.road.directions.has_oncoming_traffic {
        // Who is in the lane of others looks all the time.
        *looks |= state.lane_choice.lane[i].simd_ge(1.0);
    }
    let changing = state.path.elapsed[i].simd_lt(state.path.duration[i]);
    // Who is told or forced to change lanes may do so at any time; what it passes by is recorded.
    let forced = params.simulations.forced_decision.simd_gt(0.0);
    let told = (params.vehicles[EGO_SLOT].gap_demand_factor.simd_le(0.0) | forced).any_true();
    let is_asked = i == EGO_SLOT && (any_time || told);
    is_asked || (*looks | changing).any_true()
}

/// What everybody but the ego decides.
pub fn drive_others<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    minds: &DecisionContext<S, N>,
    step: u32,
) {
    let DecisionContext {
        bodies,
        neighbours: near,
        beliefs: believed,
        checks_mirrors: looks,
        oncoming: met,
        ..
    } = minds;
    let mut leader = [splat(params.simd, 0.0); N];
    for i in 1..params.num_slots_in_use {
        leader[i] = with_cpu_features!(
            params.simd,
            acceleration::accel_behind_leader(
                state,
                params,
                i,
                (&near[i], &believed[i]),
                met[i].is_being_passed
            )
        );
    }
    if params.road.directions.has_oncoming_traffic {
        for i in 1..params.num_slots_in_use {
            with_cpu_features!(params.simd, {
                leader[i] = min(leader[i], accel_for_oncoming(state, params, i, &met[i]));
                leader[i] = min(
                    leader[i],
                    accel_limit_while_passing(state, params, i, &minds.of_other(i)),
                );
            });
        }
    }
    for i in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            let mind = (&near[i], &believed[i]);
            let wanted = acceleration::requested_accel(
                state,
                params,
                i,
                mind,
                met[i].is_being_passed,
                leader[i],
            );
            acceleration::apply_pedals(state, params, i, wanted);
        });
    }
    if params.road.directions.has_oncoming_traffic {
        for i in 1..params.num_slots_in_use {
            let mind = minds.of_other(i);
            with_cpu_features!(
                params.simd,
                overtake::decide_other(state, params, mind, i, step)
            );
        }
        return;
    }
    for i in (1..params.num_slots_in_use).filter(|i| looks[*i].any_true()) {
        with_cpu_features!(params.simd, {
            lane_change::change_lanes_by_mobil(
                state,
                params,
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
    params: &Params<'_, S, N>,
    mind: DriverContext<'_, S>,
    recorder: &mut Recorder<'_, N>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&EgoAction<S>>,
) {
    with_cpu_features!(params.simd, {
        let two_way = params.road.directions.has_oncoming_traffic;
        // The ego flashes under another driver, too.
        let gives_way = if two_way {
            Some(accel_for_oncoming(state, params, EGO_SLOT, mind.oncoming))
        } else {
            None
        };
        let passed = mind.oncoming.is_being_passed;
        // No closure: the compiler would leave it outside, without the features of the CPU.
        let wanted = if let Some(ordered) = orders.and_then(EgoAction::requested_accel) {
            ordered
        } else {
            let mut leader = acceleration::accel_behind_leader(
                state,
                params,
                EGO_SLOT,
                (mind.neighbours, mind.beliefs),
                passed,
            );
            if let Some(most) = gives_way {
                leader = min(
                    min(leader, most),
                    accel_limit_while_passing(state, params, EGO_SLOT, &mind),
                );
            }
            let mind = (mind.neighbours, mind.beliefs);
            acceleration::requested_accel(state, params, EGO_SLOT, mind, passed, leader)
        };
        acceleration::apply_pedals(state, params, EGO_SLOT, wanted);
    });
    with_cpu_features!(
        params.simd,
        overtake::decide_ego(state, params, mind, recorder, step, orders)
    );
    with_cpu_features!(params.simd, {
        if params.road.directions.has_oncoming_traffic {
            pairs_that_may_touch::<S, N, true>(state, params, pairs);
        } else {
            pairs_that_may_touch::<S, N, false>(state, params, pairs);
        }
    });
}

/// Time, memory, weather and wind of a decision.
fn update_surroundings<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    step: u32,
) {
    let decision = step / SUBSTEPS;
    with_cpu_features!(params.simd, {
        for i in 0..params.num_slots_in_use {
            if params.road.can_overtake(i) {
                state.overtake.time_in_stage[i] += params.constants.decision;
            }
            state.lane_choice.time_since_lane_change[i] += params.constants.decision;
            state.lane_choice.time_wanted[i] += params.constants.decision;
        }
        wreck_off_road_vehicles(state, params, step);
    });
    with_cpu_features!(
        params.simd,
        perception::record_history(state, params, decision as usize)
    );
    with_cpu_features!(
        params.simd,
        road_conditions::update_random_processes(state, params, decision)
    );
    if params.road.varies_along_road() {
        for i in 0..params.num_slots_in_use {
            with_cpu_features!(params.simd, {
                road_conditions::update_road_course(state, params, i);
                if step == 0 {
                    steering::settle_into_bend(state, params, i);
                }
            });
        }
    }
    with_cpu_features!(params.simd, road_conditions::update_friction(state, params));
    with_cpu_features!(params.simd, road_conditions::update_wind(state, params));
    for i in 0..params.num_slots_in_use {
        with_cpu_features!(
            params.simd,
            steering::update_wind_trim(state, params, i, step)
        );
    }
    if with_cpu_features!(
        params.simd,
        params.simulations.push_accel.simd_ne(0.0).any_true()
    ) {
        with_cpu_features!(
            params.simd,
            road_conditions::apply_study_push(state, params, decision)
        );
    }
    update_slip_reach(state, params);
}

/// Work out anew what follows from friction and vehicles, as one of them has changed.
pub fn update_slip_reach<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
) {
    with_cpu_features!(params.simd, {
        for i in 0..params.num_slots_in_use {
            state.controls.slip_reach[i] = steering::slip_reach(state, params, i);
        }
    });
}

/// Steer, move, collide: one step.
#[allow(clippy::too_many_arguments)]
pub fn advance<S: Simd, const N: usize>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    pairs: &Pairs<S>,
    before: &mut (PerVehicle<S, N>, PerVehicle<S, N>),
    step: u32,
    stride: &StepLength,
    wheel: Option<F32<S>>,
) {
    // A step on roads that are straight and level is compiled by itself, and pays nothing for bends.
    if params.road.varies_along_road() {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, true>(state, params, pairs, before, stride, wheel);
        });
    } else {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, false>(state, params, pairs, before, stride, wheel);
        });
    }
    if !pairs.is_empty() {
        with_cpu_features!(
            params.simd,
            resolve_contacts(state, params, pairs, before, step, stride)
        );
    }
}

/// Steer and move.
#[inline(always)]
fn steer_and_move<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<'_, S, N>,
    params: &Params<'_, S, N>,
    pairs: &Pairs<S>,
    before: &mut (PerVehicle<S, N>, PerVehicle<S, N>),
    stride: &StepLength,
    wheel: Option<F32<S>>,
) {
    if !pairs.is_empty() {
        for i in 0..params.num_slots_in_use {
            (before.0[i], before.1[i]) = (state.motion.s[i], state.motion.d[i]);
        }
    }
    // Short passes over all vehicles, so that the CPU works on several of them at once.
    let mut angle = [splat(params.simd, 0.0); N];
    let mut first = EGO_SLOT;
    if let Some(ordered) = wheel {
        angle[EGO_SLOT] = steering::steer_to_angle::<S, N, VARIES>(state, params, ordered, stride);
        first += 1;
    }
    for i in first..params.num_slots_in_use {
        angle[i] = steering::steer::<S, N, VARIES>(state, params, i, stride);
    }
    let mut motion = [MotionStep::none(params.simd); N];
    for i in 0..params.num_slots_in_use {
        motion[i] =
            vehicle_dynamics::compute_step::<S, N, VARIES>(state, params, i, angle[i], stride);
    }
    for i in 0..params.num_slots_in_use {
        vehicle_dynamics::update_position::<S, N, VARIES>(state, params, i, motion[i], stride);
    }
}
