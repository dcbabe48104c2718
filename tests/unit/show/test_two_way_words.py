"""What `show` says of an overtake against oncoming traffic."""

from __future__ import annotations

from tests.support.overtakes import meeting, overtake, rural

from overtaking.labels.label import label
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
    assert values["oncoming"]["time_back_s"] is None


def test_of_a_road_of_one_direction_nothing_is_added():
    values = describe(label(overtake().trajectories), 0)
    assert "oncoming" not in values
    assert "is_two_way" not in values["road"]
