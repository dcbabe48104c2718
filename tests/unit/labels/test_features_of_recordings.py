"""Features of recordings in which vehicles enter and leave the view."""

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
def labelled_recording(tmp_path):
    """A function that labels the first simulation of a recording of given movers."""

    def label_movers(*movers):
        path = tmp_path / "scene.xml"
        path.write_text(commonroad(movers), encoding="utf-8")
        recorded_scenes = scenes(read_commonroad(path))
        return label(recorded_scenes.trajectories(range(1)))

    return label_movers


def features(labelled, reading: str) -> dict:
    rows = encode_labels(labelled, np.arange(1))["features"].to_pylist()
    return next(row for row in rows if row["reading"] == reading)


@pytest.mark.parametrize("reading", ["paper", "matched"])
def test_a_track_that_begins_within_a_lane_change_has_no_waiting_time_and_no_gap(
    labelled_recording, reading
):
    labelled = labelled_recording(replace(EGO, first=36), TARGET, BEHIND, FAR)
    assert labelled.events.attempt[0] == labelled.events.began_before_recording[0] == 0
    row = features(labelled, reading)
    assert row["WT_s"] is row["OT_s"] is row["D_m"] is None
    assert row["SP_mps"] == pytest.approx(24.0, abs=0.1)
    assert encode_labels(labelled, np.arange(1))["attempts"]["waiting_time_s"].to_pylist() == [None]
    events = encode_labels(labelled, np.arange(1))["events"]["event"].to_pylist()
    assert {"attempt", "began_before_recording"} <= set(events)


def test_a_track_that_begins_before_the_lane_change_has_a_waiting_time_and_a_gap(
    labelled_recording,
):
    labelled = labelled_recording(*OVERTAKE)
    assert labelled.events.began_before_recording[0] == NEVER
    row = features(labelled, "paper")
    assert row["WT_s"] > 1.0
    assert row["D_m"] > 40.0


@pytest.mark.ci
def test_without_a_target_the_gap_is_zero(labelled_recording):
    labelled = labelled_recording(*OVERTAKE)
    events_without_target = labelled.events.replace(
        target_slot=np.array([255], np.uint8),
        attempt=np.array([NEVER]),
        following_begin=np.zeros(1, np.int32),
    )
    features_without_target = features_of(labelled, events_without_target)
    assert (
        features_without_target.distance[0]
        == features_without_target.target_speed[0]
        == features_without_target.speed_difference[0]
        == 0.0
    )


def test_the_gap_to_a_target_that_is_no_longer_recorded_is_unknown(labelled_recording):
    labelled = labelled_recording(*OVERTAKE)
    is_recorded = labelled.trajectories.state_mask.copy()
    is_recorded[:, 1] = False
    trajectories = labelled.trajectories.replace(is_recorded=is_recorded)
    events = labelled.events.replace(attempt=np.array([NEVER]))
    features_without_track = features_of(labelled, events, trajectories)
    assert np.isnan(
        [
            features_without_track.distance[0],
            features_without_track.target_speed[0],
            features_without_track.speed_difference[0],
        ]
    ).all()


def test_a_leader_that_is_no_longer_recorded_is_not_overtaken(labelled_recording):
    trajectories = labelled_recording(*OVERTAKE).trajectories
    is_recorded = trajectories.state_mask.copy()
    is_recorded[0, 1:, 20:] = False
    assert (
        case_from_trajectories(trajectories.replace(is_recorded=is_recorded)).events.attempt[0]
        == NEVER
    )


def features_of(labelled, events, trajectories=None):
    """The matched features of a recording with other events."""
    return matched_features(
        with_events(case_from_trajectories(trajectories or labelled.trajectories), events)
    )
