"""The Rust engine: the same model as `sim.reference`, sixteen simulations at a time."""

import math
import os
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.core.memory import as_left, empty
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Contacts, Percepts, States, Trajectories
from overtaking.world.constants import Constants
from overtaking.world.parameters import Parameters, parameters

SIMD_VARIABLE = "OVERTAKING_SIMD"
"""Environment variable that forces a SIMD level: avx512, avx2, sse2, neon or portable."""

_WIDE, _HALF, _BYTE = np.int32, np.int16, np.uint8
_STATE_TYPES = {
    "x": _WIDE,
    "y": _WIDE,
    "s": _WIDE,
    "d": _WIDE,
    "speed": _WIDE,
    "heading": _HALF,
    "wheel_angle": _HALF,
    "accel_lon": _HALF,
    "accel_lat": _HALF,
    "yaw_rate": _HALF,
    "lane": _BYTE,
    "lights": _BYTE,
}
_PERCEPT_TYPES = {
    "vehicle": _BYTE,
    "detected": _BYTE,
    "gap": _WIDE,
    "closing_speed": _WIDE,
    "true_gap": _WIDE,
    "true_closing_speed": _WIDE,
}


_LINE_BYTES = 64
"""Arrays begin where a line of the CPU's cache does."""

Layout = tuple[tuple[str, tuple[int, ...], type[np.generic]], ...]
"""Names, shapes and types of some arrays."""


class Buffers:
    """Output arrays that are used again as long as they are large enough.

    Without one, memory is used again too, but only when nobody looks at the last batch any more.
    """

    def __init__(self) -> None:
        """Start without memory."""
        self._memory: dict[str, NDArray[Any]] = {}
        self._layouts: dict[str, Layout] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """An array of this shape whose content means nothing; valid until asked for again."""
        size = int(np.prod(shape, dtype=np.int64))
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = empty(size, dtype)
        return memory[:size].reshape(shape)

    def together(self, name: str, layout: "Layout") -> dict[str, NDArray[Any]]:
        """Arrays that are zero, or what was left in arrays of the same layout; valid as above.

        Args:
            name: Of all of them together.
            layout: Name, shape and type of each.
        """
        sizes = [math.prod(shape) * np.dtype(kind).itemsize for _, shape, kind in layout]
        ends = list(accumulate(-(-size // _LINE_BYTES) * _LINE_BYTES for size in sizes))
        if self._layouts.get(name) != layout:
            self._layouts[name], self._memory[name] = layout, as_left(layout, ends[-1])
        memory, begins = self._memory[name], [0, *ends]
        return {
            field: memory[begin : begin + size].view(kind).reshape(shape)
            for (field, shape, kind), begin, size in zip(layout, begins, sizes, strict=False)
        }


def simulate(
    scenario: Scenario, *, level: str | None = None, buffers: Buffers | None = None
) -> Trajectories:
    """Simulate a batch.

    Args:
        scenario: A batch of scenarios.
        level: SIMD level; None for `OVERTAKING_SIMD` or the best of this CPU. The result is the
            same.
        buffers: Memory to use again; the returned batch is then valid until the next call with it.

    Raises:
        ConfigError: The SIMD level is unknown or this CPU lacks it.
    """
    return run(scenario, parameters(scenario), level=level, buffers=buffers)


def chosen_level(level: str | None = None) -> str | None:
    """The SIMD level to ask the engine for: this one, that of `OVERTAKING_SIMD`, or None.

    Raises:
        ConfigError: It is unknown, or this CPU lacks it.
    """
    forced = level or os.environ.get(SIMD_VARIABLE) or None
    known = [name for name, is_available in _core.simd_levels() if is_available]
    if forced is not None and forced not in known:
        raise ConfigError.of(
            what="SIMD level",
            where=SIMD_VARIABLE,
            expected=", ".join(known),
            got=forced,
            next_step="unset it or choose another level",
        )
    return forced


def run(
    scenario: Scenario,
    given: Parameters,
    later: Parameters | None = None,
    switch: int = 0,
    *,
    level: str | None = None,
    buffers: Buffers | None = None,
) -> Trajectories:
    """Simulate a batch from its parameters; from step `switch` on with the parameters `later`."""
    room = -(-given.num_frames // _core.LANES) * _core.LANES
    outputs = _outputs(scenario.num_simulations, scenario.num_slots, room, buffers or Buffers())
    forced = chosen_level(level)
    flat = {name: array.reshape(-1) for name, array in outputs.items()}
    afterwards = None
    if later is not None:
        afterwards = (later.vehicle.reshape(-1), later.simulation.reshape(-1), switch)
    _core.simulate(
        vehicle=given.vehicle.reshape(-1),
        simulation=given.simulation.reshape(-1),
        index=given.index,
        slots=scenario.num_slots,
        frames=room,
        seed=given.seed,
        record_every=given.record_every,
        road=road_values(given),
        constants=constant_values(given.constants),
        outputs=flat,
        later=afterwards,
        level=forced,
    )
    return _trajectories(scenario, outputs)


def road_values(given: Parameters) -> dict[str, Any]:
    """The road as the compiled engine takes it."""
    road = given.road
    pose = [road.x0, road.y0, road.heading, road.cosine, road.sine]
    return {
        "num_lanes": road.num_lanes,
        "boundaries": road.boundaries.tolist(),
        "film_path": road.film_path.tolist(),
        "side": float(road.side),
        "pose": [float(number) for number in pose],
    }


def constant_values(c: Constants) -> dict[str, Any]:
    """The constants as the compiled engine takes them."""
    return {
        "values": [float(c.values[name]) for name in _core.constant_fields()],
        "friction_new": [[float(x) for x in row] for row in c.friction_new],
        "friction_worn": [[float(x) for x in row] for row in c.friction_worn],
        "friction_speeds": [float(x) for x in c.friction_speeds],
        "friction_films": [float(x) for x in c.friction_films],
    }


def _outputs(batch: int, slots: int, frames: int, buffers: Buffers) -> dict[str, NDArray[Any]]:
    array = buffers.array
    shape = (batch, slots, frames)
    states: Layout = tuple((name, shape, kind) for name, kind in _STATE_TYPES.items())
    # With how far each row is written: so the engine clears no more than was ever there.
    outputs = buffers.together("states", (*states, ("written", shape[:2], _WIDE)))
    outputs |= {name: array(name, (batch, frames), _BYTE) for name in ("stage", "collided_with")}
    outputs["num_frames"] = array("num_frames", (batch,), _WIDE)
    outputs["contact_partner"] = array("contact_partner", (batch, slots), _BYTE)
    for name in ("contact_time", "contact_impulse", "contact_speed"):
        outputs[name] = array(name, (batch, slots), _WIDE)
    rows = (batch, _core.MAX_PERCEPTS)
    outputs |= {
        f"percept_{name}": array(f"percept_{name}", rows, _BYTE) for name in ("valid", "kind")
    }
    outputs["percept_time"] = array("percept_time", rows, _WIDE)
    for name, dtype in _PERCEPT_TYPES.items():
        outputs[f"percept_{name}"] = array(f"percept_{name}", (*rows, 3), dtype)
    outputs["trace_hash"] = array("trace_hash", (batch, 4), np.uint32)
    return outputs


def _trajectories(scenario: Scenario, out: dict[str, NDArray[Any]]) -> Trajectories:
    longest = int(out["num_frames"].max()) if scenario.num_simulations else 0
    percepts = {name: out[f"percept_{name}"] for name in _PERCEPT_TYPES if name != "detected"}
    return Trajectories(
        scenario=scenario,
        num_frames=out["num_frames"],
        states=States(**{name: _kept(out[name][:, :, :longest]) for name in _STATE_TYPES}),
        stage=out["stage"][:, :longest],
        collided_with=out["collided_with"][:, :longest],
        contacts=Contacts(
            partner=out["contact_partner"],
            time=out["contact_time"],
            impulse=out["contact_impulse"],
            closing_speed=out["contact_speed"],
        ),
        percepts=Percepts(
            valid=out["percept_valid"].view(bool),
            kind=out["percept_kind"],
            time=out["percept_time"],
            detected=out["percept_detected"].view(bool),
            **percepts,
        ),
        trace_hash=out["trace_hash"],
    )


def _kept(states: NDArray[Any]) -> NDArray[Any]:
    """Recorded states, which nobody may change: what is zero behind them is not cleared again."""
    states.setflags(write=False)
    return states
