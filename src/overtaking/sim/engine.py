"""The compiled engine in Rust: the same model as `sim.reference`, sixteen simulations at a time.

This module allocates the output arrays of a batch (simulations that run together), passes all
inputs to the engine as flat arrays and numbers, and wraps the outputs as `Trajectories`.
`StepParameters` and `RoadParameters` describe the inputs, `Trajectories` the outputs, with shapes
and units. A slot is the number of a vehicle in its simulation; a frame is a recorded instant.
"""

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
    PerceivedVehicle,
    Percepts,
    States,
    Trajectories,
    with_world_coordinates,
)
from overtaking.world.constants import engine_constants
from overtaking.world.step_parameters import ParameterSwitch, StepParameters, step_parameters

_BELIEF_TYPES = {
    name: np.uint8 if field.is_flag else field.dtype.type
    for name, field in batch_fields(Percepts).items()
    # Fields about the manoeuvre are left out. They have no axis of perceived vehicles, the last of
    # `AXES`. Without a dtype a field is no array.
    if field.dtype and field.axes == Percepts.AXES
}
"""Type of each field of `Percepts` about a neighbour. The engine writes flags as bytes.

`Percepts` record the beliefs of the ego's driver about its neighbours at each of its decisions to
change lanes or to cancel."""


def simulate(
    scenario: Scenario, *, level: str | None = None, buffers: Buffers | None = None
) -> Trajectories:
    """Simulate a batch.

    Args:
        scenario: A batch of scenarios.
        level: SIMD level; None for `OVERTAKING_SIMD` or the best of this CPU. The result is the
            same.
        buffers: Memory for the outputs. The next call with the same buffers overwrites the returned
            arrays; without buffers each call has its own memory.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU does not have it.
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
        switches: Parameters that replace `params` at later steps, in the order of the steps.
        actions: Recorded actions of an external driver; None lets the model driver drive the ego.
        level: As in `simulate`.
        buffers: As in `simulate`.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU does not have it.
    """
    outputs = allocate_outputs(scenario, params, buffers or Buffers())
    checked_level = simd_level(level)
    # Outputs and the tables of switches are contiguous, so `reshape` returns views without gaps.
    flat_outputs = {name: array.reshape(-1) for name, array in outputs.items()}
    switch_inputs = [
        (
            new_params.vehicle_table.reshape(-1),
            new_params.simulation_table.reshape(-1),
            new_params.scenario_index,
            # Only a switch sets these errors; at the start of a simulation the engine draws them.
            _flatten(new_params.judgement_errors),
            step,
        )
        for step, new_params in switches
    ]
    _core.simulate(
        engine_inputs(params),
        # Length of the arrays. Each simulation ends at `last_step` of the `simulation_table`.
        frames=outputs["stage"].shape[1],
        outputs=flat_outputs,
        switches=switch_inputs,
        action_log=None if actions is None else (actions.kind, actions.values),
        level=checked_level,
    )
    return dataclasses.replace(to_trajectories(scenario, outputs), actions=actions)


def _flatten(judgement_errors: F32 | None) -> F32 | None:
    """The errors as one row of numbers, if there are any."""
    return None if judgement_errors is None else judgement_errors.reshape(-1)


def engine_inputs(params: StepParameters) -> _core.Inputs:
    """The parameters of a batch as the engine reads them, for any number of calls.

    The engine reads contiguous parameters in place at each call, so the caller must not change the
    arrays between two calls.

    Args:
        params: Parameters of a batch.

    Raises:
        ValueError: There are more slots than the engine has, or an array has another type.
    """
    return _core.Inputs(
        # In `sim.pedal_driving` the table of a group of vehicles is not contiguous. `ravel` copies
        # it, while `reshape` may return a view with gaps, which the engine refuses.
        vehicle=params.vehicle_table.ravel(),
        simulation=params.simulation_table.ravel(),
        scenario_index=params.scenario_index,
        num_slots=params.vehicle_table.shape[1],
        seed=params.seed,
        steps_per_frame=params.steps_per_frame,
        road=road_inputs(params),
        constants=engine_constants(params.constants),
    )


def road_inputs(params: StepParameters) -> dict[str, Any]:
    """The fields of `RoadParameters` as numbers and lists, which the engine reads by name."""
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
        # All rows in turn; they are equally long.
        "course_table": np.concatenate(road.course_table).tolist(),
    }


def allocate_outputs(
    scenario: Scenario, params: StepParameters, buffers: Buffers
) -> dict[str, NDArray[Any]]:
    """The arrays that the engine fills, by the names under which it looks them up.

    Counts and measured values are int32, codes and flags are bytes.

    Args:
        scenario: A batch of scenarios.
        params: Parameters of the batch.
        buffers: Memory for the arrays.
    """
    num_simulations, num_slots = scenario.num_simulations, scenario.num_slots
    # The engine transposes squares of 16 simulations by 16 frames, so it writes 16 frames at a
    # time. The number of frames is rounded up to a multiple of 16.
    num_frames = -(-params.num_frames // _core.SIMD_LANES) * _core.SIMD_LANES
    array = buffers.array
    shape = (num_simulations, num_slots, num_frames)
    states = tuple(ArrayLayout(name, shape, dtype) for name, dtype in STATE_DTYPES.items())
    # `written` holds how many frames of each vehicle are filled. In reused memory the engine then
    # clears only the frames that the previous batch has filled. `arrays` reuses both together.
    written = ArrayLayout("written", shape[:2], np.int32)
    outputs = buffers.arrays("states", (*states, written))
    outputs |= {
        name: array(name, (num_simulations, num_frames), np.uint8)
        for name in ("stage", "collided_with")
    }
    outputs["num_frames"] = array("num_frames", (num_simulations,), np.int32)
    outputs["contact_partner"] = array("contact_partner", (num_simulations, num_slots), np.uint8)
    for name in ("contact_time", "contact_impulse", "contact_speed"):
        outputs[name] = array(name, (num_simulations, num_slots), np.int32)
    # `MAX_PERCEPTS`: largest number of recorded decisions of a simulation.
    percept_shape = (num_simulations, _core.MAX_PERCEPTS)
    outputs |= {
        f"percept_{name}": array(f"percept_{name}", percept_shape, np.uint8)
        for name in ("valid", "kind")
    }
    outputs["percept_time"] = array("percept_time", percept_shape, np.int32)
    for name, dtype in _BELIEF_TYPES.items():
        shape_by_vehicle = (*percept_shape, len(PerceivedVehicle))
        outputs[f"percept_{name}"] = array(f"percept_{name}", shape_by_vehicle, dtype)
    # A hash over the recorded integers of each simulation, four words of 32 bits.
    outputs["trace_hash"] = array("trace_hash", (num_simulations, 4), np.uint32)
    return outputs


def to_trajectories(scenario: Scenario, outputs: dict[str, NDArray[Any]]) -> Trajectories:
    """The outputs of the engine as a recording, cut after the longest simulation.

    Args:
        scenario: The batch of scenarios.
        outputs: The arrays of `allocate_outputs`, filled by the engine. The recording contains
            views of them.
    """
    # A batch of no simulations gets one frame, because labels contain minima over the frames, and
    # NumPy has no minimum over zero frames.
    max_frames = int(outputs["num_frames"].max(initial=1))
    states = States(**{name: _read_only(outputs[name][:, :, :max_frames]) for name in STATE_DTYPES})
    is_running = np.arange(max_frames) < outputs["num_frames"][:, None, None]
    is_recorded = scenario.vehicles.valid[:, :, None] & is_running
    return Trajectories(
        scenario=scenario,
        num_frames=outputs["num_frames"],
        states=with_world_coordinates(scenario.road, states, is_recorded),
        stage=outputs["stage"][:, :max_frames],
        collided_with=outputs["collided_with"][:, :max_frames],
        contacts=Contacts(
            partner=outputs["contact_partner"],
            time=outputs["contact_time"],
            impulse=outputs["contact_impulse"],
            closing_speed=outputs["contact_speed"],
        ),
        percepts=Percepts(
            valid=outputs["percept_valid"].view(bool),
            kind=outputs["percept_kind"],
            time=outputs["percept_time"],
            is_detected=outputs["percept_is_detected"].view(bool),  # The only flag of a neighbour.
            **{name: outputs[f"percept_{name}"] for name in _BELIEF_TYPES if name != "is_detected"},
        ),
        trace_hash=outputs["trace_hash"],
    )


def _read_only(states: NDArray[Any]) -> NDArray[Any]:
    """Recorded states, protected against writing.

    The next batch in the same memory clears only the frames that the engine has written. Values
    that a caller wrote after these frames would appear in the states of that batch.
    """
    states.setflags(write=False)
    return states
