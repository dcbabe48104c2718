"""Margins frame by frame, of the rules that look at every frame."""

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.explain.explanation import case_of
from overtaking.labels.label import Labelled
from overtaking.labels.law import l03_follow, l10_side, l12_limit
from overtaking.labels.law.frames import ENDLESS, Span, conduct
from overtaking.labels.law.reference import follow_margins, stop_margins
from overtaking.model.labels import Case, Verdict

F64 = NDArray[np.float64]


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
    seen, span = case.signals, conduct(case)
    beside, sideways = l10_side.margins(case)
    side = np.full(seen.num_frames, np.nan)
    side[beside.frames] = sideways
    return {
        "L3": _within(l03_follow.span_of(case), follow_margins(case)),
        "L10": side,
        "L12": _within(span, l12_limit.limits(case)[1][:, None] - seen.speed),
        "L14": _within(span, stop_margins(case, seen.sight_lit)),
        "L14s": _within(span, stop_margins(case, seen.sight_unlit)),
    }


def _within(span: Span, values: NDArray[np.floating]) -> F64:
    """The first simulation of (simulation, time), NaN outside of a span."""
    inside = span.mask(np.array([0]), values.shape[1])[0] & (values[0] < ENDLESS)
    return np.where(inside, values[0], np.nan).astype(np.float64)
