"""A recording changed by a remedy keeps the rule; with a smaller change it still breaks it."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support import german_fixtures, law_fixtures
from tests.support.cases import Track, case, ramp, two_way_road, with_events
from tests.support.overtakes import (
    BESIDE,
    CROSSED,
    against,
    alone,
    along_course,
    crossing,
    overtake,
    passing,
)
from tests.support.worlds import wide_road

from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.remedies import BreachContext, Remedy, RemedyQuantity, RequiredChange
from overtaking.labels.law.rule import Criterion
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.road_course import RoadCourse
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case, Finding

RULES = {rule.code: rule for rule in (*PORTUGAL.rules, *GERMANY.rules)}
FIXTURES = (*law_fixtures.FIXTURES, *german_fixtures.FIXTURES)
BREACHES = [
    pytest.param(code, make, id=f"{code} {title}")
    for code, verdict, title, make in FIXTURES
    if verdict is Verdict.ILLEGAL
]
GAPS = (RemedyQuantity.GAP_AHEAD, RemedyQuantity.GAP_BEHIND)
IN_UNIT_OF_THE_MARGIN = {
    *GAPS,
    RemedyQuantity.GAP_ONCOMING,
    RemedyQuantity.CLEARANCE,
    RemedyQuantity.SIGHT,
    RemedyQuantity.WIDTH,
    RemedyQuantity.ARRIVAL,
}


def judge(code: str, judged: Case) -> Finding:
    """The finding of one rule."""
    return judge_rule(RULES[code], judged)


def remedies(code: str, breach: Case) -> tuple[Remedy, ...]:
    """The remedies of one rule for a case that breaks it."""
    finding = judge(code, breach)
    assert finding.verdict[0] == Verdict.ILLEGAL
    margin, first, last = (
        float(finding.margin[0]),
        int(finding.first_frame[0]),
        int(finding.last_frame[0]),
    )
    context = BreachContext(case=breach, margin=margin, first_frame=first, last_frame=last)
    return RULES[code].criterion.remedies(context)


def apply_change(original: Case, change: RequiredChange, by: float) -> Case:
    """The case with one recorded quantity changed by an amount, all others as before."""
    trajectories, signals, vehicle = original.trajectories, original.signals, change.slot
    steps = math.copysign(math.ceil(abs(by) * 1000.0), by)  # Recorded in thousandths.
    name, slot, frames = "speed", 0, np.ones(signals.num_frames, np.bool_)
    if change.quantity in GAPS:
        ahead = change.quantity is RemedyQuantity.GAP_AHEAD
        name, slot, steps = "s", vehicle, steps if ahead else -steps
        frames = (signals.neighbour_slot[0, 0 if ahead else 1 :: 2] == vehicle).any(axis=0)
    elif change.quantity is RemedyQuantity.LATERAL_GAP:
        is_left = (
            original.target.lateral_position[0, change.frame]
            > signals.lateral_position[0, change.frame]
        )
        name, slot, steps = "d", vehicle, steps if is_left else -steps
    elif change.quantity is RemedyQuantity.TARGET_ACCEL:
        name, slot = "accel_lon", vehicle
    elif change.quantity is RemedyQuantity.GAP_ONCOMING:
        name, slot = "s", vehicle
    elif change.quantity is RemedyQuantity.ONCOMING_BRAKING:
        name, slot, steps = "accel_lon", vehicle, -steps
    elif change.quantity is not RemedyQuantity.SPEED:
        assert change.quantity in (RemedyQuantity.LANE, RemedyQuantity.LANES_LEFT)
        name, steps = "lane", round(by)
    values = getattr(trajectories.states, name).copy()
    moved = values[0, slot].astype(np.int64) + np.where(frames, int(steps), 0)
    values[0, slot] = moved.astype(values.dtype)
    changed = case_from_trajectories(
        trajectories.replace(states=trajectories.states.replace(**{name: values}))
    )
    changed = changed.replace(signals=changed.signals.replace(friction=signals.friction))
    return with_events(changed, original.events)


def apply_remedy(original: Case, remedy: Remedy, share: float) -> Case:
    """The case with a share of each change of a remedy."""
    for change in remedy:
        original = apply_change(original, change, change.by * share)
    return original


@pytest.mark.parametrize(("code", "make"), BREACHES)
def test_every_breach_has_a_remedy_and_the_first_is_as_large_as_the_margin(code, make):
    breach = make()
    breach_remedies = remedies(code, breach)
    assert breach_remedies
    for change in (change for remedy in breach_remedies for change in remedy):
        assert change.by != 0
        assert np.isfinite([change.actual, change.needed]).all()
        assert change.frame is None or 0 <= change.frame < breach.signals.num_frames
        assert change.slot is None or change.slot != NO_VEHICLE
    first = breach_remedies[0]
    if first[0].quantity in IN_UNIT_OF_THE_MARGIN and RULES[code].unit == first[0].unit:
        largest = max(change.by for change in first)
        assert largest == pytest.approx(-judge(code, breach).margin[0], rel=1e-5)


@pytest.mark.parametrize("code", ["L3", "L4", "L5", "L8", "L10", "L12", "L13", "L14", "L14s"])
def test_a_whole_remedy_ends_the_breach_and_nine_tenths_of_it_do_not(code):
    makers = [make for rule, verdict, _, make in FIXTURES if rule == code and verdict == 1]
    for breach in (make() for make in makers):
        for remedy in remedies(code, breach):
            assert judge(code, apply_remedy(breach, remedy, 1.001)).verdict[0] != Verdict.ILLEGAL
            assert judge(code, apply_remedy(breach, remedy, 0.9)).verdict[0] == Verdict.ILLEGAL


RECORDED = {
    *GAPS,
    RemedyQuantity.GAP_ONCOMING,
    RemedyQuantity.LANE,
    RemedyQuantity.LANES_LEFT,
    RemedyQuantity.LATERAL_GAP,
    RemedyQuantity.ONCOMING_BRAKING,
    RemedyQuantity.SPEED,
    RemedyQuantity.TARGET_ACCEL,
}
"""Quantities that `apply_change` can write into a recording."""


@pytest.mark.parametrize(("code", "make"), BREACHES)
def test_a_recording_changed_by_its_remedy_no_longer_breaks_the_rule(code, make):
    breach = make()
    for remedy in remedies(code, breach):
        # `apply_change` changes all frames, also the speed at the start, which is the limit of L11.
        is_relative = code == "L11" and remedy[-1].quantity is RemedyQuantity.SPEED
        if all(change.quantity in RECORDED for change in remedy) and not is_relative:
            changed = apply_remedy(breach, remedy, 1.001)
            assert judge(code, changed).verdict[0] != Verdict.ILLEGAL


@pytest.mark.parametrize(
    ("code", "needed"),
    [
        *[("L7", 0.2), ("L9", 8.0), ("L10", 0.8), ("L13", 50 / 3.6), ("L15", 50.0), ("L18", 0.0)],
        *[("L19", 0.0), ("L20", 1.0), ("L22", 0.3), ("L28", 50.0)],
        *[("A3", 50.0), ("B1", 0.0), ("O4", 0.2), ("O5", 50.0), ("O7", 1.0), ("O8", 0.0)],
        *[("O11", 8.0), ("O13", 0.3), ("V3", 50 / 3.6)],
    ],
)
def test_the_needed_value_is_the_number_of_the_rule(code, needed):
    makers = [
        make for rule, verdict, _, make in FIXTURES if (rule, verdict) == (code, Verdict.ILLEGAL)
    ]
    assert makers
    for make in makers:
        breach = make()
        if breach.trajectories.road.is_two_way and code == "L15":
            continue  # On two-way roads L15 may require sight over the whole overtake.
        assert remedies(code, breach)[0][0].needed == pytest.approx(needed, rel=1e-6)


@pytest.mark.parametrize(("kind", "needed"), [("town", 1.5), ("other", 2.0), ("motorway", 2.0)])
def test_the_lateral_distance_to_a_bicycle_depends_on_the_kind_of_road(kind, needed):
    road = dataclasses.replace(wide_road(), kind=kind)
    breach = passing(2.4 / 3.75, target={"kind": "B"}, road=road)
    ((change,),) = remedies("O10", breach)
    assert change.needed == needed
    assert change.by == pytest.approx(-judge("O10", breach).margin[0], rel=1e-5)
    assert judge("O10", apply_remedy(breach, (change,), 1.001)).verdict[0] == Verdict.LEGAL


def test_the_faster_of_two_oncoming_vehicles_may_require_the_larger_gap():
    # A gap of 100 m to a vehicle at 10 m/s is enough. At 60 m/s the rule requires 2 s: 120 m.
    slow = Track(s=100.0 + 4.4, speed=10.0, lane=1, oncoming=True)
    fast = Track(s=110.0 + 4.4, speed=60.0, lane=1, oncoming=True)
    breach = case(
        Track(), Track(s=-30.0), slow, fast, road=two_way_road(), frames=50, events=CROSSED | {
            "attempt": 0, "line_crossed": 0, "overlap_end": 0, "return_end": 0},
    )  # fmt: skip
    ((change,),) = remedies("L24", breach)
    assert (change.slot, change.needed) == (3, pytest.approx(120.0, abs=0.01))


def test_the_remedy_of_a_slow_truck_is_50_m_even_if_the_gap_was_smaller_at_a_higher_speed():
    # The smallest gap is at 45 km/h, a speed at which the rule does not apply.
    speed, leader_speed = np.full(90, 10.0), np.full(90, 10.1)
    speed[30:60], leader_speed[45:60] = 12.5, 16.0
    breach = case(
        Track(kind="T", speed=speed),
        Track(s=31.2, speed=leader_speed),
        road=two_way_road(), frames=90, events={},
    )  # fmt: skip
    gap = breach.signals.gap[0, NeighbourRole.LEADER]
    assert gap[30:60].min() < gap[np.r_[:30, 60:90]].min()
    ((change,),) = remedies("L28", breach)
    assert change.needed == pytest.approx(50.0, abs=0.01)


def test_only_the_gap_in_frames_above_80_km_h_is_fined():
    # Between two parts of the breach the ego is nearer, at 79 km/h, where no gap is fined.
    speed, leader_speed = np.full(400, 30.0), np.full(400, 30.0)
    speed[160:240], leader_speed[160:200], leader_speed[200:240] = 22.0, 16.0, 28.0
    breach = case(
        Track(speed=speed), Track(s=20.0 + 4.4, speed=leader_speed), frames=400, events={},
    )  # fmt: skip
    lacking = 0.9 * speed - breach.signals.gap[0, NeighbourRole.LEADER]
    assert lacking[160:240].max() > lacking[np.r_[:160, 240:400]].max()
    ((change,),) = remedies("A2", breach)
    assert change.needed == pytest.approx(27.0, abs=0.01)


@pytest.mark.parametrize("code", ["L20", "L21", "L22", "L23"])
def test_a_remedy_in_whole_lanes_or_with_a_shared_limit_ends_the_breach(code):
    makers = [make for rule, verdict, _, make in FIXTURES if rule == code and verdict == 1]
    for breach in (make() for make in makers):
        for remedy in remedies(code, breach):
            verdict_after = judge(code, apply_remedy(breach, remedy, 1.001)).verdict[0]
            assert verdict_after in (Verdict.LEGAL, Verdict.NOT_APPLICABLE)


def test_every_rule_has_a_remedy():
    for rule in RULES.values():
        assert type(rule.criterion).remedies is not Criterion.remedies, rule.code


def test_a_gap_of_25_m_at_30_mps_needs_30_m_or_a_lower_speed():
    breach = case(Track(speed=30.0), Track(s=29.4, speed=30.0), events={})
    (farther,), (slower,) = remedies("L3", breach)
    gap = breach.signals.gap[0, NeighbourRole.LEADER, -1]
    assert (farther.actual, farther.needed) == pytest.approx((gap, 30.0), abs=1e-3)
    assert farther.slot == 1
    # The positive root of v + v^2 / (2 b) = gap + 30^2 / (2 b).
    b = min(8.0, 0.9 * float(breach.signals.friction[0, -1]) * 9.81)
    root = -b + np.sqrt(b * b + 2.0 * b * gap + 900.0)
    assert slower.needed == pytest.approx(root, rel=1e-4)


def test_entering_a_lane_beside_a_vehicle_has_no_lawful_speed():
    breach = crossing(Track(s=3.0, lane=1, speed=30.0))
    (changes,) = remedies("L4", breach)
    assert [change.quantity for change in changes] == [RemedyQuantity.GAP_AHEAD]


def test_no_remedy_of_l5_is_a_speed_above_the_speed_limit():
    slow, fast = (
        crossing(Track(s=-gap - 4.5 - 5.0 * (speed - 30.0), lane=1, speed=speed))
        for gap, speed in ((28.0, 32.0), (60.0, 50.0))
    )
    assert [change.quantity for (change,) in remedies("L5", slow)] == [
        RemedyQuantity.GAP_BEHIND,
        RemedyQuantity.SPEED,
    ]
    assert [change.quantity for (change,) in remedies("L5", fast)] == [RemedyQuantity.GAP_BEHIND]


def test_the_remedy_of_130_km_h_is_10_km_h_less():
    breach = alone(ego={"speed": 130 / 3.6})
    ((change,),) = remedies("L12", breach)
    assert change.by == pytest.approx(-10 / 3.6, abs=1e-3)
    assert change.needed == pytest.approx(120 / 3.6, rel=1e-6)


def test_the_needed_speed_towards_a_standing_vehicle_is_a_third_of_the_gap_per_second():
    # 5 s at 30 m/s until the line is crossed; a lawful gap alone would allow 22 m/s.
    breach = crossing(Track(s=150.0 + 4.4 + 60.0, lane=1, speed=0.0))
    _, (slower,) = remedies("L4", breach)
    assert slower.needed == pytest.approx(60.0 / 3.0, abs=0.05)


def test_the_braking_of_a_much_faster_follower_decides_the_needed_speed():
    # The gap is lawful, but (50 - 20)^2 / (2 205) is more than 2 m/s^2.
    breach = crossing(Track(s=-205.0 - 4.4 - 5.0 * 30.0, lane=1, speed=50.0), ego={"speed": 20.0})
    _, (faster,) = remedies("L5", breach)
    assert faster.needed == pytest.approx(50.0 - np.sqrt(2.0 * 2.0 * 205.0), abs=0.02)


def test_the_smaller_gap_to_a_vehicle_that_has_just_cut_in_does_not_count():
    frames = np.arange(200)
    breach = case(
        Track(speed=30.0),
        Track(s=29.4, speed=30.0),
        Track(s=14.4, speed=np.where(frames < 100, 30.0, 34.0), lane=np.where(frames < 90, 1, 0)),
        events={},
    )
    gap = breach.signals.gap[0, NeighbourRole.LEADER]
    assert gap[95] < 15.0 < gap[199] < 27.0
    (farther,), _ = remedies("L3", breach)
    assert farther.by == pytest.approx(-judge("L3", breach).margin[0], rel=1e-5)
    assert farther.frame is not None
    assert not 90 <= farther.frame <= 150


def test_in_fog_the_remedy_is_for_the_frame_of_the_highest_speed():
    speed = ramp((0, 20), (10, 40), frames=200)
    breach = alone(ego={"speed": speed}, weather={"fog": 100.0, "rain": 100.0})
    ((change,),) = remedies("L14", breach)
    assert change.frame == 199
    assert change.actual == pytest.approx(speed[-1], abs=1e-3)


def test_on_a_two_way_road_sight_is_needed_for_the_whole_time_on_the_left():
    road = two_way_road()
    events = CROSSED | {"return_end": 300}
    breach = along_course(RoadCourse(sight=((0.0, 500.0),)), events=events)
    ((change,),) = remedies("L15", breach)
    seconds = (300 - CROSSED["line_crossed"]) * 0.05
    assert change.needed == pytest.approx((30.0 + road.speed_limit) * (seconds + 1.0), rel=1e-5)
    assert change.actual == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize("gap", [5.0, 20.0, 30.0])
def test_the_remedy_of_a_small_oncoming_gap_is_the_missing_distance(gap):
    ((change,),) = remedies("L24", against(gap))
    assert change.slot == 2
    assert change.actual == pytest.approx(gap, abs=0.01)
    assert judge("L24", against(gap + change.by + 0.01)).verdict[0] == Verdict.LEGAL
    assert judge("L24", against(gap + 0.9 * change.by)).verdict[0] == Verdict.ILLEGAL


@pytest.mark.parametrize(("lane", "by"), [(0, 2.0), (1, 1.0)])
def test_the_remedy_of_passing_on_the_right_is_the_number_of_lanes_to_the_left(lane, by):
    breach = passing(lane, target={"lane": 1})
    ((change,),) = remedies("L1", breach)
    assert (change.quantity, change.by) == (RemedyQuantity.LANES_LEFT, by)
    assert judge("L1", passing(lane + by, target={"lane": 1})).verdict[0] == Verdict.LEGAL


def test_passing_two_lanes_to_the_left_is_one_lane_too_many():
    breach = passing(2, events=BESIDE | {"original_lane": 0})
    ((change,),) = remedies("L1", breach)
    assert (change.actual, change.needed) == (2.0, 1.0)


def test_a_target_that_made_room_does_not_count_as_another_lane():
    events = BESIDE | {"original_lane": 1}
    made_room = {"lane": ramp((0, 1), (2, 0), frames=200)}
    ((change,),) = remedies("L1", passing(3, target=made_room, events=events))
    assert (change.actual, change.needed) == (2.0, 1.0)


def test_the_remedy_of_passing_a_bicycle_too_near_and_too_fast_has_both_changes():
    speed = np.full(200, 10.0)
    speed[61:] = 12.0
    breach = passing(
        2.4 / 3.75, ego={"speed": speed}, target={"kind": "B", "s": 22.0, "speed": 5.0},
        events={"attempt": 60, "overlap_begin": 0, "overlap_end": 199},
    )  # fmt: skip
    ((room, slower),) = remedies("L11", breach)
    assert (room.quantity, room.needed) == (RemedyQuantity.LATERAL_GAP, 1.5)
    assert (slower.actual, slower.needed) == pytest.approx((12.0, 10.0), abs=1e-3)


def test_a_missing_lane_on_the_left_has_the_width_0():
    road = dataclasses.replace(two_way_road(), overtaking_side_neighbour=None)
    ((change,),) = remedies("L16", crossing(road=road))
    width = overtake().trajectories.scenario.vehicles.width[0, 0]
    assert change.actual == 0.0
    assert change.needed == pytest.approx(width + 0.4, rel=1e-6)
