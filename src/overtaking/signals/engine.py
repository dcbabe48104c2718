"""The signals by the compiled engine: those of `reference` and `target`, bit for bit."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import log, maximum
from overtaking.model.events import Events
from overtaking.model.signals import Around, Signals, TargetSignals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role
from overtaking.physics.constants import constants, known
from overtaking.signals.arrays import flat, states, vehicles
from overtaking.signals.conditions import conditions
from overtaking.sim.engine import SIMD_VARIABLE, Buffers, constant_values

_BYTES = ("lane", "left_count")
_ROWS = (
    "s",
    "lateral",
    "lateral_speed",
    "speed",
    "accel",
    "right_reach",
    "left_reach",
    "left_occupancy",
    "friction",
    "sight_lit",
    "sight_unlit",
)
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
_NEIGHBOURS = ("gap", "closing_speed", "lateral_gap")


def signals(
    trajectories: Trajectories, *, level: str | None = None, buffers: Buffers | None = None
) -> Signals:
    """The signals of a batch; see `model.signals.Signals`.

    Args:
        trajectories: The batch, of any origin and rate.
        level: SIMD level, as in `sim.engine.simulate`; the result is the same.
        buffers: Memory to use again; the returned batch is then valid until the next call with it.

    Raises:
        ValueError: The SIMD level is unknown or this CPU lacks it.
    """
    outputs = _outputs(trajectories, buffers or Buffers())
    _core.signals(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        around=_around(trajectories),
        constants=constant_values(constants()),
        outputs=outputs,
        level=level or os.environ.get(SIMD_VARIABLE) or None,
    )
    return Signals(
        frame_interval_ms=trajectories.scenario.frame_interval_ms,
        valid=trajectories.frame_valid,
        **outputs,
    )


def target_signals(
    trajectories: Trajectories, seen: Signals, events: Events, *, level: str | None = None
) -> TargetSignals:
    """The target of each simulation, frame by frame; see `model.signals.TargetSignals`.

    Args:
        trajectories: The batch.
        seen: Its signals.
        events: What names the targets.
        level: As in `signals`.

    Raises:
        ValueError: As in `signals`.
    """
    vehicle, shape = events.target, trajectories.stage.shape
    array = Buffers().array
    outputs = {name: array(name, shape, kind) for name, kind in _OF_TARGET.items()}
    reaches = ("lateral", "right_reach", "left_reach")
    _core.target(
        states=states(trajectories),
        vehicles=vehicles(trajectories),
        own={"target": np.ascontiguousarray(vehicle, np.uint8)}
        | {name: flat(getattr(seen, name)) for name in reaches},
        outputs=outputs,
        level=level or os.environ.get(SIMD_VARIABLE) or None,
    )
    slot = np.where(vehicle == NO_VEHICLE, Role.EGO, vehicle).astype(np.intp)
    length = trajectories.scenario.vehicles.length[np.arange(len(slot)), slot]
    return TargetSignals(vehicle=vehicle, length=length, **outputs)


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


def _outputs(trajectories: Trajectories, buffers: Buffers) -> dict[str, NDArray[Any]]:
    shape = trajectories.stage.shape
    wide = (shape[0], len(Around), shape[1])
    array = buffers.array
    outputs = {name: array(name, shape, np.float32) for name in _ROWS}
    outputs |= {name: array(name, shape, np.uint8) for name in _BYTES}
    outputs |= {name: array(name, wide, np.float32) for name in _NEIGHBOURS}
    return outputs | {"vehicle": array("vehicle", wide, np.uint8)}
