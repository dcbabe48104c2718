"""Rules of law: what each says of each simulation, and which of them a policy requires."""

from overtaking.rules.pack import Pack, check
from overtaking.rules.policies import POLICIES, Legality, Policy, legality, policy
from overtaking.rules.portugal import PORTUGAL
from overtaking.rules.rule import Check, Grade, Rule, judge

__all__ = [
    "POLICIES",
    "PORTUGAL",
    "Check",
    "Grade",
    "Legality",
    "Pack",
    "Policy",
    "Rule",
    "check",
    "judge",
    "legality",
    "policy",
]
