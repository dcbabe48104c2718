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
    assumed_oncoming_speed,
    available_sight,
    judged_span,
    nearest_oncoming_at,
    opposing_lane_span,
    scans,
    seconds_of,
)
from overtaking.labels.law.numbers import (
    RSS_ACCEL,
    RSS_LEADER_DECEL,
    RSS_REACTION_TIME,
    RSS_REAR_DECEL,
)
from overtaking.labels.law.safe_distance import (
    decel_for_safe_distance,
    margin_to_leader,
    stop_margins,
)
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    FrameSpan,
    at_frame,
    half_length_sum,
    slot_or_ego,
)
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

_ENTERED_NEIGHBOURS = {"attempt": _LEFT, "line_crossed": _LEFT, "return_begin": _RIGHT}
"""The vehicles ahead and behind in the lane that the ego moves into."""

_ENTERS_LANE = np.array([name in _ENTERED_NEIGHBOURS for name in MEASURED_MOMENTS[1:]])

_ENTERED_BY_EVENT = np.array(
    [_ENTERED_NEIGHBOURS.get(name, _LEFT) for name in MEASURED_MOMENTS[1:]], np.intp
)
"""The same by event: whether a lane is entered, and these places, shape (event, 2)."""


def safety_features(case: Case) -> SafetyMeasures:
    """The measures of a batch: over the manoeuvre, and at the events of the overtake.

    The manoeuvre is the window of the law: from 3 s before the attempt to 3 s after its end, or all
    that was driven where nothing was attempted.
    """
    span, signals = judged_span(case), case.signals
    worst = _worst_of_manoeuvre(case, span)
    frame = np.column_stack([getattr(case.events, name) for name in MEASURED_MOMENTS[1:]])
    rows, event = np.nonzero(frame != NEVER)  # Most events do not come.
    frames = frame[rows, event].astype(np.intp)
    cells = rows * len(MEASURED_MOMENTS) + event + 1  # The manoeuvre is the first moment.
    enters = np.flatnonzero(_ENTERS_LANE[event])
    ahead, behind = _ENTERED_BY_EVENT[event[enters]].T
    instants_of_entry, instants = (rows[enters], frames[enters]), (rows, frames)
    leader = encounters_at(case, NeighbourRole.LEADER, *instants)
    margins = leader_measures(case, leader, *instants) | stop_margins(
        signals.speed[instants],
        signals.friction[instants],
        signals.sight_lit[instants],
        signals.sight_unlit[instants],
    )

    def table(name: str, values: NDArray[Any], cells: IndexArray) -> NDArray[Any]:
        """A measure as a table (simulation, moment): its worst, and at events; 0 elsewhere."""
        by_moment = np.zeros((signals.num_simulations, len(MEASURED_MOMENTS)), values.dtype)
        by_moment.reshape(-1)[cells] = values
        by_moment[:, 0] = worst.get(name, 0)
        return by_moment

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
        frame=np.column_stack([np.where(span.is_nonempty, span.first, NEVER), frame]).astype(
            np.int32
        ),
        leader=tables("leader", leader, cells),
        follower=tables("follower", encounters_at(case, NeighbourRole.FOLLOWER, *instants), cells),
        new_leader=tables("entered", encounters_at(case, ahead, *instants_of_entry), cells[enters]),
        new_follower=tables(
            "entered", encounters_at(case, behind, *instants_of_entry), cells[enters]
        ),
        **{name: table(name, values, cells) for name, values in margins.items()},
        **{name: worst[name] for name in ("share_below_safe_distance", "tet", "tit")},
        entry_pet=entry_pet(case),
        return_pet=return_pet(case),
        oncoming=oncoming_measures(case),
    )


def _worst_of_manoeuvre(case: Case, span: FrameSpan) -> dict[str, F32]:
    """The worst of each measure over the frames of a span, shape (simulation,)."""
    results, never = scans(case), np.float32(np.inf)
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    lasted = np.maximum(span.last - span.first + 1, 1)
    return results.worst_measures | {
        "stop_margin_lit": np.where(span.is_nonempty, results.stop_lit.min_margin, never),
        "stop_margin_unlit": np.where(span.is_nonempty, results.stop_unlit.min_margin, never),
        "share_below_safe_distance": results.worst_measures["num_close"] / as_f32(lasted),
        "tet": results.worst_measures["num_critical"] * interval,
        "tit": results.worst_measures["shortfall"] * interval,
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
    lane = at_frame(case.signals.lane, frame) + np.uint8(1)
    return _post_encroachment_time(case, behind, frame, lane, scans(case).entry_arrival)


def return_pet(case: Case) -> F32:
    """PET of the return: of the overtaken vehicle, from `return_end`; as `entry_pet`."""
    events, arrival = case.events, scans(case).return_arrival
    return _post_encroachment_time(
        case, events.target_slot, events.return_end, events.original_lane, arrival
    )


def _post_encroachment_time(case: Case, vehicle: U8, frame: I32, lane: U8, arrival: I32) -> F32:
    """Time until the front of a vehicle is in a lane where the ego's rear is at a frame."""
    rows = np.flatnonzero((vehicle != NO_VEHICLE) & (frame != NEVER))
    time = np.full(len(frame), np.inf, np.float32)
    slot, begin, arrival_frame = slot_or_ego(vehicle[rows]), frame[rows], arrival[rows]
    first = np.maximum(arrival_frame, begin)
    in_lane = case.trajectories.states.lane[rows, slot, first] == lane[rows]
    # Between two frames both drive on evenly.
    frame_before = np.maximum(first - 1, begin)
    missing = -_front_beyond_place(case, rows, slot, begin, frame_before)
    step = _front_beyond_place(case, rows, slot, begin, first) + missing
    share_of_step = np.maximum(missing, np.float32(0.0)) / np.where(step > 0, step, np.float32(1.0))
    frames = as_f32(frame_before - begin) + share_of_step
    interval = np.float32(case.signals.frame_interval_ms / 1000.0)
    time[rows] = np.where((arrival_frame != NEVER) & in_lane, frames * interval, np.float32(np.inf))
    return time


def _front_beyond_place(
    case: Case, rows: IndexArray, slot: IndexArray, begin: I32, frame: I32
) -> F32:
    """How far a front bumper is past the place of the ego's rear bumper at an earlier frame [m].

    Args:
        case: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        begin: When the ego's rear bumper was there.
        frame: Frame of the front bumper.
    """
    s = case.trajectories.states.s
    distance = as_f32(s[rows, slot, frame] - s[rows, EGO_SLOT, begin]) * METRES_PER_MM
    return distance + half_length_sum(case.trajectories, rows, slot)


def leader_measures(
    case: Case, leader: Encounter, rows: IndexArray, frames: IndexArray
) -> dict[str, F32]:
    """Further measures of the vehicle ahead."""
    signals = case.signals
    speed, slot = (
        signals.speed[rows, frames],
        slot_or_ego(signals.neighbour_slot[rows, NeighbourRole.LEADER, frames]),
    )
    length = case.trajectories.scenario.vehicles.length[rows, slot]
    leader_speed = speed - leader.closing_speed
    decel = constant("event_detection.safety.picud_decel")
    safe = rss_safe_gap(
        speed,
        leader_speed,
        reaction_time=RSS_REACTION_TIME.f32,
        accel=RSS_ACCEL.f32,
        follower_decel=RSS_REAR_DECEL.f32,
        leader_decel=RSS_LEADER_DECEL.f32,
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
        "lawful_margin": margin_to_leader(
            leader.gap,
            speed,
            leader.closing_speed,
            decel_for_safe_distance(signals.friction[rows, frames]),
        ),
    }


_NAN = np.float32(np.nan)


def oncoming_measures(case: Case) -> PassingSafety:
    """The measures of a batch."""
    if not case.trajectories.road.is_two_way:
        return _no_measures(case.signals.num_simulations)
    out = opposing_lane_span(case)
    began, ended = (np.where(out.is_nonempty, event, NEVER) for event in (out.first, out.last))
    abreast = np.where(out.is_nonempty, case.events.overlap_begin, NEVER)
    gap_at_crossing, time_at_crossing = _gap_and_time_to_meet(case, began)
    gap_abreast, time_abreast = _gap_and_time_to_meet(case, abreast)
    gap_at_return, time_at_return = _gap_and_time_to_meet(case, ended)
    begin = np.maximum(began, 0)
    ego_speed, sight = at_frame(case.signals.speed, begin), available_sight(case, begin)
    unseen = sight / np.maximum(ego_speed + assumed_oncoming_speed(case, begin), MIN_CLOSING_SPEED)
    return PassingSafety(
        was_in_opposing_lane=out.is_nonempty,
        gap_at_crossing=gap_at_crossing,
        time_to_meet_at_crossing=time_at_crossing,
        gap_abreast=gap_abreast,
        time_to_meet_abreast=time_abreast,
        gap_at_return=gap_at_return,
        time_to_meet_at_return=time_at_return,
        min_time_to_meet=_min_time_to_meet(case),
        sight_at_crossing=_nan_unless(out.is_nonempty, sight),
        time_in_opposing_lane=_nan_unless(
            out.is_nonempty, seconds_of(case, np.maximum(out.last - out.first, 0))
        ),
        time_available=_nan_unless(out.is_nonempty, np.fmin(time_at_crossing, unseen)),
        was_aborted=case.events.abort != NEVER,
    )


def _no_measures(count: int) -> PassingSafety:
    """Nothing measured in any simulation."""
    empty: dict[str, Any] = {
        name: np.zeros(count, np.bool_) if field.is_flag else np.full(count, _NAN)
        for name, field in batch_fields(PassingSafety).items()
    }
    return PassingSafety(**empty)


def _nan_unless(where: Mask, values: F32) -> F32:
    return np.where(where, values, _NAN).astype(np.float32)


def _gap_and_time_to_meet(
    case: Case, frame: I32, rows: IndexArray | None = None
) -> tuple[F32, F32]:
    """Gap to the nearest oncoming vehicle [m], and time to meet it [s].

    `nearest_oncoming_at` describes the arguments.
    """
    gap, closing_speed, _ = nearest_oncoming_at(case, frame, rows)
    return gap, np.maximum(gap, np.float32(0.0)) / closing_speed


def _min_time_to_meet(case: Case) -> F32:
    """Smallest time to meet over all frames in the opposing lane, shape (simulation,) [s]."""
    rows, frames = opposing_lane_span(case).instants()
    _, times = _gap_and_time_to_meet(case, frames.astype(np.int32), rows)
    least = np.full(case.signals.num_simulations, _NAN)
    np.fmin.at(least, rows, times)
    return least
