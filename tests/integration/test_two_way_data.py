"""A data set of traffic in both directions is one like any other."""

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError

PROFILE = "rural"
SHORT = {"time.horizon_s": 20.0, "time.attempt_deadline_s": 18.0, "traffic.held_up": 1.0}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    out = tmp_path_factory.mktemp("rural") / "data"
    return ot.generate(PROFILE, 8, seed=3, out=out, keep="features", overrides=SHORT)


def test_frames_that_were_not_kept_are_simulated_again(data):
    again = data.trajectory(5)
    sampled = ot.simulate(ot.sample(PROFILE, 8, 3, overrides=SHORT))
    np.testing.assert_array_equal(again.trace_hash[0], sampled.trace_hash[5])


def test_vehicles_start_in_the_lanes_of_both_directions(data):
    vehicles = data.vehicles()
    ids = {lane.lane_id for lane in (data.road.lanes[0], data.road.fast_side_neighbour)}
    assert set(vehicles.start_lane_id) == ids
    comes = np.isin(data.scenario(5).start_lane[0], 1) & data.scenario(5).vehicles.valid[0]
    assert comes.any()


def test_the_law_of_the_other_side_is_asked(data):
    assert {"L25", "L29"} <= set(data.findings().rule)


def test_a_road_of_one_direction_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="two"):
        ot.generate(PROFILE, 8, seed=3, out=tmp_path / "data", road="motorway")
