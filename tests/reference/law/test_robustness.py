"""Margins of temporal rules equal the robustness that RTAMT computes for the formulas of the law.

`make_robustness.py` describes and writes `robustness.json`: random signals, and the robustness of
each formula on them.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.cases import Track, case, with_events

from overtaking.core.float32_math import as_f32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import judge_rule
from overtaking.labels.law.numbers import STOPPING_REACTION_TIME
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.safe_distance import decel_for_safe_distance, lawful_gap
from overtaking.model.verdicts import Case, Verdict

RULES = {rule.code: rule for rule in PORTUGAL.rules}

SURE = 1e6
"""Robustness of a Boolean signal in `make_robustness.py`: no frame counts where it remains."""

TOLERANCE = 2e-3
"""Hundredths are exact to this after float32 arithmetic with numbers of some hundreds."""


@cache
def robustness_table() -> Any:
    return json.loads(Path(__file__).with_name("robustness.json").read_text("utf-8"))


def random_signal(name: str) -> np.ndarray:
    """One random signal of all simulations, shape (simulation, time)."""
    rows = [row[name] for row in robustness_table()["signals"]]
    if isinstance(rows[0], str):
        return np.array([list(row) for row in rows]) == "y"
    return as_f32(np.array(rows) / 100.0)


def robustness_of(formula: str) -> np.ndarray:
    """The robustness of a formula in each simulation."""
    return np.array(robustness_table()["robustness"][formula])


def blank_case() -> Case:
    """A simulation for each random one, with an ego, three other vehicles and no events."""
    num_simulations, num_frames = random_signal("speed").shape
    single = case(Track(s=500.0, speed=30.0), *[Track()] * 3, frames=num_frames, events={})
    return single.select(np.zeros(num_simulations, np.intp))


def case_with_signals(**changes: np.ndarray) -> Case:
    """The blank case with other signals of the ego."""
    blank = blank_case()
    return blank.replace(signals=blank.signals.replace(**changes))


def case_with_states(is_recorded: np.ndarray | None = None, **changes: np.ndarray) -> Case:
    """The blank case with other recorded states."""
    blank = blank_case()
    states = blank.trajectories.states.replace(**changes)
    trajectories = blank.trajectories.replace(states=states, is_recorded=is_recorded)
    return with_events(case_from_trajectories(trajectories), blank.events)


def assert_margin_is_robustness(code: str, judged: Case, formula: str) -> None:
    """In each simulation with a frame that counts, the margin of a rule is the robustness."""
    finding, expected = judge_rule(RULES[code], judged), robustness_of(formula)
    applies = np.abs(expected) < SURE
    assert applies.any()
    assert (expected[applies] < 0).any()
    assert (expected[applies] > 0).any()
    assert finding.margin[applies] == pytest.approx(expected[applies], abs=TOLERANCE)
    is_broken = expected[applies] < 0
    assert (finding.verdict[applies] == np.where(is_broken, Verdict.ILLEGAL, Verdict.LEGAL)).all()
    assert (finding.verdict[~applies] == Verdict.NOT_APPLICABLE).all()


def test_the_margin_of_the_speed_limit_is_the_robustness():
    assert_margin_is_robustness("L12", case_with_signals(speed=random_signal("speed")), "limit")


def test_the_margin_of_stopping_within_sight_is_the_robustness():
    at_20_mps = case_with_signals(speed=np.full_like(random_signal("stop"), 20.0))
    margin = random_signal("sight") - random_signal("stop")
    sight = stopping_distance(at_20_mps) + margin
    judged = case_with_signals(speed=at_20_mps.signals.speed, sight_lit=sight)
    assert_margin_is_robustness("L14", judged, "stop")


def stopping_distance(judged: Case) -> np.ndarray:
    """The stopping distance of rule L14 in every frame [m]."""
    share = constant("friction.table.usable_share") * constant("model.nature.gravity")
    speed, decel = judged.signals.speed, share * judged.signals.friction
    return speed * STOPPING_REACTION_TIME.f32 + speed * speed / (np.float32(2.0) * decel)


def test_the_margin_of_the_lowest_speed_is_the_robustness_where_it_is_broken():
    slow = case_with_signals(speed=random_signal("slow"))
    states = slow.trajectories.states
    speed = states.speed.copy()
    # The three others make a congestion, the exception of the rule, where "jam" is true.
    speed[:, 1:] = np.where(random_signal("jam"), 1000, 25_000)[:, None]
    trajectories = slow.trajectories.replace(states=states.replace(speed=speed))
    finding = judge_rule(RULES["L13"], slow.replace(trajectories=trajectories))
    expected = robustness_of("minimum")
    is_broken = expected < 0
    assert 0 < is_broken.sum() < len(is_broken)
    assert ((finding.verdict == Verdict.ILLEGAL) == is_broken).all()
    assert finding.margin[is_broken] == pytest.approx(expected[is_broken], abs=TOLERANCE)
    # The rule looks for congestion only at low speed, so a margin of a kept rule may be smaller.
    assert (finding.margin[~is_broken] <= expected[~is_broken] + TOLERANCE).all()


def test_the_margin_of_the_lateral_distance_is_the_robustness():
    blank = blank_case()
    states, last_frame = blank.trajectories.states, blank.signals.num_frames - 1
    width = blank.trajectories.scenario.vehicles.width[:, [0]]
    d, s = states.d.copy(), states.s.copy()
    d[:, 1] = d[:, 0] + np.rint((random_signal("aside") + width) * 1000.0)
    s[:, 1] = s[:, 0] + np.where(random_signal("beside"), 0, 100_000)
    zero = np.zeros(len(d), np.int32)
    events = {"attempt": zero, "overlap_begin": zero, "overlap_end": zero + last_frame}
    judged = case_with_states(d=d, s=s)
    judged = with_events(judged, judged.events.replace(**events))
    assert_margin_is_robustness("L10", judged, "side")


def test_the_margin_of_the_safe_distance_is_the_robustness_with_time_to_regain_the_gap():
    finding, expected = judge_rule(RULES["L3"], case_with_cut_ins()), robustness_of("follow")
    applies = np.abs(expected) < SURE
    assert (expected[applies] < 0).any()
    assert (expected[applies] > 0).any()
    assert finding.margin[applies] == pytest.approx(expected[applies], abs=0.02)
    assert (finding.verdict[~applies] == Verdict.NOT_APPLICABLE).all()


def case_with_cut_ins() -> Case:
    """Vehicles 1 and 2 are leaders in turn: at each cut-in the other one becomes the leader."""
    blank = blank_case()
    states, length = blank.trajectories.states, blank.trajectories.scenario.vehicles.length
    has_leader, is_cut_in = random_signal("lead"), random_signal("cut")
    leader_slot = 1 + np.cumsum(is_cut_in, axis=1) % 2
    lane, s, speed = states.lane.copy(), states.s.copy(), states.speed.copy()
    is_recorded = blank.trajectories.state_mask.copy()
    decel = decel_for_safe_distance(blank.signals.friction)
    lawful = lawful_gap(speed[:, 0] * np.float32(1e-3), np.float32(0.0), decel)
    margin = random_signal("gap") - random_signal("need")
    distance = lawful + margin + length[:, [0]]
    for slot in (1, 2):
        # A vehicle that is not the leader is in another lane, from which it cuts in.
        lane[:, slot] = np.where(leader_slot == slot, 0, 1)
        is_recorded[:, slot] = (leader_slot != slot) | has_leader | is_cut_in
        s[:, slot] = s[:, 0] + np.rint(distance * 1000.0)
        speed[:, slot] = speed[:, 0]
    return case_with_states(is_recorded, lane=lane, s=s, speed=speed)


def test_the_return_is_overdue_where_the_past_operator_holds_for_eight_seconds():
    is_due = random_signal("due")
    states = blank_case().trajectories.states
    lane, s = states.lane.copy(), states.s.copy()
    lane[:, 0] = is_due  # The return is due while the ego is outside of lane 0.
    s[:, 1] = s[:, 0] - 300_000
    judged, zero = case_with_states(lane=lane, s=s), np.zeros(len(is_due), np.int32)
    events = judged.events.replace(attempt=zero, overlap_end=zero, original_lane=np.uint8(zero))
    finding = judge_rule(RULES["L9"], with_events(judged, events))
    is_broken = robustness_of("duty") < 0
    assert ((finding.verdict == Verdict.ILLEGAL) == is_broken).all()
    assert 0 < is_broken.sum() < len(is_broken)
