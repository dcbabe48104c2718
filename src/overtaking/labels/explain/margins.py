"""Margins frame by frame, of the rules that look at every frame."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.labels.explain.explanation import case_of
from overtaking.labels.label import Labelled
from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.distances import margin_of_gap, stop_distance, sure_decel
from overtaking.labels.law.frames import Span, after_cut_ins, conduct, settled
from overtaking.labels.law.speeds import rounded, speed_limits
from overtaking.model.labels import Case, Verdict
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.world.constants import known


def margins(labelled: Labelled) -> dict[str, F64]:
    """Margins of one simulation frame by frame; the least of them is the margin of the finding.

    Args:
        labelled: A batch of one simulation with its findings.

    Returns:
        By code of rule, those that decided this simulation: L3, L10, L12, L14 and L14s. Shape
        (time,), in the unit of the rule, negative in a breach, NaN where the rule does not look.
        Other rules look at single instants, or at how long something lasts.
    """
    case, findings = case_of(labelled), labelled.findings
    verdicts = dict(zip(findings.rules, findings.verdict[0].tolist(), strict=True))
    return {
        code: of
        for code, of in _all(case).items()
        if verdicts[code] in (Verdict.LEGAL, Verdict.ILLEGAL)
    }


def _all(case: Case) -> dict[str, F64]:
    seen, span, beside, neighbour = case.signals, conduct(case), alongside(case), Around.LEADER
    side = np.full(seen.num_frames, np.nan)
    side[beside.frames] = beside.lateral_gap - known("law.side.motor")
    stop = stop_distance(seen.speed, seen.friction)
    gap, closing = seen.gap[:, neighbour], seen.closing_speed[:, neighbour]
    follow = margin_of_gap(gap, seen.speed, closing, sure_decel(seen.friction))
    counts = (seen.vehicle[0, neighbour] != NO_VEHICLE) & ~after_cut_ins(case)[0]
    return {
        "L3": np.where(counts, _within(settled(case), follow), np.nan),
        "L10": side,
        "L12": _within(span, rounded(speed_limits(case)[1]) - seen.speed),
        "L14": _within(span, seen.sight_lit - stop),
        "L14s": _within(span, seen.sight_unlit - stop),
    }


def _within(span: Span, values: NDArray[np.floating]) -> F64:
    """The first simulation of (simulation, time), NaN outside of a span."""
    frame = np.arange(values.shape[1])
    inside = (frame >= span.start[0]) & (frame <= span.stop[0])
    return np.where(inside, values[0], np.nan).astype(np.float64)
