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


def measures_of(case) -> dict[str, float]:
    """The measures against oncoming traffic of the only simulation, by name."""
    features = oncoming_measures(case)
    return {
        field.name: float(getattr(features, field.name)[0])
        for field in dataclasses.fields(features)
        if isinstance(getattr(features, field.name), np.ndarray)
    }


def test_gaps_and_times_to_meet_of_two_vehicles_at_constant_speeds():
    # 30 m/s against 20 m/s; over the line from frame 76 to 334, alongside from frame 241 on.
    measures = measures_of(rural(meeting(60.0)))
    assert measures["gap_at_return"] == pytest.approx(60.0 + 50.0 * 0.05, abs=0.01)
    assert measures["gap_abreast"] == pytest.approx(60.0 + 50.0 * (335 - 241) * 0.05, abs=0.01)
    assert measures["gap_at_crossing"] == pytest.approx(60.0 + 50.0 * (335 - 76) * 0.05, abs=0.01)
    for name in ("at_crossing", "abreast", "at_return"):
        time = measures[f"time_to_meet_{name}"]
        assert time == pytest.approx(measures[f"gap_{name}"] / 50.0, rel=1e-5)
    assert measures["min_time_to_meet"] == pytest.approx(
        measures["time_to_meet_at_return"], rel=1e-5
    )
    assert measures["time_in_opposing_lane"] == pytest.approx((334 - 76) * 0.05)


def test_an_unseen_road_counts_as_an_oncoming_vehicle_at_the_speed_limit():
    measures = measures_of(along_course(RoadCourse(sight=((0.0, 400.0),))))
    assert measures["sight_at_crossing"] == 400.0
    assert measures["time_available"] == pytest.approx(400.0 / (30.0 + 25.0))
    assert np.isnan([measures["gap_at_crossing"], measures["min_time_to_meet"]]).all()


def test_an_oncoming_vehicle_in_sight_decides_the_time_available():
    measures = measures_of(rural(meeting(60.0)))
    assert measures["time_available"] == pytest.approx(measures["time_to_meet_at_crossing"])


def test_a_vehicle_that_has_passed_the_ego_is_no_longer_oncoming():
    measures = measures_of(rural(meeting(-500.0)))
    assert np.isnan(measures["gap_at_return"])
    assert measures["gap_at_crossing"] > 0.0


@pytest.mark.parametrize("make", [overtake, lambda: rural(ego={"lane": 0.0})])
def test_without_driving_in_the_opposing_lane_there_are_no_measures(make):
    measures = measures_of(make())
    assert not measures.pop("was_in_opposing_lane")
    assert not measures.pop("was_aborted")
    assert np.isnan(list(measures.values())).all()


def test_an_ego_that_falls_back_behind_its_target_has_aborted():
    lane = ramp((3, 0), (6, 1), (7, 1), (10, 0), frames=FRAMES)
    measures = measures_of(rural(meeting(60.0), ego={"lane": lane, "speed": 21.0}))
    assert measures["was_in_opposing_lane"]
    assert measures["was_aborted"]
    assert np.isnan(measures["time_to_meet_abreast"])
    assert not measures_of(rural(meeting(60.0)))["was_aborted"]


def test_features_of_the_attempt_describe_the_oncoming_vehicle():
    drive = rural(meeting(60.0, kind="MC"))
    features, frame = attempt_features(drive).oncoming, int(drive.events.attempt[0])
    gap = 60.0 + 50.0 * (335 - frame) * 0.05
    # The oncoming vehicle is a motorcycle, and `meeting` places the centre of a car of 4.4 m.
    gap += 0.5 * (4.4 - float(drive.trajectories.scenario.vehicles.length[0, 2]))
    assert features.exists[0]
    assert features.has_oncoming[0]
    assert features.kind[0] == VehicleKind.MOTORCYCLE
    assert features.gap[0] == pytest.approx(gap, abs=0.01)
    assert features.closing_speed[0] == pytest.approx(50.0, rel=1e-5)
    assert features.time[0] == pytest.approx(gap / 50.0, abs=1e-3)


def test_features_of_the_attempt_have_the_line_and_the_sight_at_the_ego():
    def at_the_attempt(course: RoadCourse) -> OncomingState:
        return attempt_features(along_course(course)).oncoming

    def solid(start: float) -> CentreLineSpan:
        return CentreLineSpan(mark=RoadMark.SOLID, start=start, stop=400.0)

    # The attempt begins at 100 m; the ego is over the line beyond 114 m.
    before_line, at_line = (
        at_the_attempt(RoadCourse(centre_line_spans=(solid(start),))) for start in (110.0, 80.0)
    )
    assert before_line.crossable[0]
    assert not before_line.has_oncoming[0]
    assert not at_line.crossable[0]
    assert at_the_attempt(RoadCourse(sight=((0.0, 400.0),))).sight[0] == 400.0


def test_a_road_of_one_direction_has_no_oncoming_traffic():
    assert not attempt_features(overtake()).oncoming.exists[0]
