"""Recorded simulations as tables: without padding, not rounded again, null where nothing is."""

from collections.abc import Iterable, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.data.tables.arrow import Array, Masked, to_texts
from overtaking.data.tables.build import Given, Rows, Texts, build
from overtaking.data.tables.derived import derived_weather
from overtaking.data.tables.lanes import lane_columns, start_lane_ids
from overtaking.data.tables.schemas import (
    COLUMNS,
    NUM_INDICATOR_BITS,
    RECORDED_TABLES,
    schema_of,
)
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.driver_interface import Actions
from overtaking.model.trajectories import POSITION_RESOLUTION, Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.weather import NO_PRESET
from overtaking.world.constants import STEP_MS, SUBSTEPS

Numbers = NDArray[np.int64]
"""Numbers of the simulations in their data set, shape (simulation,)."""

_INDICATOR_BITS = (1 << NUM_INDICATOR_BITS) - 1


def encode(
    trajectories: Trajectories,
    numbers: Numbers,
    tables: Iterable[str] = RECORDED_TABLES,
    sources: Sequence[str] | None = None,
) -> dict[str, pa.Table]:
    """The tables of a batch, by the names of their folders.

    Args:
        trajectories: The recorded simulations.
        numbers: Number of each simulation in its data set, growing, shape (simulation,).
        tables: Which tables; all if left out.
        sources: Where in a recording each simulation comes from; None for simulations.
    """
    made = {name: _ENCODERS[name](trajectories, numbers) for name in tables}
    if sources is not None and "simulations" in made:
        made["simulations"] = _recorded(made["simulations"], sources)
    return made


def simulations(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation."""
    scenario = trajectories.scenario
    count = scenario.num_simulations
    words = np.ascontiguousarray(trajectories.trace_hash.astype("<u4"))
    computed = {
        "simulation": numbers,
        "seed": np.full(count, scenario.seed, dtype=np.uint64),
        "profile": Texts.same(scenario.profile, count),
        "road": Texts.same(scenario.road.name, count),
        "num_vehicles": scenario.num_vehicles.astype(np.uint8),
        "weather": numbers,
        "frame_interval_ms": np.full(count, scenario.frame_interval_ms, dtype=np.int32),
        "trace_hash": words.view(np.uint8).reshape(-1),
        "source_recording": Texts(np.zeros(count, np.int32), (), np.ones(count, np.bool_)),
    }
    return build("simulations", trajectories, _as_they_are, computed)


def weather(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation: each has weather of its own."""
    preset, names = trajectories.scenario.weather.preset, tuple(weather_presets())
    unnamed = preset == NO_PRESET
    computed = {
        "weather": numbers,
        "preset": Texts(np.where(unnamed, 0, preset).astype(np.int32), names, unnamed),
        **derived_weather(trajectories.scenario),
    }
    return build("weather", trajectories, _as_they_are, computed, trajectories.unknown)


def vehicles(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and vehicle: its body, its driver, its start and its first contact."""
    scenario, valid = trajectories.scenario, trajectories.scenario.vehicles.valid
    filled = np.flatnonzero(valid)
    simulation, slot = np.divmod(filled, valid.shape[1])

    def rows(values: Array) -> Array:
        # Indices are faster here than a mask.
        return values.reshape(-1).take(filled)

    computed: dict[str, Given] = {
        "simulation": numbers[simulation],
        "vehicle": slot.astype(np.uint8),
        "role": (slot != EGO_SLOT).astype(np.int32),
        "start_lane_id": start_lane_ids(scenario.road, rows(scenario.start_lane)),
    }
    if (is_known := trajectories.is_kind_known) is not None:
        computed["kind"] = Masked(rows(scenario.vehicles.kind), ~rows(is_known))
    return build("vehicles", trajectories, rows, computed, trajectories.unknown)


def frames(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and frame: values common to all vehicles, and the ego's lane."""
    simulation, frame = np.nonzero(trajectories.frame_mask)
    at = simulation, EGO_SLOT, frame
    lane, about = trajectories.states.lane[at], lane_columns(trajectories.road)
    limit = trajectories.road.speed_limit_at(trajectories.states.s[at] * POSITION_RESOLUTION)
    off_road = about["lane_id"].missing[lane]
    computed = {
        "simulation": numbers[simulation],
        "frame": frame.astype(np.int32),
        "time_ms": trajectories.time_ms[frame],
        **{name: Masked(one.values[lane], one.missing[lane]) for name, one in about.items()},
        "speed_limit_mps": Masked(np.where(off_road, 0.0, limit), off_road),
        "lane_change_begins": lane_change_begins(trajectories)[simulation, frame],
    }
    unknown = trajectories.unknown
    return build("frames", trajectories, lambda one: one[simulation, frame], computed, unknown)


def lane_change_begins(trajectories: Trajectories) -> Mask:
    """The paper's OV: the frames in which the ego first pulls out, and first returns after that.

    Shape (simulation, time); false beyond the last recorded frame.
    """
    stage, valid = trajectories.stage, trajectories.frame_mask
    pulled_out = np.logical_or.accumulate((stage == Stage.PULL_OUT) & valid, axis=1)
    returned = np.logical_or.accumulate((stage == Stage.RETURN) & valid & pulled_out, axis=1)
    first = np.zeros_like(valid)
    for seen in (pulled_out, returned):
        first |= np.diff(seen, axis=1, prepend=False)
    return first


def states(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation, vehicle and frame, in this order."""
    simulation, vehicle, frame, take = _state_rows(trajectories)
    lane, lights = (take(getattr(trajectories.states, name)) for name in ("lane", "lights"))
    lane_id = lane_columns(trajectories.road)["lane_id"]
    computed = {
        "simulation": numbers[simulation],
        "vehicle": vehicle,
        "frame": frame,
        "lane_id": Masked(lane_id.values[lane], lane_id.missing[lane]),
        "indicator": lights & _INDICATOR_BITS,
        "lights": lights >> NUM_INDICATOR_BITS,
    }
    return build("states", trajectories, take, computed, trajectories.unknown)


def percepts(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and decision of the ego."""
    valid = trajectories.percepts.valid
    made = np.flatnonzero(valid)
    simulation = made // valid.shape[1]
    begins = np.searchsorted(simulation, simulation)
    computed = {
        "simulation": numbers[simulation],
        "percept": (np.arange(len(made)) - begins).astype(np.int32),
    }
    return build("percepts", trajectories, lambda one: one.reshape(-1).take(made), computed)


def actions(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and change of what another driver did with the ego."""
    done = trajectories.actions or Actions.empty(len(numbers))
    simulation, action = np.nonzero(done.is_change)
    values = done.values[simulation, action]
    known = {part.name: values[:, index] for index, part in enumerate(done.parts)}
    action = action.astype(np.int32)
    known["time"] = action * np.int32(STEP_MS * SUBSTEPS)
    nothing = np.ones(len(action), np.bool_)
    computed: dict[str, Given] = {"simulation": numbers[simulation], "action": action}
    for one in COLUMNS["actions"][len(computed) :]:
        dtype = np.int64 if one.spec.names else one.dtype
        none = Masked(np.zeros(len(action), dtype), nothing)
        computed[one.name] = known[one.path].astype(dtype) if one.path in known else none
    return build("actions", trajectories, _as_they_are, computed)


_ENCODERS = {
    "actions": actions,
    "simulations": simulations,
    "weather": weather,
    "vehicles": vehicles,
    "frames": frames,
    "states": states,
    "percepts": percepts,
}


def _as_they_are(values: Array) -> Array:
    """Arrays of shape (simulation,) have a row for each simulation already."""
    return values


def _recorded(table: pa.Table, sources: Sequence[str]) -> pa.Table:
    """The `simulations` of a recording: with their sources, and without seeds."""
    new = {"seed": pa.nulls(len(sources), pa.uint64()), "source_recording": to_texts(sources)}
    columns = [new.get(name, table[name]) for name in table.schema.names]
    return pa.Table.from_arrays(columns, schema=schema_of("simulations", recorded=True))


def _state_rows(
    run: Trajectories,
) -> tuple[Numbers, NDArray[np.uint8], NDArray[np.int32], Rows]:
    """The recorded states of a batch, in the order of simulations, vehicles and frames.

    Returns:
        Index in the batch, slot and frame of each, shape (row,); and what takes them from an array
        of shape (simulation, vehicle, time).
    """
    if run.is_recorded is not None:
        mask = run.state_mask
        simulation, vehicle, frame = np.nonzero(mask)
        rows = simulation, vehicle.astype(np.uint8), frame.astype(np.int32)
        return *rows, lambda values: values[mask]
    valid = run.scenario.vehicles.valid
    counts = np.where(valid, run.num_frames[:, None], 0).astype(np.int64).reshape(-1)

    def take(values: Array) -> Array:
        if (counts == values.shape[2]).all():
            return values.reshape(-1)
        rows = zip(values.reshape(len(counts), -1), counts.tolist(), strict=True)
        # Copies slices; a mask over the padded array takes several times as long.
        return np.concatenate([row[:count] for row, count in rows])

    simulation, vehicle = np.divmod(np.arange(valid.size), valid.shape[1])
    begins = np.repeat((np.cumsum(counts) - counts).astype(np.int32), counts)
    frame = np.arange(counts.sum(), dtype=np.int32) - begins
    return np.repeat(simulation, counts), np.repeat(vehicle.astype(np.uint8), counts), frame, take
