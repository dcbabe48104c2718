"""Judge simulations by a rule or a pack of rules, and count breaches under a policy.

A pack holds the rules of a law. A rule gives a finding for each simulation: a verdict, and a margin
that is negative in a breach. A policy states which findings count and how strictly; each rule names
the policies that require it. The reproduced study is Pinto, Dutra and Fonseca (2023).
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import ConfigError, check_choice
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.margins import finding_from_margins
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.numbers import COVERAGE_FACTOR
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Grade, Pack, Rule, Tolerance
from overtaking.model.batch import Batch
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import VehicleKind, may_be_kind
from overtaking.model.verdicts import Case, Finding, Findings, Severity, Verdict


def judge_rule(rule: Rule, case: Case, errors: MeasurementErrors | None = None) -> Finding:
    """Judge each simulation of a batch by one rule.

    Args:
        rule: The rule.
        case: The batch.
        errors: Standard errors of the measured positions and speeds; None for exact values.

    Returns:
        The finding with its severity. It is undecidable where the rule needs an input that the
        recording omits, and where the margin is smaller than two standard errors.
    """
    finding = _judge_without_errors(rule, case)
    if errors is None:
        return finding
    is_decided = (finding.verdict == Verdict.LEGAL) | (finding.verdict == Verdict.ILLEGAL)
    if not is_decided.any():
        return finding
    standard_error = rule.criterion.standard_error(case, finding, errors)
    if standard_error is None:
        return finding
    # Two standard errors, about 95 % confidence (JCGM 100:2008, 6.3.3). A margin of just this size
    # has the wrong sign in one of forty cases; a margin of one standard error in one of six.
    expanded_error = COVERAGE_FACTOR.f32 * standard_error
    return _with_undecidable(finding, is_decided & (np.abs(finding.margin) < expanded_error))


def _with_undecidable(finding: Finding, is_undecidable: Mask) -> Finding:
    """Make a finding undecidable in the simulations of a mask."""
    return finding.replace(
        verdict=np.where(is_undecidable, np.uint8(Verdict.UNDECIDABLE), finding.verdict),
        margin=np.where(is_undecidable, np.float32(0.0), finding.margin),
        first_frame=np.where(is_undecidable, NEVER, finding.first_frame),
        last_frame=np.where(is_undecidable, NEVER, finding.last_frame),
        longest_run=np.where(is_undecidable, np.int32(0), finding.longest_run),
        severity=np.where(is_undecidable, np.uint8(Severity.NONE), finding.severity),
    )


def _judge_without_errors(rule: Rule, case: Case) -> Finding:
    """Judge by exact positions and speeds, also where kinds of vehicles are unknown.

    If some kinds are unknown and the rule depends on them, it is undecidable in simulations in
    which the possible kinds lead to different verdicts.
    """
    # The mask is None if all kinds are known, and if no kind is known. In the second case "kinds"
    # is in `trajectories.unknown`, which `_judge_with_stated_kinds` and the criteria read.
    is_known = case.trajectories.is_kind_known
    if is_known is None or "kinds" not in rule.required_inputs | rule.conditional_inputs:
        return _judge_with_stated_kinds(rule, case)
    return _combine_findings(
        [
            _judge_with_stated_kinds(rule, possible_case)
            for possible_case in _cases_with_possible_kinds(case)
        ]
    )


def _cases_with_possible_kinds(case: Case) -> Iterator[Case]:
    """Yield the batch once for each kind, with all vehicles of unknown kind as that kind.

    Rules distinguish these five kinds only; a medium car stands for all cars. Every vehicle is
    tried as a car and as a truck, whatever its length: where kind and length in a recording
    contradict each other, the length may be wrong. Van, motorcycle and bicycle are tried only if
    the length fits, a choice; otherwise the vehicle is a car in that batch. Mixtures of kinds are
    not tried.
    """
    trajectories = case.trajectories
    vehicles = trajectories.scenario.vehicles
    car = np.uint8(VehicleKind.MEDIUM_CAR)
    for kind in (
        car,
        VehicleKind.TRUCK,
        VehicleKind.VAN,
        VehicleKind.MOTORCYCLE,
        VehicleKind.BICYCLE,
    ):
        fits = may_be_kind(kind, vehicles.length) | (kind == VehicleKind.TRUCK)
        assumed_kinds = np.where(fits, np.uint8(kind), car)
        # `known_kinds` is `is_kind_known` as a mask that is never None.
        kinds = np.where(trajectories.known_kinds, vehicles.kind, assumed_kinds)
        scenario = trajectories.scenario.replace(vehicles=vehicles.replace(kind=kinds))
        yield case.replace(trajectories=trajectories.replace(scenario=scenario))


def _combine_findings(findings: Sequence[Finding]) -> Finding:
    """Combine findings on the same batch: undecidable in simulations in which the verdicts differ.

    Where the verdicts agree, the finding with the smallest absolute margin counts, because it is
    the nearest to another verdict.
    """
    margins = np.stack([np.abs(finding.margin) for finding in findings])
    nearest_index = margins.argmin(axis=0)
    names = [field.name for field in dataclasses.fields(Finding)]
    stacked = {name: np.stack([getattr(finding, name) for finding in findings]) for name in names}
    simulation = np.arange(len(nearest_index))
    nearest = Finding(
        **{name: values[nearest_index, simulation] for name, values in stacked.items()}
    )
    return _with_undecidable(nearest, (stacked["verdict"] != stacked["verdict"][0]).any(axis=0))


def _judge_with_stated_kinds(rule: Rule, case: Case) -> Finding:
    """Judge by exact values, with every vehicle of the kind that the batch states."""
    finding = rule.criterion.check(case)
    if rule.required_inputs & case.trajectories.unknown:
        return _as_undecidable(finding)
    if rule.grade is Grade.BY_BREACH:
        return finding
    is_broken = finding.verdict == Verdict.ILLEGAL
    severity = is_broken.view(np.uint8) * np.uint8(severity_of(rule.grade, case))  # Else NONE, 0.
    return finding.replace(severity=severity)


def severity_of(grade: Grade, case: Case) -> Severity:
    """Severity of a breach of a rule with this grade on the road of the batch.

    A road of unknown kind counts as no motorway, so the breach has the lower severity.
    """
    if grade is Grade.LIGHT:
        return Severity.LIGHT
    trajectories = case.trajectories
    is_motorway = trajectories.road.kind == "motorway" and "road_kind" not in trajectories.unknown
    return Severity.VERY_SERIOUS if grade is Grade.BY_ROAD and is_motorway else Severity.SERIOUS


def _as_undecidable(finding: Finding) -> Finding:
    """Make a finding undecidable in all simulations to which the rule applies."""
    applies = finding.verdict != Verdict.NOT_APPLICABLE
    num_simulations = len(applies)
    margin = np.zeros(num_simulations, np.float32)
    never = np.full(num_simulations, NEVER)
    # In `finding_from_margins` a doubtful margin of 0 or more makes a verdict undecidable.
    return finding_from_margins(
        applies, margin, never, never, doubtful=np.ones(num_simulations, np.bool_)
    )


def undecidable_rules(pack: Pack, unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules that a recording cannot decide.

    Args:
        pack: The rules.
        unknown: Names of the unknown inputs of the recording (`trajectories.UNKNOWNS`).

    Returns:
        Codes of rules: under `always` those that are undecidable wherever they apply, under
        `sometimes` those that are undecidable in some simulations.
    """
    missing = frozenset(unknown)
    always = [rule.code for rule in pack.rules if rule.required_inputs & missing]
    sometimes = [
        rule.code
        for rule in pack.rules
        if rule.conditional_inputs & missing and not rule.required_inputs & missing
    ]
    return {"always": always, "sometimes": sometimes}


def judge_pack(pack: Pack, case: Case, errors: MeasurementErrors | None = None) -> Findings:
    """Judge each simulation of a batch by each rule of a pack.

    Args:
        pack: The rules.
        case: Recordings of any source, with their signals and events.
        errors: Standard errors of measured positions and speeds; None for exact values.

    Returns:
        Arrays of shape (simulation, rule).
    """
    # A pack may leave a rule undecidable if its authors did not read the text of the law for it.
    deciding_codes = frozenset(rule.code for rule in pack.deciding_rules)
    rule_findings = [
        judge_rule(rule, case, errors)
        if rule.code in deciding_codes
        else _as_undecidable(rule.criterion.check(case))
        for rule in pack.rules
    ]
    columns = {
        field.name: np.stack([getattr(finding, field.name) for finding in rule_findings], axis=1)
        for field in dataclasses.fields(Finding)
    }
    version = pack.version
    if case.trajectories.road.is_two_way:
        # The rules for two-way roads came later. With a version of their own they did not change
        # the version of findings on one-way roads.
        version += pack.two_way_version
    if errors is not None:
        version += str(errors)  # So that findings with and without errors cannot be confused.
    return Findings(rule_codes=pack.codes, version=version, **columns)


LAWS = {pack.name: pack for pack in (PORTUGAL, GERMANY)}
"""The packs of this package, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """How to decide from the findings whether an overtake is legal, and how to classify it.

    Attributes:
        name: Short name, a value of the column `policy`.
        required: Codes of the rules that a legal overtake must not break.
        allows_undecided: Whether a completed overtake counts as legal if no required rule is broken
            and one is undecidable; otherwise it is `SUCCESS_U`.
        censors_open: Whether an overtake that is under way when the recording ends is `CENSORED`;
            otherwise it counts as not completed.
        names_departures: Whether an ego that leaves the road or spins without a contact is
            `UNSUCCESS_DEP`; otherwise it counts as not completed, or as no attempt if it had begun
            no overtake.
        min_severity: Lowest severity at which a breach counts.
        tolerances: Tolerance by code of a rule. A breach of such a rule counts if it exceeds the
            tolerance, at any severity.
    """

    name: str
    required: tuple[str, ...]
    allows_undecided: bool = False
    censors_open: bool = True
    names_departures: bool = True
    min_severity: Severity = Severity.LIGHT
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])


@dataclass(frozen=True, slots=True, kw_only=True)
class Legality(Batch):
    """Counts of breaches under a policy; every array has shape (simulation,).

    Attributes:
        num_broken: Number of required rules with a breach that counts.
        num_undecidable: Number of required rules that apply and cannot be decided.
        is_legal: Whether `num_broken` is 0; undecidable rules do not matter.
    """

    num_broken: U8
    num_undecidable: U8
    is_legal: Mask


_POLICIES = (
    Policy(
        name="paper",
        required=(),
        allows_undecided=True,
        censors_open=False,
        names_departures=False,
    ),
    Policy(name="default", required=()),
    Policy(name="strict", required=()),
    Policy(name="serious", required=(), min_severity=Severity.SERIOUS),
    Policy(name="enforced", required=(), min_severity=Severity.SERIOUS),
)
"""The policies of every law, without the rules and tolerances that each law adds.

`paper` has the rules and the five classes of the reproduced study. `default` adds rules that need
weather and road, `strict` rules such as signalling and keeping right. `serious` and `enforced`
require the rules of `default` but count fewer breaches: by the letter of the law nearly every
overtake on a motorway is illegal, because the distance was too short for a moment. `enforced`
counts breaches that are fined in practice: only it has tolerances, and its German rule of the
distance is A2 instead of A1.
"""

STORED_POLICY_NAMES = ("paper", "default", "strict")
"""Names of the policies that data sets store, in the order of every table. The others are computed
on request."""

DEFAULT_POLICY = "default"
"""Name of the policy that classifies unless the user names another one."""

POLICY_OF_PROFILE = {"pinto2023": "paper", "pinto2023-physical": "paper"}
"""Default policies of the profiles that reproduce the study: they are classified by its rules."""


@cache
def policies_of_law(pack: str) -> tuple[Policy, ...]:
    """All policies with the rules of a pack of this package, by its name; empty for other packs."""
    if pack not in LAWS:
        return ()
    rules = LAWS[pack].rules
    return tuple(
        dataclasses.replace(
            policy,
            required=tuple(rule.code for rule in rules if policy.name in rule.required_by),
            tolerances={
                rule.code: rule.tolerances[policy.name]
                for rule in rules
                if policy.name in rule.tolerances
            },
        )
        for policy in _POLICIES
    )


STORED_POLICIES = tuple(
    policy for policy in policies_of_law("pt") if policy.name in STORED_POLICY_NAMES
)
"""The policies that data sets store, with the rules of the Portuguese pack.

Data sets hold verdicts by Portuguese law only; verdicts by other laws are computed on request.
"""


def default_policy(profile: str) -> str:
    """Name of the policy that classifies a profile unless the user names another one.

    Args:
        profile: Name of the profile of simulations, or format of a recording.
    """
    return POLICY_OF_PROFILE.get(profile, DEFAULT_POLICY)


def choose_policy(name: str | None, profile: str) -> str:
    """Name of the policy to use: the named one, or the default of the profile.

    Args:
        name: Name of a policy; None for the default.
        profile: As in `default_policy`.
    """
    return default_policy(profile) if name is None else name


def stored_policy(name: str) -> Policy:
    """The stored policy of a name.

    Raises:
        ConfigError: No stored policy has that name.
    """
    policies_by_name = {policy.name: policy for policy in STORED_POLICIES}
    check_choice(name, policies_by_name, what="policy", where="rules")
    return policies_by_name[name]


def assess_legality(
    findings: Findings, policy: Policy, pack: Pack | None = None, case: Case | None = None
) -> Legality:
    """Count the breaches and the undecidable rules of each simulation under a policy.

    Args:
        findings: Findings of each rule for each simulation.
        policy: The policy.
        pack: The rules by which the batch was judged; None ignores the tolerances of the policy.
        case: The judged batch; None ignores the tolerances of the policy.

    Raises:
        ConfigError: A rule that the policy requires is not among the findings.
    """
    missing = [code for code in policy.required if code not in findings.rule_codes]
    if missing:
        raise ConfigError(
            what=f"policy {policy.name}",
            where="findings",
            expected=f"the rules {', '.join(policy.required)}",
            got=f"none called {', '.join(missing)}",
            next_step="check a pack that has them",
        )
    columns = [findings.rule_codes.index(code) for code in policy.required]
    counted = counted_breaches(findings, policy, pack, case)[:, columns]
    num_broken = counted.sum(axis=1, dtype=np.uint8)
    is_undecidable = findings.verdict[:, columns] == Verdict.UNDECIDABLE
    return Legality(
        num_broken=num_broken,
        num_undecidable=is_undecidable.sum(axis=1, dtype=np.uint8),
        is_legal=num_broken == 0,
    )


def counted_breaches(
    findings: Findings, policy: Policy, pack: Pack | None = None, case: Case | None = None
) -> Mask:
    """Whether a breach of each rule counts under a policy, shape (simulation, rule).

    `assess_legality` describes the arguments. Rules that the policy does not require are treated
    alike.
    """
    counted = findings.verdict == Verdict.ILLEGAL
    if policy.min_severity > Severity.LIGHT:
        counted = counted & (findings.severity >= policy.min_severity)
    for code, tolerance in policy.tolerances.items():
        if pack is not None and case is not None and code in findings.rule_codes:
            column = findings.rule_codes.index(code)
            counted[:, column] = exceeds_tolerance(findings, code, tolerance, pack, case)
    return counted


def exceeds_tolerance(
    findings: Findings, code: str, tolerance: Tolerance, pack: Pack, case: Case
) -> Mask:
    """Whether a breach of one rule exceeds all parts of a tolerance, shape (simulation,)."""
    column, rule = findings.rule_codes.index(code), pack.rule(code)
    excess = -findings.margin[:, column]
    is_exceeded = (findings.verdict[:, column] == Verdict.ILLEGAL) & (excess > tolerance.margin)
    limit = rule.criterion.limit(case) if tolerance.share else None
    if limit is not None:
        # The share refers to the measured value, which is the limit plus the excess.
        is_exceeded &= excess > np.float32(tolerance.share) * (limit + excess)
    if tolerance.duration:
        is_exceeded &= breach_duration(findings, column, case) > tolerance.duration
    return is_exceeded


def breach_duration(findings: Findings, column: int, case: Case) -> F32:
    """Time of the longest unbroken run of a breach of one rule, (simulation,) [s]; 0 if kept."""
    return findings.longest_run[:, column].astype(np.float32) * np.float32(
        case.signals.frame_interval_ms / 1000.0
    )
