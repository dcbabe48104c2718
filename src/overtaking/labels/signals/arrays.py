"""Arrays as the compiled engine takes them; copies only where they lie otherwise in memory."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.signals.reference import half_window, side_of
from overtaking.model.trajectory import NO_VEHICLE, Trajectories


def adjacent(values: NDArray[Any]) -> NDArray[Any]:
    """`values` with the frames of a vehicle side by side."""
    return values if values.strides[-1] == values.itemsize else np.ascontiguousarray(values)


def flat(values: NDArray[Any]) -> NDArray[Any]:
    """`values` in one row."""
    return np.ascontiguousarray(values).reshape(-1)


def expect_slots(trajectories: Trajectories, vehicle: NDArray[np.uint8]) -> None:
    """Refuse neighbours that are no slots of a recording.

    Raises:
        ValueError: One of them is none.
    """
    slots = trajectories.states.s.shape[1]
    if ((vehicle >= slots) & (vehicle != NO_VEHICLE)).any():
        raise ValueError("vehicle: expected slots of the recording")


def states(trajectories: Trajectories) -> dict[str, NDArray[Any] | None]:
    """What is recorded of every vehicle, shape (simulation, vehicle, time)."""
    recorded, present = trajectories.states, trajectories.present
    names = ("s", "d", "speed", "heading", "lane")
    arrays = {name: adjacent(getattr(recorded, name)) for name in names}
    return arrays | {
        "accel": adjacent(recorded.accel_lon),
        "present": None if present is None else adjacent(present),
    }


def vehicles(trajectories: Trajectories) -> dict[str, Any]:
    """The vehicles, and how road and clock measure them."""
    bodies, road = trajectories.scenario.vehicles, trajectories.road
    interval_ms = trajectories.scenario.frame_interval_ms
    return {
        "num_frames": np.ascontiguousarray(trajectories.num_frames),
        "valid": flat(bodies.valid),
        "length": flat(bodies.length),
        "width": flat(bodies.width),
        "side": float(side_of(road)),
        "heading": float(np.float32(road.heading)),
        "interval_ms": interval_ms,
        "half_window": half_window(interval_ms),
    }
