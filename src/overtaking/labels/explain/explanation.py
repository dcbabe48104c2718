"""Everything that explains the verdicts on one simulation, as numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from overtaking.labels.explain.breach import BreachFacts, Remedy
from overtaking.labels.explain.german import GERMAN
from overtaking.labels.explain.remedies import REMEDIES, remedies_of
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.law.beliefs import belief, decision_at, margins_of
from overtaking.labels.law.following import L3
from overtaking.labels.law.judging import POLICIES, Policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.returning import L8
from overtaking.labels.law.rule import Pack, Rule, Text
from overtaking.labels.law.safe_distance import (
    GapMargin,
    margin_ahead,
    margin_behind,
    margin_of_gap,
)
from overtaking.labels.law.starting import L4, L5
from overtaking.labels.signals import target_signals
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle
from overtaking.model.verdicts import Belief, Case, Finding, Severity, Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A broken rule.

    Attributes:
        rule: The rule.
        policies: Names of the policies that require it.
        margin: How far beyond the border of the law, negative, in the unit of the rule.
        first: First frame of the breach.
        last: Last frame of the breach.
        severity: Severity by the law to which the rule belongs.
        belief: Whether the driver could know.
        remedies: Each of them alone would have kept the rule; none where nothing would.
    """

    rule: Rule
    policies: tuple[str, ...]
    margin: float
    first: int
    last: int
    severity: Severity
    belief: Belief
    remedies: tuple[Remedy, ...]


_MARGINS: dict[
    tuple[ManoeuvreKind, PerceivedVehicle], tuple[Callable[[Case], Finding], GapMargin]
] = {
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


def _thought(case: Case, row: int, whom: PerceivedVehicle, code: str, margin: GapMargin) -> Thought:
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
