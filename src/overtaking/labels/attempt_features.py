"""The state when an overtake begins, or might have begun, without what follows.

The instant is `t_a`, or the one of `matched` that stands for it where nothing was attempted. Each
number comes from the frame of that instant, or from a decision before it.
"""

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray, Mask
from overtaking.core.float32_math import ZERO, as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.event_detection import nan_if_begun_before_recording
from overtaking.labels.law.case import (
    available_sight,
    nearest_oncoming_at,
    neighbour_at,
    seconds_of,
    speed_limit_bounds,
)
from overtaking.labels.law.criteria.lines_and_lanes import is_solid_at, solid_borders
from overtaking.labels.law.portugal import GENERAL_LIMITS
from overtaking.labels.law.safe_distance import (
    decel_for_safe_distance,
    entry_margin_ahead,
    entry_margin_behind,
    lawful_gap,
    margin_to_leader,
    stop_margins,
)
from overtaking.labels.paper_features import matched_frame
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    OCCUPANCY_REACH_MM,
    at_frame,
    is_in_lane,
    left_lane_occupancy,
    overtaking_sign,
    slot_or_ego,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_features import (
    AttemptFeatures,
    BeliefsAtPullOut,
    EgoState,
    LawMarginsOnPullOut,
    LeaderState,
    LeftLane,
    OncomingState,
    RoadAndWeather,
)
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import (
    POSITION_RESOLUTION,
    Lights,
    ManoeuvreKind,
    PerceivedVehicle,
)
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case
from overtaking.world.surrogate_safety import looming, mttc
from overtaking.world.visibility import meteorological_range
from overtaking.world.weather_parameters import weather_effects

_INDICATOR_BITS = np.uint8(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)

_MIN_SPEED_OF_POWER = np.float32(0.1)
"""Below this a power would mean an endless force [m/s]."""

_PERCENT = np.float32(0.01)


def attempt_features(case: Case) -> AttemptFeatures:
    """The features of a batch at each attempt, or at the instant that stands for it."""
    return attempt_features_at(case, matched_frame(case))


def attempt_features_at(case: Case, frame: I32) -> AttemptFeatures:
    """The features of a batch at one frame each, whatever happens later.

    Args:
        case: The batch; of its events only `following_begin` and `began_before_recording`
            are used.
        frame: A recorded frame of each simulation, shape (simulation,).
    """
    rows, frames = np.arange(len(frame)), frame.astype(np.intp)
    surroundings, left = _surroundings(case, frames), _left_lane_features(case, frames)
    ego = _ego_state(case, rows, frames)
    leader = _leader_features(case, rows, frames, ego)
    limit = at_frame(speed_limit_bounds(case, GENERAL_LIMITS)[1], frame)
    decel = decel_for_safe_distance(surroundings.friction)
    margins = stop_margins(
        ego.speed, surroundings.friction, surroundings.sight_lit, surroundings.sight_unlit
    )
    return AttemptFeatures(
        frame=frame,
        ego=ego,
        leader=leader,
        left=left,
        oncoming=_opposing_lane_features(case, frame),
        surroundings=surroundings,
        law=LawMarginsOnPullOut(
            leader=margin_to_leader(*_gap_state(leader.encounter, ego), decel),
            left_leader=entry_margin_ahead(*_gap_state(left.leader, ego), decel),
            left_follower=entry_margin_behind(*_gap_state(left.follower, ego), decel),
            speed=limit - ego.speed,
            stop_lit=margins["stop_margin_lit"],
            stop_unlit=margins["stop_margin_unlit"],
        ),
        beliefs=_beliefs(case, frame),
    )


def available_accel(case: Case, speed: F32) -> F32:
    """Largest acceleration of each ego on a level road without wind [m/s^2].

    min(launch, P / (m v)) - rho c A v^2 / (2 m) - c_r g; negative above the top speed.

    Args:
        case: The batch.
        speed: Of each ego, shape (simulation,) [m/s].
    """
    bodies = case.trajectories.scenario.vehicles
    ego = {
        name: getattr(bodies, name)[:, EGO_SLOT]
        for name in ("mass", "power", "launch_accel", "drag_area", "rolling_resistance")
    }
    engine = ego["power"] / (ego["mass"] * np.maximum(speed, _MIN_SPEED_OF_POWER))
    pressure = np.float32(0.5) * constant("model.nature.air_density") * speed * speed
    drag = pressure * ego["drag_area"] / ego["mass"]
    rolling = ego["rolling_resistance"] * constant("model.nature.gravity")
    return np.minimum(engine, ego["launch_accel"]) - drag - rolling


def _gap_state(encounter: Encounter, ego: EgoState) -> tuple[F32, F32, F32]:
    """Gap, speed of the ego and closing speed, as the margins of the law take them."""
    return encounter.gap, ego.speed, encounter.closing_speed


def _ego_state(case: Case, rows: IndexArray, frames: IndexArray) -> EgoState:
    scenario, signals = case.trajectories.scenario, case.signals
    speed = signals.speed[rows, frames]
    waited = np.maximum(frames - case.events.following_begin, 0).astype(np.int32)
    return EgoState(
        kind=scenario.vehicles.kind[:, EGO_SLOT],
        speed=speed,
        accel=signals.accel[rows, frames],
        available_accel=available_accel(case, speed),
        desired_speed=scenario.drivers.desired_speed[:, EGO_SLOT],
        waiting_time=nan_if_begun_before_recording(case, seconds_of(case, waited)),
        lateral_offset=signals.lateral_position[rows, frames] - _lane_centre(case, rows, frames),
    )


def _leader_features(
    case: Case, rows: IndexArray, frames: IndexArray, ego: EgoState
) -> LeaderState:
    trajectories, bodies = case.trajectories, case.trajectories.scenario.vehicles
    leader = neighbour_at(case, NeighbourRole.LEADER, frames)
    slot = slot_or_ego(case.signals.neighbour_slot[rows, NeighbourRole.LEADER, frames])
    length, speed = bodies.length[rows, slot], ego.speed - leader.closing_speed
    has_next, return_gap = _next_ahead(case, slot, frames)
    time, distance = _min_overtaking_time_and_distance(case, leader, ego, length, frames)
    lateral_position = (
        overtaking_sign(trajectories.road)
        * as_f32(trajectories.states.d[rows, slot, frames])
        * METRES_PER_MM
    )
    return LeaderState(
        encounter=leader,
        kind=bodies.kind[rows, slot],
        length=length,
        speed=speed,
        accel=as_f32(trajectories.states.accel_lon[rows, slot, frames]) * METRES_PER_MM,
        lateral_offset=lateral_position - _lane_centre(case, rows, frames),
        indicator=trajectories.states.lights[rows, slot, frames] & _INDICATOR_BITS,
        looming=looming(leader.gap, leader.closing_speed, bodies.width[rows, slot]),
        has_next_leader=has_next & leader.valid,
        return_gap=return_gap,
        overtaking_time=time,
        overtaking_distance=distance,
    )


def _min_overtaking_time_and_distance(
    case: Case, encounter: Encounter, ego: EgoState, length: F32, frames: IndexArray
) -> tuple[F32, F32]:
    """Least time and way to be ahead of the vehicle ahead [s], [m].

    Ahead is where its reaction distance lies between the bumpers. It goes on at its speed, and the
    ego accelerates evenly by what it has now: less is left at higher speed, so this is a bound.
    """
    lengths = length + case.trajectories.scenario.vehicles.length[:, EGO_SLOT]
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frames))
    clear = lawful_gap(ego.speed - encounter.closing_speed, np.float32(0.0), decel)
    distance = np.maximum(encounter.gap, np.float32(0.0)) + lengths + clear
    time = mttc(distance, encounter.closing_speed, ego.available_accel)
    finite = np.where(np.isfinite(time), time, np.float32(0.0))
    return time, finite * (ego.speed + np.float32(0.5) * ego.available_accel * finite)


def _lane_centre(case: Case, rows: IndexArray, frames: IndexArray) -> F32:
    """Centre of the ego's lane across the road, growing to the left [m]."""
    road = case.trajectories.road
    centres = as_f32(road.lane_centres * float(overtaking_sign(road)))
    return centres[np.minimum(case.signals.lane[rows, frames], road.num_lanes - 1)]


def _beliefs(case: Case, frame: I32) -> BeliefsAtPullOut:
    """Beliefs at the last decision to pull out up to a frame of each simulation."""
    percepts, interval = case.trajectories.percepts, case.signals.frame_interval_ms
    count, now = len(frame), frame * np.int32(interval)
    fits = percepts.valid & (percepts.kind == ManoeuvreKind.PULL_OUT)
    fits &= percepts.time <= now[:, None]
    if "percepts" in case.trajectories.unknown or not fits.shape[1]:
        return _no_belief(count)
    row = fits.shape[1] - 1 - fits[:, ::-1].argmax(axis=1)
    entry = (np.arange(count), row)
    exists = fits[entry]
    return BeliefsAtPullOut(
        exists=exists,
        age=as_f32(now - percepts.time[entry]) / np.float32(1000.0),
        is_detected=percepts.is_detected[entry] & exists[:, None],
        gap=as_f32(percepts.gap[entry]) * METRES_PER_MM,
        closing_speed=as_f32(percepts.closing_speed[entry]) * METRES_PER_MM,
    )


def _no_belief(count: int) -> BeliefsAtPullOut:
    """Nothing believed in any simulation."""
    zero, wide = np.zeros(count, np.float32), np.zeros((count, len(PerceivedVehicle)), np.float32)
    return BeliefsAtPullOut(
        exists=zero > 0, age=zero, is_detected=wide > 0, gap=wide, closing_speed=wide
    )


def _surroundings(case: Case, frames: IndexArray) -> RoadAndWeather:
    """Road, weather and light of each simulation at one frame each."""
    trajectories, signals = case.trajectories, case.signals
    road, weather = trajectories.road, trajectories.scenario.weather
    rows = np.arange(len(frames))
    lane, s = signals.lane[rows, frames], trajectories.states.s[rows, EGO_SLOT, frames]
    on_road = lane < road.num_lanes
    widths = np.array([lane_of_road.width for lane_of_road in road.lanes])
    return RoadAndWeather(
        on_road=on_road,
        lane=lane,
        lanes_to_left=np.where(on_road, road.num_lanes - 1 - np.int32(lane), 0).astype(np.uint8),
        lane_width=widths[np.minimum(lane, road.num_lanes - 1)],
        speed_limit=road.speed_limit_at(s * POSITION_RESOLUTION),
        night=weather.night,
        low_sun=weather.low_sun,
        rain=weather_effects(trajectories.scenario).rain_rate,
        optical_range=meteorological_range(weather.fog),
        wind=constant("weather.wind.full_speed") * (weather.wind * _PERCENT),
        friction=signals.friction[rows, frames],
        sight_lit=signals.sight_lit[rows, frames],
        sight_unlit=signals.sight_unlit[rows, frames],
    )


def _left_lane_features(case: Case, frames: IndexArray) -> LeftLane:
    """The lane to the left of each ego at one frame each."""
    trajectories, signals = case.trajectories, case.signals
    rows = np.arange(len(frames))
    lane = signals.lane[rows, frames].astype(np.int32)
    inside = is_in_lane(case.trajectories, lane + 1, frames) & _is_within_occupancy_reach(
        case, frames
    )
    speed = as_f32(trajectories.states.speed[rows, :, frames]) * METRES_PER_MM
    count, total = inside.sum(axis=1), _sum_over_vehicles(speed, inside)
    return LeftLane(
        exists=lane + 1 < trajectories.road.num_lanes,
        leader=neighbour_at(case, NeighbourRole.LEFT_LEADER, frames),
        follower=neighbour_at(case, NeighbourRole.LEFT_FOLLOWER, frames),
        occupancy=left_lane_occupancy(trajectories, frames).occupancy,
        count=count.astype(np.uint8),
        space_mean_speed=total / as_f32(np.maximum(count, 1)),
        # Fast vehicles pass a place more often: Wardrop (1952), sum of squares over sum.
        time_mean_speed=_sum_over_vehicles(speed * speed, inside)
        / np.where(total > 0, total, np.float32(1.0)),
        crossable=_is_crossable_by_lane(case)[np.minimum(lane, trajectories.road.num_lanes)],
    )


def _opposing_lane_features(case: Case, frame: I32) -> OncomingState:
    """The side of oncoming traffic of each simulation at one frame each."""
    road, count = case.trajectories.road, len(frame)
    zero, false = np.zeros(count, np.float32), np.zeros(count, np.bool_)
    if not road.is_two_way:
        return OncomingState(
            exists=false,
            has_oncoming=false,
            kind=np.zeros(count, np.uint8),
            gap=zero,
            closing_speed=zero,
            time=zero,
            sight=zero,
            crossable=false,
        )
    gap, closing_speed, slot = nearest_oncoming_at(case, frame)
    return OncomingState(
        exists=~false,
        has_oncoming=np.isfinite(gap),
        kind=case.trajectories.scenario.vehicles.kind[np.arange(count), slot],
        gap=gap,
        closing_speed=closing_speed,
        time=np.maximum(gap, ZERO) / closing_speed,
        sight=available_sight(case, frame),
        crossable=~is_solid_at(road, at_frame(case.signals.s, frame)),
    )


def _next_ahead(case: Case, slot: IndexArray, frames: IndexArray) -> tuple[Mask, F32]:
    """The gap ahead of a vehicle to the next one in the ego's lane.

    Args:
        case: The batch.
        slot: The vehicle, shape (simulation,).
        frames: A frame of each simulation, same shape.

    Returns:
        Whether there is a next one, and the gap between their bumpers, same shape [m].
    """
    trajectories, rows = case.trajectories, np.arange(len(frames))
    s = trajectories.states.s[rows, :, frames]
    distance = as_f32(s - s[rows, slot][:, None]) * METRES_PER_MM
    half_length = np.float32(0.5) * trajectories.scenario.vehicles.length
    gap = distance - half_length - half_length[rows, slot][:, None]
    lane = case.signals.lane[rows, frames].astype(np.int32)
    is_ahead = is_in_lane(case.trajectories, lane, frames) & (distance > 0)
    gap = np.where(is_ahead, gap, np.float32(np.inf)).min(axis=1)
    has_next = np.asarray(is_ahead.any(axis=1))
    return has_next, np.where(has_next, gap, ZERO)


def _is_within_occupancy_reach(case: Case, frames: IndexArray) -> Mask:
    """Which centres are within the reach of the occupancy, shape (simulation, vehicle)."""
    s = case.trajectories.states.s[np.arange(len(frames)), :, frames]
    return np.abs(s - s[:, [EGO_SLOT]]) <= OCCUPANCY_REACH_MM


def _sum_over_vehicles(values: F32, counted: Mask) -> F32:
    """Sum over the vehicles that count, one after the other, shape (simulation,)."""
    total = np.zeros(len(values), np.float32)
    for j in range(values.shape[1]):
        total = total + np.where(counted[:, j], values[:, j], ZERO)
    return total


def _is_crossable_by_lane(case: Case) -> Mask:
    """Whether the line to the left may be crossed, for each lane and for beyond the fast edge."""
    road = case.trajectories.road
    closed = solid_borders(road)
    lanes = [not closed.get(lane + 1, (False, False))[0] for lane in range(road.num_lanes)]
    return np.array([*lanes, False], np.bool_)
