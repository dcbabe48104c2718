"""From a specification, a road, a seed and simulation numbers to a batch of scenarios."""

import math
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overtaking.core.arrays import F32, U8, U64
from overtaking.core.errors import ConfigError, check_whole_number
from overtaking.core.native import minimum
from overtaking.model.batch import Batch, concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.scenarios import motorway_traffic, two_way_traffic
from overtaking.scenarios.driver_sampling import (
    max_placed_desired_speed,
)
from overtaking.scenarios.motorway_traffic import PASSING_MARGIN
from overtaking.scenarios.placed_traffic import (
    sample_placed_traffic,
    start_zone,
)
from overtaking.scenarios.random_draws import NumberTransform, ProposalSampler
from overtaking.scenarios.safe_start import (
    DrawnStarts,
    FollowerLimits,
    RoadSpeeds,
    StartZone,
    TrafficStart,
    assumed_start_decel,
    repair_starts,
)
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import FlowTraffic, PlacedTraffic, TwoWayTraffic
from overtaking.scenarios.weather_sampling import sample_weather
from overtaking.world.constants import EnabledEffects, model_constants
from overtaking.world.driver_parameters import (
    DesiredSpeedFactors,
    adapted_speed,
    desired_speed_factors,
    wanted_speed,
)
from overtaking.world.road_parameters import (
    allowed_speed,
    bend_speed,
    has_two_directions,
    road_parameters,
)
from overtaking.world.weather_parameters import scene_conditions, with_effective_weather

T = TypeVar("T", bound=np.generic)
B = TypeVar("B", bound=Batch)
ScenarioModifier = Callable[[Scenario], Scenario]

BLOCK_SIZE = 2048
"""Simulations that are worked on at a time: few enough for their arrays to stay in the cache."""
MAX_SEED = 2**64 - 1
_ROAD_STEP = 100.0  # Extended roads have round lengths.


def sample(
    spec: Specification,
    road: Road,
    seed: int,
    index: ArrayLike,
    modify: ScenarioModifier | None = None,
) -> Scenario:
    """A batch of scenarios.

    Simulation number n is the same whatever else is in the batch, and has the same bits on every
    machine.

    Args:
        spec: What to sample.
        road: Where; extended to as long as the horizon needs.
        seed: Seed of the data set, 0 <= seed < 2**64.
        index: Numbers of the simulations, shape (simulation,).
        modify: Alters weather and drivers before what depends on them is worked out from the same
            random numbers: speeds, and distances at the start.

    Returns:
        The scenarios, with the fewest `SLOTS` that hold all vehicles, the ego in slot 0 and its
        leader in slot 1.

    Raises:
        ConfigError: The seed or the numbers are out of range, or the specification does not fit
            the road.
        InfeasibleError: The zone is too small, or a vehicle too slow, for the specification.
    """
    numbers = _checked_index(index)
    seed = check_whole_number(seed, 0, MAX_SEED, what="seed", where="sample")
    start, long_road = _traffic_sampler(spec, road)
    blocks = [
        _sample_block(spec, long_road, start, seed, numbers[first : first + BLOCK_SIZE], modify)
        for first in range(0, max(len(numbers), 1), BLOCK_SIZE)
    ]
    return concatenate(blocks) if len(blocks) > 1 else blocks[0]


def _checked_index(index: ArrayLike) -> U64:
    numbers = np.asarray(index)
    whole = np.issubdtype(numbers.dtype, np.integer) or numbers.size == 0
    if numbers.ndim != 1 or not whole or (numbers.size and int(numbers.min()) < 0):
        raise ConfigError.of(
            what="index",
            where="sample",
            expected="a list of whole numbers from 0 on",
            got=f"{numbers.dtype} of shape {numbers.shape}",
            next_step="pass, for example, numpy.arange(1000)",
        )
    return numbers.astype(np.uint64)


def _check_flow(spec: Specification, flow: FlowTraffic, road: Road) -> None:
    """ConfigError unless the traffic is described for each lane of the road."""
    if len(flow.lanes) != road.num_lanes:
        raise ConfigError.of(
            what="traffic.lanes",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{road.num_lanes} lanes, as the road has",
            got=len(flow.lanes),
            next_step="describe every lane, or choose another road",
        )


def _check_ways(spec: Specification, road: Road) -> None:
    """ConfigError unless the road has one lane in each direction."""
    if not has_two_directions(road):
        raise ConfigError.of(
            what="traffic.mode",
            where=f"specification {spec.name} on road {road.name}",
            expected="a two-way road with one lane in each direction",
            got=f"{road.num_lanes} lanes in one direction"
            + (" beside oncoming traffic" if road.is_two_way else ""),
            next_step="choose the road rural, or another profile",
        )


def _needed_length(
    spec: Specification, traffic: PlacedTraffic, road: Road, zone: StartZone
) -> float:
    """Length of a road that no vehicle leaves before the horizon [m]."""
    fastest = PASSING_MARGIN * max_placed_desired_speed(spec.drivers, traffic)
    return max(road.length, _round(zone.high + fastest * spec.time.horizon_s))


def _round(length: float) -> float:
    """The next round length [m]."""
    return math.ceil(length / _ROAD_STEP) * _ROAD_STEP


def extend_road(spec: Specification, road: Road) -> Road:
    """The road that a data set of a specification has: oncoming vehicles start at its far end.

    On roads of one direction how long the road is changes nothing, and it is kept as it was given.
    """
    if not isinstance(spec.traffic, TwoWayTraffic):
        return road
    return _traffic_sampler(spec, road)[1]


TrafficSampler = Callable[[int, "U64", NumberTransform], TrafficStart]
"""Seed, numbers and proposal to what starts."""


def _traffic_sampler(spec: Specification, road: Road) -> tuple[TrafficSampler, Road]:
    """What draws the traffic of a specification, and the road, as long as it takes."""
    traffic = spec.traffic
    if isinstance(traffic, FlowTraffic):
        _check_flow(spec, traffic, road)
        long_road = road.extend_to(
            max(road.length, _round(motorway_traffic.road_length(spec, traffic)))
        )
        return partial(
            motorway_traffic.sample_motorway_traffic, spec, traffic, long_road
        ), long_road
    if isinstance(traffic, TwoWayTraffic):
        _check_ways(spec, road)
        long_road = road.extend_to(
            max(road.length, _round(two_way_traffic.road_length(spec, traffic)))
        )
        return partial(two_way_traffic.sample_two_way_traffic, spec, traffic, long_road), long_road
    zone = start_zone(spec, traffic, road)
    long_road = road.extend_to(_needed_length(spec, traffic, road, zone))
    return partial(sample_placed_traffic, spec, traffic, zone), long_road


def _sample_block(
    spec: Specification,
    road: Road,
    starter: TrafficSampler,
    seed: int,
    index: U64,
    modify: ScenarioModifier | None,
) -> Scenario:
    """The scenarios of a block; `modify` as in `sample`."""
    bend = ProposalSampler(spec.proposal, seed, index)
    weather = sample_weather(spec.weather, seed, index, bend.transform)
    start = starter(seed, index, bend.transform)
    unpaced = np.zeros_like(start.drivers.desired_speed)
    scenario = Scenario(
        profile=spec.name,
        road=road,
        seed=seed,
        frame_interval_ms=spec.profile.frame_interval_ms,
        index=index,
        horizon=np.full(index.shape, spec.time.horizon_s, np.float32),
        attempt_deadline=start.deadline,
        weight=bend.weight_so_far,
        vehicles=start.vehicles,
        drivers=start.drivers,
        weather=weather,
        start_s=unpaced,
        start_lane=start.lane,
        start_speed=unpaced,
        pushes=spec.weather.pushes and spec.weather.pushes.to_model,
    )
    scenario = scenario if modify is None else modify(scenario)
    wanted, paces = wanted_speed(scenario), _speeds_for_road(scenario)
    s, speed = start.states_at_speed(wanted)
    if paces is not None:
        # Who drives slowly through a bend is followed slowly.
        slots = np.arange(s.shape[1])[:, None]
        s, speed = start.states_at_speed(minimum(wanted, paces(s.T, start.lane.T, slots).T))
    draft = DrawnStarts(
        valid=scenario.vehicles.valid,
        lane=start.lane,
        s=s,
        speed=speed,
        kept_gap_share=start.kept_gap_share,
    )
    lane = (
        start.lane
        if start.is_oncoming is None
        else np.where(start.is_oncoming, np.uint8(0), start.lane)
    )
    followers = FollowerLimits(
        length=scenario.vehicles.length,
        reaction_time=scenario.drivers.reaction_time,
        decel=assumed_start_decel(
            scenario.vehicles, with_effective_weather(scenario).weather, road, lane, speed
        ),
    )
    s, speed = repair_starts(draft, followers, spec.starts, start.zone, paces)
    if start.is_oncoming is not None:
        s = np.where(start.is_oncoming, np.float32(road.length) - s, s)
    return scenario.replace(start_s=s, start_speed=speed)


def _speeds_for_road(scenario: Scenario) -> RoadSpeeds | None:
    """The speeds that drivers choose for bends and limits; None on a road that does not vary."""
    road, c = road_parameters(scenario.road), model_constants()
    if not road.course.shape[1]:
        return None
    side_accel = scene_conditions(
        with_effective_weather(scenario), c, EnabledEffects()
    ).step.side_accel
    each = [np.broadcast_to(row, scenario.start_s.shape) for row in desired_speed_factors(scenario)]
    simulation, limit = np.arange(scenario.num_simulations), np.float32(scenario.road.speed_limit)

    def chosen(s: F32, lane: U8, slot: NDArray[np.intp]) -> F32:
        turned = lane >= road.own_lanes
        allowed = allowed_speed(c, road, s, turned)
        wanted = adapted_speed(
            DesiredSpeedFactors(*(row[simulation, slot] for row in each)), allowed
        )
        # Under the limit of the road they start as anywhere.
        wanted = np.where(allowed < limit, wanted, np.float32(np.inf))
        return minimum(bend_speed(c, road, side_accel, s, turned), wanted)

    return chosen
