"""What the stage of the ego is told from: who is ahead in its lane, who is behind."""

from __future__ import annotations

import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.simulators.sumo.run import _Simulation
from overtaking.simulators.sumo.traffic import Traffic

LANES = (-8.75, -5.25, -1.75)
LENGTH = 4.0


def sight(ego, *others, road=None):
    """What is seen of vehicles that are given as lane and front bumper."""
    body = {"length": LENGTH}
    world = scenario([Vehicle(body=body)] * (1 + len(others)), road=road or wide_road())
    simulation = _Simulation(Traffic.of(world), 0, None)
    rows = [(front, LANES[lane], 20.0, 0.0, 0.0, 90.0, 0) for lane, front in (ego, *others)]
    return simulation._sight(dict(enumerate(rows)))


def test_the_leader_is_the_nearest_ahead_in_the_own_lane():
    seen = sight((1, 100.0), (0, 110.0), (1, 160.0), (1, 130.0), (2, 105.0), (1, 95.0))
    assert (seen.lane, seen.leader) == (1, 3)
    assert seen.offset == pytest.approx(0.0)


def test_nobody_leads_from_beyond_sight_or_from_another_lane():
    assert sight((1, 100.0), (1, 401.0), (0, 120.0)).leader is None
    assert sight((1, 100.0), (1, 399.0)).leader == 1


def test_who_is_passed_has_its_front_behind_the_egos_rear():
    assert sight((1, 100.0), (0, 95.9), (0, 96.1), (2, 50.0)).passed == {1, 3}
