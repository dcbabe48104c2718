"""The share of legal overtakes as tolerances grow, and those that one rule alone decides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.result_methods import Plottable
from overtaking.core.equality import ContentEquality
from overtaking.core.units import mps_from_kmh
from overtaking.labels.law.policies import breaches, duration
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from overtaking.core.arrays import Mask
    from overtaking.labels.label import LabelledTrajectories
    from overtaking.labels.law import Pack, Policy
    from overtaking.model.verdicts import Case

STEPS = {
    "distance": ("m", "m", (0.0, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0)),
    "speed": ("m/s", "km/h", (0.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0)),
    "time": ("s", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0)),
    "lasting": ("", "s", (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0)),
}
"""Of each tolerance: the unit of the margins that it is about, empty for those of all rules; the
unit in which it is told; and its values."""


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
        whole = max(self.overtakes, 1)
        return {
            "rule_set": self.pack,
            "policy": self.policy,
            "overtakes": self.overtakes,
            "legal": self.legal,
            "undecided": self.undecided,
            "legal_share": self.legal / whole,
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
                    "legal_share": [count / whole for count in counts],
                }
                for name, counts in self.relaxed.items()
            ],
            "tolerances_by_rule": [
                {"rule": code, "legal_share": [count / whole for count in counts]}
                for code, counts in self.by_rule.items()
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
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
    found, version = [], pack.version
    for labelled, case in batches:
        found.append(_found(labelled, case, pack, policy))
        version = labelled.findings.version
    together = _Found(
        counted=np.concatenate([one.counted for one in found]),
        excess=np.concatenate([one.excess for one in found]),
        lasting=np.concatenate([one.lasting for one in found]),
        doubtful=np.concatenate([one.doubtful for one in found]),
    )
    return _curve(together, pack, policy, version)


def _found(labelled: LabelledTrajectories, case: Case, pack: Pack, policy: Policy) -> _Found:
    findings = labelled.findings
    columns = [findings.rule_codes.index(code) for code in policy.required]
    done = np.flatnonzero(labelled.labels.outcome == Outcome.COMPLETED)
    lasting = np.stack([duration(findings, one, case) for one in columns], axis=1)
    return _Found(
        counted=breaches(findings, policy, pack, case)[done][:, columns],
        excess=-findings.margin[done][:, columns],
        lasting=lasting[done],
        doubtful=(findings.verdict == Verdict.UNDECIDABLE)[done][:, columns],
    )


def _curve(found: _Found, pack: Pack, policy: Policy, version: str) -> Curve:
    units = np.array([pack.rule(code).unit for code in policy.required])
    counted = found.counted
    doubtful = found.doubtful.any(axis=1) & (not policy.allows_undecided)

    def legal(broken: Mask) -> int:
        return int((~broken.any(axis=1) & ~doubtful).sum())

    def relaxed(name: str, about: Mask) -> list[int]:
        measured = found.lasting if name == "lasting" else found.excess
        return [legal(counted & ~(about & (measured <= value))) for value in tolerances(name)]

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
    _, told, values = STEPS[name]
    return tuple(mps_from_kmh(one) for one in values) if told == "km/h" else values
