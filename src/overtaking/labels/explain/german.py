"""What would have kept each German rule that has a remedy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.labels.explain import gaps
from overtaking.labels.explain.breach import Quantity, sole
from overtaking.labels.explain.remedies import REMEDIES, apart, at_limit
from overtaking.labels.law.frames import after_cut_ins
from overtaking.labels.law.germany.distances import room_for_another, way_of
from overtaking.labels.law.germany.driving import limits
from overtaking.model.signals import Around
from overtaking.world.constants import known

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.core.arrays import F32
    from overtaking.labels.explain.breach import BreachFacts, Remedy


def _ahead(asked: Callable[[F32], F32]) -> Callable[[BreachFacts], tuple[Remedy, ...]]:
    """A1, A3 and A4: more distance to the leader, in the frame that lacks most."""

    def find(facts: BreachFacts) -> tuple[Remedy, ...]:
        frames = facts.beside(Around.LEADER)
        frames = frames[~after_cut_ins(facts.case)[0, frames]]
        seen = facts.case.signals
        margins = seen.gap[0, Around.LEADER, frames] - asked(seen.speed[0, frames])
        worst = frames[int(np.abs(margins - facts.margin).argmin())]
        return gaps.more_distance(facts, Around.LEADER, worst, facts.margin)

    return find


def _at_limit(facts: BreachFacts) -> tuple[Remedy, ...]:
    """V2: at the limit."""
    return at_limit(facts, limits(facts.case)[1])


def _slower(facts: BreachFacts) -> tuple[Remedy, ...]:
    """V3: so much slower."""
    fastest = facts.frames[int(facts.case.signals.speed[0, facts.frames].argmax())]
    return facts.speed(fastest, known("law_de.fog.speed"))


def _faster(facts: BreachFacts) -> tuple[Remedy, ...]:
    """O2: so much faster."""
    speed = facts.case.signals.speed[0, facts.first]
    return facts.speed(facts.first, speed - np.float32(facts.margin))


def _behind(neighbour: Around) -> Callable[[BreachFacts], tuple[Remedy, ...]]:
    """O6 and O12: more distance to the one behind."""
    return lambda facts: gaps.more_distance(facts, neighbour, facts.first, facts.margin)


GERMAN: dict[str, Callable[[BreachFacts], tuple[Remedy, ...]]] = {
    "A1": _ahead(lambda speed: way_of(speed, "law_de.distance.courts")),
    "A3": _ahead(lambda speed: np.full_like(speed, known("law_de.distance.trucks"))),
    "A4": _ahead(room_for_another),
    "O2": _faster,
    "O3": REMEDIES["L24"],
    "O4": REMEDIES["L7"],
    "O5": lambda facts: sole(
        Quantity.SIGHT,
        float(known("law_de.pass.truck_sight")) + facts.margin,
        known("law_de.pass.truck_sight"),
        facts.first,
    ),
    "O6": _behind(Around.LEFT_FOLLOWER),
    "O7": lambda facts: apart(facts, "law_de.side.motor"),
    "O8": REMEDIES["L18"],
    "O9": REMEDIES["L29"],
    "O10": lambda facts: apart(facts, "law_de.side.bicycle"),
    "O11": REMEDIES["L9"],
    "O12": _behind(Around.FOLLOWER),
    "O13": REMEDIES["L22"],
    "O14": REMEDIES["L25"],
    "O15": REMEDIES["L26"],
    "O16": REMEDIES["L15"],
    "O17": REMEDIES["L17"],
    "V1": REMEDIES["L14"],
    "V1s": REMEDIES["L14s"],
    "V2": _at_limit,
    "V3": _slower,
    "F1": REMEDIES["L21"],
    "B1": REMEDIES["L19"],
    "S1": REMEDIES["L2"],
}
"""By the code of the rule; A2 and O1 have their margin, and no remedy."""
