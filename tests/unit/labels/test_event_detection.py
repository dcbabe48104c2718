"""Events of overtakes that are drawn by hand, and how each edge case is decided."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.cases import Track, case, ramp, seen_case, two_way_road
from tests.support.worlds import wide_road

from overtaking.labels.event_detection import outcome_details, outcomes
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail
from overtaking.model.trajectories import NO_VEHICLE, Stage

if TYPE_CHECKING:
    from overtaking.model.road import Road

FRAMES = 500
ROAD = wide_road(lanes=3)
AHEAD = Track(s=60.0, speed=20.0)


def way(*points: tuple[float, float]) -> np.ndarray:
    return ramp(*points, frames=FRAMES)


def found(ego_lane, *others: Track, speed=28.0, **given):
    one = case(Track(speed=speed, lane=ego_lane), *others, frames=FRAMES, **{"road": ROAD} | given)
    return one.events


def said(events) -> tuple[Outcome, OutcomeDetail]:
    return Outcome(int(outcomes(events)[0])), OutcomeDetail(int(outcome_details(events, 50)[0]))


OUT_AND_BACK = way((3, 0), (6, 1), (14, 1), (17, 0))


def test_a_whole_overtake_has_its_phases_in_order():
    events = found(OUT_AND_BACK, AHEAD)
    names = [
        "attempt",
        "line_crossed",
        "overlap_begin",
        "overlap_end",
        "return_begin",
        "return_end",
    ]
    frames = [int(getattr(events, name)[0]) for name in names]
    assert frames == sorted(frames)
    assert said(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1
    assert events.num_attempts[0] == events.num_passed[0] == 1
    assert events.abort[0] == events.abort_end[0] == NEVER


def test_the_phases_are_where_the_tracks_say():
    events = found(OUT_AND_BACK, AHEAD)
    assert events.attempt[0] == pytest.approx(60, abs=2)
    # The corner is 0.9 m from the centre: over the line after 0.85 m of 3.5 m in 3 s.
    assert events.line_crossed[0] == pytest.approx(60 + 20 * 3 * 0.85 / 3.5, abs=2)
    # 60 m at 8 m/s, less and more a mean length of 4.4 m.
    assert events.overlap_begin[0] == pytest.approx(20 * (60 - 4.4) / 8, abs=2)
    assert events.overlap_end[0] == pytest.approx(20 * (60 + 4.4) / 8, abs=2)
    assert events.return_begin[0] == pytest.approx(280, abs=2)


def test_who_stays_attempts_nothing():
    events = found(0.0, AHEAD, speed=20.0)
    assert said(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1


def test_a_lane_change_with_nobody_ahead_is_no_overtake():
    events = found(OUT_AND_BACK, Track(s=-60.0, speed=20.0))
    assert said(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)
    assert events.target_slot[0] == NO_VEHICLE


def test_a_gust_alone_is_no_attempt():
    shoved = way((5, 0), (5.3, 0.1), (5.6, 0))
    assert said(found(shoved, AHEAD, speed=20.0))[0] is Outcome.NO_ATTEMPT


def test_a_slow_drift_within_the_lane_is_no_attempt():
    assert said(found(way((2, -0.12), (22, 0.12)), AHEAD, speed=20.0))[0] is Outcome.NO_ATTEMPT


def test_a_slow_drift_over_the_line_is_one():
    events = found(way((2, 0), (22, 0.5)), AHEAD, speed=20.0)
    assert events.attempt[0] != NEVER
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.OPEN_AT_HORIZON)


def drifted(events) -> bool:
    """Whether there is a drift and no attempt."""
    assert (events.drift[0] != NEVER) == (events.num_drifts[0] > 0)
    return said(events)[0] is Outcome.NO_ATTEMPT and bool(events.num_drifts[0])


def test_a_wide_movement_within_the_lane_that_is_slow_is_a_drift():
    # 0.7 m in 2.5 s and back.
    events = found(way((3, 0), (5.5, 0.2), (6, 0.2), (8.5, 0)), AHEAD, speed=20.0)
    assert drifted(events)
    assert events.drift[0] == pytest.approx(60, abs=2)


def test_a_fast_movement_within_the_lane_that_does_not_come_back_in_time_is_a_drift():
    assert drifted(found(way((3, 0), (4, 0.2)), AHEAD, speed=20.0))
    assert drifted(found(way((3, 0), (4, 0.2), (10, 0.2), (11, 0)), AHEAD, speed=20.0))


def test_a_pause_before_the_line_belongs_to_the_attempt():
    events = found(way((3, 0), (4, 0.2), (6, 0.2), (9, 1)), AHEAD)
    assert events.attempt[0] == pytest.approx(60, abs=2)
    assert events.num_attempts[0] == 1
    assert events.num_drifts[0] == 0


@pytest.mark.parametrize("track", [Track(kind="MC"), Track(kind="M")])
def test_what_counts_as_fast_depends_on_the_class(track):
    swing = way((3, 0), (4, 0.22), (6, 0.22), (7, 0))  # 0.77 m in a second.
    ego = dataclasses.replace(track, speed=20.0, lane=swing)
    events = case(ego, AHEAD, frames=FRAMES, road=ROAD).events
    assert drifted(events) == (track.kind == "MC")


def test_without_a_driving_lane_on_the_left_nothing_is_attempted():
    ahead = dataclasses.replace(AHEAD, lane=2)
    assert drifted(found(way((3, 2), (5, 2.3), (7, 2)), ahead, speed=20.0))
    assert drifted(found(way((3, 2), (4, 2.2), (5, 2.2), (6, 2)), ahead, speed=20.0))


def test_on_a_two_way_road_the_lane_of_oncoming_traffic_is_one_to_attempt_in():
    swing = way((3, 0), (4, 0.35), (5, 0.35), (6, 0))
    events = found(swing, AHEAD, speed=20.0, road=two_way_road())
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_AFTER_CROSSING)


def test_what_is_left_of_a_change_into_this_lane_from_the_right_is_no_attempt():
    # The speed falls for a moment when the centre is over the line.
    arriving = way((2, 0), (3.5, 0.6), (4.5, 0.62), (5.5, 1.0))
    events = found(arriving, dataclasses.replace(AHEAD, lane=1), speed=20.0)
    assert said(events)[0] is Outcome.NO_ATTEMPT


def test_a_tremor_while_the_ego_comes_from_the_left_is_no_attempt():
    arriving = way((2, 1), (4.5, 0.4), (4.6, 0.43), (7, 0))
    events = found(arriving, AHEAD, speed=20.0)
    assert said(events)[0] is Outcome.NO_ATTEMPT


def test_who_has_been_in_the_lane_and_goes_back_attempts_again():
    events = found(way((2, 1), (5, 0), (6, 0), (9, 1)), dataclasses.replace(AHEAD, s=90.0))
    assert events.attempt[0] == pytest.approx(120, abs=3)


def test_touching_the_line_is_a_drift_and_being_over_it_an_attempt():
    width = ROAD.lanes[0].width
    body = {"width": 1.8}
    for beyond, is_attempt in ((0.03, False), (0.08, True)):
        reach = ((width - 1.8) / 2 + beyond) / width
        ego = Track(speed=20.0, lane=way((3, 0), (10, reach), (17, 0)), body=body)
        events = case(ego, AHEAD, frames=FRAMES, road=ROAD).events
        assert bool(events.has_attempt[0]) == is_attempt


def test_the_leader_of_the_lane_that_the_ego_came_from_is_not_overtaken():
    # Nobody is ahead in lane 1, where it is for 2.6 s.
    events = found(way((2, 2), (4, 1), (4.6, 1), (6.6, 2)), dataclasses.replace(AHEAD, lane=2))
    assert said(events)[0] is Outcome.NO_ATTEMPT


def test_giving_up_before_the_line_is_an_attempt():
    events = found(way((3, 0), (4, 0.2), (6, 0.2), (7, 0)), AHEAD, speed=20.0)
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_BEFORE_CROSSING)
    assert events.line_crossed[0] == NEVER
    assert events.abort[0] < events.abort_end[0]


def test_giving_up_after_the_line_goes_back_behind_the_target():
    events = found(way((3, 0), (6, 1), (9, 1), (12, 0)), AHEAD, speed=20.0)
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_AFTER_CROSSING)
    assert events.abort[0] == pytest.approx(180, abs=3)
    assert events.return_end[0] == NEVER


def test_after_an_abort_the_last_attempt_counts():
    again = way((1, 0), (3, 1), (4, 1), (6, 0), (8, 0), (10, 1), (16, 1), (18, 0))
    speed = np.where(np.arange(FRAMES) < 140, 20.0, 32.0)
    events = found(again, AHEAD, speed=speed)
    assert events.num_attempts[0] == 2
    assert said(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.attempt[0] == pytest.approx(160, abs=3)


def test_past_the_target_and_there_to_stay():
    assert said(found(way((3, 0), (6, 1)), AHEAD)) == (
        Outcome.NOT_COMPLETED,
        OutcomeDetail.PASSED_NOT_RETURNED,
    )


def test_cut_off_while_passing_is_open():
    events = found(way((3, 0), (6, 1)), Track(s=180.0, speed=20.0))
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.OPEN_AT_HORIZON)


def test_two_targets_in_one_go_are_one_overtake_of_the_first():
    both = (AHEAD, Track(s=80.0, speed=20.0))
    events = found(way((3, 0), (6, 1), (16, 1), (19, 0)), *both)
    assert said(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1
    assert events.num_passed[0] == 2


def test_a_vehicle_that_cuts_in_before_the_attempt_becomes_the_target():
    cutting = Track(s=40.0, speed=20.0, lane=way((0, 1), (2, 0)))
    assert found(OUT_AND_BACK, AHEAD, cutting).target_slot[0] == 2


def test_a_vehicle_that_cuts_in_afterwards_does_not():
    cutting = Track(s=40.0, speed=20.0, lane=way((0, 1), (5, 1), (7, 0)))
    events = found(OUT_AND_BACK, AHEAD, cutting)
    assert events.target_slot[0] == 1
    assert events.num_passed[0] == 2


def test_a_target_that_makes_room_to_the_right_is_still_overtaken():
    leaving = Track(s=60.0, speed=20.0, lane=way((2.4, 1), (4.4, 0)))
    events = found(way((3, 1), (6, 2), (14, 2), (17, 1)), leaving)
    assert events.target_slot[0] == 1
    assert said(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)


def test_passing_on_the_right_without_moving_left_is_no_attempt():
    events = found(way((3, 1), (6, 0), (14, 0), (17, 1)), Track(s=60.0, speed=20.0, lane=1))
    # It moves left only once it is past: nobody is ahead.
    assert said(events)[0] is Outcome.NO_ATTEMPT


def test_the_original_lane_is_where_it_began():
    events = found(way((3, 1), (6, 2), (14, 2), (17, 1)), dataclasses.replace(AHEAD, lane=1))
    assert events.original_lane[0] == 1
    assert said(events)[0] is Outcome.COMPLETED


def test_two_lanes_out_and_back_is_one_overtake():
    events = found(way((2, 0), (7, 2), (14, 2), (19, 0)), AHEAD)
    assert said(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.return_begin[0] == pytest.approx(280, abs=3)


def crash(ego_lane, other: Track, at: int, speed=28.0):
    """The same tracks with a contact in a frame."""
    one = case(Track(speed=speed, lane=ego_lane), other, frames=FRAMES, road=ROAD)
    hit = one.trajectories.collided_with.copy()
    hit[:, at:] = 1
    return seen_case(one.trajectories.replace(collided_with=hit)).events


def test_running_into_the_leader_before_any_attempt_is_a_collision():
    events = crash(0.0, AHEAD, at=140)
    assert said(events) == (Outcome.COLLISION, OutcomeDetail.COLLISION_BEFORE_ATTEMPT)
    assert not events.was_struck[0]


def test_being_run_into_from_behind_is_being_struck():
    fast = Track(s=-100.0, speed=40.0, lane=1)
    events = crash(way((3, 0), (6, 1)), fast, at=150)
    # Nobody is ahead, so nothing was attempted; it was struck all the same.
    assert events.was_struck[0]


def test_moving_into_somebody_alongside_is_running_into_it():
    beside = Track(s=62.0, speed=20.0, lane=1)
    events = crash(way((7, 0), (9, 1)), beside, at=158)
    assert not events.was_struck[0]


def test_a_collision_after_the_return_still_decides():
    events = crash(OUT_AND_BACK, AHEAD, at=400)
    assert events.return_end[0] != NEVER
    assert said(events)[0] is Outcome.COLLISION


def test_nothing_counts_after_a_collision():
    events = crash(OUT_AND_BACK, AHEAD, at=100)
    assert events.overlap_begin[0] == events.return_end[0] == NEVER
    assert said(events) == (Outcome.COLLISION, OutcomeDetail.RAN_INTO_OTHER)


def test_leaving_the_road_ends_the_overtake():
    events = found(way((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.DEPARTED)


def test_leaving_the_road_from_the_fastest_lane_is_no_attempt():
    events = found(way((3, 2), (8, 3.5)), dataclasses.replace(AHEAD, lane=2))
    assert said(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.DEPARTED)


def test_an_ego_that_begins_beside_the_lanes_has_not_left_them():
    events = found(way((0, 3.2), (3, 1.0)), dataclasses.replace(AHEAD, lane=2))
    assert events.road_departure[0] == NEVER
    assert said(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)


def test_an_ego_that_stays_beside_the_lanes_has_not_left_them():
    events = found(way((0, 3.2), (3, 3.2)), dataclasses.replace(AHEAD, lane=2))
    assert events.road_departure[0] == NEVER


def test_an_ego_that_begins_beside_the_lanes_and_enters_them_can_leave_them_later():
    events = found(way((0, 3.2), (3, 1.0), (8, 3.5)), dataclasses.replace(AHEAD, lane=2))
    assert 60 < events.road_departure[0] < 200
    assert said(events)[1] is OutcomeDetail.DEPARTED


def test_an_ego_whose_first_heading_is_across_the_road_has_not_spun():
    events = turned(1, 1.0, at=0)
    assert events.spin[0] == NEVER


def turned(ego_lane, angle: float, at: int, road: Road = ROAD):
    """The same tracks, the ego turned to the left by an angle [rad] from a frame on."""
    one = case(Track(speed=28.0, lane=ego_lane), AHEAD, frames=FRAMES, road=road)
    states = one.trajectories.states
    along = float(road.heading)
    across = math.atan2(math.sin(along + angle), math.cos(along + angle))
    heading = np.full_like(states.heading, round(1e4 * along))
    heading[:, 0, at:] = round(1e4 * across)
    return seen_case(one.trajectories.replace(states=states.replace(heading=heading))).events


@pytest.mark.parametrize("angle", [1.0, -1.0])
@pytest.mark.parametrize("direction", [0.0, 3.1, -3.1])
def test_standing_across_the_road_is_a_spin_whatever_its_direction(angle, direction):
    road = dataclasses.replace(ROAD, heading=direction)
    events = turned(OUT_AND_BACK, angle, at=150, road=road)
    assert events.spin[0] == 150
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.SPUN)
    assert events.return_end[0] == NEVER


def test_what_a_driver_brings_back_is_no_spin():
    assert turned(OUT_AND_BACK, 0.79, at=150).spin[0] == NEVER
    assert turned(OUT_AND_BACK, 0.81, at=150).spin[0] == 150


def test_a_spin_without_an_attempt_is_none():
    assert said(turned(0.0, 1.0, at=60)) == (Outcome.NO_ATTEMPT, OutcomeDetail.SPUN)


def test_a_spin_after_the_return_still_decides():
    events = turned(OUT_AND_BACK, 1.0, at=400)
    assert events.return_end[0] != NEVER
    assert said(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.SPUN)


def test_who_leaves_the_road_and_spins_afterwards_has_departed():
    events = found(way((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    off = int(events.road_departure[0])
    for spin, way_out in ((off - 1, OutcomeDetail.SPUN), (off + 1, OutcomeDetail.DEPARTED)):
        both = events.replace(spin=np.array([spin], np.int32))
        assert OutcomeDetail(int(outcome_details(both, 50)[0])) is way_out


def test_with_a_contact_a_departure_is_a_collision():
    events = found(way((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    both = events.replace(collision=events.road_departure + np.int32(2))
    assert said(both)[0] is Outcome.COLLISION


@pytest.mark.parametrize(
    ("begin", "end", "means"),
    [(60, 100, True), (90, 100, False), (10, 40, False), (70, 71, True)],
)
def test_an_attempt_is_intended_if_the_driver_overtakes_before_the_line(begin, end, means):
    one = case(Track(speed=28.0, lane=OUT_AND_BACK), AHEAD, frames=FRAMES, road=ROAD)
    assert one.events.attempt[0] < 70 < one.events.line_crossed[0] < 90
    stage = one.trajectories.stage.copy()
    stage[:, begin:end] = Stage.PULL_OUT
    assert seen_case(one.trajectories.replace(stage=stage)).events.was_intended[0] == means


def test_what_is_no_attempt_is_not_intended():
    one = case(Track(speed=20.0), AHEAD, frames=FRAMES, road=ROAD)
    meant = one.trajectories.replace(stage=np.full_like(one.trajectories.stage, Stage.PULL_OUT))
    assert not seen_case(meant).events.was_intended[0]


def test_following_begins_when_the_time_gap_falls_below_three_seconds():
    events = found(0.0, Track(s=124.4, speed=20.0), speed=30.0)
    # From a gap of 120 m, 90 m are left after 3 s at 10 m/s.
    assert events.following_begin[0] == pytest.approx(60, abs=1)
