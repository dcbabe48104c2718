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


def overtake(*others: Track, **given):
    ego = Track(kind="L", speed=28.0, lane=WAY, body=BODY)
    target = Track(kind="T", s=60.0, speed=20.0, body=BODY)
    return case(ego, target, *others, frames=FRAMES, road=ROAD, **given)


def waiting(*others: Track, **given):
    """Behind somebody at the same speed, for ever."""
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=18.0, body=BODY)
    return case(ego, target, *others, frames=101, road=ROAD, **given)


def value(features, name: str) -> float:
    return float(getattr(features, name)[0])


def test_the_paper_measures_an_overtake_where_it_begins():
    one = overtake()
    found = paper_features(one)
    begun, back = int(one.events.attempt[0]), int(one.events.return_end[0])
    assert value(found, "waiting_time") == pytest.approx(begun * 0.05)
    assert value(found, "overtaking_time") == pytest.approx((back - begun) * 0.05)
    assert value(found, "ego_speed") == pytest.approx(28.0)
    assert value(found, "target_speed") == pytest.approx(20.0)
    assert value(found, "speed_difference") == pytest.approx(8.0)
    assert value(found, "distance") == pytest.approx(60.0 - 8.0 * begun * 0.05, abs=0.01)
    assert (found.ego_kind[0], found.target_kind[0]) == (VehicleKind.LARGE_CAR, VehicleKind.TRUCK)
    assert found.num_vehicles[0] == 2


def test_the_papers_occupancy_counts_vehicles_in_the_lane_to_the_left():
    others = [Track(s=s, lane=lane, speed=20.0) for s, lane in ((200.0, 1), (-200.0, 1), (0.0, 2))]
    assert value(paper_features(overtake(*others)), "left_occupancy") == pytest.approx(2 / 4)


def test_the_paper_averages_where_nothing_is_attempted():
    found = paper_features(waiting())
    assert value(found, "waiting_time") == pytest.approx(5.0)
    assert value(found, "overtaking_time") == 0.0
    # From 34 m to 24 m in 5 s.
    assert value(found, "distance") == pytest.approx(29.0, abs=0.01)
    assert value(found, "speed_difference") == pytest.approx(2.0)
    assert found.frame[0] == NEVER


def test_the_difference_of_speeds_has_a_sign_only_when_matched():
    ego, target = Track(speed=18.0, body=BODY), Track(s=34.0, speed=20.0, body=BODY)
    one = case(ego, target, frames=101, road=ROAD)
    assert value(paper_features(one), "speed_difference") == pytest.approx(2.0)
    assert value(matched_features(one), "speed_difference") == pytest.approx(-2.0)


def test_matched_features_count_from_the_time_of_closing_up():
    ego = Track(speed=28.0, lane=ramp((8, 0), (11, 1), frames=FRAMES), body=BODY)
    target = Track(s=130.0, speed=20.0, body=BODY)
    one = case(ego, target, frames=FRAMES, road=ROAD)
    found = matched_features(one)
    # 84 m of gap are 3 s: reached 42 m of closing later.
    assert one.events.following_begin[0] == pytest.approx(20 * (130 - 4 - 84) / 8, abs=2)
    waited = (one.events.attempt[0] - one.events.following_begin[0]) * 0.05
    assert value(found, "waiting_time") == pytest.approx(waited)
    gap = 130.0 - 4.0 - 8.0 * one.events.attempt[0] * 0.05
    assert value(found, "distance") == pytest.approx(gap, abs=0.01)


def test_matched_occupancy_is_a_share_of_the_road():
    beside = Track(s=20.0, lane=1, speed=28.0, body={"length": 5.0})
    assert value(matched_features(overtake(beside)), "left_occupancy") == pytest.approx(5 / 200)


def test_without_a_target_nothing_is_said_of_one():
    one = case(Track(speed=20.0), Track(s=-50.0, speed=18.0), frames=101, road=ROAD)
    for found in (paper_features(one), matched_features(one)):
        assert not found.has_target[0]
        assert np.isfinite(found.distance).all()


def test_weather_and_light_are_those_of_the_scenario():
    found = paper_features(overtake(weather=NIGHT | {"rain": 30.0, "wind": 40.0, "fog": 50.0}))
    assert found.night[0]
    assert not found.low_sun[0]
    assert (found.rain[0], found.wind[0], found.fog[0]) == (30.0, 40.0, 50.0)


def test_the_stand_in_for_an_attempt_lies_within_the_time_of_following():
    one = waiting()
    frame = pseudo_attempt(one)[0]
    assert one.events.following_begin[0] <= frame <= one.events.last[0]
    assert pseudo_attempt(overtake())[0] == NEVER


@pytest.mark.parametrize(
    ("profile", "seconds"),
    [("pinto2023", 7.5), pytest.param("motorway", 45.0, marks=pytest.mark.ci)],
)
def test_the_stand_in_comes_as_late_as_the_attempts_of_the_profile(profile: str, seconds: float):
    found = label(simulate(sample(profile, num_simulations=400, seed=3)))
    attempted, waited = found.events.has_attempt, found.matched_features.waiting_time
    early, late = np.quantile(waited[attempted], [0.25, 0.75])
    followed = found.events.last - found.events.following_begin >= seconds / 0.05
    could_wait = ~attempted & (found.events.following_begin != NEVER) & followed
    assert could_wait.sum() > 20
    assert early <= np.median(waited[could_wait]) <= late
