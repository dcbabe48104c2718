"""The constants of the simulation step, as float32, gathered from the knowledge base.

The reference reads them from here and the engine is handed the same values, so that no number of
the model is written twice.
"""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from overtaking.knowledge import friction_table, number

_NAMES = {
    "step": "model.time.step",
    "decision": "model.time.decision",
    "after_overtake": "model.time.after_overtake",
    "after_collision": "model.time.after_collision",
    "smallest_gap": "model.following.smallest_gap",
    "jerk_up": "model.following.jerk_up",
    "jerk_down": "model.following.jerk_down",
    "brake_ramp": "model.following.brake_ramp",
    "heed_until": "model.following.heed_until",
    "heed_wholly": "model.following.heed_wholly",
    "jerk_release": "model.following.jerk_release",
    "coolness": "model.following.coolness",
    "signalling_time_gap": "model.overtaking.signalling_time_gap",
    "corridor_margin": "model.lane_change.corridor_margin",
    "footprint_margin": "model.lane_change.footprint_margin",
    "clear_fraction": "model.lane_change.clear_fraction",
    "clear_margin": "model.lane_change.clear_margin",
    "visible_fraction": "model.lane_change.visible_fraction",
    "cooldown": "model.lane_change.cooldown",
    "mobil_interval": "model.lane_change.mobil_interval",
    "no_passing_right_speed": "model.lane_change.no_passing_right_speed",
    "smallest_rear_gap": "model.lane_change.smallest_rear_gap",
    "free_ahead_time": "model.lane_change.free_ahead_time",
    "most_imposed": "model.overtaking.most_imposed",
    "abort_imposed": "model.overtaking.abort_imposed",
    "patience_floor": "model.overtaking.patience_floor",
    "close_time_gap": "model.overtaking.close_time_gap",
    "waiting_time_gap": "model.overtaking.waiting_time_gap",
    "accelerate_gain": "model.overtaking.accelerate_gain",
    "abort_until": "model.overtaking.abort_until",
    "abort_factor": "model.overtaking.abort_factor",
    "abort_cooldown": "model.overtaking.abort_cooldown",
    "give_up_after": "model.overtaking.give_up_after",
    "stay_time": "model.overtaking.stay_time",
    "clear_ahead": "model.overtaking.clear_ahead",
    "settled_offset": "model.overtaking.settled_offset",
    "sight_range": "model.perception.range",
    "mirror_range": "model.perception.mirror_range",
    "unseen_gap": "model.perception.unseen_gap",
    "seen_before": "model.perception.seen_before",
    "lamp_decel": "model.perception.lamp_decel",
    "error_fade_time": "model.perception.error_fade_time",
    "brake_memory": "model.perception.brake_memory",
    "stop_lamp_decel": "model.lights.stop_lamp_decel",
    "detection_growth": "model.perception.detection_growth",
    "blind_spot": "model.perception.blind_spot",
    "looming_threshold": "model.perception.looming_threshold",
    "lane_deviation": "model.perception.lane_deviation",
    "error_time": "model.perception.error_time",
    "lane_time": "model.perception.lane_time",
    "inverse_puddle_wave_1": "weather.puddles.first_wave",
    "inverse_puddle_wave_2": "weather.puddles.second_wave",
    "puddle_slope": "weather.puddles.slope",
    "spray_coefficient": "weather.spray.coefficient",
    "spray_film": "weather.spray.full_film_mm",
    "spray_speed": "weather.spray.speed_scale",
    "spray_reach": "weather.spray.reach",
    "rain_speed": "weather.rain_sight.speed_scale",
    "inverse_stop_lamp": "weather.lamps.stop",
    "position_gain": "model.steering.position_gain",
    "velocity_gain": "model.steering.velocity_gain",
    "yaw_gain": "model.steering.yaw_gain",
    "slip_share": "model.steering.slip_share",
    "wind_lag": "model.steering.wind_lag",
    "steering_lag": "model.steering.lag",
    "steering_rate": "model.steering.rate",
    "steering_limit": "model.steering.limit",
    "slip_speed": "model.dynamics.slip_speed",
    "abs_share": "model.dynamics.abs_share",
    "traction_share": "model.dynamics.traction_share",
    "governor_band": "model.dynamics.governor_band",
    "two_wheeler_lag": "model.dynamics.two_wheeler_lag",
    "standstill": "model.dynamics.standstill",
    "restitution": "model.collision.restitution",
    "near_gap": "model.collision.near_gap",
    "near_side": "model.collision.near_side",
    "edge_margin": "model.departure.edge_margin",
    "spin_angle": "model.departure.spin_angle",
    "sliding_ratio": "friction.table.sliding_ratio",
    "friction_floor": "friction.table.floor",
    "truck_dry_factor": "friction.table.truck_dry_factor",
    "truck_loss_factor": "friction.table.truck_loss_factor",
    "turbulence_intensity": "weather.wind.turbulence_intensity",
    "gust_length_scale": "weather.wind.length_scale",
    "wind_angle_factor": "weather.wind.angle_factor",
    "gust_spacing": "weather.gusts.spacing",
    "shelter_factor": "weather.shelter.factor",
    "shelter_reach": "weather.shelter.reach",
    "shelter_release": "weather.shelter.release_ratio",
    "gravity": "model.nature.gravity",
    "half_air_density": "model.nature.air_density",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Constants:
    """Every constant of the step; SI unless the name says otherwise.

    Attributes:
        values: Name to float32 value, in a fixed order.
        friction_new: Peak friction of a new tyre at (speed, film) knots, shape (3, 4).
        friction_worn: The same for a worn one.
        friction_speeds: Speed knots [m/s].
        friction_films: Film knots [mm].
    """

    values: dict[str, np.float32]
    friction_new: tuple[tuple[np.float32, ...], ...]
    friction_worn: tuple[tuple[np.float32, ...], ...]
    friction_speeds: tuple[np.float32, ...]
    friction_films: tuple[np.float32, ...]

    def __getattr__(self, name: str) -> np.float32:
        """The value called `name`."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None

    def replace(self, **changes: float) -> "Constants":
        """A copy with some values changed, for ablations; unknown names raise KeyError."""
        unknown = set(changes) - set(self.values)
        if unknown:
            raise KeyError(f"constants: unknown {sorted(unknown)}")
        values = self.values | {name: np.float32(value) for name, value in changes.items()}
        return dataclasses.replace(self, values=values)


@cache
def known(path: str) -> np.float32:
    """One number of the knowledge base, rounded once.

    Args:
        path: File and dotted name of the entry, such as `weather.fog.clear_range`.

    Raises:
        KnowledgeError: There is no such entry, or it is no single number.
    """
    file, _, name = path.partition(".")
    return np.float32(number(f"{file}.toml", name))


@cache
def constants() -> Constants:
    """The constants of the model as published."""
    values = {name: known(path) for name, path in _NAMES.items()}
    for name in values:
        if name.startswith("inverse_"):
            values[name] = np.float32(1.0) / values[name]
    values["half_air_density"] = np.float32(0.5) * values["half_air_density"]
    table = friction_table()
    return Constants(
        values=values,
        friction_new=tuple(_row(row) for row in table.new),
        friction_worn=tuple(_row(row) for row in table.worn),
        friction_speeds=_row(table.speeds),
        friction_films=_row(table.films_mm),
    )


def _row(numbers: Iterable[float]) -> tuple[np.float32, ...]:
    return tuple(np.float32(each) for each in numbers)
