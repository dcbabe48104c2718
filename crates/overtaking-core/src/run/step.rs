//! One step of a block of simulations: decisions of all drivers every 50 ms, motion every 10 or 50 ms.
//!
//! `overtaking.sim.reference.simulation` has the same order of operations in Python. A *slot* is the number of a
//! vehicle in its simulation; the ego, the vehicle under study, is in `EGO_SLOT`, slot 0. Each vector has one number
//! for each of the sixteen simulations, which may differ in their vehicles, but not in their road.
//! `with_cpu_features!` compiles its body as a separate function for the SIMD features of the CPU; an operation on
//! vectors outside such a body is a call.

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
/// Each part is compiled as a separate function: inlining all parts into one makes compilation slow and the code no
/// faster.
pub fn decide<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &mut DecisionContext<S, N>,
    recorder: Option<&mut Recorder<'_, N>>,
    ego_decision: &EgoDecision<'_, S>,
) {
    let has_external_driver = ego_decision.action.is_some();
    perceive(
        state,
        params,
        context,
        ego_decision.step,
        has_external_driver,
    );
    drive_others(state, params, context);
    let ego = &context.drivers[EGO_SLOT];
    drive_ego(state, params, ego, recorder, ego_decision);
}

/// Update weather and friction, then find the neighbours and the beliefs of every driver.
///
/// `ego_may_change_lanes` is true if an external driver decides for the ego. The ego's neighbours in the adjacent lanes
/// are then found at every decision, not only when the driver of the model would look at them.
pub fn perceive<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &mut DecisionContext<S, N>,
    step: u32,
    ego_may_change_lanes: bool,
) {
    update_surroundings(state, params, step);
    let DecisionContext {
        drivers,
        bodies,
        oncoming_search,
        ..
    } = context;
    let has_oncoming_traffic = params.road.directions.has_oncoming_traffic;
    with_cpu_features!(params.simd, {
        for slot in 0..params.num_slots_in_use {
            bodies[slot] = VisibleBody::new(state.vehicle(params, slot));
        }
        if has_oncoming_traffic {
            oncoming_search.update(state, params, bodies);
        }
    });
    for slot in 0..params.num_slots_in_use {
        let driver = &mut drivers[slot];
        driver.decision_index = step / SUBSTEPS;
        let mut searched = SearchedNeighbours::Leader;
        with_cpu_features!(params.simd, {
            searched = update_gaze(state, params, slot, driver, ego_may_change_lanes);
        });
        let neighbours = &mut driver.neighbours;
        // The constants are the number of lanes, whether followers are found, and whether traffic is oncoming. The
        // variants are compiled separately: a common loop would need more registers than the CPU has.
        match (searched, has_oncoming_traffic) {
            (SearchedNeighbours::Leader, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, slot)
                    .find_neighbours::<1, false, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::Leaders, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, slot)
                    .find_neighbours::<3, false, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::All, false) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, slot)
                    .find_neighbours::<3, true, false>(bodies, neighbours);
            }),
            (SearchedNeighbours::Leader, true) => with_cpu_features!(params.simd, {
                state
                    .vehicle(params, slot)
                    .find_neighbours::<1, false, true>(bodies, neighbours);
            }),
            // `update_gaze` never returns `Leaders` on a two-way road; it shares this arm to save compiled code.
            (SearchedNeighbours::Leaders | SearchedNeighbours::All, true) => {
                with_cpu_features!(params.simd, {
                    state
                        .vehicle(params, slot)
                        .find_neighbours::<3, true, true>(bodies, neighbours);
                })
            }
        }
        if has_oncoming_traffic {
            with_cpu_features!(
                params.simd,
                observe_oncoming(state, params, bodies, oncoming_search, driver)
            );
        }
        // The function writes the beliefs in place: a value that is returned from a function with other CPU features
        // passes through memory twice.
        with_cpu_features!(params.simd, {
            perception::form_beliefs(state, params, slot, bodies, driver);
        });
    }
    with_cpu_features!(
        params.simd,
        drivers[EGO_SLOT].gives_way = state
            .vehicle(params, EGO_SLOT)
            .gives_way(bodies, state.lane_choice.wanted_side[EGO_SLOT])
    );
}

/// Update `checks_mirrors` of the driver in `slot`: whether it looks at the adjacent lanes at this decision.
///
/// Returns the neighbours that are needed in any simulation of the block: all if the driver looks at the adjacent
/// lanes, and only the leaders of all three lanes if it is changing lanes without a look, because it then watches only
/// these.
#[inline(always)]
fn update_gaze<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    slot: usize,
    driver: &mut DriverContext<S>,
    ego_may_change_lanes: bool,
) -> SearchedNeighbours {
    let decision_index = driver.decision_index;
    if decision_index == 0 {
        let exists = params.vehicles[slot].valid.simd_gt(0.0);
        perception::draw_shoulder_check(state, params, slot, exists, decision_index);
    }
    let mut checks_mirrors = state
        .vehicle(params, slot)
        .checks_mirrors_now(decision_index);
    if params.road.directions.has_oncoming_traffic {
        // A driver in lane 1, the opposing lane, looks at every decision.
        checks_mirrors |= state.lane_choice.lane[slot].simd_ge(1.0);
    }
    driver.checks_mirrors = checks_mirrors;
    let is_changing_lane = state.path.elapsed[slot].simd_lt(state.path.duration[slot]);
    // An ego whose decision a what-if branch forces, or one that accepts every gap (a script), may change lanes at any
    // decision, and the recorder then needs the vehicles of the lane that it enters.
    let is_forced = params.simulations.forced_decision.simd_gt(0.0);
    let accepts_every_gap = params.vehicles[EGO_SLOT].gap_demand_factor.simd_le(0.0);
    let may_change_lanes =
        slot == EGO_SLOT && (ego_may_change_lanes || (accepts_every_gap | is_forced).any_true());
    if may_change_lanes || checks_mirrors.any_true() {
        SearchedNeighbours::All
    } else if !is_changing_lane.any_true() {
        SearchedNeighbours::Leader
    } else if slot == EGO_SLOT || params.road.directions.has_oncoming_traffic {
        // The recorder records all neighbours of an ego that changes lanes. On two-way roads every driver decides
        // through the stages of the ego's model, which read the followers at any decision of a pass.
        SearchedNeighbours::All
    } else {
        SearchedNeighbours::Leaders
    }
}

/// Decide for all drivers but the ego: accelerations, then lane changes or overtakes.
///
/// Accelerations come first, because `context` has the neighbours in the lanes before any lane change.
///
/// On a road with oncoming traffic, other drivers overtake through the stages of the ego's model. On a road of one
/// direction they change lanes by MOBIL, a lane-change model that compares accelerations.
pub fn drive_others<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    context: &mut DecisionContext<S, N>,
) {
    let DecisionContext {
        drivers,
        bodies,
        accel_limit,
        ..
    } = context;
    // Short loops over all vehicles, so that the CPU works on several vehicles at once.
    for slot in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            accel_limit[slot] = state
                .vehicle(params, slot)
                .accel_behind_leader(&drivers[slot]);
        });
    }
    if params.road.directions.has_oncoming_traffic {
        for slot in 1..params.num_slots_in_use {
            with_cpu_features!(params.simd, {
                accel_limit[slot] = min(
                    accel_limit[slot],
                    accel_for_oncoming(state, params, slot, &drivers[slot].oncoming),
                );
                accel_limit[slot] = min(
                    accel_limit[slot],
                    state
                        .vehicle(params, slot)
                        .accel_limit_while_passing(&drivers[slot]),
                );
            });
        }
    }
    for slot in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            let target_accel = state
                .vehicle(params, slot)
                .target_accel(&drivers[slot], accel_limit[slot]);
            acceleration::apply_pedals(state, params, slot, target_accel);
        });
    }
    if params.road.directions.has_oncoming_traffic {
        for slot in 1..params.num_slots_in_use {
            with_cpu_features!(
                params.simd,
                overtake::decide_other(state, params, slot, &drivers[slot])
            );
        }
        return;
    }
    for slot in 1..params.num_slots_in_use {
        with_cpu_features!(params.simd, {
            // The test is inside the macro: outside, `any_true` would be compiled without the SIMD features of the CPU.
            if drivers[slot].checks_mirrors.any_true() {
                lane_change::change_lanes_by_mobil(
                    state,
                    params,
                    bodies,
                    &drivers[slot],
                    accel_limit[slot],
                );
            }
        });
    }
}

/// Decide for the ego, or carry out the action of an external driver.
///
/// An action without an acceleration leaves the pedals to the model. `ego` is the context of the ego's driver.
pub fn drive_ego<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    ego: &DriverContext<S>,
    recorder: Option<&mut Recorder<'_, N>>,
    decision: &EgoDecision<'_, S>,
) {
    with_cpu_features!(params.simd, {
        // Also computed for an external driver, because the function switches the ego's headlamp flash.
        let oncoming_limit = if params.road.directions.has_oncoming_traffic {
            Some(accel_for_oncoming(state, params, EGO_SLOT, &ego.oncoming))
        } else {
            None
        };
        // No closure here: the compiler may compile it as a separate function without the features of the CPU.
        let target_accel = if let Some(accel) = decision.action.and_then(EgoAction::requested_accel)
        {
            accel
        } else {
            let mut accel_limit = state.vehicle(params, EGO_SLOT).accel_behind_leader(ego);
            if let Some(oncoming_limit) = oncoming_limit {
                accel_limit = min(
                    min(accel_limit, oncoming_limit),
                    state
                        .vehicle(params, EGO_SLOT)
                        .accel_limit_while_passing(ego),
                );
            }
            state
                .vehicle(params, EGO_SLOT)
                .target_accel(ego, accel_limit)
        };
        acceleration::apply_pedals(state, params, EGO_SLOT, target_accel);
    });
    with_cpu_features!(
        params.simd,
        overtake::decide_ego(state, params, ego, recorder, decision)
    );
}

/// Find the pairs of vehicles that may touch before the next decision; `advance` looks for contacts of these pairs
/// only.
pub fn find_near_pairs<S: Simd, const N: usize>(
    state: &State<S, N>,
    params: &Params<S, N>,
    pairs: &mut Pairs<S>,
) {
    with_cpu_features!(params.simd, {
        if params.road.directions.has_oncoming_traffic {
            pairs_that_may_touch::<S, N, true>(state, params, pairs);
        } else {
            pairs_that_may_touch::<S, N, false>(state, params, pairs);
        }
    });
}

/// Update timers, wrecks, history, noise, road, friction and wind before perception.
fn update_surroundings<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    step: u32,
) {
    let decision_index = step / SUBSTEPS;
    with_cpu_features!(params.simd, {
        for slot in 0..params.num_slots_in_use {
            // On one-way roads only the ego goes through the stages of an overtake.
            if params.road.can_overtake(slot) {
                state.overtake.time_in_stage[slot] += params.constants.decision;
            }
            state.lane_choice.time_since_lane_change[slot] += params.constants.decision;
            state.lane_choice.time_wanted[slot] += params.constants.decision;
        }
        wreck_off_road_vehicles(state, params, step);
    });
    with_cpu_features!(
        params.simd,
        perception::record_history(state, params, decision_index)
    );
    with_cpu_features!(
        params.simd,
        road_conditions::update_random_processes(state, params, decision_index)
    );
    if params.road.varies_along_road() {
        for slot in 0..params.num_slots_in_use {
            with_cpu_features!(params.simd, {
                road_conditions::update_road_course(state, params, slot);
                if step == 0 {
                    steering::settle_into_bend(state, params, slot);
                }
            });
        }
    }
    with_cpu_features!(params.simd, road_conditions::update_friction(state, params));
    with_cpu_features!(params.simd, road_conditions::update_wind(state, params));
    for slot in 0..params.num_slots_in_use {
        with_cpu_features!(
            params.simd,
            steering::update_wind_trim(state, params, slot, step)
        );
    }
    // The pushes of the study by Pinto et al. (2023), a sideways force. They come after `update_wind_trim`, because
    // drivers do not foresee them.
    if with_cpu_features!(
        params.simd,
        params.simulations.push_accel.simd_ne(0.0).any_true()
    ) {
        with_cpu_features!(
            params.simd,
            road_conditions::apply_study_push(state, params, decision_index)
        );
    }
    update_slip_reach(state, params);
}

/// Update `slip_reach`, the largest slip angle of the front wheels that drivers request: a larger one gives hardly more
/// side force. It depends on friction and on parameters of the vehicle.
pub fn update_slip_reach<S: Simd, const N: usize>(state: &mut State<S, N>, params: &Params<S, N>) {
    with_cpu_features!(params.simd, {
        for slot in 0..params.num_slots_in_use {
            state.controls.slip_reach[slot] = state.vehicle(params, slot).slip_reach();
        }
    });
}

/// An integration step of the motion, 10 or 50 ms long.
pub struct IntegrationStep<'a, S: Simd> {
    /// Index of its first step of 10 ms.
    pub index: u32,
    /// Its length, 10 or 50 ms, and numbers derived from it.
    pub length: &'a StepLength,
    /// Angle of the ego's front wheels that an external driver requests [rad]; `None` if the model steers.
    pub wheel_angle: Option<F32<S>>,
}

/// Steer and move all vehicles for one step, then resolve collisions between `pairs`.
///
/// `step_start` is memory for the positions before the step.
pub fn advance<S: Simd, const N: usize>(
    state: &mut State<S, N>,
    params: &Params<S, N>,
    pairs: &Pairs<S>,
    step_start: &mut RoadPositions<S, N>,
    step: &IntegrationStep<'_, S>,
) {
    if !pairs.is_empty() {
        // `resolve_contacts` finds contacts between the positions before and after the step.
        with_cpu_features!(params.simd, {
            for slot in 0..params.num_slots_in_use {
                step_start.s[slot] = state.motion.s[slot];
                step_start.d[slot] = state.motion.d[slot];
            }
        });
    }
    // Straight, level roads have a variant of their own, which computes no bends and slopes.
    if params.road.varies_along_road() {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, true>(state, params, step);
        });
    } else {
        with_cpu_features!(params.simd, {
            steer_and_move::<S, N, false>(state, params, step);
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
                    index: step.index,
                    length: step.length.length,
                    start: step_start,
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
    step: &IntegrationStep<'_, S>,
) {
    let step_length = step.length;
    // Short loops over all vehicles, so that the CPU works on several vehicles at once.
    let mut wheel_angle = [splat(params.simd, 0.0); N];
    let mut first_slot = EGO_SLOT;
    if let Some(requested) = step.wheel_angle {
        wheel_angle[EGO_SLOT] =
            steering::steer_to_angle::<S, N, VARIES>(state, params, requested, step_length);
        first_slot += 1;
    }
    for slot in first_slot..params.num_slots_in_use {
        wheel_angle[slot] = steering::steer::<S, N, VARIES>(state, params, slot, step_length);
    }
    let mut motion = [MotionStep::standstill(params.simd); N];
    for slot in 0..params.num_slots_in_use {
        let angle = wheel_angle[slot];
        motion[slot] =
            vehicle_dynamics::compute_step::<S, N, VARIES>(state, params, slot, angle, step_length);
    }
    for slot in 0..params.num_slots_in_use {
        let vehicle_motion = motion[slot];
        vehicle_dynamics::update_position::<S, N, VARIES>(
            state,
            params,
            slot,
            vehicle_motion,
            step_length,
        );
    }
}
