"""Surrogate measures of safety: how near it came, at its worst and at each phase."""

from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.instants import I32, METRES, U8, Index, at, half_lengths, slot_of
from overtaking.labels.law.distances import margin_of_gap, sure_decel
from overtaking.labels.law.frames import Span, conduct, stretches
from overtaking.labels.signals import encounter
from overtaking.model.batch import Batch
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.safety import MOMENTS, Encounter, Safety
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role
from overtaking.world.constants import known
from overtaking.world.friction import stopping_distance
from overtaking.world.measures import headway, picud, rss_longitudinal

B = TypeVar("B", Encounter, "_Margins")

_ENTERED = {
    "attempt": (Around.LEFT_LEADER, Around.LEFT_FOLLOWER),
    "line_crossed": (Around.LEFT_LEADER, Around.LEFT_FOLLOWER),
    "return_begin": (Around.RIGHT_LEADER, Around.RIGHT_FOLLOWER),
}
"""Who is ahead and behind in the lane that the ego moves into."""


def safety_measures(case: Case) -> Safety:
    """The measures of a batch: over the manoeuvre, and at the events of the overtake.

    The manoeuvre is the window of the law: from 3 s before the attempt to 3 s after its end, or all
    that was driven where nothing was attempted.
    """
    span = conduct(case)
    worst = _manoeuvre(case, span)
    at_events = _at_events(case)
    start, count = np.where(span.exists, span.start, NEVER), case.signals.num_simulations
    margins = _joined(worst.margins, at_events.margins, at_events.cells, count)
    return Safety(
        frame=np.column_stack([start, _frames(case)]).astype(np.int32),
        close_share=worst.close_share,
        time_exposed=worst.time_exposed,
        time_integrated=worst.time_integrated,
        entry_encroachment=entry_encroachment(case),
        return_encroachment=return_encroachment(case),
        front=_joined(worst.front, at_events.front, at_events.cells, count),
        rear=_joined(worst.rear, at_events.rear, at_events.cells, count),
        entered_front=_joined(None, at_events.entered_front, at_events.entered_cells, count),
        entered_rear=_joined(None, at_events.entered_rear, at_events.entered_cells, count),
        **{field.name: getattr(margins, field.name) for field in fields(_Margins)},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Margins(Batch):
    """The measures beside encounters, as in `Safety`; arrays of one shape."""

    headway: F32
    picud: F32
    rss_margin: F32
    lawful_margin: F32
    stop_margin_lit: F32
    stop_margin_unlit: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class _Events(Batch):
    """What is measured at the events that came, arrays of shape (instant,).

    Attributes:
        front: The vehicle ahead.
        rear: The vehicle behind.
        margins: Beside these.
        entered_front: The vehicle ahead in a lane that is entered, at fewer instants.
        entered_rear: The one behind in it, at the same.
        cells: Which cells of a table (simulation, moment) these are, moments adjacent.
        entered_cells: The same of those at which a lane is entered.
    """

    front: Encounter
    rear: Encounter
    margins: _Margins
    entered_front: Encounter
    entered_rear: Encounter
    cells: Index
    entered_cells: Index


@dataclass(frozen=True, slots=True, kw_only=True)
class _Worst(Batch):
    """What is measured over the manoeuvre, arrays of shape (simulation,)."""

    front: Encounter
    rear: Encounter
    margins: _Margins
    close_share: F32
    time_exposed: F32
    time_integrated: F32


def _frames(case: Case) -> NDArray[np.int32]:
    """Frames of the events, `NEVER` where they did not come, shape (simulation, event)."""
    return np.column_stack([getattr(case.events, name) for name in MOMENTS[1:]])


def _at_events(case: Case) -> _Events:
    frame = _frames(case)
    rows, event = np.nonzero(frame != NEVER)  # Most events do not come.
    frames = frame[rows, event].astype(np.intp)
    ahead, behind = _entered_places()
    enters = np.isin(MOMENTS[1:], list(_ENTERED))[event]
    entered = rows[enters], frames[enters]
    front = encounter(case, Around.LEADER, rows, frames)
    cells = rows * len(MOMENTS) + event + 1  # The manoeuvre is the first moment.
    return _Events(
        front=front,
        rear=encounter(case, Around.FOLLOWER, rows, frames),
        margins=_Margins(**front_margins(case, front, rows, frames), **_stops(case, rows, frames)),
        entered_front=encounter(case, ahead[event[enters]], *entered),
        entered_rear=encounter(case, behind[event[enters]], *entered),
        cells=cells,
        entered_cells=cells[enters],
    )


def _entered_places() -> tuple[Index, Index]:
    """Places ahead and behind in the lane that is entered, by event; any where there is none."""
    nobody = (Around.LEADER, Around.FOLLOWER)
    pairs = np.array([_ENTERED.get(name, nobody) for name in MOMENTS[1:]], np.intp)
    return pairs[:, 0], pairs[:, 1]


def _manoeuvre(case: Case, span: Span) -> _Worst:
    """The worst of each measure over the frames of a span."""
    answers = stretches(case)
    found = answers.worst
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    lasted, never = np.maximum(span.stop - span.start + 1, 1), np.float32(np.inf)
    return _Worst(
        front=_encounter(found, "front"),
        rear=_encounter(found, "rear"),
        margins=_Margins(
            headway=found["headway"],
            picud=found["picud"],
            rss_margin=found["rss_margin"],
            lawful_margin=found["lawful_margin"],
            stop_margin_lit=np.where(span.exists, answers.stop_lit.low, never),
            stop_margin_unlit=np.where(span.exists, answers.stop_unlit.low, never),
        ),
        close_share=found["num_close"] / as_f32(lasted),
        time_exposed=found["num_critical"] * interval,
        time_integrated=found["shortfall"] * interval,
    )


def _encounter(found: dict[str, F32], side: str) -> Encounter:
    """The worst of an encounter out of all measures."""
    values: dict[str, Any] = {
        field.name: found[f"{side}.{field.name}"] for field in fields(Encounter)
    }
    values["valid"] = values["valid"] > 0
    return Encounter(**values)


def _stops(case: Case, rows: Index, frames: Index) -> dict[str, F32]:
    """Sight minus stopping distance at some instants, as in L14 and L14s."""
    seen = case.signals
    return stop_margins(
        seen.speed[rows, frames],
        seen.friction[rows, frames],
        seen.sight_lit[rows, frames],
        seen.sight_unlit[rows, frames],
    )


def _joined(worst: B | None, at_events: B, cells: Index, count: int) -> B:
    """Both in tables (simulation, moment): the manoeuvre first, then the events; 0 elsewhere."""

    def joined(name: str) -> NDArray[Any]:
        values = getattr(at_events, name)
        whole = np.zeros((count, len(MOMENTS)), values.dtype)
        whole.reshape(-1)[cells] = values
        if worst is not None:
            whole[:, 0] = getattr(worst, name)
        return whole

    return at_events.replace(**{f.name: joined(f.name) for f in fields(at_events)})


def entry_encroachment(case: Case) -> F32:
    """PET of entering the lane on the left.

    From the frame in which the ego crosses the line to the arrival of the vehicle behind in that
    lane at the place where the ego's rear bumper was then, shape (simulation,) [s]. 0 alongside;
    infinite where nobody is behind, or it does not arrive in that lane within the recording.

    Source:
        Allen, Shin, Cooper (1978), Analysis of traffic conflicts and collisions.
    """
    frame = case.events.line_crossed
    row = np.arange(len(frame))
    behind = case.signals.vehicle[row, Around.LEFT_FOLLOWER, np.maximum(frame, 0)]
    lane = at(case.signals.lane, frame) + np.uint8(1)
    return _encroachment(case, behind, frame, lane, stretches(case).entry_arrival)


def return_encroachment(case: Case) -> F32:
    """PET of the return: of the overtaken vehicle, from `return_end`; as `entry_encroachment`."""
    events, arrival = case.events, stretches(case).return_arrival
    return _encroachment(case, events.target, events.return_end, events.original_lane, arrival)


def _encroachment(case: Case, vehicle: U8, frame: I32, lane: U8, arrival: I32) -> F32:
    """Time until the front of a vehicle is in a lane where the ego's rear is at a frame."""
    rows = np.flatnonzero((vehicle != NO_VEHICLE) & (frame != NEVER))
    time = np.full(len(frame), np.inf, np.float32)
    slot, begin, found = slot_of(vehicle[rows]), frame[rows], arrival[rows]
    first = np.maximum(found, begin)
    in_lane = case.trajectories.states.lane[rows, slot, first] == lane[rows]
    # Between two frames both drive on evenly.
    before = np.maximum(first - 1, begin)
    missing = -_past(case, rows, slot, begin, before)
    step = _past(case, rows, slot, begin, first) + missing
    part = np.maximum(missing, np.float32(0.0)) / np.where(step > 0, step, np.float32(1.0))
    frames = as_f32(before - begin) + part
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    time[rows] = np.where((found != NEVER) & in_lane, frames * interval, np.float32(np.inf))
    return time


def _past(case: Case, rows: Index, slot: Index, begin: I32, frame: I32) -> F32:
    """How far a front bumper is past the place of the ego's rear bumper at an earlier frame [m].

    Args:
        case: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        begin: When the ego's rear bumper was there.
        frame: When the front bumper is looked at.
    """
    s = case.trajectories.states.s
    way = as_f32(s[rows, slot, frame] - s[rows, Role.EGO, begin]) * METRES
    return way + half_lengths(case.trajectories, rows, slot)


def front_margins(case: Case, front: Encounter, rows: Index, frames: Index) -> dict[str, F32]:
    """What else there is to say of the vehicle ahead."""
    seen = case.signals
    speed, slot = seen.speed[rows, frames], slot_of(seen.vehicle[rows, Around.LEADER, frames])
    length = case.trajectories.scenario.vehicles.length[rows, slot]
    lead_speed = speed - front.closing_speed
    decel = known("labels.safety.picud_decel")
    safe = rss_longitudinal(
        speed,
        lead_speed,
        reaction_time=known("law.rss.reaction_time"),
        accel=known("law.rss.accel"),
        rear_decel=known("law.rss.rear_decel"),
        lead_decel=known("law.rss.lead_decel"),
    )
    return {
        "headway": headway(front.gap, length, speed),
        "picud": picud(
            front.gap,
            speed,
            lead_speed,
            reaction_time=known("labels.safety.picud_reaction_time"),
            rear_decel=decel,
            lead_decel=decel,
        ),
        "rss_margin": front.gap - safe,
        "lawful_margin": margin_of_gap(
            front.gap, speed, front.closing_speed, sure_decel(seen.friction[rows, frames])
        ),
    }


def stop_margins(speed: F32, friction: F32, lit: F32, unlit: F32) -> dict[str, F32]:
    """Distance at which something is seen minus the stopping distance [m].

    Args:
        speed: Of the ego [m/s].
        friction: Peak friction under it, same shape [1].
        lit: Distance at which a lit vehicle is seen, same shape [m].
        unlit: Distance at which an unlit one is seen, same shape [m].
    """
    # Beyond the end of a recording there is no friction, and none of this counts.
    grip = np.maximum(friction, known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    stop = stopping_distance(speed, as_f32(known("law.sight.reaction_time")), decel)
    return {"stop_margin_lit": lit - stop, "stop_margin_unlit": unlit - stop}
