"""Physical quantities that follow from CARLA's weather settings, for the `weather` table."""

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.native import exp, maximum, minimum
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import constant
from overtaking.model.scenario import Scenario
from overtaking.world import road_surface
from overtaking.world.constants import model_constants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.road_surface import peak_friction
from overtaking.world.visibility import contrast_range, lamp_range, meteorological_range
from overtaking.world.weather_parameters import mean_wind, weather_effects, with_effective_weather

FRICTION_SPEED = np.float32(mps_from_kmh(100.0))
FRICTION_WEAR = np.float32(0.5)
CONTRAST = np.float32(0.5)
"""Of a vehicle of middling colour against the background; drivers in the model reckon with it."""

_METRES_PER_MM = np.float32(1e-3)


def derived_weather(scenario: Scenario) -> dict[str, F32]:
    """The derived columns of the `weather` table, each of shape (simulation,)."""
    c = model_constants()
    felt = with_effective_weather(scenario)
    ahead = weather_effects(scenario)
    sight, water = ahead.sight, ahead.film
    zero = np.zeros(scenario.num_simulations, dtype=np.float32)
    path = road_parameters(scenario.road).film_path[0]
    film_mm = road_surface.lane_film(
        water["min_wet_film"], water["film_rain_factor"], path, water["texture_depth"]
    )
    extinction = sight["fog_extinction"] + sight["rain_extinction"]
    lamp = constant("weather.lamps.rear_position")
    unlit = contrast_range(
        extinction, exp(sight["log_contrast_sensitivity_ahead"]) * CONTRAST, zero + np.float32(1.0)
    )
    lit = lamp_range(extinction, zero + lamp, sight["lamp_threshold"])
    along, across = mean_wind(felt)
    return {
        "rain_mmph": ahead.rain_rate,
        "water_film_m": maximum(film_mm, zero) * _METRES_PER_MM,
        "friction": peak_friction(c, zero + FRICTION_SPEED, film_mm, zero + FRICTION_WEAR, zero),
        "wind_mps": np.sqrt(along * along + across * across),
        "optical_range_m": meteorological_range(felt.weather.fog),
        "sight_unlit_m": minimum(unlit, zero + c.sight_range),
        "sight_lit_m": minimum(lit, zero + c.sight_range),
    }
