"""Everything that explains the verdicts on one simulation, as numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from overtaking.labels.explain.breach import Breach, BreachFacts
from overtaking.labels.explain.german import GERMAN
from overtaking.labels.explain.remedies import REMEDIES, remedies_of
from overtaking.labels.explain.thoughts import Thought, thoughts
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.law import POLICIES, PORTUGAL, Pack, Policy, Rule, Text
from overtaking.labels.signals import target_signals
from overtaking.model.verdicts import Belief, Case, Severity, Verdict

ALL_REMEDIES = REMEDIES | GERMAN
"""The remedies for the rules of both laws, by the check of the rule."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """A rule that cannot be decided.

    Attributes:
        rule: The rule.
        policies: Names of the policies that require it.
        missing: Names of what the recording does not tell and the rule needs.
        unread: Whether its text was not read, and the pack decides by texts that were.
    """

    rule: Rule
    policies: tuple[str, ...]
    missing: tuple[str, ...]
    unread: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why one simulation is judged as it is.

    Attributes:
        breaches: The rules that are broken.
        doubts: The rules that apply and cannot be decided.
        kept: The rules that apply and are kept.
        inapplicable: The rules that say nothing of it.
        thoughts: What the driver believed at each decision, held against the law.
    """

    breaches: tuple[Breach, ...]
    doubts: tuple[Doubt, ...]
    kept: tuple[Rule, ...]
    inapplicable: tuple[Rule, ...]
    thoughts: tuple[Thought, ...]

    @property
    def decided(self) -> tuple[Rule, ...]:
        """The rules that are broken, then those that are kept."""
        return (*(breach.rule for breach in self.breaches), *self.kept)


def explain(
    labelled: LabelledTrajectories,
    simulation: int = 0,
    *,
    pack: Pack = PORTUGAL,
    policies: Sequence[Policy] = POLICIES,
) -> Explanation:
    """Why one simulation is judged as it is, and what would have kept each broken rule.

    Args:
        labelled: A batch with its findings.
        simulation: Its index in the batch.
        pack: The rules that the findings are of.
        policies: Which of the rules count for which reading.
    """
    one = labelled.select(np.array([simulation]))
    case = case_of(one)
    verdicts = one.findings.verdict[0]
    by_verdict = {
        verdict: [rule for rule, of in zip(pack.rules, verdicts, strict=True) if of == verdict]
        for verdict in Verdict
    }
    return Explanation(
        breaches=tuple(_breach(one, case, rule, policies) for rule in by_verdict[Verdict.ILLEGAL]),
        doubts=tuple(_doubt(one, rule, policies, pack) for rule in by_verdict[Verdict.UNDECIDABLE]),
        kept=tuple(by_verdict[Verdict.LEGAL]),
        inapplicable=tuple(by_verdict[Verdict.NOT_APPLICABLE]),
        thoughts=thoughts(case, pack),
    )


def case_of(labelled: LabelledTrajectories) -> Case:
    """What rules look at."""
    runs, seen, events = labelled.trajectories, labelled.signals, labelled.events
    target = target_signals(runs, seen, events.target_slot)
    return Case(trajectories=runs, signals=seen, events=events, target=target)


def _breach(
    one: LabelledTrajectories, case: Case, rule: Rule, policies: Sequence[Policy]
) -> Breach:
    findings = one.findings
    at = (0, findings.rule_codes.index(rule.code))
    margin = float(findings.margin[at])
    first, last = int(findings.first_frame[at]), int(findings.last_frame[at])
    facts = BreachFacts(case=case, margin=margin, first=first, last=last)
    return Breach(
        rule=rule,
        policies=_asking(rule, policies),
        margin=margin,
        first=first,
        last=last,
        severity=Severity(int(findings.severity[at])),
        belief=Belief(int(findings.belief[at])),
        remedies=remedies_of(rule, facts, ALL_REMEDIES),
    )


def _doubt(one: LabelledTrajectories, rule: Rule, policies: Sequence[Policy], pack: Pack) -> Doubt:
    unknown = one.trajectories.unknown
    if one.trajectories.is_kind_known is not None and not one.trajectories.is_kind_known.all():
        unknown = unknown | {"kinds"}
    missing = (rule.needs | rule.partly) & unknown
    unread = not pack.trusts_hearsay and rule.text is not Text.READ
    return Doubt(
        rule=rule,
        policies=_asking(rule, policies),
        missing=tuple(sorted(missing)),
        unread=unread,
    )


def _asking(rule: Rule, policies: Sequence[Policy]) -> tuple[str, ...]:
    """Names of the policies that require a rule."""
    return tuple(policy.name for policy in policies if rule.code in policy.required)
