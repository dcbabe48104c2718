"""The weather in SUMO: friction of each lane, and how well drivers judge distances.

SUMO has no wind, no spray, no sun in the eyes and no range of sight: its drivers see everything
near them at any time, so no overtake there fails because a vehicle was not seen.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.world import film, friction, visibility
from overtaking.world.constants import constants, known

_ZERO = np.float32(0.0)


def is_wet(scenario: Scenario) -> NDArray[np.bool_]:
    """Whether the road is wet, shape (simulation,); on a dry one SUMO's friction is left alone."""
    weather = scenario.weather
    rain = film.rain_rate(weather.rain) > _ZERO
    return rain | (weather.puddles >= known("weather.film.wet_deposits_percent"))


def lane_friction(scenario: Scenario) -> F32:
    """Peak friction of a half-worn car tyre on the film of each lane, (simulation, lane).

    SUMO has one number for a lane, whatever the speed, as road sensors report it. So it is taken at
    the slowest speed of the friction table, without aquaplaning, and puddles are left out.
    """
    path = film.film_per_path(_drainage_path(scenario.road))[None, :]
    rain = film.film_per_rain(film.rain_rate(scenario.weather.rain))[:, None]
    least = np.where(is_wet(scenario), known("weather.film.wet_film_mm"), _ZERO)[:, None]
    texture = np.full_like(rain, known("weather.film.texture_depth_mm"))
    depth = film.lane_film(least, rain, path, texture)
    speed = np.full_like(depth, constants().friction_speeds[0])
    wear = np.full_like(depth, known("model.believed_grip.tyre_wear"))
    return friction.peak_friction(constants(), speed, depth, wear, np.zeros_like(depth))


def _drainage_path(road: Road) -> F32:
    """How far water has run from the fast edge, the crown, to the middle of each lane [m]."""
    reach = np.abs(road.centres - road.boundaries[-1]).astype(np.float32)
    return np.maximum(reach, known("model.water.shortest_path"))


def distance_error(scenario: Scenario) -> F32:
    """Coefficient of variation of judged distances, shape (simulation,) [1]."""
    day, night, fog = (known(f"weather.errors.distance_cv_{x}") for x in ("day", "night", "fog"))
    weather = scenario.weather
    foggy = visibility.meteorological_range(weather.fog) < known("model.perception.fog_range")
    return np.where(foggy, fog, np.where(weather.night, night, day))
