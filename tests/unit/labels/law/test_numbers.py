"""Margins, frames and severities worked out by hand, and beliefs at decisions."""

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


def decel(judged: verdicts.Case, frame: int) -> float:
    """Deceleration of the ego in a frame for the lawful distance [m/s^2]."""
    return min(8.0, DRY * float(judged.signals.friction[0, frame]))


def lawful(rear: float, lead: float, b: float) -> float:
    """Lawful gap [m] of two speeds: 1 s of reaction, and the difference of braking distances."""
    return max(0.0, rear * 1.0 + rear**2 / (2 * b) - lead**2 / (2 * b))


@pytest.mark.parametrize(("lead", "rear"), [(33.333, 33.333), (25.0, 33.333), (20.0, 20.0)])
def test_l3_requires_the_distance_of_the_formula(lead, rear):
    following = case(Track(speed=rear), Track(s=150.0, speed=lead), events={}, frames=81)
    needed = lawful(rear, lead, decel(following, 80))
    gap = 150.0 - 4.4 - 80 * 0.05 * (rear - lead)
    assert judge_rule(RULES["L3"], following).margin[0] == pytest.approx(gap - needed, abs=0.01)


def test_at_120_km_h_l3_requires_the_distance_of_one_second():
    near, far = (
        case(Track(speed=33.333), Track(s=s + 4.4, speed=33.333), events={}, frames=80)
        for s in (33.3, 33.4)
    )
    assert judge_rule(RULES["L3"], near).verdict[0] == Verdict.ILLEGAL
    assert judge_rule(RULES["L3"], far).verdict[0] == Verdict.LEGAL


def test_l3_judges_the_distance_from_three_seconds_after_the_first_frame():
    near = judge_rule(RULES["L3"], case(Track(speed=30.0), Track(s=25.0, speed=30.0), events={}))
    assert near.first_frame[0] == 61
    leaving = case(Track(speed=30.0), Track(s=10.0, speed=34.0), events={})
    assert judge_rule(RULES["L3"], leaving).verdict[0] == Verdict.LEGAL
    later = leaving.replace(events=leaving.events.replace(first=np.array([10], np.int32)))
    assert judge_rule(RULES["L3"], later).verdict[0] == Verdict.LEGAL


def test_rain_lengthens_the_lawful_distance_to_a_slower_leader():
    margins = [
        judge_rule(RULES["L3"], overtake(weather={"rain": rain})).margin[0] for rain in (0, 60, 100)
    ]
    assert margins[0] > margins[1] > margins[2]


def test_a_breach_has_its_first_and_its_last_frame():
    speed = ramp((2, 30.0), (4, 36.0), (5, 36.0), (7, 30.0), frames=200)
    finding = judge_rule(RULES["L12"], alone(ego={"speed": speed}))
    speeding_frames = np.flatnonzero(speed > 120.0 / 3.6)
    assert (finding.first_frame[0], finding.last_frame[0]) == (
        speeding_frames[0],
        speeding_frames[-1],
    )
    assert finding.margin[0] == pytest.approx(120.0 / 3.6 - 36.0, abs=1e-3)


def test_a_speed_at_exactly_the_limit_is_legal():
    # The speed is recorded in mm/s, and 90 km/h are 25 m/s exactly.
    assert (
        judge_rule(RULES["L12"], alone(ego={"kind": "T", "speed": 25.0})).verdict[0]
        == Verdict.LEGAL
    )
    finding = judge_rule(RULES["L12"], alone(ego={"kind": "T", "speed": 25.001}))
    assert finding.verdict[0] == Verdict.ILLEGAL


def test_three_seconds_after_a_cut_in_the_distance_counts_again():
    lane = ramp((2, 1), (3, 0), frames=200)
    cut_in = crossing(Track(s=25.0, speed=30.0, lane=lane))
    entered = int(np.argmax(cut_in.trajectories.states.lane[0, 2] == 0))
    assert judge_rule(RULES["L3"], cut_in).first_frame[0] == entered + 61


def test_the_time_to_regain_the_distance_ends_when_the_new_leader_leaves_the_lane():
    # A vehicle cuts in and leaves again. Meanwhile the gap to the target ahead became too small.
    brief_leader = Track(
        s=25.0, speed=30.0, lane=ramp((6, 1), (6.5, 0), (7.5, 0), (8, 1), frames=200)
    )
    judged = crossing(brief_leader, target={"s": 56.4, "speed": 28.0})
    departure_frame = int(np.flatnonzero(judged.trajectories.states.lane[0, 2] == 0)[-1]) + 1
    assert judge_rule(RULES["L3"], judged).first_frame[0] == departure_frame


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
    finding = judge_rule(RULES["L12"], alone(ego={"kind": kind, "speed": speed}))
    assert finding.severity[0] == severity


def test_a_breach_of_distance_is_very_serious_only_on_a_motorway():
    close_pair = [Track(speed=20.0), Track(s=15.0, speed=20.0)]
    on_motorway = judge_rule(RULES["L3"], case(*close_pair, events={}))
    on_two_way_road = judge_rule(RULES["L3"], case(*close_pair, events={}, road=two_way_road()))
    on_unknown_road = judge_rule(RULES["L3"], case(*close_pair, events={}, unknown=("road_kind",)))
    assert on_motorway.severity[0] == Severity.VERY_SERIOUS
    assert on_two_way_road.severity[0] == on_unknown_road.severity[0] == Severity.SERIOUS


def test_crossing_the_line_between_directions_is_graver_than_touching_the_edge_line():
    crossing_centre_line = overtake(road=two_way_road(RoadMark.SOLID))
    touching_edge_line = alone(ego={"lane": -0.4})
    assert judge_rule(RULES["L2"], crossing_centre_line).severity[0] == Severity.VERY_SERIOUS
    assert judge_rule(RULES["L2"], touching_edge_line).severity[0] == Severity.LIGHT


def test_l9_counts_the_longest_uninterrupted_time():
    events = {"attempt": 60, "line_crossed": 76, "overlap_begin": 112, "overlap_end": 129}
    staying_left = overtake(ego={"lane": STAYS}, target={"s": 60.0}, events=events)
    finding = judge_rule(RULES["L9"], staying_left)
    # The return is due 2 s ahead of the target: 40 m at its 20 m/s, and 4.4 m of bodies.
    return_due_frame = int(np.argmax(staying_left.target.ego_lead[0] >= 44.4))
    assert finding.first_frame[0] == return_due_frame + 160
    assert finding.last_frame[0] == 419
    assert finding.margin[0] == pytest.approx(8.0 - (420 - return_due_frame) * 0.05, abs=1e-3)


def test_l10_is_the_distance_between_the_sides():
    finding = judge_rule(RULES["L10"], passing(2.5 / 3.75))
    assert finding.margin[0] == pytest.approx(2.5 - 1.8 - 0.8, abs=2e-3)
    assert (finding.first_frame[0], finding.last_frame[0]) == (92, 108)


def test_l4_and_l5_judge_the_frame_in_which_the_ego_crosses_the_line():
    new_leader = crossing(Track(s=110.0, lane=1, speed=20.0))
    new_follower = crossing(Track(s=-90.0, lane=1, speed=40.0))
    b = decel(new_leader, 100)
    # The speeds differ by 10 m/s, for the 5 s up to the line crossing: 50 m.
    margins = {
        "L4": (new_leader, 110.0 - 4.4 - 50.0 - lawful(30.0, 20.0, b)),
        "L5": (new_follower, 90.0 - 4.4 - 50.0 - lawful(40.0, 30.0, b)),
    }
    for code, (judged, margin) in margins.items():
        finding = judge_rule(RULES[code], judged)
        assert finding.margin[0] == pytest.approx(margin, abs=0.01)
        assert (finding.first_frame[0], finding.last_frame[0]) == (100, 100)


def test_on_a_two_way_road_l15_requires_sight_of_the_distance_that_both_vehicles_drive():
    drive = {"ego": {"speed": 20.0}, "events": CROSSED | {"abort_end": 140}}
    finding = judge_rule(RULES["L15"], along_course(RoadCourse(sight=((0.0, 300.0),)), **drive))
    # 2 s in the opposing lane and 1 s more, at 20 m/s and the limit of 25 m/s.
    assert finding.margin[0] == pytest.approx(300.0 - 45.0 * 3.0, abs=0.01)


def test_l24_requires_one_second_at_the_sum_of_both_speeds():
    assert judge_rule(RULES["L24"], against(60.0)).margin[0] == pytest.approx(20.0, abs=0.01)


def test_l13_requires_50_km_h():
    finding = judge_rule(RULES["L13"], alone(ego={"speed": 12.0}))
    assert finding.margin[0] == pytest.approx(12.0 - 50.0 / 3.6, abs=1e-3)


def test_the_margin_of_l18_is_the_time_without_an_indicator():
    finding = judge_rule(RULES["L18"], overtake(ego={"lights": 0}))
    assert finding.margin[0] == pytest.approx(-2 * 61 * 0.05, abs=1e-3)


@pytest.mark.parametrize(
    ("lights", "first", "last"),
    [
        (np.where(np.arange(FRAMES) < 56, 0, SIGNALS), 36, 55),
        (np.where(np.arange(FRAMES) > 200, 0, SIGNALS), 266, 326),
        (np.zeros(FRAMES, int), 36, 326),
    ],
)
def test_l18_has_the_first_and_the_last_frame_without_an_indicator(lights, first, last):
    # The lines are crossed in frames 76 and 306: from 2 s before to 1 s after.
    finding = judge_rule(RULES["L18"], overtake(ego={"lights": lights}))
    assert (finding.first_frame[0], finding.last_frame[0]) == (first, last)


def test_the_manoeuvre_begins_3_s_before_the_attempt_and_ends_3_s_after_the_return():
    judged = overtake()
    span, events = manoeuvre(judged), judged.events
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


@pytest.mark.parametrize(
    ("largest_lane", "is_departure"), [(1.0, False), (1.45, False), (1.6, True)]
)
def test_on_a_two_way_road_driving_in_the_other_lane_is_no_departure(largest_lane, is_departure):
    ego = {"lane": ramp((3, 0), (6, largest_lane), frames=200)}
    judged = crossing(ego=ego, events=None, road=two_way_road())
    assert (last_driven_frame(judged)[0] < 199) == is_departure


def test_no_frame_after_a_collision_is_judged():
    speed = np.where(np.arange(200) < 120, 30.0, 5.0)
    crashed = crossing(ego={"speed": speed}, events=CROSSED | {"collision": 120})
    assert judge_rule(RULES["L13"], crashed).verdict[0] == Verdict.LEGAL


TRUE_NEAR, TRUE_FAR = {"true_gap": 20.0}, {"true_gap": 90.0}
THOUGHT_NEAR, THOUGHT_FAR = {"gap": 20.0}, {"gap": 90.0}


@pytest.mark.parametrize(
    ("percept", "belief"),
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
def test_the_perceived_gap_when_pulling_out_is_compared_with_the_true_gap(percept, belief):
    percept_at_decision = Belief(**({"frame": 55} | percept))
    assert judge_rule(RULES["L3"], crossing(beliefs=(percept_at_decision,))).belief[0] == belief
    without_percepts = crossing(beliefs=(percept_at_decision,), unknown=("percepts",))
    assert judge_rule(RULES["L3"], without_percepts).belief[0] == verdicts.Belief.NONE


def test_the_last_decision_before_the_line_crossing_counts():
    beliefs = (
        Belief(frame=10, true_gap=90.0, gap=90.0),
        Belief(frame=55, true_gap=20.0, gap=90.0),
        Belief(frame=150, true_gap=90.0, gap=90.0),
    )
    assert judge_rule(RULES["L3"], crossing(beliefs=beliefs)).belief[0] == verdicts.Belief.MISTAKEN


@pytest.mark.parametrize(("frame", "counts"), [(55, True), (79, True), (81, False)])
def test_without_a_line_crossing_decisions_count_until_a_second_after_the_attempt(frame, counts):
    percept = Belief(frame=frame, true_gap=20.0, gap=90.0)
    judged = crossing(beliefs=(percept,), events={"attempt": 60})
    expected = verdicts.Belief.MISTAKEN if counts else verdicts.Belief.NONE
    assert judge_rule(RULES["L3"], judged).belief[0] == expected


@pytest.mark.parametrize(("code", "whom"), [("L4", 1), ("L5", 2)])
def test_the_perceived_vehicle_decides_whether_its_belief_belongs_to_l4_or_l5(code, whom):
    others = [Track(s=80.0, lane=1, speed=32.0), Track(s=-60.0, lane=1, speed=28.0)]
    percept = Belief(frame=55, whom=whom, vehicle=2, true_gap=5.0, gap=100.0)
    judged = crossing(*others, beliefs=(percept,))
    for rule_code in ("L4", "L5"):
        expected = verdicts.Belief.MISTAKEN if rule_code == code else verdicts.Belief.NONE
        assert judge_rule(RULES[rule_code], judged).belief[0] == expected


def test_a_driver_may_believe_wrongly_that_a_return_is_lawful():
    percept = Belief(
        kind=ManoeuvreKind.RETURN, frame=140, whom=2, true_gap=2.0, gap=80.0,
        true_closing_speed=3.0, closing_speed=3.0,
    )  # fmt: skip
    events = CROSSED | {"overlap_begin": 110, "overlap_end": 120, "return_end": 150}
    judged = crossing(target={"s": -60.0}, events=events, beliefs=(percept,))
    assert judge_rule(RULES["L8"], judged).belief[0] == verdicts.Belief.MISTAKEN


def test_l6_requires_four_seconds_to_a_faster_follower_exactly():
    start = -4.4 - 40.0 - 60 * 0.05 * 10.0
    margins = [
        judge_rule(RULES["L6"], crossing(Track(s=start + shift, lane=1, speed=40.0))).margin[0]
        for shift in (-0.1, 0.1)
    ]
    assert margins == pytest.approx([0.01, -0.01], abs=1e-3)


def test_the_braking_forced_on_a_new_follower_follows_the_formula():
    lane = ramp((4.9, 0), (5.5, 1), frames=200)
    judged = crossing(Track(s=-140.0, lane=1, speed=44.0), ego={"lane": lane})
    last_frame = int(np.argmax(judged.signals.lane[0] == 1)) + 60
    gap = 140.0 - 4.4 - 14.0 * 0.05 * last_frame
    finding = judge_rule(RULES["L23"], judged)
    assert finding.margin[0] == pytest.approx(2.0 - 14.0**2 / (2 * gap), rel=1e-3)
    assert finding.last_frame[0] == last_frame


def test_the_margin_of_l11_is_the_smaller_one_of_clearance_and_speed():
    faster = ramp((3, 29.0), (4, 30.0), frames=200)
    target = {"kind": "B", "s": 48.0}
    judged = passing(1, ego={"speed": faster}, target=target, events=BESIDE)
    start_speed = float(judged.signals.speed[0, 60])
    assert judge_rule(RULES["L11"], judged).margin[0] == pytest.approx(
        (start_speed - 30.0) / start_speed, abs=1e-4
    )


def test_the_standard_overtake_is_completed_and_returns_in_frame_335():
    judged = overtake(ego={"lane": OUT_AND_BACK})
    assert judged.events.is_completed[0]
    assert (judged.events.line_crossed[0], judged.events.return_end[0]) == (76, 335)
