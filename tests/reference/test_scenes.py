"""What the names of the scenes written by hand say happens, so that they go on to show it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from overtaking.model.trajectories import Lights, Stage
from overtaking.sim import engine

from .scenes import WRITTEN, Written

BY_NAME = {written.name: written for written in WRITTEN}
LANES = BY_NAME["lane changes by hand"]
ACCIDENTS = BY_NAME["accidents by hand"]
MEETINGS = BY_NAME["meetings by hand"]
COMES_IN = BY_NAME["comes in alone"]
GIVEN_UP = BY_NAME["given up by hand"]
STEERED = BY_NAME["steered by hand"]
RING = BY_NAME["ring by hand"]
LIMITS = BY_NAME["limits by hand"]
BOTH_WAYS = BY_NAME["limits of each way by hand"]


@cache
def simulated(written: Written):
    return written.run(written.scenario(written.share), engine.run)


def stages(written: Written, words: str) -> list[list[Stage]]:
    """The stages of the ego in scenes with these words in their names, one after the other."""
    run, found = simulated(written), []
    for row, scene in enumerate(written.scenes):
        if words in scene.name:
            stage = run.stage[row, : run.num_frames[row]]
            starts = np.flatnonzero(np.diff(stage, prepend=255))
            found.append([Stage(one) for one in stage[starts]])
    assert found
    return found


def lanes(written: Written, words: str, slot: int) -> list[list[int]]:
    """The lanes that a vehicle is in, one after the other, in each of such scenes."""
    run, found = simulated(written), []
    for row, scene in enumerate(written.scenes):
        if words in scene.name:
            lane = run.states.lane[row, slot, : run.num_frames[row]].astype(int)
            found.append(lane[np.flatnonzero(np.diff(lane, prepend=-1))].tolist())
    return found


def test_the_ego_goes_back_after_eight_seconds_beside_another():
    run = simulated(LANES)
    assert stages(LANES, "is stuck") == [[Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.ABORT]]
    row = next(k for k, one in enumerate(LANES.scenes) if "is stuck" in one.name)
    assert 8.0 <= 0.05 * (run.stage[row] == Stage.PASS).sum() <= 9.0


@pytest.mark.parametrize("words", ["returns too early", "while a third comes in"])
def test_some_egos_stay_out_and_some_cannot(words):
    stays = [
        Stage.PASS in one[k:]
        for one in stages(LANES, words)
        for k in range(len(one))
        if one[k] in (Stage.RETURN, Stage.ABORT)
    ]
    assert any(stays)
    assert not all(stays)


def test_of_two_side_by_side_the_one_to_the_fast_side_goes_first():
    (one,), (other,) = (lanes(LANES, "two side by side", slot) for slot in (1, 2))
    assert one == [0, 1]
    assert other == [2]


def test_somebody_moves_over_and_goes_back():
    run, rows = (
        simulated(LANES),
        [k for k, one in enumerate(LANES.scenes) if one.name == "somebody finds another beside"],
    )
    d = run.states.d[rows, 1, :120] / 1e3
    away = np.abs(d - d[:, :1])
    goes_back = (away.max(axis=1) > 0.5) & (away.max(axis=1) < 1.7) & (away[:, -1] < 0.4)
    assert goes_back.any()
    assert (away.max(axis=1) > 1.7).any()


def test_the_ego_falls_back_as_long_as_it_can():
    last = [one[-1] for one in stages(GIVEN_UP, "fall back")]
    assert last == [Stage.ABORT] * 3 + [Stage.PASS]


def test_others_overtake_pass_the_ego_and_come_in_its_lane():
    assert [0, 1, 0] in lanes(MEETINGS, "others overtake before", 2)
    assert all(one[:2] == [0, 1] for one in lanes(MEETINGS, "the ego is passed", 1))
    assert any(0 in one for one in lanes(MEETINGS, "who comes overtakes", 2))
    lights = simulated(COMES_IN).states.lights[0, 0]
    assert (lights & int(Lights.HIGH_BEAM)).any()


def test_a_follower_lets_its_leader_go_first():
    for one in lanes(MEETINGS, "goes before its follower", 3):
        assert one == [0]


def test_egos_before_oncoming_traffic_wait_pass_give_up_and_collide():
    seen = {tuple(one) for one in stages(MEETINGS, "")}
    done = (Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE)
    for expected in (done[:1], done, (Stage.FOLLOW, Stage.PULL_OUT, Stage.ABORT, Stage.FOLLOW)):
        assert any(one[: len(expected)] == expected for one in seen), expected


def test_bodies_touch_and_wrecks_are_approached():
    hit = simulated(ACCIDENTS).contacts.partner[:, 2] != 255
    for name in {one.name for one in ACCIDENTS.scenes}:
        assert any(hit[k] for k, one in enumerate(ACCIDENTS.scenes) if one.name == name), name


def test_on_a_ring_who_began_far_ahead_comes_from_behind():
    assert simulated(RING).states.accel_lon[0, 1].min() < -1000


def test_wheels_turn_as_far_as_they_go():
    angle = simulated(STEERED).states.wheel_angle[:, 0].astype(int)
    assert -5000 <= angle[0].min() < -4900
    assert 4900 < angle[1].max() <= 5000


def speeds(written: Written, words: str, slot: int) -> list[np.ndarray]:
    """The speeds of a vehicle in scenes with these words in their names [m/s]."""
    run = simulated(written)
    return [
        1e-3 * run.states.speed[row, slot, : run.num_frames[row]]
        for row, scene in enumerate(written.scenes)
        if words in scene.name
    ]


def test_lower_limits_are_driven_by_as_the_names_of_the_scenes_say():
    obeys = speeds(LIMITS, "comes to a lower limit", 1)
    assert all(one[0] == 25.0 and one[-1] < 22.6 for one in obeys)
    assert min(one.min() for one in obeys) < 15.1
    (slow,) = speeds(LIMITS, "slower than any limit", 1)
    assert 13.9 < slow.min() <= slow.max() < 14.6
    (heavy,) = speeds(LIMITS, "a truck is as fast", 1)
    assert heavy.min() > 23.9
    (gentle,) = speeds(LIMITS, "no harder than is comfortable", 1)
    assert np.diff(gentle).min() > -0.05 * 0.6
    assert gentle[-1] > 20.0
    (leaves,) = speeds(LIMITS, "leaves the stretch", 1)
    assert leaves[-1] > 20.0
    assert lanes(LIMITS, "nobody changes lanes", 1) == [[1], [2]]
    passes = stages(LIMITS, "the ego overtakes before")
    assert [Stage.PULL_OUT in one for one in passes] == [True, True, False]


def test_who_comes_has_limits_of_its_own():
    (goes,), (comes,) = (speeds(BOTH_WAYS, "who comes slows down", slot) for slot in (0, 1))
    assert goes.min() > 24.9
    assert comes[0] == 25.0
    assert comes.min() < 15.1
    assert all(Stage.PULL_OUT in one for one in stages(BOTH_WAYS, "passes before"))
