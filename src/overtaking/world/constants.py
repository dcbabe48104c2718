"""The constants of the simulation step, as float32, gathered from the knowledge base.

The reference reads them from here and the engine is handed the same values, so that no number of
the model is written twice.
"""
# ruff: noqa: RUF009 - `_known` and `_inverse` return fields.

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from overtaking.knowledge import friction_table, number

_ONE = np.float32(1.0)
_HALF = np.float32(0.5)


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


def _known(path: str) -> Any:
    """A field whose value is an entry of the knowledge base."""
    return field(default_factory=lambda: known(path))


def _inverse(path: str) -> Any:
    """A field whose value is one over an entry: the step multiplies instead of dividing."""
    return field(default_factory=lambda: _ONE / known(path))


def _row(numbers: Iterable[float]) -> tuple[np.float32, ...]:
    return tuple(np.float32(each) for each in numbers)


def _table(rows: Iterable[Iterable[float]]) -> tuple[tuple[np.float32, ...], ...]:
    return tuple(_row(row) for row in rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class Constants:
    """Every constant of the step, as the model was published; SI unless the name says otherwise.

    `knowledge/data/model.toml`, `weather.toml` and `friction.toml` have meaning, unit and source of
    each. The engine has a field of the same name, see `crates/fields.py`.

    Attributes:
        friction_new: Peak friction of a new tyre at (speed, film) knots, shape (3, 4).
        friction_worn: The same for a worn one.
        friction_speeds: Speed knots [m/s].
        friction_films: Film knots [mm].
    """

    step: np.float32 = _known("model.time.step")
    decision: np.float32 = _known("model.time.decision")
    after_overtake: np.float32 = _known("model.time.after_overtake")
    after_collision: np.float32 = _known("model.time.after_collision")
    smallest_gap: np.float32 = _known("model.following.smallest_gap")
    jerk_up: np.float32 = _known("model.following.jerk_up")
    jerk_down: np.float32 = _known("model.following.jerk_down")
    brake_ramp: np.float32 = _known("model.following.brake_ramp")
    heed_until: np.float32 = _known("model.following.heed_until")
    heed_wholly: np.float32 = _known("model.following.heed_wholly")
    jerk_release: np.float32 = _known("model.following.jerk_release")
    coolness: np.float32 = _known("model.following.coolness")
    signalling_time_gap: np.float32 = _known("model.overtaking.signalling_time_gap")
    corridor_margin: np.float32 = _known("model.lane_change.corridor_margin")
    footprint_margin: np.float32 = _known("model.lane_change.footprint_margin")
    clear_fraction: np.float32 = _known("model.lane_change.clear_fraction")
    clear_margin: np.float32 = _known("model.lane_change.clear_margin")
    visible_fraction: np.float32 = _known("model.lane_change.visible_fraction")
    cooldown: np.float32 = _known("model.lane_change.cooldown")
    quickest_change: np.float32 = _known("model.lane_change.quickest")
    retreat_share: np.float32 = _known("model.lane_change.retreat_share")
    claim_time: np.float32 = _known("model.lane_change.claim_time")
    foresight: np.float32 = _known("model.lane_change.foresight")
    foresight_accel: np.float32 = _known("model.lane_change.foresight_accel")
    no_passing_right_speed: np.float32 = _known("model.lane_change.no_passing_right_speed")
    smallest_rear_gap: np.float32 = _known("model.lane_change.smallest_rear_gap")
    free_ahead_time: np.float32 = _known("model.lane_change.free_ahead_time")
    most_imposed: np.float32 = _known("model.overtaking.most_imposed")
    abort_imposed: np.float32 = _known("model.overtaking.abort_imposed")
    patience_floor: np.float32 = _known("model.overtaking.patience_floor")
    close_time_gap: np.float32 = _known("model.overtaking.close_time_gap")
    waiting_time_gap: np.float32 = _known("model.overtaking.waiting_time_gap")
    accelerate_gain: np.float32 = _known("model.overtaking.accelerate_gain")
    abort_until: np.float32 = _known("model.overtaking.abort_until")
    abort_factor: np.float32 = _known("model.overtaking.abort_factor")
    abort_cooldown: np.float32 = _known("model.overtaking.abort_cooldown")
    give_up_after: np.float32 = _known("model.overtaking.give_up_after")
    stay_time: np.float32 = _known("model.overtaking.stay_time")
    clear_ahead: np.float32 = _known("model.overtaking.clear_ahead")
    settled_offset: np.float32 = _known("model.overtaking.settled_offset")
    sight_range: np.float32 = _known("model.perception.range")
    mirror_range: np.float32 = _known("model.perception.mirror_range")
    unseen_gap: np.float32 = _known("model.perception.unseen_gap")
    seen_before: np.float32 = _known("model.perception.seen_before")
    lamp_decel: np.float32 = _known("model.perception.lamp_decel")
    error_fade_time: np.float32 = _known("model.perception.error_fade_time")
    urgent_time: np.float32 = _known("model.perception.urgent_time")
    brake_memory: np.float32 = _known("model.perception.brake_memory")
    stop_lamp_decel: np.float32 = _known("model.lights.stop_lamp_decel")
    detection_growth: np.float32 = _known("model.perception.detection_growth")
    blind_spot: np.float32 = _known("model.perception.blind_spot")
    alongside: np.float32 = _known("model.perception.alongside")
    glance_interval: np.float32 = _known("model.perception.glance_interval")
    glance_moving: np.float32 = _known("model.perception.glance_moving")
    glance_stagger: np.float32 = _known("model.perception.glance_stagger")
    glance_time: np.float32 = _known("model.perception.glance_time")
    looming_threshold: np.float32 = _known("model.perception.looming_threshold")
    looming_growth: np.float32 = _known("model.perception.looming_growth")
    lane_deviation: np.float32 = _known("model.perception.lane_deviation")
    error_time: np.float32 = _known("model.perception.error_time")
    lane_time: np.float32 = _known("model.perception.lane_time")
    inverse_puddle_wave_1: np.float32 = _inverse("weather.puddles.first_wave")
    inverse_puddle_wave_2: np.float32 = _inverse("weather.puddles.second_wave")
    puddle_slope: np.float32 = _known("weather.puddles.slope")
    spray_coefficient: np.float32 = _known("weather.spray.coefficient")
    spray_film: np.float32 = _known("weather.spray.full_film_mm")
    spray_speed: np.float32 = _known("weather.spray.speed_scale")
    spray_reach: np.float32 = _known("weather.spray.reach")
    rain_speed: np.float32 = _known("weather.rain_sight.speed_scale")
    inverse_stop_lamp: np.float32 = _inverse("weather.lamps.stop")
    position_gain: np.float32 = _known("model.steering.position_gain")
    velocity_gain: np.float32 = _known("model.steering.velocity_gain")
    yaw_gain: np.float32 = _known("model.steering.yaw_gain")
    slip_share: np.float32 = _known("model.steering.slip_share")
    wind_lag: np.float32 = _known("model.steering.wind_lag")
    steering_lag: np.float32 = _known("model.steering.lag")
    steering_rate: np.float32 = _known("model.steering.rate")
    steering_limit: np.float32 = _known("model.steering.limit")
    bend_accel: np.float32 = _known("model.steering.bend_accel")
    per_station: np.float32 = _inverse("model.steering.station")
    per_approach: np.float32 = _inverse("model.speed_choice.approach_time")
    pass_speed_factor: np.float32 = _known("model.overtaking.pass_speed_factor")
    slip_speed: np.float32 = _known("model.dynamics.slip_speed")
    abs_share: np.float32 = _known("model.dynamics.abs_share")
    traction_share: np.float32 = _known("model.dynamics.traction_share")
    stability_threshold: np.float32 = _known("model.dynamics.stability_threshold")
    stability_time: np.float32 = _known("model.dynamics.stability_time")
    governor_band: np.float32 = _known("model.dynamics.governor_band")
    two_wheeler_lag: np.float32 = _known("model.dynamics.two_wheeler_lag")
    standstill: np.float32 = _known("model.dynamics.standstill")
    restitution: np.float32 = _known("model.collision.restitution")
    near_gap: np.float32 = _known("model.collision.near_gap")
    near_side: np.float32 = _known("model.collision.near_side")
    edge_margin: np.float32 = _known("model.departure.edge_margin")
    spin_angle: np.float32 = _known("model.departure.spin_angle")
    sliding_ratio: np.float32 = _known("friction.table.sliding_ratio")
    friction_floor: np.float32 = _known("friction.table.floor")
    truck_dry_factor: np.float32 = _known("friction.table.truck_dry_factor")
    truck_loss_factor: np.float32 = _known("friction.table.truck_loss_factor")
    turbulence_intensity: np.float32 = _known("weather.wind.turbulence_intensity")
    gust_length_scale: np.float32 = _known("weather.wind.length_scale")
    wind_angle_factor: np.float32 = _known("weather.wind.angle_factor")
    gust_spacing: np.float32 = _known("weather.gusts.spacing")
    shelter_factor: np.float32 = _known("weather.shelter.factor")
    shelter_reach: np.float32 = _known("weather.shelter.reach")
    shelter_release: np.float32 = _known("weather.shelter.release_ratio")
    oncoming_range: np.float32 = _known("model.oncoming.range")
    small_oncomer: np.float32 = _known("model.oncoming.small_oncomer")
    passing_surplus: np.float32 = _known("model.oncoming.passing_surplus")
    turning_way: np.float32 = _known("model.oncoming.turning_way")
    squeeze_gap: np.float32 = _known("model.oncoming.squeeze_gap")
    least_room: np.float32 = _known("model.oncoming.least_room")
    fit_share: np.float32 = _known("model.oncoming.fit_share")
    calm_margin: np.float32 = _known("model.oncoming.calm_margin")
    spare_kept: np.float32 = _known("model.oncoming.spare_kept")
    abort_margin: np.float32 = _known("model.oncoming.abort_margin")
    tall_room: np.float32 = _known("model.oncoming.tall_room")
    hurry_speed: np.float32 = _known("model.oncoming.hurry_speed")
    hurry_gain: np.float32 = _known("model.oncoming.hurry_gain")
    fall_back_speed: np.float32 = _known("model.oncoming.fall_back_speed")
    fall_back_share: np.float32 = _known("model.oncoming.fall_back_share")
    eye_offset: np.float32 = _known("model.oncoming.eye_offset")
    line_ahead: np.float32 = _known("model.oncoming.line_ahead")
    head_on_flash: np.float32 = _known("model.oncoming.flash_time")
    head_on_lift: np.float32 = _known("model.oncoming.lift_decel")
    head_on_time: np.float32 = _known("model.oncoming.brake_time")
    head_on_least: np.float32 = _known("model.oncoming.least_decel")
    head_on_most: np.float32 = _known("model.oncoming.most_decel")
    aside_way: np.float32 = _known("model.oncoming.aside_way")
    aside_duration: np.float32 = _known("model.oncoming.aside_duration")
    beside_margin: np.float32 = _known("model.oncoming.beside_margin")
    gravity: np.float32 = _known("model.nature.gravity")
    half_air_density: np.float32 = field(
        default_factory=lambda: _HALF * known("model.nature.air_density")
    )
    friction_new: tuple[tuple[np.float32, ...], ...] = field(
        default_factory=lambda: _table(friction_table().new)
    )
    friction_worn: tuple[tuple[np.float32, ...], ...] = field(
        default_factory=lambda: _table(friction_table().worn)
    )
    friction_speeds: tuple[np.float32, ...] = field(
        default_factory=lambda: _row(friction_table().speeds)
    )
    friction_films: tuple[np.float32, ...] = field(
        default_factory=lambda: _row(friction_table().films_mm)
    )

    def replace(self, **changes: float) -> "Constants":
        """A copy with some numbers changed, for ablations; unknown names raise TypeError."""
        numbers: dict[str, Any] = {name: np.float32(value) for name, value in changes.items()}
        return dataclasses.replace(self, **numbers)


CONSTANT_FIELDS = tuple(one.name for one in dataclasses.fields(Constants) if one.type is np.float32)
"""The names of the single numbers."""


@cache
def constants() -> Constants:
    """The constants of the model as published."""
    return Constants()
