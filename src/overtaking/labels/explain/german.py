"""Remedies of the German rules with checks of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.knowledge.toml_reader import constant
from overtaking.labels.explain.remedies import (
    at_limit,
    elsewhere,
    see_oncoming_traffic,
)
from overtaking.labels.law.germany.driving import V2, V3, limits
from overtaking.labels.law.germany.opposite import O9, O16, O17
from overtaking.labels.law.germany.overtaking import (
    O2,
    O5,
    O6,
    O12,
)
from overtaking.labels.law.remedies import RemedyQuantity, more_gap, single_change
from overtaking.model.neighbours import NeighbourRole

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.labels.explain.remedies import Find
    from overtaking.labels.law.remedies import BreachContext, Remedy
    from overtaking.model.verdicts import Case, Finding


def _at_limit(facts: BreachContext) -> tuple[Remedy, ...]:
    """V2: no faster than the limit."""
    return at_limit(facts, limits(facts.case)[1])


def _slower(facts: BreachContext) -> tuple[Remedy, ...]:
    """V3: slower, down to the speed allowed in fog."""
    fastest = facts.frames[int(facts.case.signals.speed[0, facts.frames].argmax())]
    return facts.remedy_ego_speed(fastest, constant("law_de.fog.speed"))


def _faster(facts: BreachContext) -> tuple[Remedy, ...]:
    """O2: faster by the missing difference in speed."""
    speed = facts.case.signals.speed[0, facts.first_frame]
    return facts.remedy_ego_speed(facts.first_frame, speed - np.float32(facts.margin))


def _more_optical_range(facts: BreachContext) -> tuple[Remedy, ...]:
    """O5: the meteorological optical range that trucks need to overtake."""
    needed = constant("law_de.pass.truck_sight")
    return single_change(
        RemedyQuantity.SIGHT, float(needed) + facts.margin, needed, facts.first_frame
    )


def _behind(neighbour: NeighbourRole) -> Callable[[BreachContext], tuple[Remedy, ...]]:
    """O6 and O12: more distance to the vehicle behind."""
    return lambda facts: more_gap(facts, neighbour, facts.first_frame, facts.margin)


GERMAN: dict[Callable[[Case], Finding], Find] = {
    rule.check: find
    for rule, find in (
        (O2, _faster),
        (O5, _more_optical_range),
        (O6, _behind(NeighbourRole.LEFT_FOLLOWER)),
        (O9, elsewhere),
        (O12, _behind(NeighbourRole.FOLLOWER)),
        (O16, see_oncoming_traffic),
        (O17, elsewhere),
        (V2, _at_limit),
        (V3, _slower),
    )
}
"""Remedies by the check of a rule. German rules that are not listed share the check of a Portuguese
rule, and with it the remedy in `REMEDIES`."""
