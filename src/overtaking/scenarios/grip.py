"""How hard each vehicle can brake at its start, on its lane and in its weather."""

import numpy as np

from overtaking.core.arrays import F32, U8
from overtaking.core.compiled import minimum
from overtaking.knowledge import number
from overtaking.model.road import Road
from overtaking.model.vehicles import VehicleKind, VehicleSpecs
from overtaking.model.weather import Weather
from overtaking.world import film, friction
from overtaking.world.constants import constants, known

USABLE_SHARE = number("starts.toml", "safety.usable_grip_share")
"""The share of the peak friction that a surprised driver uses."""


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
    depth, cover = film.puddle_depth(weather.puddles), film.puddle_cover(weather.puddles)
    dry = friction.at_film(c, columns, water)
    deep = friction.at_film(c, columns, water + depth[:, None])
    grip = dry + cover[:, None] * (deep - dry)
    return minimum(
        vehicles.peak_decel,
        np.float32(USABLE_SHARE * number("model.toml", "nature.gravity")) * grip,
    )


def _film(weather: Weather, road: Road) -> F32:
    """Film of water outside puddles, shape (simulation, lane) [mm]."""
    rate = film.rain_rate(weather.rain)
    least = film.least_film(rate, weather.puddles)
    # Water runs to the slow side, so a lane drains those on its fast side. In float64 until here:
    # the start of a simulation keeps its bits on every road.
    path = np.abs(road.boundaries[-1] - road.centres).astype(np.float32)
    texture = np.asarray(known("weather.film.texture_depth_mm"))
    return film.lane_film(
        least[:, None], film.film_per_rain(rate)[:, None], film.film_per_path(path), texture
    )
