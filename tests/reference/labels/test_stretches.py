"""What the compiled engine answers about stretches of frames is what frames say one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels.recordings import case, every_recording, readable, written
from tests.reference.labels.signals import One, Row, signals
from tests.reference.labels.stretches import answers_of

from overtaking import _core
from overtaking.labels.events import case_of
from overtaking.labels.law.frames import Span, answers, conduct
from overtaking.world.compiled import SIMD_VARIABLE

if TYPE_CHECKING:
    from overtaking.model.labels import Case

LEVELS = [name for name, available in _core.simd_levels() if available]
SPANS = dict(_core.stretch_fields())["spans"]


def whole(given: Case) -> Span:
    """All that was recorded."""
    return Span(start=given.events.first, stop=given.events.last)


def some_frames(given: Case) -> Span:
    """Stretches of every length, none among them."""
    draw = np.random.default_rng(4)
    ends = draw.integers(0, given.events.last + 1, (2, len(given.events.last))).astype(np.int32)
    return Span(start=ends[0], stop=ends[1])


def assert_same(given: Case, span: Span, ones: list[tuple[One, dict[str, Row]]]) -> None:
    """Every answer has the same bits, whatever it is asked of."""
    found = answers(given, dict.fromkeys(SPANS, span))
    for k, (one, seen) in enumerate(ones):
        frames = range(int(span.start[k]), max(int(span.stop[k]) + 1, int(span.start[k])))
        expected = answers_of(given, one, seen, dict.fromkeys(SPANS, frames))
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


@pytest.mark.parametrize("span_of", [conduct, whole, some_frames])
@every_recording
def test_every_answer_is_the_same(name, span_of):
    given = case(name)
    assert_same(given, span_of(given), readable(name))


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_answers_alike(level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    for name in ("a few of motorway-risk", "gaps"):
        assert_same(case(name), whole(case(name)), readable(name))


def test_answers_about_overtakes_written_by_hand_are_the_same():
    for run in written():
        given, one = case_of(run), One(run, 0)
        assert_same(given, whole(given), [(one, signals(one))])


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
