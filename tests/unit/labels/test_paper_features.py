"""The paper's features of overtakes that are drawn by hand, under both readings."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.cases import NIGHT, Track, case, ramp
from tests.support.worlds import wide_road

from overtaking import label, sample, simulate
from overtaking.labels.paper_features import matched_features, paper_features, pseudo_attempt
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import VehicleKind

FRAMES = 500
ROAD = wide_road(lanes=3)
WAY = ramp((3, 0), (6, 1), (14, 1), (17, 0), frames=FRAMES)
BODY = {"length": 4.0, "width": 1.8}


def overtake(*others: Track, **options):
    ego = Track(kind="L", speed=28.0, lane=WAY, body=BODY)
    target = Track(kind="T", s=60.0, speed=20.0, body=BODY)
    return case(ego, target, *others, frames=FRAMES, road=ROAD, **options)


def waiting(*others: Track, **options):
    """An ego that follows a slower leader for 5 s without an attempt."""
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=18.0, body=BODY)
    return case(ego, target, *others, frames=101, road=ROAD, **options)


def value(features, name: str) -> float:
    return float(getattr(features, name)[0])


def test_the_features_of_the_paper_describe_an_overtake_at_its_attempt():
    drive = overtake()
    features = paper_features(drive)
    attempt_frame, return_frame = int(drive.events.attempt[0]), int(drive.events.return_end[0])
    assert value(features, "waiting_time") == pytest.approx(attempt_frame * 0.05)
    assert value(features, "overtaking_time") == pytest.approx(
        (return_frame - attempt_frame) * 0.05
    )
    assert value(features, "ego_speed") == pytest.approx(28.0)
    assert value(features, "target_speed") == pytest.approx(20.0)
    assert value(features, "speed_difference") == pytest.approx(8.0)
    assert value(features, "distance") == pytest.approx(60.0 - 8.0 * attempt_frame * 0.05, abs=0.01)
    assert (features.ego_kind[0], features.target_kind[0]) == (
        VehicleKind.LARGE_CAR,
        VehicleKind.TRUCK,
    )
    assert features.num_vehicles[0] == 2


def test_the_papers_occupancy_counts_vehicles_in_the_lane_to_the_left():
    others = [Track(s=s, lane=lane, speed=20.0) for s, lane in ((200.0, 1), (-200.0, 1), (0.0, 2))]
    assert value(paper_features(overtake(*others)), "left_occupancy") == pytest.approx(2 / 4)


def test_the_features_of_the_paper_are_averages_without_an_attempt():
    features = paper_features(waiting())
    assert value(features, "waiting_time") == pytest.approx(5.0)
    assert value(features, "overtaking_time") == 0.0
    # From 34 m to 24 m in 5 s.
    assert value(features, "distance") == pytest.approx(29.0, abs=0.01)
    assert value(features, "speed_difference") == pytest.approx(2.0)
    assert features.frame[0] == NEVER


def test_only_the_matched_difference_of_speeds_has_a_sign():
    ego, target = Track(speed=18.0, body=BODY), Track(s=34.0, speed=20.0, body=BODY)
    drive = case(ego, target, frames=101, road=ROAD)
    assert value(paper_features(drive), "speed_difference") == pytest.approx(2.0)
    assert value(matched_features(drive), "speed_difference") == pytest.approx(-2.0)


def test_the_matched_waiting_time_begins_when_the_ego_closes_up():
    ego = Track(speed=28.0, lane=ramp((8, 0), (11, 1), frames=FRAMES), body=BODY)
    target = Track(s=130.0, speed=20.0, body=BODY)
    drive = case(ego, target, frames=FRAMES, road=ROAD)
    features = matched_features(drive)
    # Following begins at a time gap of 3 s, which is 84 m, after 42 m of closing.
    assert drive.events.following_begin[0] == pytest.approx(20 * (130 - 4 - 84) / 8, abs=2)
    waited = (drive.events.attempt[0] - drive.events.following_begin[0]) * 0.05
    assert value(features, "waiting_time") == pytest.approx(waited)
    gap = 130.0 - 4.0 - 8.0 * drive.events.attempt[0] * 0.05
    assert value(features, "distance") == pytest.approx(gap, abs=0.01)


def test_the_matched_occupancy_is_a_share_of_the_road_length():
    beside = Track(s=20.0, lane=1, speed=28.0, body={"length": 5.0})
    assert value(matched_features(overtake(beside)), "left_occupancy") == pytest.approx(5 / 200)


def test_without_a_target_features_are_finite_and_mark_no_target():
    drive = case(Track(speed=20.0), Track(s=-50.0, speed=18.0), frames=101, road=ROAD)
    for features in (paper_features(drive), matched_features(drive)):
        assert not features.has_target[0]
        assert np.isfinite(features.distance).all()


def test_weather_and_light_come_from_the_scenario():
    features = paper_features(overtake(weather=NIGHT | {"rain": 30.0, "wind": 40.0, "fog": 50.0}))
    assert features.night[0]
    assert not features.low_sun[0]
    assert (features.rain[0], features.wind[0], features.fog[0]) == (30.0, 40.0, 50.0)


def test_the_pseudo_attempt_lies_within_the_time_of_following():
    drive = waiting()
    frame = pseudo_attempt(drive)[0]
    assert drive.events.following_begin[0] <= frame <= drive.events.last[0]
    assert pseudo_attempt(overtake())[0] == NEVER


@pytest.mark.parametrize(
    ("profile", "seconds"),
    [("pinto2023", 7.5), pytest.param("motorway", 45.0, marks=pytest.mark.ci)],
)
def test_the_pseudo_attempt_comes_as_late_as_the_attempts_of_the_profile(
    profile: str, seconds: float
):
    labelled = label(simulate(sample(profile, num_simulations=400, seed=3)))
    has_attempt, waiting_time = labelled.events.has_attempt, labelled.matched_features.waiting_time
    early, late = np.quantile(waiting_time[has_attempt], [0.25, 0.75])
    followed_long = labelled.events.last - labelled.events.following_begin >= seconds / 0.05
    could_wait = ~has_attempt & (labelled.events.following_begin != NEVER) & followed_long
    assert could_wait.sum() > 20
    assert early <= np.median(waiting_time[could_wait]) <= late
