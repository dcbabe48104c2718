"""Margins of temporal rules against the robustness that RTAMT gives the formulas of the law.

robustness.json is made by make_robustness.py, which says how.
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
SAME = 2e-3
"""Hundredths are exact to this after float32 arithmetic with numbers of some hundreds."""


@cache
def table() -> Any:
    return json.loads(Path(__file__).with_name("robustness.json").read_text("utf-8"))


def signal(name: str) -> np.ndarray:
    """One random signal of all simulations, (simulation, time)."""
    rows = [row[name] for row in table()["signals"]]
    if isinstance(rows[0], str):
        return np.array([list(row) for row in rows]) == "y"
    return as_f32(np.array(rows) / 100.0)


def robustness(name: str) -> np.ndarray:
    return np.array(table()["robustness"][name])


def blank() -> Case:
    """As many simulations of an ego and three others as there are random ones."""
    frames = signal("speed").shape[1]
    one = case(Track(s=500.0, speed=30.0), *[Track()] * 3, frames=frames, events={})
    return one.select(np.zeros(len(signal("speed")), np.intp))


def seen(**changes: np.ndarray) -> Case:
    """The same with other signals of the ego."""
    one = blank()
    return one.replace(signals=one.signals.replace(**changes))


def recorded(present: np.ndarray | None = None, **changes: np.ndarray) -> Case:
    """The same with other recorded states, and nothing that happened."""
    one = blank()
    states = one.trajectories.states.replace(**changes)
    run = one.trajectories.replace(states=states, is_recorded=present)
    return with_events(case_from_trajectories(run), one.events)


def assert_same(code: str, one: Case, name: str) -> None:
    """The margin is the robustness, wherever any frame counts."""
    found, expected = judge_rule(RULES[code], one), robustness(name)
    counts = np.abs(expected) < SURE
    assert counts.any()
    assert (expected[counts] < 0).any()
    assert (expected[counts] > 0).any()
    assert found.margin[counts] == pytest.approx(expected[counts], abs=SAME)
    assert (found.verdict[counts] == np.where(expected[counts] < 0, 1, 0)).all()
    assert (found.verdict[~counts] == Verdict.NOT_APPLICABLE).all()


def test_the_speed_limit_is_a_robustness():
    assert_same("L12", seen(speed=signal("speed")), "limit")


def test_a_stop_in_sight_is_a_robustness():
    one = seen(speed=np.full_like(signal("stop"), 20.0))
    stop = judge_stop(one)
    assert_same("L14", seen(speed=one.signals.speed, sight_lit=stop + spare()), "stop")


def judge_stop(one: Case) -> np.ndarray:
    """The stopping distance that the rule will see."""
    share = constant("friction.table.usable_share") * constant("model.nature.gravity")
    v, b = one.signals.speed, share * one.signals.friction
    return v * STOPPING_REACTION_TIME.f32 + v * v / (np.float32(2.0) * b)


def spare() -> np.ndarray:
    return signal("sight") - signal("stop")


def test_the_lowest_speed_with_its_exception_is_a_robustness():
    one = seen(speed=signal("slow"))
    states = one.trajectories.states
    speed = states.speed.copy()
    # Three others crawl where the exception holds, and drive elsewhere.
    speed[:, 1:] = np.where(signal("jam"), 1000, 25_000)[:, None]
    trajectories = one.trajectories.replace(states=states.replace(speed=speed))
    found, expected = (
        judge_rule(RULES["L13"], one.replace(trajectories=trajectories)),
        robustness("minimum"),
    )
    broken = expected < 0
    assert 0 < broken.sum() < len(broken)
    assert ((found.verdict == Verdict.ILLEGAL) == broken).all()
    assert found.margin[broken] == pytest.approx(expected[broken], abs=SAME)
    # The rule looks for congestion only where it matters, so it may say less than there is.
    assert (found.margin[~broken] <= expected[~broken] + SAME).all()


def test_the_distance_to_the_side_is_a_robustness():
    states, last = blank().trajectories.states, blank().signals.num_frames - 1
    d, s, body = states.d.copy(), states.s.copy(), blank().trajectories.scenario.vehicles
    d[:, 1] = d[:, 0] + np.rint((signal("aside") + body.width[:, [0]]) * 1000.0)
    s[:, 1] = s[:, 0] + np.where(signal("beside"), 0, 100_000)
    zero = np.zeros(len(d), np.int32)
    events = {"attempt": zero, "overlap_begin": zero, "overlap_end": zero + last}
    one = recorded(d=d, s=s)
    assert_same("L10", with_events(one, one.events.replace(**events)), "side")


def test_the_safe_distance_with_time_to_regain_it_is_a_robustness():
    one = following()
    found, expected = judge_rule(RULES["L3"], one), robustness("follow")
    counts = np.abs(expected) < SURE
    assert (expected[counts] < 0).any()
    assert (expected[counts] > 0).any()
    assert found.margin[counts] == pytest.approx(expected[counts], abs=0.02)
    assert (found.verdict[~counts] == Verdict.NOT_APPLICABLE).all()


def following() -> Case:
    """Random leaders: 1 and 2 by turns, a new one at every cut-in."""
    states, body = blank().trajectories.states, blank().trajectories.scenario.vehicles
    lead, cut = signal("lead"), signal("cut")
    turn = 1 + np.cumsum(cut, axis=1) % 2
    lane, s, speed = states.lane.copy(), states.s.copy(), states.speed.copy()
    present = blank().trajectories.state_mask.copy()
    need = lawful_gap(speed[:, 0] * np.float32(1e-3), np.float32(0.0), decel())
    gap = need + signal("gap") - signal("need") + body.length[:, [0]]
    for slot in (1, 2):
        # Whoever does not lead is in another lane, so that every new leader has come from there.
        lane[:, slot] = np.where(turn == slot, 0, 1)
        present[:, slot] = (turn != slot) | lead | cut
        s[:, slot] = s[:, 0] + np.rint(gap * 1000.0)
        speed[:, slot] = speed[:, 0]
    return recorded(present, lane=lane, s=s, speed=speed)


def decel() -> np.ndarray:
    """What both are thought capable of."""
    return decel_for_safe_distance(blank().signals.friction)


def test_a_duty_ignored_for_eight_seconds_is_the_past_operator():
    due = signal("due")
    states = blank().trajectories.states
    lane, s = states.lane.copy(), states.s.copy()
    lane[:, 0] = due  # The return is due wherever the ego is out of lane 0.
    s[:, 1] = s[:, 0] - 300_000
    one, zero = recorded(lane=lane, s=s), np.zeros(len(due), np.int32)
    events = one.events.replace(attempt=zero, overlap_end=zero, original_lane=np.uint8(zero))
    found = judge_rule(RULES["L9"], with_events(one, events))
    assert ((found.verdict == Verdict.ILLEGAL) == (robustness("duty") < 0)).all()
    assert 0 < (robustness("duty") < 0).sum() < len(due)
