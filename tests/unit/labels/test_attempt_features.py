"""Features of the decision to overtake, and their independence of later frames."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.cases import Belief, Track, case, ramp, with_events
from tests.support.worlds import wide_road

import overtaking as ot
from overtaking.data.tables.encode_labels import attempts as attempts_table
from overtaking.labels.attempt_features import attempt_features, attempt_features_at
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.labelling import label
from overtaking.model.batch import Batch
from overtaking.model.vehicles import EGO_SLOT, VehicleKind

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

FRAMES = 500
ROAD = wide_road(lanes=3)
LANE_OVER_TIME = ramp((3, 0), (6, 1), (14, 1), (17, 0), frames=FRAMES)
BODY = {"length": 4.0, "width": 1.8}
OVERWRITTEN = 7
"""Value of every state after the frame of the decision, in the test of independence."""


def overtake(*others: Track, **options) -> Case:
    ego = Track(speed=28.0, lane=LANE_OVER_TIME, body=BODY)
    target = Track(kind="T", s=60.0, speed=20.0, body=BODY)
    return case(ego, target, *others, frames=FRAMES, road=ROAD, **options)


def leaves(batch: Batch, path: str = "") -> dict[str, np.ndarray]:
    """Every array of a batch, by its dotted name."""
    arrays: dict[str, np.ndarray] = {}
    for field in dataclasses.fields(batch):  # type: ignore[arg-type]
        value = getattr(batch, field.name)
        if isinstance(value, Batch):
            arrays |= leaves(value, f"{path}{field.name}.")
        else:
            arrays[path + field.name] = value
    return arrays


def overwrite_after(original: Case, frame: np.ndarray) -> Case:
    """The case up to a frame of each simulation, with other values in all later frames."""
    trajectories = original.trajectories
    later = np.arange(trajectories.stage.shape[1]) > frame[:, None]
    states = trajectories.states.replace(
        **{
            field.name: np.where(
                later[:, None], OVERWRITTEN, getattr(trajectories.states, field.name)
            ).astype(getattr(trajectories.states, field.name).dtype)
            for field in dataclasses.fields(trajectories.states)
        }
    )
    percepts = trajectories.percepts
    now = frame[:, None] * trajectories.scenario.frame_interval_ms
    percepts = percepts.replace(valid=percepts.valid & (percepts.time <= now))
    truncated = trajectories.replace(
        states=states,
        percepts=percepts,
        num_frames=(frame + 1).astype(trajectories.num_frames.dtype),
    )
    return with_events(case_from_trajectories(truncated), original.events)


@pytest.fixture(scope="module")
def simulated() -> Case:
    return case_from_trajectories(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=96, seed=3))
    )


def test_no_feature_of_the_attempt_depends_on_later_frames(simulated):
    features = attempt_features(simulated)
    truncated = overwrite_after(simulated, features.frame)
    before, after = leaves(features), leaves(attempt_features_at(truncated, features.frame))
    assert {name for name in before if not np.array_equal(before[name], after[name])} == set()


def test_overwriting_later_frames_changes_signals_that_use_them(simulated):
    frame = attempt_features(simulated).frame
    truncated, rows = overwrite_after(simulated, frame), np.arange(len(frame))
    speeds = (recorded.signals.lateral_speed[rows, frame] for recorded in (simulated, truncated))
    assert not np.array_equal(*speeds)


def test_features_describe_ego_and_leader_at_the_attempt():
    drive = overtake()
    features, frame = attempt_features(drive), int(drive.events.attempt[0])
    gap = 60.0 - 8.0 * frame * 0.05 - 4.0
    assert features.frame[0] == frame
    assert features.leader.kind[0] == VehicleKind.TRUCK
    assert features.leader.speed[0] == pytest.approx(20.0)
    assert features.leader.encounter.gap[0] == pytest.approx(gap, abs=2e-3)
    assert features.leader.encounter.ttc[0] == pytest.approx(gap / 8.0, rel=1e-3)
    assert features.leader.looming[0] == pytest.approx(1.8 * 8.0 / (gap**2 + 0.81), rel=1e-3)
    assert features.leader.length[0] == 4.0
    assert not features.leader.has_next_leader[0]


def test_the_return_gap_is_between_the_leader_and_the_next_vehicle_of_its_lane():
    others = [Track(s=s, lane=lane, speed=20.0, body=BODY) for s, lane in ((150, 0), (110, 1))]
    features = attempt_features(overtake(*others))
    assert features.leader.return_gap[0] == pytest.approx(150 - 60 - 4, abs=2e-3)


def test_the_lane_to_the_left_has_a_space_mean_and_a_time_mean_of_speed():
    speeds = (20.0, 30.0)
    others = [
        Track(s=s, lane=1, speed=v, body=BODY) for s, v in zip((40.0, -10.0), speeds, strict=True)
    ]
    far = Track(s=400.0, lane=1, speed=40.0, body=BODY)
    left = attempt_features(overtake(*others, far)).left
    assert left.count[0] == 2
    assert left.space_mean_speed[0] == pytest.approx(25.0, rel=1e-5)
    # Wardrop (1952): the time mean is the space mean plus variance over space mean.
    assert left.time_mean_speed[0] == pytest.approx(25.0 + 25.0 / 25.0, rel=1e-5)
    assert left.exists[0]


def test_the_overtaking_time_from_equal_speed_covers_gap_lengths_and_one_second():
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=20.0, body=BODY)
    features = attempt_features(case(ego, target, frames=101, road=ROAD))
    accel = float(features.ego.available_accel[0])
    # The gap of 30 m, two lengths of 4 m, and one second at 20 m/s.
    time = np.sqrt(2.0 * (30.0 + 8.0 + 20.0) / accel)
    assert features.leader.overtaking_time[0] == pytest.approx(time, rel=1e-4)
    distance = 20.0 * time + 0.5 * accel * time**2
    assert features.leader.overtaking_distance[0] == pytest.approx(distance, rel=1e-4)


def test_no_acceleration_is_available_at_the_top_speed():
    propulsion = {"power": 60e3, "mass": 1500.0, "drag_area": 0.7, "rolling_resistance": 0.01}
    drag, rolling = 0.5 * 1.2 * 0.7, 1500.0 * 9.81 * 0.01
    roots = np.roots([drag, 0.0, rolling, -60e3])
    top = float(roots[np.isreal(roots)].real[0])
    ego = Track(speed=top, body=BODY | propulsion)
    features = attempt_features(case(ego, Track(s=90.0, body=BODY), frames=60, road=ROAD))
    assert features.ego.available_accel[0] == pytest.approx(0.0, abs=2e-3)


def test_margins_of_the_law_are_for_a_lane_change_at_the_attempt():
    features = attempt_features(overtake(Track(s=-50.0, lane=1, speed=30.0, body=BODY)))
    decel = min(8.0, 0.9 * 9.81 * float(features.surroundings.friction[0]))
    gap, gap_behind = float(features.leader.encounter.gap[0]), float(features.left.follower.gap[0])
    safe_ahead = 28.0 + (28.0**2 - 20.0**2) / (2.0 * decel)
    safe_behind = 30.0 + (30.0**2 - 28.0**2) / (2.0 * decel)
    assert features.law.leader[0] == pytest.approx(gap - safe_ahead, abs=1e-3)
    assert features.law.left_follower[0] == pytest.approx(gap_behind - safe_behind, abs=1e-3)
    # The general limit of motorways, 120 km/h, is below the posted limit of this road.
    assert features.law.speed[0] == pytest.approx(120.0 / 3.6 - 28.0, abs=1e-3)


def test_beliefs_come_from_the_last_decision_before_the_attempt():
    beliefs = tuple(
        Belief(frame=frame, whom=0, gap=gap, closing_speed=7.0)
        for frame, gap in ((20, 40.0), (50, 30.0), (300, 10.0))
    )
    drive = overtake(beliefs=beliefs)
    attempt_beliefs = attempt_features(drive).beliefs
    assert drive.events.attempt[0] > 50
    assert attempt_beliefs.exists[0]
    assert attempt_beliefs.age[0] == pytest.approx((drive.events.attempt[0] - 50) * 0.05)
    assert attempt_beliefs.gap[0, 0] == pytest.approx(30.0)
    assert not attempt_features(overtake()).beliefs.exists[0]


def test_columns_of_unknown_inputs_are_null():
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=18.0, body=BODY)
    unknown = ("weather", "drivers", "bodies", "percepts", "indicators")
    drive = case(ego, target, frames=101, road=ROAD, unknown=unknown)
    table = attempts_table(label(drive.trajectories), np.arange(1))
    unknown_columns = ("friction", "ego_desired_speed_mps", "overtaking_time_s", "law_leader_m")
    assert all(table[name].null_count for name in unknown_columns)
    known_columns = ("leader_gap_m", "ego_speed_mps", "left_exists", "lane", "law_speed_mps")
    assert not any(table[name].null_count for name in known_columns)


def test_the_ego_is_not_its_own_neighbour():
    features = attempt_features(overtake())
    assert features.left.count[0] == 0
    assert features.surroundings.lane[0] == 0
    assert features.surroundings.lanes_to_left[0] == 2
    kinds = overtake().trajectories.scenario.vehicles.kind[:, EGO_SLOT]
    assert features.ego.kind[0] == kinds[0]
