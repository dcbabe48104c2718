"""Errors of margins in cases in which another frame, zone or vehicle could decide by mistake."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from tests.support.cases import LEFT, Track, case, ramp, two_way_road
from tests.support.law_fixtures_of_two_ways import lined
from tests.support.overtakes import along_course, closing_and_opening, crossing

from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_rule
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.road import RoadMark
from overtaking.model.road_course import RoadCourse, RoadZone, ZoneKind
from overtaking.model.verdicts import Severity, Verdict

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

RULES = {rule.code: rule for rule in (*PORTUGAL.rules, *GERMANY.rules)}
CHANGE_OF_LANE = ramp((4, 0), (6, 1), frames=200)
"""The ego crosses the line in frame 100; L23 judges the frames up to 160."""


def error_of(code: str, case: Case, position_std: float = 0.0, speed_std: float = 0.0) -> float:
    """Standard error of the margin of one rule in a case of one simulation."""
    rule = RULES[code]
    errors = MeasurementErrors(position_std=position_std, speed_std=speed_std)
    error = rule.criterion.standard_error(case, rule.criterion.check(case), errors)
    assert error is not None
    return float(error[0])


@pytest.mark.parametrize("code", ["L17", "L29", "O9", "O17"])
def test_a_zone_of_a_kind_that_the_rule_does_not_forbid_leaves_the_error_as_it_is(code):
    kind = {
        "L17": ZoneKind.NARROW,
        "L29": ZoneKind.NO_OVERTAKING,
        "O9": ZoneKind.NO_OVERTAKING,
        "O17": ZoneKind.PEDESTRIAN_CROSSING,
    }[code]
    # The ego is back at 502 m, where it is farthest within the zone.
    zone = RoadZone(kind=kind, start=490.0, stop=700.0)
    other_kind = ZoneKind.NO_OVERTAKING_HEAVY if code != "O17" else ZoneKind.BEND
    longer = RoadZone(kind=other_kind, start=400.0, stop=800.0)
    alone = along_course(RoadCourse(zones=(zone,)))
    beside_another = along_course(RoadCourse(zones=(longer, zone)))
    expected = 0.1 * math.hypot(1.0, 30.0 / (3.5 / 3.0))
    assert (
        RULES[code].criterion.check(beside_another).margin
        == RULES[code].criterion.check(alone).margin
    )
    assert error_of(code, alone, position_std=0.1) == pytest.approx(expected, rel=2e-3)
    assert error_of(code, beside_another, position_std=0.1) == error_of(code, alone, 0.1)


def test_braking_forced_on_an_overlapping_follower_has_no_error_where_it_is_capped():
    # The follower is 0.1 m/s faster, and overlaps with the ego from the change of lane on.
    follower = Track(s=-4.0, speed=30.1, lane=1)
    overlap = crossing(follower, ego={"lane": CHANGE_OF_LANE})
    assert RULES["L23"].criterion.check(overlap).margin[0] == -18.0
    assert error_of("L23", overlap, speed_std=0.05) == 0.0


def test_the_braking_that_decides_lies_within_3_s_after_a_change_of_lane():
    # No follower has to brake: the follower before the change of lane falls back at 20 m/s, the
    # follower after it at 0.1 m/s.
    followers = Track(s=-50.0, speed=10.0), Track(s=-20.0, speed=29.9, lane=1)
    falling_back = crossing(*followers, ego={"lane": CHANGE_OF_LANE})
    assert RULES["L23"].criterion.check(falling_back).margin[0] == 2.0
    # With an error of 0.2 m/s a gap of some 16 m closes at 0.1 m/s: braking of 0.3 mm/s^2.
    assert 0.0 < error_of("L23", falling_back, speed_std=0.2) < 1e-3


def test_a_vehicle_beside_the_ego_may_be_behind_it_by_one_error():
    # At the attempt in frame 60 the bumpers overlap by 0.05 m, at a closing speed of 0.02 m/s.
    beside = crossing(Track(s=-4.4 + 0.05 - 60 * 0.05 * 0.02, speed=30.02, lane=1))
    assert RULES["L6"].criterion.check(beside).margin[0] == -4.0
    half_change = 0.5 * (0.1 - 0.05) / 0.02
    expected = math.sqrt(2.0) * half_change
    assert error_of("L6", beside, position_std=0.1) == pytest.approx(expected, rel=0.05)


def test_a_follower_that_indicates_has_no_error():
    indicating = crossing(
        Track(s=-40.0, speed=30.0, lights=LEFT), Track(s=-100.0, speed=36.0, lane=1)
    )
    assert RULES["L6"].criterion.check(indicating).margin[0] == -4.0
    assert error_of("L6", indicating, position_std=0.1, speed_std=0.1) == 0.0


def test_a_road_with_fewer_lanes_than_trucks_may_use_has_no_error():
    truck = case(Track(kind="T"), Track(s=80.0), road=two_way_road(), events={})
    assert RULES["L20"].criterion.check(truck).verdict[0] == Verdict.NOT_APPLICABLE
    assert error_of("L20", truck, position_std=0.1) == 0.0


def test_a_time_with_a_gap_that_is_too_small_is_undecidable_near_its_limit():
    # The gap is too small for 1.95 s of the 3 s that are tolerated; the error is 1.41 s.
    exact = judge_rule(RULES["A2"], closing_and_opening())
    errors = MeasurementErrors(position_std=0.2)
    measured = judge_rule(RULES["A2"], closing_and_opening(), errors)
    assert (exact.verdict[0], measured.verdict[0]) == (Verdict.LEGAL, Verdict.UNDECIDABLE)


def test_a_large_gap_is_legal_also_where_the_speed_may_be_too_low_for_the_rule():
    # One error less than 22.3 m/s is below 80 km/h.
    distant = case(Track(speed=22.3), Track(s=80.0, speed=22.3), events={})
    measured = judge_rule(RULES["A2"], distant, MeasurementErrors(speed_std=0.2))
    assert measured.verdict[0] == Verdict.LEGAL


def test_each_law_has_its_own_severity_for_crossing_a_line():
    # The line between the directions becomes continuous before the ego is back.
    breach = lined((450.0, 600.0, RoadMark.SOLID))
    assert RULES["S1"].criterion.check(breach).severity[0] == Severity.NONE
    assert judge_rule(RULES["S1"], breach).severity[0] == Severity.LIGHT
    assert judge_rule(RULES["L2"], breach).severity[0] == Severity.VERY_SERIOUS
