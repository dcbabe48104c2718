"""From tables back to memory: the same values, so that labels from memory and from file agree."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.errors import SchemaError
from overtaking.data.tables.arrow import column_to_numpy, to_arrow
from overtaking.data.tables.columns import codes
from overtaking.data.tables.schemas import (
    BODY_FIELDS,
    COLOURS,
    DECISIONS,
    DRIVER_FIELDS,
    INDICATORS,
    KINDS,
    NEIGHBOURS,
    NUM_INDICATOR_BITS,
    STAGES,
    STATE_FIELDS,
    WEATHER_FIELDS,
)
from overtaking.data.tables.surroundings import lane_codes
from overtaking.knowledge import presets
from overtaking.model.drivers import Drivers
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario, slots_for
from overtaking.model.trajectory import (
    METRES_PER_STEP,
    NO_VEHICLE,
    Contacts,
    Percepts,
    States,
    Trajectories,
)
from overtaking.model.vehicles import Role, VehicleSpecs
from overtaking.model.weather import NO_PRESET, Weather
from overtaking.scenarios.assumed import KIND, assumed_bodies, assumed_drivers, assumed_weather
from overtaking.world.constants import constants

Array = NDArray[Any]
Tables = Mapping[str, pa.Table]
B = TypeVar("B", VehicleSpecs, Drivers)


def restore_scenario(tables: Tables, road: Road, unknown: Collection[str] = ()) -> Scenario:
    """The scenarios of some simulations.

    Args:
        tables: `simulations`, `weather` and `vehicles` of the same simulations, sorted by key.
        road: Their road.
        unknown: What the tables do not tell, names of `UNKNOWNS`.

    Returns:
        A batch with as many vehicle slots as the sampler makes.

    Raises:
        SchemaError: The simulations do not fit into one batch.
    """
    rows = tables["simulations"]
    vehicles = _Grid.of_vehicles(tables)
    start_lane = _one(tables["vehicles"], "start_lane_id")
    lane = lane_codes(road, start_lane, np.zeros(len(start_lane), dtype=np.int32))
    return Scenario(
        profile=_shared(rows, "profile"),
        road=road,
        seed=_shared(rows, "seed") or 0,  # A recording has none.
        frame_interval_ms=_shared(rows, "frame_interval_ms"),
        index=_numbers(rows, "index"),
        horizon=_numbers(rows, "horizon_s"),
        attempt_deadline=_numbers(rows, "attempt_deadline_s"),
        weight=_numbers(rows, "weight"),
        vehicles=_bodies(tables["vehicles"], vehicles, unknown),
        drivers=_drivers(tables["vehicles"], vehicles, unknown),
        weather=assumed_weather(len(rows)) if "weather" in unknown else _weather(tables),
        start_s=vehicles.like_ego(_numbers(tables["vehicles"], "start_s_m")),
        start_lane=vehicles.like_ego(lane),
        start_speed=vehicles.like_ego(_numbers(tables["vehicles"], "start_speed_mps")),
    )


def restore(tables: Tables, road: Road, unknown: Collection[str] = ()) -> Trajectories:
    """The recorded simulations that `encode` has made tables of.

    Args:
        tables: Every table of the same simulations, sorted by key.
        road: Their road.
        unknown: What the tables do not tell, names of `UNKNOWNS`.

    Returns:
        A batch with as many vehicle slots as the sampler makes, and as many frames as needed.

    Raises:
        SchemaError: The simulations do not fit into one batch.
    """
    rows, frames = tables["simulations"], tables["frames"]
    grid = _Grid.of(tables, frames, "frame")
    hashes = b"".join(rows["trace_hash"].to_pylist())
    restored = Trajectories(
        scenario=restore_scenario(tables, road, unknown),
        num_frames=_numbers(rows, "num_frames"),
        states=_states(tables, road),
        stage=grid.filled(_codes(frames, "stage", STAGES.names)),
        collided_with=grid.filled(_numbers(frames, "collided_with", NO_VEHICLE), NO_VEHICLE),
        contacts=_contacts(tables),
        percepts=_percepts(tables),
        trace_hash=np.frombuffer(hashes, dtype="<u4").reshape(-1, 4).astype(np.uint32),
        unknown=frozenset(unknown),
    )
    if tables["states"].num_rows == np.count_nonzero(restored.state_valid):
        return restored
    return restored.replace(present=_present(tables))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Where the rows of a table lie in arrays that lead with the simulation axis.

    Attributes:
        place: Index arrays of the rows, one for each axis, shape (row,).
        shape: Shape of the arrays.
    """

    place: tuple[Array, ...]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, tables: Tables, table: pa.Table, *axes: str) -> "_Grid":
        """Arrays over the simulations and the keys named in `axes`, as long as needed."""
        numbers = _numbers(tables["simulations"], "simulation")
        places = [_numbers(table, axis) for axis in axes]
        # A table knows nothing of slots without a vehicle, which a sampled batch has.
        ends = [int(place.max()) + 1 if len(place) else 0 for place in places]
        lengths = [
            slots_for(end) if axis == "vehicle" else end
            for axis, end in zip(axes, ends, strict=True)
        ]
        simulation = np.searchsorted(numbers, _numbers(table, "simulation"))
        return cls(place=(simulation, *places), shape=(len(numbers), *lengths))

    @classmethod
    def of_vehicles(cls, tables: Tables) -> "_Grid":
        """Arrays over simulations and vehicles."""
        return cls.of(tables, tables["vehicles"], "vehicle")

    @property
    def num_rows(self) -> int:
        """Number of rows of the table."""
        return len(self.place[0])

    def filled(self, values: Array, padding: Any = 0) -> Array:
        """Values at their places; rows of (row, n) give arrays with a last axis of n."""
        array = np.full((*self.shape, *values.shape[1:]), padding, dtype=values.dtype)
        array[self.place] = values
        return array

    def like_ego(self, values: Array) -> Array:
        """Values per vehicle, where a slot without a vehicle looks like the ego.

        Slots without one are not looked at, but their values have to be ones that can be computed
        with: a body of zero mass would divide by zero.
        """
        array = self.filled(values)
        present = self.filled(np.ones(len(values), dtype=np.bool_))
        return np.where(present, array, array[:, Role.EGO, None])


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
        raise SchemaError.of(
            what=f"column {column}",
            where="simulations",
            expected="one value for all simulations of a batch",
            got=f"{len(values)} values",
            next_step="take simulations with the same value together",
        )
    return values[0]


def _attributes(
    table: pa.Table, fields: Iterable[tuple[str, str]], grid: _Grid
) -> dict[str, Array]:
    return {name: grid.like_ego(_numbers(table, column)) for name, column in fields}


def _codes(table: pa.Table, column: str, names: tuple[str, ...], missing: int = 0) -> Array:
    """The codes of an enumeration, with one for its nulls."""
    found = codes(table[column], names)
    return np.where(found < 0, missing, found).astype(np.uint8)


def _present(tables: Tables) -> NDArray[np.bool_]:
    """Where there is a row of the states, shape (simulation, vehicle, time)."""
    grid = _Grid.of(tables, tables["states"], "vehicle", "frame")
    return grid.filled(np.ones(grid.num_rows, dtype=np.bool_), padding=False)


def _bodies(table: pa.Table, grid: _Grid, unknown: Collection[str]) -> VehicleSpecs:
    valid = grid.filled(np.ones(grid.num_rows, dtype=np.bool_))
    kind = grid.like_ego(_codes(table, "kind", KINDS.names, KIND))
    if "bodies" in unknown:
        length, width = (grid.like_ego(_numbers(table, name)) for name in ("length_m", "width_m"))
        return assumed_bodies(valid, kind, length, width)
    return VehicleSpecs(
        valid=valid,
        kind=kind,
        colour=grid.like_ego(_codes(table, "colour", COLOURS.names)),
        **_attributes(table, BODY_FIELDS, grid),
    )


def _drivers(table: pa.Table, grid: _Grid, unknown: Collection[str]) -> Drivers:
    if "drivers" in unknown:
        return assumed_drivers((grid.shape[0], grid.shape[1]))
    return Drivers(**_attributes(table, DRIVER_FIELDS, grid))


def _weather(tables: Tables) -> Weather:
    key = _numbers(tables["simulations"], "weather")
    rows = np.searchsorted(_numbers(tables["weather"], "weather"), key)
    table = tables["weather"].take(to_arrow(rows))
    code = {name: number for number, name in enumerate(presets())} | {None: NO_PRESET}
    preset = np.array([code[name] for name in table["preset"].to_pylist()], dtype=np.uint8)
    return Weather(
        preset=preset, **{name: _numbers(table, column) for name, column in WEATHER_FIELDS}
    )


def _states(tables: Tables, road: Road) -> States:
    table = tables["states"]
    grid = _Grid.of(tables, table, "vehicle", "frame")
    lights = _numbers(table, "lights") << NUM_INDICATOR_BITS
    indicator = _codes(table, "indicator", INDICATORS.names)
    lane = lane_codes(road, _one(table, "lane_id"), _numbers(table, "d_mm"))
    return States(
        lane=grid.filled(lane),
        lights=grid.filled(lights | indicator),
        **{name: grid.filled(_numbers(table, column)) for name, column in STATE_FIELDS},
    )


def _contacts(tables: Tables) -> Contacts:
    table, grid = tables["vehicles"], _Grid.of_vehicles(tables)
    partner = _numbers(table, "contact_vehicle", NO_VEHICLE)
    return Contacts(
        partner=grid.filled(partner, NO_VEHICLE),
        time=grid.filled(_numbers(table, "contact_time_ms")),
        impulse=grid.filled(_numbers(table, "contact_impulse_newton_s")),
        closing_speed=grid.filled(_numbers(table, "contact_closing_speed_mmps")),
    )


def _percepts(tables: Tables) -> Percepts:
    table = tables["percepts"]
    grid = _Grid.of(tables, table, "decision")

    def of_neighbours(column: str, missing: Any = 0) -> Array:
        values = [_numbers(table, f"{who}_{column}", missing) for who in NEIGHBOURS]
        return grid.filled(np.stack(values, axis=-1), missing)

    unseen_mm = round(float(constants().unseen_gap) / METRES_PER_STEP)

    return Percepts(
        valid=grid.filled(np.ones(grid.num_rows, dtype=np.bool_)),
        kind=grid.filled(codes(table["kind"], DECISIONS.names).astype(np.uint8)),
        time=grid.filled(_numbers(table, "time_ms")),
        vehicle=of_neighbours("vehicle", NO_VEHICLE),
        detected=of_neighbours("detected"),
        gap=of_neighbours("gap_mm", unseen_mm),
        closing_speed=of_neighbours("closing_speed_mmps"),
        true_gap=of_neighbours("true_gap_mm"),
        true_closing_speed=of_neighbours("true_closing_speed_mmps"),
    )
