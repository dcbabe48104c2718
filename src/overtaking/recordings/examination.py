"""Checks of vehicle sizes and of vehicles under two ids, for recordings of every format.

They run on the tracks, after reading and before the search for overtakes. Readers check ids, times,
cells, positions and gaps themselves, so that their messages can name rows and columns of the file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.messages import refused
from overtaking.recordings.recording import select_vehicles

if TYPE_CHECKING:
    from overtaking.core.arrays import I64, Mask
    from overtaking.recordings.recording import Recording, Tracks

MAX_SWAPPED_SHARE = 0.5
"""With a larger share of vehicles that are wider than long, length and width are exchanged in the
whole recording, and it is refused. Up to this share, each such vehicle is reported."""

MIN_OVERLAP = 0.6
"""Two tracks are one vehicle if their boxes overlap in more than this share of their common frames.
In simulated collisions, boxes overlap in up to 42 % of the common frames, but not in the first."""

MAX_SPEED_DIFFERENCE = 1.0
"""Largest difference of the mean speeds of two tracks of one vehicle [m/s]. Two detections of
one vehicle are offset by less than its length, but move at the same speed."""

MIN_COMMON_SHARE = 0.5
"""The shorter of two tracks of one vehicle is left out if at least this share of its frames are
common frames. With a smaller share, the tracker changed the id on the way, and both are needed."""

_MAX_PAIRS = 1 << 20  # Pairs of tracks that are compared at a time, to keep memory small.


def examine(recording: Recording, *, needed: Mask | None = None) -> Recording:
    """Check sizes, then leave out second tracks of vehicles that have two ids.

    Args:
        recording: The recording.
        needed: Whether the track of each vehicle must stay, shape (vehicle,): a duplicate among
            them is reported, not left out. By default no track must stay.

    Returns:
        The recording without the second tracks, with all findings.

    Raises:
        ImportFormatError: Most vehicles are wider than long.
    """
    findings = check_sizes(recording)
    pairs = find_duplicates(recording.tracks)
    if not findings and not pairs:
        return recording
    tracks = recording.tracks
    is_needed = np.zeros(tracks.num_vehicles, np.bool_) if needed is None else needed
    is_left_out = np.zeros(tracks.num_vehicles, np.bool_)
    interval_s = recording.frame_interval_ms * 1e-3
    for pair in pairs:
        # A track that is left out already gives no reason to leave out another one.
        if is_left_out[pair.copy] or is_left_out[pair.vehicle]:
            continue
        is_reported = bool(is_needed[pair.copy]) or not pair.is_whole
        is_left_out[pair.copy] = not is_reported
        first = int(tracks.first[pair.copy])
        detail = (
            f"its box overlaps that of vehicle {tracks.name_of(pair.vehicle)} in "
            f"{pair.num_overlapping} of {pair.num_common} common frames, from the first one on"
        )
        detail += "; both tracks are kept" if is_reported else "; the shorter track is left out"
        findings.append(
            Finding(
                check=Check.DUPLICATE_VEHICLES,
                consequence=Consequence.REPORTED if is_reported else Consequence.LEFT_OUT,
                detail=detail,
                rows=int(tracks.start[pair.copy + 1] - tracks.start[pair.copy]),
                vehicle=tracks.name_of(pair.copy),
                first_time_s=recording.time_origin_s + first * interval_s,
            )
        )
    notes = recording.notes
    if is_left_out.any():
        tracks = select_vehicles(tracks, ~is_left_out)
        notes = notes | ({"states": tracks.num_rows} if "states" in notes else {})
    return replace(recording, tracks=tracks, notes=notes, findings=(*recording.findings, *findings))


def check_sizes(recording: Recording) -> list[Finding]:
    """Report vehicles that are wider than long, one finding for each.

    Raises:
        ImportFormatError: More than `MAX_SWAPPED_SHARE` of the vehicles are wider than long.
    """
    tracks = recording.tracks
    is_swapped = tracks.width > tracks.length
    count = int(is_swapped.sum())
    if count > MAX_SWAPPED_SHARE * tracks.num_vehicles:
        vehicle = int(np.argmax(is_swapped))
        raise refused(
            recording.name,
            f"length and width of {count} of {tracks.num_vehicles} vehicles",
            "lengths that are greater than widths",
            f"vehicle {tracks.name_of(vehicle)}, {tracks.width[vehicle]:.3g} m wide and "
            f"{tracks.length[vehicle]:.3g} m long",
            "exchange the two columns",
        )
    return [
        Finding(
            check=Check.SIZES,
            consequence=Consequence.REPORTED,
            detail=(
                f"{tracks.width[vehicle]:.3g} m wide and {tracks.length[vehicle]:.3g} m long; "
                "likely length and width are exchanged"
            ),
            rows=int(tracks.start[vehicle + 1] - tracks.start[vehicle]),
            vehicle=tracks.name_of(vehicle),
            first_time_s=recording.time_origin_s
            + float(tracks.first[vehicle]) * recording.frame_interval_ms * 1e-3,
        )
        for vehicle in np.flatnonzero(is_swapped).tolist()
    ]


class DuplicatePair(NamedTuple):
    """Two tracks of one vehicle.

    Attributes:
        vehicle: Index of the track with more frames; of two with equally many, the one that comes
            first in the file.
        copy: Index of the other track.
        num_common: Number of frames in which both tracks have a state.
        num_overlapping: Number of common frames in which the boxes overlap.
        is_whole: Whether at least `MIN_COMMON_SHARE` of the copy's frames are common frames.
    """

    vehicle: int
    copy: int
    num_common: int
    num_overlapping: int
    is_whole: bool


def find_duplicates(tracks: Tracks) -> list[DuplicatePair]:
    """Find pairs of tracks on one carriageway that are one vehicle.

    Returns:
        The pairs, those with the longest `vehicle` track first.
    """
    duplicates: list[DuplicatePair] = []
    for first, second in zip(*_find_candidate_pairs(tracks), strict=True):
        pair = _match_tracks(tracks, int(first), int(second))
        if pair is not None:
            duplicates.append(pair)
    count = np.diff(tracks.start)
    return sorted(duplicates, key=lambda pair: (-int(count[pair.vehicle]), pair.vehicle, pair.copy))


def _find_candidate_pairs(tracks: Tracks) -> tuple[I64, I64]:
    """Pairs of tracks whose boxes overlap in their first common frame.

    The first common frame of two tracks is the first frame of the later one. So each track is
    compared, in its first frame, with the tracks that have a state there. An index of tracks by
    carriageway and time span keeps the effort proportional to the number of rows.

    Returns:
        The earlier and the later track of each pair, shape (pair,) each.
    """
    count = tracks.num_vehicles
    first, last, carriageway = tracks.first, tracks.last, tracks.carriageway
    if count < 2:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    # Spans of a mean track's length: each track is in few spans, and each span has few tracks.
    span = max(1, int(np.diff(tracks.start).mean()))  # [frames]
    origin = int(first.min())
    num_spans = (int(last.max()) - origin) // span + 1
    # The key of a span is unique across carriageways.
    base = (carriageway - carriageway.min()) * num_spans
    first_span, last_span = (first - origin) // span, (last - origin) // span
    num_entries = last_span - first_span + 1
    entry_track = np.repeat(np.arange(count), num_entries)
    span_in_track = np.arange(len(entry_track)) - np.repeat(
        np.cumsum(num_entries) - num_entries, num_entries
    )
    entry_key = (base + first_span)[entry_track] + span_in_track
    order = np.argsort(entry_key, kind="stable")
    entry_key, entry_track = entry_key[order], entry_track[order]
    first_key = base + first_span
    low = np.searchsorted(entry_key, first_key, side="left")
    num_candidates = np.searchsorted(entry_key, first_key, side="right") - low
    ends = np.cumsum(num_candidates)
    pairs: list[tuple[I64, I64]] = []
    begin = 0
    while begin < count:
        num_done = int(ends[begin - 1]) if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, num_done + _MAX_PAIRS, side="right")))
        chunk = np.arange(begin, end)
        track = np.repeat(chunk, num_candidates[chunk])
        offset = np.arange(len(track)) - np.repeat(
            np.cumsum(num_candidates[chunk]) - num_candidates[chunk], num_candidates[chunk]
        )
        other = entry_track[low[track] + offset]
        # Two tracks that begin in the same frame find each other; their pair counts once.
        precedes = (first[other] < first[track]) | (
            (first[other] == first[track]) & (other < track)
        )
        precedes &= last[other] >= first[track]
        track, other = track[precedes], other[precedes]
        row = tracks.start[track]
        other_row = tracks.start[other] + first[track] - first[other]
        is_overlapping = _overlaps(tracks, track, other, row, other_row)
        pairs.append((other[is_overlapping], track[is_overlapping]))
        begin = end
    earlier, later = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return earlier, later


def _overlaps(
    tracks: Tracks, first: I64 | int, second: I64 | int, first_row: I64, second_row: I64
) -> Mask:
    """Whether the boxes of two tracks overlap, by rows of the same frames; shape of `first_row`.

    Boxes are parallel to the road.
    """
    length = 0.5 * (tracks.length[first] + tracks.length[second])
    width = 0.5 * (tracks.width[first] + tracks.width[second])
    is_along = np.abs(tracks.s[first_row] - tracks.s[second_row]) < length
    overlaps: Mask = is_along & (np.abs(tracks.d[first_row] - tracks.d[second_row]) < width)
    return overlaps


def _match_tracks(tracks: Tracks, first: int, second: int) -> DuplicatePair | None:
    """Describe two tracks as a pair; None if they are two vehicles."""
    begin = max(int(tracks.first[first]), int(tracks.first[second]))
    num_common = min(int(tracks.last[first]), int(tracks.last[second])) - begin + 1
    rows, other_rows = (
        np.arange(num_common) + tracks.row(track, begin) for track in (first, second)
    )
    num_overlapping = int(_overlaps(tracks, first, second, rows, other_rows).sum())
    if num_overlapping <= MIN_OVERLAP * num_common:
        return None
    speed_difference = float(tracks.speed[rows].mean() - tracks.speed[other_rows].mean())
    if abs(speed_difference) > MAX_SPEED_DIFFERENCE:
        return None
    count = np.diff(tracks.start)
    vehicle, copy = sorted(
        (first, second), key=lambda track: (-int(count[track]), int(tracks.file_row[track]), track)
    )
    return DuplicatePair(
        vehicle=vehicle,
        copy=copy,
        num_common=num_common,
        num_overlapping=num_overlapping,
        is_whole=num_common >= MIN_COMMON_SHARE * int(count[copy]),
    )
