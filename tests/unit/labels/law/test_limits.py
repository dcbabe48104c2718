"""Speed limits that change along the road: rules and columns use the limit at the ego."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.cases import ramp
from tests.support.logic import ALL_FACTS, group_of
from tests.support.logic_law import law_reasoner, program_verdicts
from tests.support.overtakes import alone, along_course, limited

from overtaking import label, sample, simulate
from overtaking.analysis.logic.fact_files import measure_road_facts
from overtaking.analysis.logic.vocabulary import RULE_CODES
from overtaking.data.tables.encode import encode
from overtaking.labels.attempt_features import attempt_features, attempt_features_at
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.explanation import margins_by_frame
from overtaking.labels.law.case import speed_limit_bounds
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_pack, judge_rule
from overtaking.labels.law.portugal import GENERAL_LIMITS, PORTUGAL
from overtaking.labels.safety_features import oncoming_measures
from overtaking.model.known_roads import known_road
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.model.verdicts import Severity, Verdict

L12, V2 = PORTUGAL.rule("L12"), GERMANY.rule("V2")
ENDS = st.lists(st.integers(1, 299_999), min_size=4, max_size=4, unique=True).map(sorted)


def fast(road, speed=30.0, **ego):
    """An ego alone on a road, at 108 km/h by default."""
    return alone(ego={"speed": speed} | ego, road=road)


@pytest.mark.ci
@given(ends=ENDS, lower=st.tuples(st.floats(5, 33), st.floats(5, 33)), seed=st.integers(0, 9))
def test_the_margin_uses_the_speed_limit_at_the_ego_frame_by_frame(ends, lower, seed):
    stretches = [
        (ends[2 * k] / 1000.0, ends[2 * k + 1] / 1000.0, 3.6 * speed)
        for k, speed in enumerate(lower)
    ]
    speed = 20.0 + 15.0 * np.random.default_rng(seed).random(200)
    drive = fast(limited(*stretches), speed=speed)
    states = drive.trajectories.states
    margins = []
    for frame in range(200):
        limit, s = 120.0 / 3.6, states.s[0, 0, frame] / 1000.0
        for start, stop, kmh in stretches:
            if start <= s < stop:
                limit = kmh / 3.6
        margins.append(limit + 5e-4 - states.speed[0, 0, frame] / 1000.0)
    finding = judge_rule(L12, drive)
    assert finding.margin[0] == pytest.approx(min(margins), abs=1e-5)
    breach_frames = [frame for frame, margin in enumerate(margins) if margin < 0]
    assert (finding.verdict[0] == Verdict.ILLEGAL) == bool(breach_frames)
    if breach_frames:
        assert (finding.first_frame[0], finding.last_frame[0]) == (
            breach_frames[0],
            breach_frames[-1],
        )


def test_limits_have_a_value_for_every_frame_without_a_copy_where_the_limit_is_constant():
    constant_limit, changing_limit = (
        fast(known_road("motorway")),
        fast(limited((150.0, 600.0, 60.0))),
    )
    assert speed_limit_bounds(constant_limit, GENERAL_LIMITS)[1].strides[1] == 0
    lowest, highest = speed_limit_bounds(changing_limit, GENERAL_LIMITS)
    np.testing.assert_array_equal(lowest, highest)
    np.testing.assert_allclose(highest[0, [0, 99, 100, 199]], np.array([120, 120, 60, 60]) / 3.6)


def test_the_margins_of_every_frame_agree_with_the_finding():
    labelled = label(fast(limited((150.0, 180.0, 60.0), (180.0, 600.0, 90.0))).trajectories)
    margins, column = margins_by_frame(labelled)["L12"], labelled.findings.rule_codes.index("L12")
    assert np.nanmin(margins) == labelled.findings.margin[0, column] == margins[100]
    breach_frames = np.flatnonzero(margins < 0)
    assert breach_frames[[0, -1]].tolist() == [100, 199]
    assert margins[120] > margins[119]


@pytest.mark.parametrize(("speed", "severity"), [(25.0, "LIGHT"), (30.0, "SERIOUS")])
def test_the_severity_depends_on_the_excess_over_the_limit_at_the_ego(speed: float, severity: str):
    finding = judge_rule(L12, fast(limited((50.0, 60.0, 70.0)), speed=speed))
    assert finding.severity[0] == Severity[severity]


def test_a_tolerated_share_refers_to_the_limit_with_the_largest_excess():
    # 5.7 km/h over 120 and 11 km/h over 60, in the fastest and in the slowest frame.
    speed = ramp((4.9, 125.7 / 3.6), (5.1, 71 / 3.6), frames=200)
    drive = fast(limited((200.0, 600.0, 60.0)), speed=speed)
    for rule in (L12, V2):
        limit = rule.criterion.limit(drive)
        assert limit is not None
        assert limit[0] == pytest.approx(60 / 3.6)
    assert judge_rule(L12, drive).margin[0] == pytest.approx(-11 / 3.6, abs=1e-3)


def test_features_of_the_decision_and_the_table_of_frames_have_the_limit_at_the_ego():
    drive = fast(limited((150.0, 200.0, 60.0)))
    features = attempt_features_at(drive, np.array([100], np.int32))
    assert features.surroundings.speed_limit[0] == pytest.approx(60 / 3.6)
    assert features.law.speed[0] == pytest.approx(60 / 3.6 - 30.0)
    assert attempt_features(drive).surroundings.speed_limit[0] == pytest.approx(120 / 3.6)
    table = encode(drive.trajectories, np.arange(1), ["frames"])["frames"]
    expected = [(60 if 150 <= 1.5 * frame < 200 else 120) / 3.6 for frame in range(200)]
    assert table["speed_limit_mps"].to_pylist() == pytest.approx(expected)


def test_an_unseen_oncoming_vehicle_drives_at_the_limit_of_its_direction():
    def time_available(direction: int) -> float:
        lower = SpeedLimitSpan(start=0.0, stop=600.0, speed=15.0, direction=direction)
        measured = oncoming_measures(
            along_course(RoadCourse(sight=((0.0, 400.0),), speed_limit_spans=(lower,)))
        )
        return float(measured.time_available[0])

    assert time_available(-1) == time_available(0) == pytest.approx(400.0 / (30.0 + 15.0))
    assert time_available(1) == pytest.approx(400.0 / (30.0 + 25.0))


def test_a_vehicle_from_beyond_the_end_of_the_road_drives_at_the_limit_of_its_end():
    lower = SpeedLimitSpan(start=0.0, stop=5000.0, speed=15.0)
    measured = oncoming_measures(
        along_course(RoadCourse(speed_limit_spans=(lower,), sight=((0.0, 6000.0),)))
    )
    assert measured.time_available[0] == pytest.approx(6000.0 / (30.0 + 15.0))


@pytest.mark.ci
@given(st.lists(st.floats(0, 4999, width=64), min_size=2, max_size=2, unique=True))
def test_the_fact_of_a_lower_limit_holds_at_exactly_the_positions_of_the_limit(ends: list[float]):
    start, stop = sorted(ends)
    road = limited((start, stop, 60.0))
    facts = measure_road_facts(group_of(fast(road)), ALL_FACTS)
    start_mm, stop_mm, limit = (int(column[0]) for column in facts["lower_limit"])
    assert limit == 16_667
    positions = np.array([start_mm - 1, start_mm, stop_mm - 1, stop_mm], np.int32)
    is_lower = road.speed_limit_at(positions * 1e-3) < road.speed_limit
    np.testing.assert_array_equal(is_lower, (start_mm <= positions) & (positions < stop_mm))


@pytest.mark.ci
@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_logic_program_and_python_agree_on_roads_with_lower_limits(profile: str):
    road = known_road(profile)
    stretches = [(1100.4321, 1300.1, 0.9), (1800.0, 1912.3456, 0.8), (1912.3456, 2000.7, 0.7)]
    lower = tuple(
        SpeedLimitSpan(start=start, stop=stop, speed=share * road.speed_limit, direction=1)
        for start, stop, share in stretches
    )
    course = dataclasses.replace(road.course or RoadCourse(), speed_limit_spans=lower)
    recorded = simulate_on(profile, dataclasses.replace(road, course=course))
    with law_reasoner() as reasoner:
        judgement = program_verdicts(reasoner, group_of(recorded))
    findings = judge_pack(PORTUGAL, recorded)
    columns = [findings.rule_codes.index(code) for code in RULE_CODES]
    np.testing.assert_array_equal(judgement.verdict, findings.verdict[:, columns])
    is_illegal = judgement.verdict == Verdict.ILLEGAL
    np.testing.assert_array_equal(
        judgement.first_frame[is_illegal], findings.first_frame[:, columns][is_illegal]
    )
    legal_elsewhere = judge_rule(
        L12, case_from_trajectories(simulate(sample(profile, num_simulations=40, seed=23)))
    ).verdict
    differs = judgement.verdict[:, RULE_CODES.index("L12")] != legal_elsewhere
    assert 0 < differs.sum() < len(differs)


def simulate_on(profile: str, road):
    """Simulations of a profile as if they had been recorded on another road of the same shape."""
    runs = simulate(sample(profile, num_simulations=40, seed=23))
    scenario = runs.scenario.replace(road=road)
    return case_from_trajectories(runs.replace(scenario=scenario))
