"""Margins, measures and sums over stretches of one simulation, one frame after the other.

`span_scans.rs` of `crates/overtaking-labels` computes the same, sixteen frames at a time.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.reference.labels.readable_events import first
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

    from tests.reference.labels.readable_signals import One, Row

    from overtaking.model.verdicts import Case

Lowest = tuple[np.float32, int, int, int]
"""Smallest margin, first and last frame with a negative one, and the longest run of such frames."""


def answers_of(
    given: Case, one: One, seen: dict[str, Row], spans: Mapping[str, range]
) -> dict[str, Any]:
    """All answers about one simulation, by the names of `ScanResults`.

    Args:
        given: Its batch, for the events.
        one: The simulation.
        seen: Its signals.
        spans: The frames of each span, by the names of `labels.law.case.stretches`.
    """
    names = ("line_crossed", "return_end", "target_slot", "original_lane")
    crossed, back, target, lane = (int(getattr(given.events, name)[one.number]) for name in names)
    behind = None if crossed < 0 else one.neighbour(NeighbourRole.LEFT_FOLLOWER, crossed)
    nobody = target == NO_VEHICLE
    lasting = num_frames_in(given, OBSTRUCTION_TIME.f32)
    return {
        "stop_lit": stop_margin(seen, "sight_lit", spans["conduct"]),
        "stop_unlit": stop_margin(seen, "sight_unlit", spans["conduct"]),
        "follow": follow_margin(one, seen, spans["settled"], num_frames_to_regain_gap(given)),
        "braking": braking_margin(one, seen, spans["manoeuvre"], lasting),
        "due": due_return(one, seen, 0 if nobody else target, lane, spans["passed"]),
        "entry_arrival": -1 if behind is None else arrival(one, behind, crossed),
        "return_arrival": -1 if nobody or back < 0 else arrival(one, target, back),
        "worst": worst(one, seen, spans["conduct"]),
        "sums": sums(one, seen, spans["counted"]),
    }


def lowest(margins: Iterable[tuple[int, np.float32]]) -> Lowest:
    """Of margins by frame; `UNCONSTRAINED` and -1 where there are none."""
    low, broken = UNCONSTRAINED, list[int]()
    for frame, margin in margins:
        low = min(low, margin)
        if margin < 0:
            broken.append(frame)
    # Frames of a run are as far from each other as their places in the list.
    runs = Counter(frame - place for place, frame in enumerate(broken))
    begin, end = (broken[0], broken[-1]) if broken else (-1, -1)
    return low, begin, end, max(runs.values(), default=0)


def limited(signal: Row, limit: np.float32, span: range, *, is_most: bool) -> Lowest:
    """A signal minus the least that is allowed, or the most minus the signal."""
    return lowest((t, limit - signal[t] if is_most else signal[t] - limit) for t in span)


def bits_within(values: Row, span: range) -> tuple[int, int]:
    """Bits that are set in any frame, and in all."""
    ever, always = 0, 255
    for t in span:
        ever, always = ever | int(values[t]), always & int(values[t])
    return ever, always


def who(seen: dict[str, Row], place: NeighbourRole, frame: int) -> int | None:
    """Slot of a neighbour."""
    slot = int(seen["neighbour_slot"][place, frame])
    return None if slot == NO_VEHICLE else slot


def stop_margin(seen: dict[str, Row], sight: str, span: range) -> Lowest:
    """Distance that is seen minus the stopping distance [m]."""
    usable = constant("friction.table.usable_share") * constant("model.nature.gravity")
    reaction = as_f32(STOPPING_REACTION_TIME.f32)
    decel = usable * np.maximum(seen["friction"], constant("friction.table.floor"))
    stop = stopping_distance(seen["speed"], reaction, decel)
    return lowest((t, seen[sight][t] - stop[t]) for t in span)


def follow_margin(one: One, seen: dict[str, Row], span: range, regain: int) -> Lowest:
    """Gap to the leader minus the lawful gap, but for the time after it cut in [m]."""
    counted: list[tuple[int, int]] = []
    cut_in: dict[int, int] = {}
    for t in range(span.stop):
        slot = who(seen, NeighbourRole.LEADER, t)
        if slot is None:
            continue
        if t > 0 and _cuts_in(one, seen, slot, t):
            cut_in[slot] = t
        is_recent = t - cut_in.get(slot, -regain - 1) <= regain
        if t in span and not is_recent:
            counted.append((t, slot))
    frames = [t for t, _ in counted]
    front = encounter(one, counted, ahead=True)
    decel = decel_for_safe_distance(seen["friction"][frames])
    margins = margin_to_leader(front["gap"], seen["speed"][frames], front["closing_speed"], decel)
    return lowest(zip(frames, margins, strict=True))


def _cuts_in(one: One, seen: dict[str, Row], slot: int, t: int) -> bool:
    """Whether a vehicle of another lane becomes the leader of an ego that keeps its own lane."""
    own = one.lane[0]
    is_new = who(seen, NeighbourRole.LEADER, t - 1) != slot and own[t] == own[t - 1]
    return is_new and one.recorded[slot][t - 1] and one.lane[slot][t - 1] != own[t - 1]


def braking_margin(one: One, seen: dict[str, Row], span: range, lasting: int) -> Lowest:
    """Braking that is allowed minus what is forced on the follower after a lane change [m/s^2]."""
    margins, changed, own = [], None, one.lane[0]
    for t in span:
        if t > 0 and own[t] != own[t - 1]:
            changed = t
        slot = who(seen, NeighbourRole.FOLLOWER, t)
        if slot is not None and changed is not None and t - changed <= lasting:
            forced = drac(one.gap(slot, t), one.closing(slot, t, ahead=False))
            forced = np.minimum(forced, MAX_FORCED_BRAKING.f32)
            margins.append((t, ABRUPT_BRAKING.f32 - forced))
    return lowest(margins)


def due_return(
    one: One, seen: dict[str, Row], target: int, original: int, span: range
) -> tuple[int, int]:
    """The longest run of frames in which the ego could have returned: first frame and length."""
    best, run = (-1, 0), 0
    for t in span:
        away = one.lane[0][t] not in (original, *range(one.num_lanes, 256))
        could = away and _is_behind(one, seen, target, t) and _room(one, seen, t) >= 0
        run = run + 1 if could else 0
        if run > best[1]:
            best = t + 1 - run, run
    return best


def _is_behind(one: One, seen: dict[str, Row], target: int, t: int) -> bool:
    """Whether the target is 2 s or its lawful gap behind, whichever is more."""
    lead = np.float32(one.s[0][t] - one.s[target][t]) * np.float32(1e-3)
    speed = np.float32(one.speed[target][t]) * np.float32(1e-3)
    lawful = lawful_gap(
        speed, speed - seen["speed"][t], decel_for_safe_distance(seen["friction"][t])
    )
    wanted = np.maximum(RETURN_TIME_GAP.f32 * speed, lawful)
    return bool(lead > 0 and np.abs(lead) - one.halves(target) >= wanted)


def _room(one: One, seen: dict[str, Row], t: int) -> Any:
    """The smallest margin to the lawful gaps in the lane to the right, and to 10 s ahead [m]."""
    speed, decel, room = (
        seen["speed"][t],
        decel_for_safe_distance(seen["friction"][t]),
        RETURN_RANGE.f32,
    )
    ahead, behind = (
        who(seen, NeighbourRole.RIGHT_LEADER, t),
        who(seen, NeighbourRole.RIGHT_FOLLOWER, t),
    )
    if ahead is not None:
        closing = one.closing(ahead, t, ahead=True)
        soon = RETURN_FREE_TIME.f32 * closing
        needed = np.maximum(lawful_gap(speed, closing, decel), soon)
        room = min(room, one.gap(ahead, t) - needed)
    if behind is not None:
        closing = one.closing(behind, t, ahead=False)
        room = min(room, one.gap(behind, t) - lawful_gap(speed + closing, closing, decel))
    return room


def arrival(one: One, slot: int, begin: int) -> int:
    """First frame in which the front of a vehicle is where the ego's rear was, -1 without one."""

    def is_past(t: int) -> bool:
        way = np.float32(one.s[slot][t] - one.s[0][begin]) * np.float32(1e-3)
        return bool(one.recorded[slot][t] and way + one.halves(slot) >= 0)

    frame = first(range(begin, one.frames), is_past)
    return -1 if frame is None else frame


def worst(one: One, seen: dict[str, Row], span: range) -> dict[str, Any]:
    """The worst of each measure of the vehicles ahead and behind; 0 where nobody is there."""
    found: dict[str, Any] = {}
    for side, place in (("leader", NeighbourRole.LEADER), ("follower", NeighbourRole.FOLLOWER)):
        met = [(t, slot) for t in span if (slot := who(seen, place, t)) is not None]
        each = encounter(one, met, ahead=place is NeighbourRole.LEADER)
        found[f"{side}.valid"] = float(len(met) > 0)
        for name, values in each.items():
            by = max if name in ("closing_speed", "drac") else min
            found[f"{side}.{name}"] = by(values, default=0.0)
        if place is NeighbourRole.LEADER:
            found |= _ahead(one, seen, met, each)
    return found


def _ahead(
    one: One, seen: dict[str, Row], met: list[tuple[int, int]], front: dict[str, Row]
) -> dict[str, Any]:
    """What else there is to say of the vehicle ahead."""
    frames, slots = [t for t, _ in met], [slot for _, slot in met]
    gap, closing, speed = front["gap"], front["closing_speed"], seen["speed"][frames]
    decel, limit = (
        constant("event_detection.safety.picud_decel"),
        constant("event_detection.safety.critical_ttc"),
    )
    safe = rss_safe_gap(
        speed,
        speed - closing,
        reaction_time=RSS_REACTION_TIME.f32,
        accel=RSS_ACCEL.f32,
        follower_decel=RSS_REAR_DECEL.f32,
        leader_decel=RSS_LEADER_DECEL.f32,
    )
    left = picud(
        gap,
        speed,
        speed - closing,
        reaction_time=constant("event_detection.safety.picud_reaction_time"),
        follower_decel=decel,
        leader_decel=decel,
    )
    lawful = margin_to_leader(
        gap, speed, closing, decel_for_safe_distance(seen["friction"][frames])
    )
    return {
        "time_headway": min(time_headway(gap, one.length[slots], speed), default=0.0),
        "picud": min(left, default=0.0),
        "rss_margin": min(gap - safe, default=0.0),
        "lawful_margin": min(lawful, default=0.0),
        "num_close": (lawful < 0).sum(),
        "num_critical": is_ttc_critical(front["ttc"], limit).sum(),
        # In doubles, one after the other.
        "shortfall": sum(ttc_shortfall(front["ttc"], limit).tolist()),
    }


def sums(one: One, seen: dict[str, Row], span: range) -> dict[str, int]:
    """Sums of recorded integers, those of the vehicle ahead over the frames that have one."""
    led = [(t, slot) for t in span if (slot := who(seen, NeighbourRole.LEADER, t)) is not None]
    return {
        "frames": len(span),
        "led": len(led),
        "ego_speed": sum(one.speed[0][t] for t in span),
        "target_speed": sum(one.speed[slot][t] for t, slot in led),
        "speed_difference": sum(abs(one.speed[0][t] - one.speed[slot][t]) for t, slot in led),
        "distance": sum(abs(one.s[slot][t] - one.s[0][t]) for t, slot in led),
        "left_count": sum(int(seen["left_count"][t]) for t in span),
    }
