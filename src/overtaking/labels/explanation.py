"""Reasons of the verdicts on one simulation: breaches, remedies, beliefs, margins by frame.

A pack holds the rules of one law; a policy selects the rules that a legal overtake must not break.
A percept records a decision of the ego's driver, to pull out or to return for example: true and
believed gaps and closing speeds to the neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F64
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.law.beliefs import belief_at, percept_at, true_and_believed_margin
from overtaking.labels.law.judging import STORED_POLICIES, Policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.remedies import BreachContext, Remedy
from overtaking.labels.law.rule import Pack, Rule, TextSource
from overtaking.labels.law.safe_distance import GapMargin
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle
from overtaking.model.verdicts import Belief, Case, Severity, Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A broken rule.

    Attributes:
        rule: The rule.
        policies: Names of the policies that require it.
        margin: Margin of the finding, negative, in the unit of the rule.
        first_frame: First frame of the breach.
        last_frame: Last frame of the breach.
        severity: Severity by the law to which the rule belongs.
        belief: Whether the driver knew of the breach when it decided.
        remedies: Alternative changes, each sufficient to keep the rule; empty if no change is
            known.
    """

    rule: Rule
    policies: tuple[str, ...]
    margin: float
    first_frame: int
    last_frame: int
    severity: Severity
    belief: Belief
    remedies: tuple[Remedy, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BelievedFinding:
    """Margin of a rule to one neighbour at one decision, by true and by believed values.

    Attributes:
        percept: Index of the decision among the percepts of the simulation.
        perceived: Role of the neighbour at the decision.
        rule_code: Code of the rule, such as "L3".
        margin: Margin by the true gap and closing speed, negative in a breach [m].
        believed_margin: Margin by the gap and closing speed that the driver believed; None for a
            vehicle that the driver had not noticed [m].
        belief: Result of the comparison.
    """

    percept: int
    perceived: PerceivedVehicle
    rule_code: str
    margin: float
    believed_margin: float | None
    belief: Belief


def believed_findings(case: Case, pack: Pack) -> tuple[BelievedFinding, ...]:
    """Compare margins to the neighbours, by true and by believed values, at the driver's decisions.

    Args:
        case: A batch of one simulation.
        pack: The pack of rules.

    Returns:
        At each decision, one item for each neighbour to which a rule sets a margin, in the order of
        decisions. Decisions to abort have no items, because no rule judges them. A recording that
        does not state the driver's percepts has no items.
    """
    percepts = case.trajectories.percepts
    if "percepts" in case.trajectories.unknown:
        return ()
    margins = _believed_margins(pack)
    comparisons = list[BelievedFinding]()
    for index in np.flatnonzero(percepts.valid[0]).tolist():
        kind = ManoeuvreKind(int(percepts.kind[0, index]))
        for perceived in PerceivedVehicle:
            has_neighbour = percepts.slot[0, index, perceived] != NO_VEHICLE
            if has_neighbour and (kind, perceived) in margins:
                code, margin = margins[kind, perceived]
                comparisons.append(_believed_finding(case, index, perceived, code, margin))
    return tuple(comparisons)


def _believed_margins(
    pack: Pack,
) -> dict[tuple[ManoeuvreKind, PerceivedVehicle], tuple[str, GapMargin]]:
    """Code and margin of the rule that judges each neighbour at each kind of decision.

    If several rules judge it, the first rule of the pack counts.
    """
    margins = dict[tuple[ManoeuvreKind, PerceivedVehicle], tuple[str, GapMargin]]()
    for rule in pack.deciding_rules:
        for key, margin in rule.criterion.believed_margins.items():
            margins.setdefault(key, (rule.code, margin))
    return margins


def _believed_finding(
    case: Case, percept_index: int, perceived: PerceivedVehicle, code: str, margin: GapMargin
) -> BelievedFinding:
    """Compare one margin to one neighbour at one decision of the only simulation of a case."""
    percepts = case.trajectories.percepts
    entry = (slice(0, 1), percept_index, perceived)  # The slice keeps the axis of simulations.
    percept = percept_at(
        case, np.array([percept_index]), np.array([True]), percepts.time[:1, percept_index]
    )
    true_margin, believed_margin = (
        float(values[0]) for values in true_and_believed_margin(percepts, entry, percept, margin)
    )
    return BelievedFinding(
        percept=percept_index,
        perceived=perceived,
        rule_code=code,
        margin=true_margin,
        believed_margin=believed_margin
        if percepts.is_detected[0, percept_index, perceived]
        else None,
        belief=Belief(int(belief_at(case, percept, {perceived: margin})[0])),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class UndecidedRule:
    """A rule that cannot be decided.

    Attributes:
        rule: The rule.
        policies: Names of the policies that require it.
        missing_inputs: Names of inputs that the rule needs and the recording does not state, in
            alphabetical order; empty if, for example, only measurement errors leave it undecided.
        is_text_unread: Whether the rule is undecidable because the authors of its pack did not read
            the text of the law.
    """

    rule: Rule
    policies: tuple[str, ...]
    missing_inputs: tuple[str, ...]
    is_text_unread: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Reasons of the verdicts on one simulation.

    Attributes:
        breaches: The rules that are broken.
        undecided: The rules that apply and cannot be decided.
        kept: The rules that apply and are kept.
        inapplicable: The rules that do not apply.
        believed: True and believed margins at each decision of the driver.
    """

    breaches: tuple[Breach, ...]
    undecided: tuple[UndecidedRule, ...]
    kept: tuple[Rule, ...]
    inapplicable: tuple[Rule, ...]
    believed: tuple[BelievedFinding, ...]

    @property
    def decided(self) -> tuple[Rule, ...]:
        """The rules that are broken, then those that are kept."""
        return (*(breach.rule for breach in self.breaches), *self.kept)


def explain(
    labelled: LabelledTrajectories,
    simulation: int = 0,
    *,
    pack: Pack = PORTUGAL,
    policies: Sequence[Policy] = STORED_POLICIES,
) -> Explanation:
    """Give the reasons of the verdicts on one simulation, and remedies of each breach.

    Args:
        labelled: A batch with its findings.
        simulation: Index of the simulation in the batch.
        pack: The pack by which the batch was judged.
        policies: Policies to name beside each rule that they require.
    """
    labelled = labelled.select(np.array([simulation]))
    case, verdicts = labelled.case(), labelled.findings.verdict[0]
    by_verdict = {
        verdict: [
            rule
            for rule, rule_verdict in zip(pack.rules, verdicts, strict=True)
            if rule_verdict == verdict
        ]
        for verdict in Verdict
    }
    return Explanation(
        breaches=tuple(
            _breach(labelled, case, rule, policies) for rule in by_verdict[Verdict.ILLEGAL]
        ),
        undecided=tuple(
            _undecided_rule(labelled, rule, policies, pack)
            for rule in by_verdict[Verdict.UNDECIDABLE]
        ),
        kept=tuple(by_verdict[Verdict.LEGAL]),
        inapplicable=tuple(by_verdict[Verdict.NOT_APPLICABLE]),
        believed=believed_findings(case, pack),
    )


def margins_by_frame(labelled: LabelledTrajectories, pack: Pack = PORTUGAL) -> dict[str, F64]:
    """Margins of one simulation, frame by frame; the smallest is the margin of the finding.

    Args:
        labelled: A batch of one simulation with its findings.
        pack: The pack by which the batch was judged.

    Returns:
        Margins by code of the rule, shape (time,), in the unit of the rule: negative in a breach,
        NaN in frames that the rule does not judge. They cover rules that are kept or broken in this
        simulation and that judge frame by frame: speed limits, distances to the leader and to the
        side, stopping within sight. Other rules judge single instants or durations.
    """
    case, findings = labelled.case(), labelled.findings
    verdicts = dict(zip(findings.rule_codes, findings.verdict[0].tolist(), strict=True))
    margins_by_code = {
        rule.code: rule.criterion.margins_by_frame(case)
        for rule in pack.rules
        if verdicts[rule.code] in (Verdict.LEGAL, Verdict.ILLEGAL)
    }
    return {code: margins for code, margins in margins_by_code.items() if margins is not None}


def _breach(
    labelled: LabelledTrajectories, case: Case, rule: Rule, policies: Sequence[Policy]
) -> Breach:
    """The breach of a broken rule in the only simulation of a batch."""
    findings = labelled.findings
    cell = (0, findings.rule_codes.index(rule.code))
    margin = float(findings.margin[cell])
    first, last = int(findings.first_frame[cell]), int(findings.last_frame[cell])
    context = BreachContext(case=case, margin=margin, first_frame=first, last_frame=last)
    return Breach(
        rule=rule,
        policies=_policies_that_require(rule, policies),
        margin=margin,
        first_frame=first,
        last_frame=last,
        severity=Severity(int(findings.severity[cell])),
        belief=Belief(int(findings.belief[cell])),
        remedies=rule.criterion.remedies(context),
    )


def _undecided_rule(
    labelled: LabelledTrajectories, rule: Rule, policies: Sequence[Policy], pack: Pack
) -> UndecidedRule:
    """The inputs without which a rule is undecidable in the only simulation of a batch."""
    unknown, is_kind_known = labelled.trajectories.unknown, labelled.trajectories.is_kind_known
    # `unknown` names the kinds of vehicles only if no kind is known.
    if is_kind_known is not None and not is_kind_known.all():
        unknown = unknown | {"kinds"}
    missing_inputs = (rule.required_inputs | rule.conditional_inputs) & unknown
    is_text_unread = not pack.accepts_unread_articles and rule.text_source is not TextSource.READ
    return UndecidedRule(
        rule=rule,
        policies=_policies_that_require(rule, policies),
        missing_inputs=tuple(sorted(missing_inputs)),
        is_text_unread=is_text_unread,
    )


def _policies_that_require(rule: Rule, policies: Sequence[Policy]) -> tuple[str, ...]:
    """Names of the policies that require a rule."""
    return tuple(policy.name for policy in policies if rule.code in policy.required)
