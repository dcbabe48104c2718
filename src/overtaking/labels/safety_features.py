"""Surrogate measures of safety of each simulation, also against oncoming traffic.

An event is a frame of each simulation, `NEVER` (-1) if it does not occur. An instant is one frame
of one simulation. An `Encounter` holds gap, closing speed and times to collision of the ego and a
neighbour; `valid` is false without the neighbour. `sight_lit` and `sight_unlit` are the distances
at which the ego's driver sees a lit and an unlit vehicle. Left is the overtaking side, also in
left-hand traffic.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
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
    Instants,
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

_EVENTS = MEASURED_MOMENTS[1:]
"""The moments that are events, such as `attempt`; the first moment is the whole manoeuvre."""

_LEFT = (NeighbourRole.LEFT_LEADER, NeighbourRole.LEFT_FOLLOWER)

_RIGHT = (NeighbourRole.RIGHT_LEADER, NeighbourRole.RIGHT_FOLLOWER)

_ENTERED_NEIGHBOURS = {"attempt": _LEFT, "line_crossed": _LEFT, "return_begin": _RIGHT}
"""Roles of leader and follower in the lane that the ego moves into, by event."""

_ENTERS_LANE = np.array([name in _ENTERED_NEIGHBOURS for name in _EVENTS])
"""Whether the ego moves into a lane at an event, shape (event,)."""

_ENTERED_BY_EVENT = np.array([_ENTERED_NEIGHBOURS.get(name, _LEFT) for name in _EVENTS], np.intp)
"""`_ENTERED_NEIGHBOURS` as an array of shape (event, 2); any roles where no lane is entered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _MomentTables:
    """Tables of measures, shape (simulation, moment): over the manoeuvre, then at each event.

    Attributes:
        num_simulations: Number of simulations.
        worst: Worst value of a measure over the manoeuvre, by name, shape (simulation,). A measure
            without an entry is 0 over the manoeuvre.
    """

    num_simulations: int
    worst: Mapping[str, F32]

    def of_measure(self, name: str, values: NDArray[Any], cells: IndexArray) -> NDArray[Any]:
        """A measure as a table; 0 at events that do not happen.

        Args:
            name: Name of the measure in `worst`.
            values: Its values at events, shape (instant,).
            cells: Index of each value in the flattened table, same shape.
        """
        table = np.zeros((self.num_simulations, len(MEASURED_MOMENTS)), values.dtype)
        table.reshape(-1)[cells] = values
        table[:, 0] = self.worst.get(name, 0)
        return table

    def of_encounter(self, name: str, encounter: Encounter, cells: IndexArray) -> Encounter:
        """The measures of an encounter as tables; `of_measure` describes the arguments."""
        measures = [field.name for field in fields(encounter)]
        return Encounter(
            **{
                measure: self.of_measure(f"{name}.{measure}", getattr(encounter, measure), cells)
                for measure in measures
            }
        )


def safety_features(case: Case) -> SafetyMeasures:
    """The measures of a batch: over the manoeuvre, and at the events of the overtake.

    The manoeuvre is `judged_span`, as for the law: from 3 s before the attempt to 3 s after the
    return; without an attempt, all frames in which the ego is driven.
    """
    span, signals = judged_span(case), case.signals
    frame_by_event = np.column_stack([getattr(case.events, name) for name in _EVENTS])
    # Most events do not happen, so only those that happen are measured.
    simulation, event = np.nonzero(frame_by_event != NEVER)
    instants = Instants(simulation, frame_by_event[simulation, event].astype(np.intp))
    cells = simulation * len(MEASURED_MOMENTS) + event + 1  # The manoeuvre is the first moment.

    leader = encounters_at(case, NeighbourRole.LEADER, *instants)
    follower = encounters_at(case, NeighbourRole.FOLLOWER, *instants)
    # By the names of the fields of `SafetyMeasures`.
    margins = leader_measures(case, leader, instants) | stop_margins(
        signals.speed[instants],
        signals.friction[instants],
        signals.sight_lit[instants],
        signals.sight_unlit[instants],
    )
    enters = np.flatnonzero(_ENTERS_LANE[event])
    entries = Instants(simulation[enters], instants.frame[enters])
    leader_role, follower_role = _ENTERED_BY_EVENT[event[enters]].T
    new_leader = encounters_at(case, leader_role, *entries)
    new_follower = encounters_at(case, follower_role, *entries)

    worst = _worst_of_manoeuvre(case, span)
    tables = _MomentTables(num_simulations=signals.num_simulations, worst=worst)
    begin = np.where(span.is_nonempty, span.first, NEVER)
    return SafetyMeasures(
        frame=np.column_stack([begin, frame_by_event]).astype(np.int32),
        leader=tables.of_encounter("leader", leader, cells),
        follower=tables.of_encounter("follower", follower, cells),
        # Over the manoeuvre these two have no values: `worst` has no such names.
        new_leader=tables.of_encounter("new_leader", new_leader, cells[enters]),
        new_follower=tables.of_encounter("new_follower", new_follower, cells[enters]),
        **{name: tables.of_measure(name, values, cells) for name, values in margins.items()},
        **{name: worst[name] for name in ("share_below_safe_distance", "tet", "tit")},
        entry_pet=entry_pet(case),
        return_pet=return_pet(case),
        oncoming=oncoming_measures(case),
    )


def _worst_of_manoeuvre(case: Case, span: FrameSpan) -> dict[str, F32]:
    """The worst of each measure over `judged_span`, shape (simulation,).

    `num_close` and `num_critical` are numbers of frames with a gap below the lawful one and with a
    critical time to collision. `shortfall` is the sum of critical minus actual time over the
    latter [s].
    """
    # In an empty span no frame bounds a smallest margin: it is infinite.
    results, no_frame = scans(case), np.float32(np.inf)
    frame_duration = np.float32(case.signals.frame_interval_ms / 1000.0)
    num_frames = np.maximum(span.last - span.first + 1, 1)
    return results.worst_measures | {
        "stop_margin_lit": np.where(span.is_nonempty, results.stop_lit.min_margin, no_frame),
        "stop_margin_unlit": np.where(span.is_nonempty, results.stop_unlit.min_margin, no_frame),
        "share_below_safe_distance": results.worst_measures["num_close"] / as_f32(num_frames),
        "tet": results.worst_measures["num_critical"] * frame_duration,
        "tit": results.worst_measures["shortfall"] * frame_duration,
    }


def entry_pet(case: Case) -> F32:
    """Post-encroachment time of entering the lane on the left, shape (simulation,) [s].

    The time begins in the frame in which the ego crosses the line. It ends when the front of the
    follower in that lane is where the ego's rear bumper was in that frame. It is 0 if they are
    alongside, and infinite without a follower, or if the follower does not arrive in that lane
    within the recording.

    Source:
        Allen, Shin, Cooper (1978), Analysis of traffic conflicts and collisions.
    """
    frame, rows = case.events.line_crossed, np.arange(len(case.events.line_crossed))
    slots = case.signals.neighbour_slot
    encroachment = _Encroachment(
        vehicle=slots[rows, NeighbourRole.LEFT_FOLLOWER, np.maximum(frame, 0)],
        frame=frame,
        # Only a corner of the ego is over the line in this frame; its centre is in the old lane.
        lane=at_frame(case.signals.lane, frame) + np.uint8(1),
        arrival_frame=scans(case).entry_arrival,
    )
    return _post_encroachment_time(case, encroachment)


def return_pet(case: Case) -> F32:
    """Post-encroachment time of the return, with the overtaken vehicle; (simulation,) [s].

    As `entry_pet`, from the frame in which the return ends.
    """
    encroachment = _Encroachment(
        vehicle=case.events.target_slot,
        frame=case.events.return_end,
        lane=case.events.original_lane,
        arrival_frame=scans(case).return_arrival,
    )
    return _post_encroachment_time(case, encroachment)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Encroachment:
    """The ego occupies a place that another vehicle reaches later; shape (simulation,).

    Attributes:
        vehicle: Slot of the other vehicle, `NO_VEHICLE` without one.
        frame: Frame in which the ego's rear bumper is at the place, `NEVER` without one.
        lane: Lane of the place.
        arrival_frame: First frame in which the other's front bumper has reached the place, `NEVER`
            if it does not.
    """

    vehicle: U8
    frame: I32
    lane: U8
    arrival_frame: I32


def _post_encroachment_time(case: Case, encroachment: _Encroachment) -> F32:
    """Time between the two vehicles at the place, shape (simulation,) [s]."""
    has_both = (encroachment.vehicle != NO_VEHICLE) & (encroachment.frame != NEVER)
    rows = np.flatnonzero(has_both)
    slot = slot_or_ego(encroachment.vehicle[rows])
    begin, arrival_frame = encroachment.frame[rows], encroachment.arrival_frame[rows]
    s, half_lengths = case.trajectories.states.s, half_length_sum(case.trajectories, rows, slot)

    def overshoot(frame: I32) -> F32:
        """Distance of the other's front bumper beyond the place, the ego's rear in `begin` [m]."""
        distance = as_f32(s[rows, slot, frame] - s[rows, EGO_SLOT, begin]) * METRES_PER_MM
        return distance + half_lengths

    # `NEVER` becomes `begin` here; `arrives` excludes these simulations below.
    arrival = np.maximum(arrival_frame, begin)
    is_in_lane = case.trajectories.states.lane[rows, slot, arrival] == encroachment.lane[rows]
    # The vehicle reaches the place between two frames, at constant speed. If it is there already in
    # `begin`, the distance to the place is not positive and the time is 0.
    frame_before = np.maximum(arrival - 1, begin)
    distance_to_place = -overshoot(frame_before)
    distance_per_frame = overshoot(arrival) + distance_to_place
    share_of_frame = np.maximum(distance_to_place, np.float32(0.0)) / np.where(
        distance_per_frame > 0, distance_per_frame, np.float32(1.0)
    )
    num_frames = as_f32(frame_before - begin) + share_of_frame
    frame_duration = np.float32(case.signals.frame_interval_ms / 1000.0)
    time = np.full(len(has_both), np.inf, np.float32)
    arrives = (arrival_frame != NEVER) & is_in_lane
    time[rows] = np.where(arrives, num_frames * frame_duration, np.float32(np.inf))
    return time


def leader_measures(case: Case, leader: Encounter, instants: Instants) -> dict[str, F32]:
    """The measures of the leader that a follower does not have, shape (instant,)."""
    signals, (simulation, frame) = case.signals, instants
    speed = signals.speed[instants]
    slot = slot_or_ego(signals.neighbour_slot[simulation, NeighbourRole.LEADER, frame])
    length = case.trajectories.scenario.vehicles.length[simulation, slot]
    leader_speed = speed - leader.closing_speed
    picud_decel = constant("event_detection.safety.picud_decel")
    rss_gap = rss_safe_gap(
        speed,
        leader_speed,
        reaction_time=RSS_REACTION_TIME.f32,
        accel=RSS_ACCEL.f32,
        follower_decel=RSS_REAR_DECEL.f32,
        leader_decel=RSS_LEADER_DECEL.f32,
    )
    return {
        # The headway is from front to front, so it includes the leader's length.
        "time_headway": time_headway(leader.gap, length, speed),
        "picud": picud(
            leader.gap,
            speed,
            leader_speed,
            reaction_time=constant("event_detection.safety.picud_reaction_time"),
            follower_decel=picud_decel,
            leader_decel=picud_decel,
        ),
        "rss_margin": leader.gap - rss_gap,
        "lawful_margin": margin_to_leader(
            leader.gap,
            speed,
            leader.closing_speed,
            decel_for_safe_distance(signals.friction[instants]),
        ),
    }


_NAN = np.float32(np.nan)


def oncoming_measures(case: Case) -> PassingSafety:
    """The measures of a batch against oncoming traffic, NaN where they do not exist."""
    if not case.trajectories.road.is_two_way:
        return _no_measures(case.signals.num_simulations)
    # The span begins as the ego crosses the centre line; `events.line_crossed` is the crossing of
    # any line on the ego's left.
    span = opposing_lane_span(case)
    is_in_opposing_lane = span.is_nonempty
    crossing_frame = np.where(is_in_opposing_lane, span.first, NEVER)
    gap_at_crossing, time_at_crossing = _gap_and_time_to_meet(case, crossing_frame)
    abreast_frame = np.where(is_in_opposing_lane, case.events.overlap_begin, NEVER)
    gap_abreast, time_abreast = _gap_and_time_to_meet(case, abreast_frame)
    return_frame = np.where(is_in_opposing_lane, span.last, NEVER)
    gap_at_return, time_at_return = _gap_and_time_to_meet(case, return_frame)
    # A vehicle that may come just out of sight also limits the time available. `fmin` ignores the
    # NaN of a missing oncoming vehicle.
    begin = np.maximum(crossing_frame, 0)
    sight = available_sight(case, begin)
    closing_speed = at_frame(case.signals.speed, begin) + assumed_oncoming_speed(case, begin)
    time_to_meet_unseen = sight / np.maximum(closing_speed, MIN_CLOSING_SPEED)
    time_in_opposing_lane = seconds_of(case, np.maximum(span.last - span.first, 0))
    return PassingSafety(
        was_in_opposing_lane=is_in_opposing_lane,
        gap_at_crossing=gap_at_crossing,
        time_to_meet_at_crossing=time_at_crossing,
        gap_abreast=gap_abreast,
        time_to_meet_abreast=time_abreast,
        gap_at_return=gap_at_return,
        time_to_meet_at_return=time_at_return,
        min_time_to_meet=_min_time_to_meet(case),
        sight_at_crossing=_nan_unless(is_in_opposing_lane, sight),
        time_in_opposing_lane=_nan_unless(is_in_opposing_lane, time_in_opposing_lane),
        time_available=_nan_unless(
            is_in_opposing_lane, np.fmin(time_at_crossing, time_to_meet_unseen)
        ),
        was_aborted=case.events.abort != NEVER,
    )


def _no_measures(num_simulations: int) -> PassingSafety:
    """The measures on a one-way road: NaN, and false for flags.

    Where `was_in_opposing_lane` is false, the other measures are undefined, and null in tables.
    """
    columns: dict[str, Any] = {
        name: np.full(num_simulations, False if field.is_flag else _NAN)
        for name, field in batch_fields(PassingSafety).items()
    }
    return PassingSafety(**columns)


def _nan_unless(condition: Mask, values: F32) -> F32:
    """The values, NaN where a condition does not hold."""
    return np.where(condition, values, _NAN).astype(np.float32)


def _gap_and_time_to_meet(
    case: Case, frame: I32, simulation: IndexArray | None = None
) -> tuple[F32, F32]:
    """Gap to the nearest oncoming vehicle [m], and time to meet it [s].

    `nearest_oncoming_at` describes the arguments. Its closing speed is at least
    `MIN_CLOSING_SPEED`.
    """
    gap, closing_speed, _ = nearest_oncoming_at(case, frame, simulation)
    return gap, np.maximum(gap, np.float32(0.0)) / closing_speed


def _min_time_to_meet(case: Case) -> F32:
    """Smallest time to meet over all frames in the opposing lane, shape (simulation,) [s]."""
    simulation, frame = opposing_lane_span(case).instants()
    _, times = _gap_and_time_to_meet(case, frame.astype(np.int32), simulation)
    min_time = np.full(case.signals.num_simulations, _NAN)
    np.fmin.at(min_time, simulation, times)
    return min_time
