"""Draws scenarios from a specification, a road, a seed and the indices of the scenarios.

`ScenarioSource.sample` returns a `Scenario`, the input of a batch of simulations: road, vehicles,
drivers, weather, and the station, lane and speed of each vehicle at the start. The modules
`placed_traffic`, `motorway_traffic` and `two_way_traffic` draw the three kinds of traffic, and
`weather_sampling` the weather; this module calls them in blocks, and computes the starts.

The *scenario index* and the seed decide all random numbers of a scenario. The *horizon* is the
longest duration of a simulation. The *ego* is the vehicle under study; it has *slot* 0, the first
position in the second axis of arrays (simulation, vehicle).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, U64
from overtaking.core.errors import ConfigError, check_whole_number
from overtaking.core.native import minimum
from overtaking.model.batch import concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.weather import Weather
from overtaking.scenarios import motorway_traffic, two_way_traffic
from overtaking.scenarios.driver_sampling import max_placed_desired_speed
from overtaking.scenarios.motorway_traffic import PASSING_SPEED_FACTOR
from overtaking.scenarios.placed_traffic import sample_placed_traffic, start_zone
from overtaking.scenarios.random_draws import SampleBlock
from overtaking.scenarios.safe_start import (
    DrawnStarts,
    FollowerLimits,
    RoadSpeeds,
    StartStates,
    StartZone,
    TrafficSampler,
    TrafficStart,
    assumed_start_decel,
    repair_starts,
)
from overtaking.scenarios.specification import Specification, StartsSection
from overtaking.scenarios.traffic_specification import FlowTraffic, PlacedTraffic, TwoWayTraffic
from overtaking.scenarios.weather_sampling import sample_weather
from overtaking.world.driver_parameters import (
    DesiredSpeedFactors,
    adapted_speed,
    desired_speed_factors,
)
from overtaking.world.road_parameters import has_two_directions, road_parameters
from overtaking.world.weather_parameters import scene_conditions, with_effective_weather

ScenarioModifier = Callable[[Scenario], Scenario]
"""Function that changes the weather or the drivers of scenarios, for example to ask what would have
happened without rain.

It is called before the starts are computed, so speeds and braking distances at the start follow
from the changed scenario. The gaps between vehicles of motorway and two-way traffic are an
exception: they follow from the time gaps, gaps at standstill and lengths as drawn."""

BLOCK_SIZE = 2048
"""Simulations that are drawn together: few enough for their arrays to stay in the processor's
cache. It changes no result."""

MAX_SEED = 2**64 - 1
"""Largest seed: the random numbers take 64 bits of it."""

_ROAD_STEP = 100.0
"""Lengths of extended roads are multiples of this [m], to be round numbers (a choice). Another step
would change two-way scenarios, whose oncoming vehicles start at the far end of the road."""


@dataclass(frozen=True, slots=True)
class ScenarioSource:
    """Everything from which scenarios are drawn, except for their indices.

    Attributes:
        specification: The specification of the scenarios.
        road: The road. Scenarios have a longer copy of it if vehicles would otherwise leave it
            before the horizon.
        seed: Seed of the data set, 0 <= seed < 2**64.
    """

    specification: Specification
    road: Road
    seed: int

    def sample(self, scenario_index: ArrayLike, modify: ScenarioModifier | None = None) -> Scenario:
        """Draw scenarios; each is the same in any batch and has the same bits on every machine.

        Args:
            scenario_index: Index of each scenario, whole numbers from 0 on, shape (simulation,).
            modify: Changes weather or drivers before starts are computed; None for no change.

        Returns:
            The scenarios, with the ego in slot 0.

        Raises:
            ConfigError: The seed or an index is out of range, or the specification does not fit
                the road.
            InfeasibleError: Placed traffic has too many vehicles for its zone, or a vehicle type
                too slow for its lowest speed; or the traffic of a motorway is so dense that
                the ego would see where it ends: a simulation has at most `MAX_VEHICLES` vehicles.
        """
        indices = _checked_indices(scenario_index)
        seed = check_whole_number(self.seed, 0, MAX_SEED, what="seed", where="sample")
        sample_traffic, road = _traffic_sampler_and_road(self.specification, self.road)
        batches = []
        # Without indices one empty block is drawn: a batch of no simulations, with all its fields.
        for first in range(0, max(len(indices), 1), BLOCK_SIZE):
            block_indices = indices[first : first + BLOCK_SIZE]
            block = SampleBlock.from_indices(self.specification, road, seed, block_indices)
            batches.append(_sample_block(block, sample_traffic, modify))
        return concatenate(batches) if len(batches) > 1 else batches[0]


def extend_road(specification: Specification, road: Road) -> Road:
    """Extend a road for two-way traffic; roads for other traffic stay as they are.

    The description of a data set (`dataset.json`) states the result. `ScenarioSource.sample`
    extends any road that is too short. On a two-way road the length decides scenarios, because
    oncoming vehicles count their stations from its far end, so data sets state the extended road.
    On a road with one direction the length changes no other value of a scenario.

    Args:
        specification: The specification of the scenarios.
        road: The road, before any extension.

    Raises:
        ConfigError: The specification has two-way traffic, which does not fit the road.
    """
    if not isinstance(specification.traffic, TwoWayTraffic):
        return road
    return _traffic_sampler_and_road(specification, road)[1]


def _checked_indices(scenario_index: ArrayLike) -> U64:
    """The indices as an array; ConfigError unless they are whole numbers from 0 on."""
    indices = np.asarray(scenario_index)
    # An empty list becomes an array of float64, which is allowed.
    is_whole = np.issubdtype(indices.dtype, np.integer) or indices.size == 0
    if indices.ndim != 1 or not is_whole or (indices.size and int(indices.min()) < 0):
        raise ConfigError(
            what="index",
            where="sample",
            expected="a list of whole numbers from 0 on",
            got=f"{indices.dtype} of shape {indices.shape}",
            next_step="pass, for example, numpy.arange(1000)",
        )
    return indices.astype(np.uint64)


def _traffic_sampler_and_road(
    specification: Specification, road: Road
) -> tuple[TrafficSampler, Road]:
    """The function that draws the traffic of a specification, and the road, long enough for it.

    Raises:
        ConfigError: The specification does not fit the road.
        InfeasibleError: See `ScenarioSource.sample`.
    """
    traffic = specification.traffic
    if isinstance(traffic, FlowTraffic):
        _check_lanes(specification, traffic, road)
        min_length = motorway_traffic.road_length(specification, traffic)
        sample_traffic = partial(motorway_traffic.sample_motorway_traffic, flow=traffic)
    elif isinstance(traffic, TwoWayTraffic):
        _check_two_directions(specification, road)
        min_length = two_way_traffic.road_length(specification, traffic)
        sample_traffic = partial(two_way_traffic.sample_two_way_traffic, traffic=traffic)
    else:
        zone = start_zone(specification, traffic, road)
        min_length = _placed_road_length(specification, traffic, zone)
        sample_traffic = partial(sample_placed_traffic, traffic=traffic, zone=zone)
    rounded_length = math.ceil(min_length / _ROAD_STEP) * _ROAD_STEP
    return sample_traffic, road.extend_to(max(road.length, rounded_length))


def _check_lanes(specification: Specification, flow: FlowTraffic, road: Road) -> None:
    """ConfigError unless the specification describes the traffic of each lane of the road."""
    if len(flow.lanes) != road.num_lanes:
        raise ConfigError(
            what="traffic.lanes",
            where=f"specification {specification.name} on road {road.name}",
            expected=f"{road.num_lanes} lanes, as the road has",
            got=len(flow.lanes),
            next_step="describe every lane, or choose another road",
        )


def _check_two_directions(specification: Specification, road: Road) -> None:
    """ConfigError unless the road has one lane in each direction.

    The error says if the road has oncoming traffic (`road.is_two_way`), but several lanes in a
    direction, because the oncoming traffic of such a road cannot be simulated.
    """
    if not has_two_directions(road):
        raise ConfigError(
            what="traffic.mode",
            where=f"specification {specification.name} on road {road.name}",
            expected="a two-way road with one lane in each direction",
            got=f"{road.num_lanes} lanes in one direction"
            + (" beside oncoming traffic" if road.is_two_way else ""),
            next_step="choose the road named rural, or another profile",
        )


def _placed_road_length(
    specification: Specification, traffic: PlacedTraffic, zone: StartZone
) -> float:
    """Length of a road that no placed vehicle leaves before the horizon [m].

    A vehicle that overtakes may exceed its desired speed, by `PASSING_SPEED_FACTOR` at most.
    """
    max_speed = PASSING_SPEED_FACTOR * max_placed_desired_speed(specification.drivers, traffic)
    return zone.high + max_speed * specification.time.horizon_s


def _sample_block(
    block: SampleBlock, sample_traffic: TrafficSampler, modify: ScenarioModifier | None
) -> Scenario:
    """The scenarios of a block.

    Args:
        block: The simulations that are drawn together, with their random numbers.
        sample_traffic: Draws vehicles and drivers, and returns a function for their stations.
        modify: Changes weather or drivers before starts are computed; None for no change.
    """
    weather = sample_weather(block)
    start = sample_traffic(block)
    scenario = _scenario_before_start(block, start, weather)
    if modify is not None:
        scenario = modify(scenario)
    s, speed = _start_states(block.specification.starts, start, scenario)
    if start.is_oncoming is not None:
        # Samplers count stations of oncoming vehicles from the far end of the road; a `Scenario`
        # counts all stations from its beginning.
        s = np.where(start.is_oncoming, np.float32(block.road.length) - s, s)
    return scenario.replace(start_s=s, start_speed=speed)


def _scenario_before_start(block: SampleBlock, start: TrafficStart, weather: Weather) -> Scenario:
    """Scenarios whose vehicles have lanes, but zeros in place of stations and speeds."""
    specification = block.specification
    # Lateral pushes in place of the physical effects of the weather; None for physical effects.
    pushes = specification.weather.pushes
    not_yet_known = np.zeros_like(start.drivers.desired_speed)
    return Scenario(
        profile=specification.name,
        road=block.road,
        seed=block.seed,
        frame_interval_ms=specification.profile.frame_interval_ms,
        scenario_index=block.scenario_index,
        horizon=np.full(block.scenario_index.shape, specification.time.horizon_s, np.float32),
        attempt_deadline=start.deadline,
        # The weight of importance sampling is complete, because no number is drawn after weather
        # and traffic.
        weight=block.proposal.weight_so_far,
        vehicles=start.vehicles,
        drivers=start.drivers,
        weather=weather,
        start_s=not_yet_known,
        start_lane=start.lane,
        start_speed=not_yet_known,
        pushes=pushes.lateral_pushes if pushes else None,
    )


def _start_states(section: StartsSection, start: TrafficStart, scenario: Scenario) -> StartStates:
    """Stations in each vehicle's own direction [m] and speeds [m/s], safe for every driver.

    Args:
        section: Section `[starts]` of the specification.
        start: Traffic as its sampler returns it.
        scenario: The scenarios with their final weather and drivers.
    """
    conditions = scene_conditions(scenario)
    factors = desired_speed_factors(scenario, conditions)
    desired_speed = adapted_speed(factors, np.float32(scenario.road.speed_limit))
    desired_speed = minimum(desired_speed, scenario.vehicles.max_speed)
    states = start.states_at_speed(desired_speed)
    road_speeds = _speeds_for_road(scenario, factors, conditions.max_lateral_accel)
    if road_speeds is not None:
        # Speeds in bends depend on the stations, and the stations on the speeds, because gaps grow
        # with speed. The vehicles are placed a second time with the speeds for their first
        # stations. Further rounds are not needed: `repair_starts` slows vehicles that are still too
        # fast.
        limited_speed = minimum(desired_speed, road_speeds.speeds_of_all(states.s, start.lane))
        states = start.states_at_speed(limited_speed)
    drawn = DrawnStarts(
        valid=scenario.vehicles.valid,
        lane=start.lane,
        s=states.s,
        speed=states.speed,
        kept_gap_share=start.kept_gap_share,  # Of the drawn gap behind, when a vehicle moves back.
    )
    limits = _follower_limits(start, scenario, states.speed)
    return repair_starts(drawn, limits, section, start.zone, road_speeds)


def _follower_limits(start: TrafficStart, scenario: Scenario, speed: F32) -> FollowerLimits:
    """Properties that limit how near behind another vehicle each vehicle may start.

    Args:
        start: Traffic as its sampler returns it.
        scenario: The scenarios with their final weather and drivers.
        speed: Speed at the start, shape (simulation, vehicle) [m/s].
    """
    # Water drains from the middle of a two-way road to both edges, so the film of water on the
    # oncoming lane is the film of lane 0.
    drainage_lane = start.lane
    if start.is_oncoming is not None:
        drainage_lane = np.where(start.is_oncoming, np.uint8(0), start.lane)
    # Where lateral pushes stand for the weather (`Scenario.pushes`), the road is dry.
    weather = with_effective_weather(scenario).weather
    return FollowerLimits(
        length=scenario.vehicles.length,
        reaction_time=scenario.drivers.reaction_time,
        decel=assumed_start_decel(scenario.vehicles, weather, scenario.road, drainage_lane, speed),
    )


def _speeds_for_road(
    scenario: Scenario, factors: DesiredSpeedFactors, max_lateral_accel: F32
) -> RoadSpeeds | None:
    """Speeds for bends and local limits; None on a straight and level road with one limit.

    Args:
        scenario: A batch of scenarios.
        factors: Quantities that decide the desired speeds under a limit.
        max_lateral_accel: Largest lateral acceleration that drivers accept in a bend, shape
            (simulation,) [m/s^2].
    """
    road = road_parameters(scenario.road)
    if not road.varies_along_road:
        return None
    shape = scenario.start_s.shape
    return RoadSpeeds(
        road=road,
        speed_limit=np.float32(scenario.road.speed_limit),
        max_lateral_accel=max_lateral_accel,
        factors=DesiredSpeedFactors(*(np.broadcast_to(factor, shape) for factor in factors)),
    )
