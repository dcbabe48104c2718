"""From tables back to memory: the same values, so that labels from memory and from file agree."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.core.errors import SchemaError
from overtaking.data.tables.arrow import column_to_numpy, to_arrow
from overtaking.data.tables.columns import Column, codes
from overtaking.data.tables.lanes import lane_codes, start_lane_codes
from overtaking.data.tables.names import INDICATORS, KINDS, STAGES
from overtaking.data.tables.schemas import COLUMNS, NUM_INDICATOR_BITS
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model import driver_interface
from overtaking.model.driver_interface import MAX_ACTION_PARTS, Actions
from overtaking.model.road import Road
from overtaking.model.scenario import MAX_DURATION, MAX_VEHICLES, Scenario
from overtaking.model.trajectories import (
    NO_VEHICLE,
    POSITION_RESOLUTION,
    Contacts,
    Percepts,
    States,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT, DriverTraits, VehicleSpecs
from overtaking.model.weather import NO_PRESET, LateralPushes, Weather
from overtaking.scenarios.recording_defaults import (
    DEFAULT_KIND,
    default_drivers,
    default_vehicles,
    default_weather,
    kinds_by_length,
)
from overtaking.world.constants import DECISIONS_PER_SECOND, model_constants

Array = NDArray[Any]
Tables = Mapping[str, pa.Table]


def restore_scenario(
    tables: Tables, road: Road, unknown: Collection[str] = (), pushes: LateralPushes | None = None
) -> Scenario:
    """The scenarios of some simulations.

    Args:
        tables: `simulations`, `weather` and `vehicles` of the same simulations, sorted by key.
        road: Their road.
        unknown: What the tables do not tell, names of `UNKNOWNS`.
        pushes: How weather acts instead of by physics.

    Returns:
        A batch with as many vehicle slots as the sampler makes.

    Raises:
        SchemaError: The simulations do not fit into one batch, or a key or name is unknown.
    """
    rows = tables["simulations"]
    vehicles = _Grid.of(tables, "vehicles", "vehicle")
    if not vehicles.shape[1] or not vehicles.present[:, EGO_SLOT].all():
        raise _refused("vehicles", "vehicle", "0, the ego, in every simulation", "none")
    lane = start_lane_codes(road, _numbers(tables["vehicles"], "start_lane_id"))
    return Scenario(
        profile=_shared(rows, "profile"),
        road=road,
        seed=_shared(rows, "seed") or 0,  # A recording has none.
        frame_interval_ms=_shared(rows, "frame_interval_ms"),
        scenario_index=_numbers(rows, "scenario_index"),
        horizon=_numbers(rows, "horizon_s"),
        attempt_deadline=_numbers(rows, "attempt_deadline_s"),
        weight=_numbers(rows, "weight"),
        vehicles=_bodies(tables["vehicles"], vehicles, unknown),
        drivers=default_drivers((vehicles.shape[0], vehicles.shape[1]))
        if "drivers" in unknown
        else DriverTraits(**_read("vehicles", tables, "scenario.drivers", vehicles.like_ego)),
        weather=default_weather(len(rows)) if "weather" in unknown else _weather(tables),
        start_s=vehicles.like_ego(_numbers(tables["vehicles"], "start_s_m")),
        start_lane=vehicles.like_ego(lane),
        start_speed=vehicles.like_ego(_numbers(tables["vehicles"], "start_speed_mps")),
        pushes=pushes,
    )


def restore(
    tables: Tables, road: Road, unknown: Collection[str] = (), pushes: LateralPushes | None = None
) -> Trajectories:
    """The recorded simulations that `encode` has made tables of.

    Args:
        tables: Every table of the same simulations, sorted by key.
        road: Their road.
        unknown: What the tables do not tell, names of `UNKNOWNS`.
        pushes: How weather acts instead of by physics.

    Returns:
        A batch with as many vehicle slots as the sampler makes, and as many frames as needed.

    Raises:
        SchemaError: The simulations do not fit into one batch, or a key or name is unknown.
    """
    rows, frames = tables["simulations"], tables["frames"]
    in_frames = _Grid.of(tables, "frames", "frame")
    num_rows = np.bincount(in_frames.at[0], minlength=len(rows))
    is_other = num_rows != _numbers(rows, "num_frames")
    if is_other.any():
        got = int(_numbers(rows, "num_frames")[is_other][0])
        raise _refused("simulations", "num_frames", f"{num_rows[is_other][0]}, as in frames", got)
    in_vehicles = _Grid.of(tables, "vehicles", "vehicle")
    hashes = b"".join(rows["trace_hash"].to_pylist())
    restored = Trajectories(
        scenario=restore_scenario(tables, road, unknown, pushes),
        num_frames=_numbers(rows, "num_frames"),
        states=_states(tables, road),
        stage=in_frames.filled(_codes(frames, "stage", STAGES)),
        collided_with=in_frames.filled(_numbers(frames, "collided_with", NO_VEHICLE), NO_VEHICLE),
        contacts=Contacts(**_read("vehicles", tables, "contacts", in_vehicles.filled)),
        percepts=_percepts(tables),
        trace_hash=np.frombuffer(hashes, dtype="<u4").reshape(-1, 4).astype(np.uint32),
        unknown=frozenset(unknown),
        is_kind_known=_known_kinds(tables["vehicles"], in_vehicles, unknown),
        actions=restore_actions(tables),
    )
    if tables["states"].num_rows == np.count_nonzero(restored.state_mask):
        return restored
    present = _Grid.of(tables, "states", "vehicle", "frame").present
    if present.shape != restored.state_mask.shape:
        expected = "states of the last vehicle and in the last frame"
        raise _refused("states", "vehicle", expected, f"{tables['states'].num_rows} states")
    recorded = restored.replace(is_recorded=present)
    # Events and rules read the ego in every frame; other vehicles may appear later or leave.
    num_ego_states = recorded.state_mask[:, EGO_SLOT].sum(axis=1)
    if (is_short := num_ego_states != recorded.num_frames).any():
        expected = f"{recorded.num_frames[is_short][0]} states of vehicle {EGO_SLOT}"
        raise _refused("states", "vehicle", expected, int(num_ego_states[is_short][0]))
    return recorded


def _known_kinds(table: pa.Table, grid: "_Grid", unknown: Collection[str]) -> Mask | None:
    """Whether the kind of each vehicle is known; as in `Trajectories`."""
    column = table["kind"]
    if "kinds" in unknown or not column.null_count:
        return None
    return grid.filled(column.is_valid().to_numpy(), True)


def restore_actions(tables: Tables) -> Actions | None:
    """What another driver did in some simulations; None where there was none.

    Args:
        tables: `simulations` and `actions` of the same simulations, sorted by key, or no `actions`.
    """
    if "actions" not in tables or not tables["actions"].num_rows:
        return None
    table, grid = tables["actions"], _Grid.of(tables, "actions", "action")
    columns = {one.path: one for one in COLUMNS["actions"]}
    known = driver_interface.ACTION_KINDS.items()
    named = [kind for kind, parts in known if _has(table, [columns[p.name] for p in parts])]
    kind = max(named, key=lambda one: len(driver_interface.ACTION_KINDS[one]))
    rows = np.zeros((table.num_rows, MAX_ACTION_PARTS), np.int32)
    for at, part in enumerate(driver_interface.ACTION_KINDS[kind]):
        rows[:, at] = _values(table, columns[part.name], 0)
    # Each holds until the next.
    last = np.maximum.accumulate(np.where(grid.present, np.arange(grid.shape[1]), 0), axis=1)
    values = np.take_along_axis(grid.filled(rows), last[:, :, None], axis=1)
    return Actions(values=values, kind=kind)


def _has(table: pa.Table, columns: list[Column]) -> bool:
    """Whether every one of some columns has values."""
    return all(table[one.name].null_count == 0 for one in columns)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Positions of the rows of a table in arrays whose first axis is the simulation.

    Attributes:
        at: Index arrays of the rows, one for each axis, shape (row,).
        shape: Shape of the arrays.
    """

    at: tuple[Array, ...]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, tables: Tables, name: str, *axes: str) -> "_Grid":
        """Arrays over the simulations and the keys of a table named in `axes`, long enough."""
        table = tables[name]
        numbers = _numbers(tables["simulations"], "simulation")
        indices = [_numbers(table, axis) for axis in axes]
        simulation = _row_indices(numbers, _numbers(table, "simulation"), name, "simulation")
        for axis, index in zip(axes, indices, strict=True):
            _check_index(tables["simulations"], name, axis, index, simulation)
        # A table knows nothing of slots without a vehicle, which a sampled batch has.
        ends = [int(index.max()) + 1 if len(index) else 0 for index in indices]
        # Every batch has a slot for the ego, even if no simulation is left in it.
        lengths = [
            max(end, 1) if axis == "vehicle" else end for axis, end in zip(axes, ends, strict=True)
        ]
        return cls(at=(simulation, *indices), shape=(len(numbers), *lengths))

    @property
    def present(self) -> NDArray[np.bool_]:
        """Mask of the positions that have a row."""
        return self.filled(np.ones(len(self.at[0]), dtype=np.bool_))

    def filled(self, values: Array, padding: Any = 0) -> Array:
        """Values at their indices; rows of (row, n) give arrays with a last axis of n."""
        array = np.full((*self.shape, *values.shape[1:]), padding, dtype=values.dtype)
        array[self.at] = values
        return array

    def like_ego(self, values: Array, padding: Any = 0) -> Array:
        """Values per vehicle, where a slot without a vehicle looks like the ego.

        The values of such slots are not used, but they have to be ones that can be computed with: a
        body of zero mass would divide by zero.
        """
        array = self.filled(values, padding)
        return np.where(self.present, array, array[:, EGO_SLOT, None])


def _row_indices(keys: Array, wanted: Array, table: str, column: str) -> NDArray[np.int64]:
    """Index of each wanted key among keys that increase.

    Raises:
        SchemaError: A key is not among them.
    """
    if not len(keys) and len(wanted):
        raise _refused(table, column, "a key of another table", int(wanted[0]))
    indices = np.searchsorted(keys, wanted)
    is_missing = keys[np.minimum(indices, len(keys) - 1)] != wanted
    if is_missing.any():
        raise _refused(table, column, "a key of another table", int(wanted[is_missing][0]))
    return indices


def _check_index(
    simulations: pa.Table, table: str, axis: str, index: Array, simulation: Array
) -> None:
    """Refuse indices that are beyond an axis, which would make arrays of any size.

    Args:
        simulations: The table of that name.
        table: Name of the table with the index.
        axis: Name of the column with the index.
        index: Its values, shape (row,).
        simulation: Row of each of them in `simulations`.

    Raises:
        SchemaError: An index is negative or too large; or frames or percepts are missing.
    """
    if axis == "vehicle":
        ends: Any = MAX_VEHICLES
    elif axis == "action":
        seconds = np.minimum(_numbers(simulations, "horizon_s"), MAX_DURATION)
        ends = (np.ceil(seconds * DECISIONS_PER_SECOND) + 1)[simulation]
    elif table in ("frames", "percepts"):  # Every number from 0 on has a row.
        ends = np.bincount(simulation, minlength=len(simulations))[simulation]
    else:
        ends = _numbers(simulations, "num_frames")[simulation]
    is_beyond = ~((index >= 0) & (index < ends))
    if is_beyond.any():
        end = np.broadcast_to(ends, index.shape)[is_beyond][0]
        raise _refused(table, axis, f"0 to {end - 1:g}", int(index[is_beyond][0]))


def _refused(table: str, column: str, expected: str, got: object) -> SchemaError:
    return SchemaError(
        what=f"column {column}",
        where=table,
        expected=expected,
        got=got,
        next_step="restore the data set from a copy, or generate it again",
    )


def _one(table: pa.Table, column: str) -> pa.Array:
    """A column as one piece."""
    values = table[column].combine_chunks()
    return values.combine_chunks() if isinstance(values, pa.ChunkedArray) else values


def _numbers(table: pa.Table, column: str, missing: Any = 0) -> Array:
    """A column as an array of its own type, with a value for its nulls."""
    return column_to_numpy(table[column], missing)


def _shared(table: pa.Table, column: str) -> Any:
    """The value that all simulations of a batch have in common."""
    values = table[column].unique().to_pylist()
    if len(values) != 1:
        raise SchemaError(
            what=f"column {column}",
            where="simulations",
            expected="one value for all simulations of a batch",
            got=f"{len(values)} values",
            next_step="take simulations with the same value together",
        )
    return values[0]


def _codes(table: pa.Table, column: str, names: tuple[str, ...], missing: int = 0) -> Array:
    """The codes of an enumeration, with one for its nulls."""
    found = codes(table[column], names)
    return np.where(found < 0, missing, found).astype(np.uint8)


def _read(
    name: str, tables: Tables, path: str, put: Callable[[Array, Any], Array], **missing: int
) -> dict[str, Array]:
    """The attributes of a part of a batch, from the columns that declare their paths in it.

    Args:
        name: Name of the table.
        tables: The tables.
        path: The part, dotted.
        put: Makes an array of the batch from the rows of a column, and a value for padding.
        missing: Values of nulls and padding, by attribute, where `Column.null_value` is not meant.
    """
    found: dict[str, list[Array]] = {}
    for one in COLUMNS[name]:
        part, _, attribute = one.path.rpartition(".")
        if part == path:
            null = missing.get(attribute, one.null_value if one.spec.null_unless == one.path else 0)
            found.setdefault(attribute, []).append(put(_values(tables[name], one, null), null))
    return {
        attribute: np.stack(arrays, axis=-1) if len(arrays) > 1 else arrays[0]
        for attribute, arrays in found.items()
    }


def _values(table: pa.Table, column: Column, missing: int) -> Array:
    """The rows of a column, an enumeration as its codes."""
    if column.spec.names:
        return _codes(table, column.name, tuple(column.spec.names), missing)
    return _numbers(table, column.name, missing)


def _bodies(table: pa.Table, grid: _Grid, unknown: Collection[str]) -> VehicleSpecs:
    if "bodies" in unknown:
        length, width = (grid.like_ego(_numbers(table, name)) for name in ("length_m", "width_m"))
        if "kinds" in unknown:
            nothing = np.zeros(length.shape, np.bool_)
            kind = kinds_by_length(length, is_truck=nothing, is_car=nothing)
        else:
            kind = grid.like_ego(_codes(table, "kind", KINDS, DEFAULT_KIND))
        return default_vehicles(grid.present, kind, length, width)
    read = _read(
        "vehicles", {"vehicles": table}, "scenario.vehicles", grid.like_ego, kind=DEFAULT_KIND
    )
    return VehicleSpecs(valid=grid.present, **read)


def _weather(tables: Tables) -> Weather:
    key = _numbers(tables["simulations"], "weather")
    rows = _row_indices(_numbers(tables["weather"], "weather"), key, "simulations", "weather")
    table = tables["weather"].take(to_arrow(rows))
    code = {name: number for number, name in enumerate(weather_presets())} | {None: NO_PRESET}
    named = table["preset"].to_pylist()
    if unknown := [name for name in named if name not in code]:
        raise _refused("weather", "preset", "a preset of this version, or null", unknown[0])
    preset = np.array([code[name] for name in named], dtype=np.uint8)
    read = _read("weather", {"weather": table}, "scenario.weather", lambda values, _: values)
    return Weather(preset=preset, **read)


def _states(tables: Tables, road: Road) -> States:
    table = tables["states"]
    grid = _Grid.of(tables, "states", "vehicle", "frame")
    lights = _numbers(table, "lights") << NUM_INDICATOR_BITS
    indicator = _codes(table, "indicator", INDICATORS)
    lane = lane_codes(road, _one(table, "lane_id"), _numbers(table, "d_mm"))
    return States(
        lane=grid.filled(lane),
        lights=grid.filled(lights | indicator),
        **_read("states", tables, "states", grid.filled),
    )


def _percepts(tables: Tables) -> Percepts:
    grid = _Grid.of(tables, "percepts", "percept")
    unseen_mm = round(float(model_constants().unseen_gap) / POSITION_RESOLUTION)
    read = _read("percepts", tables, "percepts", grid.filled, gap=unseen_mm)
    return Percepts(valid=grid.present, **read)
