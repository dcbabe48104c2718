"""Model constants, the clock, effects that can be switched off.

The step reads `ModelConstants`; `engine_constants` hands the same numbers to the engine.
"""
# ruff: noqa: RUF009 - the functions that make defaults return fields.

import dataclasses
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from overtaking.core.float32_math import HALF, ONE
from overtaking.knowledge.quantities import Values
from overtaking.knowledge.toml_reader import constant, load_quantity

STEP_MS = 10
"""Length of a step [ms]."""

SUBSTEPS = 5
"""Steps between two decisions."""

STEPS_PER_SECOND = np.float32(1000 // STEP_MS)
DECISIONS_PER_SECOND = np.float32(1000 // (STEP_MS * SUBSTEPS))

_UNLIMITED = 1e6
"""A range farther than any road is long [m]."""


def _constant_field(path: str) -> Any:
    """A field whose value is an entry of the knowledge base."""
    return field(default_factory=lambda: constant(path))


def _inverse_field(path: str) -> Any:
    """A field whose value is one over an entry of the knowledge base.

    The step multiplies by it instead of dividing.
    """
    return field(default_factory=lambda: ONE / constant(path))


def _table_field(path: str) -> Any:
    """A field whose value is an entry with several numbers, in tuples as deep as the entry."""
    return field(default_factory=lambda: _to_float32(load_quantity(path).value))


def _to_float32(values: Values) -> Any:
    """Numbers rounded once to float32, in tuples as deep as the given ones."""
    if isinstance(values, tuple):
        return tuple(_to_float32(value) for value in values)
    return np.float32(values)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelConstants:
    """Constants of the step, as the model was published; in SI units unless the name says another.

    `knowledge/data/model.toml`, `weather.toml` and `friction.toml` state meaning, unit and source
    of each. The engine has a field of the same name, see `crates/fields.py`.

    Attributes:
        friction_new: Peak friction of a new tyre at (speed, film) knots, shape (3, 4).
        friction_worn: Peak friction of a worn tyre at the same knots, shape (3, 4).
        friction_speeds: Speed knots [m/s].
        friction_films: Film knots [mm].
    """

    step: np.float32 = _constant_field("model.time.step")
    decision: np.float32 = _constant_field("model.time.decision")
    after_overtake: np.float32 = _constant_field("model.time.after_overtake")
    after_collision: np.float32 = _constant_field("model.time.after_collision")
    min_effective_gap: np.float32 = _constant_field("model.following.smallest_gap")
    jerk_up: np.float32 = _constant_field("model.following.jerk_up")
    jerk_down: np.float32 = _constant_field("model.following.jerk_down")
    brake_ramp: np.float32 = _constant_field("model.following.brake_ramp")
    stop_lamp_max_time_gap: np.float32 = _constant_field("model.following.heed_until")
    stop_lamp_full_time_gap: np.float32 = _constant_field("model.following.heed_wholly")
    jerk_release: np.float32 = _constant_field("model.following.jerk_release")
    coolness: np.float32 = _constant_field("model.following.coolness")
    signalling_time_gap: np.float32 = _constant_field("model.overtaking.signalling_time_gap")
    corridor_margin: np.float32 = _constant_field("model.lane_change.corridor_margin")
    footprint_margin: np.float32 = _constant_field("model.lane_change.footprint_margin")
    lane_cleared_share: np.float32 = _constant_field("model.lane_change.clear_fraction")
    lane_clearance_time: np.float32 = _constant_field("model.lane_change.clear_margin")
    visible_fraction: np.float32 = _constant_field("model.lane_change.visible_fraction")
    cooldown: np.float32 = _constant_field("model.lane_change.cooldown")
    min_lane_change_duration: np.float32 = _constant_field("model.lane_change.min_duration")
    abort_duration_share: np.float32 = _constant_field("model.lane_change.retreat_share")
    claim_time: np.float32 = _constant_field("model.lane_change.claim_time")
    foresight: np.float32 = _constant_field("model.lane_change.foresight")
    foresight_accel: np.float32 = _constant_field("model.lane_change.foresight_accel")
    no_passing_right_speed: np.float32 = _constant_field("model.lane_change.no_passing_right_speed")
    min_rear_gap: np.float32 = _constant_field("model.lane_change.smallest_rear_gap")
    free_ahead_time: np.float32 = _constant_field("model.lane_change.free_ahead_time")
    max_imposed_decel: np.float32 = _constant_field("model.overtaking.most_imposed")
    abort_imposed_factor: np.float32 = _constant_field("model.overtaking.abort_imposed")
    patience_floor: np.float32 = _constant_field("model.overtaking.patience_floor")
    close_time_gap: np.float32 = _constant_field("model.overtaking.close_time_gap")
    waiting_time_gap: np.float32 = _constant_field("model.overtaking.waiting_time_gap")
    accelerate_gain: np.float32 = _constant_field("model.overtaking.accelerate_gain")
    abort_until: np.float32 = _constant_field("model.overtaking.abort_until")
    abort_factor: np.float32 = _constant_field("model.overtaking.abort_factor")
    abort_cooldown: np.float32 = _constant_field("model.overtaking.abort_cooldown")
    give_up_after: np.float32 = _constant_field("model.overtaking.give_up_after")
    stay_time: np.float32 = _constant_field("model.overtaking.stay_time")
    return_clearance: np.float32 = _constant_field("model.overtaking.clear_ahead")
    settled_offset: np.float32 = _constant_field("model.overtaking.settled_offset")
    sight_range: np.float32 = _constant_field("model.perception.range")
    mirror_range: np.float32 = _constant_field("model.perception.mirror_range")
    unseen_gap: np.float32 = _constant_field("model.perception.unseen_gap")
    initial_time_in_view: np.float32 = _constant_field("model.perception.seen_before")
    lamp_decel: np.float32 = _constant_field("model.perception.lamp_decel")
    error_fade_time: np.float32 = _constant_field("model.perception.error_fade_time")
    urgent_time: np.float32 = _constant_field("model.perception.urgent_time")
    brake_memory: np.float32 = _constant_field("model.perception.brake_memory")
    stop_lamp_decel: np.float32 = _constant_field("model.lights.stop_lamp_decel")
    detection_growth: np.float32 = _constant_field("model.perception.detection_growth")
    blind_spot: np.float32 = _constant_field("model.perception.blind_spot")
    alongside: np.float32 = _constant_field("model.perception.alongside")
    glance_interval: np.float32 = _constant_field("model.perception.glance_interval")
    glance_moving: np.float32 = _constant_field("model.perception.glance_moving")
    glance_stagger: np.float32 = _constant_field("model.perception.glance_stagger")
    glance_time: np.float32 = _constant_field("model.perception.glance_time")
    looming_threshold: np.float32 = _constant_field("model.perception.looming_threshold")
    looming_growth: np.float32 = _constant_field("model.perception.looming_growth")
    lane_deviation: np.float32 = _constant_field("model.perception.lane_deviation")
    error_time: np.float32 = _constant_field("model.perception.error_time")
    lane_time: np.float32 = _constant_field("model.perception.lane_time")
    inverse_puddle_wave_1: np.float32 = _inverse_field("weather.puddles.first_wave")
    inverse_puddle_wave_2: np.float32 = _inverse_field("weather.puddles.second_wave")
    puddle_slope: np.float32 = _constant_field("weather.puddles.slope")
    spray_coefficient: np.float32 = _constant_field("weather.spray.coefficient")
    spray_film: np.float32 = _constant_field("weather.spray.full_film_mm")
    spray_speed: np.float32 = _constant_field("weather.spray.speed_scale")
    spray_reach: np.float32 = _constant_field("weather.spray.reach")
    rain_speed: np.float32 = _constant_field("weather.rain_sight.speed_scale")
    inverse_stop_lamp: np.float32 = _inverse_field("weather.lamps.stop")
    position_gain: np.float32 = _constant_field("model.steering.position_gain")
    velocity_gain: np.float32 = _constant_field("model.steering.velocity_gain")
    yaw_gain: np.float32 = _constant_field("model.steering.yaw_gain")
    slip_share: np.float32 = _constant_field("model.steering.slip_share")
    wind_lag: np.float32 = _constant_field("model.steering.wind_lag")
    steering_lag: np.float32 = _constant_field("model.steering.lag")
    steering_rate: np.float32 = _constant_field("model.steering.rate")
    steering_limit: np.float32 = _constant_field("model.steering.limit")
    bend_accel: np.float32 = _constant_field("model.steering.bend_accel")
    per_station: np.float32 = _inverse_field("model.steering.station")
    per_approach: np.float32 = _inverse_field("model.speed_choice.approach_time")
    passing_speed_factor: np.float32 = _constant_field("model.overtaking.pass_speed_factor")
    slip_speed: np.float32 = _constant_field("model.dynamics.slip_speed")
    abs_share: np.float32 = _constant_field("model.dynamics.abs_share")
    traction_share: np.float32 = _constant_field("model.dynamics.traction_share")
    stability_threshold: np.float32 = _constant_field("model.dynamics.stability_threshold")
    stability_time: np.float32 = _constant_field("model.dynamics.stability_time")
    governor_band: np.float32 = _constant_field("model.dynamics.governor_band")
    two_wheeler_lag: np.float32 = _constant_field("model.dynamics.two_wheeler_lag")
    standstill: np.float32 = _constant_field("model.dynamics.standstill")
    restitution: np.float32 = _constant_field("model.collision.restitution")
    near_gap: np.float32 = _constant_field("model.collision.near_gap")
    near_side: np.float32 = _constant_field("model.collision.near_side")
    edge_margin: np.float32 = _constant_field("model.departure.edge_margin")
    spin_angle: np.float32 = _constant_field("model.departure.spin_angle")
    sliding_ratio: np.float32 = _constant_field("friction.table.sliding_ratio")
    friction_floor: np.float32 = _constant_field("friction.table.floor")
    truck_dry_factor: np.float32 = _constant_field("friction.table.truck_dry_factor")
    truck_loss_factor: np.float32 = _constant_field("friction.table.truck_loss_factor")
    turbulence_intensity: np.float32 = _constant_field("weather.wind.turbulence_intensity")
    gust_length_scale: np.float32 = _constant_field("weather.wind.length_scale")
    wind_angle_factor: np.float32 = _constant_field("weather.wind.angle_factor")
    gust_spacing: np.float32 = _constant_field("weather.gusts.spacing")
    shelter_factor: np.float32 = _constant_field("weather.shelter.factor")
    shelter_reach: np.float32 = _constant_field("weather.shelter.reach")
    shelter_release: np.float32 = _constant_field("weather.shelter.release_ratio")
    oncoming_range: np.float32 = _constant_field("model.oncoming.range")
    two_wheeler_distance_factor: np.float32 = _constant_field("model.oncoming.small_oncomer")
    passing_speed_surplus: np.float32 = _constant_field("model.oncoming.passing_surplus")
    min_change_distance: np.float32 = _constant_field("model.oncoming.turning_way")
    min_return_gap: np.float32 = _constant_field("model.oncoming.squeeze_gap")
    min_return_space: np.float32 = _constant_field("model.oncoming.least_room")
    return_time_gap_share: np.float32 = _constant_field("model.oncoming.fit_share")
    urgent_return_margin: np.float32 = _constant_field("model.oncoming.calm_margin")
    min_time_reserve_share: np.float32 = _constant_field("model.oncoming.spare_kept")
    abort_margin: np.float32 = _constant_field("model.oncoming.abort_margin")
    tall_vehicle_gap_factor: np.float32 = _constant_field("model.oncoming.tall_room")
    urgent_speed_factor: np.float32 = _constant_field("model.oncoming.hurry_speed")
    urgent_accel_factor: np.float32 = _constant_field("model.oncoming.hurry_gain")
    abort_speed_difference: np.float32 = _constant_field("model.oncoming.fall_back_speed")
    abort_decel_share: np.float32 = _constant_field("model.oncoming.fall_back_share")
    eye_offset: np.float32 = _constant_field("model.oncoming.eye_offset")
    line_lookahead: np.float32 = _constant_field("model.oncoming.line_ahead")
    oncoming_flash_time: np.float32 = _constant_field("model.oncoming.flash_time")
    oncoming_lift_decel: np.float32 = _constant_field("model.oncoming.lift_decel")
    oncoming_brake_time: np.float32 = _constant_field("model.oncoming.brake_time")
    oncoming_min_decel: np.float32 = _constant_field("model.oncoming.min_decel")
    oncoming_max_decel: np.float32 = _constant_field("model.oncoming.max_decel")
    edge_shift: np.float32 = _constant_field("model.oncoming.aside_way")
    edge_shift_duration: np.float32 = _constant_field("model.oncoming.aside_duration")
    passed_awareness_margin: np.float32 = _constant_field("model.oncoming.beside_margin")
    gravity: np.float32 = _constant_field("model.nature.gravity")
    half_air_density: np.float32 = field(
        default_factory=lambda: HALF * constant("model.nature.air_density")
    )
    friction_new: tuple[tuple[np.float32, ...], ...] = _table_field("friction.table.new")
    friction_worn: tuple[tuple[np.float32, ...], ...] = _table_field("friction.table.worn")
    friction_speeds: tuple[np.float32, ...] = _table_field("friction.table.speeds")
    friction_films: tuple[np.float32, ...] = _table_field("friction.table.films_mm")

    def replace(self, **changes: float) -> "ModelConstants":
        """Copy the constants with some numbers changed, for ablations.

        Args:
            changes: New values by name, rounded to float32.

        Raises:
            TypeError: A name is not a constant.
        """
        numbers: dict[str, Any] = {name: np.float32(value) for name, value in changes.items()}
        return dataclasses.replace(self, **numbers)


CONSTANT_NAMES = tuple(
    entry.name for entry in dataclasses.fields(ModelConstants) if entry.type is np.float32
)
"""Names of the constants that are single numbers, in the order in which the engine takes them."""


@cache
def model_constants() -> ModelConstants:
    """The constants of the model as published."""
    return ModelConstants()


@dataclass(frozen=True, slots=True, kw_only=True)
class EnabledEffects:
    """Switches of physical and perceptual effects; all effects are on, except in ablations.

    Attributes:
        film: The film of water and the puddles on the road.
        gusts: Turbulence, and the gusts of bridges and cuttings.
        wake: The shelter from wind beside high-sided vehicles.
        range: Limits of sight by fog, rain, darkness and distance.
        delay: Reaction times and times of detection.
        distance_error: Misjudged distances.
        looming: The threshold below which an approach goes unnoticed.
        occlusion: Vehicles that hide others.
        mobil: Lane changes of the other vehicles.
    """

    film: bool = True
    gusts: bool = True
    wake: bool = True
    range: bool = True
    delay: bool = True
    distance_error: bool = True
    looming: bool = True
    occlusion: bool = True
    mobil: bool = True


def without_disabled_effects(constants: ModelConstants, effects: EnabledEffects) -> ModelConstants:
    """Constants with which the disabled effects do nothing.

    Only effects that a constant can switch off are treated here. The others change the parameters
    of vehicles and simulations, see `world.step_parameters`.

    Args:
        constants: Constants of the model.
        effects: The effects that are enabled.
    """
    changes: dict[str, float] = {}
    if not effects.gusts:
        changes["turbulence_intensity"] = 0.0
    if not effects.wake:
        changes["shelter_factor"] = 1.0
    if not effects.looming:
        changes["looming_threshold"] = 0.0
    if not effects.delay:
        changes["detection_growth"] = 0.0
    if not effects.range:
        changes |= {"sight_range": _UNLIMITED, "mirror_range": _UNLIMITED}
    return constants.replace(**changes) if changes else constants


def engine_constants(constants: ModelConstants) -> dict[str, Any]:
    """Constants in the form that the compiled engine takes.

    Returns:
        `values`, the single numbers in the order of `CONSTANT_NAMES`, and the tables of friction.
    """
    return {
        "values": [float(getattr(constants, name)) for name in CONSTANT_NAMES],
        "friction_new": [[float(friction) for friction in row] for row in constants.friction_new],
        "friction_worn": [[float(friction) for friction in row] for row in constants.friction_worn],
        "friction_speeds": [float(speed) for speed in constants.friction_speeds],
        "friction_films": [float(film) for film in constants.friction_films],
    }
