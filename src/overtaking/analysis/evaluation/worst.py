"""The worst scenes of a driver, for films: collisions first, then near-crashes, then breaches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from overtaking.analysis.evaluation.endpoints import POLICY
from overtaking.analysis.evaluation.results import Worst
from overtaking.labels.law.judging import stored_policy

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.measures import Columns
    from overtaking.labels.labelling import LabelledTrajectories

KEPT: Final = 10

_KINDS: Final = (
    ("own", "collides"),
    ("struck", "is struck by another vehicle"),
    ("departed", "leaves the road or spins"),
    ("near_crash", "has a near-crash"),
    ("broken", "breaks the law"),
)
"""Columns, the worst first, and what happened."""


def of_batch(labelled: LabelledTrajectories, measured: Columns) -> list[Worst]:
    """The worst scenes of a batch, the worst first; scenes in which nothing went wrong are none.

    Collisions are ordered by the speed of approach, all others by the braking that the ego needed.
    """
    hit = labelled.trajectories.contacts.closing_speed[:, 0].astype(np.float64)
    hit *= measured["collision"]
    codes = stored_policy(POLICY).required
    rows = {
        "own": measured["collision"] * (1.0 - measured["struck"]),
        "broken": sum(measured[f"{code}_broken"] for code in codes),
        **{name: measured[name] for name in ("struck", "departed", "near_crash")},
    }
    happened = np.stack([rows[name] for name, _ in _KINDS], axis=1)
    index = labelled.trajectories.scenario.scenario_index
    found: list[Worst] = []
    order = sorted(
        np.flatnonzero(happened.any(axis=1)),
        key=lambda row: _rank(happened[row], abs(hit[row]), measured["braking"][row]),
        reverse=True,
    )
    for row in order[:KEPT]:
        first = int(np.flatnonzero(happened[row])[0])
        found.append(
            Worst(
                scene=int(index[row]),
                what=_told(first, happened[row], abs(hit[row])),
                rank=_rank(happened[row], abs(hit[row]), measured["braking"][row]),
                labelled=labelled.select(np.array([row])),
            )
        )
    return found


def kept(found: list[Worst]) -> list[Worst]:
    """The worst of some scenes, the worst first."""
    return sorted(found, key=lambda one: one.rank, reverse=True)[:KEPT]


def _rank(happened: np.ndarray, hit: float, braking: float) -> tuple[float, ...]:
    kind = -float(np.flatnonzero(happened)[0])
    return kind, float(hit), float(happened[-1]), float(braking)


def _told(kind: int, happened: np.ndarray, hit: float) -> str:
    """What happened, in words."""
    _, text = _KINDS[kind]
    if hit > 0.0:
        text += f", closing at {1e-3 * hit * 3.6:.0f} km/h"
    broken = int(happened[-1])
    if broken:
        rules = "a rule" if broken == 1 else f"{broken} rules"
        text += f" and breaks {rules}" if kind < len(_KINDS) - 1 else f": {rules}"
    return text
