"""Events of the overtake, its outcome, and the reason of the outcome.

The compiled engine finds the events in recorded positions and bodies, never in the intention of the
ego's driver. `docs/explanation/events.md` defines the events, and
`tests/reference/labels/readable_events.py` finds them in Python.

An event is a frame number, `NEVER` if it does not occur. Left is the overtaking side, also in
left-hand traffic.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.signals import extract_signals_and_events, target_signals
from overtaking.labels.snapshots import (
    FrameSpan,
    VehicleInstants,
    lane_borders,
    lateral_position_and_gap,
    lateral_speed_at,
    slot_or_ego,
    vehicle_snapshot,
)
from overtaking.model.ego_signals import EgoSignals
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail, OvertakeEvents
from overtaking.model.trajectories import ANGLE_RESOLUTION, OVERTAKING_STAGES, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case

_BYTE_FIELDS = frozenset(
    ["target_slot", "original_lane", "num_attempts", "num_passed", "collision_slot", "num_drifts"]
)
"""Fields of `OvertakeEvents` that are bytes. The engine returns all fields as int32."""

HEADING_UNITS_PER_RADIAN = 1.0 / ANGLE_RESOLUTION
"""Number of steps of a recorded heading, 0.1 mrad, in a radian."""


def case_from_trajectories(trajectories: Trajectories) -> Case:
    """The input of rules and features: a recording of any origin, its signals, events and targets.

    Raises:
        ConfigError: `OVERTAKING_SIMD` is no SIMD level of this CPU.
    """
    signals, frames_by_event = extract_signals_and_events(
        trajectories, event_thresholds(trajectories)
    )
    columns: dict[str, Any] = {
        name: frames.astype(np.uint8) if name in _BYTE_FIELDS else frames
        for name, frames in frames_by_event.items()
    }
    # An excerpt is a recording of real traffic, which began before the first frame: a movement in
    # that frame began earlier. In a simulation it begins there.
    attempt = columns["attempt"]
    began_before_recording = np.where((attempt == 0) & trajectories.is_excerpt, attempt, NEVER)
    was_struck = _was_struck(trajectories, signals, columns["collision_slot"], columns["collision"])
    return Case(
        trajectories=trajectories,
        signals=signals,
        events=OvertakeEvents(
            was_struck=was_struck,
            began_before_recording=began_before_recording,
            was_intended=_was_intended(trajectories, columns),
            **columns,
        ),
        target=target_signals(trajectories, signals, columns["target_slot"]),
    )


def event_thresholds(trajectories: Trajectories) -> dict[str, Any]:
    """Thresholds of `event_detection.toml` and the lanes of the road, as the engine reads them.

    Lengths are in metres, times in frames, angles in steps of 0.1 mrad; the time gap is in seconds.
    The keys are the names of `EventThresholds` in the engine, which explains each; the file states
    the reasons of the values.

    Without crossing the line, a fast movement can be an attempt, and a wide one a drift. A fast
    movement leads to the left by `min_advance` within `advance` frames. It is an attempt only if,
    within the `follow_up` frames after it, the ego is over the line or back. A wide movement leads
    `min_shift` away from the median position of the `window` frames before it, in `min_frames`
    frames or more above `min_speed`. The ego is back if it has been `min_shift` away and comes to
    within `settled_shift`. A corner is over a line if it is farther beyond it than `over_line`.
    """
    road, kind = trajectories.road, trajectories.scenario.vehicles.kind[:, EGO_SLOT]

    def num_frames(name: str) -> int:
        seconds = float(constant(f"event_detection.{name}"))
        return max(1, round(seconds * 1000.0 / trajectories.scenario.frame_interval_ms))

    advances = [constant(f"event_detection.attempt.advance.{kind.code}") for kind in VehicleKind]
    neighbour = road.overtaking_side_neighbour
    # On a two-way road the ego overtakes in the opposing lane, which is left of its last lane. The
    # neighbour may also be no lane, such as a hard shoulder.
    has_left_neighbour = neighbour is not None and neighbour.kind == "driving"
    return {
        "min_advance": np.array(advances)[kind],
        "borders": [float(border) for border in lane_borders(road)],
        "lanes_with_left": road.num_lanes - 1 + has_left_neighbour,
        "min_frames": num_frames("motion.least_time"),
        "window": num_frames("motion.median_window"),
        "advance": num_frames("attempt.advance_time"),
        "follow_up": num_frames("attempt.back_time"),
        "min_speed": float(constant("event_detection.motion.least_speed")),
        "min_shift": float(constant("event_detection.motion.least_shift")),
        "settled_shift": float(constant("event_detection.motion.settled_shift")),
        "over_line": float(constant("event_detection.attempt.over_line")),
        "follow_time_gap": float(constant("event_detection.phases.follow_time_gap")),
        # The direction of a straight road, which the engine subtracts from headings. On a road that
        # bends, headings already are angles to the road, and it is 0.
        "direction": round(HEADING_UNITS_PER_RADIAN * trajectories.headings_and_origin[1]),
        "spin_angle": round(
            HEADING_UNITS_PER_RADIAN * float(constant("model.departure.spin_angle"))
        ),
    }


def _was_struck(
    trajectories: Trajectories, signals: EgoSignals, collision_slot: U8, collision: I32
) -> Mask:
    """Whether another vehicle ran into the ego, shape (simulation,); false without a collision.

    The last frame before the contact decides. Vehicles are side by side if they overlap along the
    road, and less or not at all across it; then the vehicle with the higher speed towards the other
    ran into it. Otherwise the vehicle behind ran into the vehicle ahead.
    """
    simulation = np.flatnonzero(collision != NEVER)
    last_frame_apart = np.maximum(collision[simulation] - 1, 0)
    other_slot = collision_slot[simulation]
    slot = slot_or_ego(other_slot)
    snapshot = vehicle_snapshot(trajectories, other_slot, simulation, last_frame_apart)
    vehicles = VehicleInstants(simulation, slot, last_frame_apart)
    other_position, lateral_gap = lateral_position_and_gap(trajectories, signals, vehicles)
    is_ego_left = signals.lateral_position[simulation, last_frame_apart] > other_position
    # Lateral speeds are positive to the left: the vehicle on the left approaches by a negative one.
    ego_lateral_speed = signals.lateral_speed[simulation, last_frame_apart]
    other_lateral_speed = lateral_speed_at(trajectories, vehicles)
    closing_by_ego = np.where(is_ego_left, -ego_lateral_speed, ego_lateral_speed)
    closing_by_other = np.where(is_ego_left, other_lateral_speed, -other_lateral_speed)
    # Gaps are negative where the bodies overlap.
    are_alongside = (snapshot.gap < 0) & (lateral_gap > snapshot.gap)
    was_struck = np.zeros(len(collision), np.bool_)
    was_struck[simulation] = np.where(
        are_alongside, closing_by_other > closing_by_ego, snapshot.ego_lead > 0
    )
    return was_struck


def _was_intended(trajectories: Trajectories, frames_by_event: Mapping[str, I32]) -> Mask:
    """Whether the simulated driver meant to overtake during the attempt, shape (simulation,).

    The driver's stages count from the attempt to the line crossing or to the end of an abort,
    whichever is first. Without an attempt the result is false.
    """
    attempt, last = frames_by_event["attempt"], frames_by_event["last"]
    crossing, abort_end = frames_by_event["line_crossed"], frames_by_event["abort_end"]
    end = np.minimum(
        np.where(crossing == NEVER, last, crossing), np.where(abort_end == NEVER, last, abort_end)
    )
    # Without an attempt the span is empty.
    span = FrameSpan(first=attempt, last=np.where(attempt != NEVER, end, NEVER - 1))
    instants = span.instants()
    is_overtaking = np.isin(trajectories.stage[instants], OVERTAKING_STAGES)
    was_intended = np.zeros(len(attempt), np.bool_)
    was_intended[instants.simulation[is_overtaking]] = True
    return was_intended


def outcomes(events: OvertakeEvents) -> U8:
    """`Outcome` of each simulation.

    A collision counts in any recorded frame. Before an attempt it prevents the overtake. After the
    return it belongs to the overtake, because a simulation ends 3 s after the return.
    """
    outcome_of_attempt = np.where(events.is_completed, Outcome.COMPLETED, Outcome.NOT_COMPLETED)
    outcome_without_collision = np.where(events.has_attempt, outcome_of_attempt, Outcome.NO_ATTEMPT)
    return np.where(events.collision != NEVER, Outcome.COLLISION, outcome_without_collision).astype(
        np.uint8
    )


def outcome_details(events: OvertakeEvents, frame_interval_ms: int) -> U8:
    """`OutcomeDetail` of each simulation: the reason of its outcome.

    Args:
        events: Events of the batch.
        frame_interval_ms: Time between frames [ms].
    """
    outcome, has_collision = outcomes(events), events.collision != NEVER
    has_abort_end = events.abort_end != NEVER
    departure, spin = events.road_departure, events.spin
    spun_first = (spin != NEVER) & ((departure == NEVER) | (spin < departure))
    # A choice: an ego that is still in the other lane 10 s after passing does not intend to return.
    stay_time = float(constant("event_detection.phases.stay_time"))
    num_frames_of_stay = stay_time * 1000.0 / frame_interval_ms
    has_passed = events.overlap_end != NEVER
    has_stayed = has_passed & (events.last - events.overlap_end >= num_frames_of_stay)
    # The first condition that holds decides, so a later one need not exclude the earlier ones.
    details_by_condition = [
        (has_collision & ~events.has_attempt, OutcomeDetail.COLLISION_BEFORE_ATTEMPT),
        (has_collision & events.was_struck, OutcomeDetail.STRUCK_BY_OTHER),
        (has_collision, OutcomeDetail.RAN_INTO_OTHER),
        # Control is lost by leaving the lanes or spinning without a collision.
        (events.lost_control & spun_first, OutcomeDetail.SPUN),
        (events.lost_control, OutcomeDetail.DEPARTED),
        (outcome == Outcome.COMPLETED, OutcomeDetail.NONE),
        (outcome == Outcome.NO_ATTEMPT, OutcomeDetail.NONE),
        (has_abort_end & (events.line_crossed == NEVER), OutcomeDetail.ABORTED_BEFORE_CROSSING),
        (has_abort_end, OutcomeDetail.ABORTED_AFTER_CROSSING),
        (has_stayed, OutcomeDetail.PASSED_NOT_RETURNED),
    ]
    return first_that_holds(details_by_condition, OutcomeDetail.OPEN_AT_HORIZON)


def first_that_holds(codes_by_condition: Sequence[tuple[Mask, int]], otherwise: int) -> U8:
    """Code of the first condition that holds in each simulation, or `otherwise`."""
    conditions, codes = zip(*codes_by_condition, strict=True)
    return np.select(conditions, codes, otherwise).astype(np.uint8)


def nan_if_begun_before_recording(case: Case, values: F32) -> F32:
    """Values that depend on the frame of the attempt; NaN if it began before the recording.

    Such an attempt has an unknown frame. The values have shape (simulation,).
    """
    return np.where(case.events.began_before_recording == NEVER, values, np.float32(np.nan))
