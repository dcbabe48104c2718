"""What `show` says of an overtake against oncoming traffic, and of limits that change."""

from __future__ import annotations

from tests.support.overtakes import alone, limited, meeting, overtake, rural

from overtaking.labels.labelling import label
from overtaking.show import wording
from overtaking.show.description import describe


def test_road_and_ending_tell_of_oncoming_traffic():
    values = describe(label(rural(meeting(60.0)).trajectories), 0)
    assert "lane -1, oncoming traffic beside it" in wording.road_words(values["road"])
    ending = "\n".join(wording.ending_words(values))
    assert "On the other side for 12.9 s; traffic came from 708 m away" in ending
    assert "62 m (1.2 s) were left." in ending


def test_without_oncoming_traffic_sight_is_told():
    values = describe(label(rural().trajectories), 0)
    assert "nobody came, and the road was in sight for" in wording.ending_words(values)[1]
    assert values["oncoming"]["time_to_meet_at_return_s"] is None


def test_of_a_road_of_one_direction_nothing_is_added():
    values = describe(label(overtake().trajectories), 0)
    assert "oncoming" not in values
    assert "is_two_way" not in values["road"]


def test_limits_that_change_are_told_with_their_stretches():
    run = label(alone(road=limited((150.0, 200.0, 60.0), (200.0, 300.0, 80.0))).trajectories)
    road = describe(run, 0)["road"]
    assert [(one["from_m"], one["to_m"]) for one in road["lower_limits"]] == [
        (150, 200),
        (200, 300),
    ]
    assert "limit 120 km/h, in places lower, down to 60, right-hand" in wording.road_words(road)
    hidden = alone(road=limited((150.0, 200.0, 60.0)), unknown=("speed_limit",)).trajectories
    assert "lower_limits" not in describe(label(hidden), 0)["road"]
    assert "lower_limits" not in describe(label(overtake().trajectories), 0)["road"]
