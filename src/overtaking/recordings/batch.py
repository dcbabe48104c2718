"""From windows of a recording to `Trajectories`: the ego in slot 0, others in the next."""

import dataclasses
import hashlib
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I64, U8, Mask
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import (
    NO_VEHICLE,
    STATE_DTYPES,
    STATE_RESOLUTION,
    Contacts,
    Percepts,
    Stage,
    States,
    Trajectories,
    to_integers,
)
from overtaking.recordings.candidates import Window
from overtaking.recordings.neighbours import NOBODY, Surroundings
from overtaking.recordings.recording import Recording
from overtaking.scenarios.recording_defaults import DEFAULT_KIND as ASSUMED_KIND
from overtaking.scenarios.recording_defaults import (
    default_drivers,
    default_vehicles,
    default_weather,
    kinds_by_length,
)

NUM_SLOTS = 16
"""Default number of vehicles of a simulation from a recording, the ego among them."""

MAX_SLOTS = 64

MEETING = 2
"""Nearest oncoming vehicles, at the beginning and at the return, that have a slot before others."""


def vehicles_of(
    recording: Recording, around: Surroundings, window: Window, num_slots: int = NUM_SLOTS
) -> tuple[int, ...]:
    """The vehicles of a simulation by slot, as places among the tracks.

    After the ego and its leader come those around it when its movement begins and when it is back,
    and who comes the other way then, then those that are around it in most frames, then those that
    are nearest to it at the beginning. Of two that are equal, the earlier among the
    tracks comes first, so nothing depends on the order in the file.

    Args:
        recording: The recording.
        around: The neighbours of all vehicles.
        window: Which part of it.
        num_slots: How many vehicles at most.
    """
    tracks, ego = recording.tracks, window.ego
    low, high = tracks.row(ego, window.first), tracks.row(ego, window.last)
    near = around.vehicles(low, high)
    chosen: dict[int, None] = {ego: None, window.leader: None}
    for frame in (window.moves, window.returns):
        if frame is not None:
            there = near[:, frame - window.first]
            chosen |= dict.fromkeys(there[there != NOBODY].tolist())
    for frame in dict.fromkeys((window.moves or window.first, window.returns or window.last)):
        chosen |= dict.fromkeys(_coming(recording, ego, frame))
    counts = Counter(near[near != NOBODY].tolist())
    by_time = sorted(counts, key=lambda vehicle: (-counts[vehicle], vehicle))
    chosen |= dict.fromkeys(by_time)
    chosen |= dict.fromkeys(_nearest(recording, window))
    return tuple(chosen)[:num_slots]


def _coming(recording: Recording, ego: int, frame: int) -> list[int]:
    """The nearest vehicles that come towards the ego in a frame."""
    tracks = recording.tracks
    there = np.flatnonzero(tracks.is_oncoming & (tracks.first <= frame) & (tracks.last >= frame))
    rows = tracks.start[there] + frame - tracks.first[there]
    ahead = tracks.s[rows] - tracks.s[tracks.row(ego, frame)]
    order = np.argsort(np.round(ahead, 3), kind="stable")
    return there[order[ahead[order] > 0.0][:MEETING]].tolist()


def _nearest(recording: Recording, window: Window) -> list[int]:
    """All vehicles of a window by the frame in which they appear, then by distance."""
    tracks = recording.tracks
    meets = (tracks.first <= window.last) & (tracks.last >= window.first)
    same = tracks.carriageway == tracks.carriageway[window.ego]
    there = np.flatnonzero(meets & (same | tracks.is_oncoming))
    frame = np.maximum(tracks.first[there], window.first)
    own = tracks.s[tracks.start[window.ego] + frame - tracks.first[window.ego]]
    apart = np.abs(tracks.s[tracks.start[there] + frame - tracks.first[there]] - own)
    return there[np.lexsort((np.round(apart, 3), frame))].tolist()


def coverage(recording: Recording, around: Surroundings, windows: Sequence[Window]) -> float:
    """Share of all neighbours of the egos, over frames and places, that have a slot."""
    tracks, found, total = recording.tracks, 0, 0
    for window in windows:
        rows = (tracks.row(window.ego, frame) for frame in (window.first, window.last))
        near = around.vehicles(*rows)
        near = near[near != NOBODY]
        found += int(np.isin(near, window.vehicles).sum())
        total += near.size
    return found / total if total else 1.0


def trajectories(
    recording: Recording, windows: Sequence[Window], *, first_index: int = 0
) -> Trajectories:
    """The simulations that some windows become.

    Args:
        recording: The recording.
        windows: At least one, with its vehicles.
        first_index: Index of the first simulation.

    Returns:
        A batch with as many slots as the largest window needs and frames as the longest one.
    """
    num_frames = np.array([one.num_frames for one in windows], np.int32)
    slots = max(len(one.vehicles) for one in windows)
    rows = np.full((len(windows), slots, num_frames.max()), NOBODY)
    for place, window in enumerate(windows):
        for slot, vehicle in enumerate(window.vehicles):
            _place(recording, window, vehicle, rows[place, slot])
    present = rows != NOBODY
    states = _states(recording, rows, present)
    shape, nothing = (len(windows), rows.shape[2]), np.zeros((len(windows), slots), np.int32)
    made = Trajectories(
        scenario=_scenario(recording, windows, rows, first_index),
        num_frames=num_frames,
        states=states,
        stage=np.full(shape, Stage.FOLLOW, np.uint8),
        collided_with=np.full(shape, NO_VEHICLE),
        contacts=Contacts(
            partner=np.full(nothing.shape, NO_VEHICLE),
            time=nothing,
            impulse=nothing,
            closing_speed=nothing,
        ),
        percepts=Percepts.empty(len(windows), 0),
        trace_hash=_hashes(states, present, num_frames),
        unknown=recording.unknown,
        is_kind_known=_known_kinds(recording, windows, slots),
    )
    whole = np.array_equal(present, made.state_mask)
    return made if whole else made.replace(is_recorded=present)


def _known_kinds(recording: Recording, windows: Sequence[Window], slots: int) -> Mask | None:
    """Whether the kind of each vehicle is known, shape (window, slot); None if all kinds are.

    Args:
        recording: The recording.
        windows: The windows, with their vehicles.
        slots: Number of vehicles of a simulation; empty slots count as known.
    """
    is_known = np.ones((len(windows), slots), np.bool_)
    for row, window in zip(is_known, windows, strict=True):
        row[: len(window.vehicles)] = recording.tracks.is_kind_known[list(window.vehicles)]
    return None if "kinds" in recording.unknown or is_known.all() else is_known


def _place(recording: Recording, window: Window, vehicle: int, into: I64) -> None:
    """Write down which rows of a vehicle a window holds."""
    tracks = recording.tracks
    first = max(window.first, int(tracks.first[vehicle]))
    last = min(window.last, int(tracks.last[vehicle]))
    if first <= last:
        row = tracks.row(vehicle, first)
        into[first - window.first : last - window.first + 1] = np.arange(
            row, row + last - first + 1
        )


def _states(recording: Recording, rows: I64, present: NDArray[np.bool_]) -> States:
    """Recorded integers; zero where a vehicle is not there."""
    tracks = recording.tracks
    # Zeros for states that recordings lack.
    values: dict[str, Any] = {k: np.zeros(rows.shape, kind) for k, kind in STATE_DTYPES.items()}
    values["lane"] = np.where(present, tracks.lane[rows], np.uint8(0))
    for name in STATE_RESOLUTION.keys() & {field.name for field in dataclasses.fields(tracks)}:
        quantity = getattr(tracks, name)
        if name in ("heading", "wheel_angle"):
            quantity = quantity - np.round(quantity / (2.0 * np.pi)) * (2.0 * np.pi)
        steps = to_integers(name, quantity / STATE_RESOLUTION[name], recording.name)
        values[name] = np.where(present, steps[rows], STATE_DTYPES[name](0))
    return States(**values)


def _scenario(
    recording: Recording, windows: Sequence[Window], rows: I64, first_index: int
) -> Scenario:
    """The scenario of each simulation; what the recording does not tell is assumed."""
    tracks, count, slots = recording.tracks, len(windows), rows.shape[1]
    num_vehicles = np.array([len(one.vehicles) for one in windows])
    valid = np.arange(slots) < num_vehicles[:, None]
    # An empty slot looks like the ego's, so that it can be computed with.
    who = np.array([[*one.vehicles, *[one.ego] * (slots - len(one.vehicles))] for one in windows])
    present = rows != NOBODY
    first = np.take_along_axis(rows, present.argmax(axis=2)[:, :, None], axis=2)[:, :, 0]
    first = np.where(valid & (first != NOBODY), first, first[:, :1])
    num_frames = np.array([one.num_frames for one in windows], np.int32)
    duration = num_frames * (recording.frame_interval_ms * 1e-3)
    lane = tracks.lane[first].astype(np.int64)
    num_lanes = recording.road.num_lanes
    lane = np.where(lane == NO_VEHICLE, 0, np.minimum(lane, num_lanes - 1))
    lane = np.where(tracks.is_oncoming[who], num_lanes, lane)
    length = tracks.length.astype(np.float32)
    return Scenario(
        profile=recording.file_format,
        road=recording.road,
        seed=0,
        frame_interval_ms=recording.frame_interval_ms,
        scenario_index=np.arange(first_index, first_index + count, dtype=np.uint64),
        horizon=duration.astype(np.float32),
        attempt_deadline=duration.astype(np.float32),
        weight=np.ones(count),
        vehicles=default_vehicles(
            valid,
            _assumed_kinds(recording, length)[who],
            length[who],
            tracks.width[who].astype(np.float32),
        ),
        drivers=default_drivers((count, slots)),
        weather=default_weather(count),
        start_s=tracks.s[first].astype(np.float32),
        start_lane=lane.astype(np.uint8),
        start_speed=tracks.speed[first].astype(np.float32),
    )


def _assumed_kinds(recording: Recording, length: F32) -> U8:
    """The kind of each vehicle, also where it is unknown, shape (vehicle,).

    Data sets store null for an unknown kind, so that kinds from a file have to follow from what is
    stored. With the same kinds here, labels before and after storing agree.

    Args:
        recording: The recording.
        length: As stored, shape (vehicle,) [m].
    """
    tracks = recording.tracks
    if "kinds" in recording.unknown:
        nothing = np.zeros(len(length), np.bool_)
        return kinds_by_length(length, is_truck=nothing, is_car=nothing)
    return np.where(tracks.is_kind_known, tracks.kind, np.uint8(ASSUMED_KIND))


def _hashes(
    states: States, present: NDArray[np.bool_], num_frames: NDArray[np.int32]
) -> NDArray[np.uint32]:
    """A 128-bit hash over the recorded integers of each simulation, shape (simulation, 4)."""
    words = np.empty((len(num_frames), 4), np.uint32)
    for place, count in enumerate(num_frames):
        digest = hashlib.blake2b(digest_size=16)
        there = present[place, :, :count]
        digest.update(np.packbits(there).tobytes())
        for name in (*STATE_RESOLUTION, "lane"):
            values = getattr(states, name)[place, :, :count][there]
            digest.update(values.astype(values.dtype.newbyteorder("<")).tobytes())
        words[place] = np.frombuffer(digest.digest(), "<u4")
    return words
