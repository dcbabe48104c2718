"""Branches: what is refused, and that a change of weather takes effect from its frame on."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.core.errors import ConfigError
from overtaking.sim import engine, reference
from overtaking.sim.branch import Decision, branch


def world(**changes: float):
    alone = Vehicle(s=100.0, lane=1, speed=30.0, driver={"desired_speed": 30.0})
    return scenario([alone], road=wide_road(), **{"horizon": 10.0, **changes})


@pytest.mark.parametrize("frame", [-1, 201, 1_000_000])
def test_a_frame_that_no_simulation_has_is_refused(frame: int):
    with pytest.raises(ConfigError, match=f"frame: expected 0 to 200, .*got {frame}"):
        branch(world(), frame)


def test_a_change_of_weather_takes_effect_from_its_frame_on():
    calm = world()
    gale = calm.weather.replace(
        wind=np.full(1, 80.0, np.float32), wind_direction=np.full(1, 1.57, np.float32)
    )
    undisturbed = engine.simulate(calm)
    ran = branch(calm, 60, weather=gale)
    before = slice(0, 60)
    np.testing.assert_array_equal(ran.states.d[0, 0, before], undisturbed.states.d[0, 0, before])
    blown = ran.states.d[0, 0, 60:100] - undisturbed.states.d[0, 0, 60:100]
    assert blown.max() > 100  # mm, to the left, where the wind blows to.


def test_engine_and_reference_branch_alike():
    one = branch(world(), 20, decision=Decision.PULL_OUT)
    two = branch(world(), 20, decision=Decision.PULL_OUT, run=reference.run)
    np.testing.assert_array_equal(one.trace_hash, two.trace_hash)


def test_a_branch_beyond_the_end_changes_nothing():
    short = world(attempt_deadline=5.0)
    undisturbed = engine.simulate(short)
    assert undisturbed.num_frames.tolist() == [101]
    np.testing.assert_array_equal(
        branch(short, 150, decision=Decision.PULL_OUT).trace_hash, undisturbed.trace_hash
    )
