"""What the compiled engine answers about stretches of frames is what frames say one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels import readable_scans
from tests.reference.labels.readable_recordings import case, every_recording, readable, written
from tests.reference.labels.readable_signals import One, Row, signals

from overtaking import _core
from overtaking.core.native import SIMD_VARIABLE
from overtaking.labels.event_detection import case_of
from overtaking.labels.law.case import conduct, overlaps
from overtaking.labels.law.margins import answers, bits_within, limited
from overtaking.labels.snapshots import Span
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

LEVELS = [name for name, available in _core.simd_levels() if available]
SPANS = _core.FIELD_NAMES["spans"]


def whole(given: Case) -> Span:
    """All that was recorded."""
    return Span(start=given.events.first, stop=given.events.last)


def some_frames(given: Case) -> Span:
    """Stretches of every length, none among them."""
    draw = np.random.default_rng(4)
    ends = draw.integers(0, given.events.last + 1, (2, len(given.events.last))).astype(np.int32)
    return Span(start=ends[0], stop=ends[1])


def ranges(span: Span) -> list[range]:
    """The frames of each span."""
    ends = zip(span.start.tolist(), span.stop.tolist(), strict=True)
    return [range(start, stop + 1) for start, stop in ends]


def assert_same(given: Case, span: Span, ones: list[tuple[One, dict[str, Row]]]) -> None:
    """Every answer has the same bits, whatever it is asked of."""
    found = answers(given, dict.fromkeys(SPANS, span))
    for k, (one, seen) in enumerate(ones):
        frames = range(int(span.start[k]), max(int(span.stop[k]) + 1, int(span.start[k])))
        expected = readable_scans.answers_of(given, one, seen, dict.fromkeys(SPANS, frames))
        for name in ("stop_lit", "stop_unlit", "follow", "braking"):
            margin = getattr(found, name)
            low, *frames = expected[name]
            assert margin.low[k].tobytes() == np.float32(low).tobytes(), (k, name)
            found_frames = [margin.first[k], margin.last[k], margin.longest[k]]
            assert found_frames == frames, (k, name)
        assert (found.due[0][k], found.due[1][k]) == expected["due"], k
        assert found.entry_arrival[k] == expected["entry_arrival"], k
        assert found.return_arrival[k] == expected["return_arrival"], k
        for name, value in expected["worst"].items():
            assert found.worst[name][k].tobytes() == np.float32(value).tobytes(), (k, name)
        assert {name: row[k] for name, row in found.sums.items()} == expected["sums"], k


@pytest.mark.ci
@pytest.mark.parametrize("span_of", [conduct, whole, some_frames])
@every_recording
def test_every_answer_is_the_same(name, span_of):
    given = case(name)
    assert_same(given, span_of(given), readable(name))


@pytest.mark.parametrize("is_most", [False, True])
@pytest.mark.parametrize("span_of", [conduct, whole, some_frames])
@every_recording
def test_margins_to_a_limit_are_those_of_the_frames(name, span_of, is_most):
    given = case(name)
    span, speed = span_of(given), given.signals.speed
    limit = np.random.default_rng(5).choice(speed.reshape(-1), len(speed))
    found = limited(speed, limit, span, is_most=is_most)
    for k, frames in enumerate(ranges(span)):
        expected = readable_scans.limited(speed[k], limit[k], frames, is_most=is_most)
        got = found.low[k], found.first[k], found.last[k], found.longest[k]
        assert got == expected, k


@pytest.mark.parametrize("level", LEVELS)
def test_runs_of_any_length_are_counted_across_sixteen_frames(level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    draw = np.random.default_rng(6)
    # From frames that take turns to one breach all along.
    signal = np.sign(draw.random((200, 90)) - np.linspace(0.0, 1.0, 200)[:, None]).astype(
        np.float32
    )
    ends = draw.integers(-1, 95, (2, 200)).astype(np.int32)
    span = Span(start=np.maximum(ends[0], 0), stop=ends[1])
    found = limited(signal, np.float32(0.0), span, is_most=False)
    for k, frames in enumerate(ranges(Span(start=span.start, stop=np.minimum(span.stop, 89)))):
        low, *ends_and_run = readable_scans.limited(
            signal[k], np.float32(0.0), frames, is_most=False
        )
        assert found.low[k] == low, k
        assert [found.first[k], found.last[k], found.longest[k]] == ends_and_run, k
    assert (found.longest > 32).any()


@every_recording
def test_bits_that_are_set_ever_and_always_are_those_of_the_frames(name):
    given = case(name)
    span, lights = some_frames(given), given.trajectories.states.lights[:, EGO_SLOT]
    found = bits_within(lights, span)
    for k, frames in enumerate(ranges(span)):
        assert (found[0][k], found[1][k]) == readable_scans.bits_within(lights[k], frames), k


@pytest.mark.parametrize("span_of", [whole, some_frames])
@every_recording
def test_who_is_alongside_is_who_overlaps_frame_by_frame(name, span_of):
    given = case(name)
    span, found = span_of(given), overlaps(given, span_of(given))
    target, met = given.target, 0
    for k, frames in enumerate(ranges(span)):
        there = [t for t in frames if target.overlaps[k, t]]
        here = slice(met, met + len(there))
        met += len(there)
        assert found.rows[here].tolist() == [k] * len(there)
        assert found.frames[here].tolist() == there
        for field in ("lane", "lateral_gap", "accel"):
            expected = getattr(target, field)[k, there]
            assert getattr(found, field)[here].tobytes() == expected.tobytes(), (k, field)
    assert met == len(found.rows)


def test_a_recording_of_another_shape_is_refused():
    given = case("pinto2023")
    short = Span(start=given.events.first[1:], stop=given.events.last[1:])
    for ask in (
        lambda: limited(given.signals.speed, np.float32(0.0), short, is_most=True),
        lambda: bits_within(given.signals.lane, short),
        lambda: overlaps(given, short),
    ):
        with pytest.raises(ValueError, match="span: expected"):
            ask()


@pytest.mark.ci
@pytest.mark.parametrize("level", LEVELS)
def test_every_level_answers_alike(level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    for name in ("a few of motorway-risk", "gaps"):
        assert_same(case(name), whole(case(name)), readable(name))


@pytest.mark.ci
def test_answers_about_overtakes_written_by_hand_are_the_same():
    for run in written():
        given, one = case_of(run), One(run, 0)
        assert_same(given, whole(given), [(one, signals(one))])


@pytest.mark.ci
def test_what_they_agree_on_has_something_of_everything():
    batches = [case(name) for name in ("pinto2023", "motorway-risk")]
    batches += [case_of(run) for run in written()]
    found = [answers(given, dict.fromkeys(SPANS, whole(given))) for given in batches]
    for name in ("stop_lit", "stop_unlit", "follow", "braking"):
        breach = np.concatenate([getattr(each, name).first for each in found])
        assert (breach >= 0).any(), name
        assert (breach < 0).any(), name
    for arrivals in (
        [each.entry_arrival for each in found],
        [each.return_arrival for each in found],
    ):
        assert (np.concatenate(arrivals) >= 0).any()
    assert any((each.due[1] > 0).any() for each in found)
    assert any(each.worst["num_close"].any() for each in found)
    assert any(each.worst["num_critical"].any() for each in found)


def test_frames_that_do_not_exist_are_refused():
    given = case("pinto2023")
    late = given.events.replace(line_crossed=given.events.last + np.int32(10_000))
    with pytest.raises(ValueError, match="no frame"):
        answers(given.replace(events=late), dict.fromkeys(SPANS, whole(given)))
