"""The signals by the compiled engine: those of `signals.reference`, bit for bit."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import log, maximum
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import Trajectories
from overtaking.physics.constants import constants, known
from overtaking.signals.conditions import Conditions, conditions
from overtaking.signals.reference import half_window, side_of
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
        states=_states(trajectories),
        around=_around(trajectories, conditions(trajectories)),
        constants=constant_values(constants()),
        outputs=outputs,
        level=level or os.environ.get(SIMD_VARIABLE) or None,
    )
    return Signals(
        frame_interval_ms=trajectories.scenario.frame_interval_ms,
        valid=trajectories.frame_valid,
        **outputs,
    )


def _states(trajectories: Trajectories) -> dict[str, NDArray[Any] | None]:
    states = trajectories.states
    names = ("s", "d", "speed", "heading", "lane")
    arrays = {name: _adjacent(getattr(states, name)) for name in names}
    present = trajectories.present
    return arrays | {
        "accel": _adjacent(states.accel_lon),
        "present": None if present is None else _adjacent(present),
    }


def _adjacent(values: NDArray[Any]) -> NDArray[Any]:
    """`values` with the frames of a vehicle side by side; a copy only if they are not."""
    return values if values.strides[-1] == values.itemsize else np.ascontiguousarray(values)


def _around(trajectories: Trajectories, given: Conditions) -> dict[str, Any]:
    bodies, road = trajectories.scenario.vehicles, trajectories.road
    lamp = given.lamp_intensity / given.lamp_threshold
    return {
        "num_frames": np.ascontiguousarray(trajectories.num_frames),
        "valid": _flat(bodies.valid),
        "length": _flat(bodies.length),
        "width": _flat(bodies.width),
        "film": _flat(given.film),
        "wear": _flat(given.wear),
        "truck": _flat(given.truck),
        "fog": _flat(given.fog_extinction),
        "rain": _flat(given.rain_extinction),
        "contrast_depth": maximum(given.contrast_depth, np.float32(0.0)),
        "lamp_depth": log(lamp),
        "lamp_clear": np.sqrt(lamp),
        "unlit_limit": _flat(given.unlit_limit),
        "attention": float(known("model.perception.range")),
        "side": float(side_of(road)),
        "heading": float(np.float32(road.heading)),
        "num_lanes": road.num_lanes,
        "interval_ms": trajectories.scenario.frame_interval_ms,
        "half_window": half_window(trajectories.scenario.frame_interval_ms),
    }


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(values).reshape(-1)


def _outputs(trajectories: Trajectories, buffers: Buffers) -> dict[str, NDArray[Any]]:
    shape = trajectories.stage.shape
    wide = (shape[0], len(Around), shape[1])
    array = buffers.array
    outputs = {name: array(name, shape, np.float32) for name in _ROWS}
    outputs |= {name: array(name, shape, np.uint8) for name in _BYTES}
    outputs |= {name: array(name, wide, np.float32) for name in _NEIGHBOURS}
    return outputs | {"vehicle": array("vehicle", wide, np.uint8)}
