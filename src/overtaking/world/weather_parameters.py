"""Parameters of each simulation: water, wind and sight, computed from weather and light."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import PI, log, minimum, sincos
from overtaking.core.random_numbers import PhiloxStream, Stream
from overtaking.knowledge.toml_reader import constant
from overtaking.model.batch import cached_per_batch
from overtaking.model.scenario import Scenario
from overtaking.model.weather import Weather
from overtaking.world import road_surface, visibility
from overtaking.world.constants import (
    DECISIONS_PER_SECOND,
    STEPS_PER_SECOND,
    EnabledEffects,
    ModelConstants,
)
from overtaking.world.road_parameters import road_parameters
from overtaking.world.road_surface import PERCENT

_ONE = np.float32(1.0)
_HIGH_SUN = np.float32(0.8)  # Neither night nor glare [rad].
_UNSEEN = np.float32(1e9)  # An illuminance at which no lamp is noticed [lx].


class SimulationParameters(NamedTuple):
    """Parameters of each simulation, in the order in which the engine receives them.

    Attributes:
        last_step: Step at which it ends at the latest.
        deadline_step: Step at which it ends if nothing was attempted.
        fog_extinction: Of fog [1/m].
        rain_extinction: Of rain, to an observer at rest [1/m].
        sight_front: Logarithm of glare factor over contrast threshold, looking ahead.
        sight_rear: The same looking back.
        lamp_threshold: Illuminance at which a lamp is seen [lx].
        inverse_lit_range: One over the range of the own low beam, 0 by day [1/m].
        detection_time: Until something in plain view is noticed [s].
        distance_error: Coefficient of variation of judged distances [1].
        speed_error: The same of closing speeds [1].
        wind_along: Mean wind in the direction of travel [m/s].
        wind_across: Mean wind towards the fast side [m/s].
        gust_gain: Amplitude of single gusts over the mean [1].
        gust_phase: Where along the road they stand, in [0, 1) of their spacing.
        gust_length: Length of road that each of them covers [m].
        push_accel: Lateral acceleration of pushes towards the fast side, 0 without them [m/s^2].
        push_rate: Pushes per decision [1].
        push_share: Part of the time in which a push acts [1].
        push_phase: When the first one comes, in [0, 1) of the interval.
        least_film: Film of a wet road, 0 on a dry one [mm].
        film_rain: `film.film_per_rain` of the rain.
        texture: Depth of the road's texture [mm].
        puddle_reach: Threshold of the field of puddles, see `film.puddle`.
        puddle_film: Depth of a puddle above the film [mm].
        puddle_phase_1: Phase of the first wave of that field, in [0, 1).
        puddle_phase_2: Phase of the second.
        side_accel: Largest lateral acceleration that drivers choose [m/s^2].
        command: Decision that is forced on the ego, 0 for none (`parameters.with_command`).
        ring: Length of a road that closes on itself, 0 for a road with ends [m].
        inverse_ring: One over that length, 0 for a road with ends [1/m].
        oncoming_error: Coefficient of variation of judged distances to oncoming vehicles [1].
        oncoming_sight: How far an oncoming car is seen in this weather and light [m].
        usual_speed: At which drivers believe that others come until it looms [m/s].
        hasty_change: Shortest change of lane in an emergency [s].
        rain_slowing: By how much a fully cautious driver slows for rain [m/s].
        stoppable_speed: Speed from which one stops within sight of a lit vehicle [m/s].

    Every array has shape (simulation,).
    """

    last_step: F32
    deadline_step: F32
    fog_extinction: F32
    rain_extinction: F32
    sight_front: F32
    sight_rear: F32
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
    push_share: F32
    push_phase: F32
    least_film: F32
    film_rain: F32
    texture: F32
    puddle_reach: F32
    puddle_film: F32
    puddle_phase_1: F32
    puddle_phase_2: F32
    side_accel: F32
    command: F32
    ring: F32
    inverse_ring: F32
    oncoming_error: F32
    oncoming_sight: F32
    usual_speed: F32
    hasty_change: F32
    rain_slowing: F32
    stoppable_speed: F32


LATER = (
    "oncoming_error",
    "oncoming_sight",
    "usual_speed",
    "hasty_change",
    "rain_slowing",
    "stoppable_speed",
)
"""What `passing` works out for two-way roads, and `people` for every one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneConditions:
    """Weather and light; every array has shape (simulation,).

    Attributes:
        rain_rate: Rain [mm/h].
        believed_friction: Friction coefficient that drivers believe in.
        step: The parameters of the step that follow.
    """

    rain_rate: F32
    believed_friction: F32
    step: SimulationParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class WeatherEffects:
    """What rain, fog and light come to; every array has shape (simulation,).

    Attributes:
        rain_rate: Rain [mm/h].
        film: Water on the road, the fields of `SimulationParameters` that are not drawn.
        sight: Sight ahead, fields of `SimulationParameters`.
    """

    rain_rate: F32
    film: dict[str, F32]
    sight: dict[str, F32]


@cached_per_batch
def weather_effects(scenario: Scenario) -> WeatherEffects:
    """What rain, fog and light come to in the whole model: in the step, in signals and tables."""
    return _outlook(scenario, EnabledEffects())


def scene_conditions(
    scenario: Scenario, c: ModelConstants, effects: EnabledEffects
) -> SceneConditions:
    """What weather and light mean in each simulation."""
    ahead = (
        weather_effects(scenario) if effects == EnabledEffects() else _outlook(scenario, effects)
    )
    draws = PhiloxStream(scenario.seed, scenario.index, Stream.WIND_AND_WATER)
    felt = with_effective_weather(scenario)
    # Wind draws before water: the order of the draws is part of what a seed means.
    wind = _wind(felt, draws, effects)
    phases = {"puddle_phase_1": draws.uniform(), "puddle_phase_2": draws.uniform()}
    grip = _believed_grip(c, ahead.film)
    dared = np.full_like(grip, constant("model.steering.comfort_accel"))
    zero = np.zeros_like(grip)
    step = SimulationParameters(
        last_step=np.rint(scenario.horizon * STEPS_PER_SECOND),
        deadline_step=np.rint(scenario.attempt_deadline * STEPS_PER_SECOND),
        side_accel=minimum(dared, constant("model.steering.grip_share") * c.gravity * grip),
        command=zero,
        ring=zero,
        inverse_ring=zero,
        **dict.fromkeys(LATER, zero),
        **_sight(felt, ahead, effects),
        **wind,
        **ahead.film,
        **phases,
        **_push(scenario, draws),
    )
    return SceneConditions(rain_rate=ahead.rain_rate, believed_friction=grip, step=step)


def with_effective_weather(scenario: Scenario) -> Scenario:
    """The scenario with the weather that acts by physics: a dry, still, clear day for pushes."""
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
    """Where the study reduces the field of vision, shape (simulation,)."""
    cloudy = weather.cloudiness > constant("weather.pushes.clouds_percent")
    return weather.night | cloudy | weather.horizon_line


def _push(scenario: Scenario, draws: PhiloxStream) -> dict[str, F32]:
    """Pushes towards where the wind blows to, as often as rain and wind are strong on average."""
    weather, pushes = scenario.weather, scenario.pushes
    zero = np.zeros_like(weather.rain)
    if pushes is None:
        return dict.fromkeys(("push_accel", "push_rate", "push_share", "push_phase"), zero)
    sine, _ = sincos(weather.wind_direction)
    towards = np.where(road_parameters(scenario.road).side * sine < 0, -_ONE, _ONE)
    strength = np.float32(0.5) * PERCENT * (weather.rain + weather.wind)
    per_second = strength / np.float32(pushes.interval)
    return {
        "push_accel": towards * np.float32(pushes.accel),
        "push_rate": per_second / np.float32(DECISIONS_PER_SECOND),
        "push_share": minimum(per_second * np.float32(pushes.duration), _ONE),
        "push_phase": draws.uniform(),
    }


def mean_wind(scenario: Scenario) -> tuple[F32, F32]:
    """Mean wind in the direction of travel and towards the fast side, (simulation,) [m/s]."""
    sine, cosine = sincos(scenario.weather.wind_direction)
    speed = constant("weather.wind.full_speed") * (scenario.weather.wind * PERCENT)
    return speed * cosine, road_parameters(scenario.road).side * speed * sine


def _wind(scenario: Scenario, draws: PhiloxStream, effects: EnabledEffects) -> dict[str, F32]:
    weather = scenario.weather
    along, across = mean_wind(scenario)
    gusty = (weather.wind >= constant("weather.gusts.from_percent")) & effects.gusts
    gain = _drawn(draws, "weather.gusts.min_ratio", "weather.gusts.max_ratio")
    return {
        "wind_along": along,
        "wind_across": across,
        "gust_gain": np.where(gusty, gain, np.float32(0.0)),
        "gust_phase": draws.uniform(),
        "gust_length": _drawn(draws, "weather.gusts.min_length", "weather.gusts.max_length"),
    }


def _drawn(draws: PhiloxStream, low: str, high: str) -> F32:
    """The next number between two entries of the knowledge base."""
    return draws.uniform(float(constant(low)), float(constant(high)))


def _outlook(scenario: Scenario, effects: EnabledEffects) -> WeatherEffects:
    felt = with_effective_weather(scenario)
    rate = road_surface.rain_rate(felt.weather.rain)
    return WeatherEffects(
        rain_rate=rate,
        film=_film(felt, rate, effects),
        sight=_sight_ahead(felt, rate, effects) | _cut(scenario, effects),
    )


def _film(scenario: Scenario, rate: F32, effects: EnabledEffects) -> dict[str, F32]:
    zero = np.zeros_like(rate)
    rain = rate if effects.film else zero
    puddles = scenario.weather.puddles if effects.film else zero
    return {
        "least_film": road_surface.min_wet_film(rain, puddles),
        "film_rain": road_surface.film_rain_factor(rain),
        "texture": np.full_like(rate, constant("weather.film.texture_depth_mm")),
        # See `film.puddle`.
        "puddle_reach": np.sqrt(np.float32(2.0) * road_surface.puddle_cover(puddles)),
        "puddle_film": road_surface.puddle_depth(puddles),
    }


def _believed_grip(c: ModelConstants, water: dict[str, F32]) -> F32:
    """The friction that a driver assumes: that of one tyre at one speed, outside puddles."""
    path = np.full_like(water["film_rain"], constant("model.believed_grip.path_factor"))
    h = road_surface.lane_film(water["least_film"], water["film_rain"], path, water["texture"])
    speed = np.full_like(h, constant("model.believed_grip.speed"))
    wear = np.full_like(h, constant("model.believed_grip.tyre_wear"))
    return road_surface.peak_friction(c, speed, h, wear, np.zeros_like(h))


def _sight(scenario: Scenario, ahead: WeatherEffects, effects: EnabledEffects) -> dict[str, F32]:
    weather, rate = scenario.weather, ahead.rain_rate
    zero = np.zeros_like(rate)
    error = (
        constant("weather.errors.closing_speed_cv") if effects.distance_error else np.float32(0.0)
    )
    return ahead.sight | {
        "sight_rear": _contrast(scenario, rate, np.abs(PI - np.abs(weather.sun_azimuth))),
        "detection_time": _detection_time(weather.night) if effects.delay else zero,
        "distance_error": _distance_error(scenario) if effects.distance_error else zero,
        "speed_error": np.full_like(rate, error),
    }


def _sight_ahead(scenario: Scenario, rate: F32, effects: EnabledEffects) -> dict[str, F32]:
    weather, limited = scenario.weather, _ONE if effects.range else np.float32(0.0)
    lit_range = limited / _low_beam_range(rate)
    return {
        "fog_extinction": limited * visibility.fog_extinction(weather.fog),
        "rain_extinction": limited * visibility.rain_extinction(rate),
        "sight_front": _contrast(scenario, rate, np.abs(weather.sun_azimuth)),
        "lamp_threshold": limited * visibility.lamp_threshold(weather.night, _dusk(scenario)),
        "inverse_lit_range": np.where(weather.night, lit_range, np.zeros_like(rate)),
    }


def _cut(scenario: Scenario, effects: EnabledEffects) -> dict[str, F32]:
    """The field of vision where pushes stand for weather: it ends for lamps as for all else."""
    if scenario.pushes is None or not effects.range:
        return {}
    cut = has_reduced_vision(scenario.weather)
    inverse = np.where(cut, _ONE / np.float32(scenario.pushes.sight), np.float32(0.0))
    return {"inverse_lit_range": inverse, "lamp_threshold": np.full_like(inverse, _UNSEEN)}


def _contrast(scenario: Scenario, rate: F32, angle: F32) -> F32:
    """Logarithm of glare factor over contrast threshold, looking within an angle of the sun."""
    weather = scenario.weather
    threshold = visibility.contrast_threshold(weather.night, _dusk(scenario), rate)
    glare = visibility.glare_factor(weather.sun_altitude, angle, weather.cloudiness)
    return log(glare / threshold)


def _dusk(scenario: Scenario) -> Mask:
    return ~scenario.weather.night & (scenario.weather.sun_altitude < 0)


def _low_beam_range(rate: F32) -> F32:
    """How far an unlit object is seen by the own low beam [m]."""
    wet_factor = np.where(rate > 0, constant("weather.headlamps.wet_factor"), _ONE)
    return constant("weather.headlamps.low_beam") * wet_factor


def _detection_time(night: Mask) -> F32:
    by_day, by_night = (constant(f"model.perception.detection_time_{x}") for x in ("day", "night"))
    return np.where(night, by_night, by_day)


def _distance_error(scenario: Scenario) -> F32:
    day, night, fog = (constant(f"weather.errors.distance_cv_{x}") for x in ("day", "night", "fog"))
    optical_range = visibility.meteorological_range(scenario.weather.fog)
    foggy = optical_range < constant("model.perception.fog_range")
    return np.where(foggy, fog, np.where(scenario.weather.night, night, day))
