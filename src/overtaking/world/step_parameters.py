"""All inputs of the simulation step, computed once from a batch of scenarios.

`step_parameters` converts a `Scenario`, many simulations on one road, to `StepParameters`, which
the reference simulator in Python and the compiled engine read. They hold values that stay constant
during a simulation. To change a value, go to the module that computes it: `vehicle_parameters`,
`driver_parameters`, `weather_parameters` or `road_parameters`. To add a field, add it to the named
tuple and run `crates/engine_names.py`, which writes the order of the fields for the engine.

A *step* is 10 ms, a *decision* is one of 20 instants per second at which drivers decide, a *frame*
is a recorded instant. A *slot* is the number of a vehicle in its simulation. The *ego*, the vehicle
under study, has slot 0; in simulations with few vehicles the last slots are empty. Inside the
simulation the lateral axis points towards the overtaking side, so that left-hand traffic is the
mirror image of right-hand traffic.
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

    Every array has shape (vehicle, simulation) in the step. Flags are 0 or 1. A slot without a
    vehicle has finite numbers without meaning. `world.vehicle_parameters` and
    `world.driver_parameters` compute the fields; those that they leave out are copies of the fields
    of the same name in `VehicleSpecs` and `DriverTraits`.

    Attributes:
        valid: Flag of a slot that holds a vehicle.
        half_length: Half the length of the body [m].
        half_width: Half the width of the body [m].
        blocks_view: Flag of a body that hides the road ahead from drivers behind it.
        mass: Mass with driver and load [kg].
        inverse_mass: One over the mass [1/kg].
        inverse_inertia: One over the inertia about the vertical axis [1/(kg m^2)].
        cg_front: Distance of the centre of gravity from the front axle [m].
        cg_rear: Distance of the centre of gravity from the rear axle [m].
        inverse_wheelbase: One over the wheelbase [1/m].
        wheelbase: Distance of the axles [m].
        cg_height: Height of the centre of gravity [m].
        front_stiffness: Cornering stiffness of the front axle per axle load [1/rad].
        rear_stiffness: Cornering stiffness of the rear axle per axle load [1/rad].
        launch_force: Largest drive force at low speed [N].
        power: Power at the wheels, on average over gear changes [W].
        drag: Drag force per squared air speed [N s^2/m^2].
        rolling: Rolling resistance [N].
        max_speed: Top speed, by a governor or by power [m/s].
        max_brake_force: Strongest braking force, positive [N].
        front_drive: Share of the drive force at the front axle [1].
        half_track: Half the distance of the left and right wheels [m].
        understeer: Additional wheel angle per lateral acceleration [rad s^2/m].
        moment_angle: Wheel angle that keeps a straight course against a yaw moment, for example of
            side wind, per moment [rad/(N m)].
        side_lag: Time constant with which the side slip of the body follows the wheels, divided by
            the speed: mass over the sum of both axles' cornering stiffnesses in N/rad [s^2/m].
        two_wheeler: Flag of a vehicle that leans instead of steering.
        side_wind: Largest side force of the wind per squared air speed [N s^2/m^2].
        wind_centre: Distance of the centre of wind pressure ahead of the middle between the axles,
            in wind from the front. The step multiplies it by the cosine of the angle between wind
            and vehicle [m].
        wind_arm: Distance of the middle between the axles ahead of the centre of gravity [m].
        tyre_wear: Tread wear, 0 new to 1 worn [1].
        has_truck_tyres: Flag of a truck: its tyres and the height of its driver's eye differ.
        shelters_wind: Flag of a body that shelters vehicles to its lee from side wind.
        spray: Spray behind the vehicle, relative to a car [1].
        looming_width: Width of the body, at night the distance between its lamps. By its growth in
            their field of view other drivers judge the closing speed [m].
        log_contrast: Logarithm of the contrast of the body against its background [1].
        inverse_tail_lamp: One over the luminous intensity to the rear [1/cd].
        inverse_head_lamp: One over the luminous intensity to the front [1/cd].
        initial_lights: Lamps that are on at the start, a sum of bits of `Lights`.
        desired_speed: Desired speed in this weather, under the highest limit of the road; the step
            lowers it where a lower limit holds [m/s].
        passing_speed: Desired speed while passing [m/s].
        time_gap: Desired time gap behind a leader [s].
        min_gap: Desired gap at standstill [m].
        accel: Largest acceleration that the driver uses on a free road [m/s^2].
        decel: Comfortable deceleration, positive [m/s^2].
        idm_interaction: Factor of speed times closing speed in the desired gap of the intelligent
            driver model (IDM) [s^2/m].
        overspeed_exponent: Exponent of the deceleration of the IDM above the desired speed [1].
        max_assumed_decel: Strongest braking that the driver counts on, positive [m/s^2].
        reaction_delay: Usual reaction time, in decisions [1].
        urgent_reaction_delay: Reaction time in danger, in decisions [1].
        attention_range: Distance to which the driver looks ahead [m].
        max_friction: Highest friction coefficient that the tyres find [1].
        politeness: Weight of the disadvantage of followers in the lane-change model MOBIL [1].
        lane_change_threshold: Incentive from which MOBIL changes lanes [m/s^2].
        keep_right_bias: Bias of MOBIL towards the slower lane, in right-hand traffic the right one
            [m/s^2].
        safe_decel: Largest braking that the driver imposes on a new follower, positive [m/s^2].
        lane_change_duration: Time from lane centre to lane centre [s].
        min_speed_gain: Speed gain from which the driver overtakes [m/s].
        inverse_patience: Rate at which the demands of a waiting driver fall [1/s].
        pull_out_ttc: Time to collision with the leader at which the driver pulls out [s].
        gap_demand_factor: Factor on the gaps and times demanded in the lane to enter [1].
        return_time_gap: Time gap to the overtaken vehicle at which the driver returns [s].
        indicator_lead_time: Time with the indicator on before moving over [s].
        uses_indicator: Flag of a driver that uses the indicator.
        checks_blind_spot: Share of lane changes before which the driver looks over its shoulder
            [1].
        start_s: Position of the centre along the road at the start. All positions of the step count
            in the vehicle's own direction of travel [m].
        start_d: Lateral position of the centre, towards the overtaking side of that direction [m].
        start_speed: Speed at the start [m/s].
        start_lane: Lane at the start, 0 the slowest of that direction.
        travel_sign: 1 along the road, -1 against it.
        edge_shift_when_passed: Lateral shift to the edge of the lane while being passed [m].
        speed_factor_when_passed: Factor on the desired speed while being passed [1].
        passing_time_factor: Believed over true time of passing against oncoming traffic [1].
        assumed_sight_factor: Distance at which the driver assumes an oncoming vehicle out of sight,
            over the sight distance [1].
        time_reserve_share: Time reserve demanded for a pass, over the time that it takes [1].
        heeds_solid_lines: Flag of a driver that heeds solid lines when passing.
        speed_limit: Highest limit of the road [m/s].
        free_speed: Desired speed on a free road in good weather, without a limit [m/s].
        speed_limit_compliance: Share of the excess over a limit that the driver gives up [1].
        caution: Share of the reduction of speed for weather and light that the driver applies [1].
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
        """Select vehicles.

        Args:
            slot: One slot, or a range of slots.

        Returns:
            Views of shape (simulation,) for one slot, (vehicle, simulation) for a range.
        """
        return VehicleParameters._make(row[slot] for row in self)


VEHICLE_FIELDS = VehicleParameters._fields
"""Names of the rows of `StepParameters.vehicle_table`, in their order."""

SIMULATION_FIELDS = SimulationParameters._fields
"""Names of the rows of `StepParameters.simulation_table`, in their order."""


# Without `slots`: `cached_property` stores its results in the `__dict__` of the instance.
@dataclass(frozen=True, kw_only=True)
class StepParameters:
    """All inputs of the simulations of a batch.

    The engine reads the tables, Python code the views `vehicles` and `simulations` on them.

    Attributes:
        vehicle_table: Shape (field, vehicle, simulation), fields as `VEHICLE_FIELDS`.
        simulation_table: Shape (field, simulation), fields as `SIMULATION_FIELDS`.
        road: The road.
        constants: Constants of the model; the constant of a disabled effect has a neutral value.
        seed: Seed of the random numbers, 0 <= seed < 2**64.
        scenario_index: Number of each scenario, shape (simulation,). The random numbers of a
            simulation depend on it and on the seed.
        steps_per_frame: Steps from one recorded frame to the next.
        judgement_errors: Only for a `ParameterSwitch`: new errors of the ego in judging distances
            (row 0) and closing speeds (row 1), in standard deviations, shape (2, simulation); None
            keeps the present errors.
        local_vehicles: A copy of `vehicle_table` in which desired speeds follow the speed limit at
            the present station of each vehicle; None if `vehicle_table` holds. The reference makes
            it at every decision; the engine computes these speeds itself.
        local_simulations: A copy of `simulation_table` in which the wind has an axis for vehicles,
            because it depends on their heading; None if `simulation_table` holds. Only the
            reference uses it, for vehicles that a program drives by pedals and wheel angles
            (`sim.pedal_driving`): they need not head along the road.
    """

    vehicle_table: F32
    simulation_table: F32
    road: RoadParameters
    constants: ModelConstants
    seed: int
    scenario_index: U64
    steps_per_frame: int
    judgement_errors: F32 | None = None
    local_vehicles: VehicleParameters | None = None
    local_simulations: SimulationParameters | None = None

    @cached_property
    def vehicles(self) -> VehicleParameters:
        """The rows of `vehicle_table` by name, or `local_vehicles`."""
        if self.local_vehicles is not None:
            return self.local_vehicles
        return VehicleParameters._make(self.vehicle_table)

    @cached_property
    def simulations(self) -> SimulationParameters:
        """The rows of `simulation_table` by name, or `local_simulations`."""
        if self.local_simulations is not None:
            return self.local_simulations
        return SimulationParameters._make(self.simulation_table)

    @property
    def num_frames(self) -> int:
        """Number of frames of the longest simulation; 1 for an empty batch."""
        last = self.simulations.last_step
        # The first frame is the start, before any step.
        return int(last.max()) // self.steps_per_frame + 1 if last.size else 1


class ParameterSwitch(NamedTuple):
    """New parameters in the middle of a simulation, where weather, drivers or vehicles change.

    A *branch* of a simulation uses it: the same simulation up to a frame, then with the changes.

    Attributes:
        step: Step from which they hold, at least 1.
        params: The parameters. Vehicles keep their state at that step if `start_s` and
            `start_speed` are as in the parameters before. A difference in `start_s` displaces the
            vehicle by as much, a difference in `start_speed` changes its speed by as much.
    """

    step: int
    params: StepParameters


def step_parameters(scenario: Scenario, effects: EnabledEffects | None = None) -> StepParameters:
    """Compute all inputs of the step.

    Args:
        scenario: A batch of scenarios.
        effects: The effects that are enabled; None for all.

    Returns:
        The inputs of the batch.

    Raises:
        ConfigError: Vehicles drive in the opposite direction on a road where the model simulates
            one direction only.
    """
    context = step_context(scenario, effects or EnabledEffects())
    # Arrays have shape (simulation, vehicle) until `_stack` reverses their axes. Of two fields with
    # the same name `|` takes the later one: computed values, such as `desired_speed`, replace
    # copied ones.
    vehicle = _same_fields(scenario.vehicles) | _same_fields(scenario.drivers)
    vehicle |= vehicle_parameters(context) | driver_parameters(context)
    simulation = (
        _clock(scenario)
        | context.conditions.step_fields()
        | weather_slowing(scenario, context.conditions)
    )
    road = road_parameters(scenario.road)
    if road.has_oncoming_traffic:
        vehicle |= reaction_to_oncoming(context)
        simulation |= oncoming_judgement(context)
    else:
        # The phrase names the kind of road in the message.
        check_one_direction(
            scenario, "a road that is not two equally wide lanes, one in each direction"
        )
        # Without oncoming traffic nothing uses these fields.
        vehicle |= dict.fromkeys(REACTION_TO_ONCOMING_FIELDS, np.zeros_like(scenario.start_s))
        simulation |= dict.fromkeys(ONCOMING_JUDGEMENT_FIELDS, np.zeros_like(scenario.horizon))
    return StepParameters(
        vehicle_table=_stack(vehicle, VEHICLE_FIELDS),
        simulation_table=_stack(simulation, SIMULATION_FIELDS),
        road=road,
        constants=context.constants,
        seed=scenario.seed,
        scenario_index=np.ascontiguousarray(scenario.scenario_index),
        steps_per_frame=scenario.frame_interval_ms // STEP_MS,
    )


def with_ring(params: StepParameters, length: F32) -> StepParameters:
    """Parameters of a road that closes on itself, for statistics of steady traffic.

    Positions along the road go on growing lap by lap. Distances to other vehicles count modulo the
    length, so each vehicle reacts to the nearest one of all laps. Two parts of the step compare
    positions without the modulo. The choice of the vehicle to overtake would be wrong, so the ego
    must not overtake (`ForcedDecision.STAY`). The search for contacts misses vehicles in different
    laps.

    Args:
        params: Parameters of a road with ends.
        length: Length of the closed road, positive, shape (simulation,) [m].

    Returns:
        A copy with the ring, and with the decision to stay.
    """
    simulation = params.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("ring_length")] = length
    simulation[SIMULATION_FIELDS.index("inverse_ring_length")] = np.float32(1.0) / length
    return with_forced_decision(
        dataclasses.replace(params, simulation_table=simulation), ForcedDecision.STAY
    )


def with_forced_decision(params: StepParameters, decision: int) -> StepParameters:
    """Parameters with a decision forced on every ego, as in a branch of a simulation.

    Args:
        params: Parameters of a batch.
        decision: A `ForcedDecision`, such as `PULL_OUT`; `FREE`, 0, forces no decision.

    Returns:
        A copy with the decision.
    """
    simulation = params.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("forced_decision")] = decision
    return dataclasses.replace(params, simulation_table=simulation)


def _clock(scenario: Scenario) -> dict[str, F32]:
    """Fields of `SimulationParameters` for the end of a simulation, and 0 for optional fields.

    From `attempt_deadline` on, a simulation also ends as soon as the ego neither overtakes nor is
    about to overtake. For the other fields, 0 means that no decision is forced and that the road
    has ends; `with_forced_decision` and `with_ring` change them.
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
    """Fields of a batch that `VehicleParameters` also has, shape (simulation, vehicle)."""
    names = (field.name for field in dataclasses.fields(batch) if field.name in VEHICLE_FIELDS)
    return {name: getattr(batch, name) for name in names}


def _stack(rows: Mapping[str, NDArray[Any]], names: Sequence[str]) -> F32:
    """Stack arrays by field in one float32 table, with reversed axes; True becomes 1.

    With the simulation as last axis, the numbers of neighbouring simulations lie side by side in
    memory: the engine loads them into one vector of the CPU.

    Args:
        rows: Arrays by field, all of shape (simulation, vehicle) or all of shape (simulation,).
            Fields that are not in `names` are left out.
        names: The fields, in the order of the table.

    Returns:
        Shape (field, vehicle, simulation) or (field, simulation).

    Raises:
        KeyError: A field is missing.
    """
    shape = (len(names), *rows[names[0]].shape[::-1])
    # `empty_array` reuses the memory of earlier large tables that nobody refers to any more.
    stacked = empty_array(math.prod(shape), np.float32).reshape(shape)
    for row, name in zip(stacked, names, strict=True):
        row[...] = rows[name].T
    return stacked
