"""Which rules make an overtake illegal: several readings, as data in `policies.toml`.

`law_rules.toml` says of each rule which of them require it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import ConfigError, check_choice
from overtaking.knowledge.toml_reader import load_toml, read_record
from overtaking.labels.law.rule import Pack
from overtaking.labels.law.texts import words_of
from overtaking.model.batch import Batch
from overtaking.model.verdicts import Case, Findings, Severity, Verdict

_FILE, _TOLERANCES = "policies.toml", "tolerances.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far beyond the letter of a rule a policy looks away; a breach exceeds all of it.

    Attributes:
        margin: Margin beyond the border, in the unit of the rule, 0 or more.
        share: Share of the measured value, 0 to 1; only of rules that have a `limit`.
        lasting: Time of the longest unbroken part of the breach [s].
    """

    margin: float = 0.0
    share: float = 0.0
    lasting: float = 0.0


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
