"""Events of overtakes that are drawn by hand, with the edge cases of their definitions."""

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


def lane_over_time(*points: tuple[float, float]) -> np.ndarray:
    """The lane in each frame, linear between points of (time [s], lane)."""
    return ramp(*points, frames=FRAMES)


def detect_events(ego_lane, *others: Track, speed=28.0, **options):
    """The events of an ego with a lane for each frame among other vehicles."""
    drive = case(
        Track(speed=speed, lane=ego_lane), *others, frames=FRAMES, **{"road": ROAD} | options
    )
    return drive.events


def outcome_of(events) -> tuple[Outcome, OutcomeDetail]:
    """The outcome and its detail, at a frame interval of 50 ms."""
    return Outcome(int(outcomes(events)[0])), OutcomeDetail(int(outcome_details(events, 50)[0]))


OUT_AND_BACK = lane_over_time((3, 0), (6, 1), (14, 1), (17, 0))


def test_a_completed_overtake_has_its_phases_in_order():
    events = detect_events(OUT_AND_BACK, AHEAD)
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
    assert outcome_of(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1
    assert events.num_attempts[0] == events.num_passed[0] == 1
    assert events.abort[0] == events.abort_end[0] == NEVER


def test_the_phases_begin_at_the_frames_that_the_tracks_imply():
    events = detect_events(OUT_AND_BACK, AHEAD)
    assert events.attempt[0] == pytest.approx(60, abs=2)
    # The corner is 0.9 m from the centre: over the line after 0.85 m of 3.5 m in 3 s.
    assert events.line_crossed[0] == pytest.approx(60 + 20 * 3 * 0.85 / 3.5, abs=2)
    # 60 m at 8 m/s, less and more a mean length of 4.4 m.
    assert events.overlap_begin[0] == pytest.approx(20 * (60 - 4.4) / 8, abs=2)
    assert events.overlap_end[0] == pytest.approx(20 * (60 + 4.4) / 8, abs=2)
    assert events.return_begin[0] == pytest.approx(280, abs=2)


def test_an_ego_that_follows_its_leader_has_no_attempt():
    events = detect_events(0.0, AHEAD, speed=20.0)
    assert outcome_of(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1


def test_a_lane_change_without_a_leader_is_no_attempt():
    events = detect_events(OUT_AND_BACK, Track(s=-60.0, speed=20.0))
    assert outcome_of(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)
    assert events.target_slot[0] == NO_VEHICLE


def test_a_displacement_by_a_gust_is_no_attempt():
    shoved = lane_over_time((5, 0), (5.3, 0.1), (5.6, 0))
    assert outcome_of(detect_events(shoved, AHEAD, speed=20.0))[0] is Outcome.NO_ATTEMPT


def test_a_slow_drift_within_the_lane_is_no_attempt():
    assert (
        outcome_of(detect_events(lane_over_time((2, -0.12), (22, 0.12)), AHEAD, speed=20.0))[0]
        is Outcome.NO_ATTEMPT
    )


def test_a_slow_drift_over_the_line_is_an_attempt():
    events = detect_events(lane_over_time((2, 0), (22, 0.5)), AHEAD, speed=20.0)
    assert events.attempt[0] != NEVER
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.OPEN_AT_HORIZON)


def is_only_drift(events) -> bool:
    """Whether the events have a drift and no attempt."""
    assert (events.drift[0] != NEVER) == (events.num_drifts[0] > 0)
    return outcome_of(events)[0] is Outcome.NO_ATTEMPT and bool(events.num_drifts[0])


def test_a_wide_slow_movement_within_the_lane_is_a_drift():
    # 0.7 m in 2.5 s and back.
    events = detect_events(
        lane_over_time((3, 0), (5.5, 0.2), (6, 0.2), (8.5, 0)), AHEAD, speed=20.0
    )
    assert is_only_drift(events)
    assert events.drift[0] == pytest.approx(60, abs=2)


def test_a_fast_movement_within_the_lane_without_a_return_in_time_is_a_drift():
    assert is_only_drift(detect_events(lane_over_time((3, 0), (4, 0.2)), AHEAD, speed=20.0))
    assert is_only_drift(
        detect_events(lane_over_time((3, 0), (4, 0.2), (10, 0.2), (11, 0)), AHEAD, speed=20.0)
    )


def test_a_pause_before_the_line_belongs_to_the_attempt():
    events = detect_events(lane_over_time((3, 0), (4, 0.2), (6, 0.2), (9, 1)), AHEAD)
    assert events.attempt[0] == pytest.approx(60, abs=2)
    assert events.num_attempts[0] == 1
    assert events.num_drifts[0] == 0


@pytest.mark.parametrize("track", [Track(kind="MC"), Track(kind="M")])
def test_the_threshold_of_a_fast_movement_depends_on_the_vehicle_class(track):
    swing = lane_over_time((3, 0), (4, 0.22), (6, 0.22), (7, 0))  # 0.77 m in a second.
    ego = dataclasses.replace(track, speed=20.0, lane=swing)
    events = case(ego, AHEAD, frames=FRAMES, road=ROAD).events
    assert is_only_drift(events) == (track.kind == "MC")


def test_without_a_driving_lane_on_the_left_a_movement_is_no_attempt():
    ahead = dataclasses.replace(AHEAD, lane=2)
    assert is_only_drift(detect_events(lane_over_time((3, 2), (5, 2.3), (7, 2)), ahead, speed=20.0))
    assert is_only_drift(
        detect_events(lane_over_time((3, 2), (4, 2.2), (5, 2.2), (6, 2)), ahead, speed=20.0)
    )


def test_on_a_two_way_road_a_movement_into_the_opposing_lane_is_an_attempt():
    swing = lane_over_time((3, 0), (4, 0.35), (5, 0.35), (6, 0))
    events = detect_events(swing, AHEAD, speed=20.0, road=two_way_road())
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_AFTER_CROSSING)


def test_the_end_of_a_lane_change_from_the_right_is_no_attempt():
    # The lateral speed falls for a moment when the centre is over the line.
    arriving = lane_over_time((2, 0), (3.5, 0.6), (4.5, 0.62), (5.5, 1.0))
    events = detect_events(arriving, dataclasses.replace(AHEAD, lane=1), speed=20.0)
    assert outcome_of(events)[0] is Outcome.NO_ATTEMPT


def test_a_tremor_during_a_lane_change_from_the_left_is_no_attempt():
    arriving = lane_over_time((2, 1), (4.5, 0.4), (4.6, 0.43), (7, 0))
    events = detect_events(arriving, AHEAD, speed=20.0)
    assert outcome_of(events)[0] is Outcome.NO_ATTEMPT


def test_an_ego_that_came_from_the_left_lane_attempts_when_it_goes_back_there():
    events = detect_events(
        lane_over_time((2, 1), (5, 0), (6, 0), (9, 1)), dataclasses.replace(AHEAD, s=90.0)
    )
    assert events.attempt[0] == pytest.approx(120, abs=3)


def test_touching_the_line_is_a_drift_and_crossing_it_is_an_attempt():
    width = ROAD.lanes[0].width
    body = {"width": 1.8}
    for distance_over_line, is_attempt in ((0.03, False), (0.08, True)):
        reach = ((width - 1.8) / 2 + distance_over_line) / width
        ego = Track(speed=20.0, lane=lane_over_time((3, 0), (10, reach), (17, 0)), body=body)
        events = case(ego, AHEAD, frames=FRAMES, road=ROAD).events
        assert bool(events.has_attempt[0]) == is_attempt


def test_the_leader_of_the_lane_that_the_ego_came_from_is_not_overtaken():
    # No vehicle is ahead in lane 1, where the ego stays for 2.6 s.
    events = detect_events(
        lane_over_time((2, 2), (4, 1), (4.6, 1), (6.6, 2)), dataclasses.replace(AHEAD, lane=2)
    )
    assert outcome_of(events)[0] is Outcome.NO_ATTEMPT


def test_an_abort_before_the_line_crossing_is_an_attempt():
    events = detect_events(lane_over_time((3, 0), (4, 0.2), (6, 0.2), (7, 0)), AHEAD, speed=20.0)
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_BEFORE_CROSSING)
    assert events.line_crossed[0] == NEVER
    assert events.abort[0] < events.abort_end[0]


def test_an_abort_after_the_line_crossing_ends_behind_the_target():
    events = detect_events(lane_over_time((3, 0), (6, 1), (9, 1), (12, 0)), AHEAD, speed=20.0)
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.ABORTED_AFTER_CROSSING)
    assert events.abort[0] == pytest.approx(180, abs=3)
    assert events.return_end[0] == NEVER


def test_after_an_abort_the_last_attempt_counts():
    again = lane_over_time((1, 0), (3, 1), (4, 1), (6, 0), (8, 0), (10, 1), (16, 1), (18, 0))
    speed = np.where(np.arange(FRAMES) < 140, 20.0, 32.0)
    events = detect_events(again, AHEAD, speed=speed)
    assert events.num_attempts[0] == 2
    assert outcome_of(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.attempt[0] == pytest.approx(160, abs=3)


def test_an_ego_that_passes_and_stays_on_the_left_has_not_returned():
    assert outcome_of(detect_events(lane_over_time((3, 0), (6, 1)), AHEAD)) == (
        Outcome.NOT_COMPLETED,
        OutcomeDetail.PASSED_NOT_RETURNED,
    )


def test_an_overtake_that_the_horizon_cuts_off_is_open():
    events = detect_events(lane_over_time((3, 0), (6, 1)), Track(s=180.0, speed=20.0))
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.OPEN_AT_HORIZON)


def test_passing_two_vehicles_is_one_overtake_of_the_first():
    targets = (AHEAD, Track(s=80.0, speed=20.0))
    events = detect_events(lane_over_time((3, 0), (6, 1), (16, 1), (19, 0)), *targets)
    assert outcome_of(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.target_slot[0] == 1
    assert events.num_passed[0] == 2


def test_a_vehicle_that_cuts_in_before_the_attempt_becomes_the_target():
    cutting = Track(s=40.0, speed=20.0, lane=lane_over_time((0, 1), (2, 0)))
    assert detect_events(OUT_AND_BACK, AHEAD, cutting).target_slot[0] == 2


def test_a_vehicle_that_cuts_in_after_the_attempt_does_not_become_the_target():
    cutting = Track(s=40.0, speed=20.0, lane=lane_over_time((0, 1), (5, 1), (7, 0)))
    events = detect_events(OUT_AND_BACK, AHEAD, cutting)
    assert events.target_slot[0] == 1
    assert events.num_passed[0] == 2


def test_a_target_that_makes_room_to_the_right_is_still_overtaken():
    leaving = Track(s=60.0, speed=20.0, lane=lane_over_time((2.4, 1), (4.4, 0)))
    events = detect_events(lane_over_time((3, 1), (6, 2), (14, 2), (17, 1)), leaving)
    assert events.target_slot[0] == 1
    assert outcome_of(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)


def test_passing_on_the_right_without_moving_left_is_no_attempt():
    events = detect_events(
        lane_over_time((3, 1), (6, 0), (14, 0), (17, 1)), Track(s=60.0, speed=20.0, lane=1)
    )
    # The ego moves left only after it has passed; then no vehicle is ahead.
    assert outcome_of(events)[0] is Outcome.NO_ATTEMPT


def test_the_original_lane_is_the_lane_at_the_attempt():
    events = detect_events(
        lane_over_time((3, 1), (6, 2), (14, 2), (17, 1)), dataclasses.replace(AHEAD, lane=1)
    )
    assert events.original_lane[0] == 1
    assert outcome_of(events)[0] is Outcome.COMPLETED


def test_moving_two_lanes_out_and_back_is_one_overtake():
    events = detect_events(lane_over_time((2, 0), (7, 2), (14, 2), (19, 0)), AHEAD)
    assert outcome_of(events) == (Outcome.COMPLETED, OutcomeDetail.NONE)
    assert events.return_begin[0] == pytest.approx(280, abs=3)


def events_with_contact(ego_lane, partner: Track, frame: int, speed=28.0):
    """Events of an ego and another vehicle that touch from a frame on."""
    drive = case(Track(speed=speed, lane=ego_lane), partner, frames=FRAMES, road=ROAD)
    hit = drive.trajectories.collided_with.copy()
    hit[:, frame:] = 1
    return seen_case(drive.trajectories.replace(collided_with=hit)).events


def test_running_into_the_leader_before_any_attempt_is_a_collision():
    events = events_with_contact(0.0, AHEAD, frame=140)
    assert outcome_of(events) == (Outcome.COLLISION, OutcomeDetail.COLLISION_BEFORE_ATTEMPT)
    assert not events.was_struck[0]


def test_an_ego_hit_from_behind_was_struck():
    fast = Track(s=-100.0, speed=40.0, lane=1)
    events = events_with_contact(lane_over_time((3, 0), (6, 1)), fast, frame=150)
    # No vehicle is ahead, so the ego attempts no overtake; it is struck nevertheless.
    assert events.was_struck[0]


def test_an_ego_that_moves_into_a_vehicle_alongside_was_not_struck():
    beside = Track(s=62.0, speed=20.0, lane=1)
    events = events_with_contact(lane_over_time((7, 0), (9, 1)), beside, frame=158)
    assert not events.was_struck[0]


def test_a_collision_after_the_return_decides_the_outcome():
    events = events_with_contact(OUT_AND_BACK, AHEAD, frame=400)
    assert events.return_end[0] != NEVER
    assert outcome_of(events)[0] is Outcome.COLLISION


def test_no_event_after_a_collision_counts():
    events = events_with_contact(OUT_AND_BACK, AHEAD, frame=100)
    assert events.overlap_begin[0] == events.return_end[0] == NEVER
    assert outcome_of(events) == (Outcome.COLLISION, OutcomeDetail.RAN_INTO_OTHER)


def test_leaving_the_road_ends_the_overtake():
    events = detect_events(lane_over_time((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.DEPARTED)


def test_leaving_the_road_from_the_fastest_lane_is_no_attempt():
    events = detect_events(lane_over_time((3, 2), (8, 3.5)), dataclasses.replace(AHEAD, lane=2))
    assert outcome_of(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.DEPARTED)


def test_an_ego_that_begins_beside_the_lanes_has_not_left_them():
    events = detect_events(lane_over_time((0, 3.2), (3, 1.0)), dataclasses.replace(AHEAD, lane=2))
    assert events.road_departure[0] == NEVER
    assert outcome_of(events) == (Outcome.NO_ATTEMPT, OutcomeDetail.NONE)


def test_an_ego_that_stays_beside_the_lanes_has_not_left_them():
    events = detect_events(lane_over_time((0, 3.2), (3, 3.2)), dataclasses.replace(AHEAD, lane=2))
    assert events.road_departure[0] == NEVER


def test_an_ego_that_begins_beside_the_lanes_and_enters_them_can_leave_them_later():
    events = detect_events(
        lane_over_time((0, 3.2), (3, 1.0), (8, 3.5)), dataclasses.replace(AHEAD, lane=2)
    )
    assert 60 < events.road_departure[0] < 200
    assert outcome_of(events)[1] is OutcomeDetail.DEPARTED


def test_an_ego_whose_first_heading_is_across_the_road_has_not_spun():
    events = events_with_turn(1, 1.0, frame=0)
    assert events.spin[0] == NEVER


def events_with_turn(ego_lane, angle: float, frame: int, road: Road = ROAD):
    """Events of an ego that is turned to the left by an angle [rad] from a frame on."""
    drive = case(Track(speed=28.0, lane=ego_lane), AHEAD, frames=FRAMES, road=road)
    states = drive.trajectories.states
    along = float(road.heading)
    across = math.atan2(math.sin(along + angle), math.cos(along + angle))
    heading = np.full_like(states.heading, round(1e4 * along))
    heading[:, 0, frame:] = round(1e4 * across)
    return seen_case(drive.trajectories.replace(states=states.replace(heading=heading))).events


@pytest.mark.parametrize("angle", [1.0, -1.0])
@pytest.mark.parametrize("direction", [0.0, 3.1, -3.1])
def test_an_ego_across_the_road_has_spun_in_either_direction(angle, direction):
    road = dataclasses.replace(ROAD, heading=direction)
    events = events_with_turn(OUT_AND_BACK, angle, frame=150, road=road)
    assert events.spin[0] == 150
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.SPUN)
    assert events.return_end[0] == NEVER


def test_a_spin_begins_at_a_heading_of_0_8_rad_to_the_road():
    assert events_with_turn(OUT_AND_BACK, 0.79, frame=150).spin[0] == NEVER
    assert events_with_turn(OUT_AND_BACK, 0.81, frame=150).spin[0] == 150


def test_a_spin_before_any_attempt_is_no_attempt():
    assert outcome_of(events_with_turn(0.0, 1.0, frame=60)) == (
        Outcome.NO_ATTEMPT,
        OutcomeDetail.SPUN,
    )


def test_a_spin_after_the_return_decides_the_outcome():
    events = events_with_turn(OUT_AND_BACK, 1.0, frame=400)
    assert events.return_end[0] != NEVER
    assert outcome_of(events) == (Outcome.NOT_COMPLETED, OutcomeDetail.SPUN)


def test_the_earlier_one_of_spin_and_departure_decides_the_detail():
    events = detect_events(lane_over_time((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    off = int(events.road_departure[0])
    for spin, detail in ((off - 1, OutcomeDetail.SPUN), (off + 1, OutcomeDetail.DEPARTED)):
        spun_events = events.replace(spin=np.array([spin], np.int32))
        assert OutcomeDetail(int(outcome_details(spun_events, 50)[0])) is detail


def test_a_departure_with_a_contact_is_a_collision():
    events = detect_events(lane_over_time((3, 1), (8, 3.5)), dataclasses.replace(AHEAD, lane=1))
    events_with_collision = events.replace(collision=events.road_departure + np.int32(2))
    assert outcome_of(events_with_collision)[0] is Outcome.COLLISION


@pytest.mark.parametrize(
    ("begin", "end", "is_intended"),
    [(60, 100, True), (90, 100, False), (10, 40, False), (70, 71, True)],
)
def test_an_attempt_is_intended_if_the_driver_pulls_out_before_the_line_crossing(
    begin, end, is_intended
):
    drive = case(Track(speed=28.0, lane=OUT_AND_BACK), AHEAD, frames=FRAMES, road=ROAD)
    assert drive.events.attempt[0] < 70 < drive.events.line_crossed[0] < 90
    stage = drive.trajectories.stage.copy()
    stage[:, begin:end] = Stage.PULL_OUT
    assert seen_case(drive.trajectories.replace(stage=stage)).events.was_intended[0] == is_intended


def test_without_an_attempt_there_is_no_intention():
    drive = case(Track(speed=20.0), AHEAD, frames=FRAMES, road=ROAD)
    pulling_out = drive.trajectories.replace(
        stage=np.full_like(drive.trajectories.stage, Stage.PULL_OUT)
    )
    assert not seen_case(pulling_out).events.was_intended[0]


def test_following_begins_when_the_time_gap_falls_below_three_seconds():
    events = detect_events(0.0, Track(s=124.4, speed=20.0), speed=30.0)
    # From a gap of 120 m, 90 m are left after 3 s at 10 m/s.
    assert events.following_begin[0] == pytest.approx(60, abs=1)
