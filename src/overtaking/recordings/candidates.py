"""Candidate overtakes in a recording: ego, leader, first and last frame.

Every vehicle that drives along the road with a leader in its lane may be an ego. A *candidate* is a
movement to the left out of a lane with a leader ahead; whether it was an overtake, and how it
ended, is for the labels. Its window reaches from some seconds before the movement to some seconds
after the return, or to the end of the track. A vehicle counts as in another lane only once it is
well inside it, so that driving along a line is no lane change.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import I64
from overtaking.model.trajectories import LANE_CHANGE_SPEED
from overtaking.recordings.neighbours import Surroundings
from overtaking.recordings.recording import Recording, Tracks, slope

BEFORE_S, AFTER_S = 10.0, 5.0
"""What a window holds before the movement and after the return [s]."""

MAX_FRAMES = 6000
"""Longer windows are cut off at their end: four minutes at 25 frames a second."""

REACH = 150.0
"""Distance within which a vehicle ahead in the same lane is a leader, bumper to bumper [m]."""

INSIDE = 0.3
"""How far inside a lane a vehicle's centre counts as in it [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A part of a recording that becomes one simulation.

    Attributes:
        ego: Place of the ego among the tracks.
        leader: Place of its leader when the movement begins, or when the window does.
        first: First frame, counted as the source does.
        last: Last frame.
        moves: Frame in which the movement to the left begins, None if there is none.
        returns: Frame in which the ego is back in its lane, None if it is not.
        vehicles: The vehicles of the simulation by slot, as places among the tracks.
    """

    ego: int
    leader: int
    first: int
    last: int
    moves: int | None = None
    returns: int | None = None
    vehicles: tuple[int, ...] = ()

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return self.last - self.first + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneChanges:
    """Changes between driving lanes, in order of vehicle and time; arrays of shape (change,).

    Attributes:
        vehicle: Place of the vehicle.
        row: First row in the new lane.
        begin: Row in which the movement begins.
        end: Row in which it ends.
        old: Lane index before.
        new: Lane index after.
    """

    vehicle: I64
    row: I64
    begin: I64
    end: I64
    old: I64
    new: I64

    @property
    def is_left(self) -> NDArray[np.bool_]:
        """Whether a change goes to the left, shape (change,)."""
        return self.new > self.old


def settled_lanes(recording: Recording) -> I64:
    """Lane that each vehicle is in, changing only once it is `INSIDE`; -1 beyond the slow edge.

    Returns:
        Lane indices, shape (row,); `num_lanes` beyond the fast edge.
    """
    tracks, road = recording.tracks, recording.road
    to_border = np.abs(tracks.d[:, None] - road.lane_boundaries[None, :]).min(axis=1)
    is_sure = to_border >= INSIDE
    is_sure[tracks.start[:-1]] = True
    row = np.arange(tracks.num_rows)
    return tracks.lane_index[np.maximum.accumulate(np.where(is_sure, row, 0))]


def lane_changes(recording: Recording) -> LaneChanges:
    """All changes from one driving lane into another, by vehicles that drive along the road."""
    tracks = recording.tracks
    lane, vehicle = settled_lanes(recording), tracks.vehicle
    changed = np.flatnonzero((np.diff(lane) != 0) & (np.diff(vehicle) == 0)) + 1
    num_lanes = recording.road.num_lanes
    on_road = np.minimum(lane[changed], lane[changed - 1]) >= 0
    # To the left of the last lane is another only where vehicles come the other way.
    end = num_lanes + recording.road.is_two_way
    on_road &= np.maximum(lane[changed], lane[changed - 1]) < end
    on_road &= ~tracks.is_oncoming[vehicle[changed]]
    changed = changed[on_road]
    to_left = (
        slope(tracks.d, tracks.start, recording.frame_interval_ms) * recording.road.overtaking_sign
    )
    old, new = lane[changed - 1], lane[changed]
    left = _last_rows_in(tracks, changed, old)
    begin, end = _movements(tracks, left, changed, to_left * 1.0, np.sign(new - old))
    return LaneChanges(
        vehicle=vehicle[changed], row=changed, begin=begin, end=end, old=old, new=new
    )


def _last_rows_in(tracks: Tracks, rows: I64, lanes: I64) -> I64:
    """The last row before each of some in which that vehicle's centre is in a lane.

    Args:
        tracks: The vehicles.
        rows: Rows in which it counts as in another lane.
        lanes: The lane that it leaves.
    """
    lane, last = tracks.lane_index, rows - 1
    for k, (row, old) in enumerate(zip(rows, lanes, strict=True)):
        low = tracks.start[np.searchsorted(tracks.start, row, side="right") - 1]
        before = np.flatnonzero(lane[low:row] == old)
        last[k] = low + before[-1] if len(before) else row - 1
    return last


def _movements(
    tracks: Tracks, left: I64, rows: I64, to_left: NDArray[np.float64], direction: I64
) -> tuple[I64, I64]:
    """First and last row of movements across the road.

    Args:
        tracks: The vehicles.
        left: Last row of each in the lane that is left; the movement has begun by then.
        rows: A later row of it, the first in the new lane.
        to_left: Speed to the left, shape (row,) [m/s].
        direction: 1 to the left, -1 to the right.
    """
    begin, end = left.copy(), rows.copy()
    vehicle = tracks.vehicle[rows]
    for k, (row, sign) in enumerate(zip(rows, direction, strict=True)):
        low, high = tracks.start[vehicle[k]], tracks.start[vehicle[k] + 1]
        still_before = np.flatnonzero(sign * to_left[low : left[k]][::-1] <= LANE_CHANGE_SPEED)
        still_after = np.flatnonzero(sign * to_left[row:high] <= LANE_CHANGE_SPEED)
        begin[k] = left[k] - still_before[0] if len(still_before) else low
        end[k] = row + still_after[0] - 1 if len(still_after) else high - 1
    return begin, np.maximum(end, rows)


def overtakes(recording: Recording, changes: LaneChanges, around: Surroundings) -> list[Window]:
    """A window for each movement to the left out of a lane with a leader ahead.

    Args:
        recording: The recording.
        changes: Its lane changes.
        around: The neighbours of all vehicles.

    Returns:
        The windows in order of their first frame, then of the ego among the tracks.
    """
    found: list[Window] = []
    for k in np.flatnonzero(changes.is_left):
        is_same_move = k > 0 and changes.begin[k] <= changes.end[k - 1]
        is_same_move &= changes.vehicle[k] == changes.vehicle[k - 1] if k else False
        leader = around.leader(int(changes.begin[k]), reach=REACH)
        if leader is None or (is_same_move and changes.is_left[k - 1]):
            continue
        found.append(_window(recording, changes, int(k), leader))
    return _ordered(found)


def _window(recording: Recording, changes: LaneChanges, k: int, leader: int) -> Window:
    """The window of one movement."""
    tracks, interval_s = recording.tracks, recording.frame_interval_ms * 1e-3
    ego = int(changes.vehicle[k])
    low, high = int(tracks.start[ego]), int(tracks.start[ego + 1]) - 1
    begin = int(changes.begin[k])
    # What came before belongs to another movement.
    previous = changes.end[:k][changes.vehicle[:k] == ego]
    earliest = int(previous[-1]) + 1 if len(previous) else low
    first = max(low, earliest, begin - round(BEFORE_S / interval_s))
    back = (changes.vehicle == ego) & (changes.row > changes.row[k])
    back &= changes.new <= changes.old[k]
    returned = np.flatnonzero(back)
    last, returns = high, None
    if len(returned):
        returns = int(changes.row[returned[0]])
        last = min(high, int(changes.end[returned[0]]) + round(AFTER_S / interval_s))
        again = changes.begin[(changes.vehicle == ego) & (changes.row > returns)]
        last = min(last, int(again[0]) - 1) if len(again) else last
        last = max(last, returns)
    frame = int(tracks.first[ego]) - low
    first = min(first, begin)
    last = min(last, first + MAX_FRAMES - 1)
    returns = returns if returns is not None and returns <= last else None
    return Window(
        ego=ego,
        leader=leader,
        first=frame + first,
        last=frame + last,
        moves=frame + begin,
        returns=None if returns is None else frame + returns,
    )


def followers(recording: Recording, changes: LaneChanges, around: Surroundings) -> list[Window]:
    """A window for each vehicle that has a leader and never leaves its lane to the left.

    It is the longest time with a leader, in whatever lane, the earlier of two that are equally
    long.
    """
    tracks = recording.tracks
    leaves = set(changes.vehicle[changes.is_left].tolist())
    has_leader = around.has_leader(reach=REACH) & ~tracks.is_oncoming[tracks.vehicle]
    found: list[Window] = []
    for ego in range(tracks.num_vehicles):
        low, high = int(tracks.start[ego]), int(tracks.start[ego + 1])
        run = _longest_run(has_leader[low:high])
        if ego in leaves or run is None:
            continue
        leader = around.leader(low + run[0], reach=REACH)
        assert leader is not None
        offset = int(tracks.first[ego])
        last = min(run[1], run[0] + MAX_FRAMES - 1)
        found.append(Window(ego=ego, leader=leader, first=offset + run[0], last=offset + last))
    return _ordered(found)


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int] | None:
    """First and last place of the longest run of true, None if there is none of two or more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2] - 1
    if not len(begins):
        return None
    best = int(np.argmax(ends - begins))
    return (int(begins[best]), int(ends[best])) if ends[best] > begins[best] else None


def _ordered(windows: list[Window]) -> list[Window]:
    """Windows in an order that does not depend on how they were found."""
    return sorted(windows, key=lambda window: (window.first, window.ego, window.last))


def num_passes(tracks: Tracks) -> int:
    """Pairs of vehicles of which one was behind the other and is ahead when they part.

    Vehicles that come the other way are met and not passed; they count for nothing.
    """
    passes = 0
    for one in np.flatnonzero(~tracks.is_oncoming).tolist():
        begin = np.maximum(tracks.first, tracks.first[one])
        end = np.minimum(tracks.last, tracks.last[one])
        same_road = tracks.carriageway == tracks.carriageway[one]
        same_road[one] = False
        other = np.flatnonzero((begin <= end) & same_road)
        rows = tracks.start[other] - tracks.first[other]
        own = tracks.start[one] - tracks.first[one]
        before = tracks.s[own + begin[other]] < tracks.s[rows + begin[other]]
        after = tracks.s[own + end[other]] > tracks.s[rows + end[other]]
        passes += int((before & after).sum())
    return passes
