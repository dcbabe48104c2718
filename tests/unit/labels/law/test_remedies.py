"""A remedy keeps the rule when it is put into the recording, and a smaller one does not."""

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
    pytest.param(code, make, id=f"{code} {what}")
    for code, verdict, what, make in FIXTURES
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


def found(code: str, one: Case) -> Finding:
    return judge_rule(RULES[code], one)


def remedies(code: str, one: Case) -> tuple[Remedy, ...]:
    check = found(code, one)
    assert check.verdict[0] == Verdict.ILLEGAL
    margin, first, last = (
        float(check.margin[0]),
        int(check.first_frame[0]),
        int(check.last_frame[0]),
    )
    facts = BreachContext(case=one, margin=margin, first_frame=first, last_frame=last)
    return RULES[code].criterion.remedies(facts)


def put_in(one: Case, change: RequiredChange, by: float) -> Case:
    """The case as if one quantity had been recorded otherwise, everything else being as it was."""
    run, seen, vehicle = one.trajectories, one.signals, change.slot
    steps = math.copysign(math.ceil(abs(by) * 1000.0), by)  # Recorded in thousandths.
    name, slot, frames = "speed", 0, np.ones(seen.num_frames, np.bool_)
    if change.quantity in GAPS:
        ahead = change.quantity is RemedyQuantity.GAP_AHEAD
        name, slot, steps = "s", vehicle, steps if ahead else -steps
        frames = (seen.neighbour_slot[0, 0 if ahead else 1 :: 2] == vehicle).any(axis=0)
    elif change.quantity is RemedyQuantity.LATERAL_GAP:
        is_left = (
            one.target.lateral_position[0, change.frame] > seen.lateral_position[0, change.frame]
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
    values = getattr(run.states, name).copy()
    moved = values[0, slot].astype(np.int64) + np.where(frames, int(steps), 0)
    values[0, slot] = moved.astype(values.dtype)
    changed = case_from_trajectories(run.replace(states=run.states.replace(**{name: values})))
    changed = changed.replace(signals=changed.signals.replace(friction=seen.friction))
    return with_events(changed, one.events)


def all_put_in(one: Case, remedy: Remedy, share: float) -> Case:
    for change in remedy:
        one = put_in(one, change, change.by * share)
    return one


@pytest.mark.parametrize(("code", "make"), BREACHES)
def test_every_breach_has_a_remedy_and_the_first_is_as_large_as_the_margin(code, make):
    one = make()
    found_remedies = remedies(code, one)
    assert found_remedies
    for change in (change for remedy in found_remedies for change in remedy):
        assert change.by != 0
        assert np.isfinite([change.actual, change.needed]).all()
        assert change.frame is None or 0 <= change.frame < one.signals.num_frames
        assert change.slot is None or change.slot != NO_VEHICLE
    first = found_remedies[0]
    if first[0].quantity in IN_UNIT_OF_THE_MARGIN and RULES[code].unit == first[0].unit:
        largest = max(change.by for change in first)
        assert largest == pytest.approx(-found(code, one).margin[0], rel=1e-5)


@pytest.mark.parametrize("code", ["L3", "L4", "L5", "L8", "L10", "L12", "L13", "L14", "L14s"])
def test_what_is_needed_is_enough_and_nine_tenths_of_it_are_not(code):
    makers = [make for of, verdict, _, make in FIXTURES if of == code and verdict == 1]
    for one in (make() for make in makers):
        for remedy in remedies(code, one):
            assert found(code, all_put_in(one, remedy, 1.001)).verdict[0] != Verdict.ILLEGAL
            assert found(code, all_put_in(one, remedy, 0.9)).verdict[0] == Verdict.ILLEGAL


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
"""Quantities that `put_in` can write into a recording."""


@pytest.mark.parametrize(("code", "make"), BREACHES)
def test_a_recording_with_its_remedy_put_in_breaks_the_rule_no_longer(code, make):
    breach = make()
    for remedy in remedies(code, breach):
        # `put_in` changes the speed in all frames, and so the speed at the start, the limit of L11.
        is_relative = code == "L11" and remedy[-1].quantity is RemedyQuantity.SPEED
        if all(change.quantity in RECORDED for change in remedy) and not is_relative:
            changed = all_put_in(breach, remedy, 1.001)
            assert found(code, changed).verdict[0] != Verdict.ILLEGAL


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
    assert change.by == pytest.approx(-found("O10", breach).margin[0], rel=1e-5)
    assert found("O10", all_put_in(breach, (change,), 1.001)).verdict[0] == Verdict.LEGAL


def test_of_two_oncoming_vehicles_the_faster_one_may_need_the_larger_gap():
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


def test_a_gap_that_is_fined_is_that_of_a_frame_above_80_km_h():
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
def test_what_is_needed_is_enough_where_there_are_whole_lanes_or_shared_limits(code):
    makers = [make for of, verdict, _, make in FIXTURES if of == code and verdict == 1]
    for one in (make() for make in makers):
        for remedy in remedies(code, one):
            kept = found(code, all_put_in(one, remedy, 1.001)).verdict[0]
            assert kept in (Verdict.LEGAL, Verdict.NOT_APPLICABLE)


def test_every_rule_has_a_remedy():
    for rule in RULES.values():
        assert type(rule.criterion).remedies is not Criterion.remedies, rule.code


def test_one_second_behind_at_equal_speeds_is_five_metres_more_than_25():
    one = case(Track(speed=30.0), Track(s=29.4, speed=30.0), events={})
    (farther,), (slower,) = remedies("L3", one)
    gap = one.signals.gap[0, NeighbourRole.LEADER, -1]
    assert (farther.actual, farther.needed) == pytest.approx((gap, 30.0), abs=1e-3)
    assert farther.slot == 1
    # The positive root of v + v^2 / (2 b) = gap + 30^2 / (2 b).
    b = min(8.0, 0.9 * float(one.signals.friction[0, -1]) * 9.81)
    root = -b + np.sqrt(b * b + 2.0 * b * gap + 900.0)
    assert slower.needed == pytest.approx(root, rel=1e-4)


def test_beside_a_slower_one_no_speed_is_lawful():
    one = crossing(Track(s=3.0, lane=1, speed=30.0))
    (changes,) = remedies("L4", one)
    assert [change.quantity for change in changes] == [RemedyQuantity.GAP_AHEAD]


def test_nobody_is_told_to_break_the_speed_limit_to_keep_another_rule():
    slow, fast = (
        crossing(Track(s=-gap - 4.5 - 5.0 * (speed - 30.0), lane=1, speed=speed))
        for gap, speed in ((28.0, 32.0), (60.0, 50.0))
    )
    assert [change.quantity for (change,) in remedies("L5", slow)] == [
        RemedyQuantity.GAP_BEHIND,
        RemedyQuantity.SPEED,
    ]
    assert [change.quantity for (change,) in remedies("L5", fast)] == [RemedyQuantity.GAP_BEHIND]


def test_the_speed_limit_is_exceeded_by_so_much():
    one = alone(ego={"speed": 130 / 3.6})
    ((change,),) = remedies("L12", one)
    assert change.by == pytest.approx(-10 / 3.6, abs=1e-3)
    assert change.needed == pytest.approx(120 / 3.6, rel=1e-6)


def test_three_seconds_before_a_standing_vehicle_are_a_third_of_its_gap_per_second():
    # 5 s at 30 m/s until the line is crossed; a lawful gap alone would allow 22 m/s.
    one = crossing(Track(s=150.0 + 4.4 + 60.0, lane=1, speed=0.0))
    _, (slower,) = remedies("L4", one)
    assert slower.needed == pytest.approx(60.0 / 3.0, abs=0.05)


def test_before_a_much_faster_one_its_braking_decides():
    # Far enough to be lawful, but (50 - 20)^2 / (2 205) is more than 2 m/s^2.
    one = crossing(Track(s=-205.0 - 4.4 - 5.0 * 30.0, lane=1, speed=50.0), ego={"speed": 20.0})
    _, (faster,) = remedies("L5", one)
    assert faster.needed == pytest.approx(50.0 - np.sqrt(2.0 * 2.0 * 205.0), abs=0.02)


def test_who_has_just_cut_in_nearer_still_does_not_count():
    frames = np.arange(200)
    one = case(
        Track(speed=30.0),
        Track(s=29.4, speed=30.0),
        Track(s=14.4, speed=np.where(frames < 100, 30.0, 34.0), lane=np.where(frames < 90, 1, 0)),
        events={},
    )
    gap = one.signals.gap[0, NeighbourRole.LEADER]
    assert gap[95] < 15.0 < gap[199] < 27.0
    (farther,), _ = remedies("L3", one)
    assert farther.by == pytest.approx(-found("L3", one).margin[0], rel=1e-5)
    assert farther.frame is not None
    assert not 90 <= farther.frame <= 150


def test_in_fog_the_fastest_instant_asks_for_most():
    faster = ramp((0, 20), (10, 40), frames=200)
    one = alone(ego={"speed": faster}, weather={"fog": 100.0, "rain": 100.0})
    ((change,),) = remedies("L14", one)
    assert change.frame == 199
    assert change.actual == pytest.approx(faster[-1], abs=1e-3)


def test_on_a_two_way_road_sight_is_needed_for_the_whole_time_on_the_left():
    road = two_way_road()
    events = CROSSED | {"return_end": 300}
    one = along_course(RoadCourse(sight=((0.0, 500.0),)), events=events)
    ((change,),) = remedies("L15", one)
    seconds = (300 - CROSSED["line_crossed"]) * 0.05
    assert change.needed == pytest.approx((30.0 + road.speed_limit) * (seconds + 1.0), rel=1e-5)
    assert change.actual == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize("gap", [5.0, 20.0, 30.0])
def test_the_oncoming_vehicle_would_have_had_to_be_farther_by_so_much(gap):
    ((change,),) = remedies("L24", against(gap))
    assert change.slot == 2
    assert change.actual == pytest.approx(gap, abs=0.01)
    assert found("L24", against(gap + change.by + 0.01)).verdict[0] == Verdict.LEGAL
    assert found("L24", against(gap + 0.9 * change.by)).verdict[0] == Verdict.ILLEGAL


@pytest.mark.parametrize(("lane", "by"), [(0, 2.0), (1, 1.0)])
def test_past_on_the_right_is_as_many_lanes_from_lawful_as_it_takes(lane, by):
    one = passing(lane, target={"lane": 1})
    ((change,),) = remedies("L1", one)
    assert (change.quantity, change.by) == (RemedyQuantity.LANES_LEFT, by)
    assert found("L1", passing(lane + by, target={"lane": 1})).verdict[0] == Verdict.LEGAL


def test_past_two_lanes_away_is_one_too_many():
    one = passing(2, events=BESIDE | {"original_lane": 0})
    ((change,),) = remedies("L1", one)
    assert (change.actual, change.needed) == (2.0, 1.0)


def test_a_target_that_made_room_does_not_count_as_another_lane():
    events = BESIDE | {"original_lane": 1}
    made_room = {"lane": ramp((0, 1), (2, 0), frames=200)}
    ((change,),) = remedies("L1", passing(3, target=made_room, events=events))
    assert (change.actual, change.needed) == (2.0, 1.0)


def test_of_a_bicycle_overtaken_too_near_and_too_fast_both_are_told():
    speed = np.full(200, 10.0)
    speed[61:] = 12.0
    both = passing(
        2.4 / 3.75, ego={"speed": speed}, target={"kind": "B", "s": 22.0, "speed": 5.0},
        events={"attempt": 60, "overlap_begin": 0, "overlap_end": 199},
    )  # fmt: skip
    ((room, slower),) = remedies("L11", both)
    assert (room.quantity, room.needed) == (RemedyQuantity.LATERAL_GAP, 1.5)
    assert (slower.actual, slower.needed) == pytest.approx((12.0, 10.0), abs=1e-3)


def test_where_there_is_no_lane_on_the_left_its_width_is_nil():
    road = dataclasses.replace(two_way_road(), overtaking_side_neighbour=None)
    ((change,),) = remedies("L16", crossing(road=road))
    width = overtake().trajectories.scenario.vehicles.width[0, 0]
    assert change.actual == 0.0
    assert change.needed == pytest.approx(width + 0.4, rel=1e-6)
