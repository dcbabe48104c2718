"""What went into tables comes out of them: the same arrays, with the same types."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from overtaking.core.errors import SchemaError
from overtaking.data.tables.encode import encode
from overtaking.data.tables.restore import restore, restore_scenario
from overtaking.model.known_roads import known_road

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories


def arrays(batch, prefix: str = "") -> dict[str, np.ndarray]:
    """Every array of a nested batch by its path."""
    found = {}
    for field in dataclasses.fields(batch):
        value = getattr(batch, field.name)
        if isinstance(value, np.ndarray):
            found[prefix + field.name] = value
        elif dataclasses.is_dataclass(value) and field.name != "road":
            found |= arrays(value, f"{prefix}{field.name}.")
    return found


def meaningful(recorded: Trajectories, path: str, values: np.ndarray) -> np.ndarray:
    """The part of an array that is not padding."""
    vehicle, frame = recorded.scenario.vehicles.valid, recorded.frame_mask
    if path.startswith("states."):
        return values[vehicle[:, :, None] & frame[:, None, :]]
    if path in ("stage", "collided_with"):
        return values[frame]
    if path.startswith("percepts.") and path != "percepts.valid":
        return values[recorded.percepts.valid]
    if values.ndim == 2 and values.shape == vehicle.shape and not path.endswith("valid"):
        return values[vehicle]
    return values


def assert_same(one: Trajectories, other: Trajectories) -> None:
    """Same structure, same types, same values where there are any."""
    first, second = arrays(one), arrays(other)
    assert first.keys() == second.keys()
    for path, values in first.items():
        ours, theirs = meaningful(one, path, values), meaningful(other, path, second[path])
        assert ours.dtype == theirs.dtype, path
        assert ours.tobytes() == theirs.tobytes(), path
    for name in ("profile", "seed", "frame_interval_ms", "road"):
        assert getattr(one.scenario, name) == getattr(other.scenario, name)


def trimmed(recorded: Trajectories) -> Trajectories:
    """Without decision slots that nobody uses: tables do not know of them."""
    used = int(recorded.percepts.valid.sum(axis=1).max())
    changes = {name: values[:, :used] for name, values in arrays(recorded.percepts).items()}
    return recorded.replace(percepts=recorded.percepts.replace(**changes))


@pytest.mark.ci
@given(seed=st.integers(0, 2**32), road=st.sampled_from(["town06", "motorway"]), left=st.booleans())
@settings(max_examples=25)
def test_tables_hold_all_of_a_recording(recorder, seed: int, road: str, left: bool):
    place = known_road(road).mirror() if left else known_road(road)
    recorded = trimmed(recorder(seed, road=place))
    restored = restore(encode(recorded, np.arange(5)), place)
    assert_same(recorded, restored)


def test_simulations_with_gaps_in_their_numbers_come_back(recorder):
    recorded = trimmed(recorder(7))
    tables = encode(recorded, np.array([2, 3, 5, 8, 2**40]))
    assert_same(recorded, restore(tables, recorded.road))


def test_some_of_the_simulations_come_back_alone(recorder):
    recorded = recorder(8)
    chosen = np.array([1, 3])
    tables = encode(recorded.select(chosen), chosen)
    everything = encode(recorded, np.arange(5))
    rows = {
        name: table.filter(pa.compute.is_in(table[0], pa.array(chosen)))
        for name, table in everything.items()
    }
    assert encode(restore(rows, recorded.road), chosen)["states"].equals(tables["states"])
    assert (
        restore_scenario(rows, recorded.road).scenario_index.tolist()
        == recorded.scenario.scenario_index[chosen].tolist()
    )


def test_an_empty_slot_looks_like_the_ego_and_not_like_nothing(recorder):
    recorded = recorder(9)
    scenario = restore(encode(recorded, np.arange(5)), recorded.road).scenario
    empty = ~scenario.vehicles.valid
    mass = np.broadcast_to(scenario.vehicles.mass[:, :1], empty.shape)
    assert empty.any()
    assert np.array_equal(scenario.vehicles.mass[empty], mass[empty])


def test_two_seeds_do_not_fit_into_one_batch(recorder):
    recorded = recorder(10)
    one, other = encode(recorded, np.arange(5)), encode(recorded, np.arange(5, 10))
    seeds = pa.array([6] * 5, pa.uint64())
    other["simulations"] = other["simulations"].set_column(1, other["simulations"].field(1), seeds)
    both = {name: pa.concat_tables([one[name], other[name]]) for name in one}
    with pytest.raises(SchemaError, match=r"column seed: expected one value .*, got 2 values"):
        restore(both, recorded.road)


@pytest.mark.parametrize("name", ["vehicles", "weather", "states", "frames"])
def test_an_empty_table_beside_simulations_is_refused(recorder, name: str):
    recorded = recorder(11)
    tables = encode(recorded, np.arange(5))
    tables[name] = tables[name].slice(0, 0)
    with pytest.raises(SchemaError, match=f"{name}|num_frames"):
        restore(tables, recorded.road)
