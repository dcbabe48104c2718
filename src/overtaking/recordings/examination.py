"""The examination of a recording, whatever file it comes from, before overtakes are looked for.

Readers examine ids, times, cells, positions and gaps, which only they can name in the words of the
file. Sizes and vehicles that a recording has twice are examined here, on its tracks.
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
"""With a larger share of vehicles that are wider than long, the columns are exchanged."""

MIN_OVERLAP = 0.6
"""Boxes that overlap in more of their common frames are one vehicle. In simulated collisions they
do in up to 42 % of them, and not from the first one on."""

MAX_SPEED_DIFFERENCE = 1.0
"""Largest difference of the mean speeds of two tracks of one vehicle [m/s]. Trackers that see a
vehicle twice differ in its position, by less than its length, not in the way that it goes."""

MIN_COMMON_SHARE = 0.5
"""Two tracks are one vehicle seen twice if they have at least this share of the shorter one in
common. If they have less, a tracker changed the id on the way, and both are needed."""

_MAX_PAIRS = 1 << 20  # Pairs of tracks that are compared at a time, to keep memory small.


def examine(recording: Recording, *, needed: Mask | None = None) -> Recording:
    """Check sizes, then leave out vehicles that the recording has under a second id.

    Args:
        recording: The recording.
        needed: Vehicles that are reported instead of left out, shape (vehicle,); none by default.

    Returns:
        The recording without those vehicles, with all findings.

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
    """Vehicles that are wider than long, one finding for each.

    Raises:
        ImportFormatError: Most of them are.
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
        vehicle: The longer track; of two that are equally long, the one that the file has first.
        copy: The other one.
        num_common: Number of common frames.
        num_overlapping: Number of those in which their boxes overlap.
        is_whole: Whether the copy has most of its frames in common with the other track.
    """

    vehicle: int
    copy: int
    num_common: int
    num_overlapping: int
    is_whole: bool


def find_duplicates(tracks: Tracks) -> list[DuplicatePair]:
    """Pairs of tracks on one carriageway that are one vehicle, in order of the longer track."""
    duplicates: list[DuplicatePair] = []
    for first, second in zip(*_overlapping_at_first(tracks), strict=True):
        pair = _compare(tracks, int(first), int(second))
        if pair is not None:
            duplicates.append(pair)
    count = np.diff(tracks.start)
    return sorted(duplicates, key=lambda pair: (-int(count[pair.vehicle]), pair.vehicle, pair.copy))


def _overlapping_at_first(tracks: Tracks) -> tuple[I64, I64]:
    """Pairs of tracks whose boxes overlap in the first frame that they have in common.

    That frame is the first one of either track, so each track is compared in its first frame with
    those that are there. Tracks are looked up by spans of time, so that the effort grows with the
    number of rows.
    """
    count = tracks.num_vehicles
    first, last, carriageway = tracks.first, tracks.last, tracks.carriageway
    if count < 2:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    span = max(1, int(np.diff(tracks.start).mean()))  # In frames.
    origin = int(first.min())
    num_spans = (int(last.max()) - origin) // span + 1
    base = (carriageway - carriageway.min()) * num_spans
    first_span, last_span = (first - origin) // span, (last - origin) // span
    num_entries = last_span - first_span + 1
    entry_track = np.repeat(np.arange(count), num_entries)
    within = np.arange(len(entry_track)) - np.repeat(
        np.cumsum(num_entries) - num_entries, num_entries
    )
    entry_key = (base + first_span)[entry_track] + within
    order = np.argsort(entry_key, kind="stable")
    entry_key, entry_track = entry_key[order], entry_track[order]
    key = base + first_span
    low = np.searchsorted(entry_key, key, side="left")
    num_near = np.searchsorted(entry_key, key, side="right") - low
    ends = np.cumsum(num_near)
    pairs: list[tuple[I64, I64]] = []
    begin = 0
    while begin < count:
        passed = int(ends[begin - 1]) if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, passed + _MAX_PAIRS, side="right")))
        part = np.arange(begin, end)
        track = np.repeat(part, num_near[part])
        offset = np.arange(len(track)) - np.repeat(
            np.cumsum(num_near[part]) - num_near[part], num_near[part]
        )
        other = entry_track[low[track] + offset]
        # Of two tracks that begin together, the pair counts once.
        is_there = (first[other] < first[track]) | (
            (first[other] == first[track]) & (other < track)
        )
        is_there &= last[other] >= first[track]
        track, other = track[is_there], other[is_there]
        row = tracks.start[track]
        other_row = tracks.start[other] + first[track] - first[other]
        is_near = _overlaps(tracks, track, other, row, other_row)
        pairs.append((other[is_near], track[is_near]))
        begin = end
    earlier, later = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return earlier, later


def _overlaps(
    tracks: Tracks, first: I64 | int, second: I64 | int, first_row: I64, second_row: I64
) -> Mask:
    """Whether the boxes of two vehicles overlap in some rows, in the axes of the road."""
    length = 0.5 * (tracks.length[first] + tracks.length[second])
    width = 0.5 * (tracks.width[first] + tracks.width[second])
    is_along = np.abs(tracks.s[first_row] - tracks.s[second_row]) < length
    overlaps: Mask = is_along & (np.abs(tracks.d[first_row] - tracks.d[second_row]) < width)
    return overlaps


def _compare(tracks: Tracks, first: int, second: int) -> DuplicatePair | None:
    """The pair, None if these tracks are two vehicles."""
    begin = max(int(tracks.first[first]), int(tracks.first[second]))
    num_common = min(int(tracks.last[first]), int(tracks.last[second])) - begin + 1
    rows, other_rows = (
        np.arange(num_common) + tracks.row(track, begin) for track in (first, second)
    )
    num_overlapping = int(_overlaps(tracks, first, second, rows, other_rows).sum())
    if num_overlapping <= MIN_OVERLAP * num_common:
        return None
    difference = float(tracks.speed[rows].mean() - tracks.speed[other_rows].mean())
    if abs(difference) > MAX_SPEED_DIFFERENCE:
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
