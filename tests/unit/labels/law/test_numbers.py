"""Margins, frames and severities by hand, and what was believed at a decision."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.cases import Belief, Track, case, ramp, two_way_road
from tests.support.overtakes import (
    BESIDE,
    CROSSED,
    FRAMES,
    OUT_AND_BACK,
    SIGNALS,
    STAYS,
    against,
    alone,
    along_course,
    crossing,
    overtake,
    passing,
)

from overtaking.labels.law.case import judged_span, last_driven_frame, manoeuvre
from overtaking.labels.law.judging import judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model import verdicts
from overtaking.model.road import RoadMark
from overtaking.model.road_course import RoadCourse
from overtaking.model.trajectories import ManoeuvreKind
from overtaking.model.verdicts import Severity, Verdict

RULES = {rule.code: rule for rule in PORTUGAL.rules}
GRAVITY, DRY = 9.81, 0.9 * 9.81


def decel(one: verdicts.Case, frame: int) -> float:
    return min(8.0, DRY * float(one.signals.friction[0, frame]))


def lawful(rear: float, lead: float, b: float) -> float:
    return max(0.0, rear * 1.0 + rear**2 / (2 * b) - lead**2 / (2 * b))


@pytest.mark.parametrize(("lead", "rear"), [(33.333, 33.333), (25.0, 33.333), (20.0, 20.0)])
def test_l3_asks_for_the_distance_of_the_formula(lead, rear):
    one = case(Track(speed=rear), Track(s=150.0, speed=lead), events={}, frames=81)
    needed = lawful(rear, lead, decel(one, 80))
    gap = 150.0 - 4.4 - 80 * 0.05 * (rear - lead)
    assert judge_rule(RULES["L3"], one).margin[0] == pytest.approx(gap - needed, abs=0.01)


def test_at_120_km_h_l3_wants_33_metres_and_a_second_does_it():
    near, far = (
        case(Track(speed=33.333), Track(s=s + 4.4, speed=33.333), events={}, frames=80)
        for s in (33.3, 33.4)
    )
    assert judge_rule(RULES["L3"], near).verdict[0] == Verdict.ILLEGAL
    assert judge_rule(RULES["L3"], far).verdict[0] == Verdict.LEGAL


def test_three_seconds_after_a_recording_began_the_distance_counts():
    near = judge_rule(RULES["L3"], case(Track(speed=30.0), Track(s=25.0, speed=30.0), events={}))
    assert near.first_frame[0] == 61
    leaving = case(Track(speed=30.0), Track(s=10.0, speed=34.0), events={})
    assert judge_rule(RULES["L3"], leaving).verdict[0] == Verdict.LEGAL
    later = leaving.replace(events=leaving.events.replace(first=np.array([10], np.int32)))
    assert judge_rule(RULES["L3"], later).verdict[0] == Verdict.LEGAL


def test_rain_lengthens_the_lawful_distance_to_a_slower_one():
    margins = [
        judge_rule(RULES["L3"], overtake(weather={"rain": rain})).margin[0] for rain in (0, 60, 100)
    ]
    assert margins[0] > margins[1] > margins[2]


def test_a_breach_is_told_with_its_first_and_last_frame():
    speed = ramp((2, 30.0), (4, 36.0), (5, 36.0), (7, 30.0), frames=200)
    found = judge_rule(RULES["L12"], alone(ego={"speed": speed}))
    over = np.flatnonzero(speed > 120.0 / 3.6)
    assert (found.first_frame[0], found.last_frame[0]) == (over[0], over[-1])
    assert found.margin[0] == pytest.approx(120.0 / 3.6 - 36.0, abs=1e-3)


def test_at_the_very_border_the_law_is_kept():
    # The speed is recorded in mm/s, and 90 km/h are 25 m/s exactly.
    assert (
        judge_rule(RULES["L12"], alone(ego={"kind": "T", "speed": 25.0})).verdict[0]
        == Verdict.LEGAL
    )
    over = judge_rule(RULES["L12"], alone(ego={"kind": "T", "speed": 25.001}))
    assert over.verdict[0] == Verdict.ILLEGAL


def test_three_seconds_after_a_cut_in_the_distance_counts_again():
    lane = ramp((2, 1), (3, 0), frames=200)
    one = crossing(Track(s=25.0, speed=30.0, lane=lane))
    entered = int(np.argmax(one.trajectories.states.lane[0, 2] == 0))
    assert judge_rule(RULES["L3"], one).first_frame[0] == entered + 61


def test_who_stops_leading_loses_the_time_to_regain():
    # One comes in and goes again; the target ahead, always there, has come too near meanwhile.
    passer = Track(s=25.0, speed=30.0, lane=ramp((6, 1), (6.5, 0), (7.5, 0), (8, 1), frames=200))
    one = crossing(passer, target={"s": 56.4, "speed": 28.0})
    left = int(np.flatnonzero(one.trajectories.states.lane[0, 2] == 0)[-1]) + 1
    assert judge_rule(RULES["L3"], one).first_frame[0] == left


@pytest.mark.parametrize(
    ("kind", "speed", "severity"),
    [
        ("M", 40.0, Severity.LIGHT),
        ("M", 42.0, Severity.SERIOUS),
        ("M", 51.0, Severity.VERY_SERIOUS),
        ("T", 30.0, Severity.LIGHT),
        ("T", 31.0, Severity.SERIOUS),
        ("T", 37.0, Severity.VERY_SERIOUS),
    ],
)
def test_speeding_is_graded_by_its_excess(kind, speed, severity):
    found = judge_rule(RULES["L12"], alone(ego={"kind": kind, "speed": speed}))
    assert found.severity[0] == severity


def test_a_breach_of_distance_is_very_serious_only_on_a_motorway():
    near = [Track(speed=20.0), Track(s=15.0, speed=20.0)]
    there = judge_rule(RULES["L3"], case(*near, events={}))
    elsewhere = judge_rule(RULES["L3"], case(*near, events={}, road=two_way_road()))
    unsure = judge_rule(RULES["L3"], case(*near, events={}, unknown=("road_kind",)))
    assert there.severity[0] == Severity.VERY_SERIOUS
    assert elsewhere.severity[0] == unsure.severity[0] == Severity.SERIOUS


def test_a_line_between_directions_is_graver_than_one_at_the_edge():
    out = overtake(road=two_way_road(RoadMark.SOLID))
    edge = alone(ego={"lane": -0.4})
    assert judge_rule(RULES["L2"], out).severity[0] == Severity.VERY_SERIOUS
    assert judge_rule(RULES["L2"], edge).severity[0] == Severity.LIGHT


def test_l9_counts_the_longest_time_on_end():
    events = {"attempt": 60, "line_crossed": 76, "overlap_begin": 112, "overlap_end": 129}
    one = overtake(ego={"lane": STAYS}, target={"s": 60.0}, events=events)
    found = judge_rule(RULES["L9"], one)
    # Two seconds of the target's way behind it: 40 m and the bodies, at 10 m/s more.
    due = int(np.argmax(one.target.ego_lead[0] >= 44.4))
    assert found.first_frame[0] == due + 160
    assert found.last_frame[0] == 419
    assert found.margin[0] == pytest.approx(8.0 - (420 - due) * 0.05, abs=1e-3)


def test_l10_is_the_distance_between_the_sides():
    found = judge_rule(RULES["L10"], passing(2.5 / 3.75))
    assert found.margin[0] == pytest.approx(2.5 - 1.8 - 0.8, abs=2e-3)
    assert (found.first_frame[0], found.last_frame[0]) == (92, 108)


def test_l4_and_l5_are_about_the_frame_in_which_the_line_is_crossed():
    front = crossing(Track(s=110.0, lane=1, speed=20.0))
    rear = crossing(Track(s=-90.0, lane=1, speed=40.0))
    b = decel(front, 100)
    # 10 m/s of difference for 5 s.
    margins = {
        "L4": (front, 110.0 - 4.4 - 50.0 - lawful(30.0, 20.0, b)),
        "L5": (rear, 90.0 - 4.4 - 50.0 - lawful(40.0, 30.0, b)),
    }
    for code, (one, margin) in margins.items():
        found = judge_rule(RULES[code], one)
        assert found.margin[0] == pytest.approx(margin, abs=0.01)
        assert (found.first_frame[0], found.last_frame[0]) == (100, 100)


def test_on_a_two_way_road_l15_wants_the_way_of_both_while_the_ego_is_out():
    given = {"ego": {"speed": 20.0}, "events": CROSSED | {"abort_end": 140}}
    found = judge_rule(RULES["L15"], along_course(RoadCourse(sight=((0.0, 300.0),)), **given))
    # 2 s out and 1 s more, at 20 m/s and the limit of 25 m/s.
    assert found.margin[0] == pytest.approx(300.0 - 45.0 * 3.0, abs=0.01)


def test_l24_is_a_second_of_both_speeds():
    assert judge_rule(RULES["L24"], against(60.0)).margin[0] == pytest.approx(20.0, abs=0.01)


def test_l13_asks_for_50_km_h():
    found = judge_rule(RULES["L13"], alone(ego={"speed": 12.0}))
    assert found.margin[0] == pytest.approx(12.0 - 50.0 / 3.6, abs=1e-3)


def test_l18_tells_the_time_without_a_signal():
    found = judge_rule(RULES["L18"], overtake(ego={"lights": 0}))
    assert found.margin[0] == pytest.approx(-2 * 61 * 0.05, abs=1e-3)


@pytest.mark.parametrize(
    ("lights", "first", "last"),
    [
        (np.where(np.arange(FRAMES) < 56, 0, SIGNALS), 36, 55),
        (np.where(np.arange(FRAMES) > 200, 0, SIGNALS), 266, 326),
        (np.zeros(FRAMES, int), 36, 326),
    ],
)
def test_l18_tells_the_first_and_the_last_frame_without_a_signal(lights, first, last):
    # The lines are crossed in frames 76 and 306: from 2 s before to 1 s after.
    found = judge_rule(RULES["L18"], overtake(ego={"lights": lights}))
    assert (found.first_frame[0], found.last_frame[0]) == (first, last)


def test_the_manoeuvre_begins_3_s_before_the_attempt_and_ends_3_s_after_the_return():
    one = overtake()
    span, events = manoeuvre(one), one.events
    assert span.first[0] == events.attempt[0] - 60 < 0 or span.first[0] == 0
    assert span.last[0] == events.return_end[0] + 60


@pytest.mark.parametrize(
    ("events", "start", "stop"),
    [
        (CROSSED, 0, 199),
        (CROSSED | {"abort_end": 140}, 0, 140),
        (CROSSED | {"return_end": 120}, 0, 180),
        (CROSSED | {"collision": 130}, 0, 129),
        ({"attempt": 90, "road_departure": 150}, 30, 149),
        ({"attempt": 90, "first": 50}, 50, 199),
        ({"first": 20, "collision": 90}, 20, 89),
        ({"first": 20}, 20, 199),
    ],
)
def test_conduct_is_judged_while_the_ego_drives(events, start, stop):
    span = judged_span(crossing(events=events))
    assert (span.first[0], span.last[0]) == (start, stop)


@pytest.mark.parametrize(("reached", "departed"), [(1.0, False), (1.45, False), (1.6, True)])
def test_on_a_two_way_road_the_other_lane_is_no_departure(reached, departed):
    away = {"lane": ramp((3, 0), (6, reached), frames=200)}
    one = crossing(ego=away, events=None, road=two_way_road())
    assert (last_driven_frame(one)[0] < 199) == departed


def test_after_a_collision_nothing_is_judged():
    speed = np.where(np.arange(200) < 120, 30.0, 5.0)
    crashed = crossing(ego={"speed": speed}, events=CROSSED | {"collision": 120})
    assert judge_rule(RULES["L13"], crashed).verdict[0] == Verdict.LEGAL


TRUE_NEAR, TRUE_FAR = {"true_gap": 20.0}, {"true_gap": 90.0}
THOUGHT_NEAR, THOUGHT_FAR = {"gap": 20.0}, {"gap": 90.0}


@pytest.mark.parametrize(
    ("given", "belief"),
    [
        (TRUE_FAR | THOUGHT_FAR, verdicts.Belief.LEGAL),
        (TRUE_NEAR | THOUGHT_FAR, verdicts.Belief.MISTAKEN),
        (TRUE_NEAR | THOUGHT_NEAR, verdicts.Belief.KNOWINGLY_ILLEGAL),
        (TRUE_FAR | THOUGHT_NEAR, verdicts.Belief.LUCKY),
        (TRUE_NEAR | THOUGHT_NEAR | {"detected": False}, verdicts.Belief.MISTAKEN),
        (TRUE_NEAR | THOUGHT_FAR | {"frame": 100}, verdicts.Belief.MISTAKEN),
        (TRUE_NEAR | THOUGHT_FAR | {"frame": 101}, verdicts.Belief.NONE),
        (TRUE_NEAR | THOUGHT_FAR | {"kind": ManoeuvreKind.CANCEL}, verdicts.Belief.NONE),
    ],
)
def test_what_was_believed_when_pulling_out_is_held_against_what_was_so(given, belief):
    said = Belief(**({"frame": 55} | given))
    assert judge_rule(RULES["L3"], crossing(beliefs=(said,))).belief[0] == belief
    told_nothing = crossing(beliefs=(said,), unknown=("percepts",))
    assert judge_rule(RULES["L3"], told_nothing).belief[0] == verdicts.Belief.NONE


def test_of_several_decisions_the_last_before_the_line_counts():
    beliefs = (
        Belief(frame=10, true_gap=90.0, gap=90.0),
        Belief(frame=55, true_gap=20.0, gap=90.0),
        Belief(frame=150, true_gap=90.0, gap=90.0),
    )
    assert judge_rule(RULES["L3"], crossing(beliefs=beliefs)).belief[0] == verdicts.Belief.MISTAKEN


@pytest.mark.parametrize(("frame", "counts"), [(55, True), (79, True), (81, False)])
def test_without_a_line_crossed_decisions_count_until_a_second_after_the_attempt(frame, counts):
    said = Belief(frame=frame, true_gap=20.0, gap=90.0)
    one = crossing(beliefs=(said,), events={"attempt": 60})
    expected = verdicts.Belief.MISTAKEN if counts else verdicts.Belief.NONE
    assert judge_rule(RULES["L3"], one).belief[0] == expected


@pytest.mark.parametrize(("code", "whom"), [("L4", 1), ("L5", 2)])
def test_entering_a_lane_is_judged_by_whom_it_is_about(code, whom):
    others = [Track(s=80.0, lane=1, speed=32.0), Track(s=-60.0, lane=1, speed=28.0)]
    said = Belief(frame=55, whom=whom, vehicle=2, true_gap=5.0, gap=100.0)
    one = crossing(*others, beliefs=(said,))
    for each in ("L4", "L5"):
        expected = verdicts.Belief.MISTAKEN if each == code else verdicts.Belief.NONE
        assert judge_rule(RULES[each], one).belief[0] == expected


def test_a_return_is_believed_safe_or_not():
    said = Belief(
        kind=ManoeuvreKind.RETURN, frame=140, whom=2, true_gap=2.0, gap=80.0,
        true_closing_speed=3.0, closing_speed=3.0,
    )  # fmt: skip
    events = CROSSED | {"overlap_begin": 110, "overlap_end": 120, "return_end": 150}
    one = crossing(target={"s": -60.0}, events=events, beliefs=(said,))
    assert judge_rule(RULES["L8"], one).belief[0] == verdicts.Belief.MISTAKEN


def test_the_gap_of_four_seconds_before_a_fast_one_is_exact():
    start = -4.4 - 40.0 - 60 * 0.05 * 10.0
    margins = [
        judge_rule(RULES["L6"], crossing(Track(s=start + shift, lane=1, speed=40.0))).margin[0]
        for shift in (-0.1, 0.1)
    ]
    assert margins == pytest.approx([0.01, -0.01], abs=1e-3)


def test_braking_that_is_forced_on_the_one_behind_is_that_of_the_formula():
    lane = ramp((4.9, 0), (5.5, 1), frames=200)
    one = crossing(Track(s=-140.0, lane=1, speed=44.0), ego={"lane": lane})
    last = int(np.argmax(one.signals.lane[0] == 1)) + 60
    gap = 140.0 - 4.4 - 14.0 * 0.05 * last
    found = judge_rule(RULES["L23"], one)
    assert found.margin[0] == pytest.approx(2.0 - 14.0**2 / (2 * gap), rel=1e-3)
    assert found.last_frame[0] == last


def test_l11_takes_the_worse_of_room_and_speed():
    faster = ramp((3, 29.0), (4, 30.0), frames=200)
    target = {"kind": "B", "s": 48.0}
    one = passing(1, ego={"speed": faster}, target=target, events=BESIDE)
    start = float(one.signals.speed[0, 60])
    assert judge_rule(RULES["L11"], one).margin[0] == pytest.approx(
        (start - 30.0) / start, abs=1e-4
    )


def test_the_standard_overtake_is_what_its_events_say():
    one = overtake(ego={"lane": OUT_AND_BACK})
    assert one.events.is_completed[0]
    assert (one.events.line_crossed[0], one.events.return_end[0]) == (76, 335)
