"""Margins over stretches of frames by the compiled engine: those of `reference`, bit for bit.

The engine looks at recorded states. Where somebody has put other signals in the place of those of a
recording, to see what would be, `reference` looks at them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import F32
from overtaking.labels.law import reference
from overtaking.labels.law.frames import Span, Stretch, driving_end, frames_of, time_to_regain
from overtaking.labels.signals import engine as signals
from overtaking.labels.signals.arrays import adjacent, flat
from overtaking.model.labels import Case
from overtaking.model.vehicles import Role
from overtaking.world.compiled import chosen_level
from overtaking.world.constants import known

I32 = NDArray[np.int32]


def lowest(values: F32, span: Span) -> F32:
    """Smallest of `values` (simulation, time) in a span; means nothing where that is empty."""
    return _extreme(values, span, greatest=False)


def highest(values: F32, span: Span) -> F32:
    """Largest of `values` (simulation, time) in a span; means nothing where that is empty."""
    return _extreme(values, span, greatest=True)


def below(values: F32, limit: F32, span: Span) -> Stretch:
    """Smallest of `values` (simulation, time) in a span, and the frames with less than a limit.

    Args:
        values: Shape (simulation, time).
        limit: Of each simulation.
        span: Where it counts; of the smallest value, as in `lowest`.
    """
    return _beyond(values, limit, span, greatest=False)


def above(values: F32, limit: F32, span: Span) -> Stretch:
    """Largest of `values` as `low`, and the frames with more than a limit; as `below`."""
    return _beyond(values, limit, span, greatest=True)


def excess(values: F32, least: np.floating[Any], span: Span) -> Stretch:
    """How far `values` (simulation, time) stay above a number."""
    found = below(values, np.full(len(values), least), span)
    return Stretch(low=found.low - least, first=found.first, last=found.last)


def dark(case: Case, crossed: I32, bit: int) -> tuple[I32, I32, I32]:
    """Frames around a crossing in which a lamp of the ego is not on; see `reference.dark`."""
    out = np.empty((3, len(crossed)), np.int32)
    _core.dark(
        lights=adjacent(case.trajectories.states.lights[:, Role.EGO]),
        crossed=np.ascontiguousarray(crossed, np.int32),
        first=np.ascontiguousarray(case.events.first, np.int32),
        last=np.ascontiguousarray(driving_end(case), np.int32),
        before=frames_of(case, known("law.signal.before")),
        after=frames_of(case, known("law.signal.after")),
        bit=bit,
        out=out,
    )
    number, first, last = out
    return number, first, last


def stop_margin(case: Case, sight: F32, span: Span) -> Stretch:
    """Distance that is seen minus the stopping distance [m].

    Args:
        case: The batch.
        sight: Shape (simulation, time) [m].
        span: Where it counts.
    """
    seen, law = case.signals, law_numbers()
    found = _nothing(case.signals.num_simulations)
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
    if not case.signals.is_original:
        return reference.follow_margin(case, span)
    run, found = case.trajectories, _nothing(case.signals.num_simulations)
    _core.follow(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "speed", "friction", "lane"),
            "around": around(case),
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
    if not (case.signals.is_original and case.target.is_original):
        return reference.duty_to_return(case, span)
    count = case.signals.num_simulations
    first, length = np.empty(count, np.int32), np.empty(count, np.int32)
    _core.duty(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "lane", "speed", "friction"),
            "around": around(case),
            "original_lane": np.ascontiguousarray(case.events.original_lane, np.uint8),
            "num_lanes": case.trajectories.road.num_lanes,
            "target": np.ascontiguousarray(case.target.vehicle, np.uint8),
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
    if not case.signals.is_original:
        return reference.braking_margin(case, span)
    found = _nothing(case.signals.num_simulations)
    _core.obstruction(
        span=recorded_span(case, span),
        seen={
            **of_signals(case, "lane"),
            "around": around(case),
            "lasting": frames_of(case, known("law.obstruction.duration")),
            "allowed": float(known("law.obstruction.braking")),
            "most": float(known("law.obstruction.most")),
        },
        out=found,
    )
    return Stretch(**found)


def of_target(case: Case, span: Span) -> dict[str, NDArray[Any]]:
    """Some signals of the target in the frames of a span, one simulation after the other.

    Returns:
        overlaps, lane, lateral_gap and accel as in `TargetSignals`, shape (instant,).
    """
    if not case.target.is_original:
        return reference.of_target(case, span)
    own = (case.trajectories, case.signals, case.target.vehicle)
    return signals.alongside(*own, (span.start, span.stop))


def around(case: Case) -> dict[str, NDArray[Any]]:
    """Who is around the ego, and the recorded states that say how far and how fast."""
    recorded, bodies = case.trajectories.states, case.trajectories.scenario.vehicles
    return {
        "vehicle": flat(case.signals.vehicle),
        "s": adjacent(recorded.s),
        "speed": adjacent(recorded.speed),
        "length": flat(bodies.length),
    }


def law_numbers() -> dict[str, float]:
    """The numbers of `labels.law.distances`."""
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
        "level": chosen_level(),
    }


def of_signals(case: Case, *names: str) -> dict[str, NDArray[Any]]:
    """Some signals, each in one row."""
    return {name: flat(getattr(case.signals, name)) for name in names}


def _nothing(count: int) -> dict[str, NDArray[Any]]:
    """Room for a `Stretch` of some simulations."""
    kinds = {"low": np.float32, "first": np.int32, "last": np.int32}
    return {name: np.empty(count, kind) for name, kind in kinds.items()}


def _beyond(values: F32, limit: F32, span: Span, *, greatest: bool) -> Stretch:
    found = _nothing(len(values))
    _core.beyond(
        span=_taken(span.start, span.stop, values.shape[1]),
        values=flat(values),
        limits=np.ascontiguousarray(limit, np.float32),
        greatest=greatest,
        out=found,
    )
    return Stretch(**found)


def _extreme(values: F32, span: Span, *, greatest: bool) -> F32:
    out = np.empty(len(values), np.float32)
    _core.extreme_float(
        span=_taken(span.start, span.stop, values.shape[1]),
        values=flat(values),
        greatest=greatest,
        out=out,
    )
    return out
