"""Margins, measures and sums over spans of one simulation, one frame after the other.

`span_scans.rs` of `crates/overtaking-labels` computes the same values, sixteen frames at a time.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.reference.labels.readable_events import first_frame
from tests.reference.labels.readable_signals import encounter

from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.margins import UNCONSTRAINED, num_frames_in, num_frames_to_regain_gap
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    MAX_FORCED_BRAKING,
    OBSTRUCTION_TIME,
    RETURN_FREE_TIME,
    RETURN_RANGE,
    RETURN_TIME_GAP,
    RSS_ACCEL,
    RSS_LEADER_DECEL,
    RSS_REACTION_TIME,
    RSS_REAR_DECEL,
    STOPPING_REACTION_TIME,
)
from overtaking.labels.law.safe_distance import (
    decel_for_safe_distance,
    lawful_gap,
    margin_to_leader,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.world.road_surface import stopping_distance
from overtaking.world.surrogate_safety import (
    drac,
    is_ttc_critical,
    picud,
    rss_safe_gap,
    time_headway,
    ttc_shortfall,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from tests.reference.labels.readable_signals import SignalArray, SingleRun

    from overtaking.model.verdicts import Case

ReferenceMinimum = tuple[np.float32, int, int, int]
"""Smallest margin, first and last frame with a negative one, and the longest run of such frames."""


def scan_results(
    case: Case, run: SingleRun, signals: dict[str, SignalArray], spans: Mapping[str, range]
) -> dict[str, Any]:
    """All results about one simulation.

    Args:
        case: Its batch, for the events.
        run: The simulation.
        signals: Its signals.
        spans: The frames of each span, by the names of `scan_spans`.
    """
    names = ("line_crossed", "return_end", "target_slot", "original_lane")
    crossing, return_end, target, original_lane = (
        int(getattr(case.events, name)[run.row]) for name in names
    )
    has_target = target != NO_VEHICLE
    follower = None if crossing < 0 else run.neighbour(NeighbourRole.LEFT_FOLLOWER, crossing)
    has_return = has_target and return_end >= 0
    num_obstruction_frames = num_frames_in(case, OBSTRUCTION_TIME.f32)
    num_regain_frames = num_frames_to_regain_gap(case)
    return {
        "stop_lit": stopping_margin(signals, "sight_lit", spans["judged"]),
        "stop_unlit": stopping_margin(signals, "sight_unlit", spans["judged"]),
        "following": following_margin(run, signals, spans["after_gap_recovery"], num_regain_frames),
        "braking": braking_margin(run, signals, spans["manoeuvre"], num_obstruction_frames),
        "return_opportunity": return_opportunity(
            run, signals, target if has_target else 0, original_lane, spans["after_passing"]
        ),
        "entry_arrival": -1 if follower is None else arrival(run, follower, crossing),
        "return_arrival": arrival(run, target, return_end) if has_return else -1,
        "worst": worst_measures(run, signals, spans["judged"]),
        "sums": recorded_sums(run, signals, spans["summed"]),
    }


def minimum_of(margins: Iterable[tuple[int, np.float32]]) -> ReferenceMinimum:
    """The minimum of margins by frame; `UNCONSTRAINED` and -1 without any."""
    minimum, breaches = UNCONSTRAINED, list[int]()
    for frame, margin in margins:
        minimum = min(minimum, margin)
        if margin < 0:
            breaches.append(frame)
    # Within a run, frames and positions in the list grow alike, so their difference stays the same.
    runs = Counter(frame - position for position, frame in enumerate(breaches))
    first, last = (breaches[0], breaches[-1]) if breaches else (-1, -1)
    return minimum, first, last, max(runs.values(), default=0)


def minimum_to_limit(
    signal: SignalArray, limit: np.float32, span: range, *, is_most: bool
) -> ReferenceMinimum:
    """The minimum of a signal above its lower limit, or below its upper limit if `is_most`."""
    return minimum_of((t, limit - signal[t] if is_most else signal[t] - limit) for t in span)


def flags_any_and_all(values: SignalArray, span: range) -> tuple[int, int]:
    """Bits that are set in any frame, and in all."""
    any_bits, all_bits = 0, 255
    for t in span:
        any_bits, all_bits = any_bits | int(values[t]), all_bits & int(values[t])
    return any_bits, all_bits


def neighbour_slot(signals: dict[str, SignalArray], role: NeighbourRole, frame: int) -> int | None:
    """Slot of a neighbour, None without one."""
    slot = int(signals["neighbour_slot"][role, frame])
    return None if slot == NO_VEHICLE else slot


def instants_with_neighbour(
    signals: dict[str, SignalArray], role: NeighbourRole, span: Iterable[int]
) -> list[tuple[int, int]]:
    """The frames with a neighbour in a role, and its slot in each."""
    slots = ((t, neighbour_slot(signals, role, t)) for t in span)
    return [(t, slot) for t, slot in slots if slot is not None]


def stopping_margin(signals: dict[str, SignalArray], sight: str, span: range) -> ReferenceMinimum:
    """Sight distance minus the stopping distance [m]."""
    usable = constant("friction.table.usable_share") * constant("model.nature.gravity")
    reaction_time = as_f32(STOPPING_REACTION_TIME.f32)
    decel = usable * np.maximum(signals["friction"], constant("friction.table.floor"))
    distance = stopping_distance(signals["speed"], reaction_time, decel)
    return minimum_of((t, signals[sight][t] - distance[t]) for t in span)


def following_margin(
    run: SingleRun, signals: dict[str, SignalArray], span: range, num_regain_frames: int
) -> ReferenceMinimum:
    """Gap to the leader minus the lawful gap, without the frames shortly after a cut-in [m]."""
    instants: list[tuple[int, int]] = []
    last_cut_in: dict[int, int] = {}
    for t, slot in instants_with_neighbour(signals, NeighbourRole.LEADER, range(span.stop)):
        if t > 0 and _cuts_in(run, signals, slot, t):
            last_cut_in[slot] = t
        is_recent = t - last_cut_in.get(slot, -num_regain_frames - 1) <= num_regain_frames
        if t in span and not is_recent:
            instants.append((t, slot))
    frames = [t for t, _ in instants]
    leader = encounter(run, instants, ahead=True)
    decel = decel_for_safe_distance(signals["friction"][frames])
    margins = margin_to_leader(
        leader["gap"], signals["speed"][frames], leader["closing_speed"], decel
    )
    return minimum_of(zip(frames, margins, strict=True))


def _cuts_in(run: SingleRun, signals: dict[str, SignalArray], slot: int, t: int) -> bool:
    """Whether a vehicle of another lane becomes the leader of an ego that stays in its lane."""
    ego_lane = run.lane[0]
    is_new_leader = neighbour_slot(signals, NeighbourRole.LEADER, t - 1) != slot
    has_changed_lane = run.is_recorded[slot][t - 1] and run.lane[slot][t - 1] != ego_lane[t - 1]
    return is_new_leader and ego_lane[t] == ego_lane[t - 1] and has_changed_lane


def braking_margin(
    run: SingleRun, signals: dict[str, SignalArray], span: range, num_obstruction_frames: int
) -> ReferenceMinimum:
    """Braking that is allowed minus what is forced on the follower after a lane change [m/s^2]."""
    margins, last_change, ego_lane = [], None, run.lane[0]
    for t in span:
        if t > 0 and ego_lane[t] != ego_lane[t - 1]:
            last_change = t
        slot = neighbour_slot(signals, NeighbourRole.FOLLOWER, t)
        if slot is None or last_change is None or t - last_change > num_obstruction_frames:
            continue
        forced = drac(run.gap(slot, t), run.closing_speed(slot, t, ahead=False))
        margins.append((t, ABRUPT_BRAKING.f32 - np.minimum(forced, MAX_FORCED_BRAKING.f32)))
    return minimum_of(margins)


def return_opportunity(
    run: SingleRun,
    signals: dict[str, SignalArray],
    target: int,
    original_lane: int,
    span: range,
) -> tuple[int, int]:
    """The longest run of frames in which the ego could have returned: first frame and length."""
    longest, length = (-1, 0), 0
    for t in span:
        is_elsewhere = run.lane[0][t] not in (original_lane, *range(run.num_lanes, 256))
        can_return = (
            is_elsewhere
            and _is_far_behind(run, signals, target, t)
            and _gap_in_right_lane(run, signals, t) >= 0
        )
        length = length + 1 if can_return else 0
        if length > longest[1]:
            longest = t + 1 - length, length
    return longest


def _is_far_behind(run: SingleRun, signals: dict[str, SignalArray], target: int, t: int) -> bool:
    """Whether the target is 2 s or its lawful gap behind, whichever is more."""
    ego_lead = np.float32(run.s[0][t] - run.s[target][t]) * np.float32(1e-3)
    speed = np.float32(run.speed[target][t]) * np.float32(1e-3)
    decel = decel_for_safe_distance(signals["friction"][t])
    lawful = lawful_gap(speed, speed - signals["speed"][t], decel)
    required = np.maximum(RETURN_TIME_GAP.f32 * speed, lawful)
    return bool(ego_lead > 0 and np.abs(ego_lead) - run.half_length_sum(target) >= required)


def _gap_in_right_lane(run: SingleRun, signals: dict[str, SignalArray], t: int) -> Any:
    """The smallest margin to the lawful gaps in the lane to the right, and to 10 s ahead [m]."""
    speed, decel = signals["speed"][t], decel_for_safe_distance(signals["friction"][t])
    margin = RETURN_RANGE.f32
    leader = neighbour_slot(signals, NeighbourRole.RIGHT_LEADER, t)
    if leader is not None:
        closing_speed = run.closing_speed(leader, t, ahead=True)
        distance_closed = RETURN_FREE_TIME.f32 * closing_speed
        required = np.maximum(lawful_gap(speed, closing_speed, decel), distance_closed)
        margin = min(margin, run.gap(leader, t) - required)
    follower = neighbour_slot(signals, NeighbourRole.RIGHT_FOLLOWER, t)
    if follower is not None:
        closing_speed = run.closing_speed(follower, t, ahead=False)
        required = lawful_gap(speed + closing_speed, closing_speed, decel)
        margin = min(margin, run.gap(follower, t) - required)
    return margin


def arrival(run: SingleRun, slot: int, begin: int) -> int:
    """First frame in which the front of a vehicle is where the ego's rear was, -1 without one."""

    def is_past(t: int) -> bool:
        distance = np.float32(run.s[slot][t] - run.s[0][begin]) * np.float32(1e-3)
        return bool(run.is_recorded[slot][t] and distance + run.half_length_sum(slot) >= 0)

    frame = first_frame(range(begin, run.num_frames), is_past)
    return -1 if frame is None else frame


def worst_measures(run: SingleRun, signals: dict[str, SignalArray], span: range) -> dict[str, Any]:
    """The worst value of each measure of leader and follower; 0 without such a vehicle."""
    measures: dict[str, Any] = {}
    for role in (NeighbourRole.LEADER, NeighbourRole.FOLLOWER):
        name_of_role, is_leader = role.name.lower(), role is NeighbourRole.LEADER
        instants = instants_with_neighbour(signals, role, span)
        values_by_measure = encounter(run, instants, ahead=is_leader)
        measures[f"{name_of_role}.valid"] = float(len(instants) > 0)
        for name, values in values_by_measure.items():
            worst = max if name in ("closing_speed", "drac") else min
            measures[f"{name_of_role}.{name}"] = worst(values, default=0.0)
        if is_leader:
            measures |= _leader_measures(run, signals, instants, values_by_measure)
    return measures


def _leader_measures(
    run: SingleRun,
    signals: dict[str, SignalArray],
    instants: list[tuple[int, int]],
    leader: dict[str, SignalArray],
) -> dict[str, Any]:
    """The measures of the leader that a follower does not have."""
    frames, slots = [t for t, _ in instants], [slot for _, slot in instants]
    gap, closing_speed, speed = leader["gap"], leader["closing_speed"], signals["speed"][frames]
    picud_decel = constant("event_detection.safety.picud_decel")
    critical_ttc = constant("event_detection.safety.critical_ttc")
    rss_gap = rss_safe_gap(
        speed,
        speed - closing_speed,
        reaction_time=RSS_REACTION_TIME.f32,
        accel=RSS_ACCEL.f32,
        follower_decel=RSS_REAR_DECEL.f32,
        leader_decel=RSS_LEADER_DECEL.f32,
    )
    picud_values = picud(
        gap,
        speed,
        speed - closing_speed,
        reaction_time=constant("event_detection.safety.picud_reaction_time"),
        follower_decel=picud_decel,
        leader_decel=picud_decel,
    )
    decel = decel_for_safe_distance(signals["friction"][frames])
    lawful_margin = margin_to_leader(gap, speed, closing_speed, decel)
    return {
        "time_headway": min(time_headway(gap, run.length[slots], speed), default=0.0),
        "picud": min(picud_values, default=0.0),
        "rss_margin": min(gap - rss_gap, default=0.0),
        "lawful_margin": min(lawful_margin, default=0.0),
        "num_close": (lawful_margin < 0).sum(),
        "num_critical": is_ttc_critical(leader["ttc"], critical_ttc).sum(),
        # The engine adds doubles in the order of the frames, so the sum must not be pairwise.
        "shortfall": sum(ttc_shortfall(leader["ttc"], critical_ttc).tolist()),
    }


def recorded_sums(run: SingleRun, signals: dict[str, SignalArray], span: range) -> dict[str, int]:
    """Sums of recorded integers; those about the leader over the frames with a leader."""
    instants = instants_with_neighbour(signals, NeighbourRole.LEADER, span)
    return {
        "frames": len(span),
        "frames_with_leader": len(instants),
        "ego_speed": sum(run.speed[0][t] for t in span),
        "target_speed": sum(run.speed[slot][t] for t, slot in instants),
        "speed_difference": sum(abs(run.speed[0][t] - run.speed[slot][t]) for t, slot in instants),
        "distance": sum(abs(run.s[slot][t] - run.s[0][t]) for t, slot in instants),
        "left_count": sum(int(signals["left_count"][t]) for t in span),
    }
