"""Surrogate measures of safety of each simulation, also against oncoming traffic."""

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    MIN_CLOSING_SPEED,
    conduct,
    next_oncomer,
    on_the_other_side,
    seconds_of,
    stretches,
)
from overtaking.labels.law.safe_distance import margin_of_gap, stop_margins, sure_decel
from overtaking.labels.law.sight import shown_sight, unseen_speed
from overtaking.labels.signals import encounter
from overtaking.labels.snapshots import METRES, Span, at, half_lengths, slot_of
from overtaking.model.batch import batch_fields
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import (
    MEASURED_MOMENTS,
    Encounter,
    PassingSafety,
    SafetyMeasures,
)
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Case
from overtaking.world.surrogate_safety import picud, rss_safe_gap, time_headway

_LEFT = (NeighbourRole.LEFT_LEADER, NeighbourRole.LEFT_FOLLOWER)

_RIGHT = (NeighbourRole.RIGHT_LEADER, NeighbourRole.RIGHT_FOLLOWER)

_INTO = {"attempt": _LEFT, "line_crossed": _LEFT, "return_begin": _RIGHT}
"""The vehicles ahead and behind in the lane that the ego moves into."""

_ENTERS = np.array([name in _INTO for name in MEASURED_MOMENTS[1:]])

_ENTERED = np.array([_INTO.get(name, _LEFT) for name in MEASURED_MOMENTS[1:]], np.intp)
"""The same by event: whether a lane is entered, and these places, shape (event, 2)."""


def safety_measures(case: Case) -> SafetyMeasures:
    """The measures of a batch: over the manoeuvre, and at the events of the overtake.

    The manoeuvre is the window of the law: from 3 s before the attempt to 3 s after its end, or all
    that was driven where nothing was attempted.
    """
    span, seen = conduct(case), case.signals
    worst = _worst(case, span)
    frame = np.column_stack([getattr(case.events, name) for name in MEASURED_MOMENTS[1:]])
    rows, event = np.nonzero(frame != NEVER)  # Most events do not come.
    frames = frame[rows, event].astype(np.intp)
    cells = rows * len(MEASURED_MOMENTS) + event + 1  # The manoeuvre is the first moment.
    enters = np.flatnonzero(_ENTERS[event])
    ahead, behind = _ENTERED[event[enters]].T
    entered, own = (rows[enters], frames[enters]), (rows, frames)
    leader = encounter(case, NeighbourRole.LEADER, *own)
    margins = leader_margins(case, leader, *own) | stop_margins(
        seen.speed[own], seen.friction[own], seen.sight_lit[own], seen.sight_unlit[own]
    )

    def table(name: str, values: NDArray[Any], cells: IndexArray) -> NDArray[Any]:
        """A measure as a table (simulation, moment): its worst, and at events; 0 elsewhere."""
        whole = np.zeros((seen.num_simulations, len(MEASURED_MOMENTS)), values.dtype)
        whole.reshape(-1)[cells] = values
        whole[:, 0] = worst.get(name, 0)
        return whole

    def tables(name: str, encounter: Encounter, cells: IndexArray) -> Encounter:
        """The same of the measures of an encounter."""
        names = [measure.name for measure in fields(encounter)]
        return Encounter(
            **{
                measure: table(f"{name}.{measure}", getattr(encounter, measure), cells)
                for measure in names
            }
        )

    return SafetyMeasures(
        frame=np.column_stack([np.where(span.exists, span.start, NEVER), frame]).astype(np.int32),
        leader=tables("leader", leader, cells),
        follower=tables("follower", encounter(case, NeighbourRole.FOLLOWER, *own), cells),
        new_leader=tables("entered", encounter(case, ahead, *entered), cells[enters]),
        new_follower=tables("entered", encounter(case, behind, *entered), cells[enters]),
        **{name: table(name, values, cells) for name, values in margins.items()},
        **{name: worst[name] for name in ("share_below_safe_distance", "tet", "tit")},
        entry_pet=entry_pet(case),
        return_pet=return_pet(case),
        oncoming=oncoming_measures(case),
    )


def _worst(case: Case, span: Span) -> dict[str, F32]:
    """The worst of each measure over the frames of a span, shape (simulation,)."""
    found, never = stretches(case), np.float32(np.inf)
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    lasted = np.maximum(span.stop - span.start + 1, 1)
    return found.worst | {
        "stop_margin_lit": np.where(span.exists, found.stop_lit.low, never),
        "stop_margin_unlit": np.where(span.exists, found.stop_unlit.low, never),
        "share_below_safe_distance": found.worst["num_close"] / as_f32(lasted),
        "tet": found.worst["num_critical"] * interval,
        "tit": found.worst["shortfall"] * interval,
    }


def entry_pet(case: Case) -> F32:
    """PET of entering the lane on the left.

    From the frame in which the ego crosses the line to the arrival of the vehicle behind in that
    lane at the place where the ego's rear bumper was then, shape (simulation,) [s]. 0 alongside;
    infinite without a vehicle behind, or if it does not arrive in that lane within the recording.

    Source:
        Allen, Shin, Cooper (1978), Analysis of traffic conflicts and collisions.
    """
    frame = case.events.line_crossed
    row = np.arange(len(frame))
    behind = case.signals.neighbour_slot[row, NeighbourRole.LEFT_FOLLOWER, np.maximum(frame, 0)]
    lane = at(case.signals.lane, frame) + np.uint8(1)
    return _post_encroachment_time(case, behind, frame, lane, stretches(case).entry_arrival)


def return_pet(case: Case) -> F32:
    """PET of the return: of the overtaken vehicle, from `return_end`; as `entry_pet`."""
    events, arrival = case.events, stretches(case).return_arrival
    return _post_encroachment_time(
        case, events.target_slot, events.return_end, events.original_lane, arrival
    )


def _post_encroachment_time(case: Case, vehicle: U8, frame: I32, lane: U8, arrival: I32) -> F32:
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


def _past(case: Case, rows: IndexArray, slot: IndexArray, begin: I32, frame: I32) -> F32:
    """How far a front bumper is past the place of the ego's rear bumper at an earlier frame [m].

    Args:
        case: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        begin: When the ego's rear bumper was there.
        frame: When the front bumper is looked at.
    """
    s = case.trajectories.states.s
    way = as_f32(s[rows, slot, frame] - s[rows, EGO_SLOT, begin]) * METRES
    return way + half_lengths(case.trajectories, rows, slot)


def leader_margins(
    case: Case, leader: Encounter, rows: IndexArray, frames: IndexArray
) -> dict[str, F32]:
    """Further measures of the vehicle ahead."""
    seen = case.signals
    speed, slot = (
        seen.speed[rows, frames],
        slot_of(seen.neighbour_slot[rows, NeighbourRole.LEADER, frames]),
    )
    length = case.trajectories.scenario.vehicles.length[rows, slot]
    leader_speed = speed - leader.closing_speed
    decel = constant("event_detection.safety.picud_decel")
    safe = rss_safe_gap(
        speed,
        leader_speed,
        reaction_time=constant("law.rss.reaction_time"),
        accel=constant("law.rss.accel"),
        follower_decel=constant("law.rss.rear_decel"),
        leader_decel=constant("law.rss.lead_decel"),
    )
    return {
        "time_headway": time_headway(leader.gap, length, speed),
        "picud": picud(
            leader.gap,
            speed,
            leader_speed,
            reaction_time=constant("event_detection.safety.picud_reaction_time"),
            follower_decel=decel,
            leader_decel=decel,
        ),
        "rss_margin": leader.gap - safe,
        "lawful_margin": margin_of_gap(
            leader.gap, speed, leader.closing_speed, sure_decel(seen.friction[rows, frames])
        ),
    }


_NONE = np.float32(np.nan)


def oncoming_measures(case: Case) -> PassingSafety:
    """The measures of a batch."""
    if not case.trajectories.road.is_two_way:
        return _nothing(case.signals.num_simulations)
    out = on_the_other_side(case)
    began, ended = (np.where(out.exists, each, NEVER) for each in (out.start, out.stop))
    abreast = np.where(out.exists, case.events.overlap_begin, NEVER)
    gap_at_crossing, time_at_crossing = _meeting(case, began)
    gap_abreast, time_abreast = _meeting(case, abreast)
    gap_at_return, time_at_return = _meeting(case, ended)
    begin = np.maximum(began, 0)
    own, sight = at(case.signals.speed, begin), shown_sight(case, begin)
    unseen = sight / np.maximum(own + unseen_speed(case, begin), MIN_CLOSING_SPEED)
    return PassingSafety(
        was_in_opposing_lane=out.exists,
        gap_at_crossing=gap_at_crossing,
        time_to_meet_at_crossing=time_at_crossing,
        gap_abreast=gap_abreast,
        time_to_meet_abreast=time_abreast,
        gap_at_return=gap_at_return,
        time_to_meet_at_return=time_at_return,
        min_time_to_meet=_min_time_to_meet(case),
        sight_at_crossing=_known(out.exists, sight),
        time_in_opposing_lane=_known(
            out.exists, seconds_of(case, np.maximum(out.stop - out.start, 0))
        ),
        time_available=_known(out.exists, np.fmin(time_at_crossing, unseen)),
        was_aborted=case.events.abort != NEVER,
    )


def _nothing(count: int) -> PassingSafety:
    """Nothing measured in any simulation."""
    empty: dict[str, Any] = {
        name: np.zeros(count, np.bool_) if field.is_flag else np.full(count, _NONE)
        for name, field in batch_fields(PassingSafety).items()
    }
    return PassingSafety(**empty)


def _known(where: Mask, values: F32) -> F32:
    return np.where(where, values, _NONE).astype(np.float32)


def _meeting(case: Case, frame: I32, rows: IndexArray | None = None) -> tuple[F32, F32]:
    """Gap to who comes next [m], and the time to meet [s]; arguments as of `next_oncomer`."""
    gap, both, _ = next_oncomer(case, frame, rows)
    return gap, np.maximum(gap, np.float32(0.0)) / both


def _min_time_to_meet(case: Case) -> F32:
    """Smallest time to meet over all frames in the opposing lane, shape (simulation,) [s]."""
    rows, frames = on_the_other_side(case).frames()
    _, times = _meeting(case, frames.astype(np.int32), rows)
    least = np.full(case.signals.num_simulations, _NONE)
    np.fmin.at(least, rows, times)
    return least
