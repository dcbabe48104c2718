"""What is said of a recording does not depend on where, when, how often or in which order."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache

import numpy as np
import pytest

from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.snapshots import at_frame
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE, Lights, Trajectories
from overtaking.model.verdicts import Verdict
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

SIZE = 400
TIMES = [
    "following_begin",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "overlap_end",
    "return_begin",
    "return_end",
    "abort",
    "abort_end",
]


@cache
def recorded(interval_ms: int = 50, size: int = SIZE) -> Trajectories:
    given = load_specification("pinto2023-physical", {"profile.frame_interval_ms": interval_ms})
    index = np.arange(size, dtype=np.uint64)
    return engine.simulate(ScenarioSource(given, load_road(given.road), 11).sample(index))


@cache
def labelled(interval_ms: int = 50, size: int = SIZE) -> LabelledTrajectories:
    return label(recorded(interval_ms, size))


def states_with(run: Trajectories, **changes: np.ndarray) -> Trajectories:
    return run.replace(states=run.states.replace(**changes))


def test_the_origin_of_the_road_is_irrelevant():
    run = recorded()
    moved = label(states_with(run, s=run.states.s + np.int32(123_457)))
    same_sayings(moved, labelled())


def mirrored(run: Trajectories) -> Trajectories:
    """The same traffic in a world where left and right are swapped."""
    scenario, states = run.scenario, run.states
    weather = scenario.weather.replace(
        wind_direction=-scenario.weather.wind_direction, sun_azimuth=-scenario.weather.sun_azimuth
    )
    flipped = {
        name: -getattr(states, name)
        for name in ("y", "d", "heading", "wheel_angle", "accel_lat", "yaw_rate")
    }
    left, right = states.lights & Lights.INDICATOR_LEFT, states.lights & Lights.INDICATOR_RIGHT
    rest = states.lights & np.uint8(0xFF ^ (Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT))
    lights = (rest | (left << 1) | (right >> 1)).astype(np.uint8)
    world = scenario.replace(road=scenario.road.mirror(), weather=weather)
    return states_with(run.replace(scenario=world), lights=lights, **flipped)


def test_left_and_right_are_the_same_where_traffic_keeps_to_the_other_side():
    same_sayings(label(mirrored(recorded())), labelled())


def test_the_order_of_the_other_vehicles_is_irrelevant():
    run, slots = recorded(), recorded().scenario.num_slots
    # The ego first, the others the other way round.
    order = np.array([0, *range(slots - 1, 0, -1)])
    place = np.append(np.argsort(order), np.full(256 - slots, NO_VEHICLE)).astype(np.uint8)
    place[NO_VEHICLE] = NO_VEHICLE
    scenario = run.scenario.replace(
        vehicles=turned(run.scenario.vehicles, order),
        drivers=turned(run.scenario.drivers, order),
        start_s=run.scenario.start_s[:, order],
        start_lane=run.scenario.start_lane[:, order],
        start_speed=run.scenario.start_speed[:, order],
    )
    contacts = turned(run.contacts, order)
    other = run.replace(
        scenario=scenario,
        states=turned(run.states, order),
        collided_with=place[run.collided_with],
        contacts=contacts.replace(partner=place[contacts.partner]),
        percepts=run.percepts.replace(slot=place[run.percepts.slot]),
    )
    found, expected = label(other), labelled()
    assert (found.events.target_slot == place[expected.events.target_slot]).all()
    same_sayings(found, expected, but=("target_slot", "collision_slot"))


def turned(batch, order: np.ndarray):
    changes = {f.name: getattr(batch, f.name)[:, order] for f in dataclasses.fields(batch)}
    return batch.replace(**changes)


def test_a_later_start_of_the_recording_only_moves_the_times():
    run, shift = recorded(), 40
    found = label(prefixed(run, shift))
    before, after = labelled().events, found.events
    # In those that begin so late, nothing of the window of the law lies before the recording.
    late = before.attempt > 80
    assert late.sum() > 30
    for name in TIMES[1:]:
        old, new = getattr(before, name)[late], getattr(after, name)[late]
        assert (new == np.where(old == NEVER, NEVER, old + shift)).all(), name
    assert (found.labels.classes[late] == labelled().labels.classes[late]).all()


def prefixed(run: Trajectories, frames: int) -> Trajectories:
    """The recording with some seconds before it, in which everybody kept lane and speed."""

    def longer(values: np.ndarray, back: np.ndarray | int = 0) -> np.ndarray:
        first = np.repeat(values[..., :1], frames, axis=-1) - back
        return np.concatenate([first.astype(values.dtype), values], axis=-1)

    ticks = np.arange(frames, 0, -1)
    way = np.rint(run.states.speed[..., :1] * ticks * 0.05).astype(np.int64)
    arrays = {f.name: longer(getattr(run.states, f.name)) for f in dataclasses.fields(run.states)}
    return run.replace(
        num_frames=run.num_frames + np.int32(frames),
        states=run.states.replace(**arrays | {"s": longer(run.states.s, way)}),
        stage=longer(run.stage),
        collided_with=longer(run.collided_with),
        percepts=run.percepts.replace(time=run.percepts.time + np.int32(frames * 50)),
    )


@pytest.mark.ci
@pytest.mark.parametrize("interval_ms", [40, 100])
def test_classes_hardly_depend_on_the_frame_rate(interval_ms):
    size = 1200
    one, other = labelled(50, size), labelled(interval_ms, size)
    agree = (one.labels.classes == other.labels.classes).all(axis=1)
    assert agree.mean() >= (0.995 if interval_ms == 40 else 0.98)
    both = (one.events.attempt != NEVER) & (other.events.attempt != NEVER)
    times = [run.events.attempt[both] * ms for run, ms in ((one, 50), (other, interval_ms))]
    assert np.percentile(np.abs(times[0] - times[1]), 95) <= 2 * max(50, interval_ms)


def test_labels_of_a_part_are_those_of_the_whole():
    part = np.array([5, 17, 3, 211])
    same_sayings(label(recorded().select(part)), labelled().select(part))


def same_sayings(
    found: LabelledTrajectories, expected: LabelledTrajectories, but: tuple[str, ...] = ()
) -> None:
    """Events, findings, labels and features are the same in every value."""
    for name in ("events", "findings", "labels", "paper_features", "matched_features"):
        one, other = getattr(found, name), getattr(expected, name)
        for field in dataclasses.fields(one):
            values = getattr(one, field.name), getattr(other, field.name)
            if isinstance(values[0], np.ndarray) and field.name not in but:
                differ = np.flatnonzero((values[0] != values[1]).reshape(len(values[0]), -1).any(1))
                assert not len(differ), (name, field.name, differ[:5])


def test_breaches_lie_within_the_recording_and_have_negative_margins():
    found = labelled().findings
    broken = found.verdict == Verdict.ILLEGAL
    last = labelled().events.last[:, None]
    assert (found.margin[broken] < 0).all()
    assert (
        (found.first_frame >= 0)
        & (found.first_frame <= found.last_frame)
        & (found.last_frame <= last)
    )[broken].all()
    assert (found.first_frame[~broken] == NEVER).all()


def test_phases_of_completed_overtakes_are_in_order():
    events = labelled().events
    done = events.is_completed
    assert done.sum() > 50
    names = ("attempt", "overlap_begin", "overlap_end", "return_end")
    frames = [getattr(events, name)[done] for name in names]
    assert all((a <= b).all() for a, b in itertools.pairwise(frames))
    # Who cuts in closely turns back before being wholly past.
    turned = events.return_begin[done]
    assert ((frames[0] < turned) & (turned <= frames[-1])).all()
    lead = at_frame(labelled().signals.lane, events.return_end)[done]
    assert (lead == events.original_lane[done]).all()
