"""Properties of scenarios for every specification, seed and batch."""

import dataclasses

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from overtaking.core.errors import ConfigError
from overtaking.model.batch import Batch
from overtaking.model.known_roads import known_road
from overtaking.model.scenario import SLOT_CAPACITIES
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import BLOCK_SIZE, ScenarioSource
from overtaking.scenarios.traffic_specification import PlacedTraffic

TOWN06 = known_road("town06")
PINTO = load_specification("pinto2023-physical")
SEEDS = st.integers(0, 2**64 - 1)


def arrays(batch, prefix=""):
    """Every array of a batch and of the batches in it, with its name."""
    for field in dataclasses.fields(batch):
        value = getattr(batch, field.name)
        if isinstance(value, np.ndarray):
            yield prefix + field.name, value
        elif isinstance(value, Batch):
            yield from arrays(value, f"{prefix}{field.name}.")


def assert_same(left_batch, right_batch):
    for (name, left), (_, right) in zip(arrays(left_batch), arrays(right_batch), strict=True):
        assert left.dtype == right.dtype, name
        assert left.shape == right.shape, name
        assert left.tobytes() == right.tobytes(), name


@st.composite
def specifications(draw):
    fewest = draw(st.integers(2, SLOT_CAPACITIES[0]))
    low = draw(st.floats(30.0, 80.0))
    zone = draw(st.floats(20.0, 200.0)), draw(st.floats(200.0, 400.0))
    overrides = {
        "traffic.vehicles": [fewest, draw(st.integers(fewest, SLOT_CAPACITIES[0]))],
        "traffic.speed_kmh": [low, draw(st.floats(low, 150.0))],
        "traffic.leader_speed_kmh": [low, draw(st.floats(low, 150.0))],
        "traffic.leader_speed_exponent": draw(st.floats(0.5, 4.0)),
        "traffic.spawn_s_m": [zone[0], zone[1] + 50.0],
        "starts.min_gap_m": draw(st.floats(3.0, 15.0)),
        "drivers.driving_style": draw(st.sampled_from([[0.0, 1.0], [1.0, 1.0], [0.2, 0.4]])),
        "weather.mode": draw(st.sampled_from(["presets", "independent"])),
    }
    if overrides["weather.mode"] == "presets":
        overrides["weather.presets"] = PINTO.to_dict()["weather"]["presets"]
    return load_specification("pinto2023-physical", overrides)


@pytest.mark.ci
@settings(max_examples=25)
@given(SEEDS, st.lists(st.integers(0, 2**64 - 1), min_size=1, max_size=30))
def test_a_scenario_is_the_same_in_any_batch(seed, numbers):
    together = ScenarioSource(PINTO, TOWN06, seed).sample(np.array(numbers, np.uint64))
    row = len(numbers) // 2
    alone = ScenarioSource(PINTO, TOWN06, seed).sample(np.array([numbers[row]], np.uint64))
    assert_same(together.select(np.array([row])), alone)
    backwards = ScenarioSource(PINTO, TOWN06, seed).sample(np.array(numbers[::-1], np.uint64))
    assert_same(together.select(slice(None, None, -1)), backwards)


def test_a_scenario_is_the_same_in_any_block_of_the_sampler():
    together = ScenarioSource(PINTO, TOWN06, 1).sample(np.arange(BLOCK_SIZE + 100))
    later = ScenarioSource(PINTO, TOWN06, 1).sample(np.arange(BLOCK_SIZE - 50, BLOCK_SIZE + 50))
    assert_same(together.select(slice(BLOCK_SIZE - 50, BLOCK_SIZE + 50)), later)


def test_simulation_57_does_not_depend_on_the_largest_number_of_vehicles():
    # Each slot has its own random streams, so more slots only add vehicles.
    fixed = {"starts.allow_doomed": True, "starts.min_gap_m": 3.0}
    few, many = (
        ScenarioSource(
            load_specification("pinto2023-physical", fixed | {"traffic.vehicles": [n, n]}),
            TOWN06,
            1,
        ).sample([57])
        for n in (3, 6)
    )
    for name in ("kind", "colour", "length", "mass", "tyre_wear"):
        left, right = (getattr(batch.vehicles, name)[:, :3] for batch in (few, many))
        np.testing.assert_array_equal(left, right)
    np.testing.assert_array_equal(few.drivers.time_gap[:, :3], many.drivers.time_gap[:, :3])
    np.testing.assert_array_equal(few.weather.preset, many.weather.preset)


@pytest.mark.ci
@settings(max_examples=40)
@given(specifications(), SEEDS)
def test_every_start_lies_within_the_ranges_of_its_specification(specification, seed):
    batch = ScenarioSource(specification, TOWN06, seed).sample(np.arange(64))
    valid, s, lane = batch.vehicles.valid, batch.start_s, batch.start_lane
    fewest, most = specification.traffic.vehicles
    assert fewest <= batch.num_vehicles.min() <= batch.num_vehicles.max() <= most
    assert np.all(valid[:, :2])
    assert np.all(lane[:, 0] == lane[:, 1])
    assert np.all(lane[:, 0] < TOWN06.num_lanes - 1)
    low, high = specification.traffic.spawn_s_m
    assert np.all((s[valid] > low - 1e-3) & (s[valid] < high + 1e-3))
    slowest = min(specification.traffic.speed_kmh[0], specification.traffic.leader_speed_kmh[0])
    fastest = max(specification.traffic.speed_kmh[1], specification.traffic.leader_speed_kmh[1])
    speed_kmh = batch.start_speed[valid] * 3.6
    assert np.all((speed_kmh > slowest - 1e-3) & (speed_kmh < fastest + 1e-3))
    half_length = 0.5 * batch.vehicles.length
    for first in range(batch.num_slots):
        for second in range(first):
            in_same_lane = valid[:, first] & valid[:, second] & (lane[:, first] == lane[:, second])
            gap = (
                np.abs(s[:, first] - s[:, second]) - half_length[:, first] - half_length[:, second]
            )
            assert np.all(gap[in_same_lane] > specification.starts.min_gap_m - 1e-3)


@settings(max_examples=20)
@given(specifications(), SEEDS)
def test_every_number_is_finite_and_of_the_agreed_shape(specification, seed):
    batch = ScenarioSource(specification, TOWN06, seed).sample(np.arange(16))
    for name, values in arrays(batch):
        assert values.shape in ((16,), (16, batch.num_slots)), name
        assert np.all(np.isfinite(values)), name
        if values.dtype.kind == "f":
            assert values.dtype == (np.float64 if name == "weight" else np.float32), name


@pytest.mark.ci
@settings(max_examples=20)
@given(SEEDS)
def test_another_seed_gives_another_batch(seed):
    batch = ScenarioSource(PINTO, TOWN06, seed).sample(np.arange(8))
    other_seed_batch = ScenarioSource(PINTO, TOWN06, (seed + 1) % 2**64).sample(np.arange(8))
    assert np.all(batch.start_s[batch.vehicles.valid] > 0)
    assert not np.array_equal(batch.start_s, other_seed_batch.start_s)


def test_an_empty_batch_has_the_shape_of_its_specification():
    empty = ScenarioSource(PINTO, TOWN06, 1).sample([])
    assert empty.num_simulations == 0
    assert isinstance(PINTO.traffic, PlacedTraffic)
    assert empty.start_s.shape == (0, PINTO.traffic.vehicles[1])


@pytest.mark.parametrize("index", [[-1], [0.5], [[0, 1]], 3, ["a"]])
def test_invalid_numbers_of_simulations_are_refused(index):
    with pytest.raises(ConfigError, match="a list of whole numbers from 0 on"):
        ScenarioSource(PINTO, TOWN06, 1).sample(index)


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_an_invalid_seed_is_refused(seed):
    with pytest.raises(ConfigError, match="seed"):
        ScenarioSource(PINTO, TOWN06, seed).sample([0])


def test_the_batch_has_the_times_and_the_name_of_its_specification():
    batch = ScenarioSource(PINTO, TOWN06, 7).sample([3, 1])
    assert (batch.profile, batch.seed, batch.frame_interval_ms) == ("pinto2023-physical", 7, 50)
    np.testing.assert_array_equal(batch.scenario_index, np.array([3, 1], np.uint64))
    np.testing.assert_array_equal(batch.horizon, np.float32([20, 20]))
    np.testing.assert_array_equal(batch.attempt_deadline, np.float32([8, 8]))
    np.testing.assert_array_equal(batch.weight, [1.0, 1.0])
