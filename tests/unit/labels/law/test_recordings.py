"""Findings where vehicles enter and leave the recording, and where positions are noisy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.cases import Track, ramp, seen_case
from tests.support.overtakes import crossing

from overtaking.labels.law.criteria.starting import denoised_lateral_speed_at
from overtaking.labels.law.judging import judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.snapshots import VehicleInstants, lateral_speed_at
from overtaking.model.verdicts import Verdict
from overtaking.recordings.recording import NEVER_RECORDED

ATTEMPT = 60
L7 = next(rule for rule in PORTUGAL.rules if rule.code == "L7")
TWO_HUNDRED = np.float32(0.2)


def recorded(target_d: np.ndarray, first: int = 0):
    """A crossing with a target that is recorded from a frame on, at lateral offsets [m]."""
    simulated = crossing(target={"lane": 0.0})
    trajectories = simulated.trajectories
    d = trajectories.states.d.copy()
    d[0, 1] = np.rint(d[0, 1] + target_d * 1000.0)
    d[0, 1, :first] = 0
    is_recorded = trajectories.state_mask.copy()
    is_recorded[0, 1, :first] = False
    states = dataclasses.replace(trajectories.states, d=d)
    unknown = NEVER_RECORDED - {"indicators"}
    trajectories = trajectories.replace(states=states, is_recorded=is_recorded, unknown=unknown)
    return seen_case(trajectories, {"attempt": ATTEMPT, "line_crossed": 100})


@pytest.mark.parametrize("first", [ATTEMPT - 1, ATTEMPT])
def test_a_target_whose_track_begins_at_the_attempt_has_no_lateral_jump(first):
    case = recorded(np.zeros(200), first)
    assert abs(case.trajectories.states.d[0, 1, ATTEMPT]) > 1000  # 0 would be a metre away.
    finding = judge_rule(L7, case)
    assert finding.verdict[0] == Verdict.LEGAL
    assert finding.margin[0] == pytest.approx(0.2)


def target_at(frame):
    """The vehicle in slot 1 in one frame of the only simulation."""
    return VehicleInstants(np.zeros(1, np.intp), np.ones(1, np.intp), np.array([frame]))


def test_lateral_speeds_beside_a_gap_are_one_sided_differences():
    case = recorded(np.arange(200) * 0.01, ATTEMPT)
    run = case.trajectories
    expected = case.target.lateral_speed[0]
    for frame in range(ATTEMPT, 200):
        speed = lateral_speed_at(run, target_at(frame))
        assert speed[0] == pytest.approx(0.2, abs=1e-3)
        assert speed[0] == expected[frame]


def test_a_vehicle_recorded_in_a_single_frame_has_no_lateral_speed():
    case = recorded(np.zeros(200), ATTEMPT)
    is_recorded = case.trajectories.state_mask.copy()
    is_recorded[0, 1, ATTEMPT + 1 :] = False
    run = case.trajectories.replace(is_recorded=is_recorded)
    assert lateral_speed_at(run, target_at(ATTEMPT))[0] == 0.0
    assert denoised_lateral_speed_at(run, target_at(ATTEMPT), 0.2)[0] == 0.0


def test_l7_does_not_take_noise_for_movement():
    generator = np.random.default_rng(3)
    num_breaches = {"steady": 0, "short": 0}
    for _ in range(50):
        case = recorded(generator.normal(0.0, 0.03, 200))
        speed = lateral_speed_at(case.trajectories, target_at(ATTEMPT))
        num_breaches["short"] += int(speed[0] > TWO_HUNDRED)
        num_breaches["steady"] += int(judge_rule(L7, case).verdict[0] == Verdict.ILLEGAL)
    assert num_breaches["short"] >= 5
    assert num_breaches["steady"] == 0


def test_l7_detects_movement_through_noise():
    generator = np.random.default_rng(4)
    moving = ramp((0, 0), (10, 5), frames=200)  # 0.5 m/s.
    case = recorded(moving + generator.normal(0.0, 0.03, 200))
    finding = judge_rule(L7, case)
    assert finding.verdict[0] == Verdict.ILLEGAL
    assert finding.margin[0] == pytest.approx(-0.3, abs=0.1)


def test_the_lateral_speed_in_a_simulation_is_not_denoised():
    case = crossing(Track(s=40.0))
    target = target_at(ATTEMPT)
    speed = lateral_speed_at(case.trajectories, target)
    assert denoised_lateral_speed_at(case.trajectories, target, 0.2) == speed
