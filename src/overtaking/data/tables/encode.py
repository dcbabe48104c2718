"""Recorded simulations as tables: without padding, not rounded again, null where nothing is."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.data.tables.arrow import Array, Mask, Masked, to_texts
from overtaking.data.tables.build import Given, Texts, build
from overtaking.data.tables.derived import derived_weather
from overtaking.data.tables.schemas import (
    BODY_FIELDS,
    DRIVER_FIELDS,
    NEIGHBOURS,
    NUM_INDICATOR_BITS,
    RECORDED_TABLES,
    STATE_FIELDS,
    WEATHER_FIELDS,
)
from overtaking.data.tables.surroundings import Surroundings
from overtaking.data.tables.unknown import schema_of, silent_columns
from overtaking.knowledge import presets
from overtaking.model.batch import Batch
from overtaking.model.road import Road
from overtaking.model.trajectory import NO_VEHICLE, Percepts, Stage, Trajectories
from overtaking.model.vehicles import Role
from overtaking.model.weather import NO_PRESET

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
        sources: Where in a recording each simulation comes from; None for what was simulated.
    """
    made = {name: _ENCODERS[name](trajectories, numbers) for name in tables}
    if trajectories.unknown:
        made = {name: _silenced(name, rows, trajectories) for name, rows in made.items()}
    if sources is not None and "simulations" in made:
        made["simulations"] = _recorded(made["simulations"], sources)
    return made


def simulations(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation."""
    scenario = trajectories.scenario
    count = scenario.num_simulations
    words = np.ascontiguousarray(trajectories.trace_hash.astype("<u4"))
    nowhere = Texts(np.zeros(count, np.int32), (), np.ones(count, np.bool_))
    return build(
        "simulations",
        {
            "simulation": numbers,
            "seed": np.full(count, scenario.seed, dtype=np.uint64),
            "index": scenario.index,
            "profile": Texts.same(scenario.profile, count),
            "road": Texts.same(scenario.road.name, count),
            "num_vehicles": scenario.num_vehicles.astype(np.uint8),
            "weather": numbers,
            "num_frames": trajectories.num_frames,
            "frame_interval_ms": np.full(count, scenario.frame_interval_ms, dtype=np.int32),
            "horizon_s": scenario.horizon,
            "attempt_deadline_s": scenario.attempt_deadline,
            "weight": scenario.weight,
            "trace_hash": words.view(np.uint8).reshape(-1),
            "source_recording": nowhere,
        },
    )


def weather(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation: each has weather of its own."""
    given = trajectories.scenario.weather
    names = tuple(presets())
    unnamed = given.preset == NO_PRESET
    return build(
        "weather",
        {
            "weather": numbers,
            "preset": Texts(np.where(unnamed, 0, given.preset).astype(np.int32), names, unnamed),
            **{column: getattr(given, name) for name, column in WEATHER_FIELDS},
            **derived_weather(trajectories.scenario),
        },
    )


def vehicles(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and vehicle: its body, its driver, its start and its first contact."""
    scenario, contacts = trajectories.scenario, trajectories.contacts
    bodies, valid = scenario.vehicles, scenario.vehicles.valid
    filled = np.flatnonzero(valid)
    simulation, slot = np.divmod(filled, valid.shape[1])
    partner = _picked(contacts.partner, filled)
    no_contact = partner == NO_VEHICLE
    lane_id = Surroundings.of(scenario.road).lane_id
    return build(
        "vehicles",
        {
            "simulation": numbers[simulation],
            "vehicle": slot.astype(np.uint8),
            "role": (slot != Role.EGO).astype(np.int32),
            "kind": _picked(bodies.kind, filled),
            "colour": _picked(bodies.colour, filled),
            **_attributes(bodies, BODY_FIELDS, filled),
            **_attributes(scenario.drivers, DRIVER_FIELDS, filled),
            "start_s_m": _picked(scenario.start_s, filled),
            "start_lane_id": lane_id[_picked(scenario.start_lane, filled)],
            "start_speed_mps": _picked(scenario.start_speed, filled),
            "contact_vehicle": Masked(partner, no_contact),
            "contact_time_ms": Masked(_picked(contacts.time, filled), no_contact),
            "contact_impulse_newton_s": Masked(_picked(contacts.impulse, filled), no_contact),
            "contact_closing_speed_mmps": Masked(
                _picked(contacts.closing_speed, filled), no_contact
            ),
        },
    )


def frames(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and frame: what is the same for all vehicles, and the ego's lane."""
    simulation, frame = np.nonzero(trajectories.frame_valid)
    stage = trajectories.stage[simulation, frame]
    partner = trajectories.collided_with[simulation, frame]
    lane = trajectories.states.lane[simulation, Role.EGO, frame]
    return build(
        "frames",
        {
            "simulation": numbers[simulation],
            "frame": frame.astype(np.int32),
            "time_ms": trajectories.time_ms[frame],
            **_ego_lane(trajectories.road, lane),
            "collided_with": Masked(partner, partner == NO_VEHICLE),
            "overtaking": overtaking(trajectories)[simulation, frame],
            "stage": stage,
        },
    )


def overtaking(trajectories: Trajectories) -> Mask:
    """The paper's OV: the frames in which the ego first pulls out, and first returns after that.

    Shape (simulation, time); false beyond the last recorded frame.
    """
    stage, valid = trajectories.stage, trajectories.frame_valid
    pulled_out = np.logical_or.accumulate((stage == Stage.PULL_OUT) & valid, axis=1)
    returned = np.logical_or.accumulate((stage == Stage.RETURN) & valid & pulled_out, axis=1)
    first = np.zeros_like(valid)
    for seen in (pulled_out, returned):
        first |= np.diff(seen, axis=1, prepend=False)
    return first


def states(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation, vehicle and frame, in this order."""
    recorded = trajectories.states
    rows = _Rows.of(trajectories)
    lane = rows.of_state(recorded.lane)
    lights = rows.of_state(recorded.lights)
    around = Surroundings.of(trajectories.road)
    return build(
        "states",
        {
            "simulation": numbers[rows.simulation],
            "vehicle": rows.vehicle,
            "frame": rows.frame,
            **{column: rows.of_state(getattr(recorded, name)) for name, column in STATE_FIELDS},
            "lane_id": Masked(around.lane_id[lane], ~around.on_road[lane]),
            "indicator": lights & _INDICATOR_BITS,
            "lights": lights >> NUM_INDICATOR_BITS,
        },
    )


def percepts(trajectories: Trajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and decision of the ego."""
    believed = trajectories.percepts
    made = np.flatnonzero(believed.valid)
    simulation = made // believed.valid.shape[1]
    begins = np.searchsorted(simulation, simulation)
    decision = np.arange(len(made)) - begins
    return build(
        "percepts",
        {
            "simulation": numbers[simulation],
            "decision": decision.astype(np.int32),
            "kind": _picked(believed.kind, made),
            "time_ms": _picked(believed.time, made),
            **_of_neighbours(believed, made),
        },
    )


_ENCODERS = {
    "simulations": simulations,
    "weather": weather,
    "vehicles": vehicles,
    "frames": frames,
    "states": states,
    "percepts": percepts,
}


def _silenced(name: str, table: pa.Table, trajectories: Trajectories) -> pa.Table:
    """The table with null in the columns that the source of the recording does not tell."""
    silent = silent_columns(name, trajectories.unknown)
    columns = [
        pa.nulls(table.num_rows, field.type) if field.name in silent else table[field.name]
        for field in table.schema
    ]
    return pa.Table.from_arrays(columns, schema=schema_of(name, trajectories.unknown))


def _recorded(table: pa.Table, sources: Sequence[str]) -> pa.Table:
    """The `simulations` of a recording: with their sources, and without seeds."""
    new = {"seed": pa.nulls(len(sources), pa.uint64()), "source_recording": to_texts(sources)}
    columns = [new.get(name, table[name]) for name in table.schema.names]
    return pa.Table.from_arrays(columns, schema=schema_of("simulations", recorded=True))


def _attributes(
    batch: Batch, fields: Iterable[tuple[str, str]], filled: NDArray[np.int64]
) -> dict[str, Array]:
    """The filled slots of some arrays of shape (simulation, vehicle), by column."""
    return {column: _picked(getattr(batch, name), filled) for name, column in fields}


def _picked(values: Array, filled: NDArray[np.int64]) -> Array:
    """The filled slots of an array of shape (simulation, vehicle); faster than with a mask."""
    return values.reshape(-1).take(filled)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Which states there are, in the order of simulations, vehicles and frames.

    Attributes:
        simulation: Row of the batch, shape (row,).
        vehicle: Slot, same shape.
        frame: Same shape.
        counts: Frames of each simulation and slot if they begin with the first, shape
            (simulation * vehicle,); else None.
        mask: Where there is a state otherwise, shape (simulation, vehicle, time).
    """

    simulation: NDArray[np.int64]
    vehicle: NDArray[np.uint8]
    frame: NDArray[np.int32]
    counts: NDArray[np.int64] | None
    mask: Mask | None

    @classmethod
    def of(cls, trajectories: Trajectories) -> Self:
        """The rows of a batch."""
        if trajectories.present is not None:
            mask = trajectories.state_valid
            simulation, vehicle, frame = np.nonzero(mask)
            return cls(
                simulation=simulation,
                vehicle=vehicle.astype(np.uint8),
                frame=frame.astype(np.int32),
                counts=None,
                mask=mask,
            )
        valid = trajectories.scenario.vehicles.valid
        counts = np.where(valid, trajectories.num_frames[:, None], 0).astype(np.int64).reshape(-1)
        simulation, vehicle = np.divmod(np.arange(valid.size), valid.shape[1])
        begins = np.cumsum(counts) - counts
        return cls(
            simulation=np.repeat(simulation, counts),
            vehicle=np.repeat(vehicle.astype(np.uint8), counts),
            frame=np.arange(counts.sum(), dtype=np.int32)
            - np.repeat(begins.astype(np.int32), counts),
            counts=counts,
            mask=None,
        )

    def of_state(self, values: Array) -> Array:
        """The recorded values of an array of shape (simulation, vehicle, time)."""
        if self.counts is None:
            return values[self.mask]
        if (self.counts == values.shape[2]).all():
            return values.reshape(-1)
        rows = values.reshape(len(self.counts), -1)
        # Copies slices; a mask over the padded array takes several times as long.
        return np.concatenate(
            [row[:count] for row, count in zip(rows, self.counts.tolist(), strict=True)]
        )


def _ego_lane(road: Road, lane: NDArray[np.uint8]) -> dict[str, Given]:
    """What belongs to the lane that the ego is in, null where it is in none."""
    around = Surroundings.of(road)
    off = ~around.on_road[lane]
    no_right, no_left = off | ~around.has_right[lane], off | ~around.has_left[lane]
    return {
        "lane_id": Masked(around.lane_id[lane], off),
        "speed_limit_mps": Masked(np.full(len(lane), road.speed_limit), off),
        "right_line": Masked(around.right_mark[lane], off),
        "left_line": Masked(around.left_mark[lane], off),
        "lane_width_m": Masked(around.width[lane], off),
        "right_lane_id": Masked(around.right_id[lane], no_right),
        "right_lane_width_m": Masked(around.right_width[lane], no_right),
        "left_lane_id": Masked(around.left_id[lane], no_left),
        "left_lane_width_m": Masked(around.left_width[lane], no_left),
    }


def _of_neighbours(believed: Percepts, made: NDArray[np.int64]) -> dict[str, Given]:
    """The columns about the neighbours, in the decisions that were made."""

    def rows(values: Array) -> Array:
        """One row for each neighbour."""
        return np.ascontiguousarray(values.reshape(-1, len(NEIGHBOURS)).take(made, axis=0).T)

    vehicle, detected = rows(believed.vehicle), rows(believed.detected)
    gap, closing_speed = rows(believed.gap), rows(believed.closing_speed)
    true_gap, true_speed = rows(believed.true_gap), rows(believed.true_closing_speed)
    columns: dict[str, Given] = {}
    for place, who in enumerate(NEIGHBOURS):
        nobody, unseen = vehicle[place] == NO_VEHICLE, ~detected[place]
        columns |= {
            f"{who}_vehicle": Masked(vehicle[place], nobody),
            f"{who}_detected": detected[place],
            f"{who}_gap_mm": Masked(gap[place], unseen),
            f"{who}_closing_speed_mmps": Masked(closing_speed[place], unseen),
            f"{who}_true_gap_mm": Masked(true_gap[place], nobody),
            f"{who}_true_closing_speed_mmps": Masked(true_speed[place], nobody),
        }
    return columns
