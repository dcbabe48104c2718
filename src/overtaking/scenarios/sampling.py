"""From a specification, a road, a seed and simulation numbers to a batch of scenarios."""

import math
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from overtaking.core.arrays import F32, U8, U64
from overtaking.core.checks import check_whole_number
from overtaking.core.compiled import minimum
from overtaking.core.errors import ConfigError, InfeasibleError
from overtaking.core.units import kmh_from_mps, mps_from_kmh
from overtaking.knowledge import VEHICLE_CLASS_ORDER
from overtaking.model.batch import Batch, concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.scenarios import natural, ways
from overtaking.scenarios.bodies import (
    lifted,
    longest,
    placed_kinds,
    sample_bodies,
    top_speeds,
)
from overtaking.scenarios.grip import usable_decel
from overtaking.scenarios.layout import Draft, Followers, Paces, Zone, draw_layout, settle
from overtaking.scenarios.natural import PASSING_MARGIN, Start
from overtaking.scenarios.people import drivers_of, fastest_wish, sample_traits
from overtaking.scenarios.proposal import Bending
from overtaking.scenarios.schema import Spec, Traffic
from overtaking.scenarios.schema_flow import Flow
from overtaking.scenarios.schema_ways import TwoWay
from overtaking.scenarios.weather import sample_weather
from overtaking.world.conditions import acting, world_of
from overtaking.world.constants import constants
from overtaking.world.effects import Effects
from overtaking.world.lanes import allowed_speed, bend_speed, has_two_directions, road_parameters
from overtaking.world.people import Wish, adapted_speed, wanted_speed, wishes

T = TypeVar("T", bound=np.generic)
B = TypeVar("B", bound=Batch)

Altered = Callable[[Scenario], Scenario]

BLOCK = 2048
"""Simulations that are worked on at a time: few enough for their arrays to stay in the cache."""

MAX_SEED = 2**64 - 1

_SLACK = 0.01  # Metres of a zone that rounding may take.
_ROAD_STEP = 100.0  # Extended roads have round lengths.


def sample(
    spec: Spec, road: Road, seed: int, index: ArrayLike, changed: Altered | None = None
) -> Scenario:
    """A batch of scenarios.

    Simulation number n is the same whatever else is in the batch, and has the same bits on every
    machine.

    Args:
        spec: What to sample.
        road: Where; extended to as long as the horizon needs.
        seed: Seed of the data set, 0 <= seed < 2**64.
        index: Numbers of the simulations, shape (simulation,).
        changed: Alters weather and drivers before what depends on them is worked out from the same
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
    start, long_road = _starter(spec, road)
    blocks = [
        _block(spec, long_road, start, seed, numbers[first : first + BLOCK], changed)
        for first in range(0, max(len(numbers), 1), BLOCK)
    ]
    return concatenate(blocks) if len(blocks) > 1 else blocks[0]


def _zone(spec: Spec, traffic: Traffic, road: Road) -> Zone:
    """Where vehicles may start on a road.

    Raises:
        ConfigError: The zone or a lane is not on the road.
        InfeasibleError: The zone is too small, or a vehicle too slow, for the specification.
    """
    lanes = _ego_lanes(spec, traffic, road)
    low, high = _stretch(spec, traffic, road)
    _check_speeds(spec, traffic)
    room = longest(traffic) + spec.starts.min_gap_m
    fit = math.floor((high - low - _SLACK) / room) + 1 if high - low > _SLACK else 1
    most = traffic.vehicles[1]
    if fit < 2 or fit * road.num_lanes < most:
        raise InfeasibleError.of(
            what="traffic.vehicles",
            where=f"specification {spec.name}",
            expected=f"at most {fit * road.num_lanes if fit > 1 else 1} on {high - low:g} m of "
            f"{road.num_lanes} lanes, with {room:.1f} m for each vehicle",
            got=most,
            next_step="ask for fewer vehicles, a longer zone, or smaller gaps",
        )
    return Zone(low=low, high=high, ego_lanes=lanes, num_lanes=road.num_lanes, most_in_lane=fit)


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


def _stretch(spec: Spec, traffic: Traffic, road: Road) -> tuple[float, float]:
    """The zone of the starts along the road [m]."""
    key, ends = "spawn_s_m", traffic.spawn_s_m
    if traffic.spawn_x_m is not None:
        key = "spawn_x_m"
        middle = 0.5 * (road.boundaries[0] + road.boundaries[-1])
        _, y = road.world(0.5 * road.length, middle)
        along, _ = road.road_coordinates(np.array(traffic.spawn_x_m), np.full(2, float(y)))
        ends = (float(along.min()), float(along.max()))
    assert ends is not None  # The specification has one of the two.
    half = 0.5 * longest(traffic)
    if ends[0] < half or ends[1] > road.length - half:
        # As long as the profile's where the road allows, in whole metres.
        first = math.ceil(half)
        last = math.floor(min(road.length - half, first + ends[1] - ends[0] + _SLACK))
        ready = f"add --set traffic.spawn_s_m={first}..{last}"
        raise ConfigError.of(
            what=f"traffic.{key}",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{half:g} to {road.length - half:g} m along the road, so that all are on it",
            got=f"{ends[0]:g} to {ends[1]:g} m along it",
            next_step=ready if last > first else "choose a longer road",
        )
    return ends


def _ego_lanes(spec: Spec, traffic: Traffic, road: Road) -> tuple[int, ...]:
    """Lanes for the ego: never the fastest, beside which there is none to overtake in."""
    given = traffic.ego_lanes
    lanes = tuple(range(road.num_lanes - 1)) if given is None else given
    if not lanes or max(lanes) > road.num_lanes - 2:
        raise ConfigError.of(
            what="traffic.ego_lanes",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"lanes with one on their faster side, 0 to {road.num_lanes - 2}"
            if road.num_lanes > 1
            else "a road with at least two lanes",
            got=list(lanes) or f"{road.num_lanes} lane",
            next_step="leave out the fastest lane" if lanes else "choose another road",
        )
    return lanes


def _check_speeds(spec: Spec, traffic: Traffic) -> None:
    """InfeasibleError if a type of vehicle is slower than the slowest speed asked for."""
    for key, low, weights in (
        ("speed_kmh", traffic.speed_kmh[0], traffic.types),
        ("speed_kmh", traffic.speed_kmh[0], traffic.ego_types),
        ("lead_speed_kmh", traffic.lead_speed_kmh[0], traffic.types),
    ):
        for name, weight in weights.items():
            top = float(top_speeds()[VEHICLE_CLASS_ORDER.index(name)])
            if weight > 0.0 and top < mps_from_kmh(low):
                raise InfeasibleError.of(
                    what=f"traffic.{key}",
                    where=f"specification {spec.name}",
                    expected=f"a speed that type {name} reaches, {kmh_from_mps(top):g} km/h",
                    got=f"{low:g} km/h at least",
                    next_step=f"lower it or leave out {name}",
                )


def _check_flow(spec: Spec, flow: Flow, road: Road) -> None:
    """ConfigError unless the traffic is described for each lane of the road."""
    if len(flow.lanes) != road.num_lanes:
        raise ConfigError.of(
            what="traffic.lanes",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{road.num_lanes} lanes, as the road has",
            got=len(flow.lanes),
            next_step="describe every lane, or choose another road",
        )


def _check_ways(spec: Spec, road: Road) -> None:
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


def _needed_length(spec: Spec, traffic: Traffic, road: Road, zone: Zone) -> float:
    """Length of a road that no vehicle leaves before the horizon [m]."""
    fastest = PASSING_MARGIN * fastest_wish(spec.drivers, traffic)
    return max(road.length, _round(zone.high + fastest * spec.time.horizon_s))


def _round(length: float) -> float:
    """The next round length [m]."""
    return math.ceil(length / _ROAD_STEP) * _ROAD_STEP


def long_enough(spec: Spec, road: Road) -> Road:
    """The road that a data set of a specification has: oncoming vehicles start at its far end.

    On roads of one direction how long the road is changes nothing, and it is kept as it was given.
    """
    if not isinstance(spec.traffic, TwoWay):
        return road
    return _starter(spec, road)[1]


Starter = Callable[[int, "U64", Bending], Start]
"""Seed, numbers and proposal to what starts."""


def _starter(spec: Spec, road: Road) -> tuple[Starter, Road]:
    """What draws the traffic of a specification, and the road, as long as it takes."""
    traffic = spec.traffic
    if isinstance(traffic, Flow):
        _check_flow(spec, traffic, road)
        long_road = road.extended(max(road.length, _round(natural.road_length(spec, traffic))))
        return partial(natural.start, spec, traffic, long_road), long_road
    if isinstance(traffic, TwoWay):
        _check_ways(spec, road)
        long_road = road.extended(max(road.length, _round(ways.road_length(spec, traffic))))
        return partial(ways.start, spec, traffic, long_road), long_road
    zone = _zone(spec, traffic, road)
    long_road = road.extended(_needed_length(spec, traffic, road, zone))
    return partial(_placed, spec, traffic, zone), long_road


def _placed(
    spec: Spec,
    traffic: Traffic,
    zone: Zone,
    seed: int,
    index: U64,
    bend: Bending,
) -> Start:
    """Vehicles each on its own, as in the study."""
    bodies = sample_bodies(
        partial(placed_kinds, traffic), traffic.colours, seed, index, traffic.vehicles[1]
    )
    traits = sample_traits(spec.drivers, seed, index, bodies.kind, bend)
    draft = draw_layout(traffic, zone, seed, index, bodies.kind)
    drivers = drivers_of(traits, draft.speed, top_speeds()[bodies.kind])
    vehicles = lifted(bodies.replace(valid=draft.valid), drivers.desired_speed)
    return Start(
        vehicles=vehicles,
        drivers=drivers,
        lane=draft.lane,
        kept=draft.kept,
        zone=zone,
        pace=lambda _: (draft.s, draft.speed),  # They come with their speeds, whatever the weather.
        deadline=np.full(index.shape, spec.time.attempt_deadline_s, np.float32),
    )


def _block(
    spec: Spec,
    road: Road,
    starter: Starter,
    seed: int,
    index: U64,
    changed: Altered | None,
) -> Scenario:
    """The scenarios of a block; `changed` as in `sample`."""
    bend = Bending(spec.proposal, seed, index)
    weather = sample_weather(spec.weather, seed, index, bend)
    start = starter(seed, index, bend)
    unpaced = np.zeros_like(start.drivers.desired_speed)
    scenario = Scenario(
        profile=spec.name,
        road=road,
        seed=seed,
        frame_interval_ms=spec.profile.frame_interval_ms,
        index=index,
        horizon=np.full(index.shape, spec.time.horizon_s, np.float32),
        attempt_deadline=start.deadline,
        weight=bend.weight,
        vehicles=start.vehicles,
        drivers=start.drivers,
        weather=weather,
        start_s=unpaced,
        start_lane=start.lane,
        start_speed=unpaced,
        pushes=spec.weather.pushes and spec.weather.pushes.value,
    )
    scenario = scenario if changed is None else changed(scenario)
    wanted, paces = wanted_speed(scenario), _paces(scenario)
    s, speed = start.pace(wanted)
    if paces is not None:
        # Who drives slowly through a bend is followed slowly.
        slots = np.arange(s.shape[1])[:, None]
        s, speed = start.pace(minimum(wanted, paces(s.T, start.lane.T, slots).T))
    draft = Draft(valid=scenario.vehicles.valid, lane=start.lane, s=s, speed=speed, kept=start.kept)
    lane = start.lane if start.turned is None else np.where(start.turned, np.uint8(0), start.lane)
    followers = Followers(
        length=scenario.vehicles.length,
        reaction_time=scenario.drivers.reaction_time,
        decel=usable_decel(scenario.vehicles, acting(scenario).weather, road, lane, speed),
    )
    s, speed = settle(draft, followers, spec.starts, start.zone, paces)
    if start.turned is not None:
        s = np.where(start.turned, np.float32(road.length) - s, s)
    return scenario.replace(start_s=s, start_speed=speed)


def _paces(scenario: Scenario) -> Paces | None:
    """The speeds that drivers choose for bends and limits; None on a road that does not vary."""
    road, c = road_parameters(scenario.road), constants()
    if not road.course.shape[1]:
        return None
    side_accel = world_of(acting(scenario), c, Effects()).step.side_accel
    each = [np.broadcast_to(row, scenario.start_s.shape) for row in wishes(scenario)]
    simulation, limit = np.arange(scenario.num_simulations), np.float32(scenario.road.speed_limit)

    def chosen(s: F32, lane: U8, slot: NDArray[np.intp]) -> F32:
        turned = lane >= road.own_lanes
        allowed = allowed_speed(c, road, s, turned)
        wanted = adapted_speed(Wish(*(row[simulation, slot] for row in each)), allowed)
        # Under the limit of the road they start as anywhere.
        wanted = np.where(allowed < limit, wanted, np.float32(np.inf))
        return minimum(bend_speed(c, road, side_accel, s, turned), wanted)

    return chosen
