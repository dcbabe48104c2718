"""The Rust engine: the same model as `sim.reference`, sixteen simulations at a time."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.arrays import F32, ArrayLayout, Buffers
from overtaking.core.native import simd_level
from overtaking.model.batch import batch_fields
from overtaking.model.driver_interface import Actions
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import (
    STATE_DTYPES,
    Contacts,
    Percepts,
    States,
    Trajectories,
    with_world_coordinates,
)
from overtaking.world.constants import engine_constants
from overtaking.world.step_parameters import ParameterSwitch, StepParameters, step_parameters

_WIDE, _BYTE = np.int32, np.uint8
_BELIEF_TYPES = {
    name: _BYTE if field.is_flag else field.dtype.type
    for name, field in batch_fields(Percepts).items()
    if field.dtype and field.axes == Percepts.AXES
}
"""Types of the recorded beliefs about a neighbour; flags come as bytes."""


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
    return run(scenario, step_parameters(scenario), level=level, buffers=buffers)


def run(
    scenario: Scenario,
    params: StepParameters,
    switches: Sequence[ParameterSwitch] = (),
    *,
    actions: Actions | None = None,
    level: str | None = None,
    buffers: Buffers | None = None,
) -> Trajectories:
    """Simulate a batch from its parameters.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        switches: Parameters that take over at later steps, in their order.
        actions: What another driver did with the ego; None for the model's own.
        level: As in `simulate`.
        buffers: As in `simulate`.
    """
    room = -(-params.num_frames // _core.SIMD_LANES) * _core.SIMD_LANES
    outputs = _allocate_outputs(
        scenario.num_simulations, scenario.num_slots, room, buffers or Buffers()
    )
    forced = simd_level(level)
    flat = {name: array.reshape(-1) for name, array in outputs.items()}
    later = [
        (
            one.vehicle_table.reshape(-1),
            one.simulation_table.reshape(-1),
            one.scenario_index,
            _flat(one.judgement_errors),
            step,
        )
        for step, one in switches
    ]
    _core.simulate(
        vehicle=params.vehicle_table.reshape(-1),
        simulation=params.simulation_table.reshape(-1),
        scenario_index=params.scenario_index,
        num_slots=scenario.num_slots,
        frames=room,
        seed=params.seed,
        steps_per_frame=params.steps_per_frame,
        road=road_values(params),
        constants=engine_constants(params.constants),
        outputs=flat,
        switches=later,
        action_log=None if actions is None else (actions.kind, actions.values),
        level=forced,
    )
    return dataclasses.replace(_to_trajectories(scenario, outputs), actions=actions)


def _flat(judged: F32 | None) -> F32 | None:
    return None if judged is None else judged.reshape(-1)


def road_values(params: StepParameters) -> dict[str, Any]:
    """The road as the compiled engine takes it."""
    road = params.road
    pose = [road.x0, road.y0, road.heading, road.cosine, road.sine]
    return {
        "num_lanes": road.num_lanes,
        "boundaries": road.boundaries.tolist(),
        "film_path": road.film_path.tolist(),
        "overtaking_sign": float(road.overtaking_sign),
        "pose": [float(number) for number in pose],
        "num_own_lanes": road.num_own_lanes,
        "has_oncoming_traffic": road.has_oncoming_traffic,
        "length": float(road.length),
        "edge_sum": float(road.edge_sum),
        "sight": road.sight.tolist(),
        "solid_line": road.solid_line.tolist(),
        "course_table": np.concatenate(road.course_table).tolist(),
    }


def _allocate_outputs(
    batch: int, slots: int, frames: int, buffers: Buffers
) -> dict[str, NDArray[Any]]:
    array = buffers.array
    shape = (batch, slots, frames)
    states = tuple(ArrayLayout(name, shape, dtype) for name, dtype in STATE_DTYPES.items())
    # With how far each row is written: so the engine clears no more than was ever there.
    written = ArrayLayout("written", shape[:2], _WIDE)
    outputs = buffers.arrays("states", (*states, written))
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
    for name, dtype in _BELIEF_TYPES.items():
        outputs[f"percept_{name}"] = array(f"percept_{name}", (*rows, 3), dtype)
    outputs["trace_hash"] = array("trace_hash", (batch, 4), np.uint32)
    return outputs


def _to_trajectories(scenario: Scenario, out: dict[str, NDArray[Any]]) -> Trajectories:
    # A batch of no simulations gets one frame, because NumPy has no minimum over zero frames.
    longest = int(out["num_frames"].max(initial=1))
    states = States(**{name: _read_only(out[name][:, :, :longest]) for name in STATE_DTYPES})
    running = np.arange(longest) < out["num_frames"][:, None, None]
    there = scenario.vehicles.valid[:, :, None] & running
    return Trajectories(
        scenario=scenario,
        num_frames=out["num_frames"],
        states=with_world_coordinates(scenario.road, states, there),
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
            is_detected=out["percept_is_detected"].view(bool),
            **{name: out[f"percept_{name}"] for name in _BELIEF_TYPES if name != "is_detected"},
        ),
        trace_hash=out["trace_hash"],
    )


def _read_only(states: NDArray[Any]) -> NDArray[Any]:
    """Recorded states, read-only: the zeros behind them are not cleared again."""
    states.setflags(write=False)
    return states
