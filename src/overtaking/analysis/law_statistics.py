"""Shares of legal overtakes as tolerances grow, and overtakes on which two laws differ."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.result_methods import Plottable
from overtaking.core.equality import ContentEquality
from overtaking.core.units import mps_from_kmh
from overtaking.labels.law.judging import breach_duration, counted_breaches
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import OvertakeClass, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from overtaking.core.arrays import Mask
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.labels.law.judging import Policy
    from overtaking.labels.law.rule import Pack
    from overtaking.model.verdicts import Case

STEPS = {
    "distance": ("m", "m", (0.0, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0)),
    "speed": ("m/s", "km/h", (0.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0)),
    "time": ("s", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0)),
    "lasting": ("", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0)),
}
"""For each tolerance the unit of the margins that it relaxes, empty for the margins of all rules;
the unit in which results show it; and its values in that unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve(ContentEquality, Plottable):
    """Legal overtakes under one policy.

    Attributes:
        pack: Version of the rules.
        policy: Name of the policy.
        overtakes: Number of completed overtakes.
        legal: Legal ones among them.
        undecided: Without a breach, but with a required rule that is undecidable, unless the policy
            takes that for kept.
        titles: Title of each required rule, by code.
        broken: Overtakes that break a rule, by code.
        alone: Overtakes that break this rule and no other.
        relaxed: Legal overtakes by tolerance and value, all rules being relaxed by as much.
        by_rule: The same for one rule alone, its margin being relaxed; values as in `relaxed`.
    """

    pack: str
    policy: str
    overtakes: int
    legal: int
    undecided: int
    titles: dict[str, str]
    broken: dict[str, int]
    alone: dict[str, int]
    relaxed: dict[str, list[int]]
    by_rule: dict[str, list[int]]

    def values(self) -> dict[str, Any]:
        """Plain values; shares are of completed overtakes."""
        num_overtakes = max(self.overtakes, 1)
        return {
            "rule_set": self.pack,
            "policy": self.policy,
            "overtakes": self.overtakes,
            "legal": self.legal,
            "undecided": self.undecided,
            "legal_share": self.legal / num_overtakes,
            "rules": [
                {
                    "rule": code,
                    "title": title,
                    "broken": self.broken[code],
                    "alone": self.alone[code],
                }
                for code, title in self.titles.items()
            ],
            "tolerances": [
                {
                    "tolerance": name,
                    "unit": STEPS[name][1],
                    "values": list(STEPS[name][2]),
                    "legal_share": [count / num_overtakes for count in counts],
                }
                for name, counts in self.relaxed.items()
            ],
            "tolerances_by_rule": [
                {"rule": code, "legal_share": [count / num_overtakes for count in counts]}
                for code, counts in self.by_rule.items()
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class _CompletedOvertakes:
    """The completed overtakes of a batch; arrays of shape (overtake, required rule)."""

    counted: Mask
    excess: NDArray[np.floating]
    lasting: NDArray[np.floating]
    doubtful: Mask


def curve(
    batches: Iterable[tuple[LabelledTrajectories, Case]], pack: Pack, policy: Policy
) -> Curve:
    """The curve of all completed overtakes.

    Args:
        batches: Labels by the pack, with what they are about; one or more.
        pack: The rules.
        policy: Which of them count.
    """
    overtakes, version = [], pack.version
    for labelled, case in batches:
        overtakes.append(_completed_overtakes(labelled, case, pack, policy))
        version = labelled.findings.version
    all_overtakes = _CompletedOvertakes(
        counted=np.concatenate([overtakes_of_batch.counted for overtakes_of_batch in overtakes]),
        excess=np.concatenate([overtakes_of_batch.excess for overtakes_of_batch in overtakes]),
        lasting=np.concatenate([overtakes_of_batch.lasting for overtakes_of_batch in overtakes]),
        doubtful=np.concatenate([overtakes_of_batch.doubtful for overtakes_of_batch in overtakes]),
    )
    return _curve(all_overtakes, pack, policy, version)


def _completed_overtakes(
    labelled: LabelledTrajectories, case: Case, pack: Pack, policy: Policy
) -> _CompletedOvertakes:
    findings = labelled.findings
    columns = [findings.rule_codes.index(code) for code in policy.required]
    is_completed = np.flatnonzero(labelled.labels.outcome == Outcome.COMPLETED)
    lasting = np.stack([breach_duration(findings, column, case) for column in columns], axis=1)
    return _CompletedOvertakes(
        counted=counted_breaches(findings, policy, pack, case)[is_completed][:, columns],
        excess=-findings.margin[is_completed][:, columns],
        lasting=lasting[is_completed],
        doubtful=(findings.verdict == Verdict.UNDECIDABLE)[is_completed][:, columns],
    )


def _curve(overtakes: _CompletedOvertakes, pack: Pack, policy: Policy, version: str) -> Curve:
    units = np.array([pack.rule(code).unit for code in policy.required])
    counted = overtakes.counted
    doubtful = overtakes.doubtful.any(axis=1) & (not policy.allows_undecided)

    def legal(broken: Mask) -> int:
        return int((~broken.any(axis=1) & ~doubtful).sum())

    def relaxed(name: str, is_relaxed: Mask) -> list[int]:
        measured = overtakes.lasting if name == "lasting" else overtakes.excess
        return [legal(counted & ~(is_relaxed & (measured <= value))) for value in tolerances(name)]

    single = counted.sum(axis=1) == 1
    by_rule = {}
    for column, code in enumerate(policy.required):
        of_unit = [name for name, (unit, _, _) in STEPS.items() if unit == units[column]]
        if of_unit:
            by_rule[code] = relaxed(of_unit[0], np.arange(len(units)) == column)
    return Curve(
        pack=version,
        policy=policy.name,
        overtakes=len(counted),
        legal=legal(counted),
        undecided=int((doubtful & ~counted.any(axis=1)).sum()),
        titles={code: pack.rule(code).title for code in policy.required},
        broken=dict(zip(policy.required, counted.sum(axis=0).tolist(), strict=True)),
        alone=dict(zip(policy.required, counted[single].sum(axis=0).tolist(), strict=True)),
        relaxed={
            name: relaxed(name, (units == unit) | (unit == ""))
            for name, (unit, _, _) in STEPS.items()
        },
        by_rule=by_rule,
    )


def tolerances(name: str) -> tuple[float, ...]:
    """The values of a tolerance in SI."""
    _, shown_unit, values = STEPS[name]
    return tuple(mps_from_kmh(value) for value in values) if shown_unit == "km/h" else values


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
    names = [difference.name for difference in policies[0]]
    classes = {(pack.name, name): Counter[str]() for pack in packs for name in names}
    conduct = {key: Counter[str]() for key in classes}
    parted = {
        (a.name, b.name, name): Parted(legal=a.name, illegal=b.name, policy=name)
        for name in names
        for a, b in permutations(packs, 2)
    }
    versions, total, overtakes = dict[str, str](), 0, 0
    for numbers, case, labelled_by_law in batches:
        total += len(numbers)
        overtakes += int((labelled_by_law[0].labels.outcome == Outcome.COMPLETED).sum())
        for pack, labelled in zip(packs, labelled_by_law, strict=True):
            versions[pack.name] = labelled.findings.version
            for column, name in enumerate(names):
                found = (
                    OvertakeClass(difference).title
                    for difference in labelled.labels.classes[:, column]
                )
                classes[pack.name, name].update(found)
                conduct[pack.name, name].update(_conduct(labelled, column))
        for i, j in permutations(range(len(packs)), 2):
            batch = (numbers, case, labelled_by_law[i], labelled_by_law[j])
            for column, name in enumerate(names):
                difference = parted[packs[i].name, packs[j].name, name]
                _count_differences(difference, column, batch, packs[j], policies[j][column])
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
        "parted": [difference.values() for difference in parted.values()],
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


def _count_differences(
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
    counted = counted_breaches(findings, policy, pack, case)
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
