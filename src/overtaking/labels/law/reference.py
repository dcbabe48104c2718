"""Margins over stretches of frames as a person reads them.

`crates/overtaking-core/src/stretches.rs` is the fast twin, and `labels.law.engine` its Python.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.law.distances import lawful_gap, margin_of_gap, sure_decel
from overtaking.labels.law.frames import (
    ENDLESS,
    Span,
    Stretch,
    driving_end,
    ends_in,
    frames_of,
    lowest,
    reduced,
    stretch,
    stretch_of_instants,
    time_to_regain,
)
from overtaking.labels.law.room import slow_lane_room
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.world.constants import known
from overtaking.world.friction import stopping_distance
from overtaking.world.measures import drac

Index = NDArray[np.intp]
I32 = NDArray[np.int32]


def stop_margin(case: Case, sight: F32, span: Span) -> Stretch:
    """Distance that is seen minus the stopping distance [m].

    Args:
        case: The batch.
        sight: Shape (simulation, time) [m].
        span: Where it counts.
    """
    return stretch(stop_margins(case, sight), span)


def stop_margins(case: Case, sight: F32) -> F32:
    """Distance that is seen minus the stopping distance, shape (simulation, time) [m]."""
    seen = case.signals
    # Beyond the end of a recording there is no friction, and none of this counts.
    grip = np.maximum(seen.friction, known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    stop = stopping_distance(seen.speed, as_f32(known("law.sight.reaction_time")), decel)
    return sight - stop


def follow_margin(case: Case, span: Span) -> Stretch:
    """Gap to the leader minus the lawful gap, but for 3 s after it cut in [m]."""
    return stretch(follow_margins(case), span)


def follow_margins(case: Case) -> F32:
    """The same frame by frame, `ENDLESS` where it does not count; shape (simulation, time) [m]."""
    seen, place = case.signals, Around.LEADER
    margin = margin_of_gap(
        seen.gap[:, place], seen.speed, seen.closing_speed[:, place], sure_decel(seen.friction)
    )
    np.copyto(margin, ENDLESS, where=seen.vehicle[:, place] == NO_VEHICLE)
    margin[recapturing(case)] = ENDLESS
    return margin


def recapturing(case: Case) -> tuple[Index, Index]:
    """Simulations and frames in which the present leader has cut in less than 3 s ago."""
    vehicle = case.signals.vehicle[:, Around.LEADER]
    row, frame = _cut_ins(case, vehicle)
    since = np.arange(time_to_regain(case) + 1)
    frames = np.minimum(frame[:, None] + since, vehicle.shape[1] - 1)
    rows = np.broadcast_to(row[:, None], frames.shape)
    same = vehicle[rows, frames] == vehicle[row, frame][:, None]
    return rows[same], frames[same]


def _cut_ins(case: Case, vehicle: NDArray[np.uint8]) -> tuple[Index, Index]:
    """Where a vehicle from another lane has become the leader of an ego that kept its own."""
    lane = case.signals.lane
    new = (vehicle[:, 1:] != vehicle[:, :-1]) & (vehicle[:, 1:] != NO_VEHICLE)
    row, before = np.nonzero(new & (lane[:, 1:] == lane[:, :-1]))
    place = (row, vehicle[row, before + 1], before)
    came = case.trajectories.states.lane[place] != lane[row, before]
    if case.trajectories.present is not None:
        came &= case.trajectories.present[place]
    return row[came], before[came] + 1


def duty_to_return(case: Case, span: Span) -> tuple[I32, I32]:
    """The longest run of frames of a span in which the ego could have returned.

    Returns:
        Its first frame, `NEVER` without one, and its number of frames, shape (simulation,).
    """
    events, seen = case.events, case.signals
    rows, frames = span.frames()
    lane = seen.lane[rows, frames]
    away = (lane != events.original_lane[rows]) & (lane < case.trajectories.road.num_lanes)
    rows, frames = _behind(case, rows[away], frames[away])
    due = slow_lane_room(case, rows, frames) >= 0
    first, length = longest_run(rows[due], frames[due], seen.num_simulations)
    return first.astype(np.int32), length.astype(np.int32)


def of_target(case: Case, span: Span) -> dict[str, NDArray[Any]]:
    """Some signals of the target in the frames of a span; see `labels.law.engine.of_target`."""
    names, at = ("overlaps", "lane", "lateral_gap", "accel"), span.frames()
    return {name: getattr(case.target, name)[at] for name in names}


def below(values: F32, limit: F32, span: Span) -> Stretch:
    """Smallest of `values` in a span, and the frames with less than a limit."""
    rows = np.arange(len(values))
    first, last = ends_in(span, rows, values < limit[:, None])
    return Stretch(low=lowest(values, span), first=first, last=last)


def above(values: F32, limit: F32, span: Span) -> Stretch:
    """Largest of `values` in a span as `low`, and the frames with more than a limit."""
    rows = np.arange(len(values))
    first, last = ends_in(span, rows, values > limit[:, None])
    return Stretch(low=reduced(np.maximum, values, span), first=first, last=last)


def dark(case: Case, crossed: I32, bit: int) -> tuple[I32, I32, I32]:
    """Frames around a crossing in which a lamp of the ego is not on, as Article 21 asks.

    Args:
        case: The batch.
        crossed: Frame of the crossing of each simulation, `NEVER` without one.
        bit: The lamp, one of `Lights`.

    Returns:
        Their number, the first and the last, `NEVER` without one; shape (simulation,).
    """
    before = frames_of(case, known("law.signal.before"))
    after = frames_of(case, known("law.signal.after"))
    frame = crossed[:, None] + np.arange(-before, after + 1, dtype=np.int32)
    end = driving_end(case)[:, None]
    asked = (crossed != NEVER)[:, None] & (frame >= case.events.first[:, None]) & (frame <= end)
    lights = case.trajectories.states.lights[:, Role.EGO]
    shown = np.take_along_axis(lights, np.clip(frame, 0, lights.shape[1] - 1), axis=1)
    found = asked & ((shown & bit) == 0)
    row, last = np.arange(len(crossed)), found.shape[1] - 1 - found[:, ::-1].argmax(axis=1)
    some = found.any(axis=1)
    ends = (frame[row, found.argmax(axis=1)], frame[row, last])
    first, last = (np.where(some, each, NEVER) for each in ends)
    return found.sum(axis=1, dtype=np.int32), first, last


def longest_run(rows: Index, frames: Index, num_simulations: int) -> tuple[Index, Index]:
    """Longest run of consecutive frames of each simulation: first frame and number of frames.

    Args:
        rows: Simulation of each frame, in order.
        frames: The frames, in order within each simulation.
        num_simulations: Length of the results.
    """
    first, length = np.full(num_simulations, int(NEVER)), np.zeros(num_simulations, np.intp)
    if rows.size:
        begins = np.ones(rows.size, np.bool_)
        begins[1:] = (rows[1:] != rows[:-1]) | (frames[1:] != frames[:-1] + 1)
        start = np.flatnonzero(begins)
        size = np.diff(start, append=rows.size)
        # Stable, so that of runs of one length the last stays, and then the first is asked for.
        order = np.argsort(size[::-1], kind="stable")
        best = start[::-1][order]
        length[rows[best]], first[rows[best]] = size[::-1][order], frames[best]
    return first, length


def _behind(case: Case, rows: Index, frames: Index) -> tuple[Index, Index]:
    """Those of single frames in which the target is far enough behind."""
    seen, target, here = case.signals, case.target, (rows, frames)
    speed = target.speed[here]
    lawful = lawful_gap(speed, speed - seen.speed[here], sure_decel(seen.friction[here]))
    wanted = np.maximum(known("law.return.time_gap") * speed, lawful)
    enough = (target.lead[here] > 0) & (target.gap[here] >= wanted)
    return rows[enough], frames[enough]


def braking_margin(case: Case, span: Span) -> Stretch:
    """Braking that is allowed minus what is forced on the follower after a lane change [m/s^2]."""
    rows, frames = _after_changes(case, span)
    place = Around.FOLLOWER
    there = case.signals.vehicle[rows, place, frames] != NO_VEHICLE
    rows, frames = rows[there], frames[there]
    gap, closing = (
        of[rows, place, frames] for of in (case.signals.gap, case.signals.closing_speed)
    )
    forced = np.minimum(drac(gap, closing), known("law.obstruction.most"))
    margin = known("law.obstruction.braking") - forced
    return stretch_of_instants(margin, rows, frames, case.signals.num_simulations)


def _after_changes(case: Case, span: Span) -> tuple[Index, Index]:
    """Simulations and frames within 3 s after a change of lane, in a span."""
    lane = case.signals.lane
    row, before = np.nonzero(lane[:, 1:] != lane[:, :-1])
    inside = (before + 1 >= span.start[row]) & (before < span.stop[row])
    row, begin = row[inside], before[inside] + 1
    # Until the next change of the same simulation, so that no frame comes twice.
    following = np.append(np.where(row[1:] == row[:-1], begin[1:], 2**31 - 1), 2**31 - 1)[
        : row.size
    ]
    end = begin + frames_of(case, known("law.obstruction.duration"))
    stop = np.minimum(np.minimum(end, following - 1), span.stop[row])
    which, frames = Span(start=begin.astype(np.int32), stop=stop.astype(np.int32)).frames()
    return row[which], frames
