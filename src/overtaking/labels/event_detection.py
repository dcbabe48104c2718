"""What happened: the events of an overtake, and how it ended.

The events are found in recorded positions and bodies, never in the intentions of the ego. The
compiled engine finds them; `tests/reference/labels/readable_events.py` is the same in Python and
follows the definitions of `docs/explanation/events.md`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.signals import target_signals, watch
from overtaking.labels.snapshots import (
    across_at,
    borders_of,
    frames_within,
    lateral_speed_at,
    slot_of,
    vehicle_at,
)
from overtaking.model.ego_signals import EgoSignals
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail, OvertakeEvents
from overtaking.model.trajectories import ANGLE_RESOLUTION, OVERTAKING_STAGES, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case

_NARROW = frozenset(
    ["target_slot", "original_lane", "num_attempts", "num_passed", "collision_slot", "num_drifts"]
)
"""Events that are bytes; the others are frames."""

_LINE_OR_ABORT_END = ("line_crossed", "abort_end")

HEADINGS = 1.0 / ANGLE_RESOLUTION
"""Recorded steps of a heading in a radian."""


def case_of(trajectories: Trajectories) -> Case:
    """A recording of any origin with its signals, its events and its targets.

    Raises:
        ConfigError: `OVERTAKING_SIMD` is no SIMD level of this CPU.
    """
    seen, found = watch(trajectories, thresholds(trajectories))
    columns: dict[str, Any] = {
        name: row.astype(np.uint8) if name in _NARROW else row for name, row in found.items()
    }
    # A movement that is there in the first frame of a recording had begun; in a simulation it
    # begins.
    attempt = columns["attempt"]
    begun = np.where((attempt == 0) & trajectories.is_excerpt, attempt, NEVER)
    by_other = _struck(trajectories, seen, columns["collision_slot"], columns["collision"])
    return Case(
        trajectories=trajectories,
        signals=seen,
        events=OvertakeEvents(
            was_struck=by_other,
            began_before_recording=begun,
            was_intended=_was_intended(trajectories, columns),
            **columns,
        ),
        target=target_signals(trajectories, seen, columns["target_slot"]),
    )


def thresholds(trajectories: Trajectories) -> dict[str, Any]:
    """Numbers of `event_detection.toml` that tell an attempt, and the lanes of the road."""
    road, kind = trajectories.road, trajectories.scenario.vehicles.kind[:, EGO_SLOT]

    def frames(name: str) -> int:
        seconds = float(constant(f"event_detection.{name}"))
        return max(1, round(seconds * 1000.0 / trajectories.scenario.frame_interval_ms))

    advances = [constant(f"event_detection.attempt.advance.{kind.code}") for kind in VehicleKind]
    borders, beyond = borders_of(road), road.overtaking_side_neighbour
    return {
        "min_advance": np.array(advances)[kind],
        "borders": [float(each) for each in borders],
        "lanes_with_left": road.num_lanes - 1 + (beyond is not None and beyond.kind == "driving"),
        "min_frames": frames("motion.least_time"),
        "window": frames("motion.median_window"),
        "advance": frames("attempt.advance_time"),
        "follow_up": frames("attempt.back_time"),
        "min_speed": float(constant("event_detection.motion.least_speed")),
        "min_shift": float(constant("event_detection.motion.least_shift")),
        "settled_shift": float(constant("event_detection.motion.settled_shift")),
        "over_line": float(constant("event_detection.attempt.over_line")),
        "follow_time_gap": float(constant("event_detection.phases.follow_time_gap")),
        "direction": round(HEADINGS * trajectories.headings_and_origin[1]),
        "spin_angle": round(HEADINGS * float(constant("model.departure.spin_angle"))),
    }


def _struck(trajectories: Trajectories, seen: EgoSignals, partner: U8, collision: I32) -> Mask:
    """Whether another vehicle ran into the ego, shape (simulation,); False without a collision.

    In the last frame before the contact: where the two are apart along the road, the one behind
    runs into the one ahead; where they are side by side, the one that moves towards the other
    faster does.
    """
    rows = np.flatnonzero(collision != NEVER)
    before, slot = np.maximum(collision[rows] - 1, 0), slot_of(partner[rows])
    along = vehicle_at(trajectories, partner[rows], rows, before)
    lateral, lateral_gap = across_at(trajectories, seen, rows, slot, before)
    is_left = seen.lateral_position[rows, before] > lateral
    own = seen.lateral_speed[rows, before]
    others = lateral_speed_at(trajectories, rows, slot, before)
    # Towards the other: to the right for the one on the left.
    towards, towards_ego = np.where(is_left, -own, own), np.where(is_left, others, -others)
    beside = (along.gap < 0) & (lateral_gap > along.gap)
    struck = np.zeros(len(collision), np.bool_)
    struck[rows] = np.where(beside, towards_ego > towards, along.lead > 0)
    return struck


def _was_intended(trajectories: Trajectories, found: Mapping[str, I32]) -> Mask:
    """Whether the driver meant each attempt, shape (simulation,): by its stage until the line."""
    ends = (
        np.where(found[name] == NEVER, found["last"], found[name]) for name in _LINE_OR_ABORT_END
    )
    begin, end = found["attempt"], np.minimum(*ends)
    rows, frames = frames_within(begin, np.where(begin != NEVER, end, NEVER - 1))
    meant = np.zeros(len(begin), np.bool_)
    meant[rows[np.isin(trajectories.stage[rows, frames], OVERTAKING_STAGES)]] = True
    return meant


def outcome(events: OvertakeEvents) -> U8:
    """`Outcome` of each simulation.

    A collision counts at any time that was recorded, also before an attempt and after the return:
    recordings of this package end three seconds after the overtake, and what happens until then
    belongs to it.
    """
    ended = np.where(events.is_completed, Outcome.COMPLETED, Outcome.NOT_COMPLETED)
    tried = np.where(events.has_attempt, ended, Outcome.NO_ATTEMPT)
    return np.where(events.collision != NEVER, Outcome.COLLISION, tried).astype(np.uint8)


def detail(events: OvertakeEvents, frame_interval_ms: int) -> U8:
    """`OutcomeDetail` of each simulation.

    Args:
        events: Events of the batch.
        frame_interval_ms: Time between frames [ms].
    """
    how, collided, back = outcome(events), events.collision != NEVER, events.abort_end != NEVER
    off, across = events.road_departure, events.spin
    spun_first = (across != NEVER) & ((off == NEVER) | (across < off))
    # Passed, and in the other lane for good.
    frames = float(constant("event_detection.phases.stay_time")) * 1000.0 / frame_interval_ms
    stayed = (events.overlap_end != NEVER) & (events.last - events.overlap_end >= frames)
    cases = [
        (collided & ~events.has_attempt, OutcomeDetail.COLLISION_BEFORE_ATTEMPT),
        (collided & events.was_struck, OutcomeDetail.STRUCK_BY_OTHER),
        (collided, OutcomeDetail.RAN_INTO_OTHER),
        (events.lost_control & spun_first, OutcomeDetail.SPUN),
        (events.lost_control, OutcomeDetail.DEPARTED),
        (how == Outcome.COMPLETED, OutcomeDetail.NONE),
        (how == Outcome.NO_ATTEMPT, OutcomeDetail.NONE),
        (back & (events.line_crossed == NEVER), OutcomeDetail.ABORTED_BEFORE_CROSSING),
        (back, OutcomeDetail.ABORTED_AFTER_CROSSING),
        (stayed, OutcomeDetail.PASSED_NOT_RETURNED),
    ]
    return first_case(cases, OutcomeDetail.OPEN_AT_HORIZON)


def first_case(cases: Sequence[tuple[Mask, int]], otherwise: int) -> U8:
    """The code of the first case that holds in each simulation."""
    conditions, codes = zip(*cases, strict=True)
    return np.select(conditions, codes, otherwise).astype(np.uint8)


def nan_if_begun_before_recording(case: Case, values: F32) -> F32:
    """Values that count from the attempt, NaN where the recording begins later, (simulation,)."""
    return np.where(case.events.began_before_recording == NEVER, values, np.float32(np.nan))
