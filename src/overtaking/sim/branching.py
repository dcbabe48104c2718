"""Branches: the same simulations with weather, drivers or vehicles changed from a frame on.

A branch draws the same random numbers as its source. So it equals the source up to the first
change, and each later difference is an effect of the changes. A batch holds simulations that run
together, a slot is the number of a vehicle in its simulation, a frame is a recorded instant.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, U64, Mask
from overtaking.core.errors import ConfigError
from overtaking.model.batch import batch_fields
from overtaking.model.checks import check_batch
from overtaking.model.scenario import BranchOrigin, ForcedDecision, Intervention, Scenario
from overtaking.model.trajectories import STATE_DTYPES, States, Trajectories
from overtaking.model.vehicles import EGO_SLOT, DriverTraits
from overtaking.model.weather import Weather
from overtaking.sim import engine
from overtaking.world.step_parameters import ParameterSwitch, step_parameters, with_forced_decision

__all__ = [
    "ForcedDecision",
    "ScenarioVersion",
    "Simulate",
    "apply_intervention",
    "branch",
    "simulate_versions",
    "versions_by_frame",
    "with_final_conditions",
]


Simulate = Callable[..., Trajectories]
"""A simulator: `engine.run` or `reference.run`."""


_REMOVED_S = np.float32(-30_000.0)
"""Station of removed vehicles, far before the start of the road [m]. Chosen.

A removed vehicle keeps its slot, because random numbers are drawn by slot. It also keeps its flag
`valid` (the slot holds a vehicle): the engine writes sixteen frames of a vehicle at a time, if the
flag holds at the last of them. A change in between would lose the earlier ones.
"""


_REMOVED_SPACING = np.float32(1_000.0)
"""Distance between removed vehicles in successive slots, so that they do not meet [m]. Chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioVersion:
    """The scenarios of a batch as they are from a frame on.

    Attributes:
        frame: First frame at which this version holds.
        scenario: Weather, drivers and vehicle bodies from this frame on. If `start_s` differs from
            the previous version, the vehicle is displaced by the difference at this frame; a
            difference in `start_speed` changes the speed by as much.
        decision: Decision forced on every ego, such as STAY (no overtake); FREE forces none.
        scenario_index: Indices from which all random numbers are drawn from this frame on, shape
            (simulation,); None for the indices of the scenario.
        judgement_errors: New errors of the ego in judging distances and closing speeds, in standard
            deviations, shape (2, simulation); None keeps the present errors. None at frame 0.
    """

    frame: int
    scenario: Scenario
    decision: ForcedDecision = ForcedDecision.FREE
    scenario_index: U64 | None = None
    judgement_errors: F32 | None = None


def branch(
    source: Scenario | Trajectories,
    frame: int = 0,
    *,
    decision: ForcedDecision | None = None,
    weather: Weather | None = None,
    interventions: Iterable[Intervention] = (),
    run: Simulate = engine.run,
) -> Trajectories:
    """Simulate a batch again with interventions.

    The frames before the first intervention are simulated as well, because a recording holds only a
    part of the state. Without any change the trace hash (of all recorded values) equals the trace
    hash of the source.

    Args:
        source: A batch of scenarios, or a branch, whose interventions then stay in force.
        frame: First frame that `decision` and `weather` can affect, from 0 to the last frame before
            the horizon, the end of the simulated time.
        decision: Decision forced on every ego.
        weather: Weather of every simulation from this frame on, shape (simulation,) or (1,).
        interventions: Further interventions, each with its own frame.
        run: `engine.run` or `reference.run`.

    Returns:
        The recordings, with the interventions in `branch_origin`.

    Raises:
        ConfigError: A number is out of its range, a frame, vehicle, trait or weather factor does
            not exist, the ego is to be removed, or the source was driven by an external driver.
    """
    origin, interventions = _origin_of(source), tuple(interventions)
    # `frame` is left out here: `simulate_versions` knows the last frame and checks it.
    for intervention in (Intervention(weather=weather), *interventions):
        check_batch(intervention, "branch")
    first_intervention = Intervention(frame=frame, decision=decision, weather=weather)
    # The sort is stable: interventions at the same frame act in the order of the arguments.
    all_interventions = tuple(
        sorted(
            (*origin.interventions, first_intervention, *interventions),
            key=lambda intervention: intervention.frame,
        )
    )
    versions = versions_by_frame(origin.scenario, all_interventions)
    # Interventions that are valid one by one can lead to an invalid scenario: two reductions of a
    # speed can make it negative.
    for version in versions:
        check_batch(version.scenario, "branch")
    trajectories = with_final_conditions(
        simulate_versions(origin.scenario, versions, run),
        origin.scenario,
        versions,
        all_interventions,
    )
    # An intervention that sets only its frame has no effect, so `branch_origin` leaves it out.
    effective_interventions = tuple(
        intervention
        for intervention in all_interventions
        if intervention != Intervention(frame=intervention.frame)
    )
    branch_origin = BranchOrigin(scenario=origin.scenario, interventions=effective_interventions)
    return trajectories.replace(branch_origin=branch_origin if effective_interventions else None)


def simulate_versions(
    scenario: Scenario, versions: Sequence[ScenarioVersion], run: Simulate
) -> Trajectories:
    """Simulate a batch whose scenarios are replaced by other versions at some frames.

    Args:
        scenario: The batch before the first version.
        versions: Versions in the order of their frames. A version at frame 0 replaces the start.
        run: `engine.run` or `reference.run`.

    Raises:
        ConfigError: The frame of a version does not exist.
    """
    params = step_parameters(scenario)
    last_frame = max(params.num_frames - 1, 0)
    switches: list[ParameterSwitch] = []
    for version in versions:
        # A batch without simulations has no frames, so it takes versions at any frame.
        is_after_end = version.frame > last_frame and scenario.num_simulations > 0
        if version.frame < 0 or is_after_end:
            raise _frame_error(last_frame, version.frame)
        new_params = step_parameters(version.scenario)
        if version.scenario_index is not None:
            new_params = dataclasses.replace(
                new_params, scenario_index=np.ascontiguousarray(version.scenario_index)
            )
        new_params = dataclasses.replace(
            with_forced_decision(new_params, int(version.decision)),
            judgement_errors=version.judgement_errors,
        )
        if version.frame == 0:
            params = new_params
        else:
            switches.append(ParameterSwitch(version.frame * params.steps_per_frame, new_params))
    return run(scenario, params, switches)


def _origin_of(source: Scenario | Trajectories) -> BranchOrigin:
    """The scenarios without any intervention, and the interventions that a source has already.

    Raises:
        ConfigError: An external driver drove the source.
    """
    if isinstance(source, Scenario):
        return BranchOrigin(scenario=source, interventions=())
    if source.actions is not None:
        raise ConfigError(
            what="simulation",
            where="branch",
            expected="one in which the model drives the ego",
            got="one with the actions of a driver, which would not react to a change",
            next_step="drive the changed scenario with that driver",
        )
    return source.branch_origin or BranchOrigin(scenario=source.scenario, interventions=())


def versions_by_frame(
    scenario: Scenario, interventions: Iterable[Intervention]
) -> list[ScenarioVersion]:
    """The versions of a batch, one for each frame that has interventions.

    Args:
        scenario: The batch without interventions.
        interventions: Interventions in the order of their frames. Each acts on the result of the
            previous one, and a forced decision holds until the next one.

    Raises:
        ConfigError: A vehicle, trait or weather factor does not exist, or the ego is to be removed.
    """
    versions: dict[int, ScenarioVersion] = {}
    decision = ForcedDecision.FREE
    for intervention in interventions:
        scenario = apply_intervention(scenario, intervention)
        if intervention.decision is not None:
            decision = intervention.decision
        versions[intervention.frame] = ScenarioVersion(
            frame=intervention.frame, scenario=scenario, decision=decision
        )
    return list(versions.values())


def apply_intervention(scenario: Scenario, intervention: Intervention) -> Scenario:
    """The scenarios with the weather, driver and vehicle of an intervention.

    Changes of position and speed are made to `start_s` and `start_speed`, also for a later frame:
    the simulators take the difference between two versions as the change at that frame.

    Args:
        scenario: A batch of scenarios.
        intervention: The intervention; its frame and its decision make no difference.

    Raises:
        ConfigError: The vehicle, trait or weather factor does not exist, or the ego is to be
            removed.
    """
    weather = scenario.weather if intervention.weather is None else intervention.weather
    if len(weather.rain) == 1:  # One weather for all simulations.
        weather = weather.select(np.zeros(scenario.num_simulations, np.int64))
    # `without` names the weather factors that the intervention removes.
    new_scenario = scenario.replace(weather=weather.without(*intervention.without))
    if not intervention.is_about_vehicle:
        return new_scenario
    _check_vehicle(scenario, intervention)
    slot, drivers = intervention.slot, _with_traits(scenario.drivers, intervention)
    start_speed = _add_to_slot(scenario.start_speed, slot, intervention.speed_change)
    # `position_change` is positive ahead; the station of an oncoming vehicle decreases ahead.
    direction = np.where(_is_oncoming(scenario)[:, slot], -1.0, 1.0)
    start_s = _add_to_slot(scenario.start_s, slot, direction * intervention.position_change)
    if intervention.remove:
        start_s[:, slot] = _REMOVED_S - _REMOVED_SPACING * np.float32(slot)
    return new_scenario.replace(drivers=drivers, start_s=start_s, start_speed=start_speed)


def _with_traits(drivers: DriverTraits, intervention: Intervention) -> DriverTraits:
    """The drivers, with the new traits and the new desired speed of one driver per simulation.

    Raises:
        ConfigError: A trait does not exist.
    """
    trait_names = batch_fields(DriverTraits)
    new_traits = {}
    for name, value in intervention.traits.items():
        if name not in trait_names:
            raise ConfigError.unknown_choice(
                what="trait", where="branch", choices=trait_names, got=name
            )
        array = getattr(drivers, name).copy()
        array[:, intervention.slot] = value
        new_traits[name] = array
    drivers, slot = drivers.replace(**new_traits), intervention.slot
    # With the old desired speed the driver would return to the speed before the change.
    desired_speed = _add_to_slot(drivers.desired_speed, slot, intervention.speed_change)
    return drivers.replace(
        desired_speed=np.where(desired_speed < 0, np.float32(0.0), desired_speed)
    )


def _is_oncoming(scenario: Scenario) -> Mask:
    """Whether each vehicle starts in the opposing lane, shape (simulation, vehicle)."""
    # Lanes 0 to num_lanes - 1 are lanes of the road's own direction.
    return scenario.start_lane == scenario.road.num_lanes


def _add_to_slot(values: F32, slot: int, increase: ArrayLike) -> F32:
    """A copy of values of shape (simulation, vehicle), increased in one slot."""
    new_values = values.copy()
    new_values[:, slot] = new_values[:, slot] + np.asarray(increase, np.float32)
    return new_values


def _check_vehicle(scenario: Scenario, intervention: Intervention) -> None:
    """Reject a slot that is empty in any simulation, and the removal of the ego."""
    slot = intervention.slot
    # Vehicles fill the first slots of each simulation.
    min_vehicles = int(scenario.num_vehicles.min(initial=scenario.num_slots))
    if slot >= min_vehicles:
        raise ConfigError.out_of_range(
            what="vehicle", where="branch", low=0, high=min_vehicles - 1, got=slot
        )
    if intervention.remove and slot == EGO_SLOT:
        raise ConfigError(
            what="vehicle",
            where="branch",
            expected="another vehicle than the ego to be removed",
            got=slot,
            next_step="force ForcedDecision.STAY to see what happens without an overtake",
        )


def with_final_conditions(
    trajectories: Trajectories,
    source: Scenario,
    versions: Sequence[ScenarioVersion],
    interventions: Sequence[Intervention],
) -> Trajectories:
    """The recording of a branch, with the scenarios by which its events and breaches are judged.

    These are the scenarios of the last version, but with the positions and speeds at frame 0: in
    the last version, `start_s` and `start_speed` include changes at later frames, and removed
    vehicles are far before the road.

    Args:
        trajectories: The recording.
        source: The batch without interventions.
        versions: The versions of the batch, at least one.
        interventions: The interventions of the versions.
    """
    start = source
    for intervention in interventions:
        if intervention.frame == 0 and not intervention.remove:
            start = apply_intervention(start, intervention)
    final_scenario = versions[-1].scenario.replace(
        start_s=start.start_s, start_speed=start.start_speed
    )
    return _hide_removed(trajectories, interventions).replace(scenario=final_scenario)


def _hide_removed(
    trajectories: Trajectories, interventions: Sequence[Intervention]
) -> Trajectories:
    """The recording without the states of removed vehicles from their removal on."""
    removals = [intervention for intervention in interventions if intervention.remove]
    if not removals:
        return trajectories
    is_recorded = np.ones(trajectories.states.s.shape, np.bool_)
    for removal in removals:
        is_recorded[:, removal.slot, removal.frame :] = False
    states = {
        name: np.where(is_recorded, getattr(trajectories.states, name), dtype(0))
        for name, dtype in STATE_DTYPES.items()
    }
    return trajectories.replace(is_recorded=is_recorded, states=States(**states))


def _frame_error(last_frame: int, frame: int) -> ConfigError:
    """The error for a frame that a batch does not have."""
    return ConfigError(
        what="frame",
        where="branch",
        expected=f"0 to {last_frame}, the last one before the horizon",
        got=frame,
        next_step="choose a recorded frame",
    )
