"""Rules of law, packs of rules, and the functions that rules call.

A rule is a function of a case, with its description; a pack is a list of rules:

    import numpy as np
    from overtaking import law

    def slow(case: law.Case) -> law.Finding:
        return law.always(np.float32(25.0) - case.signals.speed, law.manoeuvre(case))

    SLOW = law.Rule(
        id="my.1@2026",
        code="S1",
        law="none",
        title="Slowly",
        gloss="Overtake at no more than 25 m/s.",
        predicate="During the manoeuvre: speed <= 25 m/s.",
        unit="m/s",
        grade=law.Grade.LIGHT,
        check=slow,
    )
    PACK = law.Pack(name="mine", version="mine-1", rules=(SLOW,))

`overtaking.label(runs, law=PACK)` and `overtaking label DATA --law module:PACK` apply it.
"""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from overtaking.core.errors import ConfigError, check_choice
from overtaking.labels.instants import at, seconds_of
from overtaking.labels.law import GERMANY, PACKS, PORTUGAL, Policy, Text, Tolerance
from overtaking.labels.law import policies_for as policies_of_package
from overtaking.labels.law.alongside import alongside
from overtaking.labels.law.distances import beside
from overtaking.labels.law.errors import deciding, standard_error
from overtaking.labels.law.frames import (
    ENDLESS,
    Span,
    always,
    always_at,
    conduct,
    frames_of,
    instant,
    manoeuvre,
    passed,
    settled,
)
from overtaking.labels.law.policies import POLICIES, STORED
from overtaking.labels.law.rule import (
    Finding,
    Grade,
    MeasurementErrors,
    Pack,
    Rule,
    Spread,
    adopt,
    decided,
    judge,
)
from overtaking.labels.law.speeds import CLASSES, ROAD_KINDS, keeps_limit, limits_of
from overtaking.labels.signals import encounter
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Case, Severity, Verdict

__all__ = [
    "CLASSES",
    "ENDLESS",
    "GERMANY",
    "NEVER",
    "PORTUGAL",
    "ROAD_KINDS",
    "Case",
    "Finding",
    "Grade",
    "MeasurementErrors",
    "NeighbourRole",
    "Pack",
    "Policy",
    "Rule",
    "Severity",
    "Span",
    "Spread",
    "Text",
    "Tolerance",
    "Verdict",
    "adopt",
    "alongside",
    "always",
    "always_at",
    "at",
    "beside",
    "conduct",
    "decided",
    "deciding",
    "encounter",
    "frames_of",
    "instant",
    "judge",
    "keeps_limit",
    "limits_of",
    "load_pack",
    "manoeuvre",
    "passed",
    "policies_for",
    "seconds_of",
    "settled",
    "standard_error",
]


def load_pack(law: str | Pack) -> Pack:
    """Load a pack of rules.

    Args:
        law: A pack; `pt` for the Portuguese pack, `de` for the German one; or `module:NAME` of a
            pack in a Python module that is installed or in the working folder. The module is run.

    Raises:
        ConfigError: The module or pack does not exist, or two of its rules have the same code.
    """
    if isinstance(law, Pack):
        return _check_pack(law)
    if law in PACKS:
        return PACKS[law]
    module, colon, name = law.partition(":")
    if not (module and colon and name):
        raise _law_error(law, "pt, de, or MODULE:NAME", "another form")
    working_folder = str(Path.cwd())
    if working_folder not in sys.path:
        sys.path.append(working_folder)
    try:
        pack = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # The module of another author may raise anything.
        raise _law_error(law, "a module that can be imported", f"{error!r}") from None
    if not isinstance(pack, Pack):
        raise _law_error(law, f"a Pack called {name}", type(pack).__name__)
    return _check_pack(pack)


def policies_for(pack: Pack, names: Sequence[str] | None = None) -> tuple[Policy, ...]:
    """The policies that decide about classes.

    A pack of this package has policies of its own. Another pack gets each Portuguese policy whose
    rules it has. Without such a policy it gets one, `all`, that requires every rule about a duty of
    the ego.

    Args:
        pack: The pack.
        names: Names of policies of the pack; None for the policies that data sets store.

    Raises:
        ConfigError: The pack has no policy of a name.
    """
    package_policies = policies_of_package(pack.name) if pack.name in PACKS else ()
    applicable = package_policies or tuple(
        policy for policy in POLICIES if {*policy.required} <= {*pack.codes}
    )
    duties = tuple(rule.code for rule in pack.rules if rule.of_ego)
    policies = applicable or (Policy(name="all", required=duties),)
    by_name = {policy.name: policy for policy in policies}
    if names is None:
        return tuple(policy for policy in policies if policy.name in STORED or not package_policies)
    for name in names:
        check_choice(name, by_name, what="policy", where=pack.name)
    return tuple(by_name[name] for name in names)


def _check_pack(pack: Pack) -> Pack:
    """The pack, after a check that it has rules and that their codes differ."""
    if not pack.rules or len({*pack.codes}) < len(pack.rules):
        codes = ", ".join(pack.codes) or "no rules"
        raise _law_error(pack.name, "one rule or more, each with a code of its own", codes)
    return pack


def _law_error(law: str, expected: str, got: str) -> ConfigError:
    return ConfigError(
        what="law",
        where=law,
        expected=expected,
        got=got,
        next_step="correct the name, or the module",
    )
