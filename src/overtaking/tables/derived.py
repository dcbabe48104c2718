"""What the weather means in numbers, as the simulation takes it, for the `weather` table."""

import numpy as np

from overtaking.core.elementary import F32, exp, maximum, minimum
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge import Quantity, quantities
from overtaking.model.scenario import Scenario
from overtaking.physics.film import lane_film, rain_rate
from overtaking.physics.friction import peak_friction
from overtaking.physics.visibility import contrast_range, lamp_range, meteorological_range
from overtaking.sim.parameters import SIMULATION_FIELDS, parameters

FRICTION_SPEED = np.float32(mps_from_kmh(100.0))
FRICTION_WEAR = np.float32(0.5)
CONTRAST = np.float32(0.5)
"""Of a vehicle of middling colour against the background; drivers in the model reckon with it."""

_METRES_PER_MM = np.float32(1e-3)


def derived_weather(scenario: Scenario) -> dict[str, F32]:
    """The derived columns of the `weather` table, each of shape (simulation,)."""
    given = parameters(scenario)
    world = dict(zip(SIMULATION_FIELDS, given.simulation, strict=True))
    zero = np.zeros(scenario.num_simulations, dtype=np.float32)
    film_mm = lane_film(
        world["least_film"], world["film_rain"], given.road.film_path[0], world["texture"]
    )
    extinction = world["fog_extinction"] + world["rain_extinction"]
    lamp = quantities("weather.toml")["lamps.rear_position"]
    assert isinstance(lamp, Quantity)
    unlit = contrast_range(extinction, exp(world["sight_front"]) * CONTRAST, zero + np.float32(1.0))
    lit = lamp_range(extinction, zero + np.float32(lamp.number), world["lamp_threshold"])
    along, across = world["wind_along"], world["wind_across"]
    return {
        "rain_mmph": rain_rate(scenario.weather.rain),
        "water_film_m": maximum(film_mm, zero) * _METRES_PER_MM,
        "friction": peak_friction(
            given.constants, zero + FRICTION_SPEED, film_mm, zero + FRICTION_WEAR, zero
        ),
        "wind_mps": np.sqrt(along * along + across * across),
        "optical_range_m": meteorological_range(scenario.weather.fog),
        "sight_unlit_m": minimum(unlit, zero + given.constants.sight_range),
        "sight_lit_m": minimum(lit, zero + given.constants.sight_range),
    }
