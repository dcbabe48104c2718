"""What must not change a verdict: a mirror, the order of vehicles, the clock, the company."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.cases import Track, case, ramp, seen_case
from tests.support.overtakes import CROSSED, crossing, overtake

import overtaking as ot
from overtaking.labels.law.judging import judge_pack
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.trajectories import NO_VEHICLE, Lights, States, Trajectories
from overtaking.model.verdicts import Case, Findings, Verdict

LEFT, RIGHT = int(Lights.INDICATOR_LEFT), int(Lights.INDICATOR_RIGHT)
TURNED = ("y", "d", "heading", "wheel_angle", "accel_lat", "yaw_rate")
"""States that change sign in a mirror."""


@cache
def simulated() -> Case:
    """Real overtakes in all weathers, with breaches of most rules."""
    return seen_case(ot.simulate(ot.sample("pinto2023-physical", num_simulations=96, seed=11)))


@cache
def found() -> Findings:
    return judge_pack(PORTUGAL, simulated())


def assert_equal(one: Findings, other: Findings) -> None:
    for field in dataclasses.fields(Findings):
        values, others = getattr(one, field.name), getattr(other, field.name)
        if isinstance(values, np.ndarray):
            where = np.argwhere(values != others)
            named = [(int(k), one.rule_codes[j]) for k, j in where[:5]]
            assert not named, (field.name, named)


def test_the_simulations_break_most_rules():
    broken = (found().verdict == Verdict.ILLEGAL).any(axis=0)
    assert broken.sum() >= 12


def test_in_a_mirror_the_law_is_the_same():
    recorded = simulated().trajectories
    assert_equal(found(), judge_pack(PORTUGAL, seen_case(mirrored(recorded))))


def mirrored(recorded: Trajectories) -> Trajectories:
    """The same in a world where left and right are swapped, and traffic keeps to the left."""
    states = recorded.states
    changes = {name: -getattr(states, name) for name in TURNED}
    lights = states.lights & ~np.uint8(LEFT | RIGHT)
    lights |= np.where(states.lights & LEFT, np.uint8(RIGHT), np.uint8(0))
    lights |= np.where(states.lights & RIGHT, np.uint8(LEFT), np.uint8(0))
    scenario = recorded.scenario.replace(road=recorded.road.mirror())
    return recorded.replace(scenario=scenario, states=states.replace(lights=lights, **changes))


def test_the_order_of_the_others_does_not_matter():
    recorded = simulated().trajectories
    slots = recorded.states.s.shape[1]
    order = np.array([0, *range(slots - 1, 0, -1)])
    assert_equal(found(), judge_pack(PORTUGAL, seen_case(reordered(recorded, order))))


def reordered(recorded: Trajectories, order: np.ndarray) -> Trajectories:
    """The same with other slots: slot k holds what was in slot order[k]."""
    place = np.full(256, NO_VEHICLE)
    place[order] = np.arange(len(order))
    states = States(**{f.name: getattr(recorded.states, f.name)[:, order] for f in fields(States)})
    scenario, bodies = recorded.scenario, recorded.scenario.vehicles
    moved = {f.name: getattr(bodies, f.name)[:, order] for f in fields(type(bodies))}
    percepts = recorded.percepts.replace(slot=place[recorded.percepts.slot])
    return recorded.replace(
        scenario=scenario.replace(vehicles=type(bodies)(**moved)),
        states=states,
        percepts=percepts,
        collided_with=place[recorded.collided_with],
    )


def fields(cls: type) -> tuple[dataclasses.Field, ...]:
    return dataclasses.fields(cls)


def test_a_simulation_is_judged_alike_in_any_company():
    chosen = np.array([70, 3, 41, 8])
    assert_equal(found().select(chosen), judge_pack(PORTUGAL, simulated().select(chosen)))


def test_frames_beyond_the_end_of_a_recording_do_not_matter():
    one = simulated()
    spoiled = {
        name: np.where(one.signals.valid, getattr(one.signals, name), np.float32(-7.0))
        for name in ("speed", "friction", "sight_lit", "sight_unlit", "right_edge", "left_edge")
    }
    assert_equal(found(), judge_pack(PORTUGAL, one.replace(signals=one.signals.replace(**spoiled))))


@pytest.mark.ci
@settings(max_examples=15, deadline=None)
@given(shift=st.integers(1, 400))
def test_a_recording_that_began_earlier_says_the_same_later(shift):
    lane = ramp((3 + shift * 0.05, 0), (6 + shift * 0.05, 1), frames=200 + shift)
    early = crossing_at(shift, lane, frames=200 + shift)
    late = crossing_at(0, lane[shift:], frames=200)
    one, other = judge_pack(PORTUGAL, early), judge_pack(PORTUGAL, late)
    assert (one.verdict == other.verdict).all()
    assert one.margin == pytest.approx(other.margin, abs=0.02)
    broken = one.verdict == Verdict.ILLEGAL
    assert (one.first_frame[broken] == other.first_frame[broken] + shift).all()
    assert (one.last_frame[broken] == other.last_frame[broken] + shift).all()


def crossing_at(shift: int, lane: np.ndarray, *, frames: int) -> Case:
    """Over the line in frame 100 after `shift`, where the others are as they would be then."""
    lost = shift * 0.05
    others = [(1, 70.0, 26.0), (1, -60.0, 36.0), (0, -30.0, 29.0)]
    events = {name: frame + shift for name, frame in CROSSED.items()} | {"first": shift}
    return case(
        Track(speed=30.0, s=500.0 - 30.0 * lost, lane=lane),
        Track(s=540.0 - 27.0 * lost, speed=27.0),
        *(Track(s=500.0 + s - v * lost, speed=v, lane=index) for index, s, v in others),
        frames=frames,
        events=events,
    )


@pytest.mark.ci
@settings(max_examples=20, deadline=None)
@given(near=st.floats(40.0, 150.0), more=st.floats(0.1, 100.0))
def test_a_leader_farther_off_never_makes_a_lawful_distance_unlawful(near, more):
    margins = [
        judge_pack(PORTUGAL, crossing(Track(s=s, lane=1), target={"s": s})).margin[0]
        for s in (near, near + more)
    ]
    for code in ("L3", "L4"):
        k = PORTUGAL.codes.index(code)
        assert margins[1][k] >= margins[0][k] - 1e-3


@settings(max_examples=10, deadline=None)
@given(far=st.floats(0.0, 5000.0))
def test_where_on_the_road_it_happens_does_not_matter(far):
    here = judge_pack(PORTUGAL, overtake(target={"s": 110.0}))
    there = judge_pack(PORTUGAL, overtake(ego={"s": far}, target={"s": 110.0 + far}))
    assert (here.verdict == there.verdict).all()
    assert here.margin == pytest.approx(there.margin, abs=0.02)
