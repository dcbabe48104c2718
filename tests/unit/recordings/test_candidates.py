"""Who drives around whom, who changes lanes, and which part of a recording becomes a simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.recordings import OVERTAKE, Mover, commonroad

from overtaking.knowledge.toml_reader import constant
from overtaking.model.trajectories import LANE_CHANGE_SPEED
from overtaking.recordings import candidates
from overtaking.recordings.batch import vehicles_of
from overtaking.recordings.candidates import lane_changes, num_passes, overtakes
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.neighbours import NOBODY, PLACES, Surroundings
from overtaking.recordings.recording import Tracks, kept, slope
from overtaking.recordings.scenes import scenes

QUIET = [replace(one, last=250) for one in OVERTAKE]


def read(tmp_path, movers, **options):
    path = tmp_path / "scene.xml"
    path.write_text(commonroad(movers, **options), encoding="utf-8")
    return read_commonroad(path)


@st.composite
def crowds(draw) -> list[Mover]:
    """Vehicles anywhere on three lanes, coming and going."""
    count = draw(st.integers(1, 7))
    vehicles: list[Mover] = []
    for number in range(1, count + 1):
        first = draw(st.integers(0, 6))
        vehicles.append(
            Mover(
                number=number,
                s=draw(st.integers(10, 300)) + 0.0,
                speed=draw(st.integers(1, 40)) + 0.0,
                lane=draw(st.integers(0, 2)),
                moves=((0.5, draw(st.integers(0, 2))),),
                ramp=1.0,
                first=first,
                last=first + draw(st.integers(1, 9)),
            )
        )
    return vehicles


@pytest.mark.ci
@settings(max_examples=25)
@given(movers=crowds())
def test_neighbours_are_those_that_a_plain_search_finds(tmp_path_factory, movers):
    recording = read(tmp_path_factory.mktemp("crowd"), movers)
    tracks, around = recording.tracks, Surroundings.of(recording)
    vehicle, frame = tracks.vehicle, tracks.frame
    for row in range(tracks.num_rows):
        for place, (shift, is_ahead) in enumerate(PLACES):
            there = (frame == frame[row]) & (vehicle != vehicle[row])
            there &= tracks.lane.astype(int) == int(tracks.lane[row]) + shift
            apart = np.round(tracks.s - tracks.s[row], 3)
            there &= (apart >= 0) if is_ahead else (apart < 0)
            found = around.row[place, row]
            same = (apart == 0) & (frame == frame[row]) & (tracks.lane == tracks.lane[row])
            if shift == 0 and same.sum() > 1:
                continue  # Of two in the same place either may be ahead.
            assert (found != NOBODY) == there.any()
            if there.any():
                assert abs(apart[found]) == np.abs(apart[there]).min()


@pytest.mark.ci
@settings(max_examples=25)
@given(movers=crowds())
def test_passes_are_those_that_a_plain_count_finds(tmp_path_factory, movers):
    tracks = read(tmp_path_factory.mktemp("crowd"), movers).tracks
    count = 0
    for one in range(tracks.num_vehicles):
        for other in range(tracks.num_vehicles):
            first = max(tracks.first[one], tracks.first[other])
            last = min(tracks.last[one], tracks.last[other])
            if one != other and first <= last:
                lead = [
                    tracks.s[tracks.row(one, f)] - tracks.s[tracks.row(other, f)]
                    for f in (first, last)
                ]
                count += lead[0] < 0 < lead[1]
    assert num_passes(tracks) == count


@pytest.mark.ci
def test_the_order_in_the_file_changes_nothing(tmp_path):
    one = scenes(read(tmp_path, QUIET))
    other = scenes(read(tmp_path, QUIET[::-1]))
    assert one.sources(range(len(one))) == other.sources(range(len(other)))
    ours, theirs = (each.trajectories(range(len(each))) for each in (one, other))
    assert np.array_equal(ours.trace_hash, theirs.trace_hash)


def test_a_vehicle_along_a_line_does_not_change_lanes(tmp_path):
    weaving = Mover(
        number=1, s=20.0, lane=0, moves=((3.0, 0.55), (8.0, 0.4), (13.0, 0.57)), ramp=2.0
    )
    recording = read(tmp_path, [weaving, Mover(number=2, s=80.0)])
    assert len(set(recording.tracks.lane[: recording.tracks.start[1]].tolist())) == 2
    assert len(lane_changes(recording).row) == 0
    over = replace(weaving, moves=((3.0, 0.65),))
    assert len(lane_changes(read(tmp_path, [over, Mover(number=2, s=80.0)])).row) == 1


@pytest.mark.ci
def test_without_a_leader_in_reach_there_is_no_candidate(tmp_path):
    alone = [QUIET[0], QUIET[2]]
    recording = read(tmp_path, alone)
    changes = lane_changes(recording)
    assert changes.is_left.sum() == 1
    assert overtakes(recording, changes, Surroundings.of(recording)) == []
    far = [QUIET[0], replace(QUIET[1], s=20.0 + 60.0 + 150.0)]
    recording = read(tmp_path, far)
    assert overtakes(recording, lane_changes(recording), Surroundings.of(recording)) == []


@pytest.mark.ci
def test_two_lanes_in_one_go_are_one_candidate_and_two_movements_are_two(tmp_path):
    leader = Mover(number=2, s=80.0, speed=24.0, last=299)
    second = Mover(number=3, s=150.0, speed=24.0, lane=1, last=299)
    go = Mover(number=1, s=20.0, speed=30.0, moves=((6.0, 2),), ramp=6.0, last=299)
    recording = read(tmp_path, [go, leader, second])
    assert lane_changes(recording).new.tolist() == [1, 2]
    assert len(overtakes(recording, lane_changes(recording), Surroundings.of(recording))) == 1
    twice = replace(go, moves=((4.0, 1), (14.0, 2)), ramp=3.0)
    recording = read(tmp_path, [twice, leader, second])
    windows = overtakes(recording, lane_changes(recording), Surroundings.of(recording))
    names = recording.tracks.names
    assert [int(names[one.leader]) for one in windows] == [2, 3]
    # The second begins when the first movement has ended, not ten seconds before its own.
    assert windows[0].moves is not None
    assert windows[1].first > windows[0].moves + 20


def test_a_window_ends_before_the_next_attempt_and_is_cut_off_when_too_long(tmp_path, monkeypatch):
    leader = Mover(number=2, s=80.0, speed=24.0, last=299)
    again = Mover(
        number=1, s=20.0, speed=25.0, moves=((4.0, 1), (9.0, 0), (14.0, 1)), ramp=3.0, last=299
    )
    recording = read(tmp_path, [again, leader])
    windows = overtakes(recording, lane_changes(recording), Surroundings.of(recording))
    assert len(windows) == 2
    assert windows[1].moves is not None
    assert windows[0].last < windows[1].moves
    assert windows[0].returns is not None
    assert windows[1].returns is None
    assert windows[1].last == 299
    monkeypatch.setattr(candidates, "MAX_FRAMES", 40)
    short = overtakes(recording, lane_changes(recording), Surroundings.of(recording))
    assert [one.last - one.first + 1 for one in short] == [40, 40]
    assert short[0].returns is None


def test_slots_go_to_those_who_matter_and_the_rest_is_said_to_be_missing(tmp_path):
    recording = read(tmp_path, QUIET)
    around = Surroundings.of(recording)
    (window,) = overtakes(recording, lane_changes(recording), around)
    names = recording.tracks.names
    everybody = [int(names[one]) for one in vehicles_of(recording, around, window)]
    assert everybody[:3] == [7, 3, 5]
    assert sorted(everybody) == [3, 5, 7, 9]
    few = scenes(recording, num_slots=2)
    assert all(len(one.vehicles) == 2 for one in few.windows)
    assert few.counts["neighbours_with_a_slot"] < 1.0


def test_of_a_track_that_leaves_the_road_the_longest_piece_stays():
    count = 10
    values = np.arange(count, dtype=np.float64)
    tracks = Tracks(
        names=np.array(["4", "8"], np.object_),
        kind=np.zeros(2, np.uint8),
        is_kind_known=np.ones(2, np.bool_),
        length=np.ones(2),
        width=np.ones(2),
        carriageway=np.zeros(2, np.int64),
        file_row=np.arange(2),
        first=np.array([100, 200]),
        start=np.array([0, 6, 10]),
        lane=np.zeros(count, np.uint8),
        **dict.fromkeys(("x", "y", "s", "d", "speed", "heading", "accel_lon", "accel_lat"), values),
        **dict.fromkeys(("yaw_rate", "wheel_angle"), values),
    )
    rows = np.array([True, False, True, True, False, True, False, False, False, False])
    left = kept(tracks, rows, 100)
    assert left.names.tolist() == ["4"]
    assert left.first.tolist() == [102]
    assert left.last.tolist() == [103]
    assert left.s.tolist() == [2.0, 3.0]
    assert kept(tracks, np.ones(count, bool), 100).s.tolist() == values.tolist()
    assert kept(tracks, np.zeros(count, bool), 100).num_vehicles == 0


def test_long_pieces_of_a_track_are_tracks_in_order_of_time():
    names, count = ["4", "4 (2)", "8"], 18
    values = np.arange(count, dtype=np.float64)
    quantities = ("x", "y", "s", "d", "speed", "heading", "accel_lon", "accel_lat", "yaw_rate")
    tracks = Tracks(
        names=np.array(names, np.object_),
        kind=np.zeros(3, np.uint8),
        is_kind_known=np.ones(3, np.bool_),
        length=np.ones(3),
        width=np.ones(3),
        carriageway=np.zeros(3, np.int64),
        file_row=np.arange(3),
        first=np.array([100, 150, 200]),
        start=np.array([0, 8, 14, 18]),
        lane=np.zeros(count, np.uint8),
        **dict.fromkeys((*quantities, "wheel_angle"), values),
    )
    rows = np.ones(count, np.bool_)
    rows[3] = False
    pieces = kept(tracks, rows, 200)
    assert pieces.names.tolist() == ["4", "4 (2)", "4 (3)", "8"]
    assert pieces.first.tolist() == [100, 104, 150, 200]
    assert pieces.start.tolist() == [0, 3, 7, 13, 17]
    assert pieces.s.tolist() == values[rows].tolist()


@pytest.mark.parametrize("interval", [40, 50, 100])
def test_a_slope_is_exact_for_what_grows_evenly_and_stays_within_a_vehicle(interval):
    start = np.array([0, 7, 8, 15])
    values = np.concatenate([np.arange(7) * 3.0, [1000.0], -np.arange(7) * 2.0])
    found = slope(values, start, interval)
    per_second = 1000.0 / interval
    assert found[:7] == pytest.approx(3.0 * per_second)
    assert found[7] == 0.0
    assert found[8:] == pytest.approx(-2.0 * per_second)


def test_the_leader_of_a_follower_is_in_slot_one(tmp_path):
    movers = [
        Mover(number=5, s=60.0, last=60),
        Mover(number=9, s=100.0, last=60),
        Mover(number=1, s=20.0, last=60),
    ]
    recording = read(tmp_path, movers)
    found = scenes(recording)
    names = recording.tracks.names
    slots = {int(names[one.ego]): [int(names[k]) for k in one.vehicles] for one in found.windows}
    assert slots[5] == [5, 9, 1]
    assert slots[1][:2] == [1, 5]
    assert 9 not in slots


def test_who_is_there_at_the_return_goes_before_who_is_beside_for_longer(tmp_path):
    movers = [QUIET[0], QUIET[1], QUIET[3], Mover(number=11, s=22.0, speed=30.0, lane=2, last=250)]
    recording = read(tmp_path, movers)
    around = Surroundings.of(recording)
    (window,) = overtakes(recording, lane_changes(recording), around)
    names = recording.tracks.names
    assert [int(names[one]) for one in vehicles_of(recording, around, window, 3)] == [7, 3, 9]
    assert [int(names[one]) for one in vehicles_of(recording, around, window, 4)] == [7, 3, 9, 11]


def test_the_leader_is_looked_for_in_the_lane_that_is_left(tmp_path):
    # The ego rests with its centre 0.2 m beyond the line, and moves on after a second.
    ego = Mover(number=7, s=20.0, speed=25.0, moves=((3.0, 0.55), (6.0, 1)), ramp=2.0, last=120)
    left = Mover(number=3, s=60.0, speed=25.0, last=120)
    entered = Mover(number=5, s=50.0, speed=25.0, lane=1, last=120)
    recording = read(tmp_path, [ego, left, entered])
    changes = lane_changes(recording)
    (window,) = overtakes(recording, changes, Surroundings.of(recording))
    assert recording.tracks.names[window.leader] == "3"
    assert window.moves == pytest.approx(21, abs=2)


def test_candidates_and_labels_agree_on_the_speed_of_a_lane_change():
    speed = float(constant("event_detection.motion.least_speed"))
    assert pytest.approx(speed) == LANE_CHANGE_SPEED
