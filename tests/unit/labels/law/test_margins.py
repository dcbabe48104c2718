"""Findings over spans of frames against a loop over single frames."""

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
    margin_values = np.array(draw(margins), np.float32)
    n = len(margin_values)
    start = draw(st.lists(st.integers(0, FRAMES - 1), min_size=n, max_size=n))
    length = draw(st.lists(st.integers(0, FRAMES), min_size=n, max_size=n))
    stop = np.minimum(np.add(start, length) - 1, FRAMES - 1)
    return margin_values, FrameSpan(first=np.array(start, np.int32), last=stop.astype(np.int32))


def by_hand(values: np.ndarray, start: int, stop: int) -> tuple[object, ...]:
    """Verdict, margin, first and last frame of one simulation."""
    frames_in_span = [(k, values[k]) for k in range(start, stop + 1)]
    if not frames_in_span:
        return Verdict.NOT_APPLICABLE, 0.0, NEVER, NEVER
    breach_frames = [k for k, value in frames_in_span if value < 0]
    smallest = min(value for _, value in frames_in_span)
    if not breach_frames:
        return Verdict.LEGAL, smallest, NEVER, NEVER
    return Verdict.ILLEGAL, smallest, breach_frames[0], breach_frames[-1]


@given(spans())
def test_a_negative_margin_in_a_span_is_a_breach_from_its_first_to_its_last_negative_frame(
    values_and_span,
):
    values, span = values_and_span
    dense = finding_over_span(values, span)
    rows, frames = span.instants()
    sparse = finding_at_instants(values[rows, frames], rows, frames, len(values))
    for k, row in enumerate(values):
        expected = by_hand(row, int(span.first[k]), int(span.last[k]))
        for finding in (dense, sparse):
            result = (
                finding.verdict[k],
                finding.margin[k],
                finding.first_frame[k],
                finding.last_frame[k],
            )
            assert result == expected


@given(spans())
def test_a_span_has_the_frames_from_its_start_to_its_stop(values_and_span):
    values, span = values_and_span
    simulations = np.arange(len(values))
    mask = span.mask(simulations, FRAMES)
    rows, frames = span.instants()
    assert np.argwhere(mask).tolist() == np.stack([rows, frames], axis=1).tolist()
    for k in simulations[span.is_nonempty]:
        assert reduce_span(np.maximum, values, span)[k] == values[k][mask[k]].max()


def test_a_fixture_has_the_same_finding_in_a_batch_and_alone():
    groups: dict[object, list[Case]] = {}
    for _, _, _, make in FIXTURES:
        fixture = make()
        shape = fixture.trajectories.states.s.shape
        key = (repr(fixture.trajectories.road), fixture.trajectories.unknown, shape)
        groups.setdefault(key, []).append(fixture)
    assert max(len(cases) for cases in groups.values()) > 20
    for cases in groups.values():
        batch_findings = judge_pack(PORTUGAL, concatenate(cases))
        for k, fixture in enumerate(cases):
            single_findings = judge_pack(PORTUGAL, fixture)
            for name in ("verdict", "margin", "first_frame", "last_frame", "severity", "belief"):
                in_batch, single = (
                    getattr(batch_findings, name)[k],
                    getattr(single_findings, name)[0],
                )
                assert in_batch.tolist() == single.tolist(), name
