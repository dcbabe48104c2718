"""Recordings of every kind, on which tests compare the compiled labels with the readable ones."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels.readable_signals import SignalArray, SingleRun, signals_of
from tests.support.law_fixtures import FIXTURES
from tests.support.recordings import with_gaps

from overtaking.labels.event_detection import case_from_trajectories
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine as simulator

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories
    from overtaking.model.verdicts import Case


def simulate_profile(
    profile: str, num_simulations: int, interval_ms: int = 50, *, mirrored: bool = False
) -> Trajectories:
    """Simulations of a profile, in left-hand traffic if mirrored."""
    specification = load_specification(profile, {"profile.frame_interval_ms": interval_ms})
    road = load_road(specification.road)
    road = road.mirror() if mirrored else road
    source = ScenarioSource(specification, road, 27)
    return simulator.simulate(source.sample(np.arange(num_simulations, dtype=np.uint64)))


def ego_beyond_the_lanes() -> Trajectories:
    """Recordings that end early; every other ego is beyond the lanes for a while."""
    trajectories = simulate_profile("pinto2023-physical", 64)
    lane = trajectories.states.lane.copy()
    lane[::2, 0, 40:60] = 255
    return trajectories.replace(
        states=trajectories.states.replace(lane=lane),
        num_frames=trajectories.num_frames - np.int32(20),
    )


def ego_across_the_road() -> Trajectories:
    """Recordings in which every other ego stands across the road for a while."""
    trajectories = simulate_profile("pinto2023", 64)
    heading = trajectories.states.heading.copy()
    heading[::2, 0, 40:60] -= 9000
    return trajectories.replace(states=trajectories.states.replace(heading=heading))


def excerpt() -> Trajectories:
    """Recordings that begin during a manoeuvre, with vehicles that are missing for some time."""
    trajectories, begin = simulate_profile("pinto2023-physical", 96), 150
    states = trajectories.states
    later_states = {
        field.name: getattr(states, field.name)[..., begin:] for field in dataclasses.fields(states)
    }
    return with_gaps(
        trajectories.replace(
            states=states.replace(**later_states),
            num_frames=np.maximum(trajectories.num_frames - np.int32(begin), np.int32(1)),
            stage=trajectories.stage[:, begin:],
            collided_with=trajectories.collided_with[:, begin:],
            unknown=frozenset(["stage", "percepts", "indicators"]),
        )
    )


RECORDINGS = {
    "pinto2023": lambda: simulate_profile("pinto2023-physical", 256),
    "motorway": lambda: simulate_profile("motorway", 96),
    "motorway-risk": lambda: simulate_profile("motorway-risk", 96),
    "a few of motorway-risk": lambda: simulate_profile("motorway-risk", 16),
    "25 Hz": lambda: simulate_profile("pinto2023-physical", 48, 40),
    "10 Hz": lambda: simulate_profile("pinto2023-physical", 48, 100),
    "left-hand traffic": lambda: simulate_profile("pinto2023-physical", 48, mirrored=True),
    "gaps": lambda: with_gaps(simulate_profile("pinto2023-physical", 96)),
    "excerpt": excerpt,
    "off the road": ego_beyond_the_lanes,
    "across the road": ego_across_the_road,
}

LONG_RECORDINGS = {"motorway", "motorway-risk"}
every_recording = pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.ci] if name in LONG_RECORDINGS else [])
        for name in RECORDINGS
    ],
)


@cache
def sample_case(name: str) -> Case:
    """A recording with its compiled signals and events."""
    return case_from_trajectories(RECORDINGS[name]())


@cache
def readable_runs(name: str) -> list[tuple[SingleRun, dict[str, SignalArray]]]:
    """The simulations of a recording, each with its readable signals."""
    trajectories = sample_case(name).trajectories
    runs = [SingleRun(trajectories, row) for row in range(len(trajectories.num_frames))]
    return [(run, signals_of(run)) for run in runs]


def handwritten_recordings() -> list[Trajectories]:
    """The overtakes that keep or break each rule, as tests of the law write them by hand."""
    return [make().trajectories for _, _, _, make in FIXTURES]


def have_same_bits(first: SignalArray, second: SignalArray) -> bool:
    """Whether two arrays have the same type, shape and bits."""
    return (first.dtype, first.shape, first.tobytes()) == (
        second.dtype,
        second.shape,
        second.tobytes(),
    )
