"""Speeds, following and passing of drivers, as parameters of the step.

Where lateral pushes stand for the weather (`Scenario.pushes`), the *effective* weather is a dry,
clear day, see `weather_parameters.with_effective_weather`; otherwise it is the recorded weather.
Drivers slow down and react for the effective weather. Oncoming vehicles are judged by the recorded
night: pushes stand for rain, wind and fog, and darkness remains. This matters only on two-way roads
with pushes; no profile of the package has both.
"""

from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, clamp, exp, maximum, minimum
from overtaking.core.random_numbers import PhiloxStream, Stream
from overtaking.knowledge.toml_reader import constant
from overtaking.model.scenario import Scenario
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world import road_surface, visibility
from overtaking.world.constants import DECISIONS_PER_SECOND, EnabledEffects, model_constants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.vehicle_parameters import FieldArrays
from overtaking.world.weather_parameters import (
    SceneConditions,
    StepContext,
    with_effective_weather,
)

ONCOMING_JUDGEMENT_FIELDS = (
    "oncoming_error",
    "oncoming_sight",
    "expected_oncoming_speed",
    "urgent_change_duration",
)
"""Fields of `SimulationParameters` that only a two-way road needs; 0 elsewhere."""

REACTION_TO_ONCOMING_FIELDS = (
    "assumed_sight_factor",
    "time_reserve_share",
    "speed_limit",
    "edge_shift_when_passed",
    "speed_factor_when_passed",
)
"""Fields of `VehicleParameters` that only a two-way road needs; 0 elsewhere."""

_NEVER = np.float32(1e9)
"""A threshold that no incentive to change lanes reaches [m/s^2]."""

_UNLIMITED_FRICTION = np.float32(10.0)
"""A friction coefficient that no tyre reaches."""

_QUINTIC_PEAK = np.float32(5.77)
"""Largest acceleration of a quintic path from rest to rest over a distance D in a time T, in
D / T^2: 10 / sqrt(3) = 5.7735. The rounding shortens lane changes that friction limits by 0.03 %;
another digit would change every recorded simulation with such a lane change."""

_MIN_DEMAND = np.float32(0.1)
"""Smallest `gap_demand_factor` in the formula of `unseen_trust`, which divides by its root: keeps
the trust of a driver that demands no gap finite [1]."""


class DesiredSpeedFactors(NamedTuple):
    """Quantities that decide the speed that a driver wants; the shapes broadcast.

    Attributes:
        free: Desired speed on a free road in good weather, without a limit [m/s].
        speed_limit_compliance: Share of the excess over a limit that the driver gives up [1].
        caution: Share of the slowing for weather and light that the driver applies [1].
        rain_slowing: Speed by which a fully cautious driver slows for rain [m/s].
        stoppable: Speed from which a driver stops within sight of a lit vehicle [m/s].
    """

    free: F32
    speed_limit_compliance: F32
    caution: F32
    rain_slowing: F32
    stoppable: F32


class _VisibleRange(NamedTuple):
    """Range at which drivers see another vehicle, shape (simulation,) [m]."""

    by_contrast: F32
    by_lamp: F32


def driver_parameters(context: StepContext) -> FieldArrays:
    """Fields of `VehicleParameters` that are computed from traits of drivers.

    `step_parameters.parameters` adds the traits that are fields of `VehicleParameters` as they are.

    - `desired_speed`, `pass_speed`: desired speed now and while passing; `free_speed`: desired
      speed on a free road in good weather, without a limit [m/s].
    - `interaction`: factor of speed times closing speed in the desired gap [s^2/m];
      `overspeed_exponent`: exponent of the deceleration above the desired speed [1];
      `hardest_decel`: strongest braking that the driver counts on, positive [m/s^2].
    - `reaction_ticks`, `urgent_ticks`: usual reaction time, and reaction time in danger, in
      decisions.
    - `attention`: distance to which the driver looks ahead [m]; `most_friction`: highest friction
      coefficient that the tyres find [1].
    - `threshold`, `bias`: threshold of lane changes and bias towards the slow side of the model
      MOBIL [m/s^2]; `min_speed_gain`: speed gain from which the driver overtakes [m/s];
      `lane_change_duration` [s].
    - `inverse_patience`: rate at which the demands of a waiting driver fall [1/s].

    Args:
        context: The batch, its weather and the constants.

    Returns:
        Arrays of shape (simulation, vehicle) by field.
    """
    return (
        _speeds(context)
        | _following(context)
        | _reaction(context)
        | _limits(context)
        | _lane_changes(context)
        | {"inverse_patience": ONE / context.scenario.drivers.patience}
    )


def desired_speed_factors(scenario: Scenario, conditions: SceneConditions) -> DesiredSpeedFactors:
    """Quantities that decide the desired speeds of all drivers of a batch.

    Args:
        scenario: A batch of scenarios.
        conditions: Its weather and light.

    Returns:
        Arrays of shape (simulation, vehicle), or (simulation, 1) for the effects of weather.
    """
    traits, slowing = scenario.drivers, weather_slowing(scenario, conditions)
    return DesiredSpeedFactors(
        free=traits.desired_speed,
        speed_limit_compliance=traits.speed_limit_compliance,
        caution=traits.caution,
        rain_slowing=slowing["rain_slowing"][:, None],
        stoppable=slowing["stoppable_speed"][:, None],
    )


def adapted_speed(factors: DesiredSpeedFactors, limit: F32 | np.float32) -> F32:
    """Speed that drivers want under a limit in their weather and light [m/s].

    A cautious driver slows for heavy rain as measured on motorways, and to a speed from which the
    vehicle stops within sight of a lit vehicle. A careless driver does neither.

    Args:
        factors: The quantities that decide the desired speed.
        limit: Speed limit, a shape that broadcasts with them [m/s].
    """
    excess_over_limit = maximum(factors.free - limit, ZERO)
    in_good_weather = factors.free - factors.speed_limit_compliance * excess_over_limit
    excess_over_sight = maximum(in_good_weather - factors.rain_slowing - factors.stoppable, ZERO)
    return in_good_weather - factors.caution * (factors.rain_slowing + excess_over_sight)


def weather_slowing(scenario: Scenario, conditions: SceneConditions) -> dict[str, F32]:
    """Fields of `SimulationParameters` by which drivers slow down for the effective weather.

    Args:
        scenario: A batch of scenarios.
        conditions: Its weather and light.

    Returns:
        Arrays of shape (simulation,) by field.
    """
    is_night = with_effective_weather(scenario).weather.night
    return {
        "rain_slowing": _rain_slowing(conditions),
        "stoppable_speed": _stoppable_speed(is_night, conditions),
    }


def oncoming_judgement(context: StepContext) -> dict[str, F32]:
    """How drivers judge distance and speed of oncoming vehicles.

    The errors grow in the recorded night, also where pushes stand for the weather: see the head of
    this module.

    Args:
        context: A batch on a two-way road.

    Returns:
        The `ONCOMING_JUDGEMENT_FIELDS`, each of shape (simulation,).

    Source:
        Attwood 1976 (more scatter in the dark).
    """
    scenario = context.scenario
    by_day = constant("model.oncoming.distance_cv_day")
    by_night = constant("model.oncoming.distance_cv_night")
    error = np.where(scenario.weather.night, by_night, by_day)
    expected_share = constant("model.oncoming.expected_speed_share")
    expected_speed = expected_share * np.float32(scenario.road.speed_limit)
    return {
        "oncoming_error": error if context.effects.distance_error else np.zeros_like(error),
        "oncoming_sight": _sight_of_oncoming(context),
        "expected_oncoming_speed": np.full_like(error, expected_speed),
        "urgent_change_duration": maximum(
            min_change_duration_by_friction(context), constant("model.oncoming.hasty_change")
        ),
    }


def reaction_to_oncoming(context: StepContext) -> FieldArrays:
    """Caution of each driver towards oncoming traffic, and its behaviour while being passed.

    - `unseen_trust`: the driver takes the road to be free up to this many times the sight distance
      [1].
    - `spare`: time reserve that the driver demands, over the time that passing takes [1].
    - `limit`: the limit that drivers heed while passing, the highest limit of the road [m/s]. It is
      stored for each vehicle, because on a road with several limits the step replaces it by the
      limit at the station of the vehicle.
    - `makes_room`: lateral shift to the edge of the lane while being passed [m].
    - `passed_factor`: factor on the desired speed while being passed [1].

    Args:
        context: A batch on a two-way road.

    Returns:
        The `REACTION_TO_ONCOMING_FIELDS`, each of shape (simulation, vehicle).
    """
    return _passing(context.scenario) | _reaction_to_being_passed(context.scenario)


def min_change_duration_by_friction(context: StepContext) -> F32:
    """Duration of the shortest lane change that the believed friction allows, (simulation,) [s].

    A quintic path over one lane width D in a time T reaches the lateral acceleration 5.77 D / T^2.
    The duration is the T at which this equals `model.lane_change.accel_share` of `side_accel`, the
    largest lateral acceleration that a driver chooses at the believed friction.

    Args:
        context: The batch and its weather.
    """
    # One duration serves all lanes of a road: lane 0 stands for the others.
    borders = road_parameters(context.scenario.road).boundaries
    width = borders[1] - borders[0]
    share = constant("model.lane_change.accel_share")
    return np.sqrt(_QUINTIC_PEAK * width / (share * context.conditions.max_lateral_accel))


def _speeds(context: StepContext) -> FieldArrays:
    """Desired speeds under `Road.speed_limit`, the highest limit of the road.

    Where a lower limit holds, the step lowers them by the table `RoadParameters.course`.
    """
    scenario = context.scenario
    max_speed, limit = scenario.vehicles.max_speed, np.float32(scenario.road.speed_limit)
    factors = desired_speed_factors(scenario, context.conditions)
    desired = minimum(adapted_speed(factors, limit), max_speed)
    return {
        "desired_speed": desired,
        "passing_speed": minimum(desired * context.constants.passing_speed_factor, max_speed),
        "free_speed": scenario.drivers.desired_speed,
    }


def _following(context: StepContext) -> FieldArrays:
    """Parameters of the intelligent driver model.

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), chapter 11: the factor of v dv in s* is
        1 / (2 sqrt(a b)), the exponent above the desired speed 4 a / b.
    """
    traits, friction = context.scenario.drivers, context.conditions.believed_friction
    grip_share = constant("model.following.grip_share")
    usable_decel = grip_share * context.constants.gravity * friction[:, None]
    return {
        "idm_interaction": HALF / np.sqrt(traits.accel * traits.decel),
        "overspeed_exponent": constant("model.following.free_exponent")
        * traits.accel
        / traits.decel,
        "max_assumed_decel": minimum(context.scenario.vehicles.peak_decel, usable_decel),
    }


def _reaction(context: StepContext) -> FieldArrays:
    """Reaction times in decisions: usual ones, longer at night and in haze, and urgent ones."""
    conditions = context.conditions
    reaction_time = context.scenario.drivers.reaction_time
    fog = visibility.extinction_of_range(constant("model.perception.fog_range"))
    is_hazy = (conditions.fog_extinction > fog) | (
        conditions.rain_rate > constant("model.perception.heavy_rain_mmph")
    )
    is_night = context.effective_scenario.weather.night
    night_factor = np.where(is_night, constant("model.perception.reaction_night_factor"), ONE)
    haze_factor = np.where(is_hazy, constant("model.perception.reaction_haze_factor"), ONE)
    usual = reaction_time * night_factor[:, None] * haze_factor[:, None]
    return {
        "reaction_delay": _whole_decisions(usual, context.effects),
        "urgent_reaction_delay": _whole_decisions(reaction_time, context.effects),
    }


def _whole_decisions(reaction_time: F32, effects: EnabledEffects) -> F32:
    """A reaction time in decisions, at most the remembered ones; 0 if the effect is disabled."""
    # The step keeps only so many earlier decisions.
    history = constant("model.perception.history")
    delay = minimum(np.rint(reaction_time * DECISIONS_PER_SECOND), history)
    return delay if effects.delay else np.zeros_like(delay)


def _limits(context: StepContext) -> FieldArrays:
    """Range of each driver's attention, and the highest friction that its tyres find.

    The values are the same for all; `benchmarks/nets.py` lowers them for an impaired ego.
    """
    reaction_time = context.scenario.drivers.reaction_time
    return {
        "attention_range": np.full_like(reaction_time, context.constants.sight_range),
        "max_friction": np.full_like(reaction_time, _UNLIMITED_FRICTION),
    }


def _lane_changes(context: StepContext) -> FieldArrays:
    """Incentives and durations of lane changes."""
    traits = context.scenario.drivers
    threshold, gain = traits.lane_change_threshold, traits.min_speed_gain
    if not context.effects.mobil:
        # `threshold` governs lane changes by MOBIL, `min_speed_gain` governs overtaking. Without
        # MOBIL the other vehicles do neither, and the ego still overtakes.
        threshold = np.full_like(threshold, _NEVER)
        gain = np.where(np.arange(gain.shape[1]) == EGO_SLOT, gain, _NEVER)
    min_duration = min_change_duration_by_friction(context)[:, None]
    return {
        "lane_change_threshold": threshold,
        "min_speed_gain": gain,
        "keep_right_bias": traits.keep_right_bias,
        "lane_change_duration": maximum(traits.lane_change_duration, min_duration),
    }


def _rain_slowing(conditions: SceneConditions) -> F32:
    """Speed by which a fully cautious driver slows for rain, shape (simulation,) [m/s]."""
    heavy = constant("model.speed_choice.rain_from_mmph")
    excess = (conditions.rain_rate - heavy) / constant("model.speed_choice.rain_span_mmph")
    smallest = constant("model.speed_choice.rain_min_slowing")
    growth = constant("model.speed_choice.rain_more_slowing") * clamp(excess, ZERO, ONE)
    return np.where(conditions.rain_rate > heavy, smallest + growth, ZERO)


def _stoppable_speed(is_night: Mask, conditions: SceneConditions) -> F32:
    """Speed from which a driver stops within sight of a lit vehicle, shape (simulation,) [m/s]."""
    visible = _visible_range(conditions, constant("weather.lamps.rear_position"))
    by_day = maximum(visible.by_contrast, visible.by_lamp)
    sight = np.where(is_night, visible.by_lamp, by_day)
    reaction_time = np.full_like(sight, constant("model.speed_choice.reaction_time"))
    grip_share = constant("model.speed_choice.grip_share")
    # No ablation changes gravity, so the published constants serve all callers.
    decel = grip_share * model_constants().gravity * conditions.believed_friction
    return road_surface.stoppable_speed(sight, reaction_time, decel)


def _sight_of_oncoming(context: StepContext) -> F32:
    """Range at which drivers see an oncoming car of middling colour, shape (simulation,) [m]."""
    conditions = context.conditions
    visible = _visible_range(conditions, constant("model.lights.headlamp"))
    # By day low beam counts in rain only. In thick fog, where `vehicle_parameters` switches it on,
    # too, it would raise the range from at most 77 m to at most 230 m, still less than a usual
    # pass needs.
    with_lamps = maximum(visible.by_contrast, visible.by_lamp)
    by_day = np.where(conditions.rain_rate > 0, with_lamps, visible.by_contrast)
    sight = np.where(context.scenario.weather.night, visible.by_lamp, by_day)
    return minimum(sight, constant("model.oncoming.range"))


def _visible_range(conditions: SceneConditions, lamp_intensity: np.float32) -> _VisibleRange:
    """Range of a car of middling colour, by its contrast and by its lamps.

    Args:
        conditions: Weather and light.
        lamp_intensity: Luminous intensity of the lamps [cd].
    """
    rain_factor = constant("model.speed_choice.rain_sight_factor")
    extinction = conditions.fog_extinction + rain_factor * conditions.rain_extinction
    # `sight_front` is log(glare factor / contrast threshold). So `contrast` is a multiple of the
    # contrast threshold, and a car is seen down to a multiple of 1.
    contrast = exp(conditions.log_contrast_sensitivity_ahead) * constant(
        "model.speed_choice.contrast"
    )
    threshold = maximum(conditions.lamp_threshold, visibility.MIN_ILLUMINANCE)
    lamp = np.full_like(extinction, lamp_intensity)
    return _VisibleRange(
        by_contrast=visibility.contrast_range(extinction, contrast, np.ones_like(extinction)),
        by_lamp=visibility.lamp_range(extinction, lamp, threshold),
    )


def _passing(scenario: Scenario) -> FieldArrays:
    """Time reserve that each driver demands, and its trust that the road beyond sight is free."""
    demand = scenario.drivers.gap_demand_factor
    sight_factor = constant("model.oncoming.assumed_sight_factor")
    # The root is a choice. Divided by the demand itself, trust led to more collisions, and careful
    # drivers hardly passed on straight, empty roads.
    return {
        "assumed_sight_factor": sight_factor / np.sqrt(maximum(demand, _MIN_DEMAND)),
        "time_reserve_share": constant("model.oncoming.time_reserve_share") * demand,
        "speed_limit": np.full_like(scenario.start_s, scenario.road.speed_limit),
    }


def _reaction_to_being_passed(scenario: Scenario) -> FieldArrays:
    """Behaviour of each driver while being passed: shifts to the edge, yields, or speeds up."""
    # These draws have streams of their own, one for each slot, so they change no other draw. They
    # decide parameters of the step but no trait of `DriverTraits`, so no data set stores them.
    # `Stream` leaves 256 numbers for the slots, more than `MAX_VEHICLES`.
    slots = np.uint32(Stream.BEING_PASSED) + np.arange(scenario.num_slots, dtype=np.uint32)
    draws = PhiloxStream(scenario.seed, scenario.scenario_index[:, None], slots)
    shifts_to_edge = draws.uniform() < constant("model.oncoming.edge_shift_share")
    manner = draws.uniform()
    is_yielding = manner < constant("model.oncoming.yields_share")
    is_racing = manner > ONE - constant("model.oncoming.races_share")
    racing_factor = np.where(is_racing, constant("model.oncoming.races_factor"), ONE)
    edge_shift = constant("model.oncoming.edge_shift_when_passed")
    return {
        "edge_shift_when_passed": np.where(shifts_to_edge, edge_shift, ZERO),
        "speed_factor_when_passed": np.where(
            is_yielding, constant("model.oncoming.yields_factor"), racing_factor
        ),
    }
