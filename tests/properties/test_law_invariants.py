"""Verdicts do not depend on the clock, on the place or on frames after the recording.

`test_label_invariants` has the mirror, the order of vehicles and batches of other simulations, for
findings too.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.cases import Track, case, ramp, seen_case
from tests.support.overtakes import CROSSED, crossing, overtake

import overtaking as ot
from overtaking.labels.law.judging import judge_pack
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.verdicts import Case, Findings, Verdict


@pytest.fixture(scope="module")
def simulated_case() -> Case:
    """Real overtakes in all weathers, with breaches of most rules."""
    scenarios = ot.sample("pinto2023-physical", num_simulations=96, seed=11)
    return seen_case(ot.simulate(scenarios))


@pytest.fixture(scope="module")
def findings(simulated_case: Case) -> Findings:
    return judge_pack(PORTUGAL, simulated_case)


def test_the_simulations_break_most_rules(findings: Findings):
    is_broken = (findings.verdict == Verdict.ILLEGAL).any(axis=0)
    assert is_broken.sum() >= 12


def test_frames_beyond_the_end_of_a_recording_are_irrelevant(
    simulated_case: Case, findings: Findings
):
    signals = simulated_case.signals
    spoiled = {
        name: np.where(signals.valid, getattr(signals, name), np.float32(-7.0))
        for name in ("speed", "friction", "sight_lit", "sight_unlit", "right_edge", "left_edge")
    }
    spoiled_case = simulated_case.replace(signals=signals.replace(**spoiled))
    assert_same_findings(judge_pack(PORTUGAL, spoiled_case), findings)


def assert_same_findings(actual: Findings, expected: Findings) -> None:
    for field in dataclasses.fields(Findings):
        values, expected_values = getattr(actual, field.name), getattr(expected, field.name)
        if isinstance(values, np.ndarray):
            differences = np.argwhere(values != expected_values)
            rules = [(int(row), actual.rule_codes[column]) for row, column in differences[:5]]
            assert not rules, (field.name, rules)


@pytest.mark.ci
@settings(max_examples=15, deadline=None)
@given(shift=st.integers(1, 400))
def test_a_recording_that_began_earlier_has_the_same_findings_later(shift: int):
    lane = ramp((3 + shift * 0.05, 0), (6 + shift * 0.05, 1), frames=200 + shift)
    long = judge_pack(PORTUGAL, crossing_after(shift, lane, frames=200 + shift))
    short = judge_pack(PORTUGAL, crossing_after(0, lane[shift:], frames=200))
    assert (long.verdict == short.verdict).all()
    assert long.margin == pytest.approx(short.margin, abs=0.02)
    is_broken = short.verdict == Verdict.ILLEGAL
    assert (long.first_frame[is_broken] == short.first_frame[is_broken] + shift).all()
    assert (long.last_frame[is_broken] == short.last_frame[is_broken] + shift).all()


def crossing_after(shift: int, lane: np.ndarray, *, frames: int) -> Case:
    """Over the line in frame 100 after `shift`, with the same traffic at that time."""
    seconds = shift * 0.05
    others = [(1, 70.0, 26.0), (1, -60.0, 36.0), (0, -30.0, 29.0)]
    events = {name: frame + shift for name, frame in CROSSED.items()} | {"first": shift}
    return case(
        Track(speed=30.0, s=500.0 - 30.0 * seconds, lane=lane),
        Track(s=540.0 - 27.0 * seconds, speed=27.0),
        *(Track(s=500.0 + s - v * seconds, speed=v, lane=index) for index, s, v in others),
        frames=frames,
        events=events,
    )


@pytest.mark.ci
@settings(max_examples=20, deadline=None)
@given(distance=st.floats(40.0, 150.0), increase=st.floats(0.1, 100.0))
def test_a_leader_farther_away_never_makes_a_lawful_distance_unlawful(
    distance: float, increase: float
):
    near, far = (
        judge_pack(PORTUGAL, crossing(Track(s=s, lane=1), target={"s": s})).margin[0]
        for s in (distance, distance + increase)
    )
    for code in ("L3", "L4"):
        column = PORTUGAL.codes.index(code)
        assert far[column] >= near[column] - 1e-3


@settings(max_examples=10, deadline=None)
@given(distance=st.floats(0.0, 5000.0))
def test_the_place_on_the_road_is_irrelevant(distance: float):
    at_begin = judge_pack(PORTUGAL, overtake(target={"s": 110.0}))
    farther = judge_pack(PORTUGAL, overtake(ego={"s": distance}, target={"s": 110.0 + distance}))
    assert (at_begin.verdict == farther.verdict).all()
    assert at_begin.margin == pytest.approx(farther.margin, abs=0.02)
