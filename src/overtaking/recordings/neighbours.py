"""The neighbours of all vehicles of a recording in all frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import I64
from overtaking.recordings.recording import Recording, Tracks

NOBODY = -1

PLACES = ((0, True), (0, False), (1, True), (1, False), (-1, True), (-1, False))
"""Lane to look in, relative to the own one, and whether ahead; the order of `signals.Around`."""

_MM_PER_M = 1000.0
_LANES_PER_FRAME = 16  # More than there are lanes, with one beside each edge and one to spare.


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """The six neighbours of each row.

    Attributes:
        tracks: The vehicles.
        vehicle: Place of each row's vehicle, shape (row,).
        row: Row of the neighbour in each of the `PLACES`, `NOBODY` if there is none, shape
            (place, row). A vehicle exactly beside counts as ahead.
    """

    tracks: Tracks
    vehicle: I64
    row: I64

    @classmethod
    def of(cls, recording: Recording) -> "Surroundings":
        """The neighbours in a recording, by the lanes that the centres are in."""
        tracks = recording.tracks
        key = _keys(tracks)
        # Of two vehicles at the same position neither is ahead of the first among the tracks.
        order = np.lexsort((tracks.vehicle, key))
        sorted_keys = key[order]
        rows = np.full((len(PLACES), tracks.num_rows), NOBODY)
        for place, (shift, is_ahead) in enumerate(PLACES):
            rows[place] = _found(tracks, key, order, sorted_keys, shift, is_ahead=is_ahead)
        return cls(tracks=tracks, vehicle=tracks.vehicle, row=rows)

    def has_leader(self, *, reach: float) -> NDArray[np.bool_]:
        """Whether a vehicle is ahead in the same lane within `reach` [m], shape (row,)."""
        row = np.arange(self.tracks.num_rows)
        return (self.row[0] != NOBODY) & (self._gap(row, self.row[0]) <= reach)

    def leader(self, row: int, *, reach: float) -> int | None:
        """Vehicle ahead in the same lane within `reach` [m], None if there is none."""
        ahead = int(self.row[0, row])
        if ahead == NOBODY or self._gap(np.array([row]), np.array([ahead]))[0] > reach:
            return None
        return int(self.vehicle[ahead])

    def vehicles(self, first: int, last: int) -> I64:
        """Vehicles in the six places around a vehicle, shape (place, row), `NOBODY` for none.

        Args:
            first: First row of the vehicle.
            last: Its last row.
        """
        rows = self.row[:, first : last + 1]
        return np.where(rows == NOBODY, NOBODY, self.vehicle[rows])

    def _gap(self, row: I64, ahead: I64) -> NDArray[np.float64]:
        """Distance between the bumpers of some rows and of others ahead of them [m]."""
        tracks, vehicle = self.tracks, self.vehicle
        half = (tracks.length[vehicle[row]] + tracks.length[vehicle[ahead]]) * 0.5
        return tracks.s[ahead] - tracks.s[row] - half


def _keys(tracks: Tracks) -> I64:
    """A number for each row that sorts by frame, then lane, then position along the road."""
    lane = tracks.lane_index + 1
    along = np.rint((tracks.s - tracks.s.min()) * _MM_PER_M).astype(np.int64)
    first = int(tracks.carriageway.min())
    roads = int(tracks.carriageway.max()) - first + 1
    carriageway = tracks.carriageway[tracks.vehicle] - first
    frame = (tracks.frame - tracks.first.min()) * roads + carriageway
    return (frame * _LANES_PER_FRAME + lane) * _span(tracks) + along


def _span(tracks: Tracks) -> int:
    """More millimetres than any two vehicles are apart."""
    return int(np.ceil((tracks.s.max() - tracks.s.min()) * _MM_PER_M)) + 2


def _found(
    tracks: Tracks, key: I64, order: I64, sorted_keys: I64, shift: int, *, is_ahead: bool
) -> I64:
    """The nearest row ahead or behind in a lane, for every row."""
    span = _span(tracks)
    aim = key + shift * span
    if shift == 0:
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        place = rank + (1 if is_ahead else -1)
    else:
        place = np.searchsorted(sorted_keys, aim, side="left") - (0 if is_ahead else 1)
    inside = (place >= 0) & (place < len(order))
    clipped = np.clip(place, 0, len(order) - 1)
    same_lane = sorted_keys[clipped] // span == aim // span
    lane = (aim // span) % _LANES_PER_FRAME
    exists = (lane > 0) & ((key // span) % _LANES_PER_FRAME > 0)
    return np.where(inside & same_lane & exists, order[clipped], NOBODY)
