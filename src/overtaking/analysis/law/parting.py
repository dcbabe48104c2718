"""Differences between two laws: overtakes that are legal under one and illegal under the other."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.labels.law.policies import breaches
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from overtaking.labels.label import LabelledTrajectories
    from overtaking.labels.law import Pack, Policy
    from overtaking.model.verdicts import Case

EXAMPLES = 5
"""Simulations that are named for each way to part."""

Judged = tuple["NDArray[np.integer]", "Case", "list[LabelledTrajectories]"]
"""Numbers of simulations, what they are, and their labels by each law."""


@dataclass(kw_only=True)
class Parted:
    """Overtakes that are legal under one law and illegal under another.

    Attributes:
        legal: Name of the law under which they are legal.
        illegal: Name of the other.
        policy: The policy of both.
        count: How many.
        rules: How many break each rule of the other.
        examples: Number of a simulation, the rule that it breaks most severely, and its margin.
    """

    legal: str
    illegal: str
    policy: str
    count: int = 0
    rules: Counter[str] = field(default_factory=Counter[str])
    examples: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    def values(self) -> dict[str, Any]:
        """Plain values, the most frequent rules first."""
        return {
            "legal_under": self.legal,
            "illegal_under": self.illegal,
            "policy": self.policy,
            "overtakes": self.count,
            "rules": dict(self.rules.most_common()),
            "examples": self.examples,
        }


def compared(
    batches: Iterable[Judged], packs: Sequence[Pack], policies: Sequence[Sequence[Policy]]
) -> dict[str, Any]:
    """How many overtakes are legal under each law and policy, and where the laws part.

    Args:
        batches: Labels by each of the laws.
        packs: The laws, two or more.
        policies: Of each law, the same names in the same order.

    Returns:
        Plain values. `classes` counts simulations by class, `conduct` all of them by whether the
        ego kept the required rules.
    """
    names = [one.name for one in policies[0]]
    classes = {(pack.name, name): Counter[str]() for pack in packs for name in names}
    conduct = {key: Counter[str]() for key in classes}
    parted = {
        (a.name, b.name, name): Parted(legal=a.name, illegal=b.name, policy=name)
        for name in names
        for a, b in permutations(packs, 2)
    }
    versions, total, overtakes = dict[str, str](), 0, 0
    for numbers, case, said in batches:
        total += len(numbers)
        overtakes += int((said[0].labels.outcome == Outcome.COMPLETED).sum())
        for pack, labelled in zip(packs, said, strict=True):
            versions[pack.name] = labelled.findings.version
            for column, name in enumerate(names):
                found = (OvertakeClass(one).title for one in labelled.labels.classes[:, column])
                classes[pack.name, name].update(found)
                conduct[pack.name, name].update(_conduct(labelled, column))
        for i, j in permutations(range(len(packs)), 2):
            batch = (numbers, case, said[i], said[j])
            for column, name in enumerate(names):
                one = parted[packs[i].name, packs[j].name, name]
                _part(one, column, batch, packs[j], policies[j][column])
    return {
        "simulations": total,
        "overtakes": overtakes,
        "rule_sets": versions,
        "laws": [
            {
                "law": law,
                "policy": name,
                "classes": dict(sorted(count.items())),
                "conduct": dict(conduct[law, name]),
            }
            for (law, name), count in classes.items()
        ],
        "parted": [one.values() for one in parted.values()],
    }


def _conduct(labelled: LabelledTrajectories, column: int) -> dict[str, int]:
    """Simulations, overtake or not, by whether required rules are broken, or in doubt."""
    broken = labelled.labels.num_broken[:, column] > 0
    doubtful = ~broken & (labelled.labels.num_undecidable[:, column] > 0)
    return {
        "kept": int((~broken & ~doubtful).sum()),
        "broken": int(broken.sum()),
        "undecidable": int(doubtful.sum()),
    }


def _part(
    into: Parted,
    column: int,
    batch: tuple[NDArray[np.integer], Case, LabelledTrajectories, LabelledTrajectories],
    pack: Pack,
    policy: Policy,
) -> None:
    """Count the overtakes of a batch that part in one direction."""
    numbers, case, legal, illegal = batch
    parts = legal.labels.classes[:, column] == OvertakeClass.SUCCESS_L
    parts &= illegal.labels.classes[:, column] == OvertakeClass.SUCCESS_I
    rows, findings = np.flatnonzero(parts), illegal.findings
    counted = breaches(findings, policy, pack, case)
    into.count += len(rows)
    for row in rows.tolist():
        codes = [code for code in policy.required if counted[row, findings.rule_codes.index(code)]]
        into.rules.update(codes)
        if len(into.examples) < EXAMPLES:
            worst = max(
                codes, key=lambda code: findings.severity[row, findings.rule_codes.index(code)]
            )
            into.examples.append(
                {
                    "simulation": int(numbers[row]),
                    "rule": worst,
                    "margin": round(
                        float(findings.margin[row, findings.rule_codes.index(worst)]), 3
                    ),
                    "unit": pack.rule(worst).unit,
                }
            )
