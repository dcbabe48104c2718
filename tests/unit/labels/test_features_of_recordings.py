"""What is measured of recordings in which vehicles come and go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.cases import with_events
from tests.support.recordings import OVERTAKE, commonroad

from overtaking.data.tables.encode_labels import encode_labels
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.labelling import label
from overtaking.labels.paper_features import matched_features
from overtaking.model.overtake_events import NEVER
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.scenes import scenes

EGO, TARGET, BEHIND, FAR = OVERTAKE


@pytest.fixture
def judged(tmp_path):
    """The first simulation of a made-up recording."""

    def _judged(*movers):
        path = tmp_path / "scene.xml"
        path.write_text(commonroad(movers), encoding="utf-8")
        found = scenes(read_commonroad(path))
        return label(found.trajectories(range(1)))

    return _judged


def features(labelled, reading: str) -> dict:
    rows = encode_labels(labelled, np.arange(1))["features"].to_pylist()
    return next(row for row in rows if row["reading"] == reading)


@pytest.mark.parametrize("reading", ["paper", "matched"])
def test_a_track_that_begins_within_a_change_has_no_waiting_time_and_no_gap(judged, reading):
    found = judged(replace(EGO, first=36), TARGET, BEHIND, FAR)
    assert found.events.attempt[0] == found.events.began_before_recording[0] == 0
    said = features(found, reading)
    assert said["WT_s"] is said["OT_s"] is said["D_m"] is None
    assert said["SP_mps"] == pytest.approx(24.0, abs=0.1)
    assert encode_labels(found, np.arange(1))["attempts"]["waiting_time_s"].to_pylist() == [None]
    events = encode_labels(found, np.arange(1))["events"]["event"].to_pylist()
    assert {"attempt", "began_before_recording"} <= set(events)


def test_a_track_that_begins_before_has_them(judged):
    found = judged(*OVERTAKE)
    assert found.events.began_before_recording[0] == NEVER
    said = features(found, "paper")
    assert said["WT_s"] > 1.0
    assert said["D_m"] > 40.0


@pytest.mark.ci
def test_without_anybody_ahead_the_gap_is_zero(judged):
    found = judged(*OVERTAKE)
    alone = found.events.replace(
        target_slot=np.array([255], np.uint8),
        attempt=np.array([NEVER]),
        following_begin=np.zeros(1, np.int32),
    )
    nobody = features_of(found, alone)
    assert nobody.distance[0] == nobody.target_speed[0] == nobody.speed_difference[0] == 0.0


def test_the_gap_to_somebody_who_is_no_longer_there_is_unknown(judged):
    found = judged(*OVERTAKE)
    present = found.trajectories.state_mask.copy()
    present[:, 1] = False
    run = found.trajectories.replace(is_recorded=present)
    waiting = found.events.replace(attempt=np.array([NEVER]))
    gone = features_of(found, waiting, run)
    assert np.isnan([gone.distance[0], gone.target_speed[0], gone.speed_difference[0]]).all()


def test_a_leader_that_is_no_longer_recorded_is_not_overtaken(judged):
    run = judged(*OVERTAKE).trajectories
    present = run.state_mask.copy()
    present[0, 1:, 20:] = False
    assert case_from_trajectories(run.replace(is_recorded=present)).events.attempt[0] == NEVER


def features_of(found, events, run=None):
    """The matched features if these were the events."""
    return matched_features(with_events(case_from_trajectories(run or found.trajectories), events))
