"""Judge a case by a rule or a pack of rules, and read the findings under a policy.

`law_rules.toml` lists for each rule the policies that require it; `policies.toml` has the policies.
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import ConfigError, check_choice
from overtaking.knowledge import toml_reader
from overtaking.knowledge.toml_reader import load_toml, read_record
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.margins import decided
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Grade, Pack, Rule, Tolerance
from overtaking.labels.law.texts import words_of
from overtaking.model.batch import Batch
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import VehicleKind, may_be_kind
from overtaking.model.verdicts import Case, Finding, Findings, Severity, Verdict


def judge(rule: Rule, case: Case, errors: MeasurementErrors | None = None) -> Finding:
    """What a rule says of a batch, with severity, and undecidable where it lacks what it needs.

    Args:
        rule: The rule.
        case: The batch.
        errors: Of its measurement; a margin within its own is undecidable.
    """
    found = _judged(rule, case)
    if errors is None or rule.spread is None:
        return found
    is_decided = (found.verdict == Verdict.LEGAL) | (found.verdict == Verdict.ILLEGAL)
    if not is_decided.any():
        return found
    error = toml_reader.constant("law.errors.coverage") * rule.spread.of(case, found, errors)
    return _doubted(found, is_decided & (np.abs(found.margin) < error))


def _doubted(found: Finding, inside: Mask) -> Finding:
    """The same check, undecidable in the simulations of a mask."""
    return found.replace(
        verdict=np.where(inside, np.uint8(Verdict.UNDECIDABLE), found.verdict),
        margin=np.where(inside, np.float32(0.0), found.margin),
        first_frame=np.where(inside, NEVER, found.first_frame),
        last_frame=np.where(inside, NEVER, found.last_frame),
        longest_run=np.where(inside, np.int32(0), found.longest_run),
        severity=np.where(inside, np.uint8(Severity.NONE), found.severity),
    )


def _judged(rule: Rule, case: Case) -> Finding:
    """Check a rule on a batch without errors of measurement.

    If some kinds of vehicles are unknown and the rule depends on them, it is undecidable where the
    possible kinds lead to different verdicts.
    """
    is_known = case.trajectories.is_kind_known
    if is_known is None or "kinds" not in rule.needs | rule.partly:
        return _judged_as_stated(rule, case)
    return _agreed_check(
        [_judged_as_stated(rule, possible_case) for possible_case in _possible_kinds(case)]
    )


def _possible_kinds(case: Case) -> Iterator[Case]:
    """Yield the batch once for each kind, which vehicles of unknown kind have if their length fits.

    A vehicle whose length does not fit is a car. Every vehicle is a truck once, whatever its
    length: where kind and length of a recording contradict each other, the length may be wrong.
    """
    run = case.trajectories
    vehicles = run.scenario.vehicles
    car = np.uint8(VehicleKind.MEDIUM_CAR)
    for kind in (
        car,
        VehicleKind.TRUCK,
        VehicleKind.VAN,
        VehicleKind.MOTORCYCLE,
        VehicleKind.BICYCLE,
    ):
        may_be = may_be_kind(kind, vehicles.length) | (kind == VehicleKind.TRUCK)
        possible = np.where(may_be, np.uint8(kind), car)
        kinds = np.where(run.known_kinds, vehicles.kind, possible)
        scenario = run.scenario.replace(vehicles=vehicles.replace(kind=kinds))
        yield case.replace(trajectories=run.replace(scenario=scenario))


def _agreed_check(checks: Sequence[Finding]) -> Finding:
    """Combine checks of the same batch: undecidable in simulations in which the verdicts differ.

    Where they agree, the check with the smallest absolute margin counts.
    """
    margins = np.stack([np.abs(check.margin) for check in checks])
    choice = margins.argmin(axis=0)
    names = [field.name for field in dataclasses.fields(Finding)]
    stacked = {name: np.stack([getattr(check, name) for check in checks]) for name in names}
    columns = np.arange(len(choice))
    nearest = Finding(**{name: values[choice, columns] for name, values in stacked.items()})
    return _doubted(nearest, (stacked["verdict"] != stacked["verdict"][0]).any(axis=0))


def _judged_as_stated(rule: Rule, case: Case) -> Finding:
    """Check a rule with every vehicle of the kind that the batch states."""
    found = rule.check(case)
    if rule.needs & case.trajectories.unknown:
        return _undecided(found)
    if rule.grade is Grade.BY_BREACH:
        return found
    broken = found.verdict == Verdict.ILLEGAL
    severity = broken.view(np.uint8) * np.uint8(_severity(rule.grade, case))
    return found.replace(severity=severity)


def _severity(grade: Grade, case: Case) -> Severity:
    """Severity of any breach of a rule with this grade."""
    if grade is Grade.LIGHT:
        return Severity.LIGHT
    trajectories = case.trajectories
    motorway = trajectories.road.kind == "motorway" and "road_kind" not in trajectories.unknown
    return Severity.VERY_SERIOUS if grade is Grade.BY_ROAD and motorway else Severity.SERIOUS


def _undecided(found: Finding) -> Finding:
    """The same check where nothing can be said of simulations that the rule is about."""
    about = found.verdict != Verdict.NOT_APPLICABLE
    n = len(about)
    nothing = np.zeros(n, np.float32)
    never = np.full(n, NEVER)
    return decided(about, nothing, never, never, doubtful=np.ones(n, np.bool_))


def lacking(pack: "Pack", unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules that a recording cannot decide.

    Args:
        pack: The rules.
        unknown: What the recording does not tell, names of `UNKNOWNS`.

    Returns:
        Codes of the rules that are undecidable wherever they apply, under `always`, and of those
        that are in some simulations, under `sometimes`.
    """
    missing = frozenset(unknown)
    always = [rule.code for rule in pack.rules if rule.needs & missing]
    partly = [
        rule.code for rule in pack.rules if rule.partly & missing and not rule.needs & missing
    ]
    return {"always": always, "sometimes": partly}


def check(pack: Pack, case: Case, errors: MeasurementErrors | None = None) -> Findings:
    """What each rule of a pack says of each simulation.

    Args:
        pack: The rules.
        case: Recordings of any source, with their signals and events.
        errors: Of their measurement; None if there are none.

    Returns:
        Arrays of shape (simulation, rule).
    """
    deciding = frozenset(rule.code for rule in pack.deciding_rules)
    found = [
        judge(rule, case, errors) if rule.code in deciding else _undecided(rule.check(case))
        for rule in pack.rules
    ]
    columns = {
        field.name: np.stack([getattr(one, field.name) for one in found], axis=1)
        for field in dataclasses.fields(Finding)
    }
    version = pack.version
    if case.trajectories.road.is_two_way:
        version += pack.two_way_version
    if errors is not None:
        version += str(errors)
    return Findings(rule_codes=pack.codes, version=version, **columns)


_FILE, _TOLERANCES = "policies.toml", "tolerances.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """Which rules count, and how undecidable ones are treated.

    Attributes:
        name: Short name, a value of the column `policy`.
        required: Codes of the rules that a legal overtake must not break.
        allows_undecided: Whether an overtake counts as legal although a rule that applies is
            undecidable; else it is `SUCCESS_U`.
        censors_open: Whether an overtake that is open at the horizon is `CENSORED`; else it counts
            as not completed.
        names_departures: Whether an ego that leaves the road or spins without a contact is
            `UNSUCCESS_DEP`; else it counts as not completed, or as no attempt if it began none.
        least: Severity from which a breach counts.
        tolerances: By code of the rule; with one, a breach beyond it counts at any severity.
    """

    name: str
    required: tuple[str, ...]
    allows_undecided: bool = False
    censors_open: bool = True
    names_departures: bool = True
    least: Severity = Severity.LIGHT
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])


@dataclass(frozen=True, slots=True, kw_only=True)
class Legality(Batch):
    """What a policy makes of findings; every array has shape (simulation,).

    Attributes:
        num_broken: Number of required rules that are broken, as far as the policy counts it.
        num_undecidable: Number of required rules that apply and cannot be decided.
        is_legal: Whether none is broken, as far as can be decided.
    """

    num_broken: U8
    num_undecidable: U8
    is_legal: Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reading:
    """A policy as the file has it."""

    allows_undecided: bool = False
    censors_open: bool = True
    names_departures: bool = True
    least: str = Severity.LIGHT.name.lower()


@cache
def policies_for(pack: str) -> tuple[Policy, ...]:
    """All policies of a pack of this package, by its name; none for a pack that is not here."""
    asked_by = {code: words.policies.split() for code, words in words_of(pack).items()}
    return tuple(
        _policy(name, pack, tuple(code for code, names in asked_by.items() if name in names))
        for name in load_toml(_FILE)["policies"]
        if asked_by
    )


def _policy(name: str, pack: str, required: tuple[str, ...]) -> Policy:
    reading = read_record(_Reading, _FILE, f"policies.{name}")
    return Policy(
        name=name,
        required=required,
        allows_undecided=reading.allows_undecided,
        censors_open=reading.censors_open,
        names_departures=reading.names_departures,
        least=Severity[reading.least.upper()],
        tolerances={
            code: read_record(Tolerance, _TOLERANCES, f"{name}.{pack}.{code}")
            for code in load_toml(_TOLERANCES).get(name, {}).get(pack, {})
        },
    )


STORED: tuple[str, ...] = tuple(load_toml(_FILE)["stored"].split())
"""Names of the policies that data sets keep, in the order of every table."""

POLICIES = tuple(one for one in policies_for("pt") if one.name in STORED)
"""The policies that data sets keep, of the Portuguese pack."""


def default_policy(profile: str) -> str:
    """Name of the policy that decides the class unless the user names one.

    Args:
        profile: Name of the profile of simulations, or format of a recording.
    """
    policies = load_toml(_FILE)
    return str(policies["default_of_profile"].get(profile, policies["default"]))


def choose_policy(name: str | None, profile: str) -> str:
    """Name of the policy to use: the named one, or the default of the profile.

    Args:
        name: Name of a policy; None for the default.
        profile: As in `default_policy`.
    """
    return default_policy(profile) if name is None else name


def policy(name: str) -> Policy:
    """The stored policy of a name.

    Raises:
        ConfigError: There is none of that name.
    """
    known = {one.name: one for one in POLICIES}
    check_choice(name, known, what="policy", where="rules")
    return known[name]


def legality(
    findings: Findings, policy: Policy, pack: Pack | None = None, case: Case | None = None
) -> Legality:
    """Findings under a policy.

    Args:
        findings: What each rule says of each simulation.
        policy: Which of the rules count.
        pack: The rules; read for a policy with tolerances.
        case: What the findings are about; read for a policy with tolerances.

    Raises:
        ConfigError: The findings lack a rule that the policy requires.
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
    place = [findings.rule_codes.index(code) for code in policy.required]
    counted = breaches(findings, policy, pack, case)[:, place]
    broken = counted.sum(axis=1, dtype=np.uint8)
    doubtful = findings.verdict[:, place] == Verdict.UNDECIDABLE
    return Legality(
        num_broken=broken,
        num_undecidable=doubtful.sum(axis=1, dtype=np.uint8),
        is_legal=broken == 0,
    )


def breaches(
    findings: Findings, policy: Policy, pack: Pack | None = None, case: Case | None = None
) -> Mask:
    """Which rules are broken as far as a policy counts it, shape (simulation, rule).

    The arguments are those of `legality`. Rules that the policy does not require are judged like
    the others.
    """
    counted = findings.verdict == Verdict.ILLEGAL
    if policy.least > Severity.LIGHT:
        counted = counted & (findings.severity >= policy.least)
    for code, tolerance in policy.tolerances.items():
        if pack is not None and case is not None and code in findings.rule_codes:
            place = findings.rule_codes.index(code)
            counted[:, place] = beyond(findings, code, tolerance, pack, case)
    return counted


def beyond(findings: Findings, code: str, tolerance: Tolerance, pack: Pack, case: Case) -> Mask:
    """Where a breach of one rule exceeds a tolerance, shape (simulation,)."""
    place, rule = findings.rule_codes.index(code), pack.rule(code)
    excess = -findings.margin[:, place]
    broken = (findings.verdict[:, place] == Verdict.ILLEGAL) & (excess > tolerance.margin)
    if tolerance.share and rule.limit is not None:
        broken &= excess > np.float32(tolerance.share) * (rule.limit(case) + excess)
    if tolerance.lasting:
        broken &= duration(findings, place, case) > tolerance.lasting
    return broken


def duration(findings: Findings, place: int, case: Case) -> F32:
    """Time of the longest unbroken part of a breach of one rule, 0 without, (simulation,) [s]."""
    return findings.longest_run[:, place].astype(np.float32) * np.float32(
        case.signals.frame_interval_ms / 1000.0
    )


PACKS = {pack.name: pack for pack in (PORTUGAL, GERMANY)}
"""The packs of this package, by name."""
