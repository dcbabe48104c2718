"""All parameters of a batch, computed once from its scenarios for reference and engine.

They are the values that stay constant during a simulation: forces per unit, extinction, the desired
speed for the sight and the friction. Inside the simulation the lateral axis points towards the fast
side, so that left-hand traffic is the mirror image of right-hand traffic.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U64, empty_array
from overtaking.model.scenario import ForcedDecision, Scenario
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.world.constants import (
    STEP_MS,
    STEPS_PER_SECOND,
    EnabledEffects,
    ModelConstants,
)
from overtaking.world.driver_parameters import (
    ONCOMING_JUDGEMENT_FIELDS,
    REACTION_TO_ONCOMING_FIELDS,
    driver_parameters,
    oncoming_judgement,
    reaction_to_oncoming,
    weather_slowing,
)
from overtaking.world.road_parameters import RoadParameters, check_one_direction, road_parameters
from overtaking.world.vehicle_parameters import vehicle_parameters
from overtaking.world.weather_parameters import SimulationParameters, step_context


class VehicleParameters(NamedTuple):
    """Parameters of each vehicle, in the order in which the engine receives them.

    Every array has shape (vehicle, simulation) in the step. `model.vehicles.VehicleSpecs` and
    `model.vehicles.DriverTraits` explain the fields that they have too;
    `world.vehicle_parameters` and `world.driver_parameters` compute the others. Flags are 0 or 1.
    Desired speeds hold under the limit of the road; the step lowers them on a road with
    `RoadCourse.speed_limit_spans`.
    """

    valid: F32
    half_length: F32
    half_width: F32
    blocks_view: F32
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
    max_brake_force: F32
    front_drive: F32
    half_track: F32
    understeer: F32
    moment_angle: F32
    side_lag: F32
    two_wheeler: F32
    side_wind: F32
    wind_centre: F32
    wind_arm: F32
    tyre_wear: F32
    has_truck_tyres: F32
    shelters_wind: F32
    spray: F32
    looming_width: F32
    log_contrast: F32
    inverse_tail_lamp: F32
    inverse_head_lamp: F32
    initial_lights: F32
    desired_speed: F32
    passing_speed: F32
    time_gap: F32
    min_gap: F32
    accel: F32
    decel: F32
    idm_interaction: F32
    overspeed_exponent: F32
    max_assumed_decel: F32
    reaction_delay: F32
    urgent_reaction_delay: F32
    attention_range: F32
    max_friction: F32
    politeness: F32
    lane_change_threshold: F32
    keep_right_bias: F32
    safe_decel: F32
    lane_change_duration: F32
    min_speed_gain: F32
    inverse_patience: F32
    pull_out_ttc: F32
    gap_demand_factor: F32
    return_time_gap: F32
    indicator_lead_time: F32
    uses_indicator: F32
    checks_blind_spot: F32
    start_s: F32
    start_d: F32
    start_speed: F32
    start_lane: F32
    travel_sign: F32
    edge_shift_when_passed: F32
    speed_factor_when_passed: F32
    passing_time_factor: F32
    assumed_sight_factor: F32
    time_reserve_share: F32
    heeds_solid_lines: F32
    speed_limit: F32
    free_speed: F32
    speed_limit_compliance: F32
    caution: F32

    def at_slots(self, slot: int | slice) -> "VehicleParameters":
        """The parameters of one vehicle, shape (simulation,), or of several."""
        return VehicleParameters._make(row[slot] for row in self)


VEHICLE_FIELDS = VehicleParameters._fields
SIMULATION_FIELDS = SimulationParameters._fields


@dataclass(frozen=True, kw_only=True)  # No slots: the views on the tables are cached.
class StepParameters:
    """All inputs of a batch.

    Attributes:
        vehicle_table: Shape (field, vehicle, simulation), fields as `VEHICLE_FIELDS`.
        simulation_table: Shape (field, simulation), fields as `SIMULATION_FIELDS`.
        road: The road.
        constants: Constants of the model, without the disabled effects.
        seed: Key of the random numbers.
        scenario_index: Numbers from which the scenarios are drawn, shape (simulation,).
        steps_per_frame: Steps between recorded frames.
        judgement_errors: The ego's errors of distance and speed at the step from which these
            parameters hold, in standard deviations, shape (2, simulation); None leaves them
            unchanged.
    """

    vehicle_table: F32
    simulation_table: F32
    road: RoadParameters
    constants: ModelConstants
    seed: int
    scenario_index: U64
    steps_per_frame: int
    judgement_errors: F32 | None = None

    @cached_property
    def vehicles(self) -> VehicleParameters:
        """The rows of `vehicle_table` by name."""
        return VehicleParameters._make(self.vehicle_table)

    @cached_property
    def simulations(self) -> SimulationParameters:
        """The rows of `simulation_table` by name."""
        return SimulationParameters._make(self.simulation_table)

    @property
    def num_frames(self) -> int:
        """Number of frames of the longest simulation; 1 for an empty batch."""
        last = self.simulations.last_step
        return int(last.max()) // self.steps_per_frame + 1 if last.size else 1


class ParameterSwitch(NamedTuple):
    """New parameters in the middle of a simulation.

    Attributes:
        step: Step from which they hold, at least 1.
        params: The parameters. Vehicles are displaced and accelerated by the differences between
            their starts in these parameters and in those before.
    """

    step: int
    params: StepParameters


def step_parameters(scenario: Scenario, effects: EnabledEffects | None = None) -> StepParameters:
    """Compute all inputs of the step.

    Args:
        scenario: A batch of scenarios.
        effects: The effects that are enabled; None for the model as published.

    Raises:
        ConfigError: Vehicles drive in the opposite direction on a road where the model simulates
            one direction only.
    """
    context = step_context(scenario, effects or EnabledEffects())
    vehicle = _same_fields(scenario.vehicles) | _same_fields(scenario.drivers)
    vehicle |= vehicle_parameters(context) | driver_parameters(context)
    simulation = (
        _clock(scenario)
        | context.conditions.step_fields()
        | weather_slowing(scenario, context.conditions)
    )
    if road_parameters(scenario.road).has_oncoming_traffic:
        vehicle |= reaction_to_oncoming(context)
        simulation |= oncoming_judgement(context)
    else:
        check_one_direction(
            scenario, "a road that is not two equally wide lanes, one in each direction"
        )
        vehicle |= dict.fromkeys(REACTION_TO_ONCOMING_FIELDS, np.zeros_like(scenario.start_s))
        simulation |= dict.fromkeys(ONCOMING_JUDGEMENT_FIELDS, np.zeros_like(scenario.horizon))
    return StepParameters(
        vehicle_table=_stack(vehicle, VEHICLE_FIELDS),
        simulation_table=_stack(simulation, SIMULATION_FIELDS),
        road=road_parameters(scenario.road),
        constants=context.constants,
        seed=scenario.seed,
        scenario_index=np.ascontiguousarray(scenario.scenario_index),
        steps_per_frame=scenario.frame_interval_ms // STEP_MS,
    )


def with_ring(params: StepParameters, length: F32) -> StepParameters:
    """Parameters of a road that closes on itself, for statistics of steady traffic.

    Each vehicle reacts to the nearest image of every other vehicle. Vehicles that are laps apart
    cannot touch in the simulation, and an ego that overtakes would not find its target, so the ego
    must stay (`ForcedDecision.STAY`).

    Args:
        params: Parameters of a road with ends.
        length: Length of the closed road, shape (simulation,) [m].
    """
    simulation = params.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("ring_length")] = length
    simulation[SIMULATION_FIELDS.index("inverse_ring_length")] = np.float32(1.0) / length
    return with_forced_decision(
        dataclasses.replace(params, simulation_table=simulation), ForcedDecision.STAY
    )


def with_forced_decision(params: StepParameters, decision: int) -> StepParameters:
    """Parameters with a decision forced on every ego, see `sim.branch`.

    Args:
        params: Parameters of a batch.
        decision: A `ForcedDecision`.
    """
    simulation = params.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("forced_decision")] = decision
    return dataclasses.replace(params, simulation_table=simulation)


def _clock(scenario: Scenario) -> dict[str, F32]:
    """Fields of `SimulationParameters` for the end of a simulation, and those without an effect.

    No decision is forced and the road has ends; `with_forced_decision` and `with_ring` change that.
    """
    zero = np.zeros_like(scenario.horizon)
    return {
        "last_step": np.rint(scenario.horizon * STEPS_PER_SECOND),
        "deadline_step": np.rint(scenario.attempt_deadline * STEPS_PER_SECOND),
        "forced_decision": zero,
        "ring_length": zero,
        "inverse_ring_length": zero,
    }


def _same_fields(batch: VehicleSpecs | DriverTraits) -> dict[str, NDArray[Any]]:
    """The fields that `VehicleParameters` has under the same name."""
    names = (field.name for field in dataclasses.fields(batch) if field.name in VEHICLE_FIELDS)
    return {name: getattr(batch, name) for name in names}


def _stack(rows: Mapping[str, NDArray[Any]], names: Sequence[str]) -> F32:
    """Stack arrays by field and transpose them: simulations lie side by side in memory.

    Args:
        rows: Arrays of one shape by field.
        names: The fields, in the order of the table.

    Returns:
        Shape (field, ...), the other axes in reverse order.

    Raises:
        KeyError: A field is missing.
    """
    shape = (len(names), *rows[names[0]].shape[::-1])
    stacked = empty_array(math.prod(shape), np.float32).reshape(shape)
    for row, name in zip(stacked, names, strict=True):
        row[...] = rows[name].T
    return stacked
