"""Stretches of frames against the same worked out one frame at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.law_fixtures import FIXTURES

from overtaking.labels.law.judging import judge_pack
from overtaking.labels.law.margins import finding_at_instants, finding_over_span, reduce_span
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.batch import concatenate
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Case, Verdict

pytestmark = pytest.mark.ci

FRAMES = 12

# Whole numbers, so that margins of exactly 0 are common.
margins = st.lists(
    st.lists(st.integers(-2, 3), min_size=FRAMES, max_size=FRAMES), min_size=1, max_size=5
)


@st.composite
def spans(draw: st.DrawFn) -> tuple[np.ndarray, FrameSpan]:
    values = np.array(draw(margins), np.float32)
    n = len(values)
    start = draw(st.lists(st.integers(0, FRAMES - 1), min_size=n, max_size=n))
    length = draw(st.lists(st.integers(0, FRAMES), min_size=n, max_size=n))
    stop = np.minimum(np.add(start, length) - 1, FRAMES - 1)
    return values, FrameSpan(first=np.array(start, np.int32), last=stop.astype(np.int32))


def by_hand(values: np.ndarray, start: int, stop: int) -> tuple[object, ...]:
    """Verdict, margin, first and last frame of one simulation."""
    inside = [(k, values[k]) for k in range(start, stop + 1)]
    if not inside:
        return Verdict.NOT_APPLICABLE, 0.0, NEVER, NEVER
    broken = [k for k, value in inside if value < 0]
    low = min(value for _, value in inside)
    if not broken:
        return Verdict.LEGAL, low, NEVER, NEVER
    return Verdict.ILLEGAL, low, broken[0], broken[-1]


@given(spans())
def test_a_margin_that_may_never_be_negative(given_):
    values, span = given_
    dense = finding_over_span(values, span)
    rows, frames = span.instants()
    sparse = finding_at_instants(values[rows, frames], rows, frames, len(values))
    for k, row in enumerate(values):
        expected = by_hand(row, int(span.first[k]), int(span.last[k]))
        for found in (dense, sparse):
            said = found.verdict[k], found.margin[k], found.first_frame[k], found.last_frame[k]
            assert said == expected


@given(spans())
def test_a_span_has_the_frames_from_its_start_to_its_stop(given_):
    values, span = given_
    every = np.arange(len(values))
    mask = span.mask(every, FRAMES)
    rows, frames = span.instants()
    assert np.argwhere(mask).tolist() == np.stack([rows, frames], axis=1).tolist()
    for k in every[span.is_nonempty]:
        assert reduce_span(np.maximum, values, span)[k] == values[k][mask[k]].max()


def test_in_a_batch_every_fixture_is_judged_as_it_is_alone():
    groups: dict[object, list[Case]] = {}
    for _, _, _, make in FIXTURES:
        one = make()
        shape = one.trajectories.states.s.shape
        key = (repr(one.trajectories.road), one.trajectories.unknown, shape)
        groups.setdefault(key, []).append(one)
    assert max(len(cases) for cases in groups.values()) > 20
    for cases in groups.values():
        together = judge_pack(PORTUGAL, concatenate(cases))
        for k, one in enumerate(cases):
            alone = judge_pack(PORTUGAL, one)
            for name in ("verdict", "margin", "first_frame", "last_frame", "severity", "belief"):
                whole, part = getattr(together, name)[k], getattr(alone, name)[0]
                assert whole.tolist() == part.tolist(), name
