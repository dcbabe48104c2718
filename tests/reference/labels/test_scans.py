"""The engine scans spans of frames with the results of the readable reference, bit for bit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels import readable_scans
from tests.reference.labels.readable_recordings import (
    every_recording,
    handwritten_recordings,
    readable_runs,
    sample_case,
)
from tests.reference.labels.readable_signals import SignalArray, SingleRun, signals_of

from overtaking import _core
from overtaking.core.native import SIMD_VARIABLE
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.case import judged_span, overlaps_in
from overtaking.labels.law.margins import flags_any_and_all, minimum_to_limit, scan_spans
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

SIMD_LEVELS = [name for name, available in _core.simd_levels() if available]
SPANS = _core.FIELD_NAMES["spans"]


def whole_recording(case: Case) -> FrameSpan:
    """All recorded frames."""
    return FrameSpan(first=case.events.first, last=case.events.last)


def random_spans(case: Case) -> FrameSpan:
    """Spans of random length, some of them empty."""
    last = case.events.last
    ends = np.random.default_rng(4).integers(0, last + 1, (2, len(last))).astype(np.int32)
    return FrameSpan(first=ends[0], last=ends[1])


def frames_of(span: FrameSpan) -> list[range]:
    """The frames of each span."""
    ends = zip(span.first.tolist(), span.last.tolist(), strict=True)
    return [range(first, last + 1) for first, last in ends]


def assert_same_scans(
    case: Case, span: FrameSpan, runs: list[tuple[SingleRun, dict[str, SignalArray]]]
) -> None:
    """Scan one span for every purpose: all results have the bits of the readable reference."""
    results = scan_spans(case, dict.fromkeys(SPANS, span))
    minima = {
        "stop_lit": results.stop_lit,
        "stop_unlit": results.stop_unlit,
        "following": results.following,
        "braking": results.forced_braking,
    }
    first_frame, num_frames = results.return_opportunity
    for row, ((run, signals), frames) in enumerate(zip(runs, frames_of(span), strict=True)):
        spans = dict.fromkeys(SPANS, frames)
        expected = readable_scans.scan_results(case, run, signals, spans)
        for name, minimum in minima.items():
            min_margin, *breach = expected[name]
            assert minimum.min_margin[row].tobytes() == np.float32(min_margin).tobytes(), (
                row,
                name,
            )
            compiled_breach = [
                minimum.first_frame[row],
                minimum.last_frame[row],
                minimum.longest_run[row],
            ]
            assert compiled_breach == breach, (row, name)
        assert (first_frame[row], num_frames[row]) == expected["return_opportunity"], row
        assert results.entry_arrival[row] == expected["entry_arrival"], row
        assert results.return_arrival[row] == expected["return_arrival"], row
        for name, value in expected["worst"].items():
            bits = np.float32(value).tobytes()
            assert results.worst_measures[name][row].tobytes() == bits, (row, name)
        sums = {name: values[row] for name, values in results.recorded_sums.items()}
        assert sums == expected["sums"], row


@pytest.mark.ci
@pytest.mark.parametrize("make_span", [judged_span, whole_recording, random_spans])
@every_recording
def test_scans_of_recordings_have_the_bits_of_the_reference(name, make_span):
    case = sample_case(name)
    assert_same_scans(case, make_span(case), readable_runs(name))


@pytest.mark.parametrize("is_most", [False, True])
@pytest.mark.parametrize("make_span", [judged_span, whole_recording, random_spans])
@every_recording
def test_margins_to_a_limit_equal_a_loop_over_single_frames(name, make_span, is_most):
    case = sample_case(name)
    span, speed = make_span(case), case.signals.speed
    limit = np.random.default_rng(5).choice(speed.reshape(-1), len(speed))
    minimum = minimum_to_limit(speed, limit, span, is_most=is_most)
    for row, frames in enumerate(frames_of(span)):
        expected = readable_scans.minimum_to_limit(speed[row], limit[row], frames, is_most=is_most)
        assert (
            minimum.min_margin[row],
            minimum.first_frame[row],
            minimum.last_frame[row],
            minimum.longest_run[row],
        ) == expected, row


@pytest.mark.parametrize("level", SIMD_LEVELS)
def test_runs_longer_than_the_sixteen_frames_of_a_step_are_counted(level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    generator = np.random.default_rng(6)
    # From frames that break the limit by turns to one breach from the first frame to the last.
    threshold = np.linspace(0.0, 1.0, 200)[:, None]
    signal = np.sign(generator.random((200, 90)) - threshold).astype(np.float32)
    ends = generator.integers(-1, 95, (2, 200)).astype(np.int32)
    span = FrameSpan(first=np.maximum(ends[0], 0), last=ends[1])
    minimum = minimum_to_limit(signal, np.float32(0.0), span, is_most=False)
    recorded_span = FrameSpan(first=span.first, last=np.minimum(span.last, 89))
    for row, frames in enumerate(frames_of(recorded_span)):
        assert (
            minimum.min_margin[row],
            minimum.first_frame[row],
            minimum.last_frame[row],
            minimum.longest_run[row],
        ) == readable_scans.minimum_to_limit(signal[row], np.float32(0.0), frames, is_most=False), (
            row
        )
    assert (minimum.longest_run > 32).any()


@every_recording
def test_bits_set_in_any_and_in_all_frames_equal_a_loop_over_single_frames(name):
    case = sample_case(name)
    span, lights = random_spans(case), case.trajectories.states.lights[:, EGO_SLOT]
    any_bits, all_bits = flags_any_and_all(lights, span)
    for row, frames in enumerate(frames_of(span)):
        expected = readable_scans.flags_any_and_all(lights[row], frames)
        assert (any_bits[row], all_bits[row]) == expected, row


@pytest.mark.parametrize("make_span", [whole_recording, random_spans])
@every_recording
def test_frames_alongside_are_the_frames_with_an_overlap_of_target_and_ego(name, make_span):
    case = sample_case(name)
    span, target, begin = make_span(case), case.target, 0
    alongside = overlaps_in(case, span)
    for row, frames in enumerate(frames_of(span)):
        expected_frames = [frame for frame in frames if target.overlaps[row, frame]]
        instants = slice(begin, begin + len(expected_frames))
        begin += len(expected_frames)
        assert alongside.simulation[instants].tolist() == [row] * len(expected_frames)
        assert alongside.frame[instants].tolist() == expected_frames
        for field in ("lane", "lateral_gap", "accel"):
            expected = getattr(target, field)[row, expected_frames]
            values = getattr(alongside, field)[instants]
            assert values.tobytes() == expected.tobytes(), (row, field)
    assert begin == len(alongside.simulation)


def test_spans_of_another_number_of_simulations_are_refused():
    case = sample_case("pinto2023")
    short = FrameSpan(first=case.events.first[1:], last=case.events.last[1:])
    for scan in (
        lambda: minimum_to_limit(case.signals.speed, np.float32(0.0), short, is_most=True),
        lambda: flags_any_and_all(case.signals.lane, short),
        lambda: overlaps_in(case, short),
    ):
        with pytest.raises(ValueError, match="span: expected"):
            scan()


@pytest.mark.ci
@pytest.mark.parametrize("level", SIMD_LEVELS)
def test_every_simd_level_has_the_bits_of_the_reference(level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    for name in ("a few of motorway-risk", "gaps"):
        case = sample_case(name)
        assert_same_scans(case, whole_recording(case), readable_runs(name))


@pytest.mark.ci
def test_scans_of_handwritten_overtakes_have_the_bits_of_the_reference():
    for trajectories in handwritten_recordings():
        case, run = case_from_trajectories(trajectories), SingleRun(trajectories, 0)
        assert_same_scans(case, whole_recording(case), [(run, signals_of(run))])


@pytest.mark.ci
def test_the_compared_recordings_have_breaches_arrivals_and_critical_measures():
    cases = [sample_case(name) for name in ("pinto2023", "motorway-risk")]
    cases += [case_from_trajectories(trajectories) for trajectories in handwritten_recordings()]
    scans = [scan_spans(case, dict.fromkeys(SPANS, whole_recording(case))) for case in cases]
    for name in ("stop_lit", "stop_unlit", "following", "forced_braking"):
        first_frame = np.concatenate([getattr(scan, name).first_frame for scan in scans])
        assert (first_frame >= 0).any(), name
        assert (first_frame < 0).any(), name
    assert any((scan.entry_arrival >= 0).any() for scan in scans)
    assert any((scan.return_arrival >= 0).any() for scan in scans)
    assert any((scan.return_opportunity[1] > 0).any() for scan in scans)
    assert any(scan.worst_measures["num_close"].any() for scan in scans)
    assert any(scan.worst_measures["num_critical"].any() for scan in scans)


def test_frames_after_the_last_are_refused():
    case = sample_case("pinto2023")
    late = case.events.replace(line_crossed=case.events.last + np.int32(10_000))
    with pytest.raises(ValueError, match="no frame"):
        scan_spans(case.replace(events=late), dict.fromkeys(SPANS, whole_recording(case)))
