"""Numbers of the model that are equal for all simulations, and switches that disable effects.

The numbers come from the TOML files in `knowledge/data`, which state unit, source and rationale of
each: change a number there. A *step* is 10 ms. Every fifth step is a *decision*: drivers perceive
and decide. The model is written twice: the reference simulator in Python (`sim.reference`) reads
`ModelConstants`, and the compiled engine receives the same numbers from `engine_constants`.

`EnabledEffects` are the switches. They serve ablations: simulations without one effect of the
model, which show its influence.
"""
# ruff: noqa: RUF009 - the rule forbids function calls as defaults; the calls here return a
# `dataclasses.field`, which makes a default for each instance.

import dataclasses
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from overtaking.core.float32_math import HALF, ONE
from overtaking.knowledge.quantities import Values
from overtaking.knowledge.toml_reader import constant, load_quantity

STEP_MS = 10
"""Duration of a step, as `ModelConstants.step` but a whole number [ms]."""

SUBSTEPS = 5
"""Steps from one decision to the next."""

STEPS_PER_SECOND = np.float32(1000 // STEP_MS)
DECISIONS_PER_SECOND = np.float32(1000 // (STEP_MS * SUBSTEPS))

_UNLIMITED = 1e6
"""A range of attention that excludes no vehicle: neighbours are never so far apart [m]."""


# The paths below name a file of `knowledge/data`, a section and an entry: `model.time.step` is the
# entry `step` of `[time]` in `model.toml`. The files are read when the first instance is made, not
# at import.


def _constant_field(path: str) -> Any:
    """A dataclass field whose default is an entry, in SI units.

    An entry with a unit at the end of its name, such as `_mm`, stays in that unit.
    """
    return field(default_factory=lambda: constant(path))


def _inverse_field(path: str) -> Any:
    """A dataclass field whose default is one over an entry: the step multiplies, not divides."""
    return field(default_factory=lambda: ONE / constant(path))


def _table_field(path: str) -> Any:
    """A dataclass field whose default is an entry that is a list, or a list of lists."""
    return field(default_factory=lambda: _to_float32(load_quantity(path).value))


def _to_float32(values: Values) -> Any:
    """Round a number, or each number of nested tuples, to float32, the type of the step."""
    if isinstance(values, tuple):
        return tuple(_to_float32(value) for value in values)
    return np.float32(values)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelConstants:
    """Constants of the step: single float32 numbers, then the tables of friction as tuples.

    The engine has fields of the same names in the same order, which `crates/engine_names.py`
    writes: run it after a change. The *ego* is the vehicle under study, "others" are all other
    vehicles. The *overtaking lane* is the next lane towards the overtaking side; on a two-way
    road it is the opposing lane. The *target* is the vehicle that the driver overtakes. TTC is the
    time to collision. Looming is the growth of the visual angle of a vehicle that comes nearer.

    Attributes:
        step: Duration of a step [s].
        decision: Time between two decisions [s].
        after_overtake: Time simulated after the ego has returned from its overtake [s].
        after_collision: Time simulated after the ego has collided or left the road [s].
        min_effective_gap: Smaller gaps count as this in car following [m].
        jerk_up: Fastest growth of the acceleration while it is zero or more [m/s^3].
        jerk_down: Fastest fall of the acceleration for moderate braking [m/s^3].
        brake_ramp: Time in which a driver builds up strong braking: the acceleration falls at the
            desired deceleration divided by this time, if that exceeds `jerk_down` [s].
        stop_lamp_max_time_gap: Time gap above which a driver ignores stop lamps of its leader [s].
        stop_lamp_full_time_gap: Time gap up to which a driver brakes as hard as its braking leader
            makes necessary; from here to `stop_lamp_max_time_gap` the reaction fades [s].
        jerk_release: Fastest growth of the acceleration while it is negative [m/s^3].
        coolness: The car-following model (IIDM) can brake harder than a leader of constant
            acceleration requires. Then `coolness` is the weight of the required braking, and
            1 - `coolness` the weight of the braking by the IIDM (Treiber and Kesting 2013) [1].
        signalling_time_gap: Share of the desired time gap that a driver keeps while it signals to
            pull out [1].
        corridor_margin: A vehicle occupies a lane that it overlaps by more than this [m].
        footprint_margin: A driver that changes lane follows the leader of its old lane until their
            lateral gap is larger than this [m].
        lane_cleared_share: Share of the duration of a lane change after which the vehicle has left
            its old lane [1].
        lane_clearance_time: A driver plans to leave its old lane this long before it would reach
            the leader there [s].
        visible_fraction: Share of the duration of a lane change after which other drivers notice it
            [1].
        cooldown: For the others, time from the start of a lane change to the start of the next one.
            If the next one begins an overtake, `abort_cooldown` holds instead [s].
        min_lane_change_duration: Shortest duration of a lane change that avoids a leader [s].
        abort_duration_share: Duration of the way back of a cancelled lane change, over the usual
            duration of a lane change [1].
        claim_time: Two drivers may signal for the same lane, one from its left and one from its
            right. The driver behind waits if they are less than this time apart along the road [s].
        foresight: Before a lane change, the new follower is judged at its present state and at its
            state after this time [s].
        foresight_accel: Acceleration that the new follower is assumed to have in that time [m/s^2].
        no_passing_right_speed: Speed above which drivers do not pass on the kerb side [m/s].
        min_rear_gap: Smallest gap to the vehicles of the new lane for a lane change [m].
        free_ahead_time: The others return to the slower lane if the time gap to the next leader
            there is longer [s].
        max_imposed_decel: Hardest braking that a lane change may demand of the new follower
            [m/s^2].
        abort_imposed_factor: Factor on the braking that a driver accepts for the new follower; a
            driver that would impose more cancels the lane change [1].
        patience_floor: Smallest factor on the gaps and speed gains that a driver demands; the
            factor falls from 1 while the driver waits behind a slower leader [1].
        close_time_gap: A leader within this many desired time gaps is close enough to overtake [1].
        waiting_time_gap: A driver behind a slower leader waits if its time gap is shorter [s].
        accelerate_gain: Factor on the acceleration while passing, when drivers use more of the
            engine than while following [1].
        abort_until: Share of the duration of a lane change up to which it can be cancelled [1].
        abort_factor: Factor on the comfortable deceleration; a driver that must brake harder
            cancels the lane change [1].
        abort_cooldown: Time from a lane change to the next attempt to overtake, or to return [s].
        give_up_after: Time in the overtaking lane after which a driver that is not past the target
            returns behind it [s].
        stay_time: A driver stays in the overtaking lane if it would reach the next leader of the
            slower lane within this time [s].
        return_clearance: Gap to the passed vehicle from which a driver may return [m].
        settled_offset: Distance to the lane centre below which a lane change is complete [m].
        sight_range: Distance to which drivers attend to vehicles ahead [m].
        mirror_range: Distance to which drivers attend to vehicles in the mirrors [m].
        unseen_gap: Gap that a driver believes in where it has noticed no vehicle [m].
        initial_time_in_view: Time for which the vehicles that are visible at the start are assumed
            to have been in view: longer than any detection time [s].
        lamp_decel: Smallest deceleration that a driver assumes of a vehicle with lit stop lamps,
            until looming shows the true one [m/s^2].
        error_fade_time: TTC below which errors of judgement become smaller [s].
        urgent_time: TTC below which drivers react with their shorter, urgent reaction time [s].
        brake_memory: Number of decisions over which drivers judge the braking of a leader [1].
        stop_lamp_decel: Deceleration from which the stop lamps are lit [m/s^2].
        detection_growth: Detection time at the limit of sight, divided by the detection time in
            plain view, minus 1 [1].
        blind_spot: Length of the area behind the rear bumper that the mirrors do not show [m].
        alongside: Lateral gap below which a driver notices a vehicle in that area [m].
        glance_interval: Decisions between two looks at mirrors and other lanes [1].
        glance_moving: Decisions between two looks at the lane that a driver enters, in the first
            half of a lane change [1].
        glance_stagger: Decisions from the look of one driver to the look of the driver in the next
            slot, so that few drivers look at the same time [1].
        glance_time: Time in view that each look adds for the vehicles that it shows [s].
        looming_threshold: Growth of the visual angle from which an approach is noticed [rad/s].
        looming_growth: Above the threshold drivers perceive a growing part of the closing speed,
            and all of it from (1 + `looming_growth`) times the threshold [1].
        lane_deviation: Standard deviation of the wandering in the lane [m].
        error_time: Correlation time of errors of judgement [s].
        lane_time: Correlation time of the wandering in the lane [s].
        inverse_puddle_wave_1: One over the length of the first wave of the puddles [1/m].
        inverse_puddle_wave_2: One over the length of the second wave [1/m].
        puddle_slope: Puddles lie where the sum of the two waves is below a threshold
            (`road_surface.puddle_depth_share`). They have their full depth where it is below by
            1 / `puddle_slope` or more [1].
        spray_coefficient: Extinction in the spray of a car at `spray_speed` [1/m].
        spray_film: Film of water beyond which the spray does not grow [mm].
        spray_speed: Reference speed of the spray, which grows with the square of speed [m/s].
        spray_reach: Length of the spray behind a vehicle [m].
        rain_speed: Speed at which a driver meets twice the rain of an observer at rest [m/s].
        inverse_stop_lamp: One over the luminous intensity of a stop lamp [1/cd].
        position_gain: Lateral acceleration that a driver requests per lateral distance from its
            path [1/s^2].
        velocity_gain: The same per error of the lateral speed [1/s].
        yaw_gain: Gain on the requested lateral acceleration minus speed times yaw rate [1].
        slip_share: Largest front slip angle that drivers steer, in units of the friction
            coefficient over the cornering stiffness per load; the tyre slides at 3 units [1].
        wind_lag: Time constant with which drivers steer against side wind [s].
        steering_lag: Time constant of the wheel angle [s].
        steering_rate: Largest speed of the wheel angle [rad/s].
        steering_limit: Largest wheel angle [rad].
        bend_accel: Lateral acceleration that drivers choose in bends, if friction allows [m/s^2].
        per_station: One over the distance between the stations of a `CourseTable`, at which the
            step knows the geometry of a road [1/m].
        per_approach: One over the time in which the speed approaches a falling limit [1/s].
        passing_speed_factor: Factor on the desired speed while passing [1].
        slip_speed: Smaller speeds count as this where a formula divides by speed [m/s].
        abs_share: Share of the friction that anti-lock brakes use [1].
        traction_share: Share of the friction that traction control leaves to the engine [1].
        stability_threshold: Error of the yaw rate that stability control ignores [rad/s].
        stability_time: Time in which stability control removes an error of the yaw rate [s].
        governor_band: Speeds above the top speed over which the governor closes the throttle [m/s].
        two_wheeler_lag: Time constant with which a two-wheeler leans [s].
        standstill: Speed below which a vehicle that does not accelerate stands [m/s].
        restitution: Coefficient of restitution of collisions [1].
        near_gap: Contacts are computed for bodies within this distance along the road [m].
        near_side: Contacts are computed for bodies within this distance across the road [m].
        edge_margin: A vehicle has left the road if its centre is this far beyond the edge [m].
        spin_angle: A vehicle is out of control at this angle to the road [rad].
        sliding_ratio: Friction of a wrecked, sliding vehicle over its peak friction [1].
        friction_floor: Smallest friction coefficient of a tyre [1].
        truck_dry_factor: Friction of truck over car tyres on a dry road [1].
        truck_loss_factor: Loss of friction with speed, of truck over car tyres on a wet road [1].
        turbulence_intensity: Standard deviation of the turbulence over the mean wind [1].
        gust_length_scale: Length over which the turbulence is correlated [m].
        wind_angle_factor: The side force grows with the sine of this factor times the angle of the
            relative wind, up to its maximum [1].
        gust_spacing: Distance from one single gust of a bridge or cutting to the next [m].
        shelter_factor: Share of the cross wind that remains in the lee of a high-sided vehicle [1].
        shelter_reach: Lateral gap up to which the lee acts [m].
        shelter_release: Distance beyond that vehicle over which the wind returns, in lengths of the
            vehicle [1].
        oncoming_range: Distance to which drivers look for oncoming vehicles [m].
        two_wheeler_distance_factor: Believed over true distance of oncoming two-wheelers [1].
        passing_speed_surplus: Speed above the target's that drivers want while passing against
            oncoming traffic [m/s].
        min_change_distance: Shortest distance along the road that an urgent lane change takes [m].
        min_return_gap: Gap to the target that drivers keep in an urgent return or abort [m].
        min_return_space: Gap to the leader plus gap to the follower in the lane to return to, below
            which a driver aborts instead [m].
        return_time_gap_share: Share of the desired time gap that must be free ahead of the target
            for a return [1].
        urgent_return_margin: A return is urgent if the driver would complete it less than this
            before it meets the oncoming vehicle [s].
        min_time_reserve_share: The time reserve before oncoming vehicles that a driver demands
            falls while it waits, down to this share [1].
        abort_margin: A driver behind the middle of the target aborts if it would complete the
            overtake less than this before it meets the oncoming vehicle [s].
        tall_vehicle_gap_factor: Factor on the gaps to vehicles that hide the road ahead [1].
        urgent_speed_factor: Factor on the passing speed in an urgent return [1].
        urgent_accel_factor: Factor on the acceleration in an urgent return [1].
        abort_speed_difference: An aborting driver brakes until it is slower than the target by this
            [m/s].
        abort_decel_share: Braking in an abort, as a share of the strongest braking that the driver
            counts on [1].
        eye_offset: Distance of the driver's eye from the vehicle's path towards the opposing lane,
            including the shift by which it looks past a leader [m].
        line_lookahead: Distance ahead at which drivers heed a solid line [m].
        oncoming_flash_time: Time to meet a vehicle in the driver's own lane below which the driver
            flashes and lifts the throttle [s].
        oncoming_lift_decel: Deceleration with the throttle lifted [m/s^2].
        oncoming_brake_time: Time to meet such a vehicle below which the driver brakes [s].
        oncoming_min_decel: Weakest braking for such a vehicle [m/s^2].
        oncoming_max_decel: Strongest braking for such a vehicle [m/s^2].
        edge_shift: Lateral shift towards the edge while braking for such a vehicle [m].
        edge_shift_duration: Duration of that shift [s].
        passed_awareness_margin: Gap along the road below which a driver knows that a vehicle in
            the overtaking lane passes it [m].
        gravity: Acceleration of gravity [m/s^2].
        half_air_density: Half the density of air [kg/m^3].
        friction_new: Peak friction of a new tyre at (speed, film), shape (3, 4) [1].
        friction_worn: Peak friction of a worn tyre at the same points, shape (3, 4) [1].
        friction_speeds: Speeds of the rows of both tables, shape (3,) [m/s].
        friction_films: Films of water of their columns, shape (4,) [mm].
    """

    step: np.float32 = _constant_field("model.time.step")
    decision: np.float32 = _constant_field("model.time.decision")
    after_overtake: np.float32 = _constant_field("model.time.after_overtake")
    after_collision: np.float32 = _constant_field("model.time.after_collision")
    min_effective_gap: np.float32 = _constant_field("model.following.min_effective_gap")
    jerk_up: np.float32 = _constant_field("model.following.jerk_up")
    jerk_down: np.float32 = _constant_field("model.following.jerk_down")
    brake_ramp: np.float32 = _constant_field("model.following.brake_ramp")
    stop_lamp_max_time_gap: np.float32 = _constant_field("model.following.stop_lamp_max_time_gap")
    stop_lamp_full_time_gap: np.float32 = _constant_field("model.following.stop_lamp_full_time_gap")
    jerk_release: np.float32 = _constant_field("model.following.jerk_release")
    coolness: np.float32 = _constant_field("model.following.coolness")
    signalling_time_gap: np.float32 = _constant_field("model.overtaking.signalling_time_gap")
    corridor_margin: np.float32 = _constant_field("model.lane_change.corridor_margin")
    footprint_margin: np.float32 = _constant_field("model.lane_change.footprint_margin")
    lane_cleared_share: np.float32 = _constant_field("model.lane_change.cleared_share")
    lane_clearance_time: np.float32 = _constant_field("model.lane_change.clearance_time")
    visible_fraction: np.float32 = _constant_field("model.lane_change.visible_fraction")
    cooldown: np.float32 = _constant_field("model.lane_change.cooldown")
    min_lane_change_duration: np.float32 = _constant_field("model.lane_change.min_duration")
    abort_duration_share: np.float32 = _constant_field("model.lane_change.abort_duration_share")
    claim_time: np.float32 = _constant_field("model.lane_change.claim_time")
    foresight: np.float32 = _constant_field("model.lane_change.foresight")
    foresight_accel: np.float32 = _constant_field("model.lane_change.foresight_accel")
    no_passing_right_speed: np.float32 = _constant_field("model.lane_change.no_passing_right_speed")
    min_rear_gap: np.float32 = _constant_field("model.lane_change.min_rear_gap")
    free_ahead_time: np.float32 = _constant_field("model.lane_change.free_ahead_time")
    max_imposed_decel: np.float32 = _constant_field("model.overtaking.max_imposed_decel")
    abort_imposed_factor: np.float32 = _constant_field("model.overtaking.abort_imposed_factor")
    patience_floor: np.float32 = _constant_field("model.overtaking.patience_floor")
    close_time_gap: np.float32 = _constant_field("model.overtaking.close_time_gap")
    waiting_time_gap: np.float32 = _constant_field("model.overtaking.waiting_time_gap")
    accelerate_gain: np.float32 = _constant_field("model.overtaking.accelerate_gain")
    abort_until: np.float32 = _constant_field("model.overtaking.abort_until")
    abort_factor: np.float32 = _constant_field("model.overtaking.abort_factor")
    abort_cooldown: np.float32 = _constant_field("model.overtaking.abort_cooldown")
    give_up_after: np.float32 = _constant_field("model.overtaking.give_up_after")
    stay_time: np.float32 = _constant_field("model.overtaking.stay_time")
    return_clearance: np.float32 = _constant_field("model.overtaking.return_clearance")
    settled_offset: np.float32 = _constant_field("model.overtaking.settled_offset")
    sight_range: np.float32 = _constant_field("model.perception.range")
    mirror_range: np.float32 = _constant_field("model.perception.mirror_range")
    unseen_gap: np.float32 = _constant_field("model.perception.unseen_gap")
    initial_time_in_view: np.float32 = _constant_field("model.perception.initial_time_in_view")
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
    passing_speed_factor: np.float32 = _constant_field("model.overtaking.passing_speed_factor")
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
    two_wheeler_distance_factor: np.float32 = _constant_field(
        "model.oncoming.two_wheeler_distance_factor"
    )
    passing_speed_surplus: np.float32 = _constant_field("model.oncoming.passing_speed_surplus")
    min_change_distance: np.float32 = _constant_field("model.oncoming.min_change_distance")
    min_return_gap: np.float32 = _constant_field("model.oncoming.min_return_gap")
    min_return_space: np.float32 = _constant_field("model.oncoming.min_return_space")
    return_time_gap_share: np.float32 = _constant_field("model.oncoming.return_time_gap_share")
    urgent_return_margin: np.float32 = _constant_field("model.oncoming.urgent_return_margin")
    min_time_reserve_share: np.float32 = _constant_field("model.oncoming.min_time_reserve_share")
    abort_margin: np.float32 = _constant_field("model.oncoming.abort_margin")
    tall_vehicle_gap_factor: np.float32 = _constant_field("model.oncoming.tall_vehicle_gap_factor")
    urgent_speed_factor: np.float32 = _constant_field("model.oncoming.urgent_speed_factor")
    urgent_accel_factor: np.float32 = _constant_field("model.oncoming.urgent_accel_factor")
    abort_speed_difference: np.float32 = _constant_field("model.oncoming.abort_speed_difference")
    abort_decel_share: np.float32 = _constant_field("model.oncoming.abort_decel_share")
    eye_offset: np.float32 = _constant_field("model.oncoming.eye_offset")
    line_lookahead: np.float32 = _constant_field("model.oncoming.line_lookahead")
    oncoming_flash_time: np.float32 = _constant_field("model.oncoming.flash_time")
    oncoming_lift_decel: np.float32 = _constant_field("model.oncoming.lift_decel")
    oncoming_brake_time: np.float32 = _constant_field("model.oncoming.brake_time")
    oncoming_min_decel: np.float32 = _constant_field("model.oncoming.min_decel")
    oncoming_max_decel: np.float32 = _constant_field("model.oncoming.max_decel")
    edge_shift: np.float32 = _constant_field("model.oncoming.edge_shift")
    edge_shift_duration: np.float32 = _constant_field("model.oncoming.edge_shift_duration")
    passed_awareness_margin: np.float32 = _constant_field("model.oncoming.passed_awareness_margin")
    gravity: np.float32 = _constant_field("model.nature.gravity")
    half_air_density: np.float32 = field(
        default_factory=lambda: HALF * constant("model.nature.air_density")
    )
    friction_new: tuple[tuple[np.float32, ...], ...] = _table_field("friction.table.new")
    friction_worn: tuple[tuple[np.float32, ...], ...] = _table_field("friction.table.worn")
    friction_speeds: tuple[np.float32, ...] = _table_field("friction.table.speeds")
    friction_films: tuple[np.float32, ...] = _table_field("friction.table.films_mm")

    def replace(self, **changes: float) -> "ModelConstants":
        """Copy the constants with some single numbers changed.

        Args:
            changes: New values by name, not for tables; they are rounded to float32.

        Raises:
            TypeError: A name is not a constant.
        """
        numbers: dict[str, Any] = {name: np.float32(value) for name, value in changes.items()}
        return dataclasses.replace(self, **numbers)


# `entry.type` is a type only because this module does not import `annotations` from `__future__`.
CONSTANT_NAMES = tuple(
    entry.name for entry in dataclasses.fields(ModelConstants) if entry.type is np.float32
)
"""Names of the constants that are single numbers, in the order in which the engine takes them."""


@cache
def model_constants() -> ModelConstants:
    """The constants as the knowledge files state them, no effect disabled; one shared instance."""
    return ModelConstants()


@dataclass(frozen=True, slots=True, kw_only=True)
class EnabledEffects:
    """Switches of physical and perceptual effects; True keeps the effect in the model.

    Attributes:
        film: The film of water and the puddles on the road.
        gusts: Turbulence, and the single gusts of bridges and cuttings; the mean wind remains.
        wake: The shelter from side wind beside high-sided vehicles.
        range: Limits of sight by fog, rain, darkness and distance.
        delay: Reaction times, and the time until a driver notices a vehicle in view.
        distance_error: Errors of judged distances and closing speeds.
        looming: The threshold below which drivers do not notice an approach.
        occlusion: Vehicles that hide others.
        mobil: Lane changes of all vehicles but the ego (lane-change model MOBIL) and their
            overtaking.
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
    """Constants with neutral values where they express a disabled effect.

    Constants express `wake` and `looming`, and parts of `gusts`, `range` and `delay`. Parameters of
    vehicles and simulations express the other parts and effects. Their neutral values are set in
    `world.weather_parameters`, `world.vehicle_parameters` and `world.driver_parameters`.

    Args:
        constants: Constants of the model.
        effects: The effects that are enabled.

    Returns:
        New constants; the argument itself if no constant changes.
    """
    changes: dict[str, float] = {}
    if not effects.gusts:
        changes["turbulence_intensity"] = 0.0
    if not effects.wake:
        changes["shelter_factor"] = 1.0  # All of the cross wind remains.
    if not effects.looming:
        changes["looming_threshold"] = 0.0
    if not effects.delay:
        changes["detection_growth"] = 0.0
    if not effects.range:
        changes |= {"sight_range": _UNLIMITED, "mirror_range": _UNLIMITED}
    return constants.replace(**changes) if changes else constants


def engine_constants(constants: ModelConstants) -> dict[str, Any]:
    """Constants in the form that the compiled engine takes.

    Args:
        constants: Constants of the model.

    Returns:
        `values`, the single numbers in the order of `CONSTANT_NAMES`; `friction_new`,
        `friction_worn`, `friction_speeds` and `friction_films`, the tables as lists.
    """
    return {
        "values": [float(getattr(constants, name)) for name in CONSTANT_NAMES],
        "friction_new": [[float(friction) for friction in row] for row in constants.friction_new],
        "friction_worn": [[float(friction) for friction in row] for row in constants.friction_worn],
        "friction_speeds": [float(speed) for speed in constants.friction_speeds],
        "friction_films": [float(film) for film in constants.friction_films],
    }
