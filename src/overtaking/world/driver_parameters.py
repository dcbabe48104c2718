"""What drivers give the step: speeds, following, passing."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32
from overtaking.core.float32_math import clamp, exp, maximum, minimum
from overtaking.core.random_numbers import PhiloxStream, Stream
from overtaking.knowledge.toml_reader import constant
from overtaking.model.scenario import Scenario
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world import road_surface, visibility
from overtaking.world.constants import (
    DECISIONS_PER_SECOND,
    EnabledEffects,
    ModelConstants,
    model_constants,
)
from overtaking.world.road_parameters import refuse_oncoming, road_parameters
from overtaking.world.vehicle_parameters import FieldArrays
from overtaking.world.weather_parameters import (
    SceneConditions,
    scene_conditions,
    with_effective_weather,
)

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)

_NEVER = np.float32(1e9)
"""A threshold that no incentive to change lanes reaches [m/s^2]."""

_UNLIMITED_FRICTION = np.float32(10.0)
"""A friction coefficient that no tyre reaches."""

MIN_ILLUMINANCE = np.float32(1e-12)
"""Keeps the range of lamps finite where light has no limit [lx]."""

_QUINTIC_PEAK = np.float32(5.77)
"""Largest acceleration of a quintic path from rest to rest, 10 / sqrt(3), in D / T^2."""


def driver_parameters(
    scenario: Scenario, c: ModelConstants, world: SceneConditions, effects: EnabledEffects
) -> FieldArrays:
    """The parameters of the step that people decide, but for those that are traits as they are.

    Args:
        scenario: A batch of scenarios.
        c: Constants.
        world: Its weather and light.
        effects: Ablations.
    """
    return (
        _speeds(scenario, world, c)
        | _following(scenario, c, world)
        | _reaction(scenario, world, effects)
        | _limits(scenario, c)
        | _lane_changes(scenario, world, effects)
        | {"inverse_patience": _ONE / scenario.drivers.patience}
    )


def wanted_speed(scenario: Scenario) -> F32:
    """Speed that each driver wants in its weather and vehicle, (simulation, vehicle) [m/s]."""
    adapted = adapted_speed(desired_speed_factors(scenario), np.float32(scenario.road.speed_limit))
    return minimum(adapted, scenario.vehicles.max_speed)


def _speeds(scenario: Scenario, world: SceneConditions, c: ModelConstants) -> FieldArrays:
    """What drivers want under the limit of the road; with `RoadCourse.limits` the highest one."""
    top, limit = scenario.vehicles.max_speed, np.float32(scenario.road.speed_limit)
    desired = minimum(adapted_speed(_wishes(scenario, c, world), limit), top)
    return {
        "desired_speed": desired,
        "pass_speed": minimum(desired * c.pass_speed_factor, top),
        "free_speed": scenario.drivers.desired_speed,
    }


def _following(scenario: Scenario, c: ModelConstants, world: SceneConditions) -> FieldArrays:
    """Parameters of the intelligent driver model.

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), chapter 11: the factor of v dv in s* is
        1 / (2 sqrt(a b)), the exponent above the desired speed 4 a / b.
    """
    p = scenario.drivers
    usable = constant("model.following.grip_share") * c.gravity * world.believed_friction[:, None]
    return {
        "interaction": np.float32(0.5) / np.sqrt(p.accel * p.decel),
        "overspeed_exponent": constant("model.following.free_exponent") * p.accel / p.decel,
        "hardest_decel": minimum(scenario.vehicles.peak_decel, usable),
    }


def _reaction(scenario: Scenario, world: SceneConditions, effects: EnabledEffects) -> FieldArrays:
    """Reaction times in whole decisions, longer at night and in haze, and when it is urgent."""
    night = constant("model.perception.reaction_night_factor")
    haze = constant("model.perception.reaction_haze_factor")
    fog = visibility.extinction_of_range(constant("model.perception.fog_range"))
    hazy = (world.step.fog_extinction > fog) | (
        world.rain_rate > constant("model.perception.heavy_rain_mmph")
    )
    slower = np.where(scenario.weather.night, night, _ONE)[:, None]
    usual = scenario.drivers.reaction_time * slower * np.where(hazy, haze, _ONE)[:, None]
    return {
        "reaction_ticks": _ticks(usual, effects),
        "urgent_ticks": _ticks(scenario.drivers.reaction_time, effects),
    }


def _ticks(reaction: F32, effects: EnabledEffects) -> F32:
    """A reaction time in whole decisions, as far back as is remembered; none without delay."""
    ticks = minimum(np.rint(reaction * DECISIONS_PER_SECOND), constant("model.perception.history"))
    return ticks if effects.delay else np.zeros_like(ticks)


def _limits(scenario: Scenario, c: ModelConstants) -> FieldArrays:
    """How far ahead each driver attends to, and the most friction that its tyres find.

    Alike for all; `benchmarks/nets.py` lowers them for an ego that does not know of it.
    """
    shape = scenario.drivers.reaction_time
    return {
        "attention": np.full_like(shape, c.sight_range),
        "most_friction": np.full_like(shape, _UNLIMITED_FRICTION),
    }


def _lane_changes(
    scenario: Scenario, world: SceneConditions, effects: EnabledEffects
) -> FieldArrays:
    p = scenario.drivers
    threshold = p.lane_change_threshold
    quickest = min_change_duration_by_friction(scenario, world)[:, None]
    gain = p.passing_gain
    if not effects.mobil:
        threshold = np.full_like(threshold, _NEVER)
        gain = np.where(np.arange(gain.shape[1]) == EGO_SLOT, gain, _NEVER)
    return {
        "threshold": threshold,
        "passing_gain": gain,
        "bias": p.right_bias,
        "lane_change_duration": maximum(p.lane_change_duration, quickest),
    }


def min_change_duration_by_friction(scenario: Scenario, world: SceneConditions) -> F32:
    """Shortest lane change that the believed grip allows, shape (simulation,) [s]."""
    borders = road_parameters(scenario.road).boundaries
    width = borders[1] - borders[0]
    share = constant("model.lane_change.accel_share")
    return np.sqrt(_QUINTIC_PEAK * width / (share * world.step.side_accel))


class DesiredSpeedFactors(NamedTuple):
    """What the speed that a driver wants follows from; arrays of shapes that go together.

    Attributes:
        free: Wanted on a free road in good weather, without a limit [m/s].
        speed_limit_compliance: Share of the excess over a limit that is given up [1].
        caution: Share of what weather and light take off [1].
        rain_slowing: By how much a fully cautious driver slows for rain [m/s].
        stoppable: Speed from which one stops within sight of a lit vehicle [m/s].
    """

    free: F32
    speed_limit_compliance: F32
    caution: F32
    rain_slowing: F32
    stoppable: F32


def adapted_speed(wish: DesiredSpeedFactors, limit: F32 | np.float32) -> F32:
    """Speed that drivers want under a limit in their weather and light [m/s].

    A cautious driver slows for heavy rain as measured on motorways, and to a speed from which the
    vehicle stops within sight of a lit one; a careless one does not.
    """
    wanted = wish.free - wish.speed_limit_compliance * maximum(wish.free - limit, _ZERO)
    excess = maximum(wanted - wish.rain_slowing - wish.stoppable, _ZERO)
    return wanted - wish.caution * (wish.rain_slowing + excess)


def desired_speed_factors(scenario: Scenario) -> DesiredSpeedFactors:
    """Those of all drivers, each array of shape (simulation, vehicle) or (simulation, 1)."""
    c = model_constants()
    return _wishes(
        with_effective_weather(scenario), c, scene_conditions(scenario, c, EnabledEffects())
    )


def _wishes(scenario: Scenario, c: ModelConstants, world: SceneConditions) -> DesiredSpeedFactors:
    p, each = scenario.drivers, weather_slowing(scenario, c, world)
    slowing, stoppable = (each[name][:, None] for name in ("rain_slowing", "stoppable_speed"))
    return DesiredSpeedFactors(p.desired_speed, p.limit_respect, p.caution, slowing, stoppable)


def weather_slowing(
    scenario: Scenario, c: ModelConstants, world: SceneConditions
) -> dict[str, F32]:
    """The fields of `SimulationParameters` by which drivers slow down, each (simulation,).

    Args:
        scenario: A batch of scenarios.
        c: Constants.
        world: Its weather and light.
    """
    return {
        "rain_slowing": _rain_slowing(world),
        "stoppable_speed": _stoppable_speed(scenario, c, world),
    }


def _rain_slowing(world: SceneConditions) -> F32:
    """By how much a fully cautious driver slows for rain, shape (simulation,) [m/s]."""
    heavy = constant("model.speed_choice.rain_from_mmph")
    beyond = (world.rain_rate - heavy) / constant("model.speed_choice.rain_span_mmph")
    least = constant("model.speed_choice.rain_min_slowing")
    more = constant("model.speed_choice.rain_more_slowing") * clamp(beyond, _ZERO, _ONE)
    return np.where(world.rain_rate > heavy, least + more, _ZERO)


def _stoppable_speed(scenario: Scenario, c: ModelConstants, world: SceneConditions) -> F32:
    """Speed from which one stops within sight of a lit vehicle, shape (simulation,) [m/s]."""
    sight = world.step
    rain_factor = constant("model.speed_choice.rain_sight_factor")
    extinction = sight.fog_extinction + rain_factor * sight.rain_extinction
    contrast = exp(sight.sight_front) * constant("model.speed_choice.contrast")
    by_contrast = visibility.contrast_range(extinction, contrast, np.ones_like(extinction))
    tail = np.full_like(extinction, constant("weather.lamps.rear_position"))
    by_lamp = visibility.lamp_range(
        extinction, tail, maximum(sight.lamp_threshold, MIN_ILLUMINANCE)
    )
    seen = np.where(scenario.weather.night, by_lamp, maximum(by_contrast, by_lamp))
    reaction = np.full_like(seen, constant("model.speed_choice.reaction_time"))
    decel = constant("model.speed_choice.grip_share") * c.gravity * world.believed_friction
    return road_surface.stoppable_speed(seen, reaction, decel)


_BY_DRIVER = (
    "unseen_trust",
    "spare",
    "limit",
    "makes_room",
    "passed_factor",
)
"""What `passing_parameters` gives each vehicle."""
_MIN_DEMAND = np.float32(0.1)  # Keeps the trust of who demands no gap finite.
_FAINTEST = np.float32(1e-12)  # Keeps the range of lamps finite where light has no limit [lx].


def passing_parameters(
    scenario: Scenario, world: SceneConditions, effects: EnabledEffects
) -> tuple[dict[str, NDArray[Any]], FieldArrays]:
    """The fields of `SimulationParameters` and of `VehicleParameters` for two directions.

    Args:
        scenario: A batch of scenarios.
        world: Its weather and light.
        effects: Ablations.
    """
    if not road_parameters(scenario.road).two_way:
        refuse_oncoming(
            scenario, "a road that is not two equally wide lanes, one in each direction"
        )
        return {}, dict.fromkeys(_BY_DRIVER, np.zeros_like(scenario.start_s))
    return _oncoming_judgement(scenario, world, effects), _passing(
        scenario
    ) | _reaction_to_being_passed(scenario)


def _oncoming_judgement(
    scenario: Scenario, world: SceneConditions, effects: EnabledEffects
) -> dict[str, NDArray[Any]]:
    """How drivers judge the distance and the speed of who comes.

    Source:
        Attwood 1976 (more scatter in the dark).
    """
    night = scenario.weather.night
    day, dark = (
        constant("model.oncoming.distance_cv_day"),
        constant("model.oncoming.distance_cv_night"),
    )
    limit = constant("model.oncoming.expected_speed_share") * np.float32(scenario.road.speed_limit)
    return {
        "oncoming_error": np.where(night, dark, day)
        if effects.distance_error
        else np.zeros(night.shape),
        "oncoming_sight": _sight(scenario, world),
        "usual_speed": np.full(night.shape, limit),
        "hasty_change": maximum(
            min_change_duration_by_friction(scenario, world),
            constant("model.oncoming.hasty_change"),
        ),
    }


def _passing(scenario: Scenario) -> FieldArrays:
    """What each driver wants to spare, and how far it trusts the unseen road to be free."""
    demand = scenario.drivers.gap_acceptance
    return {
        "unseen_trust": constant("model.oncoming.assumed_sight_factor")
        / np.sqrt(maximum(demand, _MIN_DEMAND)),
        "spare": constant("model.oncoming.time_reserve_share") * demand,
        "limit": np.full_like(scenario.start_s, scenario.road.speed_limit),
    }


def _sight(scenario: Scenario, world: SceneConditions) -> F32:
    """How far an oncoming car of middling colour with low beams is seen, (simulation,) [m]."""
    step = world.step
    rain = constant("model.speed_choice.rain_sight_factor") * step.rain_extinction
    extinction = step.fog_extinction + rain
    contrast = exp(step.sight_front) * constant("model.speed_choice.contrast")
    by_contrast = visibility.contrast_range(extinction, contrast, np.ones_like(extinction))
    lamps = np.full_like(extinction, constant("model.lights.headlamp"))
    by_lamp = visibility.lamp_range(extinction, lamps, maximum(step.lamp_threshold, _FAINTEST))
    lit = with_effective_weather(scenario).weather.night | (world.rain_rate > 0)
    by_day = np.where(lit, maximum(by_contrast, by_lamp), by_contrast)
    seen = np.where(scenario.weather.night, by_lamp, by_day)
    return minimum(seen, constant("model.oncoming.range"))


def _reaction_to_being_passed(scenario: Scenario) -> FieldArrays:
    """Behaviour of each driver while being passed: makes room, yields, or speeds up."""
    # A separate stream, so that these draws change no other draw and no column of a data set.
    slots = np.uint32(Stream.BEING_PASSED) + np.arange(scenario.num_slots, dtype=np.uint32)
    draws = PhiloxStream(scenario.seed, scenario.index[:, None], slots)
    moves = draws.uniform() < constant("model.oncoming.edge_shift_share")
    manner = draws.uniform()
    yields = manner < constant("model.oncoming.yields_share")
    races = manner > _ONE - constant("model.oncoming.races_share")
    yielding, racing = (
        constant("model.oncoming.yields_factor"),
        constant("model.oncoming.races_factor"),
    )
    return {
        "makes_room": np.where(moves, constant("model.oncoming.edge_shift_when_passed"), _ZERO),
        "passed_factor": np.where(yields, yielding, np.where(races, racing, _ONE)),
    }
