"""Rules of law: what each says of each simulation, and which of them a policy requires."""

from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.policies import (
    POLICIES,
    Legality,
    Policy,
    Tolerance,
    choose_policy,
    default_policy,
    legality,
    policies_for,
    policy,
)
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import (
    Finding,
    Grade,
    Pack,
    Rule,
    Text,
    adopt,
    check,
    judge,
    lacking,
)

PACKS = {pack.name: pack for pack in (PORTUGAL, GERMANY)}
"""The packs of this package, by name."""

__all__ = [
    "GERMANY",
    "PACKS",
    "POLICIES",
    "PORTUGAL",
    "Finding",
    "Grade",
    "Legality",
    "MeasurementErrors",
    "Pack",
    "Policy",
    "Rule",
    "Text",
    "Tolerance",
    "adopt",
    "check",
    "choose_policy",
    "default_policy",
    "judge",
    "lacking",
    "legality",
    "policies_for",
    "policy",
]
