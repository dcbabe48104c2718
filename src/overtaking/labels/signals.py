"""Signals of the ego and its target, computed by the compiled engine.

This module packs recordings into arrays for the engine, and its results into batches.
`tests/reference/labels` computes the same signals one frame after the other.

The ego is the vehicle under study, its target the vehicle that it overtakes, and its neighbours are
the nearest vehicles ahead and behind in its lane and in the two beside it. Left is the overtaking
side, also in left-hand traffic. A slot is the number of a vehicle in its simulation. `sight_lit`
and `sight_unlit` are the distances at which the ego's driver sees a lit and an unlit vehicle.
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
"""Signals that other compiled functions read, by name."""

_NEIGHBOUR_SIGNAL_NAMES = ("gap", "closing_speed", "lateral_gap", "left_occupancy", "left_count")
"""Signals that `_neighbour_signals` computes; the last two describe the lane to the left."""

_PER_NEIGHBOUR = ("neighbour_slot", "gap", "closing_speed", "lateral_gap")
"""Signals of shape (simulation, neighbour, time)."""


def extract_signals_and_events(
    trajectories: Trajectories, thresholds: dict[str, Any]
) -> tuple[EgoSignals, ArraysByName]:
    """Signals and events of a batch, in one compiled call.

    Gaps to all neighbours and the lane to the left are computed at their first use.

    Args:
        trajectories: The batch, of any origin and rate; its arrays must not change afterwards.
        thresholds: Result of `event_detection.event_thresholds`.

    Returns:
        The signals, and by name the events that the engine finds, shape (simulation,).

    Raises:
        ConfigError: `OVERTAKING_SIMD` is no SIMD level of this CPU.
    """
    names, recording = _core.FIELD_NAMES["events"], pack_recording(trajectories)
    events = np.empty((len(names), len(trajectories.num_frames)), np.int32)
    layouts = _array_layouts(trajectories, EgoSignals, (*SIGNALS_FOR_ENGINE, "accel"))
    zero_from = ArrayLayout("zero_from", trajectories.num_frames.shape, np.int32)
    # Signals are 0 after the end of a simulation. Memory of a deleted batch is used again. With it
    # comes `zero_from`: for each row, the frame from which on the deleted batch left zeros. The
    # engine clears only the frames before that one, which saves writes because most simulations end
    # early, and then stores its own `zero_from`. New memory is all zeros.
    outputs = Buffers().arrays("signals", (*layouts, zero_from))
    zero_from_frame = outputs.pop("zero_from")
    _core.ego_signals_and_events(
        recording=recording,
        visibility=visibility_inputs(trajectories),
        thresholds=thresholds,
        constants=engine_constants(model_constants()),
        zero_from=zero_from_frame,
        signals=outputs,
        events=events,
        level=simd_level(),
    )
    # The first use of a neighbour signal computes all five.
    neighbour_signals = partial(_neighbour_signals, trajectories, outputs["neighbour_slot"])
    at_first_use: DelayedArrays = {
        "s": lambda: {"s": as_f32(trajectories.states.s[:, EGO_SLOT]) * METRES_PER_MM},
        "valid": lambda: {"valid": trajectories.frame_mask},
        **dict.fromkeys(_NEIGHBOUR_SIGNAL_NAMES, neighbour_signals),
    }
    _limit_sight_by_road(trajectories, outputs)
    interval = trajectories.scenario.frame_interval_ms
    # A batch whose fields in `at_first_use` are computed when they are first read.
    signals = EgoSignals.partly(at_first_use, frame_interval_ms=interval, **outputs)
    return signals, dict(zip(names, events, strict=True))


def _limit_sight_by_road(trajectories: Trajectories, outputs: ArraysByName) -> None:
    """Limit both sight distances to the one that the course of the road leaves."""
    if trajectories.road.course is not None:
        # Roads are computed in float64; `METRES_PER_MM` is the same factor in float32.
        s = trajectories.states.s[:, EGO_SLOT] * POSITION_RESOLUTION
        sight_of_road = sight_at(trajectories.road, s)
        for name in ("sight_lit", "sight_unlit"):
            np.minimum(outputs[name], as_f32(sight_of_road), out=outputs[name])


def target_signals(trajectories: Trajectories, signals: EgoSignals, vehicle: U8) -> TargetSignals:
    """Signals of the target of each simulation.

    Signals with a value for each frame are computed when they are first read.

    Args:
        trajectories: The batch.
        signals: Its signals.
        vehicle: Slot of each target, `NO_VEHICLE` without a target, shape (simulation,).

    Raises:
        ValueError: A target is not a vehicle of the recording.
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
    case: Case, role: NeighbourRole | IndexArray, simulation: IndexArray, frame: IndexArray
) -> Encounter:
    """The ego and a neighbour at single frames, with the fields of `Encounter`.

    Times to collision and required decelerations refer to the rear one of the two vehicles.

    Args:
        case: The batch.
        role: Role of the neighbour, one for all instants or one for each.
        simulation: Row of the simulation, shape (instant,).
        frame: A recorded frame, same shape.

    Returns:
        Arrays of shape (instant,).

    Raises:
        ValueError: A frame does not exist.
    """
    names, num_instants = _core.FIELD_NAMES["encounters"], len(simulation)
    slot, out = np.empty(num_instants, np.uint8), np.empty((len(names), num_instants), np.float32)
    instants = np.empty((3, num_instants), np.int64)
    instants[:] = simulation, np.broadcast_to(np.int64(role), np.shape(simulation)), frame
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
        ends: `FrameSpan.packed_ends` of the spans in which to look.

    Returns:
        Simulation and frame of each instant; lane of the target, lateral gap between the two [m],
        and acceleration of the target [m/s^2]; each of shape (instant,).
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
    """`pack_recording` of a case, computed once."""
    return pack_recording(case.trajectories)


def pack_recording(trajectories: Trajectories) -> dict[str, Any]:
    """A recording as arrays for compiled functions.

    On a two-way road the opposing lane is one more lane to the left. Oncoming vehicles are left
    out: leaders, followers and targets drive in the direction of the ego.
    """
    states, bodies, road = trajectories.states, trajectories.scenario.vehicles, trajectories.road
    interval_ms = trajectories.scenario.frame_interval_ms
    is_recorded = trajectories.is_recorded
    recorded = {name: getattr(states, name) for name in ("s", "d", "speed", "lane")}
    # The origin is the angle that the engine subtracts from the headings: on a straight road its
    # direction. On a road that bends, the headings already are angles to the road, so it is 0.
    recorded["heading"], heading_origin = trajectories.headings_and_origin
    recorded |= {"accel": states.accel_lon, "collided_with": trajectories.collided_with}
    if road.is_two_way:
        recorded["lane"] = _lanes_with_opposing_lane(trajectories)
        drives_along = np.broadcast_to(~is_oncoming(trajectories)[:, :, None], states.s.shape)
        # None: every vehicle is recorded in every frame.
        is_recorded = drives_along.copy() if is_recorded is None else is_recorded & drives_along
    return {
        **{name: contiguous_in_time(values) for name, values in recorded.items()},
        "is_recorded": None if is_recorded is None else contiguous_in_time(is_recorded),
        "num_frames": np.ascontiguousarray(trajectories.num_frames),
        **{name: _contiguous_row(getattr(bodies, name)) for name in ("valid", "length", "width")},
        # The engine has room for `MAX_LANES` lanes. If the ego's direction has that many, there is
        # none for the opposing lane, and vehicles in it count as beyond the lanes.
        "num_lanes": min(road.num_lanes + road.is_two_way, MAX_LANES),
        "overtaking_sign": float(overtaking_sign(road)),
        # The same float32 that `snapshots` subtracts from headings.
        "direction": float(np.float32(heading_origin)),
        "interval_ms": interval_ms,
        "half_window": lateral_speed_half_window(interval_ms),
    }


def _lanes_with_opposing_lane(trajectories: Trajectories) -> U8:
    """Lanes of all vehicles on a two-way road.

    `num_lanes` is the opposing lane, `num_lanes + 1` everything beyond its outer edge. Recordings
    have `num_lanes` for both.
    """
    states, road = trajectories.states, trajectories.road
    outer_edge = float(lane_borders(road)[-1])
    # `states.d` is in steps of `POSITION_RESOLUTION`, the border in metres.
    is_beyond_road = float(overtaking_sign(road)) * states.d > outer_edge / POSITION_RESOLUTION
    return states.lane + (is_beyond_road & (states.lane == road.num_lanes)).view(np.uint8)


def pack_signals(signals: EgoSignals) -> ArraysByName:
    """Signals as arrays for compiled functions."""
    return {name: _contiguous_row(getattr(signals, name)) for name in SIGNALS_FOR_ENGINE}


def visibility_inputs(trajectories: Trajectories) -> dict[str, Any]:
    """Inputs of friction and sight beside the states; flat arrays of shape (simulation,).

    Friction belongs to the mean film of the lane, because a driver cannot know which wheel will be
    in which puddle. Spray is left out: it hides only the road beyond the vehicle that throws it
    up, and the brake lamps of that vehicle announce what it meets there.

    Returns:
        film: Mean water film of each lane, puddles included, shape (simulation, `MAX_LANES`): the
            engine expects this length, whatever the number of lanes [mm].
        tyre_wear, has_truck_tyres: Tread wear of the ego, and 1 for truck tyres.
        fog, rain: Extinction coefficient of fog, and of rain for an observer at rest; the engine
            increases the second with the speed of the ego [1/m].
        contrast_depth: Optical depth at which a vehicle of medium contrast becomes invisible.
        lamp_depth: Logarithm of a rear lamp's intensity over the threshold of detection.
        lamp_clear: Distance at which a rear lamp is detected in clear air, by the inverse-square
            law [m].
        unlit_limit: The attention range, or the range of the ego's low beam if it is shorter; by
            day only the attention range limits the sight of unlit vehicles [m].
        attention_range: Distance beyond which drivers perceive no vehicle, a number [m].
    """
    scenario, attention_range = trajectories.scenario, constant("model.perception.range")
    effects, bodies = weather_effects(scenario), scenario.vehicles
    sight = effects.sight
    film = _mean_water_film(effects.film, path_factor=road_parameters(scenario.road).film_path)
    # The rain rate only gives the shape (simulation,).
    lamp = np.full_like(effects.rain_rate, constant("weather.lamps.rear_position"))
    lamp_ratio = lamp / sight["lamp_threshold"]
    # The contrast of a vehicle of medium colour, which drivers also assume as they choose a speed.
    depth = sight["log_contrast_sensitivity_ahead"] + log(constant("model.speed_choice.contrast"))
    # The inverse range of the low beam; by day it is 0, the inverse of an unlimited range.
    inverse_limit = maximum(sight["inverse_lit_range"], np.float32(1.0) / attention_range)
    arrays = {
        "film": film,
        "tyre_wear": bodies.tyre_wear[:, EGO_SLOT],
        "has_truck_tyres": as_f32(bodies.kind[:, EGO_SLOT] == VehicleKind.TRUCK),
        "fog": sight["fog_extinction"],
        "rain": sight["rain_extinction"],
        "contrast_depth": maximum(depth, np.float32(0.0)),
        "lamp_depth": log(lamp_ratio),
        "lamp_clear": np.sqrt(lamp_ratio),
        "unlit_limit": np.float32(1.0) / inverse_limit,
    }
    flat = {name: _contiguous_row(values) for name, values in arrays.items()}
    return {**flat, "attention_range": float(attention_range)}


def _mean_water_film(water: dict[str, F32], *, path_factor: F32) -> F32:
    """Water film of each lane, with the puddles spread evenly over it, (simulation, lane) [mm].

    Args:
        water: Water on the road, as `WeatherEffects.film`.
        path_factor: Factor of each lane for the length over which water drains to it, shape
            (lane,), result of `road_surface.film_path_factor`.
    """
    film = lane_film(
        water["min_wet_film"][:, None],
        water["film_rain_factor"][:, None],
        path_factor[None, :],
        water["texture_depth"][:, None],
    )
    # A puddle is where the sum of two waves is below a threshold t
    # (`road_surface.puddle_depth_share`). The waves are distributed like independent uniform
    # numbers from 0 to 1; their sum is below t <= 1 on a share t^2 / 2 of the lane.
    covered_share = np.float32(0.5) * water["puddle_threshold"] * water["puddle_threshold"]
    return film + (water["puddle_film"] * covered_share)[:, None]


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
    """Arrays with undefined content for some fields of a batch."""
    return {
        name: empty_array(math.prod(shape), dtype).reshape(shape)
        for name, shape, dtype in _array_layouts(trajectories, cls, names)
    }


def _array_layouts(
    trajectories: Trajectories, cls: type[Batch], names: Iterable[str]
) -> tuple[ArrayLayout, ...]:
    """Layouts of the arrays for some fields of a batch."""
    num_simulations, num_frames = trajectories.stage.shape
    shape = num_simulations, num_frames
    neighbour_shape = num_simulations, len(NeighbourRole), num_frames
    per_neighbour = _PER_NEIGHBOUR if cls is EgoSignals else ()
    specifications = batch_fields(cls)
    return tuple(
        ArrayLayout(
            name,
            neighbour_shape if name in per_neighbour else shape,
            np.dtype(specifications[name].dtype),
        )
        for name in names
    )


def contiguous_in_time(values: NDArray[Any]) -> NDArray[Any]:
    """The values with consecutive frames next to each other in memory; a copy if they are not."""
    return values if values.strides[-1] == values.itemsize else np.ascontiguousarray(values)


def _contiguous_row(values: NDArray[Any]) -> NDArray[Any]:
    """The values as a flat, contiguous array; a copy if they are not contiguous."""
    return np.ascontiguousarray(values).reshape(-1)
