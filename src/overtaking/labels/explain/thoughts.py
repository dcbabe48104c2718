"""What the driver believed at each decision, held against the law."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from overtaking.labels.law import Finding, Pack
from overtaking.labels.law.beliefs import (
    Margin,
    belief,
    decision_at,
    margins_of,
)
from overtaking.labels.law.distances import margin_ahead, margin_behind, margin_of_gap
from overtaking.labels.law.gaps import L3, L4, L5, L8
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle
from overtaking.model.verdicts import Belief, Case

_MARGINS: dict[tuple[ManoeuvreKind, PerceivedVehicle], tuple[Callable[[Case], Finding], Margin]] = {
    (ManoeuvreKind.PULL_OUT, PerceivedVehicle.LEADER): (L3.check, margin_of_gap),
    (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_LEADER): (L4.check, margin_ahead),
    (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_FOLLOWER): (L5.check, margin_behind),
    (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_LEADER): (L8.check, margin_of_gap),
    (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_FOLLOWER): (L8.check, margin_behind),
}
"""By the kind of decision and the neighbour, the check that judges the gap, and its margin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thought:
    """What the law says of one neighbour at one decision, in truth and as believed.

    Attributes:
        decision: Row of the percepts.
        whom: The neighbour.
        code: Of the rule.
        margin: By the true gap and closing speed [m].
        believed_margin: By those believed; None for a vehicle that was not noticed [m].
        belief: What that makes of the driver.
    """

    decision: int
    whom: PerceivedVehicle
    code: str
    margin: float
    believed_margin: float | None
    belief: Belief


def thoughts(case: Case, pack: Pack) -> tuple[Thought, ...]:
    """Compare the law with what the driver believed of each vehicle at its decisions.

    Args:
        case: One simulation.
        pack: The pack of rules. Neighbours that no rule of it judges are left out.

    Returns:
        One item for each neighbour at each decision, in the order of decisions. Decisions to abort
        have no item because no rule judges them; recordings without percepts have no items.
    """
    percepts = case.trajectories.percepts
    if "percepts" in case.trajectories.unknown:
        return ()
    comparisons = list[Thought]()
    for row in np.flatnonzero(percepts.valid[0]).tolist():
        kind = ManoeuvreKind(int(percepts.kind[0, row]))
        for whom in PerceivedVehicle:
            has_neighbour = percepts.slot[0, row, whom] != NO_VEHICLE
            if has_neighbour and (kind, whom) in _MARGINS:
                check, margin = _MARGINS[kind, whom]
                codes = [rule.code for rule in pack.deciding_rules if rule.check is check]
                # One comparison is enough: rules with the same check have the same margin.
                comparisons += [_thought(case, row, whom, code, margin) for code in codes[:1]]
    return tuple(comparisons)


def _thought(case: Case, row: int, whom: PerceivedVehicle, code: str, margin: Margin) -> Thought:
    percepts, at = case.trajectories.percepts, (slice(0, 1), row, whom)
    decision = decision_at(case, np.array([row]), np.array([True]), percepts.time[:1, row])
    true, believed = (float(one[0]) for one in margins_of(percepts, at, decision, margin))
    return Thought(
        decision=row,
        whom=whom,
        code=code,
        margin=true,
        believed_margin=believed if percepts.is_detected[0, row, whom] else None,
        belief=Belief(int(belief(case, decision, {whom: margin})[0])),
    )
