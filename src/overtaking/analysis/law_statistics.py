"""Shares of legal overtakes as tolerances grow, and overtakes on which two laws differ."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
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
    from overtaking.labels.labelling import JudgedBatch, LabelledTrajectories
    from overtaking.labels.law.judging import Policy
    from overtaking.labels.law.rule import Pack
    from overtaking.model.verdicts import Case


@dataclass(frozen=True, slots=True)
class ToleranceScale:
    """The values of a tolerance.

    Attributes:
        unit: Unit of the margins that it relaxes; empty: it relaxes the rules of all units.
        result_unit: Unit of the values in results.
        values: The values in that unit, from 0 upwards.
    """

    unit: str
    result_unit: str
    values: tuple[float, ...]

    @property
    def values_si(self) -> tuple[float, ...]:
        """The values in SI."""
        if self.result_unit == "km/h":
            return tuple(mps_from_kmh(value) for value in self.values)
        return self.values


TOLERANCE_SCALES = {
    "distance": ToleranceScale("m", "m", (0.0, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0)),
    "speed": ToleranceScale("m/s", "km/h", (0.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0)),
    "time": ToleranceScale("s", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0)),
    "duration": ToleranceScale("", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0)),
}
"""Tolerances by name. The first three relax the margin, the last one the duration of a breach."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToleranceCurve(ContentEquality, Plottable):
    """Legal overtakes under one policy, by tolerance.

    Attributes:
        rule_set: Version of the pack of rules.
        policy: Name of the policy.
        overtakes: Number of completed overtakes.
        legal: Number of legal ones among them.
        undecided: Number without a breach, but with an undecidable required rule; 0 if the policy
            counts undecidable rules as kept.
        titles: Title of each required rule, by code.
        broken: Number of overtakes that break a rule, by code.
        broken_alone: Number of overtakes that break this rule and no other, by code.
        legal_by_tolerance: Number of legal overtakes for each value in `TOLERANCE_SCALES`, if the
            tolerance relaxes all rules of its unit.
        legal_by_rule: The same for the tolerance in the unit of one rule, if it relaxes this rule
            alone; by code. Rules in units without a tolerance, such as m/s^2, have no entry.
    """

    rule_set: str
    policy: str
    overtakes: int
    legal: int
    undecided: int
    titles: dict[str, str]
    broken: dict[str, int]
    broken_alone: dict[str, int]
    legal_by_tolerance: dict[str, list[int]]
    legal_by_rule: dict[str, list[int]]

    def to_dict(self) -> dict[str, Any]:
        """The curve as JSON values; shares are of completed overtakes."""
        num_overtakes = max(self.overtakes, 1)
        return {
            "rule_set": self.rule_set,
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
                    "broken_alone": self.broken_alone[code],
                }
                for code, title in self.titles.items()
            ],
            "legal_by_tolerance": [
                {
                    "tolerance": name,
                    "unit": TOLERANCE_SCALES[name].result_unit,
                    "values": list(TOLERANCE_SCALES[name].values),
                    "legal_share": [count / num_overtakes for count in counts],
                }
                for name, counts in self.legal_by_tolerance.items()
            ],
            "legal_by_rule": [
                {"rule": code, "legal_share": [count / num_overtakes for count in counts]}
                for code, counts in self.legal_by_rule.items()
            ],
        }


def tolerance_curve(batches: Iterable[JudgedBatch], pack: Pack, policy: Policy) -> ToleranceCurve:
    """The curve of all completed overtakes.

    Args:
        batches: One or more batches with labels by the pack alone.
        pack: The rules.
        policy: The policy that names the required rules.
    """
    parts: list[_CompletedOvertakes] = []
    rule_set = pack.version
    for batch in batches:
        (labelled,) = batch.labelled
        parts.append(_completed_overtakes(labelled, batch.case, pack, policy))
        # The findings add `Pack.two_way_version` on two-way roads, and the measurement errors if
        # verdicts allow for them.
        rule_set = labelled.findings.version
    overtakes = _CompletedOvertakes(
        is_breach=np.concatenate([part.is_breach for part in parts]),
        excess=np.concatenate([part.excess for part in parts]),
        duration=np.concatenate([part.duration for part in parts]),
        is_undecidable=np.concatenate([part.is_undecidable for part in parts]),
        units=parts[0].units,
        counts_undecidable=not policy.allows_undecided,
    )
    return _curve_of(overtakes, pack, policy, rule_set)


@dataclass(frozen=True, kw_only=True)
class _CompletedOvertakes:
    """Completed overtakes; arrays have shape (overtake, required rule).

    Attributes:
        is_breach: Whether the rule is broken and the policy counts the breach, given the policy's
            smallest severity and its tolerance for the rule.
        excess: Distance beyond the limit of the law, not beyond what the policy tolerates: the
            negative margin, in the unit of the rule.
        duration: Duration of the breach [s].
        is_undecidable: Whether the rule is undecidable.
        units: Unit of each rule, shape (required rule,).
        counts_undecidable: Whether an undecidable rule keeps an overtake from being legal.
    """

    is_breach: Mask
    excess: NDArray[np.floating]
    duration: NDArray[np.floating]
    is_undecidable: Mask
    units: NDArray[np.str_]
    counts_undecidable: bool

    @cached_property
    def is_undecided(self) -> Mask:
        """Overtakes with an undecidable rule that counts, shape (overtake,)."""
        if not self.counts_undecidable:
            return np.zeros(len(self.is_undecidable), np.bool_)
        return np.asarray(self.is_undecidable.any(axis=1))

    def num_legal(self, is_breach: Mask) -> int:
        """Number of overtakes without a breach and without an undecidable rule that counts."""
        return int((~is_breach.any(axis=1) & ~self.is_undecided).sum())

    def num_legal_by_value(self, tolerance: str, is_relaxed: Mask) -> list[int]:
        """Number of legal overtakes for each value of a tolerance.

        Args:
            tolerance: A key of `TOLERANCE_SCALES`.
            is_relaxed: The rules that it relaxes, shape (required rule,).
        """
        measured = self.duration if tolerance == "duration" else self.excess
        return [
            self.num_legal(self.is_breach & ~(is_relaxed & (measured <= value)))
            for value in TOLERANCE_SCALES[tolerance].values_si
        ]


def _completed_overtakes(
    labelled: LabelledTrajectories, case: Case, pack: Pack, policy: Policy
) -> _CompletedOvertakes:
    findings = labelled.findings
    rule_columns = [findings.rule_codes.index(code) for code in policy.required]
    rows = np.flatnonzero(labelled.labels.outcome == Outcome.COMPLETED)
    duration = np.stack(
        [breach_duration(findings, column, case) for column in rule_columns], axis=1
    )
    return _CompletedOvertakes(
        is_breach=counted_breaches(findings, policy, pack, case)[rows][:, rule_columns],
        excess=-findings.margin[rows][:, rule_columns],
        duration=duration[rows],
        is_undecidable=(findings.verdict == Verdict.UNDECIDABLE)[rows][:, rule_columns],
        units=np.array([pack.rule(code).unit for code in policy.required]),
        counts_undecidable=not policy.allows_undecided,
    )


def _curve_of(
    overtakes: _CompletedOvertakes, pack: Pack, policy: Policy, rule_set: str
) -> ToleranceCurve:
    is_breach, units = overtakes.is_breach, overtakes.units
    breaks_one_rule = is_breach.sum(axis=1) == 1
    legal_by_rule: dict[str, list[int]] = {}
    for rule_index, code in enumerate(policy.required):
        for name, scale in TOLERANCE_SCALES.items():
            if scale.unit == units[rule_index]:
                is_this_rule = np.arange(len(units)) == rule_index
                legal_by_rule[code] = overtakes.num_legal_by_value(name, is_this_rule)
    broken = is_breach.sum(axis=0).tolist()
    broken_alone = is_breach[breaks_one_rule].sum(axis=0).tolist()
    return ToleranceCurve(
        rule_set=rule_set,
        policy=policy.name,
        overtakes=len(is_breach),
        legal=overtakes.num_legal(is_breach),
        undecided=int((overtakes.is_undecided & ~is_breach.any(axis=1)).sum()),
        titles={code: pack.rule(code).title for code in policy.required},
        broken=dict(zip(policy.required, broken, strict=True)),
        broken_alone=dict(zip(policy.required, broken_alone, strict=True)),
        legal_by_tolerance={
            name: overtakes.num_legal_by_value(name, (units == scale.unit) | (scale.unit == ""))
            for name, scale in TOLERANCE_SCALES.items()
        },
        legal_by_rule=legal_by_rule,
    )


MAX_EXAMPLES = 5
"""Largest number of overtakes that a disagreement of two laws lists."""


@dataclass(kw_only=True)
class LawDisagreement:
    """Overtakes that are legal under one law and illegal under another.

    Attributes:
        legal_under: Name of the law under which they are legal.
        illegal_under: Name of the other law.
        policy: Name of the policy, which both laws have.
        count: Number of overtakes.
        rules: Number of overtakes that break each rule of the other law.
        examples: Of the first `MAX_EXAMPLES` of them, the number of the simulation in its data set,
            the rule of the other law that is broken most severely, and the margin with its unit.
    """

    legal_under: str
    illegal_under: str
    policy: str
    count: int = 0
    rules: Counter[str] = field(default_factory=Counter[str])
    examples: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    def to_dict(self) -> dict[str, Any]:
        """The disagreement as JSON values, the most frequent rules first."""
        return {
            "legal_under": self.legal_under,
            "illegal_under": self.illegal_under,
            "policy": self.policy,
            "overtakes": self.count,
            "rules": dict(self.rules.most_common()),
            "examples": self.examples,
        }

    def add(
        self,
        batch: JudgedBatch,
        labelled_pair: tuple[LabelledTrajectories, LabelledTrajectories],
        policy_column: int,
        pack: Pack,
        policy: Policy,
    ) -> None:
        """Count the overtakes of a batch on which the laws differ in this direction.

        Args:
            batch: The batch.
            labelled_pair: Its labels by the law under which overtakes are legal, and by the other
                law.
            policy_column: Column of the policy in the classes of the labels.
            pack: Rules of the other law.
            policy: Policy of the other law.
        """
        legal, illegal = labelled_pair
        # The classes of completed overtakes: `SUCCESS_L` legal, `SUCCESS_I` illegal.
        differs = legal.labels.classes[:, policy_column] == OvertakeClass.SUCCESS_L
        differs &= illegal.labels.classes[:, policy_column] == OvertakeClass.SUCCESS_I
        rows, findings = np.flatnonzero(differs), illegal.findings
        is_breach = counted_breaches(findings, policy, pack, batch.case)
        self.count += len(rows)
        for row in rows.tolist():
            rule_columns = {
                code: findings.rule_codes.index(code)
                for code in policy.required
                if is_breach[row, findings.rule_codes.index(code)]
            }
            self.rules.update(rule_columns.keys())
            if len(self.examples) < MAX_EXAMPLES:
                # `Severity` ascends from light to very serious; of equals the first rule counts.
                severity = {
                    code: findings.severity[row, rule_column]
                    for code, rule_column in rule_columns.items()
                }
                worst = max(severity, key=lambda code: severity[code])
                self.examples.append(
                    {
                        "simulation": int(batch.simulation_ids[row]),
                        "rule": worst,
                        "margin": round(float(findings.margin[row, rule_columns[worst]]), 3),
                        "unit": pack.rule(worst).unit,
                    }
                )


def compare_laws(
    batches: Iterable[JudgedBatch], packs: Sequence[Pack], policies: Sequence[Sequence[Policy]]
) -> dict[str, Any]:
    """Count legal overtakes under each law and policy, and the overtakes on which two laws differ.

    Args:
        batches: Batches with labels by each of the laws.
        packs: The laws, two or more.
        policies: Of each law, the same names in the same order.

    Returns:
        JSON values. For each law and policy, `classes` counts all simulations by class, and
        `conduct` counts all of them by whether the ego kept the required rules.
    """
    names = [policy.name for policy in policies[0]]
    classes = {(pack.name, name): Counter[str]() for pack in packs for name in names}
    conduct = {key: Counter[str]() for key in classes}
    disagreements = {
        (legal.name, illegal.name, name): LawDisagreement(
            legal_under=legal.name, illegal_under=illegal.name, policy=name
        )
        for name in names
        for legal, illegal in permutations(packs, 2)
    }
    rule_sets, num_simulations, num_overtakes = dict[str, str](), 0, 0
    for batch in batches:
        num_simulations += len(batch.simulation_ids)
        outcome = batch.labelled[0].labels.outcome
        num_overtakes += int((outcome == Outcome.COMPLETED).sum())
        for pack, labelled in zip(packs, batch.labelled, strict=True):
            rule_sets[pack.name] = labelled.findings.version
            for policy_column, name in enumerate(names):
                class_codes = labelled.labels.classes[:, policy_column]
                classes[pack.name, name].update(OvertakeClass(code).title for code in class_codes)
                conduct[pack.name, name].update(_conduct_counts(labelled, policy_column))
        for i, j in permutations(range(len(packs)), 2):
            labelled_pair = batch.labelled[i], batch.labelled[j]
            for policy_column, name in enumerate(names):
                disagreement = disagreements[packs[i].name, packs[j].name, name]
                policy = policies[j][policy_column]
                disagreement.add(batch, labelled_pair, policy_column, packs[j], policy)
    return {
        "simulations": num_simulations,
        "overtakes": num_overtakes,
        "rule_sets": rule_sets,
        "laws": [
            {
                "law": law,
                "policy": name,
                "classes": dict(sorted(count.items())),
                "conduct": dict(conduct[law, name]),
            }
            for (law, name), count in classes.items()
        ],
        "disagreements": [disagreement.to_dict() for disagreement in disagreements.values()],
    }


def _conduct_counts(labelled: LabelledTrajectories, policy_column: int) -> dict[str, int]:
    """Simulations by whether required rules are broken or undecidable, overtake or not.

    Args:
        labelled: The labels.
        policy_column: Column of the policy in the labels.
    """
    is_broken = labelled.labels.num_broken[:, policy_column] > 0
    is_undecidable = ~is_broken & (labelled.labels.num_undecidable[:, policy_column] > 0)
    return {
        "kept": int((~is_broken & ~is_undecidable).sum()),
        "broken": int(is_broken.sum()),
        "undecidable": int(is_undecidable.sum()),
    }
