"""Margins over stretches of frames by the compiled engine: those of `reference`, bit for bit."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import F32
from overtaking.model.labels import Case
from overtaking.physics.constants import known
from overtaking.rules.frames import Span, Stretch, ends_in, frames_of, time_to_regain
from overtaking.signals.arrays import adjacent, flat
from overtaking.sim.engine import SIMD_VARIABLE

I32 = NDArray[np.int32]

_NEIGHBOURS = ("vehicle", "gap", "closing_speed")


def lowest(values: F32, span: Span) -> F32:
    """Smallest of `values` (simulation, time) in a span; means nothing where that is empty."""
    return _extreme(values, span, greatest=False)


def highest(values: F32, span: Span) -> F32:
    """Largest of `values` (simulation, time) in a span; means nothing where that is empty."""
    return _extreme(values, span, greatest=True)


def excess(values: F32, least: np.floating[Any], span: Span) -> Stretch:
    """How far `values` (simulation, time) stay above a number."""
    low = lowest(values, span) - least
    rows = np.flatnonzero(span.exists & (low < 0))
    first, last = ends_in(span, rows, values[rows] < least)
    return Stretch(low=low, first=first, last=last)


def stop_margin(case: Case, sight: F32, span: Span) -> Stretch:
    """Distance that is seen minus the stopping distance [m].

    Args:
        case: The batch.
        sight: Shape (simulation, time) [m].
        span: Where it counts.
    """
    seen, law = case.signals, law_numbers()
    found = _nothing(case)
    _core.stops(
        span=recorded_span(case, span),
        speed=flat(seen.speed),
        friction=flat(seen.friction),
        sight=flat(sight),
        floor=law["floor"],
        usable=law["usable"],
        reaction_time=float(known("law.sight.reaction_time")),
        out=found,
    )
    return Stretch(**found)


def follow_margin(case: Case, span: Span) -> Stretch:
    """Gap to the leader minus the lawful gap, but for 3 s after it cut in [m]."""
    run, found = case.trajectories, _nothing(case)
    _core.follow(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "speed", "friction", "lane", *_NEIGHBOURS),
            "lanes": adjacent(run.states.lane),
            "present": None if run.present is None else adjacent(run.present),
            "regain": time_to_regain(case),
        },
        law=law_numbers(),
        out=found,
    )
    return Stretch(**found)


def duty_to_return(case: Case, span: Span) -> tuple[I32, I32]:
    """The longest run of frames of a span in which the ego could have returned.

    Returns:
        Its first frame, `NEVER` without one, and its number of frames, shape (simulation,).
    """
    count = case.signals.num_simulations
    first, length = np.empty(count, np.int32), np.empty(count, np.int32)
    _core.duty(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "lane", "speed", "friction", *_NEIGHBOURS),
            "original_lane": np.ascontiguousarray(case.events.original_lane, np.uint8),
            "num_lanes": case.trajectories.road.num_lanes,
            "lead": flat(case.target.lead),
            "target_gap": flat(case.target.gap),
            "target_speed": flat(case.target.speed),
            "time_gap": float(known("law.return.time_gap")),
            "free_time": float(known("law.return.free_time")),
            "reach": float(known("law.return.reach")),
        },
        law=law_numbers(),
        first=first,
        length=length,
    )
    return first, length


def braking_margin(case: Case, span: Span) -> Stretch:
    """Braking that is allowed minus what is forced on the follower after a lane change [m/s^2]."""
    found = _nothing(case)
    _core.obstruction(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "lane", *_NEIGHBOURS),
            "lasting": frames_of(case, known("law.obstruction.duration")),
            "allowed": float(known("law.obstruction.braking")),
            "most": float(known("law.obstruction.most")),
        },
        out=found,
    )
    return Stretch(**found)


def law_numbers() -> dict[str, float]:
    """The numbers of `rules.distances`."""
    usable = known("friction.table.usable_share") * known("model.nature.gravity")
    return {
        "floor": float(known("friction.table.floor")),
        "usable": float(usable),
        "decel_limit": float(known("law.safe_distance.decel_limit")),
        "reaction_time": float(known("law.safe_distance.reaction_time")),
    }


def recorded_span(case: Case, span: Span) -> dict[str, Any]:
    """A span as the engine takes it, without frames that were not recorded."""
    last = case.trajectories.num_frames - np.int32(1)
    return _taken(span.start, np.minimum(span.stop, last), case.signals.num_frames)


def _taken(start: I32, stop: I32, num_frames: int) -> dict[str, Any]:
    return {
        "start": np.ascontiguousarray(start, np.int32),
        "stop": np.ascontiguousarray(stop, np.int32),
        "frames": num_frames,
        "level": os.environ.get(SIMD_VARIABLE) or None,
    }


def of_signals(case: Case, *names: str) -> dict[str, NDArray[Any]]:
    """Some signals, each in one row."""
    return {name: flat(getattr(case.signals, name)) for name in names}


def _nothing(case: Case) -> dict[str, NDArray[Any]]:
    """Room for a `Stretch`."""
    count = case.signals.num_simulations
    kinds = {"low": np.float32, "first": np.int32, "last": np.int32}
    return {name: np.empty(count, kind) for name, kind in kinds.items()}


def _extreme(values: F32, span: Span, *, greatest: bool) -> F32:
    out = np.empty(len(values), np.float32)
    _core.extreme_float(
        span=_taken(span.start, span.stop, values.shape[1]),
        values=flat(values),
        greatest=greatest,
        out=out,
    )
    return out
