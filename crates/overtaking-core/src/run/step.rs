//! One step of a block of simulations: decisions of all drivers every 50 ms, motion every 10 or 50 ms.
//!
//! `overtaking.sim.reference.simulation` has the same order of operations in Python. Slot `i` is the number of a
//! vehicle in its simulation; the ego, the vehicle under study, is in `EGO_SLOT`, slot 0. Each vector has one number
//! for each of the sixteen simulations. `with_cpu_features!` compiles its body as a function of its own with the SIMD
//! features of the CPU.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::acceleration;
use crate::acceleration::accel_for_oncoming;
use crate::collisions::{
    Pairs, SweptStep, pairs_that_may_touch, resolve_contacts, wreck_off_road_vehicles,
};
use crate::decision_context::{DecisionContext, DriverContext, RoadPositions};
use crate::ego_action::EgoAction;
use crate::lane_change;
use crate::math::vectors::{F32, min, splat, with_cpu_features};
use crate::neighbour_search::{SearchedNeighbours, VisibleBody};
use crate::oncoming::observe_oncoming;
use crate::overtake::{self, EgoDecision};
use crate::params::{Params, SUBSTEPS, StepLength};
use crate::recorder::Recorder;
use crate::road_conditions;
use crate::state::{EGO_SLOT, State};
use crate::vehicle_dynamics;
use crate::vehicle_dynamics::MotionStep;
use crate::{perception, steering};

/// Compute one decision, 20 times a second: weather, perception, then the choices of all drivers.
///
/// `orders` are the actions of an external driver of the ego, `None` if the model drives. Each part is compiled as a
/// separate function: inlining all parts into one makes compilation slow and the code no faster.
pub fn decide<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &mut DecisionContext<S, N>,
    recorder: Option<&mut Recorder<'_, N>>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&EgoAction<S>>,
) {
    perceive(state, params, context, step, orders.is_some());
    drive_others(state, params, context);
    let driver = &context.drivers[EGO_SLOT];
    drive_ego(state, params, driver, recorder, pairs, step, orders);
}

/// Update weather and friction, then find the neighbours and the beliefs of every driver.
///
/// With `ego_may_change_any_time`, an external driver decides for the ego. The ego's neighbours in the adjacent lanes
/// are then found at every decision, not only when the driver of the model would look at them.
pub fn perceive<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &mut DecisionContext<S, N>,
    step: u32,
    ego_may_change_any_time: bool,
) {
    let decision = step / SUBSTEPS;
    update_surroundings(state, params, step);
    let DecisionContext {
        drivers,
        bodies,
        oncoming_search,
        ..
    } = context;
    let two_way = params.road.directions.has_oncoming_traffic;
    with_cpu_features!(params.simd, {
        for i in 0..params.num_slots_in_use {
            bodies[i] = VisibleBody::new(state.vehicle(params, i));
        }
        if two_way {
            oncoming_search.update(state, params, bodies);
        }
    });
    for i in 0..params.num_slots_in_use {
        let driver = &mut drivers[i];
        driver.decision_index = decision;
        let mut searched = SearchedNeighbours::Leader;
        with_cpu_features!(params.simd, {
            searched = update_gaze(state, params, i, driver, ego_may_change_any_time);
        });
        let neighbours = &mut driver.neighbours;
        // The variants are compiled separately: a common loop would need more registers than the CPU has.
        match (searched, two_way) {
            (SearchedNeighbours::Leader, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, i)
                    .find_neighbours::<1, false, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::Leaders, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, i)
                    .find_neighbours::<3, false, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::All, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, i)
                    .find_neighbours::<3, true, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::Leader, true) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, i)
                    .find_neighbours::<1, false, true>(bodies, neighbours);
            }),
            // `update_gaze` never returns `Leaders` on a two-way road; it shares this arm to save compiled code.
            (SearchedNeighbours::Leaders | SearchedNeighbours::All, true) => {
                with_cpu_features!(params.simd, {
                    state
                        .vehicle(params, i)
                        .find_neighbours::<3, true, true>(bodies, neighbours);
                })
            }
        }
        if two_way {
            with_cpu_features!(params.simd, {
                // Other drivers need beliefs about oncoming vehicles only when they look, or while they overtake.
                let needs_beliefs = i == EGO_SLOT
                    || (driver.checks_mirrors | oncoming_search.overtakes[i]).any_true();
                let traffic = (&*bodies, &*oncoming_search);
                observe_oncoming(state, params, i, traffic, (driver, needs_beliefs));
            });
        }
        // The function writes the beliefs in place: a value that is returned from a function with other CPU features
        // passes through memory twice.
        with_cpu_features!(params.simd, {
            perception::form_beliefs(state, params, i, bodies, driver);
        });
    }
    with_cpu_features!(
        params.simd,
        drivers[EGO_SLOT].gives_way = state
            .vehicle(params, EGO_SLOT)
            .gives_way(bodies, state.lane_choice.wanted_side[EGO_SLOT])
    );
}

/// Update `checks_mirrors` of driver `i`: whether it looks at the adjacent lanes at this decision.
///
/// Returns the neighbours that are needed in any simulation of the block: all where the driver looks at the adjacent
/// lanes, and the leaders there while it changes lanes without a look, because it watches only these.
#[inline(always)]
fn update_gaze<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    i: usize,
    driver: &mut DriverContext<S>,
    ego_may_change_any_time: bool,
) -> SearchedNeighbours {
    let decision = driver.decision_index;
    if decision == 0 {
        let exists = params.vehicles[i].valid.simd_gt(0.0);
        perception::draw_shoulder_check(state, params, i, exists, decision);
    }
    let mut checks_mirrors = state.vehicle(params, i).checks_mirrors_now(decision);
    if params.road.directions.has_oncoming_traffic {
        // A driver in the opposing lane looks at every decision.
        checks_mirrors |= state.lane_choice.lane[i].simd_ge(1.0);
    }
    driver.checks_mirrors = checks_mirrors;
    let is_changing_lane = state.path.elapsed[i].simd_lt(state.path.duration[i]);
    // An ego with a forced decision, or one that accepts every gap, may change lanes at any decision, and the recorder
    // then needs the vehicles of the lane that it enters.
    let is_forced = params.simulations.forced_decision.simd_gt(0.0);
    let accepts_every_gap = params.vehicles[EGO_SLOT].gap_demand_factor.simd_le(0.0);
    let may_change_any_time =
        i == EGO_SLOT && (ego_may_change_any_time || (accepts_every_gap | is_forced).any_true());
    if may_change_any_time || checks_mirrors.any_true() {
        SearchedNeighbours::All
    } else if !is_changing_lane.any_true() {
        SearchedNeighbours::Leader
    } else if i == EGO_SLOT || params.road.directions.has_oncoming_traffic {
        // The recorder writes down all neighbours of an ego that changes lanes. On two-way roads every driver decides
        // through the stages of the ego's model, which read the followers at any decision of a pass.
        SearchedNeighbours::All
    } else {
        SearchedNeighbours::Leaders
    }
}

/// Decide for all drivers but the ego: acceleration first, then lane changes or overtakes.
///
/// On a road with oncoming traffic, other drivers overtake through the stages of the ego's model. On a road of one
/// direction they change lanes by MOBIL, a lane-change model that compares accelerations.
pub fn drive_others<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &DecisionContext<S, N>,
) {
    let DecisionContext {
        drivers, bodies, ..
    } = context;
    // Short loops over all vehicles, so that the CPU works on several vehicles at once.
    let mut accel_limit = [splat(params.simd, 0.0); N];
    for i in 1..params.num_slots_in_use {
        accel_limit[i] = with_cpu_features!(
            params.simd,
            state.vehicle(params, i).accel_behind_leader(&drivers[i])
        );
    }
    if params.road.directions.has_oncoming_traffic {
        for i in 1..params.num_slots_in_use {
            with_cpu_features!(params.simd, {
                accel_limit[i] = min(
                    accel_limit[i],
                    accel_for_oncoming(state, params, i, &drivers[i].oncoming),
                );
                accel_limit[i] = min(
                    accel_limit[i],
                    state
                        .vehicle(params, i)
                        .accel_limit_while_passing(&drivers[i]),
                );
            });
        }
    }
    for i in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            let requested = state
                .vehicle(params, i)
                .requested_accel(&drivers[i], accel_limit[i]);
            acceleration::apply_pedals(state, params, i, requested);
        });
    }
    if params.road.directions.has_oncoming_traffic {
        for i in 1..params.num_slots_in_use {
            with_cpu_features!(
                params.simd,
                overtake::decide_other(state, params, i, &drivers[i])
            );
        }
        return;
    }
    for i in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            // Asked in here: outside, `any_true` would be compiled without the SIMD features of the CPU.
            if drivers[i].checks_mirrors.any_true() {
                lane_change::change_lanes_by_mobil(
                    state,
                    params,
                    i,
                    (bodies, &drivers[i]),
                    accel_limit[i],
                );
            }
        });
    }
}

/// Decide for the ego, then find the pairs of vehicles that may collide before the next decision.
///
/// `orders` are the actions of an external driver, `None` if the model drives the ego. Orders without an acceleration
/// leave the pedals to the model.
pub fn drive_ego<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    driver: &DriverContext<S>,
    recorder: Option<&mut Recorder<'_, N>>,
    pairs: &mut Pairs<S>,
    step: u32,
    orders: Option<&EgoAction<S>>,
) {
    with_cpu_features!(params.simd, {
        let two_way = params.road.directions.has_oncoming_traffic;
        // Computed under an external driver, too, because the function also switches the ego's headlamp flash.
        let oncoming_limit = if two_way {
            Some(accel_for_oncoming(
                state,
                params,
                EGO_SLOT,
                &driver.oncoming,
            ))
        } else {
            None
        };
        // No closure here: the compiler may compile it as a separate function without the features of the CPU.
        let requested = if let Some(ordered) = orders.and_then(EgoAction::requested_accel) {
            ordered
        } else {
            let mut accel_limit = state.vehicle(params, EGO_SLOT).accel_behind_leader(driver);
            if let Some(oncoming_limit) = oncoming_limit {
                accel_limit = min(
                    min(accel_limit, oncoming_limit),
                    state
                        .vehicle(params, EGO_SLOT)
                        .accel_limit_while_passing(driver),
                );
            }
            state
                .vehicle(params, EGO_SLOT)
                .requested_accel(driver, accel_limit)
        };
        acceleration::apply_pedals(state, params, EGO_SLOT, requested);
    });
    let decision = EgoDecision {
        step,
        action: orders,
    };
    with_cpu_features!(
        params.simd,
        overtake::decide_ego(state, params, driver, recorder, &decision)
    );
    with_cpu_features!(params.simd, {
        if params.road.directions.has_oncoming_traffic {
            pairs_that_may_touch::<S, N, true>(state, params, pairs);
        } else {
            pairs_that_may_touch::<S, N, false>(state, params, pairs);
        }
    });
}

/// Update timers, remembered states, wrecks, gusts, friction and wind before the drivers decide.
fn update_surroundings<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
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
        perception::record_history(state, params, decision)
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

/// Update how far each driver may turn the front wheels: it depends on friction and on the parameters of the vehicle.
pub fn update_slip_reach<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    with_cpu_features!(params.simd, {
        for i in 0..params.num_slots_in_use {
            state.controls.slip_reach[i] = state.vehicle(params, i).slip_reach();
        }
    });
}

/// Steer and move all vehicles for one step, then resolve collisions between `pairs`.
///
/// `stride` is the length of the step, 10 or 50 ms. `wheel` is the angle of the ego's front wheels [rad] that an
/// external driver ordered, `None` if the model steers. `positions` is memory for `s` and `d` before the step.
#[allow(clippy::too_many_arguments)]
pub fn advance<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pairs: &Pairs<S>,
    positions: &mut RoadPositions<S, N>,
    step: u32,
    stride: &StepLength,
    wheel: Option<F32<S>>,
) {
    // Straight, level roads have a variant of their own, which computes no bends and slopes.
    if params.road.varies_along_road() {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, true>(state, params, pairs, positions, stride, wheel);
        });
    } else {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, false>(state, params, pairs, positions, stride, wheel);
        });
    }
    if !pairs.is_empty() {
        with_cpu_features!(
            params.simd,
            resolve_contacts(
                state,
                params,
                pairs,
                &SweptStep {
                    index: step,
                    length: stride.length,
                    start: positions,
                },
            )
        );
    }
}

/// Steer and move all vehicles for one step. `VARIES` is whether the road bends, rises or has several speed limits.
#[inline(always)]
fn steer_and_move<S: Simd, const N: usize, const VARIES: bool>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pairs: &Pairs<S>,
    positions: &mut RoadPositions<S, N>,
    stride: &StepLength,
    wheel: Option<F32<S>>,
) {
    if !pairs.is_empty() {
        // A collision is found between the positions before and after the step.
        for i in 0..params.num_slots_in_use {
            (positions.s[i], positions.d[i]) = (state.motion.s[i], state.motion.d[i]);
        }
    }
    // Short loops over all vehicles, so that the CPU works on several vehicles at once.
    let mut angle = [splat(params.simd, 0.0); N];
    let mut first_slot = EGO_SLOT;
    if let Some(ordered) = wheel {
        angle[EGO_SLOT] = steering::steer_to_angle::<S, N, VARIES>(state, params, ordered, stride);
        first_slot += 1;
    }
    for i in first_slot..params.num_slots_in_use {
        angle[i] = steering::steer::<S, N, VARIES>(state, params, i, stride);
    }
    let mut motion = [MotionStep::standstill(params.simd); N];
    for i in 0..params.num_slots_in_use {
        motion[i] =
            vehicle_dynamics::compute_step::<S, N, VARIES>(state, params, i, angle[i], stride);
    }
    for i in 0..params.num_slots_in_use {
        vehicle_dynamics::update_position::<S, N, VARIES>(state, params, i, motion[i], stride);
    }
}
