"""Margins frame by frame, of the rules that look at every frame."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.explain.explanation import case_of
from overtaking.labels.label import Labelled
from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.distances import margin_of_gap, sure_decel
from overtaking.labels.law.frames import Span, conduct, settled, time_to_regain
from overtaking.labels.law.speeds import posted_limits
from overtaking.model.labels import Case, Verdict
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.world.constants import known
from overtaking.world.friction import stopping_distance

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
    seen, span, beside = case.signals, conduct(case), alongside(case)
    side = np.full(seen.num_frames, np.nan)
    side[beside.frames] = beside.lateral_gap - known("law.side.motor")
    stop = _stopping_distance(case)
    return {
        "L3": np.where(_has_settled_leader(case), _within(settled(case), _follow(case)), np.nan),
        "L10": side,
        "L12": _within(span, posted_limits(case)[1][:, None] - seen.speed),
        "L14": _within(span, seen.sight_lit - stop),
        "L14s": _within(span, seen.sight_unlit - stop),
    }


def _within(span: Span, values: NDArray[np.floating]) -> F64:
    """The first simulation of (simulation, time), NaN outside of a span."""
    frame = np.arange(values.shape[1])
    inside = (frame >= span.start[0]) & (frame <= span.stop[0])
    return np.where(inside, values[0], np.nan).astype(np.float64)


def _stopping_distance(case: Case) -> F32:
    """Of the ego, shape (simulation, time) [m]."""
    seen = case.signals
    grip = np.maximum(seen.friction, known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    return stopping_distance(seen.speed, as_f32(known("law.sight.reaction_time")), decel)


def _follow(case: Case) -> F32:
    """Gap to the leader minus the lawful gap, shape (simulation, time) [m]."""
    seen, place = case.signals, Around.LEADER
    gap, closing = seen.gap[:, place], seen.closing_speed[:, place]
    return margin_of_gap(gap, seen.speed, closing, sure_decel(seen.friction))


def _has_settled_leader(case: Case) -> Mask:
    """Whether the first simulation's leader has not cut in within 3 s, shape (time,)."""
    vehicle, lane = case.signals.vehicle[0, Around.LEADER], case.signals.lane[0]
    run, is_settled = case.trajectories, vehicle != NO_VEHICLE
    new = (vehicle[1:] != vehicle[:-1]) & is_settled[1:] & (lane[1:] == lane[:-1])
    for before in np.flatnonzero(new).tolist():
        slot, since = int(vehicle[before + 1]), slice(before + 1, before + 2 + time_to_regain(case))
        came = run.states.lane[0, slot, before] != lane[before]
        if came and (run.present is None or run.present[0, slot, before]):
            is_settled[since] &= vehicle[since] != slot
    return is_settled
