"""Tracks smoothed by symmetric exponential moving averages.

Noise of positions grows when they are differentiated, so speeds and accelerations come from
differences of the recorded positions and are smoothed on their own, over longer times.

Source:
    Thiemann, Treiber and Kesting (2008), section 2, made for NGSIM.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from overtaking.core.arrays import F64, I64
from overtaking.knowledge.toml_reader import number
from overtaking.recordings.recording import Recording, bending, lane_codes

_MOVES = 0.5  # Below this speed a movement has no reliable direction [m/s].


def smoothed(recording: Recording) -> Recording:
    """A recording with smooth positions, and speeds, directions and accelerations made of them."""
    tracks, interval = recording.tracks, recording.frame_interval_ms * 1e-3
    average, rate = partial(moving_average, start=tracks.start), partial(_rate, start=tracks.start)
    times = {name: _known(name) / interval for name in ("position", "speed", "accel")}
    stretch, turning = bending(recording.road, tracks.s, tracks.d)
    along, left = rate(tracks.s) / interval * stretch, rate(tracks.d) / interval
    turn = turning * along
    push, pull = rate(along) / interval - turn * left, rate(left) / interval + turn * along
    s, d, x, y = (average(each, width=times["position"]) for each in (
        tracks.s, tracks.d, tracks.x, tracks.y))  # fmt: skip
    along, left = (average(each, width=times["speed"]) for each in (along, left))
    push, pull = (average(each, width=times["accel"]) for each in (push, pull))
    angle = np.where(np.hypot(along, left) > _MOVES, np.arctan2(left, along), 0.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    made = replace(
        tracks,
        x=x,
        y=y,
        s=s,
        d=d,
        speed=np.hypot(along, left),
        heading=recording.road.heading_at(s) + angle,
        accel_lon=push * cosine + pull * sine,
        accel_lat=pull * cosine - push * sine,
        lane=lane_codes(recording.road, d),
    )
    seconds = {name: _known(name) for name in times}
    return replace(recording, tracks=made, notes={**recording.notes, "smoothing_s": seconds})


def moving_average(values: F64, *, start: I64, width: float) -> F64:
    """Symmetric exponential moving averages within tracks.

    Args:
        values: Shape (row,).
        start: First row of each track, and the number of rows, shape (track + 1,).
        width: Number of rows in which a weight falls to 1/e.

    Returns:
        The weighted means of up to three widths to either side, as many on both; at the ends of a
        track the values themselves.
    """
    row, count = np.arange(len(values)), np.diff(start)
    to_end = np.minimum(row - np.repeat(start[:-1], count), np.repeat(start[1:] - 1, count) - row)
    total, weights = values.copy(), np.ones(len(values))
    for step in range(1, int(_known("reach") * width) + 1):
        here = np.flatnonzero(to_end >= step)
        if not len(here):
            break
        weight = np.exp(-step / width)
        total[here] += weight * (values[here - step] + values[here + step])
        weights[here] += 2.0 * weight
    return total / weights


def _rate(values: F64, *, start: I64) -> F64:
    """Central differences per row within tracks, one-sided at the ends, 0 for a single row."""
    row, count = np.arange(len(values)), np.diff(start)
    later = np.minimum(row + 1, np.repeat(start[1:] - 1, count))
    earlier = np.maximum(row - 1, np.repeat(start[:-1], count))
    return (values[later] - values[earlier]) / np.maximum(later - earlier, 1)


def _known(name: str) -> float:
    return number(f"event_detection.smoothing.{name}")
