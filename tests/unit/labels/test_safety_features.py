"""Surrogate measures of safety, of overtakes drawn by hand and in each frame of simulations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.cases import Track, case, ramp
from tests.support.worlds import wide_road

import overtaking as ot
from overtaking.data.tables.encode_labels import safety as safety_table
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.labelling import label
from overtaking.labels.law.case import judged_span
from overtaking.labels.safety_features import safety_features
from overtaking.labels.signals import encounters_at
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import MEASURED_MOMENTS
from overtaking.world.surrogate_safety import looming

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

FRAMES = 500
ROAD = wide_road(lanes=3)
LANE_OVER_TIME = ramp((3, 0), (6, 1), (14, 1), (17, 0), frames=FRAMES)
BODY = {"length": 4.0, "width": 1.8}


def overtake(*others: Track) -> Case:
    ego = Track(speed=28.0, lane=LANE_OVER_TIME, body=BODY)
    target = Track(s=60.0, speed=20.0, body=BODY)
    return case(ego, target, *others, frames=FRAMES, road=ROAD)


def value_at(values: np.ndarray, moment: str) -> float:
    return float(values[0, MEASURED_MOMENTS.index(moment)])


def gap_at(drive: Case, event: str) -> float:
    """Gap of ego and target, from bumper to bumper."""
    frame = int(getattr(drive.events, event)[0])
    return abs(60.0 - 8.0 * frame * 0.05) - 4.0


def test_measures_at_the_attempt_refer_to_the_leader():
    drive = overtake()
    measures, gap = safety_features(drive), gap_at(drive, "attempt")
    assert value_at(measures.leader.gap, "attempt") == pytest.approx(gap, abs=2e-3)
    assert value_at(measures.leader.time_gap, "attempt") == pytest.approx(gap / 28.0, rel=1e-3)
    assert value_at(measures.time_headway, "attempt") == pytest.approx((gap + 4.0) / 28.0, rel=1e-3)
    assert value_at(measures.leader.ttc, "attempt") == pytest.approx(gap / 8.0, rel=1e-3)
    assert value_at(measures.leader.mttc, "attempt") == pytest.approx(gap / 8.0, rel=1e-3)
    assert value_at(measures.leader.drac, "attempt") == pytest.approx(64.0 / (2.0 * gap), rel=1e-3)
    picud = gap - 28.0 - (28.0**2 - 20.0**2) / 6.6
    assert value_at(measures.picud, "attempt") == pytest.approx(picud, rel=1e-3)


def test_the_modified_time_to_collision_uses_the_accelerations():
    ego = Track(speed=28.0, accel=1.0, body=BODY)
    ahead = Track(s=60.0, speed=20.0, accel=-0.5, body=BODY)
    behind = Track(s=-40.0, speed=30.0, accel=1.5, body=BODY)
    drive = case(ego, ahead, behind, frames=60, road=ROAD, events={"attempt": 0})
    measures = safety_features(drive)
    # The first t with a t^2 / 2 + v t = gap, for 1.5 and for 0.5 m/s^2.
    assert value_at(measures.leader.mttc, "attempt") == pytest.approx(
        (np.sqrt(8.0**2 + 2 * 1.5 * 56.0) - 8.0) / 1.5, rel=1e-3
    )
    assert value_at(measures.follower.mttc, "attempt") == pytest.approx(
        (np.sqrt(2.0**2 + 2 * 0.5 * 36.0) - 2.0) / 0.5, rel=1e-3
    )


def test_at_the_return_the_overtaken_vehicle_is_the_new_follower():
    drive = overtake()
    measures, gap = safety_features(drive), gap_at(drive, "return_begin")
    assert value_at(measures.new_follower.gap, "return_begin") == pytest.approx(gap, abs=2e-3)
    assert value_at(measures.new_follower.time_gap, "return_begin") == pytest.approx(
        gap / 20.0, rel=1e-3
    )
    assert np.isinf(value_at(measures.new_follower.ttc, "return_begin"))
    assert not value_at(measures.follower.valid, "return_begin")
    assert value_at(measures.follower.valid, "return_end")


def test_at_the_line_crossing_the_vehicle_behind_on_the_left_is_the_new_follower():
    drive = overtake(Track(s=-30.0, lane=1, speed=31.0, body=BODY))
    measures = safety_features(drive)
    time = int(drive.events.line_crossed[0]) * 0.05
    gap = 30.0 - 3.0 * time - 4.0
    assert value_at(measures.new_follower.gap, "line_crossed") == pytest.approx(gap, abs=2e-3)
    assert value_at(measures.new_follower.ttc, "line_crossed") == pytest.approx(gap / 3.0, rel=1e-3)
    assert value_at(measures.new_follower.drac, "line_crossed") == pytest.approx(
        4.5 / gap, rel=1e-3
    )
    assert not value_at(measures.new_follower.valid, "overlap_begin")


def test_exposed_and_integrated_times_add_up_critical_frames():
    # The gap of 56 m closes at 8 m/s: the time to collision falls from 7 s to 3 s in 4 s.
    ego, target = Track(speed=28.0, body=BODY), Track(s=60.0, speed=20.0, body=BODY)
    measures = safety_features(case(ego, target, frames=120, road=ROAD))
    assert measures.tet[0] == pytest.approx(1.95, abs=0.051)
    assert measures.tit[0] == pytest.approx(0.5 * 1.95**2, abs=0.06)
    assert value_at(measures.leader.ttc, "manoeuvre") == pytest.approx(7.0 - 119 * 0.05, rel=1e-3)


def test_the_share_below_the_safe_distance_counts_frames():
    # The gap begins at 40 m and closes at 1 m/s; at equal speeds of 28 m/s 28 m are lawful.
    ego, target = Track(speed=28.0, body=BODY), Track(s=44.0, speed=27.0, body=BODY)
    drive = case(ego, target, frames=401, road=ROAD)
    measures = safety_features(drive)
    gap = drive.signals.gap[0, NeighbourRole.LEADER]
    assert 0.0 < measures.share_below_safe_distance[0] < 1.0
    # The safe distance grows by (28^2 - 27^2) / (2 b) only, so the share is between these two.
    assert (gap < 28.0).mean() <= measures.share_below_safe_distance[0] <= (gap < 33.0).mean()


def test_the_overtaken_vehicle_sets_the_post_encroachment_time_of_the_return():
    drive = overtake()
    measures = safety_features(drive)
    gap = gap_at(drive, "return_end")
    assert measures.return_pet[0] == pytest.approx(gap / 20.0, rel=1e-3)
    assert np.isinf(measures.entry_pet[0])


@pytest.mark.parametrize("leaves", [False, True])
def test_the_vehicle_behind_sets_the_post_encroachment_time_of_the_entry_if_it_stays(leaves: bool):
    drive = overtake(Track(s=-60.0, lane=1, speed=30.0, body=BODY))
    time = int(drive.events.line_crossed[0]) * 0.05
    lane = ramp((time + 0.2, 1), (time + 1.0, 2), frames=FRAMES) if leaves else 1
    drive = overtake(Track(s=-60.0, lane=lane, speed=30.0, body=BODY))
    gap = 60.0 - 2.0 * time - 4.0
    expected = np.inf if leaves else gap / 30.0
    assert safety_features(drive).entry_pet[0] == pytest.approx(expected, rel=1e-3)


def test_looming_is_the_rate_of_the_visual_angle():
    gap, closing, width, step = 25.0, 6.0, 1.8, 1e-3
    angles = [2.0 * np.arctan(width / (2.0 * (gap - closing * t))) for t in (-step, step)]
    looming_rate = looming(np.float32(gap), np.float32(closing), np.float32(width))
    assert float(looming_rate) == pytest.approx((angles[1] - angles[0]) / (2 * step), rel=1e-4)


@pytest.fixture(scope="module")
def simulated():
    return label(ot.simulate(ot.sample("pinto2023-physical", num_simulations=64, seed=11)))


def test_the_worst_values_are_the_extremes_over_all_frames(simulated):
    judged = case_from_trajectories(simulated.trajectories)
    span = judged_span(judged)
    for k in range(0, 64, 5):
        frames = np.arange(span.first[k], span.last[k] + 1)
        rows = np.full(len(frames), k)
        for name, role in (("leader", NeighbourRole.LEADER), ("follower", NeighbourRole.FOLLOWER)):
            encounters = encounters_at(judged, role, rows, frames)
            worst = getattr(simulated.safety, name)
            assert worst.valid[k, 0] == encounters.valid.any()
            if not encounters.valid.any():
                continue
            for field in ("gap", "time_gap", "ttc", "mttc"):
                lowest = getattr(encounters, field)[encounters.valid].min()
                assert getattr(worst, field)[k, 0] == lowest
            assert worst.drac[k, 0] == encounters.drac[encounters.valid].max()


def test_the_safety_table_has_a_row_for_every_moment_that_occurred(simulated):
    table = safety_table(simulated, np.arange(64))
    events = simulated.events
    num_moments = sum(int((getattr(events, name) != NEVER).sum()) for name in MEASURED_MOMENTS[1:])
    assert table.num_rows == num_moments + int((simulated.safety.frame[:, 0] != NEVER).sum())
    times = table["leader_ttc_s"].drop_null().to_numpy()
    assert np.isfinite(times).all()
