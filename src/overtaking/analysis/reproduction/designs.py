"""The inputs of our simulations that are compared with those of the paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.analysis.reproduction.replicates import SIZE
from overtaking.analysis.stats.associations import ALPHA
from overtaking.analysis.stats.columns import FEATURES
from overtaking.core.errors import ConfigError
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.recordings.pinto2023_schema import COLUMNS
from overtaking.scenarios.specification import PresetWeather
from overtaking.scenarios.traffic_specification import PlacedTraffic

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification


def designs(spec: Specification, road: Road) -> dict[str, float]:
    """Our inputs by their names in `paper.toml`, in SI.

    Raises:
        ConfigError: The specification places no vehicles, or takes no weather from presets.
    """
    traffic, weather = spec.traffic, spec.weather
    if not isinstance(traffic, PlacedTraffic) or not isinstance(weather, PresetWeather):
        raise ConfigError(
            what="profile",
            where="reproduce",
            expected="placed vehicles and weather from presets, as in the paper",
            got=spec.name,
            next_step="reproduce pinto2023",
        )
    named = [weather_presets()[name] for name, weight in weather.presets.items() if weight > 0.0]
    nights = sum(one.sun_altitude_deg < 0.0 for one in named)
    spawn = traffic.spawn_x_m or (float("nan"), float("nan"))
    return {
        "simulations": SIZE,
        "vehicles_fewest": traffic.vehicles[0],
        "vehicles_most": traffic.vehicles[1],
        "vehicle_types": _used(traffic.types),
        "ego_types": _used(traffic.ego_types),
        "colours": _used(traffic.colours),
        "speed_lowest": mps_from_kmh(traffic.speed_kmh[0]),
        "speed_highest": mps_from_kmh(traffic.speed_kmh[1]),
        "lanes": road.num_lanes,
        "lane_width": road.lane_boundaries[1] - road.lane_boundaries[0],
        "spawn_nearest": spawn[0],
        "spawn_farthest": spawn[1],
        "speed_limit": road.speed_limit,
        "presets": len(named),
        "night_presets": nights / len(named),
        "columns": len(COLUMNS),
        "static_features": sum(one.is_static for one in FEATURES),
        "dynamic_features": sum(not one.is_static for one in FEATURES),
        "frames_per_second": 1000.0 / spec.profile.frame_interval_ms,
        "speed_factor": 1.0,  # Our vehicles drive as fast as they are recorded.
        "level": ALPHA,
    }


def _used(weights: dict[str, float]) -> int:
    """Number of kinds that may occur."""
    return sum(weight > 0.0 for weight in weights.values())
