"""Features of the decision to overtake: what they say, and that nothing in them is from later."""

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
WAY = ramp((3, 0), (6, 1), (14, 1), (17, 0), frames=FRAMES)
BODY = {"length": 4.0, "width": 1.8}
LATER = 7
"""What stands in every state of a recording after the end of what is known."""


def overtake(*others: Track, **given) -> Case:
    ego = Track(speed=28.0, lane=WAY, body=BODY)
    target = Track(kind="T", s=60.0, speed=20.0, body=BODY)
    return case(ego, target, *others, frames=FRAMES, road=ROAD, **given)


def leaves(batch: Batch, path: str = "") -> dict[str, np.ndarray]:
    """Every array of a batch, by its dotted name."""
    found: dict[str, np.ndarray] = {}
    for field in dataclasses.fields(batch):  # type: ignore[arg-type]
        value = getattr(batch, field.name)
        if isinstance(value, Batch):
            found |= leaves(value, f"{path}{field.name}.")
        else:
            found[path + field.name] = value
    return found


def known_until(one: Case, frame: np.ndarray) -> Case:
    """The case as it was at one frame of each simulation; all that came later is something else."""
    run = one.trajectories
    later = np.arange(run.stage.shape[1]) > frame[:, None]
    states = run.states.replace(
        **{
            field.name: np.where(later[:, None], LATER, getattr(run.states, field.name)).astype(
                getattr(run.states, field.name).dtype
            )
            for field in dataclasses.fields(run.states)
        }
    )
    percepts = run.percepts
    now = frame[:, None] * run.scenario.frame_interval_ms
    percepts = percepts.replace(valid=percepts.valid & (percepts.time <= now))
    cut = run.replace(
        states=states, percepts=percepts, num_frames=(frame + 1).astype(run.num_frames.dtype)
    )
    return with_events(case_from_trajectories(cut), one.events)


@pytest.fixture(scope="module")
def simulated() -> Case:
    return case_from_trajectories(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=96, seed=3))
    )


def test_nothing_in_them_is_later_than_the_decision(simulated):
    whole = attempt_features(simulated)
    cut = known_until(simulated, whole.frame)
    before, after = leaves(whole), leaves(attempt_features_at(cut, whole.frame))
    assert {name for name in before if not np.array_equal(before[name], after[name])} == set()


def test_what_comes_later_would_be_seen_if_it_were_used(simulated):
    frame = attempt_features(simulated).frame
    cut, rows = known_until(simulated, frame), np.arange(len(frame))
    speeds = (one.signals.lateral_speed[rows, frame] for one in (simulated, cut))
    assert not np.array_equal(*speeds)


def test_they_describe_the_pair_at_the_attempt():
    one = overtake()
    found, frame = attempt_features(one), int(one.events.attempt[0])
    gap = 60.0 - 8.0 * frame * 0.05 - 4.0
    assert found.frame[0] == frame
    assert found.leader.kind[0] == VehicleKind.TRUCK
    assert found.leader.speed[0] == pytest.approx(20.0)
    assert found.leader.encounter.gap[0] == pytest.approx(gap, abs=2e-3)
    assert found.leader.encounter.ttc[0] == pytest.approx(gap / 8.0, rel=1e-3)
    assert found.leader.looming[0] == pytest.approx(1.8 * 8.0 / (gap**2 + 0.81), rel=1e-3)
    assert found.leader.length[0] == 4.0
    assert not found.leader.has_next_leader[0]


def test_the_room_to_return_to_is_between_two_vehicles_of_the_lane():
    others = [Track(s=s, lane=lane, speed=20.0, body=BODY) for s, lane in ((150, 0), (110, 1))]
    found = attempt_features(overtake(*others))
    assert found.leader.return_gap[0] == pytest.approx(150 - 60 - 4, abs=2e-3)


def test_the_lane_to_the_left_has_two_means_of_speed():
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


def test_the_least_time_from_equal_speed_is_that_of_the_distance_to_gain():
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=20.0, body=BODY)
    found = attempt_features(case(ego, target, frames=101, road=ROAD))
    accel = float(found.ego.available_accel[0])
    # The gap of 30 m, two lengths of 4 m, and one second at 20 m/s.
    time = np.sqrt(2.0 * (30.0 + 8.0 + 20.0) / accel)
    assert found.leader.overtaking_time[0] == pytest.approx(time, rel=1e-4)
    way = 20.0 * time + 0.5 * accel * time**2
    assert found.leader.overtaking_distance[0] == pytest.approx(way, rel=1e-4)


def test_no_acceleration_is_available_at_the_top_speed():
    given = {"power": 60e3, "mass": 1500.0, "drag_area": 0.7, "rolling_resistance": 0.01}
    drag, rolling = 0.5 * 1.2 * 0.7, 1500.0 * 9.81 * 0.01
    roots = np.roots([drag, 0.0, rolling, -60e3])
    top = float(roots[np.isreal(roots)].real[0])
    ego = Track(speed=top, body=BODY | given)
    found = attempt_features(case(ego, Track(s=90.0, body=BODY), frames=60, road=ROAD))
    assert found.ego.available_accel[0] == pytest.approx(0.0, abs=2e-3)


def test_the_law_is_asked_as_if_the_ego_moved_over_now():
    found = attempt_features(overtake(Track(s=-50.0, lane=1, speed=30.0, body=BODY)))
    decel = min(8.0, 0.9 * 9.81 * float(found.surroundings.friction[0]))
    gap, behind = float(found.leader.encounter.gap[0]), float(found.left.follower.gap[0])
    safe_ahead = 28.0 + (28.0**2 - 20.0**2) / (2.0 * decel)
    safe_behind = 30.0 + (30.0**2 - 28.0**2) / (2.0 * decel)
    assert found.law.leader[0] == pytest.approx(gap - safe_ahead, abs=1e-3)
    assert found.law.left_follower[0] == pytest.approx(behind - safe_behind, abs=1e-3)
    # The general limit of motorways, 120 km/h, is below what this road posts.
    assert found.law.speed[0] == pytest.approx(120.0 / 3.6 - 28.0, abs=1e-3)


def test_beliefs_are_those_of_the_last_decision_before_it():
    beliefs = tuple(
        Belief(frame=frame, whom=0, gap=gap, closing_speed=7.0)
        for frame, gap in ((20, 40.0), (50, 30.0), (300, 10.0))
    )
    one = overtake(beliefs=beliefs)
    found = attempt_features(one).beliefs
    assert one.events.attempt[0] > 50
    assert found.exists[0]
    assert found.age[0] == pytest.approx((one.events.attempt[0] - 50) * 0.05)
    assert found.gap[0, 0] == pytest.approx(30.0)
    assert not attempt_features(overtake()).beliefs.exists[0]


def test_what_a_recording_does_not_tell_is_null():
    ego, target = Track(speed=20.0, body=BODY), Track(s=34.0, speed=18.0, body=BODY)
    unknown = ("weather", "drivers", "bodies", "percepts", "indicators")
    one = case(ego, target, frames=101, road=ROAD, unknown=unknown)
    table = attempts_table(label(one.trajectories), np.arange(1))
    silent = ("friction", "ego_desired_speed_mps", "overtaking_time_s", "law_leader_m")
    assert all(table[name].null_count for name in silent)
    told = ("leader_gap_m", "ego_speed_mps", "left_exists", "lane", "law_speed_mps")
    assert not any(table[name].null_count for name in told)


def test_the_ego_itself_is_no_neighbour():
    found = attempt_features(overtake())
    assert found.left.count[0] == 0
    assert found.surroundings.lane[0] == 0
    assert found.surroundings.lanes_to_left[0] == 2
    kinds = overtake().trajectories.scenario.vehicles.kind[:, EGO_SLOT]
    assert found.ego.kind[0] == kinds[0]
