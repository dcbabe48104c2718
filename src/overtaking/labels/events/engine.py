"""The events by the compiled engine: those of `labels.events.reference`, number for number."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.labels.events import reference
from overtaking.labels.events.accidents import struck
from overtaking.labels.events.attempts import under_way
from overtaking.labels.events.movements import num_frames_of
from overtaking.labels.events.view import borders_of, lanes_with_left, least_advances
from overtaking.labels.signals.arrays import adjacent, expect_slots, flat
from overtaking.model.events import Events
from overtaking.model.signals import Signals
from overtaking.model.trajectory import Trajectories
from overtaking.model.vehicles import Role
from overtaking.world.constants import known

_NARROW = frozenset(
    ["target", "original_lane", "num_attempts", "num_passed", "partner", "num_drifts"]
)
"""Events that are bytes; the others are frames."""

_SEEN = (
    "lane",
    "lateral",
    "lateral_speed",
    "right_reach",
    "left_reach",
    "speed",
    "vehicle",
)


def find_events(trajectories: Trajectories, seen: Signals) -> Events:
    """The events of a batch.

    Args:
        trajectories: The recording.
        seen: Its signals.

    Returns:
        Events of the attempt that decides each simulation, see `model.events.Events`.
    """
    if not seen.is_original:  # Somebody asks what would be if signals were others.
        expect_slots(trajectories, seen.vehicle)
        return reference.find_events(trajectories, seen)
    names = _core.event_fields()
    found = np.empty((len(names), seen.num_simulations), np.int32)
    _core.events(
        recorded=_recorded(trajectories),
        seen={name: flat(getattr(seen, name)) for name in _SEEN},
        limits=_limits(trajectories, seen),
        out=found,
    )
    columns: dict[str, Any] = {
        name: row.astype(np.uint8) if name in _NARROW else row
        for name, row in zip(names, found, strict=True)
    }
    by_other = struck(trajectories, seen, columns["partner"], columns["collision"])
    begun = under_way(trajectories, columns["attempt"])
    return Events(struck=by_other, under_way=begun, **columns)


def _recorded(trajectories: Trajectories) -> dict[str, NDArray[Any] | None]:
    bodies, present = trajectories.scenario.vehicles, trajectories.present
    return {
        "num_frames": flat(trajectories.num_frames),
        "valid": flat(bodies.valid),
        "length": flat(bodies.length),
        "least_advance": least_advances()[bodies.kind[:, Role.EGO]],
        "s": adjacent(trajectories.states.s),
        "hit": adjacent(trajectories.collided_with),
        "present": None if present is None else adjacent(present),
    }


def _limits(trajectories: Trajectories, seen: Signals) -> dict[str, Any]:
    road = trajectories.road
    return {
        "borders": [float(each) for each in borders_of(road)],
        "least_frames": num_frames_of(seen, "motion.least_time"),
        "window": num_frames_of(seen, "motion.median_window"),
        "least_speed": float(known("labels.motion.least_speed")),
        "least_shift": float(known("labels.motion.least_shift")),
        "settled_shift": float(known("labels.motion.settled_shift")),
        "lanes_with_left": lanes_with_left(road),
        "over_line": float(known("labels.attempt.over_line")),
        "advance": num_frames_of(seen, "attempt.advance_time"),
        "follow_up": num_frames_of(seen, "attempt.back_time"),
        "follow_time_gap": float(known("labels.phases.follow_time_gap")),
    }
