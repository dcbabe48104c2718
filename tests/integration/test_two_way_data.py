"""A data set of traffic in both directions is one like any other."""

import numpy as np
import pytest

import overtaking as ot
from overtaking.analysis.learning.examples import examples_of
from overtaking.core.errors import ConfigError

pytestmark = pytest.mark.ci

PROFILE = "rural"
SHORT = {"time.horizon_s": 20.0, "time.attempt_deadline_s": 18.0, "traffic.held_up": 1.0}
PASSES = SHORT | {
    "time.horizon_s": 35.0,
    "drivers.driving_style": [0.9, 1.0],
    "traffic.types": {"M": 1.0, "T": 1.0},
    "traffic.ego_types": {"M": 1.0},
}
"""Egos that pass soon."""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    out = tmp_path_factory.mktemp("rural") / "data"
    return ot.generate_dataset(
        PROFILE, num_simulations=8, seed=3, out=out, keep="features", overrides=SHORT
    )


def test_frames_that_were_not_kept_are_simulated_again(data):
    again = data.trajectory(5)
    sampled = ot.simulate(ot.sample(PROFILE, num_simulations=8, seed=3, overrides=SHORT))
    np.testing.assert_array_equal(again.trace_hash[0], sampled.trace_hash[5])


def test_vehicles_start_in_the_lanes_of_both_directions(data):
    vehicles = data.vehicles()
    ids = {lane.lane_id for lane in (data.road.lanes[0], data.road.overtaking_side_neighbour)}
    assert set(vehicles.start_lane_id) == ids
    comes = np.isin(data.scenario(5).start_lane[0], 1) & data.scenario(5).vehicles.valid[0]
    assert comes.any()


def test_the_law_of_the_other_side_is_asked(data):
    assert {"L25", "L29"} <= set(data.findings().rule)


@pytest.fixture(scope="module")
def passes(tmp_path_factory):
    out = tmp_path_factory.mktemp("passes") / "data"
    return ot.generate_dataset(PROFILE, num_simulations=64, seed=5, out=out, overrides=PASSES)


def by_hand(data, number):
    """Time until ego and oncomer meet by frame, and the first and last on the other side.

    From the rows of the states alone: bodies as boxes, and who comes in the other lane.
    """
    states = data.states(number).set_index(["frame", "vehicle"])
    bodies = data.vehicles().query("simulation == @number").set_index("vehicle")
    ego, road = states.xs(0, level="vehicle"), data.road
    direction = road.heading_at(ego.s_m.to_numpy())
    turned = ego.heading_rad.to_numpy() - np.arctan2(direction[1], direction[0])
    half = 0.5 * bodies.loc[0, ["length_m", "width_m"]].to_numpy(dtype=float)
    reach = ego.d_m + np.abs(np.sin(turned)) * half[0] + np.abs(np.cos(turned)) * half[1]
    beyond = np.flatnonzero(reach > road.lane_boundaries[-1] + 0.05)
    comes = bodies.index[bodies.start_lane_id == road.overtaking_side_neighbour.lane_id]
    nearest, times = np.full(len(ego), np.inf), np.full(len(ego), np.nan)
    for slot in comes:
        other = states.xs(slot, level="vehicle")
        ahead = (other.s_m - ego.s_m).to_numpy()
        gap = ahead - half[0] - 0.5 * bodies.loc[slot, "length_m"]
        closing = (other.speed_mps + ego.speed_mps).to_numpy()
        met = np.maximum(gap, 0.0) / np.maximum(closing, 1e-3)  # Both may stand after a collision.
        is_next = (ahead > 0.0) & (gap < nearest)
        nearest, times = np.where(is_next, gap, nearest), np.where(is_next, met, times)
    return times, beyond


def test_times_to_meet_are_those_of_the_recorded_states(passes):
    rows = passes.safety().query("moment == 'manoeuvre'").set_index("simulation")
    labels = passes.labels().query("policy == 'paper'").set_index("simulation")
    found = rows[(labels.outcome == "completed") & rows.oncoming_time_in_opposing_lane_s.notna()]
    assert len(found) >= 5
    for number, row in found.iterrows():
        times, beyond = by_hand(passes, number)
        first, last = int(beyond[0]), int(beyond[-1])
        told = row[
            [
                "oncoming_time_to_meet_at_crossing_s",
                "oncoming_time_to_meet_at_return_s",
                "oncoming_min_time_to_meet_s",
            ]
        ]
        computed = [times[first], times[last], np.nanmin(times[first : last + 1])]
        np.testing.assert_allclose(told.to_numpy(float), computed, atol=2e-3)
        assert row.oncoming_time_in_opposing_lane_s == pytest.approx(
            0.05 * (last - first), abs=1e-4
        )
        assert not row.oncoming_was_aborted


def test_decisions_know_who_comes_next(passes):
    attempts = passes.attempts().set_index("simulation")
    for number, row in attempts.iterrows():
        times, _ = by_hand(passes, number)
        assert row.oncoming_time_s == pytest.approx(times[row.frame], abs=2e-3)
    assert attempts.oncoming_crossable.notna().all()


def test_sql_finds_the_margins_that_the_tables_have(passes):
    asked = "select min(oncoming_time_to_meet_at_return_s) from safety where moment = 'manoeuvre'"
    (least,) = ot.sql(passes, asked).rows[0]
    assert least == pytest.approx(passes.safety().oncoming_time_to_meet_at_return_s.min())


def test_the_learner_knows_oncoming_traffic(passes):
    examples = examples_of(passes)
    found = examples.column("oncoming_time_s")
    known = passes.attempts().oncoming_time_s.to_numpy(float)
    np.testing.assert_allclose(found, np.clip(np.nan_to_num(known, nan=60.0), 0.0, 60.0))
    assert set(examples.column("oncoming_crossable")) <= {0.0, 1.0}


def test_a_road_of_one_direction_has_no_oncoming_traffic(tmp_path):
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=8, seed=3, out=tmp_path / "data", keep="features"
    )
    for table in (data.safety(), data.attempts()):
        columns = [name for name in table.columns if str(name).startswith("oncoming_")]
        assert len(columns) >= 6
        assert table[columns].isna().all().all()
    assert not any(one.of_two_ways for one in examples_of(data).attributes)


def test_a_road_of_one_direction_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="two"):
        ot.generate_dataset(
            PROFILE, num_simulations=8, seed=3, out=tmp_path / "data", road="motorway"
        )
