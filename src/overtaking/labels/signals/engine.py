"""The signals by the compiled engine: those of `reference` and `target`, bit for bit."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import as_f32, log, maximum
from overtaking.core.memory import Buffers
from overtaking.labels.signals import reference
from overtaking.labels.signals.arrays import flat, states, vehicles
from overtaking.labels.signals.conditions import conditions
from overtaking.labels.signals.reference import I32, METRES, Neighbours
from overtaking.model.events import Events
from overtaking.model.signals import Around, Signals, TargetSignals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role
from overtaking.world.compiled import chosen_level, constant_values
from overtaking.world.constants import constants, known

_SIGNALS = {
    "lane": np.uint8,
    "lateral": np.float32,
    "lateral_speed": np.float32,
    "speed": np.float32,
    "accel": np.float32,
    "right_reach": np.float32,
    "left_reach": np.float32,
    "friction": np.float32,
    "sight_lit": np.float32,
    "sight_unlit": np.float32,
}
_LEFT = {"left_occupancy": np.float32, "left_count": np.uint8}
_OF_TARGET = {
    "valid": np.bool_,
    "lead": np.float32,
    "overlaps": np.bool_,
    "gap": np.float32,
    "lateral": np.float32,
    "lateral_gap": np.float32,
    "lane": np.uint8,
    "speed": np.float32,
    "accel": np.float32,
    "lateral_speed": np.float32,
}
_GAPS = ("gap", "closing_speed", "lateral_gap")

Arrays = dict[str, NDArray[Any]]
Index = NDArray[np.intp]


def signals(
    trajectories: Trajectories, *, level: str | None = None, buffers: Buffers | None = None
) -> Signals:
    """The signals of a batch; see `model.signals.Signals`.

    Gaps to all neighbours and the lane to the left are worked out when somebody asks for them.

    Args:
        trajectories: The batch, of any origin and rate; what it holds must not change.
        level: SIMD level, as in `world.compiled.chosen_level`; the result is the same.
        buffers: Memory to use again; the returned batch is then valid until the next call with it.

    Raises:
        ConfigError: The SIMD level is unknown or this CPU lacks it.
    """
    buffers = buffers or Buffers()
    outputs = _outputs(trajectories, _SIGNALS, buffers)
    vehicle = buffers.array("vehicle", _wide(trajectories), np.uint8)
    _core.signals(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        around=_around(trajectories),
        constants=constant_values(constants()),
        outputs=outputs | {"vehicle": vehicle},
        level=chosen_level(level),
    )
    gaps = partial(_gaps, trajectories, vehicle, level)
    left = partial(_left, trajectories, level)
    later: dict[str, Callable[[], Arrays]] = {
        "s": partial(_place, trajectories),
        "valid": lambda: {"valid": trajectories.frame_valid},
    }
    return Signals.partly(
        later | dict.fromkeys(_GAPS, gaps) | dict.fromkeys(_LEFT, left),
        frame_interval_ms=trajectories.scenario.frame_interval_ms,
        vehicle=vehicle,
        **outputs,
    )


def target_signals(
    trajectories: Trajectories, seen: Signals, events: Events, *, level: str | None = None
) -> TargetSignals:
    """The target of each simulation, frame by frame; see `model.signals.TargetSignals`.

    Its frames are worked out when somebody asks for them.

    Args:
        trajectories: The batch.
        seen: Its signals.
        events: What names the targets.
        level: As in `signals`.

    Raises:
        ValueError: A target is no vehicle of the recording.
    """
    vehicle, length = events.target, trajectories.scenario.vehicles.length
    slot = np.where(vehicle == NO_VEHICLE, Role.EGO, vehicle).astype(np.intp)
    if slot.size and slot.max() >= length.shape[1]:
        raise ValueError(f"target: no vehicle {slot.max()}")
    work_out = partial(_target, trajectories, seen, vehicle, level)
    return TargetSignals.partly(
        dict.fromkeys(_OF_TARGET, work_out),
        vehicle=vehicle,
        length=length[np.arange(len(slot)), slot],
    )


def neighbours_at(
    trajectories: Trajectories, seen: Signals, place: Around | Index, rows: Index, frames: Index
) -> Neighbours:
    """The neighbours of single frames, as in `Signals`, without those of all others.

    Args:
        trajectories: The batch.
        seen: Its signals.
        place: Place around the ego, or one for each instant.
        rows: Simulations, shape (instant,).
        frames: A recorded frame of each, same shape.
    """
    if not seen.is_original:  # Somebody asks what would be if gaps were others.
        return reference.neighbours_at(trajectories, seen, place, rows, frames)
    kinds = {"vehicle": np.uint8, "gap": np.float32, "closing_speed": np.float32}
    found: Arrays = {name: np.empty(len(rows), kind) for name, kind in kinds.items()}
    recorded, places = trajectories.states, np.broadcast_to(np.int64(place), np.shape(rows))
    _core.neighbours_at(
        near={
            "s": recorded.s,
            "speed": recorded.speed,
            "length": trajectories.scenario.vehicles.length,
            "vehicle": seen.vehicle,
        },
        rows=np.ascontiguousarray(rows, np.int64),
        places=np.ascontiguousarray(places),
        frames=np.ascontiguousarray(frames, np.int64),
        out=found,
    )
    return Neighbours(**found)


def alongside(
    trajectories: Trajectories, seen: Signals, vehicle: NDArray[np.uint8], span: tuple[I32, I32]
) -> Arrays:
    """Some signals of the target in some frames of each simulation, one after the other.

    Args:
        trajectories: The batch.
        seen: Its signals.
        vehicle: Slot of the target of each simulation, `NO_VEHICLE` without one.
        span: First and last frame, shape (simulation,); none where the last is before the first.

    Returns:
        overlaps, lane, lateral_gap and accel as in `TargetSignals`, shape (instant,).
    """
    start, stop = (np.ascontiguousarray(each, np.int32) for each in span)
    names = ("overlaps", "lane", "lateral_gap", "accel")
    count = int(np.maximum(stop - start + 1, 0).sum())
    found: Arrays = {name: np.empty(count, _OF_TARGET[name]) for name in names}
    _core.alongside(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        own=_own(seen, vehicle),
        start=start,
        stop=stop,
        out=found,
        level=chosen_level(),
    )
    return found


def _place(trajectories: Trajectories) -> Arrays:
    return {"s": as_f32(trajectories.states.s[:, Role.EGO]) * METRES}


def _gaps(trajectories: Trajectories, vehicle: NDArray[np.uint8], level: str | None) -> Arrays:
    shape = _wide(trajectories)
    outputs: Arrays = {name: Buffers().array(name, shape, np.float32) for name in _GAPS}
    _core.neighbours(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        vehicle=flat(vehicle),
        outputs=outputs,
        level=chosen_level(level),
    )
    return outputs


def _left(trajectories: Trajectories, level: str | None) -> Arrays:
    outputs = _outputs(trajectories, _LEFT, Buffers())
    _core.left_lane(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        num_lanes=trajectories.road.num_lanes,
        outputs=outputs,
        level=chosen_level(level),
    )
    return outputs


def _target(
    trajectories: Trajectories, seen: Signals, vehicle: NDArray[np.uint8], level: str | None
) -> Arrays:
    outputs = _outputs(trajectories, _OF_TARGET, Buffers())
    _core.target(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        own=_own(seen, vehicle),
        outputs=outputs,
        level=chosen_level(level),
    )
    return outputs


def _own(seen: Signals, vehicle: NDArray[np.uint8]) -> Arrays:
    """The target, and where the ego is across the road."""
    reaches = ("lateral", "right_reach", "left_reach")
    place = {name: flat(getattr(seen, name)) for name in reaches}
    return {"target": np.ascontiguousarray(vehicle, np.uint8)} | place


def _around(trajectories: Trajectories) -> dict[str, Any]:
    given = conditions(trajectories)
    lamp = given.lamp_intensity / given.lamp_threshold
    return {
        "film": flat(given.film),
        "wear": flat(given.wear),
        "truck": flat(given.truck),
        "fog": flat(given.fog_extinction),
        "rain": flat(given.rain_extinction),
        "contrast_depth": maximum(given.contrast_depth, np.float32(0.0)),
        "lamp_depth": log(lamp),
        "lamp_clear": np.sqrt(lamp),
        "unlit_limit": flat(given.unlit_limit),
        "attention": float(known("model.perception.range")),
        "num_lanes": trajectories.road.num_lanes,
    }


def _wide(trajectories: Trajectories) -> tuple[int, int, int]:
    """Shape of neighbours."""
    simulations, frames = trajectories.stage.shape
    return simulations, len(Around), frames


def _outputs(trajectories: Trajectories, kinds: Mapping[str, Any], buffers: Buffers) -> Arrays:
    shape = trajectories.stage.shape
    return {name: buffers.array(name, shape, kind) for name, kind in kinds.items()}
