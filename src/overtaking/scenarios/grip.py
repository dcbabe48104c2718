"""How hard each vehicle can brake at its start, on its lane and in its weather."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.compiled import maximum, minimum
from overtaking.core.units import GRAVITY
from overtaking.knowledge import weather_maps
from overtaking.model.vehicles import VehicleKind, VehicleSpecs
from overtaking.world import film, friction
from overtaking.world.constants import constants

if TYPE_CHECKING:
    from overtaking.core.elementary import F32
    from overtaking.model.road import Road
    from overtaking.model.weather import Weather
    from overtaking.scenarios.noise import U8

USABLE_SHARE = 0.7
"""The part of the peak friction that a driver who is surprised gets out of the tyres."""


def usable_decel(vehicles: VehicleSpecs, weather: Weather, road: Road, lane: U8, speed: F32) -> F32:
    """Deceleration that a driver can count on from a speed down [m/s^2].

    Friction falls with speed, so that of the highest speed is on the safe side for all of the
    braking. Puddles count with the part of the lane that they cover.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        weather: Weather, shape (simulation,).
        road: The road.
        lane: Lane of each vehicle, 0 the slowest, (simulation, vehicle).
        speed: Speed from which it brakes, (simulation, vehicle) [m/s].
    """
    c = constants()
    truck = (vehicles.kind == VehicleKind.T).astype(np.float32)
    columns = friction.speed_columns(c, speed, vehicles.tyre_wear, truck)
    water = _film(weather, road)[np.arange(lane.shape[0])[:, None], lane]
    depth, cover = _puddles(weather)
    dry = friction.at_film(c, columns, water)
    deep = friction.at_film(c, columns, water + depth[:, None])
    grip = dry + cover[:, None] * (deep - dry)
    return minimum(vehicles.peak_decel, np.float32(USABLE_SHARE * GRAVITY) * grip)


def _film(weather: Weather, road: Road) -> F32:
    """Film of water outside puddles, shape (simulation, lane) [mm]."""
    maps = weather_maps().film
    rate = film.rain_rate(weather.rain)
    wet = (rate > 0) | (weather.puddles >= np.float32(maps.wet_deposits_percent))
    least = np.where(wet, np.float32(maps.wet_film_mm), np.float32(0.0))
    # Water runs to the slow side, so a lane drains those on its fast side.
    path = np.abs(road.boundaries[-1] - road.centres).astype(np.float32)
    texture = np.array(maps.texture_depth_mm, np.float32)
    return film.lane_film(
        least[:, None], film.film_per_rain(rate)[:, None], film.film_per_path(path), texture
    )


def _puddles(weather: Weather) -> tuple[F32, F32]:
    """Depth of a puddle [mm], and the part of a lane under puddles, shape (simulation,)."""
    maps = weather_maps().puddles
    from_percent = np.float32(maps.from_percent)
    full = (weather.puddles - from_percent) / (np.float32(100.0) - from_percent)
    depth = np.float32(maps.max_film_mm) * maximum(full, np.zeros_like(full))
    return depth, np.float32(maps.full_cover / 100.0) * weather.puddles
