"""Traffic as it is met: the ego among others, far from the ends, in balance at the first frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from overtaking.core.errors import ConfigError, InfeasibleError
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.specification import IndependentWeather
from overtaking.scenarios.traffic_specification import FlowTraffic

MOTORWAY = load_road("motorway")
NUMBERS = np.arange(600, dtype=np.uint64)


def _lanes_with_first_types(types: str) -> str:
    """Value of `traffic.lanes` in TOML, with these vehicle types in the slow lane of three."""
    other = "{ density = 1.0, types = { S = 1 }, speed_kmh = 110.0 }"
    return f"[{{ density = 1.0, types = {types}, speed_kmh = 92.0 }}, {other}, {other}]"


@pytest.fixture(scope="module")
def drawn():
    return ScenarioSource(load_specification("motorway"), MOTORWAY, 1).sample(NUMBERS)


def test_the_ego_is_one_of_many_and_never_in_the_fastest_lane(drawn):
    assert drawn.num_slots == 32
    assert drawn.num_vehicles.min() >= 8
    assert set(np.unique(drawn.start_lane[:, 0])) == {0, 1}
    assert not np.isin(
        drawn.vehicles.kind[:, 0], (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE)
    ).any()
    # Filled slots come first.
    count = drawn.num_vehicles
    assert np.array_equal(drawn.vehicles.valid, np.arange(32)[None, :] < count[:, None])


def test_lanes_have_their_densities_and_their_kinds(drawn):
    narrow = load_specification("motorway", {"traffic.density_per_km_lane": [10.0, 10.0]})
    batch = ScenarioSource(narrow, MOTORWAY, 2).sample(NUMBERS)
    for lane, share in enumerate((0.85, 1.15, 1.0)):
        spacings = []
        for one in range(len(NUMBERS)):
            there = batch.vehicles.valid[one] & (batch.start_lane[one] == lane)
            spacings.append(np.diff(np.sort(batch.start_s[one, there])))
        mean = np.concatenate(spacings).mean()
        assert mean == pytest.approx(100.0 / share, rel=0.06)
    trucks = drawn.vehicles.valid & (drawn.vehicles.kind == VehicleKind.TRUCK)
    assert not (trucks & (drawn.start_lane == 2)).any()
    assert trucks.sum() / drawn.vehicles.valid.sum() == pytest.approx(0.2, abs=0.03)


def test_nobody_starts_too_near_too_fast_or_doomed(drawn):
    s, speed = drawn.start_s.astype(float), drawn.start_speed.astype(float)
    half, valid = 0.5 * drawn.vehicles.length.astype(float), drawn.vehicles.valid
    wish = drawn.drivers.desired_speed.astype(float)
    assert (speed <= wish + 1e-3)[valid].all()
    checked = 0
    for one in range(len(NUMBERS)):
        for lane in range(3):
            there = np.flatnonzero(valid[one] & (drawn.start_lane[one] == lane))
            there = there[np.argsort(s[one, there])]
            rear, front = there[:-1], there[1:]
            gap = s[one, front] - s[one, rear] - half[one, rear] - half[one, front]
            assert (gap > 8.0 - 0.01).all()
            closing = np.maximum(speed[one, rear] - speed[one, front], 0.0)
            # Braking by 3 m/s^2 after 1.5 s is more than enough on a dry road.
            dry = drawn.weather.rain[one] == 0 and drawn.weather.puddles[one] < 25
            assert not dry or (gap > closing * 1.5 + closing**2 / 6.0 - 0.01).all()
            checked += len(rear)
    assert checked > 10_000


def test_the_ends_of_the_traffic_are_out_of_sight_at_first_and_until_the_deadline(drawn):
    flow = load_specification("motorway").traffic
    assert isinstance(flow, FlowTraffic)
    back, front = flow.sight_m
    dense = drawn.num_vehicles == 32
    assert (drawn.attempt_deadline <= 50.0).all()
    assert (drawn.attempt_deadline[~dense] == 50.0).all()
    assert np.median(drawn.attempt_deadline) == 50.0
    own = drawn.start_s[:, 0]
    for lane in range(3):
        there = drawn.vehicles.valid & (drawn.start_lane == lane)
        there[:, 0] = False
        ahead = np.where(there, drawn.start_s, -np.inf).max(axis=1) - own
        behind = own - np.where(there, drawn.start_s, np.inf).min(axis=1)
        # `settle` may have moved someone a little.
        assert np.quantile(ahead, 0.01) > front - 20.0
        assert np.quantile(behind, 0.01) > back - 20.0


def test_a_simulation_is_the_same_in_any_batch(drawn):
    part = ScenarioSource(load_specification("motorway"), MOTORWAY, 1).sample(NUMBERS[[17, 3, 599]])
    for name in ("start_s", "start_speed", "start_lane", "attempt_deadline", "weight"):
        np.testing.assert_array_equal(getattr(part, name), getattr(drawn, name)[[17, 3, 599]])
    np.testing.assert_array_equal(part.drivers.time_gap, drawn.drivers.time_gap[[17, 3, 599]])


def test_who_wants_to_go_faster_than_the_slow_overtakes_on_the_left_for_a_reason(drawn):
    # The ego's wish is its own, not made from its leader's: some are slower than all around.
    wish = drawn.drivers.desired_speed
    faster = wish[:, 0] > np.where(drawn.vehicles.valid, wish, np.nan)[:, 1:].mean(
        axis=1, where=drawn.vehicles.valid[:, 1:]
    )
    assert 0.2 < faster.mean() < 0.8


def test_a_flow_that_does_not_fit_the_road_is_refused():
    with pytest.raises(ConfigError, match="5 lanes, as the road has"):
        ScenarioSource(load_specification("motorway"), load_road("town06"), 1).sample(NUMBERS[:2])


@pytest.mark.parametrize(
    ("key", "value", "remedy"),
    [
        ("traffic.ego_lanes", "[2]", "leave out the fastest lane"),
        ("traffic.lanes", _lanes_with_first_types("{ MC = 1, S = 0 }"), "add a type such as M"),
        ("traffic.free_speed_kmh", "{ S = 100.0 }", "add L"),
        ("traffic.density_per_km_lane", "0..5", "greater than or equal to 0.1"),
        ("traffic.spawn_s_m", "[0, 1]", "did you mean"),
        ("drivers.scale", "{ time_gab = 1.0 }", "did you mean time_gap?"),
    ],
)
def test_a_mistake_is_one_line(key, value, remedy):
    with pytest.raises(ConfigError) as caught:
        load_specification("motorway", {key: value})
    assert remedy in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_lane_without_the_ego_may_have_two_wheelers_only():
    lanes = _lanes_with_first_types('["MC"]')
    overrides = {"traffic.lanes": lanes, "traffic.ego_lanes": [1]}
    batch = ScenarioSource(load_specification("motorway", overrides), MOTORWAY, 1).sample(NUMBERS)
    in_slow_lane = batch.vehicles.valid & (batch.start_lane == 0)
    assert (batch.vehicles.kind[in_slow_lane] == VehicleKind.MOTORCYCLE).all()
    assert not (batch.vehicles.kind[:, 0] == VehicleKind.MOTORCYCLE).any()


@pytest.mark.parametrize(("num_vehicles", "remedy"), [(32, "lower it"), (20, "raise traffic")])
def test_traffic_whose_ends_are_in_sight_at_the_start_is_refused_in_one_line(num_vehicles, remedy):
    overrides = {
        "traffic.density_per_km_lane": [60.0, 100.0],
        "traffic.vehicles": [8, num_vehicles],
    }
    dense = ScenarioSource(load_specification("motorway", overrides), MOTORWAY, 1)
    with pytest.raises(InfeasibleError) as caught:
        dense.sample(NUMBERS[:4])
    message = str(caught.value)
    assert "traffic.density_per_km_lane" in message
    assert "60 to 100, too dense in scenario 0" in message
    assert remedy in message
    assert "\n" not in message


@pytest.mark.parametrize(
    "overrides",
    [
        # So many vehicles, so far apart, that the traffic is much longer than the ego sees.
        {
            "traffic.vehicles": [32, 32],
            "traffic.density_per_km_lane": [2.0, 2.0],
            "time.horizon_s": 20.0,
            "time.attempt_deadline_s": 10.0,
        },
        # The traffic is placed for the 25 s after a deadline that is the end of the simulation.
        {
            "traffic.spacing_sigma": 0.05,
            "traffic.density_per_km_lane": [9.0, 9.0],
            "time.horizon_s": 1.0,
            "time.attempt_deadline_s": 1.0,
        },
    ],
)
def test_the_road_is_longer_than_the_traffic_and_the_way_of_the_foremost_vehicle(overrides):
    short_road = dataclasses.replace(load_road("motorway"), length=600.0)
    spec = load_specification("motorway", overrides)
    scenario = ScenarioSource(spec, short_road, 3).sample(range(200))
    way = scenario.start_speed * scenario.horizon[:, None]
    end = np.where(scenario.vehicles.valid, scenario.start_s + way, 0.0)
    assert end.max() < scenario.road.length


def test_dense_traffic_is_drawn_if_the_ego_sees_less_far():
    overrides = {"traffic.density_per_km_lane": [60.0, 100.0], "traffic.sight_m": [20.0, 40.0]}
    batch = ScenarioSource(load_specification("motorway", overrides), MOTORWAY, 1).sample(NUMBERS)
    assert (batch.attempt_deadline > 0.0).all()


def test_a_scale_multiplies_what_is_drawn_for_everyone(drawn):
    scaled = ScenarioSource(
        load_specification("motorway", {"drivers.scale": {"patience": 2.0}}), MOTORWAY, 1
    ).sample(NUMBERS[:50])
    np.testing.assert_allclose(scaled.drivers.patience, 2.0 * drawn.drivers.patience[:50])
    np.testing.assert_array_equal(scaled.drivers.time_gap, drawn.drivers.time_gap[:50])


def test_a_profile_may_be_based_on_another(tmp_path):
    path = tmp_path / "calm.toml"
    own = '[profile]\nname = "calm"\n[weather]\nfog_probability = 0.0\n'
    path.write_text('base = "motorway"\n' + own)
    calm = load_specification(path)
    assert calm.name == "calm"
    assert calm.traffic == load_specification("motorway").traffic
    assert isinstance(calm.weather, IndependentWeather)
    assert calm.weather.fog_probability == 0.0
    path.write_text('base = "motorvay"\n')
    with pytest.raises(ConfigError, match="did you mean motorway"):
        load_specification(path)
