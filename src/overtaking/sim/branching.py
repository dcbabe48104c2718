"""What would have happened: the same simulation with something changed from a frame on."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, U64, Mask
from overtaking.core.errors import ConfigError
from overtaking.model.batch import batch_fields
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
"""`engine.run`, or `reference.run`."""


_REMOVED_S = np.float32(-30_000.0)
"""Station of removed vehicles: behind the road, where they meet no other vehicle [m].

Slots keep their numbers, and with them their random numbers. A flag of validity that changes would
leave half-written frames.
"""


_REMOVED_SPACING = np.float32(1_000.0)
"""Distance between vehicles that are removed [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioVersion:
    """A batch as it is from a frame on.

    Attributes:
        frame: The frame.
        scenario: Weather, drivers and bodies from then on. By how much its starts differ from
            those of the version before, vehicles are displaced and sped up.
        decision: Decision forced on every ego.
        scenario_index: Numbers from which everything is drawn from then on; None for those of the
            scenario.
        judgement_errors: As in `world.step_parameters.StepParameters`.
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
    """Simulate again, with something changed.

    The part before a change is simulated too, not read from a file, so the result is exact; with
    nothing changed its trace hash is that of the undisturbed simulation.

    Args:
        source: A batch of scenarios; or a branch, whose changes come before these.
        frame: First frame that `decision` and `weather` can affect, 0 to the last one before the
            horizon.
        decision: Decision forced on every ego.
        weather: Weather of every simulation from then on, shape as in the scenarios.
        interventions: Other changes, at frames of their own.
        run: `engine.run`, or `reference.run` for the readable twin.

    Raises:
        ConfigError: There is no such frame or vehicle, or a change cannot be made.
    """
    before = _origin_of(source)
    first = Intervention(frame=frame, decision=decision, weather=weather)
    # The later of two that begin together is made on top of the earlier.
    made = tuple(sorted((*before.interventions, first, *interventions), key=lambda one: one.frame))
    stages = versions_by_frame(before.scenario, made)
    found = with_final_conditions(
        simulate_versions(before.scenario, stages, run), before.scenario, stages, made
    )
    meant = tuple(one for one in made if one != Intervention(frame=one.frame))
    branched = BranchOrigin(scenario=before.scenario, interventions=meant)
    return found.replace(branch_origin=branched if meant else None)


def simulate_versions(
    scenario: Scenario, versions: Sequence[ScenarioVersion], run: Simulate
) -> Trajectories:
    """Simulate a batch that is another one from some frames on.

    Args:
        scenario: The batch as it begins.
        versions: In the order of their frames; one at frame 0 is how it begins.
        run: `engine.run`, or `reference.run`.

    Raises:
        ConfigError: There is no such frame.
    """
    params = step_parameters(scenario)
    last = max(params.num_frames - 1, 0)
    switches: list[ParameterSwitch] = []
    for one in versions:
        is_beyond = one.frame > last and scenario.num_simulations > 0
        if one.frame < 0 or is_beyond:
            raise _frame_error(last, one.frame)
        then = step_parameters(one.scenario)
        if one.scenario_index is not None:
            then = dataclasses.replace(
                then, scenario_index=np.ascontiguousarray(one.scenario_index)
            )
        then = dataclasses.replace(
            with_forced_decision(then, int(one.decision)), judgement_errors=one.judgement_errors
        )
        if one.frame == 0:
            params = then
        else:
            switches.append(ParameterSwitch(one.frame * params.steps_per_frame, then))
    return run(scenario, params, switches)


def _origin_of(source: Scenario | Trajectories) -> BranchOrigin:
    """What a batch branches from, and the changes that were made already."""
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


def versions_by_frame(scenario: Scenario, changes: Iterable[Intervention]) -> list[ScenarioVersion]:
    """The batch after each frame at which something changes.

    Args:
        scenario: The batch as it begins.
        changes: In the order of their frames.

    Raises:
        ConfigError: There is no such vehicle, trait or weather.
    """
    found: dict[int, ScenarioVersion] = {}
    decision = ForcedDecision.FREE
    for one in changes:
        scenario = apply_intervention(scenario, one)
        decision = decision if one.decision is None else one.decision
        found[one.frame] = ScenarioVersion(frame=one.frame, scenario=scenario, decision=decision)
    return list(found.values())


def apply_intervention(scenario: Scenario, change: Intervention) -> Scenario:
    """The scenarios with what a change says.

    Raises:
        ConfigError: There is no such vehicle, trait or weather.
    """
    weather = scenario.weather if change.weather is None else change.weather
    if len(weather.rain) == 1:
        weather = weather.select(np.zeros(scenario.num_simulations, np.int64))
    found = scenario.replace(weather=weather.without(*change.without))
    if not change.is_about_vehicle:
        return found
    _check_vehicle(scenario, change)
    slot, start, drivers = change.slot, scenario.start_s, _with_traits(scenario.drivers, change)
    speed = _add_to_slot(scenario.start_speed, slot, change.speed_change)
    comes = _is_oncoming(scenario)[:, slot]
    place = _add_to_slot(
        start, slot, np.where(comes, -change.position_change, change.position_change)
    )
    if change.remove:
        place[:, slot] = _REMOVED_S - _REMOVED_SPACING * np.float32(slot)
    return found.replace(drivers=drivers, start_s=place, start_speed=speed)


def _with_traits(drivers: DriverTraits, change: Intervention) -> DriverTraits:
    """Drivers with other traits of one of them."""
    fields_of_drivers = batch_fields(DriverTraits)
    found = {}
    for name, value in change.traits.items():
        if name not in fields_of_drivers:
            raise ConfigError.unknown_choice(
                what="trait", where="branch", choices=fields_of_drivers, got=name
            )
        array = getattr(drivers, name).copy()
        array[:, change.slot] = value
        found[name] = array
    drivers = drivers.replace(**found)
    wish = _add_to_slot(drivers.desired_speed, change.slot, change.speed_change)
    return drivers.replace(desired_speed=np.where(wish < 0, np.float32(0.0), wish))


def _is_oncoming(scenario: Scenario) -> Mask:
    """Whose way ahead is against that of the road, (simulation, vehicle)."""
    return scenario.start_lane == scenario.road.num_lanes


def _add_to_slot(values: F32, slot: int, by: ArrayLike) -> F32:
    """Values with a number added to those of one vehicle."""
    found = values.copy()
    found[:, slot] = found[:, slot] + np.asarray(by, np.float32)
    return found


def _check_vehicle(scenario: Scenario, change: Intervention) -> None:
    """Refuse a vehicle that a simulation lacks, and to remove the ego."""
    slot, least = change.slot, int(scenario.num_vehicles.min(initial=scenario.num_slots))
    if slot >= least:
        raise ConfigError.out_of_range(
            what="vehicle", where="branch", low=0, high=least - 1, got=slot
        )
    if change.remove and slot == EGO_SLOT:
        raise ConfigError(
            what="vehicle",
            where="branch",
            expected="another one than the ego to be removed",
            got=slot,
            next_step="force Decision.STAY to see what happens without an overtake",
        )


def with_final_conditions(
    run: Trajectories,
    first: Scenario,
    stages: Sequence[ScenarioVersion],
    changes: Sequence[Intervention],
) -> Trajectories:
    """A recording of versions as it is judged: with weather and drivers of the last of them.

    Args:
        run: The recording.
        first: The batch as it begins.
        stages: The versions.
        changes: What makes them.
    """
    begins = first
    for one in changes:
        if one.frame == 0 and not one.remove:
            begins = apply_intervention(begins, one)
    last = stages[-1].scenario
    kept = last.replace(start_s=begins.start_s, start_speed=begins.start_speed)
    return _hide_removed(run, changes).replace(scenario=kept)


def _hide_removed(run: Trajectories, changes: Sequence[Intervention]) -> Trajectories:
    """The recording without vehicles from when they are removed; nothing is said of them then."""
    gone = [one for one in changes if one.remove]
    if not gone:
        return run
    there = np.ones(run.states.s.shape, np.bool_)
    for one in gone:
        there[:, one.slot, one.frame :] = False
    rows = {
        name: np.where(there, getattr(run.states, name), kind(0))
        for name, kind in STATE_DTYPES.items()
    }
    return run.replace(is_recorded=there, states=States(**rows))


def _frame_error(last: int, got: int) -> ConfigError:
    return ConfigError(
        what="frame",
        where="branch",
        expected=f"0 to {last}, the last one before the horizon",
        got=got,
        next_step="choose a recorded frame",
    )
