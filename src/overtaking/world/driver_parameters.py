"""Parameters of drivers in a simulation step: desired speeds, car following, passing.

The functions take the traits of the drivers (`Scenario.drivers`), the weather and the road. They
return float32 arrays by field name: fields of `VehicleParameters`, one number per vehicle, and of
`SimulationParameters`, one number per simulation. The simulation step reads both;
`step_parameters.step_parameters` collects them once before a simulation. Numbers of the model come
from `knowledge/data` (`constant`).

A *decision* is one of 20 instants per second at which drivers perceive and decide. A *slot* is the
number of a vehicle in its simulation; the ego, the vehicle under study, has slot 0.

A scenario may replace the physical effects of its weather by random lateral pushes
(`Scenario.pushes`). Then the *effective* weather, to which drivers react, is a dry, clear day. In
all other scenarios it is the recorded weather. `oncoming_judgement` is an exception: whether it is
night follows the recorded weather even with pushes. This matters only on two-way roads with pushes,
which no profile of the package has.
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
"""Fields of `SimulationParameters` for two-way roads; on other roads the caller sets them to 0."""

REACTION_TO_ONCOMING_FIELDS = (
    "assumed_sight_factor",
    "time_reserve_share",
    "speed_limit",
    "edge_shift_when_passed",
    "speed_factor_when_passed",
)
"""Fields of `VehicleParameters` for two-way roads; on other roads the caller sets them to 0."""

_UNREACHABLE = np.float32(1e9)
"""A threshold that disables lane changes: no incentive [m/s^2] or speed gain [m/s] reaches it."""

_UNLIMITED_FRICTION = np.float32(10.0)
"""A friction coefficient that no tyre reaches: it limits nothing [1]."""

_QUINTIC_PEAK = np.float32(5.77)
"""Largest acceleration of a quintic path from rest to rest over a distance D in a time T, in
D / T^2: 10 / sqrt(3) = 5.7735. The rounding shortens the result of `_min_change_duration` by
0.03 %. More digits would change all simulations that depend on it."""

_MIN_DEMAND = np.float32(0.1)
"""Lower limit of the trait `gap_demand_factor` where `_passing` divides by its root: the trait is 0
for a driver that demands no gap at all. A choice [1]."""


class DesiredSpeedFactors(NamedTuple):
    """Quantities from which `adapted_speed` computes desired speeds; their shapes broadcast.

    Attributes:
        free: Desired speed on a free road in good weather, without a limit [m/s].
        speed_limit_compliance: Share of the excess over a limit that the driver gives up [1].
        caution: Share of the slowing for weather and light that the driver applies [1].
        rain_slowing: Reduction of speed by a fully cautious driver (caution 1) in this rain [m/s].
        stoppable: Largest speed from which a driver can stop before a lit vehicle that comes in
            sight [m/s].
    """

    free: F32
    speed_limit_compliance: F32
    caution: F32
    rain_slowing: F32
    stoppable: F32


class _VisibleRange(NamedTuple):
    """Distances at which drivers see another vehicle, shape (simulation,) [m].

    Attributes:
        by_contrast: By the contrast of its body.
        by_lamp: By its lamps.
    """

    by_contrast: F32
    by_lamp: F32


def driver_parameters(context: StepContext) -> FieldArrays:
    """Fields of `VehicleParameters` that are computed from traits of drivers.

    - `desired_speed`, `passing_speed`: desired speed in this weather under the limit of the road,
      usually and while passing; `free_speed`: desired speed on a free road in good weather, without
      a limit [m/s].
    - `idm_interaction`: factor of speed times closing speed in the desired gap of the intelligent
      driver model [s^2/m]; `overspeed_exponent`: exponent of its deceleration above the desired
      speed [1]; `max_assumed_decel`: strongest braking that the driver counts on, positive
      [m/s^2].
    - `reaction_delay`, `urgent_reaction_delay`: reaction times, usual and in danger, as whole
      numbers of decisions [1].
    - `attention_range`: distance to which the driver looks ahead [m]; `max_friction`: highest
      friction coefficient that the tyres find [1].
    - `lane_change_threshold`: incentive from which the lane-change model MOBIL changes lanes
      [m/s^2]; `min_speed_gain`: speed gain from which the driver overtakes [m/s];
      `lane_change_duration` [s].
    - `inverse_patience`: rate at which the demands of a waiting driver fall [1/s].

    `desired_speed`, `lane_change_threshold`, `min_speed_gain` and `lane_change_duration` are also
    names of traits: these numbers replace the traits. `VehicleParameters` has further traits as
    fields; the caller copies them.

    Args:
        context: The batch, its weather, the constants and the enabled effects.

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
    """Collect the inputs of `adapted_speed` for all drivers of a batch.

    Args:
        scenario: A batch of scenarios.
        conditions: Its weather and light.

    Returns:
        Arrays of shape (simulation, vehicle), or (simulation, 1) for `rain_slowing` and
        `stoppable`.
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

    A fully cautious driver slows by `rain_slowing`, and further to `stoppable` if that speed is
    lower still. Other drivers slow by the share `caution` of this reduction.

    Args:
        factors: Traits of the drivers and effects of their weather.
        limit: Speed limit, a shape that broadcasts with the arrays of `factors` [m/s].

    Returns:
        Speeds of the common shape.
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
        `rain_slowing` and `stoppable_speed`, as in `DesiredSpeedFactors`, shape (simulation,)
        [m/s].
    """
    is_night = with_effective_weather(scenario).weather.night
    return {
        "rain_slowing": _rain_slowing(conditions),
        "stoppable_speed": _stoppable_speed(is_night, conditions),
    }


def oncoming_judgement(context: StepContext) -> dict[str, F32]:
    """How drivers judge oncoming vehicles, and how fast they can return before them.

    - `oncoming_error`: coefficient of variation of judged distances, larger at night [1].
    - `oncoming_sight`: distance at which drivers see an oncoming car in this weather and light [m].
    - `expected_oncoming_speed`: speed that drivers assume of oncoming vehicles until they perceive
      it [m/s].
    - `urgent_change_duration`: duration of the shortest lane change in an emergency [s].

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
        # `hasty_change` is the shortest duration on a dry road. On a slippery road friction limits
        # the duration.
        "urgent_change_duration": maximum(
            _min_change_duration(context), constant("model.oncoming.hasty_change")
        ),
    }


def reaction_to_oncoming(context: StepContext) -> FieldArrays:
    """Caution of each driver towards oncoming traffic, and its behaviour while being passed.

    - `assumed_sight_factor`: the driver assumes that the nearest oncoming vehicle it cannot see is
      this many sight distances away [1].
    - `time_reserve_share`: time reserve that the driver demands, over the time that passing takes
      [1].
    - `speed_limit`: the limit that drivers observe while passing, the highest limit of the road
      [m/s]. It is stored for each vehicle, because on a road with several limits the step replaces
      it by the limit at the position of the vehicle.
    - `edge_shift_when_passed`: lateral shift to the edge of the lane while being passed [m].
    - `speed_factor_when_passed`: factor on the desired speed while being passed [1].

    Args:
        context: A batch on a two-way road.

    Returns:
        The `REACTION_TO_ONCOMING_FIELDS`, each of shape (simulation, vehicle).
    """
    return _passing(context.scenario) | _reaction_to_being_passed(context.scenario)


def _min_change_duration(context: StepContext) -> F32:
    """Duration of the shortest lane change that drivers dare, shape (simulation,) [s].

    A quintic path over one lane width D in a time T reaches the lateral acceleration 5.77 D / T^2.
    The duration is the T at which this equals a share, `model.lane_change.accel_share`, of the
    largest lateral acceleration that drivers choose at the friction that they assume.
    """
    # The width of lane 0 serves all lanes, so that a vehicle has a single duration.
    borders = road_parameters(context.scenario.road).boundaries
    width = borders[1] - borders[0]
    share = constant("model.lane_change.accel_share")
    return np.sqrt(_QUINTIC_PEAK * width / (share * context.conditions.max_lateral_accel))


def _speeds(context: StepContext) -> FieldArrays:
    """Desired speeds under `Road.speed_limit`, the highest limit of the road.

    Where a lower limit holds along the road, the step lowers them.
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
    """Parameters of the intelligent driver model (IDM) and of its improved version.

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), chapter 11: the factor of v dv in the
        desired gap s* is 1 / (2 sqrt(a b)); the exponent above the desired speed is delta a / b
        with delta = 4. a is the acceleration and b the comfortable deceleration.
    """
    traits, friction = context.scenario.drivers, context.conditions.believed_friction
    # The share of the friction that drivers count on for braking.
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
    """Reaction times in decisions. Only the usual ones grow at night, in fog and in heavy rain.

    Close to a collision drivers react as fast as by day: the faster the image of the leader grows,
    the sooner they brake.

    Source:
        Markkula et al. (2016), for the urgent reactions; the growth of the usual ones is a choice.
    """
    conditions = context.conditions
    reaction_time = context.scenario.drivers.reaction_time
    fog_limit = visibility.extinction_of_range(constant("model.perception.fog_range"))
    is_hazy = (conditions.fog_extinction > fog_limit) | (
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
    """Reaction times [s] as whole numbers of decisions; 0 if the effect `delay` is disabled."""
    # Drivers react to positions and speeds of earlier decisions. The step stores those of the
    # last `history` decisions only.
    max_delay = constant("model.perception.history")
    delay = minimum(np.rint(reaction_time * DECISIONS_PER_SECOND), max_delay)
    return delay if effects.delay else np.zeros_like(delay)


def _limits(context: StepContext) -> FieldArrays:
    """Distance to which each driver looks ahead, and the highest friction that its tyres find.

    Both are equal for all vehicles here. They are fields of each vehicle so that a study of an
    impaired driver can lower them for the ego alone, as `benchmarks/nets.py` does.
    """
    template = context.scenario.drivers.reaction_time  # Any float32 array (simulation, vehicle).
    return {
        "attention_range": np.full_like(template, context.constants.sight_range),
        "max_friction": np.full_like(template, _UNLIMITED_FRICTION),
    }


def _lane_changes(context: StepContext) -> FieldArrays:
    """Thresholds and durations of lane changes."""
    traits = context.scenario.drivers
    threshold, gain = traits.lane_change_threshold, traits.min_speed_gain
    if not context.effects.mobil:
        # `threshold` governs lane changes by MOBIL, `gain` governs overtaking. With the effect
        # `mobil` disabled, the other vehicles do neither, while the ego still overtakes.
        threshold = np.full_like(threshold, _UNREACHABLE)
        is_ego = np.arange(gain.shape[1]) == EGO_SLOT
        gain = np.where(is_ego, gain, _UNREACHABLE)
    min_duration = _min_change_duration(context)[:, None]
    return {
        "lane_change_threshold": threshold,
        "min_speed_gain": gain,
        "lane_change_duration": maximum(traits.lane_change_duration, min_duration),
    }


def _rain_slowing(conditions: SceneConditions) -> F32:
    """Reduction of speed by a fully cautious driver in rain, shape (simulation,) [m/s].

    0 up to heavy rain, then a jump, then linear growth up to the heaviest rain of the model: free
    speeds are measured to fall by 10 to 19 km/h in rain that counts as heavy.
    """
    heavy = constant("model.speed_choice.rain_from_mmph")
    excess = (conditions.rain_rate - heavy) / constant("model.speed_choice.rain_span_mmph")
    jump = constant("model.speed_choice.rain_min_slowing")
    growth = constant("model.speed_choice.rain_more_slowing") * clamp(excess, ZERO, ONE)
    return np.where(conditions.rain_rate > heavy, jump + growth, ZERO)


def _stoppable_speed(is_night: Mask, conditions: SceneConditions) -> F32:
    """Speed from which a driver stops before a lit vehicle that comes in sight [m/s].

    At night the driver sees only its rear lamps. By day they are visible farther than its body only
    in thick or rainy fog.

    Args:
        is_night: Whether it is night, shape (simulation,).
        conditions: Weather and light.
    """
    visible = _visible_range(conditions, constant("weather.lamps.rear_position"))
    by_day = maximum(visible.by_contrast, visible.by_lamp)
    sight = np.where(is_night, visible.by_lamp, by_day)
    reaction_time = np.full_like(sight, constant("model.speed_choice.reaction_time"))
    # The share of the friction that drivers count on for an emergency stop.
    grip_share = constant("model.speed_choice.grip_share")
    # Not `context.constants`: the sampling of scenarios calls this without a `StepContext`. Gravity
    # is the same in both.
    decel = grip_share * model_constants().gravity * conditions.believed_friction
    return road_surface.stoppable_speed(sight, reaction_time, decel)


def _sight_of_oncoming(context: StepContext) -> F32:
    """Range at which drivers see an oncoming car of middling colour, shape (simulation,) [m]."""
    conditions = context.conditions
    visible = _visible_range(conditions, constant("model.lights.headlamp"))
    # By day drivers are assumed to use low beam only in rain. Low beam in thick fog is neglected:
    # it would raise the range to at most 230 m, still less than a usual pass needs.
    with_lamps = maximum(visible.by_contrast, visible.by_lamp)
    by_day = np.where(conditions.rain_rate > 0, with_lamps, visible.by_contrast)
    sight = np.where(context.scenario.weather.night, visible.by_lamp, by_day)
    return minimum(sight, constant("model.oncoming.range"))


def _visible_range(conditions: SceneConditions, lamp_intensity: np.float32) -> _VisibleRange:
    """Distances at which drivers see a car of middling colour ahead.

    Args:
        conditions: Weather and light.
        lamp_intensity: Luminous intensity of its lamps [cd].
    """
    # `rain_extinction` holds for an observer at rest. A moving driver meets more rain: twice as
    # much at 108 km/h, a usual speed, which counts for all drivers here.
    rain_factor = constant("model.speed_choice.rain_sight_factor")
    extinction = conditions.fog_extinction + rain_factor * conditions.rain_extinction
    # The sensitivity is the share of contrast that glare leaves, divided by the smallest contrast
    # that drivers detect. The product with the contrast of the car is 1 where the car is just
    # visible.
    sensitivity = exp(conditions.log_contrast_sensitivity_ahead)
    relative_contrast = sensitivity * constant("model.speed_choice.contrast")
    contrast_threshold = np.ones_like(extinction)
    lamp = np.full_like(extinction, lamp_intensity)
    # `lamp_range` divides by the threshold, which is 0 if the effect `range` is disabled.
    lamp_threshold = maximum(conditions.lamp_threshold, visibility.MIN_ILLUMINANCE)
    return _VisibleRange(
        by_contrast=visibility.contrast_range(extinction, relative_contrast, contrast_threshold),
        by_lamp=visibility.lamp_range(extinction, lamp, lamp_threshold),
    )


def _passing(scenario: Scenario) -> FieldArrays:
    """Time reserve that each driver demands, and how far it assumes a free road beyond sight."""
    demand = scenario.drivers.gap_demand_factor
    sight_factor = constant("model.oncoming.assumed_sight_factor")
    # The root is a choice: with the demand itself as divisor there were more collisions, and
    # drivers with a large demand hardly passed on straight, empty roads.
    return {
        "assumed_sight_factor": sight_factor / np.sqrt(maximum(demand, _MIN_DEMAND)),
        "time_reserve_share": constant("model.oncoming.time_reserve_share") * demand,
        "speed_limit": np.full_like(scenario.start_s, scenario.road.speed_limit),
    }


def _reaction_to_being_passed(scenario: Scenario) -> FieldArrays:
    """Draw how each driver behaves while being passed: shifts aside, yields or speeds up."""
    # Each slot has a stream of random numbers, which depends on seed, scenario and stream number
    # only. So data sets need not store the results: every run draws them again. Draws have shape
    # (simulation, vehicle).
    streams = np.uint32(Stream.BEING_PASSED) + np.arange(scenario.num_slots, dtype=np.uint32)
    draws = PhiloxStream(scenario.seed, scenario.scenario_index[:, None], streams)
    shifts_to_edge = draws.uniform() < constant("model.oncoming.edge_shift_share")
    # One draw decides both, so that no driver yields and also speeds up.
    speed_draw = draws.uniform()
    is_yielding = speed_draw < constant("model.oncoming.yields_share")
    is_racing = speed_draw > ONE - constant("model.oncoming.races_share")
    racing_factor = np.where(is_racing, constant("model.oncoming.races_factor"), ONE)
    edge_shift = constant("model.oncoming.edge_shift_when_passed")
    return {
        "edge_shift_when_passed": np.where(shifts_to_edge, edge_shift, ZERO),
        "speed_factor_when_passed": np.where(
            is_yielding, constant("model.oncoming.yields_factor"), racing_factor
        ),
    }
