"""Weather and light of each simulation as parameters of the step: water, wind and sight.

`scene_conditions` converts a batch of scenarios, with weather in percentages of the driving
simulator CARLA, to `SceneConditions`, float32 arrays of shape (simulation,) in physical units. They
are most of the `SimulationParameters`, which the simulation step reads, and the base of the speeds
and reactions in `driver_parameters`. The formulas are in `road_surface` and `visibility`;
`constant` reads numbers from `knowledge/data`.

Some scenarios repeat a published study (Pinto, Dutra and Fonseca 2023). There random lateral
*pushes* and a reduced field of vision replace the physical effects of weather (`Scenario.pushes`).
The weather that acts by physics, the *effective* weather, is then a dry, still, clear day
(`with_effective_weather`). In all other scenarios it is the recorded weather.

A *decision* is one of 20 instants per second at which drivers decide. `EnabledEffects` switches
effects off, to show their influence; a disabled effect has a neutral number here.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, PI, TWO, ZERO, log, minimum, sincos
from overtaking.core.random_numbers import PhiloxStream, Stream
from overtaking.knowledge.toml_reader import constant
from overtaking.model.batch import cached_per_batch
from overtaking.model.scenario import Scenario
from overtaking.model.weather import Weather, sun_angle_ahead
from overtaking.world import road_surface, visibility
from overtaking.world.constants import (
    DECISIONS_PER_SECOND,
    EnabledEffects,
    ModelConstants,
    model_constants,
    without_disabled_effects,
)
from overtaking.world.road_parameters import road_parameters
from overtaking.world.road_surface import PERCENT

_HIGH_SUN = np.float32(0.8)
"""Altitude of a sun that brings neither night nor glare [rad]. A choice: 46 degrees; glare
ends at 18 degrees."""

_NO_LAMP_VISIBLE = np.float32(1e9)
"""A threshold of illuminance that no lamp reaches [lx]."""


class SimulationParameters(NamedTuple):
    """Parameters of each simulation, in the order in which the engine receives them.

    Attributes:
        last_step: Step at which the simulation ends at the latest.
        deadline_step: From this step on, it also ends as soon as the ego is neither overtaking nor
            about to: it never began, or it gave up.
        fog_extinction: Extinction coefficient of fog [1/m].
        rain_extinction: Extinction coefficient of rain for an observer at rest [1/m].
        log_contrast_sensitivity_ahead: Logarithm of the glare factor (share of contrast that the
            glare of a low sun leaves) over the smallest contrast that a driver detects, in the
            direction of travel. An object is visible where this plus the logarithm of its contrast
            is larger than extinction times distance (Koschmieder's law) [1].
        log_contrast_sensitivity_behind: The same for a look into the mirrors [1].
        lamp_threshold: Illuminance at which a driver detects a lamp [lx].
        inverse_lit_range: One over the distance to which a driver sees unlit objects: the range of
            the low beam, or the reduced field of vision in a scenario with pushes; 0 if unlimited
            [1/m].
        detection_time: Time in which a driver notices a vehicle in plain view [s].
        distance_error: Coefficient of variation of judged distances [1].
        speed_error: Coefficient of variation of judged closing speeds [1].
        wind_along: Mean wind in the direction of travel [m/s].
        wind_across: Mean wind towards the overtaking side [m/s].
        gust_gain: Amplitude of the single gusts at bridges and cuttings, over the mean wind [1].
        gust_phase: Position of these gusts along the road, as a share of the distance between two
            of them, in (0, 1) [1].
        gust_length: Length of road that each of them covers [m].
        push_accel: Lateral acceleration of pushes, positive towards the overtaking side; 0 without
            pushes [m/s^2].
        push_rate: Pushes per decision [1].
        push_duty_cycle: Share of the time in which a push acts, 0 to 1 [1].
        push_phase: Share of the interval between two pushes that has passed at the start, in (0, 1)
            [1].
        min_wet_film: Thinnest film of water on a wet road, 0 on a dry one [mm].
        film_rain_factor: Factor A of the film by the rain, see `road_surface.film_rain_factor`
            [mm].
        texture_depth: Depth of the road's texture [mm].
        puddle_threshold: A puddle is where the two waves of `road_surface.puddle_depth_share` add
            up to less than this [1].
        puddle_film: Full depth of a puddle above the film [mm].
        puddle_phase_1: Phase of the first wave at s = 0, as a share of its length, in (0, 1) [1].
        puddle_phase_2: Phase of the second wave, as a share of its length, in (0, 1) [1].
        max_lateral_accel: Largest lateral acceleration that drivers choose at the friction that
            they assume [m/s^2].
        forced_decision: `ForcedDecision` of the ego; 0 leaves the decision to its driver.
        ring_length: Length of a road that closes on itself, 0 for a road with ends [m].
        inverse_ring_length: One over that length, 0 for a road with ends [1/m].
        oncoming_error: Coefficient of variation of judged distances to oncoming vehicles [1].
        oncoming_sight: Distance at which a driver sees an oncoming car in this weather [m].
        expected_oncoming_speed: Speed that drivers assume of oncoming vehicles until their images
            grow visibly [m/s].
        urgent_change_duration: Shortest duration of a lane change in an emergency [s].
        rain_slowing: Reduction of speed by a fully cautious driver in this rain [m/s].
        stoppable_speed: Largest speed from which a driver can stop before a lit vehicle that comes
            in sight [m/s].

    Every array has shape (simulation,).
    """

    last_step: F32
    deadline_step: F32
    fog_extinction: F32
    rain_extinction: F32
    log_contrast_sensitivity_ahead: F32
    log_contrast_sensitivity_behind: F32
    lamp_threshold: F32
    inverse_lit_range: F32
    detection_time: F32
    distance_error: F32
    speed_error: F32
    wind_along: F32
    wind_across: F32
    gust_gain: F32
    gust_phase: F32
    gust_length: F32
    push_accel: F32
    push_rate: F32
    push_duty_cycle: F32
    push_phase: F32
    min_wet_film: F32
    film_rain_factor: F32
    texture_depth: F32
    puddle_threshold: F32
    puddle_film: F32
    puddle_phase_1: F32
    puddle_phase_2: F32
    max_lateral_accel: F32
    forced_decision: F32
    ring_length: F32
    inverse_ring_length: F32
    oncoming_error: F32
    oncoming_sight: F32
    expected_oncoming_speed: F32
    urgent_change_duration: F32
    rain_slowing: F32
    stoppable_speed: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class WeatherEffects:
    """Effects of rain, fog and light that need no random number; arrays of shape (simulation,).

    Rules of the law and tables of results also read this part of `SceneConditions`.

    Attributes:
        rain_rate: Rain [mm/h].
        film: Water on the road, by the name of the field of `SimulationParameters`:
            `min_wet_film`, `film_rain_factor`, `texture_depth`, `puddle_threshold`, `puddle_film`.
        sight: Sight ahead, in the same way: `fog_extinction`, `rain_extinction`,
            `log_contrast_sensitivity_ahead`, `lamp_threshold`, `inverse_lit_range`.
    """

    rain_rate: F32
    film: dict[str, F32]
    sight: dict[str, F32]


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneConditions:
    """Weather and light of each simulation; every array has shape (simulation,).

    The fields below the first two are fields of `SimulationParameters`, which describes them.

    Attributes:
        rain_rate: Rain [mm/h].
        believed_friction: Friction coefficient that drivers assume [1].
    """

    rain_rate: F32
    believed_friction: F32
    fog_extinction: F32
    rain_extinction: F32
    log_contrast_sensitivity_ahead: F32
    log_contrast_sensitivity_behind: F32
    lamp_threshold: F32
    inverse_lit_range: F32
    detection_time: F32
    distance_error: F32
    speed_error: F32
    wind_along: F32
    wind_across: F32
    gust_gain: F32
    gust_phase: F32
    gust_length: F32
    push_accel: F32
    push_rate: F32
    push_duty_cycle: F32
    push_phase: F32
    min_wet_film: F32
    film_rain_factor: F32
    texture_depth: F32
    puddle_threshold: F32
    puddle_film: F32
    puddle_phase_1: F32
    puddle_phase_2: F32
    max_lateral_accel: F32

    def step_fields(self) -> dict[str, F32]:
        """The fields of `SimulationParameters` that these conditions decide."""
        return {name: getattr(self, name) for name in _STEP_FIELDS}


_STEP_FIELDS = tuple(
    field.name for field in fields(SceneConditions) if field.name in SimulationParameters._fields
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepContext:
    """The inputs of the functions that compute parameters of the step.

    Attributes:
        scenario: A batch of scenarios, with its recorded weather. Lamps, pushes and judgements of
            oncoming vehicles depend on this weather.
        effective_scenario: The same batch with the weather that acts by physics. Drivers slow down
            for this weather.
        constants: Constants of the model; the constant of a disabled effect has a neutral value.
        conditions: Weather and light, from the effective weather and the pushes.
        effects: The effects that are enabled.
    """

    scenario: Scenario
    effective_scenario: Scenario
    constants: ModelConstants
    conditions: SceneConditions
    effects: EnabledEffects


@cached_per_batch
def weather_effects(scenario: Scenario) -> WeatherEffects:
    """Effects of rain, fog and light with all effects enabled.

    The step, rules of the law and tables of results share one result for each batch: callers must
    not change the arrays.

    Args:
        scenario: A batch of scenarios, with its recorded weather.
    """
    return _weather_effects(scenario, EnabledEffects())


def scene_conditions(scenario: Scenario, effects: EnabledEffects | None = None) -> SceneConditions:
    """Weather and light of each simulation.

    Gravity and friction come from `model_constants`, as no disabled effect changes them.

    Args:
        scenario: A batch of scenarios, with its recorded weather.
        effects: The effects that are enabled; None for all.
    """
    effects = effects or EnabledEffects()
    is_whole_model = effects == EnabledEffects()
    weather = weather_effects(scenario) if is_whole_model else _weather_effects(scenario, effects)
    draws = PhiloxStream(scenario.seed, scenario.scenario_index, Stream.WIND_AND_WATER)
    effective_scenario = with_effective_weather(scenario)
    # `draws` gives successive random numbers, which depend on seed and scenario. Wind draws first,
    # then puddles, then pushes: another order would change the simulations of every seed.
    wind = _wind(effective_scenario, draws, effects)
    phases = {"puddle_phase_1": draws.uniform(), "puddle_phase_2": draws.uniform()}
    pushes = _pushes(scenario, draws)
    friction = _believed_friction(weather.film)
    comfort = np.full_like(friction, constant("model.steering.comfort_accel"))
    # The share of the friction that drivers use for lateral acceleration.
    grip_share = constant("model.steering.grip_share")
    return SceneConditions(
        rain_rate=weather.rain_rate,
        believed_friction=friction,
        max_lateral_accel=minimum(comfort, grip_share * model_constants().gravity * friction),
        **weather.sight,
        **_perception(effective_scenario, weather.rain_rate, effects),
        **wind,
        **weather.film,
        **phases,
        **pushes,
    )


def step_context(scenario: Scenario, effects: EnabledEffects) -> StepContext:
    """Gather the inputs of the functions that compute parameters of the step.

    Args:
        scenario: A batch of scenarios, with its recorded weather.
        effects: The effects that are enabled.
    """
    return StepContext(
        scenario=scenario,
        effective_scenario=with_effective_weather(scenario),
        constants=without_disabled_effects(model_constants(), effects),
        conditions=scene_conditions(scenario, effects),
        effects=effects,
    )


def with_effective_weather(scenario: Scenario) -> Scenario:
    """The scenario with the weather that acts by physics.

    That is a dry, still, clear day where pushes stand for the weather, else the recorded weather.

    Args:
        scenario: A batch of scenarios.
    """
    if scenario.pushes is None:
        return scenario
    weather, zero = scenario.weather, np.zeros_like(scenario.weather.rain)
    return scenario.replace(
        weather=weather.replace(
            cloudiness=zero,
            rain=zero,
            puddles=zero,
            wind=zero,
            fog=zero,
            sun_altitude=np.full_like(zero, _HIGH_SUN),
            night=np.zeros_like(weather.night),
        )
    )


def has_reduced_vision(weather: Weather) -> Mask:
    """Whether the study with pushes reduces the field of vision, shape (simulation,).

    It does so at night, above 60 % of clouds and towards a low sun.

    Args:
        weather: The recorded weather.
    """
    is_cloudy = weather.cloudiness > constant("weather.pushes.clouds_percent")
    return weather.night | is_cloudy | weather.low_sun


def mean_wind(scenario: Scenario) -> tuple[F32, F32]:
    """Mean wind in each simulation.

    Args:
        scenario: A batch of scenarios.

    Returns:
        Components along the road and towards its overtaking side, shape (simulation,) [m/s].
    """
    # The direction to which the wind blows, anticlockwise from the direction of travel. So the sine
    # counts to the left, which is the overtaking side where `overtaking_sign` is +1.
    sine, cosine = sincos(scenario.weather.wind_direction)
    speed = constant("weather.wind.full_speed") * (scenario.weather.wind * PERCENT)
    return speed * cosine, road_parameters(scenario.road).overtaking_sign * speed * sine


def _pushes(scenario: Scenario, draws: PhiloxStream) -> dict[str, F32]:
    """Fields of pushes; a push acts towards the side to which the wind blows.

    Their rate is proportional to the mean of rain and wind: at 100 % of both there is one push in
    each `LateralPushes.interval`. Their strength is the same in all weather.
    """
    weather, pushes = scenario.weather, scenario.pushes
    zero = np.zeros_like(weather.rain)
    if pushes is None:
        return dict.fromkeys(("push_accel", "push_rate", "push_duty_cycle", "push_phase"), zero)
    sine, _ = sincos(weather.wind_direction)
    push_sign = np.where(road_parameters(scenario.road).overtaking_sign * sine < 0, -ONE, ONE)
    mean_share = HALF * PERCENT * (weather.rain + weather.wind)
    per_second = mean_share / np.float32(pushes.interval)
    return {
        "push_accel": push_sign * np.float32(pushes.accel),
        "push_rate": per_second / DECISIONS_PER_SECOND,
        "push_duty_cycle": minimum(per_second * np.float32(pushes.duration), ONE),
        "push_phase": draws.uniform(),
    }


def _wind(scenario: Scenario, draws: PhiloxStream, effects: EnabledEffects) -> dict[str, F32]:
    """Mean wind, and the gusts at bridges and cuttings.

    All simulations draw gain, phase and length, in this order, also those without gusts. So the
    numbers drawn later, for puddles and pushes, do not depend on the wind or on the effects.
    """
    along, across = mean_wind(scenario)
    has_gusts = (scenario.weather.wind >= constant("weather.gusts.from_percent")) & effects.gusts
    gain = _draw_between(draws, "weather.gusts.min_ratio", "weather.gusts.max_ratio")
    return {
        "wind_along": along,
        "wind_across": across,
        "gust_gain": np.where(has_gusts, gain, ZERO),
        "gust_phase": draws.uniform(),
        "gust_length": _draw_between(draws, "weather.gusts.min_length", "weather.gusts.max_length"),
    }


def _draw_between(draws: PhiloxStream, low: str, high: str) -> F32:
    """Draw a number, uniform between two entries of the knowledge files, (simulation,)."""
    return draws.uniform(float(constant(low)), float(constant(high)))


def _weather_effects(scenario: Scenario, effects: EnabledEffects) -> WeatherEffects:
    """Compute `WeatherEffects`; disabled effects have neutral numbers.

    The reduced field of vision depends on the recorded weather, all else on the effective weather.
    """
    effective_scenario = with_effective_weather(scenario)
    rate = road_surface.rain_rate(effective_scenario.weather.rain)
    return WeatherEffects(
        rain_rate=rate,
        film=_film(effective_scenario, rate, effects),
        sight=_sight_ahead(effective_scenario, rate, effects) | _reduced_vision(scenario, effects),
    )


def _film(scenario: Scenario, rate: F32, effects: EnabledEffects) -> dict[str, F32]:
    """Water on the road, at a rain rate [mm/h]; none if the effect `film` is disabled."""
    zero = np.zeros_like(rate)
    rain = rate if effects.film else zero
    puddles = scenario.weather.puddles if effects.film else zero
    return {
        "min_wet_film": road_surface.min_wet_film(rain, puddles),
        "film_rain_factor": road_surface.film_rain_factor(rain),
        "texture_depth": np.full_like(rate, constant("weather.film.texture_depth_mm")),
        # The share of the road under puddles is half the square of the threshold, as
        # `puddle_depth_share` explains.
        "puddle_threshold": np.sqrt(TWO * road_surface.puddle_cover(puddles)),
        "puddle_film": road_surface.puddle_depth(puddles),
    }


def _believed_friction(water: dict[str, F32]) -> F32:
    """Friction coefficient that drivers assume from experience, shape (simulation,).

    It is the peak friction of a half-worn car tyre at 90 km/h, outside puddles, on the film of the
    second lane from the crown; drivers do not know the friction under their own tyres.
    """
    path = np.full_like(water["film_rain_factor"], constant("model.believed_grip.path_factor"))
    film = road_surface.lane_film(
        water["min_wet_film"], water["film_rain_factor"], path, water["texture_depth"]
    )
    speed = np.full_like(film, constant("model.believed_grip.speed"))
    wear = np.full_like(film, constant("model.believed_grip.tyre_wear"))
    car = np.zeros_like(film)
    return road_surface.peak_friction(model_constants(), speed, film, wear, car)


def _perception(scenario: Scenario, rate: F32, effects: EnabledEffects) -> dict[str, F32]:
    """Sight behind, time of detection and errors of judgement.

    Args:
        scenario: A batch of scenarios, with its effective weather.
        rate: Rain rate [mm/h].
        effects: The effects that are enabled.
    """
    weather, zero = scenario.weather, np.zeros_like(rate)
    # The azimuth counts from the direction of travel, where the sun is straight ahead.
    sun_angle_behind = np.abs(PI - np.abs(weather.sun_azimuth))
    speed_error = constant("weather.errors.closing_speed_cv") if effects.distance_error else ZERO
    return {
        "log_contrast_sensitivity_behind": _log_contrast_sensitivity(
            scenario, rate, sun_angle_behind
        ),
        "detection_time": _detection_time(weather.night) if effects.delay else zero,
        "distance_error": _distance_error(scenario) if effects.distance_error else zero,
        "speed_error": np.full_like(rate, speed_error),
    }


def _sight_ahead(scenario: Scenario, rate: F32, effects: EnabledEffects) -> dict[str, F32]:
    """Sight ahead: extinction, contrast, lamps.

    Args:
        scenario: A batch of scenarios, with its effective weather.
        rate: Rain rate [mm/h].
        effects: The effects that are enabled.
    """
    weather, zero = scenario.weather, np.zeros_like(rate)
    # Without the effect `range`, extinctions, lamp thresholds and inverse ranges are 0: unlimited
    # sight. Contrast needs no factor, as it does not fall with distance at an extinction of 0.
    range_factor = ONE if effects.range else ZERO
    sun_angle = sun_angle_ahead(weather.sun_azimuth)
    lamp_threshold = visibility.lamp_threshold(weather.night, _is_dusk(scenario))
    return {
        "fog_extinction": range_factor * visibility.fog_extinction(weather.fog),
        "rain_extinction": range_factor * visibility.rain_extinction(rate),
        "log_contrast_sensitivity_ahead": _log_contrast_sensitivity(scenario, rate, sun_angle),
        "lamp_threshold": range_factor * lamp_threshold,
        "inverse_lit_range": np.where(weather.night, range_factor / _low_beam_range(rate), zero),
    }


def _reduced_vision(scenario: Scenario, effects: EnabledEffects) -> dict[str, F32]:
    """Fields that limit sight in a scenario with pushes; empty in all others.

    The result replaces two fields of `_sight_ahead`. No lamp is visible, by day or at night:
    otherwise drivers would see the lamps of vehicles beyond a reduced field of vision.
    """
    if scenario.pushes is None or not effects.range:
        return {}
    is_reduced = has_reduced_vision(scenario.weather)
    inverse = np.where(is_reduced, ONE / np.float32(scenario.pushes.sight_distance), ZERO)
    return {"inverse_lit_range": inverse, "lamp_threshold": np.full_like(inverse, _NO_LAMP_VISIBLE)}


def _log_contrast_sensitivity(scenario: Scenario, rate: F32, angle: F32) -> F32:
    """Logarithm of glare factor over contrast threshold, shape (simulation,) [1].

    Args:
        scenario: A batch of scenarios, with its effective weather.
        rate: Rain rate [mm/h].
        angle: Horizontal angle between the line of sight and the sun [rad].
    """
    weather = scenario.weather
    threshold = visibility.contrast_threshold(weather.night, _is_dusk(scenario), rate)
    glare = visibility.glare_factor(weather.sun_altitude, angle, weather.cloudiness)
    return log(glare / threshold)


def _is_dusk(scenario: Scenario) -> Mask:
    """Whether the sun is below the horizon before the night begins."""
    return ~scenario.weather.night & (scenario.weather.sun_altitude < 0)


def _low_beam_range(rate: F32) -> F32:
    """Range at which a driver's low beam shows an unlit object, shorter on a wet road [m]."""
    wet_factor = np.where(rate > 0, constant("weather.headlamps.wet_factor"), ONE)
    return constant("weather.headlamps.low_beam") * wet_factor


def _detection_time(night: Mask) -> F32:
    """Time in which a driver notices a vehicle in plain view [s]."""
    by_day = constant("model.perception.detection_time_day")
    by_night = constant("model.perception.detection_time_night")
    return np.where(night, by_night, by_day)


def _distance_error(scenario: Scenario) -> F32:
    """Coefficient of variation of judged distances [1]: in fog, else at night, else by day."""
    day, night, fog = (
        constant(f"weather.errors.distance_cv_{light}") for light in ("day", "night", "fog")
    )
    optical_range = visibility.meteorological_range(scenario.weather.fog)
    is_foggy = optical_range < constant("model.perception.fog_range")
    return np.where(is_foggy, fog, np.where(scenario.weather.night, night, day))
