"""Physical conditions of each simulation from weather and light: water, wind and sight.

Attributes that are parameters of the step have the names of `parameters.SimulationParameters`.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, PI, Mask, log, minimum, sincos
from overtaking.core.philox import Draws, Stream
from overtaking.model.once import once
from overtaking.model.scenario import Scenario
from overtaking.model.weather import Weather
from overtaking.world import film, friction, visibility
from overtaking.world.clock import DECISIONS_PER_SECOND
from overtaking.world.constants import Constants, known
from overtaking.world.effects import Effects
from overtaking.world.film import PERCENT
from overtaking.world.lanes import road_parameters

_ONE = np.float32(1.0)
_HIGH_SUN = np.float32(0.8)  # Neither night nor glare [rad].
_UNSEEN = np.float32(1e9)  # An illuminance at which no lamp is noticed [lx].


@dataclass(frozen=True, slots=True, kw_only=True)
class Water:
    """Water on the road; every array has shape (simulation,).

    Attributes:
        least_film: Film of a wet road, 0 on a dry one [mm].
        film_rain: `film.film_per_rain` of the rain.
        texture: Depth of the road's texture [mm].
        puddle_reach: Threshold of the field of puddles, see `film.puddle`.
        puddle_film: Depth of a puddle above the film [mm].
        puddle_phase_1: Phase of the first wave of that field, in [0, 1).
        puddle_phase_2: Phase of the second.
    """

    least_film: F32
    film_rain: F32
    texture: F32
    puddle_reach: F32
    puddle_film: F32
    puddle_phase_1: F32
    puddle_phase_2: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """Wind; every array has shape (simulation,).

    Attributes:
        wind_along: Mean wind in the direction of travel [m/s].
        wind_across: Mean wind towards the fast side [m/s].
        gust_gain: Amplitude of single gusts over the mean [1].
        gust_phase: Where along the road they stand, in [0, 1) of their spacing.
        gust_length: Length of road that each of them covers [m].
    """

    wind_along: F32
    wind_across: F32
    gust_gain: F32
    gust_phase: F32
    gust_length: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """Lateral pushes in place of the wind; every array has shape (simulation,).

    Attributes:
        push_accel: Lateral acceleration towards the fast side, 0 without pushes [m/s^2].
        push_rate: Pushes per decision [1].
        push_share: Part of the time in which a push acts [1].
        push_phase: When the first one comes, in [0, 1) of the interval.
    """

    push_accel: F32
    push_rate: F32
    push_share: F32
    push_phase: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """Visibility in the weather; every array has shape (simulation,).

    Attributes:
        fog_extinction: Of fog [1/m].
        rain_extinction: Of rain, to an observer at rest [1/m].
        sight_front: Logarithm of glare factor over contrast threshold, looking ahead.
        sight_rear: The same looking back.
        lamp_threshold: Illuminance at which a lamp is seen [lx].
        inverse_lit_range: One over the range of the own low beam, 0 by day [1/m].
        detection_time: Until something in plain view is noticed [s].
        distance_error: Coefficient of variation of judged distances [1].
        speed_error: The same of closing speeds [1].
    """

    fog_extinction: F32
    rain_extinction: F32
    sight_front: F32
    sight_rear: F32
    lamp_threshold: F32
    inverse_lit_range: F32
    detection_time: F32
    distance_error: F32
    speed_error: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Weather and light; every array has shape (simulation,).

    Attributes:
        rain_rate: Rain [mm/h].
        water: On the road.
        wind: Beside it.
        push: In its place.
        sight: Through all of it.
        grip: Friction coefficient that drivers believe in.
        side_accel: Lateral acceleration that they dare at most [m/s^2].
    """

    rain_rate: F32
    water: Water
    wind: Wind
    push: Push
    sight: Sight
    grip: F32
    side_accel: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """What rain, fog and light come to; every array has shape (simulation,).

    Attributes:
        rain_rate: Rain [mm/h].
        film: How much water lies on the road, the fields of `Water` that are not drawn.
        sight: How far one sees ahead, fields of `Sight`.
    """

    rain_rate: F32
    film: dict[str, F32]
    sight: dict[str, F32]


@once
def outlook(scenario: Scenario) -> Outlook:
    """What rain, fog and light come to in the whole model: in the step, in signals and tables."""
    return _outlook(scenario, Effects())


def world_of(scenario: Scenario, c: Constants, effects: Effects) -> World:
    """What weather and light mean in each simulation."""
    ahead = outlook(scenario) if effects == Effects() else _outlook(scenario, effects)
    draws = Draws(scenario.seed, scenario.index, Stream.FIELD)
    felt = acting(scenario)
    # Wind draws before water: the order of the draws is part of what a seed means.
    wind = _wind(felt, draws, effects)
    water = _water(ahead, draws)
    grip = _believed_grip(c, water)
    dared = np.full_like(grip, known("model.steering.comfort_accel"))
    return World(
        rain_rate=ahead.rain_rate,
        water=water,
        wind=wind,
        push=_push(scenario, draws),
        sight=_sight(felt, ahead, effects),
        grip=grip,
        side_accel=minimum(dared, known("model.steering.grip_share") * c.gravity * grip),
    )


def acting(scenario: Scenario) -> Scenario:
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


def vision_is_cut(weather: Weather) -> Mask:
    """Where the study reduces the field of vision, shape (simulation,)."""
    cloudy = weather.cloudiness > known("weather.pushes.clouds_percent")
    return weather.night | cloudy | weather.horizon_line


def _push(scenario: Scenario, draws: Draws) -> Push:
    """Pushes towards where the wind blows to, as often as rain and wind are strong on average."""
    weather, pushes = scenario.weather, scenario.pushes
    zero = np.zeros_like(weather.rain)
    if pushes is None:
        return Push(push_accel=zero, push_rate=zero, push_share=zero, push_phase=zero)
    sine, _ = sincos(weather.wind_direction)
    towards = np.where(road_parameters(scenario.road).side * sine < 0, -_ONE, _ONE)
    strength = np.float32(0.5) * PERCENT * (weather.rain + weather.wind)
    per_second = strength / np.float32(pushes.interval)
    return Push(
        push_accel=towards * np.float32(pushes.accel),
        push_rate=per_second / np.float32(DECISIONS_PER_SECOND),
        push_share=minimum(per_second * np.float32(pushes.duration), _ONE),
        push_phase=draws.uniform(),
    )


def mean_wind(scenario: Scenario) -> tuple[F32, F32]:
    """Mean wind in the direction of travel and towards the fast side, (simulation,) [m/s]."""
    sine, cosine = sincos(scenario.weather.wind_direction)
    speed = known("weather.wind.full_speed") * (scenario.weather.wind * PERCENT)
    return speed * cosine, road_parameters(scenario.road).side * speed * sine


def _wind(scenario: Scenario, draws: Draws, effects: Effects) -> Wind:
    weather = scenario.weather
    along, across = mean_wind(scenario)
    gusty = (weather.wind >= known("weather.gusts.from_percent")) & effects.gusts
    gain = _drawn(draws, "weather.gusts.smallest_ratio", "weather.gusts.largest_ratio")
    return Wind(
        wind_along=along,
        wind_across=across,
        gust_gain=np.where(gusty, gain, np.float32(0.0)),
        gust_phase=draws.uniform(),
        gust_length=_drawn(draws, "weather.gusts.shortest", "weather.gusts.longest"),
    )


def _drawn(draws: Draws, low: str, high: str) -> F32:
    """The next number between two entries of the knowledge base."""
    return draws.uniform(float(known(low)), float(known(high)))


def _water(ahead: Outlook, draws: Draws) -> Water:
    return Water(
        **ahead.film,
        puddle_phase_1=draws.uniform(),
        puddle_phase_2=draws.uniform(),
    )


def _outlook(scenario: Scenario, effects: Effects) -> Outlook:
    felt = acting(scenario)
    rate = film.rain_rate(felt.weather.rain)
    return Outlook(
        rain_rate=rate,
        film=_film(felt, rate, effects),
        sight=_sight_ahead(felt, rate, effects) | _cut(scenario, effects),
    )


def _film(scenario: Scenario, rate: F32, effects: Effects) -> dict[str, F32]:
    zero = np.zeros_like(rate)
    rain = rate if effects.film else zero
    puddles = scenario.weather.puddles if effects.film else zero
    return {
        "least_film": film.least_film(rain, puddles),
        "film_rain": film.film_per_rain(rain),
        "texture": np.full_like(rate, known("weather.film.texture_depth_mm")),
        # See `film.puddle`.
        "puddle_reach": np.sqrt(np.float32(2.0) * film.puddle_cover(puddles)),
        "puddle_film": film.puddle_depth(puddles),
    }


def _believed_grip(c: Constants, water: Water) -> F32:
    """What a driver takes the friction for: one tyre at one speed, outside puddles."""
    path = np.full_like(water.film_rain, known("model.believed_grip.path_factor"))
    h = film.lane_film(water.least_film, water.film_rain, path, water.texture)
    speed = np.full_like(h, known("model.believed_grip.speed"))
    wear = np.full_like(h, known("model.believed_grip.tyre_wear"))
    return friction.peak_friction(c, speed, h, wear, np.zeros_like(h))


def _sight(scenario: Scenario, ahead: Outlook, effects: Effects) -> Sight:
    weather, rate = scenario.weather, ahead.rain_rate
    zero = np.zeros_like(rate)
    error = known("weather.errors.closing_speed_cv") if effects.distance_error else np.float32(0.0)
    return Sight(
        **ahead.sight,
        sight_rear=_contrast(scenario, rate, np.abs(PI - np.abs(weather.sun_azimuth))),
        detection_time=_detection_time(weather.night) if effects.delay else zero,
        distance_error=_distance_error(scenario) if effects.distance_error else zero,
        speed_error=np.full_like(rate, error),
    )


def _sight_ahead(scenario: Scenario, rate: F32, effects: Effects) -> dict[str, F32]:
    weather, limited = scenario.weather, _ONE if effects.range else np.float32(0.0)
    lit_range = limited / _low_beam_range(rate)
    return {
        "fog_extinction": limited * visibility.fog_extinction(weather.fog),
        "rain_extinction": limited * visibility.rain_extinction(rate),
        "sight_front": _contrast(scenario, rate, np.abs(weather.sun_azimuth)),
        "lamp_threshold": limited * visibility.lamp_threshold(weather.night, _dusk(scenario)),
        "inverse_lit_range": np.where(weather.night, lit_range, np.zeros_like(rate)),
    }


def _cut(scenario: Scenario, effects: Effects) -> dict[str, F32]:
    """The field of vision where pushes stand for weather: it ends for lamps as for all else."""
    if scenario.pushes is None or not effects.range:
        return {}
    cut = vision_is_cut(scenario.weather)
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
    wet_factor = np.where(rate > 0, known("weather.headlamps.wet_factor"), _ONE)
    return known("weather.headlamps.low_beam") * wet_factor


def _detection_time(night: Mask) -> F32:
    by_day, by_night = (known(f"model.perception.detection_time_{x}") for x in ("day", "night"))
    return np.where(night, by_night, by_day)


def _distance_error(scenario: Scenario) -> F32:
    day, night, fog = (known(f"weather.errors.distance_cv_{x}") for x in ("day", "night", "fog"))
    optical_range = visibility.meteorological_range(scenario.weather.fog)
    foggy = optical_range < known("model.perception.fog_range")
    return np.where(foggy, fog, np.where(scenario.weather.night, night, day))
