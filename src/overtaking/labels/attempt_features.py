"""The state of the ego and its surroundings when an overtake begins, or could have begun.

The features are measured in the frame of the attempt. In a simulation without an attempt, they are
measured in a frame that `paper_features` draws, the pseudo attempt. Each number comes from that
frame or from a decision before it: a model of the decision must not see its consequences.

Left is the overtaking side, also in left-hand traffic. `sight_lit` and `sight_unlit` are distances
at which the driver sees a lit and an unlit vehicle. `model.overtake_features` states meaning and
unit of each feature. Where it declares a value undefined, such as the kind of a missing leader, the
value is arbitrary.
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
    Instants,
    VehicleInstants,
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
"""Lower limit of the speed in power over speed, to avoid a division by 0 [m/s].

It changes no result for the vehicle classes of this package: at 0.1 m/s even a cyclist's 2.5 W/kg
give 25 m/s^2, and the acceleration from standstill, 1 to 7 m/s^2, is the smaller limit.
"""

_PERCENT = np.float32(0.01)


def attempt_features(case: Case) -> AttemptFeatures:
    """The features of a batch, at the attempt or pseudo attempt of each simulation."""
    return attempt_features_at(case, matched_frame(case))


def attempt_features_at(case: Case, frame: I32) -> AttemptFeatures:
    """The features of a batch at one frame of each simulation, independent of later frames.

    Args:
        case: The batch. Of its events, the features read only `following_begin` and
            `began_before_recording`.
        frame: A recorded frame of each simulation, shape (simulation,).
    """
    instants = Instants(np.arange(len(frame)), frame.astype(np.intp))
    surroundings, left = _surroundings(case, instants), _left_lane_features(case, instants)
    ego = _ego_state(case, instants)
    # By Portuguese law. The two bounds differ only where inputs are unknown. The margin of the
    # speed is null then, so either bound would do.
    _, highest_limit = speed_limit_bounds(case, GENERAL_LIMITS)
    leader = neighbour_at(case, NeighbourRole.LEADER, instants.frame)
    decel = decel_for_safe_distance(surroundings.friction)
    margins = stop_margins(
        ego.speed, surroundings.friction, surroundings.sight_lit, surroundings.sight_unlit
    )
    return AttemptFeatures(
        frame=frame,
        ego=ego,
        leader=_leader_features(case, instants, ego),
        left=left,
        oncoming=_opposing_lane_features(case, frame),
        surroundings=surroundings,
        law=LawMarginsOnPullOut(
            leader=margin_to_leader(*_gap_state(leader, ego), decel),
            left_leader=entry_margin_ahead(*_gap_state(left.leader, ego), decel),
            left_follower=entry_margin_behind(*_gap_state(left.follower, ego), decel),
            speed=at_frame(highest_limit, frame) - ego.speed,
            stop_lit=margins["stop_margin_lit"],
            stop_unlit=margins["stop_margin_unlit"],
        ),
        beliefs=_beliefs(case, frame),
    )


def available_accel(case: Case, speed: F32) -> F32:
    """Largest acceleration of each ego on a level road without wind, (simulation,) [m/s^2].

    It is min(a_0, P / (m v)) - rho c A v^2 / (2 m) - c_r g, with the acceleration from standstill
    a_0, power P, mass m, speed v, air density rho, drag area c A and rolling resistance c_r. Above
    the top speed it is negative.

    Args:
        case: The batch.
        speed: Speed of each ego, shape (simulation,) [m/s].
    """
    vehicles = case.trajectories.scenario.vehicles
    ego = {
        name: getattr(vehicles, name)[:, EGO_SLOT]
        for name in ("mass", "power", "launch_accel", "drag_area", "rolling_resistance")
    }
    engine_accel = ego["power"] / (ego["mass"] * np.maximum(speed, _MIN_SPEED_OF_POWER))
    dynamic_pressure = np.float32(0.5) * constant("model.nature.air_density") * speed * speed
    drag = dynamic_pressure * ego["drag_area"] / ego["mass"]
    rolling = ego["rolling_resistance"] * constant("model.nature.gravity")
    return np.minimum(engine_accel, ego["launch_accel"]) - drag - rolling


def _gap_state(encounter: Encounter, ego: EgoState) -> tuple[F32, F32, F32]:
    """Gap [m], speed of the ego and closing speed [m/s]: the first arguments of a `GapMargin`."""
    return encounter.gap, ego.speed, encounter.closing_speed


def _ego_state(case: Case, instants: Instants) -> EgoState:
    """State of the ego at one frame of each simulation."""
    scenario, signals = case.trajectories.scenario, case.signals
    speed = signals.speed[instants]
    waiting_frames = np.maximum(instants.frame - case.events.following_begin, 0).astype(np.int32)
    return EgoState(
        kind=scenario.vehicles.kind[:, EGO_SLOT],
        speed=speed,
        accel=signals.accel[instants],
        available_accel=available_accel(case, speed),
        desired_speed=scenario.drivers.desired_speed[:, EGO_SLOT],
        waiting_time=nan_if_begun_before_recording(case, seconds_of(case, waiting_frames)),
        lateral_offset=signals.lateral_position[instants] - _lane_centre(case, instants),
    )


def _leader_features(case: Case, instants: Instants, ego: EgoState) -> LeaderState:
    """State of the leader in the ego's lane at one frame of each simulation."""
    trajectories, bodies = case.trajectories, case.trajectories.scenario.vehicles
    rows, frame = instants
    leader = neighbour_at(case, NeighbourRole.LEADER, frame)
    slot = slot_or_ego(case.signals.neighbour_slot[rows, NeighbourRole.LEADER, frame])
    leader_instants = VehicleInstants(rows, slot, frame)
    length = bodies.length[rows, slot]
    has_next, return_gap = _next_ahead(case, slot, frame)
    time, distance = _min_overtaking_time_and_distance(case, leader, ego, length, frame)
    lateral_position = (
        overtaking_sign(trajectories.road)
        * as_f32(trajectories.states.d[leader_instants])
        * METRES_PER_MM
    )
    return LeaderState(
        encounter=leader,
        kind=bodies.kind[rows, slot],
        length=length,
        speed=ego.speed - leader.closing_speed,
        accel=as_f32(trajectories.states.accel_lon[leader_instants]) * METRES_PER_MM,
        lateral_offset=lateral_position - _lane_centre(case, instants),
        indicator=trajectories.states.lights[leader_instants] & _INDICATOR_BITS,
        looming=looming(leader.gap, leader.closing_speed, bodies.width[rows, slot]),
        has_next_leader=has_next & leader.valid,
        return_gap=return_gap,
        overtaking_time=time,
        overtaking_distance=distance,
    )


def _min_overtaking_time_and_distance(
    case: Case, leader: Encounter, ego: EgoState, leader_length: F32, frame: IndexArray
) -> tuple[F32, F32]:
    """Lower bounds of the time [s] and the distance [m] until the ego has overtaken its leader.

    The overtake ends when the ego is ahead by the lawful gap for equal speeds, the distance that
    the leader covers in its reaction time. The leader is assumed to keep its speed, and the ego its
    available acceleration. These are lower bounds, because less acceleration is available at higher
    speed. The time is infinite, and the distance 0, if the ego never gets ahead.
    """
    lengths = leader_length + case.trajectories.scenario.vehicles.length[:, EGO_SLOT]
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))
    gap_behind = lawful_gap(ego.speed - leader.closing_speed, np.float32(0.0), decel)
    distance_to_gain = np.maximum(leader.gap, np.float32(0.0)) + lengths + gap_behind
    # MTTC solves the same equation: the time in which a follower gains a distance on its leader.
    time = mttc(distance_to_gain, leader.closing_speed, ego.available_accel)
    finite_time = np.where(np.isfinite(time), time, np.float32(0.0))
    mean_speed = ego.speed + np.float32(0.5) * ego.available_accel * finite_time
    return time, finite_time * mean_speed


def _lane_centre(case: Case, instants: Instants) -> F32:
    """Lateral position of the centre of the ego's lane, growing to the left, (instant,) [m]."""
    road = case.trajectories.road
    centres = as_f32(road.lane_centres * float(overtaking_sign(road)))
    # Off the road any lane will do: `on_road` is false there, and the columns are null.
    return centres[np.minimum(case.signals.lane[instants], road.num_lanes - 1)]


def _beliefs(case: Case, frame: I32) -> BeliefsAtPullOut:
    """Beliefs at the last decision to pull out in or before one frame of each simulation."""
    percepts = case.trajectories.percepts
    time = frame * np.int32(case.signals.frame_interval_ms)  # [ms]
    is_earlier = percepts.time <= time[:, None]
    is_pull_out = percepts.valid & (percepts.kind == ManoeuvreKind.PULL_OUT) & is_earlier
    num_simulations, num_percepts = is_pull_out.shape
    if "percepts" in case.trajectories.unknown or not num_percepts:
        return _no_beliefs(len(frame))
    # Percepts are in the order of time. Without a decision to pull out, `last` is the last percept,
    # and `exists` is false.
    last = num_percepts - 1 - is_pull_out[:, ::-1].argmax(axis=1)
    index = (np.arange(num_simulations), last)
    exists = is_pull_out[index]
    return BeliefsAtPullOut(
        exists=exists,
        age=as_f32(time - percepts.time[index]) / np.float32(1000.0),
        is_detected=percepts.is_detected[index] & exists[:, None],
        gap=as_f32(percepts.gap[index]) * METRES_PER_MM,
        closing_speed=as_f32(percepts.closing_speed[index]) * METRES_PER_MM,
    )


def _no_beliefs(num_simulations: int) -> BeliefsAtPullOut:
    """Beliefs of simulations without a decision to pull out."""
    zeros = np.zeros(num_simulations, np.float32)
    zeros_by_vehicle = np.zeros((num_simulations, len(PerceivedVehicle)), np.float32)
    return BeliefsAtPullOut(
        exists=zeros > 0,
        age=zeros,
        is_detected=zeros_by_vehicle > 0,
        gap=zeros_by_vehicle,
        closing_speed=zeros_by_vehicle,
    )


def _surroundings(case: Case, instants: Instants) -> RoadAndWeather:
    """Road, weather and light at one frame of each simulation."""
    trajectories, signals = case.trajectories, case.signals
    road, weather = trajectories.road, trajectories.scenario.weather
    rows, frame = instants
    lane, s = signals.lane[instants], trajectories.states.s[rows, EGO_SLOT, frame]
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
        # Of fog alone; `sight_lit` and `sight_unlit` contain the rain too.
        optical_range=meteorological_range(weather.fog),
        wind=constant("weather.wind.full_speed") * (weather.wind * _PERCENT),
        friction=signals.friction[instants],
        sight_lit=signals.sight_lit[instants],
        sight_unlit=signals.sight_unlit[instants],
    )


def _left_lane_features(case: Case, instants: Instants) -> LeftLane:
    """The lane to the left of the ego at one frame of each simulation."""
    trajectories, (rows, frame) = case.trajectories, instants
    lane = case.signals.lane[instants].astype(np.int32)
    is_on_left = is_in_lane(trajectories, lane + 1, frame)
    is_on_left &= _is_within_occupancy_reach(case, frame)
    speed = as_f32(trajectories.states.speed[rows, :, frame]) * METRES_PER_MM
    count, speed_sum = is_on_left.sum(axis=1), _sum_over_vehicles(speed, is_on_left)
    return LeftLane(
        exists=lane + 1 < trajectories.road.num_lanes,
        leader=neighbour_at(case, NeighbourRole.LEFT_LEADER, frame),
        follower=neighbour_at(case, NeighbourRole.LEFT_FOLLOWER, frame),
        occupancy=left_lane_occupancy(trajectories, frame).occupancy,
        count=count.astype(np.uint8),
        space_mean_speed=speed_sum / as_f32(np.maximum(count, 1)),
        # Fast vehicles pass a place more often, so each speed is weighted by itself (Wardrop 1952).
        time_mean_speed=_sum_over_vehicles(speed * speed, is_on_left)
        / np.where(speed_sum > 0, speed_sum, np.float32(1.0)),
        crossable=_is_crossable_by_lane(case)[np.minimum(lane, trajectories.road.num_lanes)],
    )


def _opposing_lane_features(case: Case, frame: I32) -> OncomingState:
    """The opposing lane at one frame of each simulation; all false and 0 on one-way roads."""
    road, num_simulations = case.trajectories.road, len(frame)
    if not road.is_two_way:
        zeros = np.zeros(num_simulations, np.float32)
        all_false = np.zeros(num_simulations, np.bool_)
        return OncomingState(
            exists=all_false,
            has_oncoming=all_false,
            kind=np.zeros(num_simulations, np.uint8),
            gap=zeros,
            closing_speed=zeros,
            time=zeros,
            sight=zeros,
            crossable=all_false,
        )
    gap, closing_speed, slot = nearest_oncoming_at(case, frame)
    return OncomingState(
        exists=np.ones(num_simulations, np.bool_),
        has_oncoming=np.isfinite(gap),
        kind=case.trajectories.scenario.vehicles.kind[np.arange(num_simulations), slot],
        gap=gap,
        closing_speed=closing_speed,
        time=np.maximum(gap, ZERO) / closing_speed,
        sight=available_sight(case, frame),
        # This line separates the directions of travel.
        crossable=~is_solid_at(road, at_frame(case.signals.s, frame)),
    )


def _next_ahead(case: Case, slot: IndexArray, frames: IndexArray) -> tuple[Mask, F32]:
    """The gap from a vehicle to the nearest vehicle ahead of it in the ego's lane.

    Args:
        case: The batch.
        slot: Slot of the vehicle, shape (simulation,).
        frames: A frame of each simulation, same shape.

    Returns:
        Whether there is a vehicle ahead, and the gap between the bumpers, 0 without a vehicle
        ahead, same shape [m].
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
    """Whether each centre is within `OCCUPANCY_REACH_MM` of the ego's, (simulation, vehicle)."""
    s = case.trajectories.states.s[np.arange(len(frames)), :, frames]
    return np.abs(s - s[:, [EGO_SLOT]]) <= OCCUPANCY_REACH_MM


def _sum_over_vehicles(values: F32, is_counted: Mask) -> F32:
    """Sum over the vehicles of a mask, shape (simulation,).

    The order of the additions is fixed: NumPy's own sum may add in an order that depends on the
    processor, and then rounds differently.
    """
    total = np.zeros(len(values), np.float32)
    for slot in range(values.shape[1]):
        total = total + np.where(is_counted[:, slot], values[:, slot], ZERO)
    return total


def _is_crossable_by_lane(case: Case) -> Mask:
    """Whether the line to the left of each lane may be crossed to the left, shape (num_lanes + 1,).

    The last entry, false, is for an ego outside the lanes.
    """
    road = case.trajectories.road
    # Border i is to the right of lane i. The first flag of a pair is for crossing to the left.
    solid_flags = solid_borders(road)
    lanes = [not solid_flags.get(lane + 1, (False, False))[0] for lane in range(road.num_lanes)]
    return np.array([*lanes, False], np.bool_)
