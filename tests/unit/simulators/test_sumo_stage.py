"""Stages of an overtake, told from movement."""

from __future__ import annotations

from overtaking.model.trajectories import Stage
from overtaking.simulators.sumo.stage import Sight, Watch

AHEAD, BEHIND = frozenset(), frozenset({1})


def sight(drift=0.0, offset=0.0, lane=0, leader=1, passed=AHEAD):
    return Sight(lane=lane, offset=offset, drift=drift, leader=leader, passed=passed)


def stages(*sights):
    watch = Watch(settled=0.4)
    return [watch.look(one) for one in sights], watch


OUT = (sight(drift=0.5), sight(drift=1.0, offset=1.2), sight(drift=0.3, lane=1, offset=-0.3))


def test_an_overtake_goes_through_its_stages():
    seen, watch = stages(
        sight(),
        *OUT,
        sight(lane=1),
        sight(lane=1, passed=BEHIND),
        sight(drift=-0.5, lane=1, passed=BEHIND),
        sight(drift=-0.5, lane=0, offset=0.9, passed=BEHIND),
        sight(lane=0, passed=BEHIND),
    )
    assert seen == [
        Stage.FOLLOW,
        *[Stage.PULL_OUT] * 3,
        *[Stage.PASS] * 2,
        *[Stage.RETURN] * 2,
        Stage.DONE,
    ]
    assert (watch.attempted, watch.target) == (True, 1)


def test_who_turns_back_before_the_target_gives_up():
    back = sight(drift=-0.5, offset=0.3)
    assert stages(*OUT[:2], back, sight())[0][2:] == [Stage.ABORT, Stage.FOLLOW]
    assert stages(*OUT, sight(lane=1), sight(drift=-0.5, lane=1))[0][-1] is Stage.ABORT


def test_who_is_past_when_back_in_a_lane_has_overtaken():
    back = [sight(drift=-0.5, lane=1), sight(drift=-0.5, passed=BEHIND), sight(passed=BEHIND)]
    assert stages(*OUT, sight(lane=1), *back)[0][4:] == [Stage.ABORT, Stage.RETURN, Stage.DONE]


def test_a_lane_change_without_anybody_ahead_is_no_overtake():
    seen, watch = stages(sight(drift=0.5, leader=None), sight(drift=1.0, leader=None))
    assert (seen[-1], watch.attempted) == (Stage.FOLLOW, False)


def test_going_to_the_slow_side_is_no_overtake():
    assert stages(sight(drift=-0.5))[0] == [Stage.FOLLOW]


def test_a_crash_is_for_good_as_is_the_end():
    watch = Watch(settled=0.4)
    watch.crash()
    assert watch.look(sight(drift=0.5)) is Stage.CRASHED
    done = Watch(settled=0.4, stage=Stage.DONE, attempted=True, target=1)
    assert done.look(sight(drift=0.5)) is Stage.DONE
