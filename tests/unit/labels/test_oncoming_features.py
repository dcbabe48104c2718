"""Measures against oncoming traffic, by hand."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.cases import ramp
from tests.support.overtakes import FRAMES, along_course, meeting, overtake, rural

from overtaking.labels.attempt_features import attempt_features
from overtaking.labels.safety_features import oncoming_measures
from overtaking.model.road import RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse
from overtaking.model.vehicles import VehicleKind

if TYPE_CHECKING:
    from overtaking.model.overtake_features import OncomingState


def told(case) -> dict[str, float]:
    found = oncoming_measures(case)
    return {
        one.name: float(getattr(found, one.name)[0])
        for one in dataclasses.fields(found)
        if isinstance(getattr(found, one.name), np.ndarray)
    }


def test_distances_and_times_are_those_of_two_vehicles_that_drive_evenly():
    # 30 m/s against 20 m/s; over the line from frame 76 to 334, alongside from frame 241 on.
    found = told(rural(meeting(60.0)))
    assert found["gap_at_return"] == pytest.approx(60.0 + 50.0 * 0.05, abs=0.01)
    assert found["gap_abreast"] == pytest.approx(60.0 + 50.0 * (335 - 241) * 0.05, abs=0.01)
    assert found["gap_at_crossing"] == pytest.approx(60.0 + 50.0 * (335 - 76) * 0.05, abs=0.01)
    for name in ("at_crossing", "abreast", "at_return"):
        time = found[f"time_to_meet_{name}"]
        assert time == pytest.approx(found[f"gap_{name}"] / 50.0, rel=1e-5)
    assert found["min_time_to_meet"] == pytest.approx(found["time_to_meet_at_return"], rel=1e-5)
    assert found["time_in_opposing_lane"] == pytest.approx((334 - 76) * 0.05)


def test_an_unseen_road_counts_as_somebody_at_the_limit():
    found = told(along_course(RoadCourse(sight=((0.0, 400.0),))))
    assert found["sight_at_crossing"] == 400.0
    assert found["time_available"] == pytest.approx(400.0 / (30.0 + 25.0))
    assert np.isnan([found["gap_at_crossing"], found["min_time_to_meet"]]).all()


def test_who_is_met_sooner_than_sight_ends_decides():
    found = told(rural(meeting(60.0)))
    assert found["time_available"] == pytest.approx(found["time_to_meet_at_crossing"])


def test_who_has_gone_by_is_not_met_again():
    found = told(rural(meeting(-500.0)))
    assert np.isnan(found["gap_at_return"])
    assert found["gap_at_crossing"] > 0.0


@pytest.mark.parametrize("make", [overtake, lambda: rural(ego={"lane": 0.0})])
def test_without_the_other_side_nothing_is_measured(make):
    found = told(make())
    assert not found.pop("was_in_opposing_lane")
    assert not found.pop("was_aborted")
    assert np.isnan(list(found.values())).all()


def test_who_falls_back_behind_its_target_has_given_up():
    away = ramp((3, 0), (6, 1), (7, 1), (10, 0), frames=FRAMES)
    found = told(rural(meeting(60.0), ego={"lane": away, "speed": 21.0}))
    assert found["was_in_opposing_lane"]
    assert found["was_aborted"]
    assert np.isnan(found["time_to_meet_abreast"])
    assert not told(rural(meeting(60.0)))["was_aborted"]


def test_who_comes_is_known_when_the_overtake_begins():
    one = rural(meeting(60.0, kind="MC"))
    found, frame = attempt_features(one).oncoming, int(one.events.attempt[0])
    gap = 60.0 + 50.0 * (335 - frame) * 0.05
    # It is as long as a motorcycle, and `meeting` places the centre of a car of 4.4 m.
    gap += 0.5 * (4.4 - float(one.trajectories.scenario.vehicles.length[0, 2]))
    assert found.exists[0]
    assert found.has_oncoming[0]
    assert found.kind[0] == VehicleKind.MOTORCYCLE
    assert found.gap[0] == pytest.approx(gap, abs=0.01)
    assert found.closing_speed[0] == pytest.approx(50.0, rel=1e-5)
    assert found.time[0] == pytest.approx(gap / 50.0, abs=1e-3)


def test_the_line_and_the_sight_are_those_of_the_place():
    def at_the_attempt(course: RoadCourse) -> OncomingState:
        return attempt_features(along_course(course)).oncoming

    def solid(start: float) -> CentreLineSpan:
        return CentreLineSpan(mark=RoadMark.SOLID, start=start, stop=400.0)

    # The attempt begins at 100 m; the ego is over the line beyond 114 m.
    ahead, here = (
        at_the_attempt(RoadCourse(centre_line_spans=(solid(start),))) for start in (110.0, 80.0)
    )
    assert ahead.crossable[0]
    assert not ahead.has_oncoming[0]
    assert not here.crossable[0]
    assert at_the_attempt(RoadCourse(sight=((0.0, 400.0),))).sight[0] == 400.0


def test_a_road_of_one_direction_has_no_other_side():
    assert not attempt_features(overtake()).oncoming.exists[0]
