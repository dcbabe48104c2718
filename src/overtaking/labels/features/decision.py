"""What there is to know when an overtake begins, or might have begun; nothing of what comes after.

The instant is `t_a`, or the one of `matched` that stands for it where nothing was attempted. Each
number comes from one frame, that of the instant, or from a decision before it.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.features.common import unless_under_way
from overtaking.labels.features.decision_lanes import lane_around, left_lane, next_ahead
from overtaking.labels.features.encounters import Index, Side
from overtaking.labels.features.engine import encounter
from overtaking.labels.features.margins import stop_margins
from overtaking.labels.features.matched import moment
from overtaking.labels.law.distances import (
    lawful_gap,
    margin_ahead,
    margin_behind,
    margin_of_gap,
    sure_decel,
)
from overtaking.labels.law.limits import speed_limits
from overtaking.labels.signals.frames import at, seconds_of
from overtaking.labels.signals.reference import METRES, side_of
from overtaking.model.decisions import Believed, Decisions, LawAhead, OwnState, VehicleAhead
from overtaking.model.labels import Case
from overtaking.model.safety import Encounter
from overtaking.model.signals import Around
from overtaking.model.trajectory import DecisionKind, Lights
from overtaking.model.vehicles import Role
from overtaking.world.constants import known
from overtaking.world.measures import looming, ttc_accel

I32 = NDArray[np.int32]

_INDICATORS = np.uint8(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
_PERCEIVED = 3
_LEAST_SPEED = np.float32(0.1)
"""Below this a power would mean an endless force [m/s]."""


def decision_features(case: Case) -> Decisions:
    """The features of a batch at each attempt, or at the instant that stands for it."""
    return features_at(case, moment(case))


def features_at(case: Case, frame: I32) -> Decisions:
    """The features of a batch at one frame each, whatever happens later.

    Args:
        case: The batch; of its events only `follow` and `under_way` are used.
        frame: A recorded frame of each simulation, shape (simulation,).
    """
    rows, frames = np.arange(len(frame)), frame.astype(np.intp)
    around, left = lane_around(case, frames), left_lane(case, frames)
    ego = _ego(case, rows, frames)
    ahead = _ahead(case, rows, frames, ego)
    limit = speed_limits(case)[1]
    decel = sure_decel(around.friction)
    margins = stop_margins(ego.speed, around.friction, around.sight_lit, around.sight_unlit)
    return Decisions(
        frame=frame,
        ego=ego,
        ahead=ahead,
        left=left,
        around=around,
        law=LawAhead(
            follow=margin_of_gap(*_pair(ahead.encounter, ego), decel),
            entry_front=margin_ahead(*_pair(left.front, ego), decel),
            entry_rear=margin_behind(*_pair(left.rear, ego), decel),
            speed=limit - ego.speed,
            stop_lit=margins["stop_margin_lit"],
            stop_unlit=margins["stop_margin_unlit"],
        ),
        believed=_believed(case, frame),
    )


def available_accel(case: Case, speed: F32) -> F32:
    """Largest acceleration of each ego on a level road without wind [m/s^2].

    min(launch, P / (m v)) - rho c A v^2 / (2 m) - c_r g; negative above the top speed.

    Args:
        case: The batch.
        speed: Of each ego, shape (simulation,) [m/s].
    """
    bodies = case.trajectories.scenario.vehicles
    own = {
        name: getattr(bodies, name)[:, Role.EGO]
        for name in ("mass", "power", "launch_accel", "drag_area", "rolling_resistance")
    }
    engine = own["power"] / (own["mass"] * np.maximum(speed, _LEAST_SPEED))
    pressure = np.float32(0.5) * known("model.nature.air_density") * speed * speed
    drag = pressure * own["drag_area"] / own["mass"]
    rolling = own["rolling_resistance"] * known("model.nature.gravity")
    return np.minimum(engine, own["launch_accel"]) - drag - rolling


def _pair(one: Encounter, ego: OwnState) -> tuple[F32, F32, F32]:
    """Gap, speed of the ego and closing speed, as the margins of the law take them."""
    return one.gap, ego.speed, one.closing_speed


def _ego(case: Case, rows: Index, frames: Index) -> OwnState:
    scenario, seen = case.trajectories.scenario, case.signals
    speed = seen.speed[rows, frames]
    waited = np.maximum(frames - case.events.follow, 0).astype(np.int32)
    return OwnState(
        kind=scenario.vehicles.kind[:, Role.EGO],
        speed=speed,
        accel=seen.accel[rows, frames],
        available_accel=available_accel(case, speed),
        desired_speed=scenario.drivers.desired_speed[:, Role.EGO],
        waiting_time=unless_under_way(case, seconds_of(case, waited)),
        lateral_offset=seen.lateral[rows, frames] - _lane_centre(case, rows, frames),
    )


def _ahead(case: Case, rows: Index, frames: Index, ego: OwnState) -> VehicleAhead:
    run, bodies = case.trajectories, case.trajectories.scenario.vehicles
    one = encounter(case, Around.LEADER, Side.AHEAD, rows, frames)
    slot = np.where(one.valid, case.signals.vehicle[rows, Around.LEADER, frames], Role.EGO)
    slot = slot.astype(np.intp)
    length, speed = bodies.length[rows, slot], ego.speed - one.closing_speed
    has_next, return_gap = next_ahead(case, slot, frames)
    time, distance = _overtaking(case, one, ego, length, frames)
    across = side_of(run.road) * as_f32(run.states.d[rows, slot, frames]) * METRES
    return VehicleAhead(
        encounter=one,
        kind=bodies.kind[rows, slot],
        length=length,
        speed=speed,
        accel=as_f32(run.states.accel_lon[rows, slot, frames]) * METRES,
        lateral_offset=across - _lane_centre(case, rows, frames),
        indicator=run.states.lights[rows, slot, frames] & _INDICATORS,
        looming=looming(one.gap, one.closing_speed, bodies.width[rows, slot]),
        has_next=has_next & one.valid,
        return_gap=return_gap,
        overtaking_time=time,
        overtaking_distance=distance,
    )


def _overtaking(
    case: Case, one: Encounter, ego: OwnState, length: F32, frames: Index
) -> tuple[F32, F32]:
    """Least time and way to be ahead of the vehicle ahead [s], [m].

    Ahead is where its reaction distance lies between the bumpers. It goes on at its speed, and the
    ego accelerates evenly by what it has now: less is left at higher speed, so this is a bound.
    """
    lengths = length + case.trajectories.scenario.vehicles.length[:, Role.EGO]
    decel = sure_decel(at(case.signals.friction, frames.astype(np.int32)))
    clear = lawful_gap(ego.speed - one.closing_speed, np.float32(0.0), decel)
    way = np.maximum(one.gap, np.float32(0.0)) + lengths + clear
    time = ttc_accel(way, one.closing_speed, ego.available_accel)
    finite = np.where(np.isfinite(time), time, np.float32(0.0))
    return time, finite * (ego.speed + np.float32(0.5) * ego.available_accel * finite)


def _lane_centre(case: Case, rows: Index, frames: Index) -> F32:
    """Centre of the ego's lane across the road, growing to the left [m]."""
    road = case.trajectories.road
    centres = as_f32(road.centres * float(side_of(road)))
    return centres[np.minimum(case.signals.lane[rows, frames], road.num_lanes - 1)]


def _believed(case: Case, frame: I32) -> Believed:
    """What was believed at the last decision to pull out that is not later than a frame."""
    percepts, interval = case.trajectories.percepts, case.signals.frame_interval_ms
    count, now = len(frame), frame * np.int32(interval)
    fits = percepts.valid & (percepts.kind == DecisionKind.PULL_OUT)
    fits &= percepts.time <= now[:, None]
    if "percepts" in case.trajectories.unknown or not fits.shape[1]:
        return _nothing(count)
    row = fits.shape[1] - 1 - fits[:, ::-1].argmax(axis=1)
    place = (np.arange(count), row)
    exists = fits[place]
    return Believed(
        exists=exists,
        age=as_f32(now - percepts.time[place]) / np.float32(1000.0),
        detected=percepts.detected[place] & exists[:, None],
        gap=as_f32(percepts.gap[place]) * METRES,
        closing_speed=as_f32(percepts.closing_speed[place]) * METRES,
    )


def _nothing(count: int) -> Believed:
    """Nothing believed in any simulation."""
    zero, wide = np.zeros(count, np.float32), np.zeros((count, _PERCEIVED), np.float32)
    return Believed(exists=zero > 0, age=zero, detected=wide > 0, gap=wide, closing_speed=wide)
