"""What compiled rules and measures find over stretches is what the readable ones find."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from tests.support.recordings import with_gaps

from overtaking import _core
from overtaking.labels.events import find_events
from overtaking.labels.features import encounters, past
from overtaking.labels.features import engine as fast_measures
from overtaking.labels.features import reference as measures
from overtaking.labels.features.encounters import Side
from overtaking.labels.law import engine, reference
from overtaking.labels.law.frames import Span, conduct, lowest, manoeuvre, reduced
from overtaking.labels.signals.engine import neighbours_at, signals, target_signals
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.trajectory import Lights
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine as simulator
from overtaking.world.compiled import SIMD_VARIABLE

LEVELS = [name for name, available in _core.simd_levels() if available]


@cache
def case(profile: str = "pinto2023", *, gaps: bool = False) -> Case:
    given = spec(profile)
    road = load_road(given.road)
    run = simulator.simulate(sample(given, road, 21, np.arange(192, dtype=np.uint64)))
    run = with_gaps(run) if gaps else run
    seen = signals(run)
    events = find_events(run, seen)
    target = target_signals(run, seen, events)
    return Case(trajectories=run, signals=seen, events=events, target=target)


def whole(given: Case) -> Span:
    """All that was recorded."""
    return Span(start=given.events.first, stop=given.events.last)


def some_frames(given: Case) -> Span:
    """Stretches of every length, none among them."""
    draw = np.random.default_rng(4)
    ends = draw.integers(0, given.events.last + 1, (2, len(given.events.last))).astype(np.int32)
    return Span(start=ends[0], stop=ends[1])


CASES = {
    "study": case,
    "risk": lambda: case("motorway-risk"),
    "gaps": lambda: case(gaps=True),
}
SPANS = {"conduct": conduct, "manoeuvre": manoeuvre, "all": whole, "some frames": some_frames}

every_case = pytest.mark.parametrize("make", CASES.values(), ids=list(CASES))
every_span = pytest.mark.parametrize("span_of", SPANS.values(), ids=list(SPANS))


@pytest.fixture(params=LEVELS, autouse=True)
def level(request, monkeypatch):
    """Everything is worked out at every SIMD level."""
    monkeypatch.setenv(SIMD_VARIABLE, request.param)


def same(one: np.ndarray, other: np.ndarray, where: np.ndarray | slice = slice(None)) -> bool:
    return one.dtype == other.dtype and one[where].tobytes() == other[where].tobytes()


def assert_same_stretch(expected, found, span: Span) -> None:
    for field in dataclasses.fields(expected):
        a, b = getattr(expected, field.name), getattr(found, field.name)
        assert same(a, b, span.exists), field.name


@every_span
@every_case
def test_margins_to_a_stop_are_the_same(make, span_of):
    given = make()
    span = span_of(given)
    for sight in (given.signals.sight_lit, given.signals.sight_unlit):
        expected = reference.stop_margin(given, sight, span)
        assert_same_stretch(expected, engine.stop_margin(given, sight, span), span)


@every_span
@every_case
def test_margins_to_the_leader_are_the_same(make, span_of):
    given = make()
    span = span_of(given)
    expected = reference.follow_margin(given, span)
    assert_same_stretch(expected, engine.follow_margin(given, span), span)


@every_span
@every_case
def test_the_duty_to_return_is_the_same(make, span_of):
    given = make()
    span = span_of(given)
    expected, found = (of.duty_to_return(given, span) for of in (reference, engine))
    assert (expected[1] > 0).any()
    for a, b in zip(expected, found, strict=True):
        assert same(a, b)


@every_span
@every_case
def test_braking_forced_on_others_is_the_same(make, span_of):
    given = make()
    span = span_of(given)
    expected = reference.braking_margin(given, span)
    assert_same_stretch(expected, engine.braking_margin(given, span), span)


@every_span
@every_case
def test_extremes_are_the_same(make, span_of):
    given = make()
    span = span_of(given)
    for values in (given.signals.speed, given.signals.left_reach):
        assert same(lowest(values, span), engine.lowest(values, span))
        assert same(reduced(np.maximum, values, span), engine.highest(values, span))


@every_span
@every_case
def test_the_worst_of_each_measure_is_the_same(make, span_of):
    given = make()
    expected, found = (of.worst(given, span_of(given)) for of in (measures, fast_measures))
    assert expected.keys() == found.keys()
    assert expected["num_close"].any()
    assert expected["num_critical"].any()
    for name, values in expected.items():
        assert same(values, found[name]), name


@every_case
def test_sums_over_frames_are_the_same(make):
    given = make()
    last = given.events.last - np.int32(30)
    expected, found = (of.sums(given, last) for of in (measures, fast_measures))
    assert expected.keys() == found.keys()
    for name, values in expected.items():
        assert same(values, found[name]), name


@every_span
@every_case
def test_what_is_below_and_above_a_limit_is_the_same(make, span_of):
    given = make()
    span, speed = span_of(given), given.signals.speed
    limit = speed[np.arange(len(speed)), given.events.last // 2]
    for name in ("below", "above"):
        expected, found = (getattr(of, name)(speed, limit, span) for of in (reference, engine))
        assert (expected.first >= 0).any()
        assert (expected.first < 0).any()
        assert_same_stretch(expected, found, span)


@every_case
@pytest.mark.parametrize("bit", [Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT])
def test_lamps_that_were_not_on_around_a_crossing_are_the_same(make, bit):
    given = make()
    early = np.where(given.events.attempted, np.int32(5), np.int32(-1))
    late = given.events.last - np.int32(3)
    for crossed in (given.events.line_crossed, given.events.return_end, early, late):
        expected, found = (of.dark(given, crossed, int(bit)) for of in (reference, engine))
        assert (expected[0] > 0).any()
        for a, b in zip(expected, found, strict=True):
            assert same(a, b)


@every_span
@every_case
def test_the_target_in_the_frames_of_a_span_is_the_same(make, span_of):
    given = make()
    span = span_of(given)
    expected, found = (of.of_target(given, span) for of in (reference, engine))
    assert expected.keys() == found.keys()
    # Where there is no target, or it is not there, its numbers mean nothing.
    there = given.target.valid[span.frames()]
    assert there.any()
    assert same(expected["overlaps"], found["overlaps"])
    for name, values in expected.items():
        assert same(values, found[name], there), name


def instants(given: Case) -> tuple[np.ndarray, np.ndarray]:
    """Frames in an order of their own, some of them twice."""
    draw = np.random.default_rng(5)
    rows = draw.integers(0, len(given.events.last), 500)
    return rows, (given.events.last[rows] * draw.random(500)).astype(np.intp)


@every_case
@pytest.mark.parametrize("place", Around)
def test_encounters_at_single_frames_are_the_same(make, place):
    given = make()
    rows, frames = instants(given)
    side = Side.AHEAD if place % 2 == 0 else Side.BEHIND
    expected = encounters.encounter(given, place, side, rows, frames)
    found = fast_measures.encounter(given, place, side, rows, frames)
    assert expected.valid.any()
    for field in dataclasses.fields(expected):
        assert same(getattr(expected, field.name), getattr(found, field.name)), field.name
    near = neighbours_at(given.trajectories, given.signals, place, rows, frames)
    assert same(near.gap, expected.gap)
    assert same(near.closing_speed, expected.closing_speed)
    assert same(near.exists, expected.valid)


@every_case
def test_arrivals_where_the_ego_was_are_the_same(make):
    given = make()
    rows, frames = instants(given)
    vehicles = given.trajectories.scenario.num_vehicles[rows].astype(np.intp)
    slot, begin = 1 + rows % (vehicles - 1), frames.astype(np.int32)
    expected = past.first_past(given, rows, slot, begin)
    found = fast_measures.first_past(given, rows, slot, begin)
    assert (expected >= 0).any()
    assert (expected < 0).any()
    assert same(expected, found)


def test_signals_that_somebody_changed_are_believed():
    given = case()
    span = conduct(given)
    before = engine.follow_margin(given, span)
    farther = given.signals.replace(gap=given.signals.gap + np.float32(10.0))
    after = engine.follow_margin(given.replace(signals=farther), span)
    counts = span.exists & (before.low < 1e30)
    np.testing.assert_allclose(after.low[counts], before.low[counts] + 10.0, rtol=1e-5, atol=1e-3)


def test_frames_and_slots_that_do_not_exist_are_refused():
    given = case()
    rows, frames = instants(given)
    run, seen = given.trajectories, given.signals
    with pytest.raises(ValueError, match="expected recorded frames"):
        neighbours_at(run, seen, Around.LEADER, rows, frames + seen.num_frames)
    with pytest.raises(ValueError, match="expected recorded frames"):
        fast_measures.encounter(given, Around.LEADER, Side.AHEAD, rows - len(seen.valid), frames)
    with pytest.raises(ValueError, match="no frame"):
        engine.dark(given, given.events.last + np.int32(10_000), 1)
