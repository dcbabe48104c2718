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
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.case import judged_span, overlaps_in
from overtaking.labels.law.margins import flags_any_and_all, minimum_to_limit, scan_spans
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

LEVELS = [name for name, available in _core.simd_levels() if available]
SPANS = _core.FIELD_NAMES["spans"]


def whole(given: Case) -> FrameSpan:
    """All that was recorded."""
    return FrameSpan(first=given.events.first, last=given.events.last)


def some_frames(given: Case) -> FrameSpan:
    """Stretches of every length, none among them."""
    draw = np.random.default_rng(4)
    ends = draw.integers(0, given.events.last + 1, (2, len(given.events.last))).astype(np.int32)
    return FrameSpan(first=ends[0], last=ends[1])


def ranges(span: FrameSpan) -> list[range]:
    """The frames of each span."""
    ends = zip(span.first.tolist(), span.last.tolist(), strict=True)
    return [range(start, stop + 1) for start, stop in ends]


def assert_same(given: Case, span: FrameSpan, ones: list[tuple[One, dict[str, Row]]]) -> None:
    """Every answer has the same bits, whatever it is asked of."""
    found = scan_spans(given, dict.fromkeys(SPANS, span))
    for k, (one, seen) in enumerate(ones):
        frames = range(int(span.first[k]), max(int(span.last[k]) + 1, int(span.first[k])))
        expected = readable_scans.answers_of(given, one, seen, dict.fromkeys(SPANS, frames))
        minima = {
            "stop_lit": found.stop_lit,
            "stop_unlit": found.stop_unlit,
            "follow": found.following,
            "braking": found.forced_braking,
        }
        for name, minimum in minima.items():
            min_margin, *frames = expected[name]
            assert minimum.min_margin[k].tobytes() == np.float32(min_margin).tobytes(), (k, name)
            breach = [minimum.first_frame[k], minimum.last_frame[k], minimum.longest_run[k]]
            assert breach == frames, (k, name)
        assert (found.return_opportunity[0][k], found.return_opportunity[1][k]) == expected[
            "due"
        ], k
        assert found.entry_arrival[k] == expected["entry_arrival"], k
        assert found.return_arrival[k] == expected["return_arrival"], k
        for name, value in expected["worst"].items():
            assert found.worst_measures[name][k].tobytes() == np.float32(value).tobytes(), (k, name)
        assert {name: row[k] for name, row in found.recorded_sums.items()} == expected["sums"], k


@pytest.mark.ci
@pytest.mark.parametrize("span_of", [judged_span, whole, some_frames])
@every_recording
def test_every_answer_is_the_same(name, span_of):
    given = case(name)
    assert_same(given, span_of(given), readable(name))


@pytest.mark.parametrize("is_most", [False, True])
@pytest.mark.parametrize("span_of", [judged_span, whole, some_frames])
@every_recording
def test_margins_to_a_limit_are_those_of_the_frames(name, span_of, is_most):
    given = case(name)
    span, speed = span_of(given), given.signals.speed
    limit = np.random.default_rng(5).choice(speed.reshape(-1), len(speed))
    found = minimum_to_limit(speed, limit, span, is_most=is_most)
    for k, frames in enumerate(ranges(span)):
        expected = readable_scans.limited(speed[k], limit[k], frames, is_most=is_most)
        got = found.min_margin[k], found.first_frame[k], found.last_frame[k], found.longest_run[k]
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
    span = FrameSpan(first=np.maximum(ends[0], 0), last=ends[1])
    found = minimum_to_limit(signal, np.float32(0.0), span, is_most=False)
    for k, frames in enumerate(ranges(FrameSpan(first=span.first, last=np.minimum(span.last, 89)))):
        low, *ends_and_run = readable_scans.limited(
            signal[k], np.float32(0.0), frames, is_most=False
        )
        assert found.min_margin[k] == low, k
        assert [found.first_frame[k], found.last_frame[k], found.longest_run[k]] == ends_and_run, k
    assert (found.longest_run > 32).any()


@every_recording
def test_bits_that_are_set_ever_and_always_are_those_of_the_frames(name):
    given = case(name)
    span, lights = some_frames(given), given.trajectories.states.lights[:, EGO_SLOT]
    found = flags_any_and_all(lights, span)
    for k, frames in enumerate(ranges(span)):
        assert (found[0][k], found[1][k]) == readable_scans.bits_within(lights[k], frames), k


@pytest.mark.parametrize("span_of", [whole, some_frames])
@every_recording
def test_who_is_alongside_is_who_overlaps_frame_by_frame(name, span_of):
    given = case(name)
    span, found = span_of(given), overlaps_in(given, span_of(given))
    target, met = given.target, 0
    for k, frames in enumerate(ranges(span)):
        there = [t for t in frames if target.overlaps[k, t]]
        here = slice(met, met + len(there))
        met += len(there)
        assert found.simulation[here].tolist() == [k] * len(there)
        assert found.frame[here].tolist() == there
        for field in ("lane", "lateral_gap", "accel"):
            expected = getattr(target, field)[k, there]
            assert getattr(found, field)[here].tobytes() == expected.tobytes(), (k, field)
    assert met == len(found.simulation)


def test_a_recording_of_another_shape_is_refused():
    given = case("pinto2023")
    short = FrameSpan(first=given.events.first[1:], last=given.events.last[1:])
    for ask in (
        lambda: minimum_to_limit(given.signals.speed, np.float32(0.0), short, is_most=True),
        lambda: flags_any_and_all(given.signals.lane, short),
        lambda: overlaps_in(given, short),
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
        given, one = case_from_trajectories(run), One(run, 0)
        assert_same(given, whole(given), [(one, signals(one))])


@pytest.mark.ci
def test_what_they_agree_on_has_something_of_everything():
    batches = [case(name) for name in ("pinto2023", "motorway-risk")]
    batches += [case_from_trajectories(run) for run in written()]
    found = [scan_spans(given, dict.fromkeys(SPANS, whole(given))) for given in batches]
    for name in ("stop_lit", "stop_unlit", "following", "forced_braking"):
        breach = np.concatenate([getattr(each, name).first_frame for each in found])
        assert (breach >= 0).any(), name
        assert (breach < 0).any(), name
    for arrivals in (
        [each.entry_arrival for each in found],
        [each.return_arrival for each in found],
    ):
        assert (np.concatenate(arrivals) >= 0).any()
    assert any((each.return_opportunity[1] > 0).any() for each in found)
    assert any(each.worst_measures["num_close"].any() for each in found)
    assert any(each.worst_measures["num_critical"].any() for each in found)


def test_frames_that_do_not_exist_are_refused():
    given = case("pinto2023")
    late = given.events.replace(line_crossed=given.events.last + np.int32(10_000))
    with pytest.raises(ValueError, match="no frame"):
        scan_spans(given.replace(events=late), dict.fromkeys(SPANS, whole(given)))
