"""Recordings written by hand: a few tracks become trajectories, signals, events and a case."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.support.worlds import CLEAR, Vehicle, scenario

from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.signals import target_signals
from overtaking.model.known_roads import known_road
from overtaking.model.overtake_events import NEVER, OvertakeEvents
from overtaking.model.road import Lane, Road, RoadMark
from overtaking.model.trajectories import (
    NO_VEHICLE,
    STATE_DTYPES,
    Contacts,
    Lights,
    ManoeuvreKind,
    Percepts,
    States,
    Trajectories,
)

if TYPE_CHECKING:
    from overtaking.model.ego_signals import EgoSignals
    from overtaking.model.verdicts import Case

INTERVAL_MS = 50
LEFT, RIGHT = int(Lights.INDICATOR_LEFT), int(Lights.INDICATOR_RIGHT)
LOW, HIGH, FOG = int(Lights.LOW_BEAM), int(Lights.HIGH_BEAM), int(Lights.REAR_FOG)
NIGHT = {"night": 1.0, "sun_altitude": -1.5}


@dataclass(frozen=True, kw_only=True)
class Track:
    """The way of one vehicle.

    Attributes:
        kind: Its class.
        s: Position of its centre in frame 0 [m].
        speed: In each frame, or always [m/s].
        lane: Lane index in each frame, or always; fractions lie between lane centres.
        lights: `Lights` in each frame, or always.
        accel: In each frame, or always [m/s^2].
        oncoming: Whether it drives against the road.
        body: What differs from the middle of its class.
    """

    kind: str = "M"
    s: float = 0.0
    speed: Any = 25.0
    lane: Any = 0.0
    lights: Any = 0
    accel: Any = 0.0
    oncoming: bool = False
    body: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What the ego believed of one vehicle at a decision, and what was so; SI."""

    kind: ManoeuvreKind = ManoeuvreKind.PULL_OUT
    frame: int = 0
    whom: int = 0
    vehicle: int = 1
    detected: bool = True
    gap: float = 0.0
    closing_speed: float = 0.0
    true_gap: float = 0.0
    true_closing_speed: float = 0.0


def case(
    *tracks: Track,
    frames: int = 200,
    road: Road | None = None,
    weather: dict[str, float] | None = None,
    unknown: tuple[str, ...] = (),
    events: dict[str, int] | None = None,
    beliefs: tuple[Belief, ...] = (),
    interval_ms: int = INTERVAL_MS,
) -> Case:
    """One simulation, the ego first.

    Args:
        tracks: The vehicles.
        frames: Number of frames.
        road: `motorway` by default.
        weather: Differences from `CLEAR`.
        unknown: What the recording does not tell.
        events: Events by name, none of the others having happened; found in the tracks by default.
        beliefs: What the ego believed, one vehicle at a decision.
        interval_ms: Time between frames [ms].
    """
    road = road or known_road("motorway")
    world = scenario(
        [Vehicle(kind=each.kind, body=each.body) for each in tracks],
        road=road,
        weather=CLEAR | (weather or {}),
        frame_interval_ms=interval_ms,
        num_slots=len(tracks),
    )
    recorded = Trajectories(
        scenario=world,
        num_frames=np.array([frames], np.int32),
        states=_states(tracks, road, frames, interval_ms),
        stage=np.zeros((1, frames), np.uint8),
        collided_with=_collided((events or {}).get("collision"), frames, len(tracks)),
        contacts=_contacts(len(tracks)),
        percepts=_percepts(beliefs, interval_ms),
        trace_hash=np.zeros((1, 4), np.uint32),
        unknown=frozenset(unknown),
    )
    return seen_case(recorded, events)


def seen_case(recorded: Trajectories, events: dict[str, int] | None = None) -> Case:
    """A case from trajectories, with events by name or those that are found in it."""
    found = case_from_trajectories(recorded)
    if events is None:
        return found
    return with_events(found, _events(recorded, found.signals, events))


def with_events(one: Case, events: OvertakeEvents) -> Case:
    """The case as if these were its events."""
    target = target_signals(one.trajectories, one.signals, events.target_slot)
    return one.replace(events=events, target=target)


def ramp(*points: tuple[float, float], frames: int, interval_ms: int = INTERVAL_MS) -> np.ndarray:
    """Values in each frame, linear between (time [s], value) points."""
    times, values = zip(*points, strict=True)
    return np.interp(np.arange(frames) * interval_ms / 1000.0, times, values)


def two_way_road(mark: RoadMark = RoadMark.BROKEN) -> Road:
    """One lane in each direction."""
    lane = Lane(lane_id=-1, width=3.5, right_mark=RoadMark.SOLID, left_mark=mark)
    opposite = Lane(
        lane_id=1,
        width=3.5,
        direction=-1,
        right_mark=mark.reverse,
        left_mark=RoadMark.SOLID,
    )
    return dataclasses.replace(
        known_road("motorway"),
        name="two-way",
        kind="rural",
        lanes=(lane,),
        kerb_edge_d=-3.5,
        speed_limit=25.0,
        kerb_side_neighbour=None,
        overtaking_side_neighbour=opposite,
    )


def _states(tracks: tuple[Track, ...], road: Road, frames: int, interval_ms: int) -> States:
    def rows(name: str, dtype: type, scale: float = 1.0) -> np.ndarray:
        values = [np.broadcast_to(getattr(each, name), frames) for each in tracks]
        scaled = np.array(values, np.float64) * scale
        return (np.rint(scaled) if np.issubdtype(dtype, np.integer) else scaled).astype(dtype)[None]

    speed = rows("speed", np.int32, 1000.0)
    step = np.array([-1 if each.oncoming else 1 for each in tracks])[None, :, None]
    way = np.cumsum(speed * step, axis=2) - speed * step
    s = np.array([each.s for each in tracks])[None, :, None] * 1000.0 + way * interval_ms / 1000.0
    d = rows("lane", np.float64) * road.overtaking_sign * road.lanes[0].width + road.lane_centres[0]
    index = road.lane_index(d)
    x, y = road.to_world(s / 1000.0, d)
    heading = np.where(step < 0, np.round(np.pi * 1e4), 0.0) + np.zeros(s.shape)
    known = {
        "x": _int32(x * 1000.0),
        "y": _int32(y * 1000.0),
        "s": _int32(s),
        "d": _int32(d * 1000.0),
        "speed": speed,
        "heading": heading.astype(np.int16),
        "accel_lon": rows("accel", np.int16, 1000.0),
        "lane": np.where(index < 0, 255, index).astype(np.uint8),
        "lights": rows("lights", np.uint8),
    }
    zeros = {name: np.zeros(s.shape, kind) for name, kind in STATE_DTYPES.items()}
    return States(**zeros | known)


def _int32(values: np.ndarray) -> np.ndarray:
    return np.rint(values).astype(np.int32)


def _collided(collision: int | None, frames: int, vehicles: int) -> np.ndarray:
    hit = np.full((1, frames), NO_VEHICLE)
    if collision is not None and vehicles > 1:
        hit[:, collision:] = 1
    return hit


def _contacts(slots: int) -> Contacts:
    zero = np.zeros((1, slots), np.int32)
    return Contacts(
        partner=np.full((1, slots), NO_VEHICLE), time=zero, impulse=zero, closing_speed=zero
    )


def _percepts(beliefs: tuple[Belief, ...], interval_ms: int) -> Percepts:
    shape = (1, max(len(beliefs), 1), 3)
    columns = {
        name: np.zeros(shape, np.int32)
        for name in ("gap", "closing_speed", "true_gap", "true_closing_speed")
    }
    valid, kind = np.zeros(shape[:2], np.bool_), np.zeros(shape[:2], np.uint8)
    time, vehicle = np.zeros(shape[:2], np.int32), np.full(shape, NO_VEHICLE)
    detected = np.zeros(shape, np.bool_)
    for k, each in enumerate(beliefs):
        valid[0, k], kind[0, k], time[0, k] = True, each.kind, each.frame * interval_ms
        vehicle[0, k, each.whom], detected[0, k, each.whom] = each.vehicle, each.detected
        for name, values in columns.items():
            values[0, k, each.whom] = round(getattr(each, name) * 1000.0)
    return Percepts(
        valid=valid, kind=kind, time=time, slot=vehicle, is_detected=detected, **columns
    )


def _events(recorded: Trajectories, seen: EgoSignals, named: dict[str, int]) -> OvertakeEvents:
    values = {each.name: int(NEVER) for each in dataclasses.fields(OvertakeEvents)}
    values |= {
        "first": 0,
        "last": int(recorded.num_frames[0]) - 1,
        "target_slot": 1,
        "original_lane": int(seen.lane[0, 0]),
        "following_begin": 0,
        "num_attempts": int("attempt" in named),
        "num_passed": 0,
        "collision_slot": int(NO_VEHICLE),
        "was_struck": 0,
    }
    types = {each.name: str(each.type) for each in dataclasses.fields(OvertakeEvents)}
    columns = {
        name: np.array([value], _TYPES.get(types[name], np.int32))
        for name, value in (values | named).items()
    }
    return OvertakeEvents(**columns)


_TYPES = {"U8": np.uint8, "Mask": np.bool_}
