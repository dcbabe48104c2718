"""Recordings of every kind on which the compiled labels are held against the readable ones."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels.readable_signals import One, Row, signals
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


def simulated(
    profile: str, count: int, interval_ms: int = 50, *, mirrored: bool = False
) -> Trajectories:
    given = load_specification(profile, {"profile.frame_interval_ms": interval_ms})
    road = load_road(given.road)
    road = road.mirror() if mirrored else road
    return simulator.simulate(
        ScenarioSource(given, road, 27).sample(np.arange(count, dtype=np.uint64))
    )


def nowhere() -> Trajectories:
    """A recording in which the ego is beyond the lanes for a while, and soon ends."""
    run = simulated("pinto2023-physical", 64)
    lane = run.states.lane.copy()
    lane[::2, 0, 40:60] = 255
    states = dataclasses.replace(run.states, lane=lane)
    return dataclasses.replace(run, states=states, num_frames=run.num_frames - np.int32(20))


def across() -> Trajectories:
    """A recording in which every other ego stands across the road for a while."""
    run = simulated("pinto2023", 64)
    heading = run.states.heading.copy()
    heading[::2, 0, 40:60] -= 9000
    return dataclasses.replace(run, states=dataclasses.replace(run.states, heading=heading))


def excerpt() -> Trajectories:
    """Recordings that begin in the midst of a movement, with vehicles that come and go."""
    run, begin = simulated("pinto2023-physical", 96), 150
    later = {
        field.name: getattr(run.states, field.name)[..., begin:]
        for field in dataclasses.fields(run.states)
    }
    run = run.replace(
        states=run.states.replace(**later),
        num_frames=np.maximum(run.num_frames - np.int32(begin), np.int32(1)),
        stage=run.stage[:, begin:],
        collided_with=run.collided_with[:, begin:],
        unknown=frozenset(["stage", "percepts", "indicators"]),
    )
    return with_gaps(run)


RECORDINGS = {
    "pinto2023": lambda: simulated("pinto2023-physical", 256),
    "motorway": lambda: simulated("motorway", 96),
    "motorway-risk": lambda: simulated("motorway-risk", 96),
    "a few of motorway-risk": lambda: simulated("motorway-risk", 16),
    "25 Hz": lambda: simulated("pinto2023-physical", 48, 40),
    "10 Hz": lambda: simulated("pinto2023-physical", 48, 100),
    "left-hand traffic": lambda: simulated("pinto2023-physical", 48, mirrored=True),
    "gaps": lambda: with_gaps(simulated("pinto2023-physical", 96)),
    "excerpt": excerpt,
    "off the road": nowhere,
    "across the road": across,
}

LONG = {"motorway", "motorway-risk"}
every_recording = pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.ci] if name in LONG else []) for name in RECORDINGS],
)


@cache
def case(name: str) -> Case:
    """A recording with its compiled signals and events."""
    return case_from_trajectories(RECORDINGS[name]())


@cache
def readable(name: str) -> list[tuple[One, dict[str, Row]]]:
    """Its simulations one by one, with their readable signals."""
    run = case(name).trajectories
    ones = [One(run, number) for number in range(len(run.num_frames))]
    return [(one, signals(one)) for one in ones]


def written() -> list[Trajectories]:
    """The overtakes written by hand for and against each rule."""
    return [make().trajectories for _, _, _, make in FIXTURES]


def same(one: Row, other: Row) -> bool:
    """Whether two arrays have the same type, shape and bits."""
    return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
