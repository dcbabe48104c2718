"""One simulation in SI units: its numbers are those that diagrams, exporters and films show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.cases import Belief, Track, case, two_way_road

from overtaking.analysis.stats.diagrams import diagram
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.model.known_roads import known_road
from overtaking.model.trajectories import NO_VEHICLE, Lights, ManoeuvreKind, Trajectories
from overtaking.model.vehicle_tracks import VehicleTracks
from overtaking.recordings.highd_write import INTERVAL_MS, image_tracks
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

ROW = 3


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    source = ScenarioSource(load_specification("rural"), known_road("rural"), 1)
    return label(engine.simulate(source.sample(np.arange(8, dtype=np.uint64))))


@pytest.fixture(scope="module")
def tracks(labelled: LabelledTrajectories) -> VehicleTracks:
    return VehicleTracks.from_trajectories(labelled.trajectories, ROW, labelled.events)


def test_a_row_of_a_batch_gives_the_tracks_of_a_batch_of_one(
    labelled: LabelledTrajectories, tracks: VehicleTracks
):
    one = slice(ROW, ROW + 1)
    alone = VehicleTracks.from_trajectories(
        labelled.trajectories.select(one), events=labelled.events.select(one), simulation_id=ROW
    )
    assert alone == tracks
    assert tracks.simulation_id == ROW


def test_states_are_the_recorded_integers_times_their_resolution(
    labelled: LabelledTrajectories, tracks: VehicleTracks
):
    trajectories, frames = labelled.trajectories, int(labelled.trajectories.num_frames[ROW])
    states, slots = trajectories.states, list(tracks.slots)
    for name, values, step in (
        ("s", tracks.s, 1e-3),
        ("d", tracks.d, 1e-3),
        ("speed", tracks.speed, 1e-3),
        ("heading", tracks.heading, 1e-4),
        ("accel_lon", tracks.accel, 1e-3),
        ("yaw_rate", tracks.yaw_rate, 1e-4),
    ):
        recorded = getattr(states, name)[ROW, slots, :frames]
        np.testing.assert_array_equal(values, recorded * step, err_msg=name)
    np.testing.assert_array_equal(tracks.lights, states.lights[ROW, slots, :frames])
    np.testing.assert_array_equal(tracks.time, np.arange(frames) * 50 / 1000.0)
    np.testing.assert_array_equal(tracks.is_recorded, trajectories.state_mask[ROW, slots, :frames])
    assert tracks.slots == tuple(np.flatnonzero(trajectories.scenario.vehicles.valid[ROW]))


def test_the_angle_to_a_straight_road_is_the_heading_less_that_of_the_road(
    labelled: LabelledTrajectories, tracks: VehicleTracks
):
    angle = tracks.heading - labelled.trajectories.road.heading
    np.testing.assert_array_equal(tracks.road_angle, angle)


def test_a_diagram_shows_the_same_stations_and_positions(
    labelled: LabelledTrajectories,
):
    for row in range(len(labelled.events.target_slot)):
        one = slice(row, row + 1)
        events = labelled.events.select(one)
        shown = diagram(labelled.trajectories.select(one), events)
        tracks = VehicleTracks.from_trajectories(labelled.trajectories, row, labelled.events)
        assert tracks.target == next(
            (tracks.row_of(track.slot) for track in shown.tracks if track.is_target), None
        )
        road = labelled.trajectories.road
        along = tracks.s_from_moving_mark(shown.reference_speed)
        across = (tracks.d - road.lane_boundaries[0]) * int(road.overtaking_sign)
        for track in shown.tracks:
            index = tracks.row_of(track.slot)
            is_recorded = tracks.is_recorded[index]
            np.testing.assert_array_equal(np.isfinite(track.ahead), is_recorded)
            np.testing.assert_array_equal(track.lateral[is_recorded], across[index][is_recorded])
            start = along[0, 0] - (tracks.s[0, 0] - tracks.s[tracks.target or 0, 0])
            assert start == 0.0
            np.testing.assert_allclose(
                track.ahead[is_recorded], along[index][is_recorded], rtol=0, atol=1e-9
            )
            assert track.length == tracks.length[index]


def test_an_export_to_highd_has_the_same_states_where_both_have_a_frame():
    source = ScenarioSource(load_specification("motorway"), known_road("motorway"), 1)
    trajectories = engine.simulate(source.sample(np.arange(2, dtype=np.uint64)))
    tracks, image = VehicleTracks.from_trajectories(trajectories, 1), image_tracks(trajectories, 1)
    times = np.arange(image.x.shape[1]) * INTERVAL_MS
    shared = np.flatnonzero(times % 50 == 0)
    at_shared = tracks.at_frames(times[shared] // 50)
    assert len(shared) > 50
    np.testing.assert_array_equal(image.there[:, shared], at_shared.is_recorded)
    np.testing.assert_array_equal(image.length, tracks.length)
    np.testing.assert_array_equal(image.width, tracks.width)
    np.testing.assert_allclose(
        np.diff(image.x[:, shared], axis=1), np.diff(at_shared.s, axis=1), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        np.diff(image.y[:, shared], axis=1), -np.diff(at_shared.d, axis=1), rtol=0, atol=1e-9
    )


def test_frames_can_be_selected(tracks: VehicleTracks):
    frames = np.array([0, 0, 4])
    selected = tracks.at_frames(frames)
    np.testing.assert_array_equal(selected.time, [0.0, 0.0, 0.2])
    np.testing.assert_array_equal(selected.s, tracks.s[:, frames])
    np.testing.assert_array_equal(selected.lights, tracks.lights[:, frames])
    np.testing.assert_array_equal(selected.length, tracks.length)


def passing_case(unknown: tuple[str, ...] = (), beliefs: tuple[Belief, ...] = ()) -> Trajectories:
    """An ego that passes the second vehicle; a third one drives ahead, an oncoming one comes."""
    return case(
        Track(s=0.0, speed=30.0, lights=int(Lights.INDICATOR_LEFT | Lights.LOW_BEAM)),
        Track(s=20.0, speed=20.0),
        Track(s=100.0, speed=20.0),
        Track(s=300.0, speed=20.0, lane=1.0, oncoming=True),
        frames=81,
        road=two_way_road(),
        unknown=unknown,
        beliefs=beliefs,
    ).trajectories


def test_the_gap_to_the_target_is_zero_alongside():
    tracks = VehicleTracks.from_trajectories(passing_case())
    gap = tracks.gap_to_target()
    assert tracks.target == 1
    assert gap is not None
    touching = 0.5 * (tracks.length[0] + tracks.length[1])
    np.testing.assert_allclose(gap[[0, 40, 80]], [20.0 - touching, 0.0, touching - 20.0])


def test_without_events_the_last_decision_to_pull_out_names_the_target():
    percepts = (Belief(vehicle=1), Belief(vehicle=2, frame=20))
    assert VehicleTracks.from_trajectories(passing_case(beliefs=percepts)).target == 2
    unknown = passing_case(unknown=("percepts",), beliefs=percepts)
    assert VehicleTracks.from_trajectories(unknown).target == 1
    aborts = passing_case(beliefs=(Belief(vehicle=2, kind=ManoeuvreKind.RETURN),))
    assert VehicleTracks.from_trajectories(aborts).target == 1


def test_a_vehicle_without_a_state_in_the_first_frame_is_not_the_target():
    """Its station there is 0, which is ahead of an ego before the start of the road."""
    both = case(Track(s=-50.0), Track(s=-20.0), frames=3).trajectories
    assert VehicleTracks.from_trajectories(both).target == 1
    is_recorded = both.state_mask.copy()
    is_recorded[:, 1, 0] = False
    states = both.states.replace(s=np.where(is_recorded, both.states.s, 0))
    later = both.replace(states=states, is_recorded=is_recorded)
    assert VehicleTracks.from_trajectories(later).target is None


def test_an_ego_without_a_vehicle_ahead_has_no_target():
    alone = VehicleTracks.from_trajectories(case(Track(), frames=3).trajectories)
    assert alone.target is None
    assert alone.gap_to_target() is None
    np.testing.assert_allclose(alone.s_from_moving_mark(25.0), 0.0, atol=1e-9)


def test_events_without_a_target_give_none(labelled: LabelledTrajectories):
    target = np.full_like(labelled.events.target_slot, NO_VEHICLE)
    events = dataclasses.replace(labelled.events, target_slot=target)
    assert VehicleTracks.from_trajectories(labelled.trajectories, ROW, events).target is None


@pytest.mark.parametrize(
    ("unknown", "expected"),
    [
        ((), Lights.INDICATOR_LEFT | Lights.LOW_BEAM),
        (("indicators",), Lights.LOW_BEAM),
        (("lamps",), Lights.INDICATOR_LEFT),
        (("indicators", "lamps"), Lights(0)),
    ],
)
def test_lamps_that_a_recording_does_not_state_are_off(unknown: tuple[str, ...], expected: Lights):
    tracks = VehicleTracks.from_trajectories(passing_case(unknown))
    np.testing.assert_array_equal(tracks.lights[0], int(expected))


def test_a_slot_without_a_vehicle_has_no_row():
    tracks = VehicleTracks.from_trajectories(passing_case())
    assert tracks.row_of(2) == 2
    with pytest.raises(ValueError, match="tuple"):
        tracks.row_of(9)


def test_an_oncoming_vehicle_points_against_the_road():
    tracks = VehicleTracks.from_trajectories(passing_case())
    np.testing.assert_allclose(np.abs(tracks.road_angle[3]), np.pi, atol=1e-4)
