"""From a scenario to the numbers that the step needs, computed once for reference and engine.

What does not change during a simulation is worked out here: forces per unit, extinction, the speed
that a driver thinks right for the sight and the grip. Inside the simulation the lateral axis points
towards the fast side, so that left-hand traffic is the mirror image of right-hand traffic.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.core.memory import empty
from overtaking.model.decision import Decision
from overtaking.model.scenario import Scenario
from overtaking.world.bodies import body_parameters
from overtaking.world.clock import STEP_MS, STEPS_PER_SECOND, SUBSTEPS
from overtaking.world.conditions import World, world_of
from overtaking.world.constants import Constants, constants
from overtaking.world.effects import Effects, ablated
from overtaking.world.lanes import RoadParameters, road_parameters
from overtaking.world.people import driver_parameters

__all__ = [
    "SIMULATION_FIELDS",
    "SUBSTEPS",
    "VEHICLE_FIELDS",
    "Effects",
    "Parameters",
    "RoadParameters",
    "parameters",
    "road_parameters",
    "with_command",
    "with_ring",
]

VEHICLE_FIELDS = (
    "valid",
    "half_length",
    "half_width",
    "tall",
    "mass",
    "inverse_mass",
    "inverse_inertia",
    "cg_front",
    "cg_rear",
    "inverse_wheelbase",
    "wheelbase",
    "cg_height",
    "front_stiffness",
    "rear_stiffness",
    "launch_force",
    "power",
    "drag",
    "rolling",
    "max_speed",
    "brake_force",
    "front_drive",
    "half_track",
    "understeer",
    "moment_angle",
    "two_wheeler",
    "side_wind",
    "wind_centre",
    "wind_arm",
    "wear",
    "truck",
    "shelters",
    "spray",
    "loom_width",
    "contrast",
    "inverse_tail_lamp",
    "inverse_head_lamp",
    "lights",
    "desired_speed",
    "pass_speed",
    "time_gap",
    "min_gap",
    "accel",
    "decel",
    "interaction",
    "overspeed_exponent",
    "hardest_decel",
    "reaction_ticks",
    "politeness",
    "threshold",
    "bias",
    "safe_decel",
    "lane_change_duration",
    "passing_gain",
    "inverse_patience",
    "pull_out_time",
    "gap_acceptance",
    "return_time_gap",
    "signal_time",
    "uses_indicator",
    "checks_blind_spot",
    "start_s",
    "start_d",
    "start_speed",
    "start_lane",
)
"""Per-vehicle parameters, in the order in which the engine receives them."""

SIMULATION_FIELDS = (
    "last_step",
    "deadline_step",
    "fog_extinction",
    "rain_extinction",
    "sight_front",
    "sight_rear",
    "lamp_threshold",
    "inverse_lit_range",
    "detection_time",
    "distance_error",
    "speed_error",
    "wind_along",
    "wind_across",
    "gust_gain",
    "gust_phase",
    "gust_length",
    "least_film",
    "film_rain",
    "texture",
    "puddle_reach",
    "puddle_film",
    "puddle_phase_1",
    "puddle_phase_2",
    "side_accel",
    "command",
    "ring",
    "inverse_ring",
)
"""Per-simulation parameters, in the order in which the engine receives them."""


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
    """

    vehicle: F32
    simulation: F32
    road: RoadParameters
    constants: Constants
    seed: int
    index: NDArray[np.uint64]
    record_every: int

    @property
    def num_frames(self) -> int:
        """Frames of the longest simulation that these parameters allow."""
        last = self.simulation[SIMULATION_FIELDS.index("last_step")]
        return int(last.max()) // self.record_every + 1 if last.size else 0


def parameters(scenario: Scenario, effects: Effects | None = None) -> Parameters:
    """Work out everything that the step needs.

    Args:
        scenario: A batch of scenarios.
        effects: Ablations; None for the model as published.
    """
    effects = effects or Effects()
    c = ablated(constants(), effects)
    world = world_of(scenario, c, effects)
    vehicle = body_parameters(scenario, c, world, effects)
    vehicle |= driver_parameters(scenario, c, world, effects)
    return Parameters(
        vehicle=_stacked(vehicle, VEHICLE_FIELDS),
        simulation=_stacked(_simulation_parameters(scenario, world), SIMULATION_FIELDS),
        road=road_parameters(scenario.road),
        constants=c,
        seed=scenario.seed,
        index=np.ascontiguousarray(scenario.index),
        record_every=scenario.frame_interval_ms // STEP_MS,
    )


def _simulation_parameters(scenario: Scenario, world: World) -> dict[str, F32]:
    rows = {
        "last_step": np.rint(scenario.horizon * STEPS_PER_SECOND),
        "deadline_step": np.rint(scenario.attempt_deadline * STEPS_PER_SECOND),
        "side_accel": world.side_accel,
        "command": np.zeros_like(scenario.horizon),
        "ring": np.zeros_like(scenario.horizon),
        "inverse_ring": np.zeros_like(scenario.horizon),
    }
    return rows | _by_name(world.water) | _by_name(world.wind) | _by_name(world.sight)


def _stacked(rows: Mapping[str, NDArray[Any]], names: Sequence[str]) -> F32:
    """Arrays of one shape, turned so that simulations lie side by side, shape (field, ...)."""
    shape = (len(names), *rows[names[0]].shape[::-1])
    stacked = empty(math.prod(shape), np.float32).reshape(shape)
    for row, name in zip(stacked, names, strict=True):
        row[...] = rows[name].T
    return stacked


def _by_name(part: Any) -> dict[str, F32]:
    """The arrays of a part of the world by the names of its attributes."""
    return {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}


def with_ring(given: Parameters, length: F32) -> Parameters:
    """The same parameters on a road that closes on itself after `length`, (simulation,) [m].

    For the statistics of steady traffic. Everyone sees the nearest image of everyone else;
    contacts between vehicles that are laps apart are not looked for, and an ego that overtakes
    would not find its target, so it is kept from it (`Decision.STAY`).
    """
    simulation = given.simulation.copy()
    simulation[SIMULATION_FIELDS.index("ring")] = length
    simulation[SIMULATION_FIELDS.index("inverse_ring")] = np.float32(1.0) / length
    return with_command(dataclasses.replace(given, simulation=simulation), Decision.STAY)


def with_command(given: Parameters, command: int) -> Parameters:
    """The same parameters with a decision forced on every ego (see `sim.branch`)."""
    simulation = given.simulation.copy()
    simulation[SIMULATION_FIELDS.index("command")] = command
    return dataclasses.replace(given, simulation=simulation)
