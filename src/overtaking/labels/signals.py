"""Signals by the compiled engine: one place packs recordings for it, one reads its answers.

`tests/reference/labels` says the same one frame after the other.
"""

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.arrays import F32, U8, ArrayLayout, Buffers, IndexArray, empty_array
from overtaking.core.float32_math import as_f32, log, maximum
from overtaking.core.native import simd_level
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.snapshots import (
    METRES_PER_MM,
    is_oncoming,
    lane_borders,
    lateral_speed_half_window,
    overtaking_sign,
    slot_or_ego,
)
from overtaking.model.batch import Batch, batch_fields, cached_per_batch
from overtaking.model.ego_signals import EgoSignals, TargetSignals
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.road import MAX_LANES
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case
from overtaking.world.constants import engine_constants, model_constants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.road_surface import lane_film
from overtaking.world.sight_distance import sight_at
from overtaking.world.weather_parameters import weather_effects

ArraysByName = dict[str, NDArray[Any]]
DelayedArrays = dict[str, Callable[[], ArraysByName]]

SIGNALS_FOR_ENGINE = (
    *("lane", "lateral_position", "lateral_speed", "speed"),
    *("right_edge", "left_edge", "neighbour_slot"),
    *("friction", "sight_lit", "sight_unlit"),
)
"""Signals that further compiled functions read."""

_NEIGHBOUR_SIGNAL_NAMES = ("gap", "closing_speed", "lateral_gap", "left_occupancy", "left_count")
_PER_NEIGHBOUR = ("neighbour_slot", "gap", "closing_speed", "lateral_gap")
"""Signals of shape (simulation, neighbour, time)."""


def extract_signals_and_events(
    trajectories: Trajectories, limits: dict[str, Any]
) -> tuple[EgoSignals, ArraysByName]:
    """Signals and events of a batch, in one compiled call.

    Gaps to all neighbours and the lane to the left are computed at their first use.

    Args:
        trajectories: The batch, of any origin and rate; its arrays must not change afterwards.
        limits: The thresholds of events.

    Returns:
        The signals, and most of the events by name, shape (simulation,).

    Raises:
        ConfigError: `OVERTAKING_SIMD` is no SIMD level of this CPU.
    """
    names, recording = _core.FIELD_NAMES["events"], pack_recording(trajectories)
    events = np.empty((len(names), len(trajectories.num_frames)), np.int32)
    layouts = _array_layouts(trajectories, EgoSignals, (*SIGNALS_FOR_ENGINE, "accel"))
    zero_from = ArrayLayout("zero_from", trajectories.num_frames.shape, np.int32)
    # Most simulations end early: zeros behind their ends need not be written again.
    outputs = Buffers().arrays("signals", (*layouts, zero_from))
    _core.ego_signals_and_events(
        recording=recording,
        visibility=visibility_inputs(trajectories),
        thresholds=limits,
        constants=engine_constants(model_constants()),
        zero_from=outputs.pop("zero_from"),
        signals=outputs,
        events=events,
        level=simd_level(),
    )
    around = partial(_neighbour_signals, trajectories, outputs["neighbour_slot"])
    later: DelayedArrays = {
        "s": lambda: {"s": as_f32(trajectories.states.s[:, EGO_SLOT]) * METRES_PER_MM},
        "valid": lambda: {"valid": trajectories.frame_mask},
        **dict.fromkeys(_NEIGHBOUR_SIGNAL_NAMES, around),
    }
    _limit_sight_by_road(trajectories, outputs)
    interval = trajectories.scenario.frame_interval_ms
    signals = EgoSignals.partly(later, frame_interval_ms=interval, **outputs)
    return signals, dict(zip(names, events, strict=True))


def _limit_sight_by_road(trajectories: Trajectories, outputs: ArraysByName) -> None:
    """Nothing is seen beyond what the road shows."""
    if trajectories.road.course:
        s = trajectories.states.s[:, EGO_SLOT] * POSITION_RESOLUTION
        sight_of_road = sight_at(trajectories.road, s)
        for name in ("sight_lit", "sight_unlit"):
            np.minimum(outputs[name], as_f32(sight_of_road), out=outputs[name])


def target_signals(trajectories: Trajectories, signals: EgoSignals, vehicle: U8) -> TargetSignals:
    """The target of each simulation, computed frame by frame at its first use.

    Args:
        trajectories: The batch.
        signals: Its signals.
        vehicle: Slot of each target, `NO_VEHICLE` without a target, shape (simulation,).

    Raises:
        ValueError: A target is no vehicle of the recording.
    """
    slot, length = slot_or_ego(vehicle), trajectories.scenario.vehicles.length
    if slot.size and slot.max() >= length.shape[1]:
        raise ValueError(f"target: no vehicle {slot.max()}")
    return TargetSignals.partly(
        dict.fromkeys(_target_names(), partial(_frames_of_target, trajectories, signals, vehicle)),
        slot=vehicle,
        length=length[np.arange(len(slot)), slot],
    )


def encounters_at(
    case: Case, neighbour: NeighbourRole | IndexArray, rows: IndexArray, frames: IndexArray
) -> Encounter:
    """The ego and a neighbour at single frames, with the measures of the follower.

    Args:
        case: The batch.
        neighbour: Which neighbour, or one for each instant.
        rows: Simulations, shape (instant,).
        frames: A recorded frame of each, same shape.

    Returns:
        Arrays of shape (instant,).

    Raises:
        ValueError: A frame does not exist.
    """
    names, slot = _core.FIELD_NAMES["encounters"], np.empty(len(rows), np.uint8)
    out = np.empty((len(names), len(rows)), np.float32)
    instants = np.empty((3, len(rows)), np.int64)
    instants[:] = rows, np.broadcast_to(np.int64(neighbour), np.shape(rows)), frames
    _core.encounter_measures(
        recording=packed_recording(case),
        neighbour_slot=_contiguous_row(case.signals.neighbour_slot),
        instants=_contiguous_row(instants),
        slot=slot,
        out=out,
        level=simd_level(),
    )
    return Encounter(valid=slot != NO_VEHICLE, **dict(zip(names, out, strict=True)))


def frames_alongside_target(
    case: Case, ends: NDArray[np.int32]
) -> tuple[IndexArray, IndexArray, U8, NDArray[np.float32], NDArray[np.float32]]:
    """The frames in which ego and target overlap along the road, in order.

    Args:
        case: The batch.
        ends: First and then last frames in which to look, shape (2 simulation,).

    Returns:
        Simulation and frame of each, and of the target its lane, the gap between the sides of both
        [m], and its acceleration [m/s^2]; shape (instant,).
    """
    return _core.frames_alongside(
        recording=packed_recording(case),
        signals=pack_signals(case.signals),
        target_slot=np.ascontiguousarray(case.target.slot, np.uint8),
        span=ends,
        level=simd_level(),
    )


@cached_per_batch
def packed_recording(case: Case) -> dict[str, Any]:
    """`pack` of a case."""
    return pack_recording(case.trajectories)


def pack_recording(trajectories: Trajectories) -> dict[str, Any]:
    """A recording as compiled functions take it.

    On a two-way road the lane of oncoming traffic is one more lane to the left. Oncoming vehicles
    are left out: leaders, followers and targets drive in the direction of the ego.
    """
    states, bodies, road = trajectories.states, trajectories.scenario.vehicles, trajectories.road
    interval_ms, present = trajectories.scenario.frame_interval_ms, trajectories.is_recorded
    recorded = {name: getattr(states, name) for name in ("s", "d", "speed", "lane")}
    recorded["heading"], direction = trajectories.headings_and_origin
    recorded |= {"accel": states.accel_lon, "collided_with": trajectories.collided_with}
    if road.is_two_way:
        recorded["lane"] = _with_opposite_lane(trajectories)
        along = np.broadcast_to(~is_oncoming(trajectories)[:, :, None], states.s.shape)
        present = along.copy() if present is None else present & along
    return {
        **{name: with_adjacent_frames(values) for name, values in recorded.items()},
        "is_recorded": None if present is None else with_adjacent_frames(present),
        "num_frames": np.ascontiguousarray(trajectories.num_frames),
        **{name: _contiguous_row(getattr(bodies, name)) for name in ("valid", "length", "width")},
        "num_lanes": min(road.num_lanes + road.is_two_way, MAX_LANES),
        "overtaking_sign": float(overtaking_sign(road)),
        "direction": float(np.float32(direction)),
        "interval_ms": interval_ms,
        "half_window": lateral_speed_half_window(interval_ms),
    }


def _with_opposite_lane(trajectories: Trajectories) -> U8:
    """Lanes, with the next number for what is beyond the lane of oncoming traffic."""
    states, road = trajectories.states, trajectories.road
    edge = float(lane_borders(road)[-1])
    is_beyond_road = float(overtaking_sign(road)) * states.d > edge / POSITION_RESOLUTION
    return states.lane + (is_beyond_road & (states.lane == road.num_lanes)).view(np.uint8)


def pack_signals(signals: EgoSignals) -> ArraysByName:
    """Signals as compiled functions take them."""
    return {name: _contiguous_row(getattr(signals, name)) for name in SIGNALS_FOR_ENGINE}


def visibility_inputs(trajectories: Trajectories) -> dict[str, Any]:
    """Inputs of the signals beside the states; flat arrays of shape (simulation,).

    A stop is judged on the mean film of the lane: the driver cannot know which wheel will be
    in which puddle. Spray is left out: it hides only a vehicle whose own brake lamps announce it.

    Returns:
        film: Mean water film of each lane, puddles included, padded to eight lanes, shape
            (simulation, lane) [mm].
        tyre_wear, has_truck_tyres: Tread wear of the ego, and 1 for truck tyres.
        fog, rain: Extinction of fog, and of rain to an observer at rest [1/m].
        contrast_depth: Optical depth at which a vehicle of middling colour is lost.
        lamp_depth, lamp_clear: Logarithm of a rear lamp's intensity over the threshold, and its
            range in clear air [m].
        unlit_limit: Range of the ego's own lamps by night, the limit of attention by day [m].
        attention_range: That limit, a number [m].
    """
    scenario, attention = trajectories.scenario, constant("model.perception.range")
    ahead, bodies = weather_effects(scenario), scenario.vehicles
    sight, film = (
        ahead.sight,
        _mean_water_film(ahead.film, road_parameters(scenario.road).film_path),
    )
    lamp = np.full_like(ahead.rain_rate, constant("weather.lamps.rear_position"))
    lamp = lamp / sight["lamp_threshold"]
    depth = sight["log_contrast_sensitivity_ahead"] + log(constant("model.speed_choice.contrast"))
    inverse = maximum(sight["inverse_lit_range"], np.float32(1.0) / attention)
    arrays = {
        "film": film,
        "tyre_wear": bodies.tyre_wear[:, EGO_SLOT],
        "has_truck_tyres": as_f32(bodies.kind[:, EGO_SLOT] == VehicleKind.TRUCK),
        "fog": sight["fog_extinction"],
        "rain": sight["rain_extinction"],
        "contrast_depth": maximum(depth, np.float32(0.0)),
        "lamp_depth": log(lamp),
        "lamp_clear": np.sqrt(lamp),
        "unlit_limit": np.float32(1.0) / inverse,
    }
    flat = {name: _contiguous_row(values) for name, values in arrays.items()}
    return {**flat, "attention_range": float(attention)}


def _mean_water_film(water: dict[str, F32], film_path: F32) -> F32:
    """Film of each lane with the puddles spread evenly over it, (simulation, lane) [mm]."""
    film = lane_film(
        water["min_wet_film"][:, None],
        water["film_rain_factor"][:, None],
        film_path[None, :],
        water["texture_depth"][:, None],
    )
    # See `film.puddle`: half the square of the threshold is the share that is under water.
    covered = np.float32(0.5) * water["puddle_threshold"] * water["puddle_threshold"]
    return film + (water["puddle_film"] * covered)[:, None]


def _neighbour_signals(trajectories: Trajectories, vehicle: U8) -> ArraysByName:
    outputs = _empty_arrays(trajectories, EgoSignals, _NEIGHBOUR_SIGNAL_NAMES)
    _core.neighbour_signals(
        recording=pack_recording(trajectories),
        neighbour_slot=_contiguous_row(vehicle),
        outputs=outputs,
        level=simd_level(),
    )
    return outputs


def _frames_of_target(trajectories: Trajectories, signals: EgoSignals, vehicle: U8) -> ArraysByName:
    outputs = _empty_arrays(trajectories, TargetSignals, _target_names())
    _core.target_signals(
        recording=pack_recording(trajectories),
        signals=pack_signals(signals),
        target_slot=np.ascontiguousarray(vehicle, np.uint8),
        outputs=outputs,
        level=simd_level(),
    )
    return outputs


def _target_names() -> list[str]:
    """The signals of the target that have a value for each frame."""
    return [name for name in batch_fields(TargetSignals) if name not in ("slot", "length")]


def _empty_arrays(
    trajectories: Trajectories, cls: type[Batch], names: Iterable[str]
) -> ArraysByName:
    """Arrays for some fields of a batch, of their types, whose content means nothing yet."""
    return {
        name: empty_array(math.prod(shape), dtype).reshape(shape)
        for name, shape, dtype in _array_layouts(trajectories, cls, names)
    }


def _array_layouts(
    trajectories: Trajectories, cls: type[Batch], names: Iterable[str]
) -> tuple[ArrayLayout, ...]:
    """Layouts of some fields of a batch."""
    simulations, frames = trajectories.stage.shape
    shape_of_neighbours, shape = (simulations, len(NeighbourRole), frames), (simulations, frames)
    kinds, wide = batch_fields(cls), _PER_NEIGHBOUR if cls is EgoSignals else ()
    return tuple(
        ArrayLayout(
            name, shape_of_neighbours if name in wide else shape, np.dtype(kinds[name].dtype)
        )
        for name in names
    )


def with_adjacent_frames(values: NDArray[Any]) -> NDArray[Any]:
    """`values` with the frames of a vehicle side by side; a copy only where they are not."""
    return values if values.strides[-1] == values.itemsize else np.ascontiguousarray(values)


def _contiguous_row(values: NDArray[Any]) -> NDArray[Any]:
    """`values` in one row."""
    return np.ascontiguousarray(values).reshape(-1)
