"""From a scenario to the numbers that the step needs, computed once for reference and engine.

Values that are constant during a simulation are computed here: forces per unit, extinction, the
speed that a driver thinks right for the sight and the grip. Inside the simulation the lateral axis
points towards the fast side, so that left-hand traffic is the mirror image of right-hand traffic.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U64, empty_array
from overtaking.model.scenario import ForcedDecision, Scenario
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.world.constants import (
    STEP_MS,
    EnabledEffects,
    ModelConstants,
    model_constants,
    without_disabled_effects,
)
from overtaking.world.driver_parameters import (
    driver_parameters,
    passing_parameters,
    weather_slowing,
)
from overtaking.world.road_parameters import RoadParameters, road_parameters
from overtaking.world.vehicle_parameters import vehicle_parameters
from overtaking.world.weather_parameters import (
    SimulationParameters,
    scene_conditions,
    with_effective_weather,
)


class VehicleParameters(NamedTuple):
    """Parameters of each vehicle, in the order in which the engine receives them.

    Every array has shape (vehicle, simulation) in the step. `model.vehicles.VehicleSpecs` and
    `model.vehicles.DriverTraits` explain the fields that have their names;
    `world.vehicle_parameters` and `world.driver_parameters` work out the others. Flags are 0 or 1.
    Wanted speeds are those under the limit of the road; on one with `RoadCourse.limits` the step
    lowers them.
    """

    valid: F32
    half_length: F32
    half_width: F32
    tall: F32
    mass: F32
    inverse_mass: F32
    inverse_inertia: F32
    cg_front: F32
    cg_rear: F32
    inverse_wheelbase: F32
    wheelbase: F32
    cg_height: F32
    front_stiffness: F32
    rear_stiffness: F32
    launch_force: F32
    power: F32
    drag: F32
    rolling: F32
    max_speed: F32
    brake_force: F32
    front_drive: F32
    half_track: F32
    understeer: F32
    moment_angle: F32
    side_lag: F32
    two_wheeler: F32
    side_wind: F32
    wind_centre: F32
    wind_arm: F32
    wear: F32
    truck: F32
    shelters: F32
    spray: F32
    loom_width: F32
    contrast: F32
    inverse_tail_lamp: F32
    inverse_head_lamp: F32
    lights: F32
    desired_speed: F32
    pass_speed: F32
    time_gap: F32
    min_gap: F32
    accel: F32
    decel: F32
    interaction: F32
    overspeed_exponent: F32
    hardest_decel: F32
    reaction_ticks: F32
    urgent_ticks: F32
    attention: F32
    most_friction: F32
    politeness: F32
    threshold: F32
    bias: F32
    safe_decel: F32
    lane_change_duration: F32
    passing_gain: F32
    inverse_patience: F32
    pull_out_time: F32
    gap_acceptance: F32
    return_time_gap: F32
    signal_time: F32
    uses_indicator: F32
    checks_blind_spot: F32
    start_s: F32
    start_d: F32
    start_speed: F32
    start_lane: F32
    direction: F32
    makes_room: F32
    passed_factor: F32
    need_factor: F32
    unseen_trust: F32
    spare: F32
    heeds_lines: F32
    limit: F32
    free_speed: F32
    limit_respect: F32
    caution: F32

    def of(self, slot: int | slice) -> "VehicleParameters":
        """The parameters of one vehicle, shape (simulation,), or of several."""
        return VehicleParameters._make(row[slot] for row in self)


VEHICLE_FIELDS = VehicleParameters._fields
SIMULATION_FIELDS = SimulationParameters._fields


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """All inputs of a batch.

    Attributes:
        vehicle: Shape (field, vehicle, simulation), fields as `VEHICLE_FIELDS`.
        simulation: Shape (field, simulation), fields as `SIMULATION_FIELDS`.
        road: The road.
        constants: The constants.
        seed: Key of the random numbers.
        index: Simulation numbers, shape (simulation,).
        record_every: Steps between recorded frames.
        judged: Errors of distance and speed that the ego has where these parameters take over, in
            standard deviations, shape (2, simulation); None leaves them as they are.
    """

    vehicle: F32
    simulation: F32
    road: RoadParameters
    constants: ModelConstants
    seed: int
    index: U64
    record_every: int
    judged: F32 | None = None

    @property
    def of_vehicles(self) -> VehicleParameters:
        """The rows of `vehicle` by name."""
        return VehicleParameters._make(self.vehicle)

    @property
    def of_simulations(self) -> SimulationParameters:
        """The rows of `simulation` by name."""
        return SimulationParameters._make(self.simulation)

    @property
    def num_frames(self) -> int:
        """Frames of the longest simulation that these parameters allow; 1 for an empty batch."""
        last = self.of_simulations.last_step
        return int(last.max()) // self.record_every + 1 if last.size else 1


Turn = tuple[int, Parameters]
"""A step, and the parameters from then on; vehicles are displaced and sped up by as much as their
starts differ from those before."""


def parameters(scenario: Scenario, effects: EnabledEffects | None = None) -> Parameters:
    """Work out everything that the step needs.

    Args:
        scenario: A batch of scenarios.
        effects: Ablations; None for the model as published.
    """
    effects = effects or EnabledEffects()
    c = without_disabled_effects(model_constants(), effects)
    world = scene_conditions(scenario, c, effects)
    vehicle = _unchanged(scenario.vehicles) | _unchanged(scenario.drivers)
    vehicle |= vehicle_parameters(scenario, c, world, effects)
    vehicle |= driver_parameters(with_effective_weather(scenario), c, world, effects)
    own, each = passing_parameters(scenario, world, effects)
    vehicle |= each
    own |= weather_slowing(with_effective_weather(scenario), c, world)
    return Parameters(
        vehicle=_stacked(vehicle, VEHICLE_FIELDS),
        simulation=_stacked(world.step._asdict() | own, SIMULATION_FIELDS),
        road=road_parameters(scenario.road),
        constants=c,
        seed=scenario.seed,
        index=np.ascontiguousarray(scenario.index),
        record_every=scenario.frame_interval_ms // STEP_MS,
    )


def _unchanged(batch: VehicleSpecs | DriverTraits) -> dict[str, NDArray[Any]]:
    """The fields that the step has under the same name, as they are."""
    names = (field.name for field in dataclasses.fields(batch) if field.name in VEHICLE_FIELDS)
    return {name: getattr(batch, name) for name in names}


def _stacked(rows: Mapping[str, NDArray[Any]], names: Sequence[str]) -> F32:
    """Arrays of one shape, turned so that simulations lie side by side, shape (field, ...)."""
    shape = (len(names), *rows[names[0]].shape[::-1])
    stacked = empty_array(math.prod(shape), np.float32).reshape(shape)
    for row, name in zip(stacked, names, strict=True):
        row[...] = rows[name].T
    return stacked


def with_ring(given: Parameters, length: F32) -> Parameters:
    """The same parameters on a road that closes on itself after `length`, (simulation,) [m].

    For the statistics of steady traffic. Everyone sees the nearest image of everyone else;
    contacts between vehicles that are laps apart are not looked for, and an ego that overtakes
    would not find its target, so it is kept from it (`ForcedDecision.STAY`).
    """
    simulation = given.simulation.copy()
    simulation[SIMULATION_FIELDS.index("ring")] = length
    simulation[SIMULATION_FIELDS.index("inverse_ring")] = np.float32(1.0) / length
    return with_command(dataclasses.replace(given, simulation=simulation), ForcedDecision.STAY)


def with_command(given: Parameters, command: int) -> Parameters:
    """The same parameters with a decision forced on every ego (see `sim.branch`)."""
    simulation = given.simulation.copy()
    simulation[SIMULATION_FIELDS.index("command")] = command
    return dataclasses.replace(given, simulation=simulation)
