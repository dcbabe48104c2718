"""Measures against oncoming traffic, by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.overtakes import along_course, meeting, overtake, rural

from overtaking.labels.features.oncoming import oncoming_measures
from overtaking.model.course import Course


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
    assert found["distance_back"] == pytest.approx(60.0 + 50.0 * 0.05, abs=0.01)
    assert found["distance_abreast"] == pytest.approx(60.0 + 50.0 * (335 - 241) * 0.05, abs=0.01)
    assert found["distance_out"] == pytest.approx(60.0 + 50.0 * (335 - 76) * 0.05, abs=0.01)
    for name in ("out", "abreast", "back"):
        assert found[f"time_{name}"] == pytest.approx(found[f"distance_{name}"] / 50.0, rel=1e-5)
    assert found["least_time"] == pytest.approx(found["time_back"], rel=1e-5)
    assert found["time_needed"] == pytest.approx((334 - 76) * 0.05)


def test_an_unseen_road_counts_as_somebody_at_the_limit():
    found = told(along_course(Course(sight=((0.0, 400.0),))))
    assert found["sight_out"] == 400.0
    assert found["time_available"] == pytest.approx(400.0 / (30.0 + 25.0))
    assert np.isnan([found["distance_out"], found["least_time"]]).all()


def test_who_is_met_sooner_than_sight_ends_decides():
    found = told(rural(meeting(60.0)))
    assert found["time_available"] == pytest.approx(found["time_out"])


def test_who_has_gone_by_is_not_met_again():
    found = told(rural(meeting(-500.0)))
    assert np.isnan(found["distance_back"])
    assert found["distance_out"] > 0.0


@pytest.mark.parametrize("make", [overtake, lambda: rural(ego={"lane": 0.0})])
def test_without_the_other_side_nothing_is_measured(make):
    assert np.isnan(list(told(make()).values())).all()
