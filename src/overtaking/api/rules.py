"""Rules of law of one's own: what a rule and a pack are, and what rules may look at.

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
        law: A pack, `pt` for the Portuguese one or `de` for the German one, or `module:name` of one
            in a Python module that is installed or in the working folder. Its code is run.

    Raises:
        ConfigError: There is no such module or pack, or two of its rules have the same code.
    """
    if isinstance(law, Pack):
        return _sound(law)
    if law in PACKS:
        return PACKS[law]
    module, colon, name = law.partition(":")
    if not (module and colon and name):
        raise _refused(law, "pt, de, or MODULE:NAME", "another form")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        found = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # Whatever the code of others raises, it is one line here.
        raise _refused(law, "a module that can be imported", f"{error!r}") from None
    if not isinstance(found, Pack):
        raise _refused(law, f"a Pack called {name}", type(found).__name__)
    return _sound(found)


def policies_for(pack: Pack, names: Sequence[str] | None = None) -> tuple[Policy, ...]:
    """The policies that decide about classes.

    A pack of this package has policies of its own. Of another pack they are those of the Portuguese
    one whose rules it has; without any there is one, `all`, that requires every rule about the
    ego's duty.

    Args:
        pack: The pack.
        names: Which of its policies; None for those that data sets store.

    Raises:
        ConfigError: The pack has no policy of a name.
    """
    own = policies_of_package(pack.name) if pack.name in PACKS else ()
    fitting = own or tuple(one for one in POLICIES if {*one.required} <= {*pack.codes})
    duties = tuple(rule.code for rule in pack.rules if rule.of_ego)
    known = {one.name: one for one in fitting or (Policy(name="all", required=duties),)}
    if names is None:
        return tuple(one for one in known.values() if one.name in STORED or not own)
    for name in names:
        check_choice(name, known, what="policy", where=pack.name)
    return tuple(known[name] for name in names)


def _sound(pack: Pack) -> Pack:
    """A pack whose rules can be told apart."""
    if not pack.rules or len({*pack.codes}) < len(pack.rules):
        got = ", ".join(pack.codes) or "no rules"
        raise _refused(pack.name, "one rule or more, each with a code of its own", got)
    return pack


def _refused(law: str, expected: str, got: str) -> ConfigError:
    return ConfigError(
        what="law",
        where=law,
        expected=expected,
        got=got,
        next_step="correct the name, or the module",
    )
