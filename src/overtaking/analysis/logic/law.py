"""The law as a logic program: verdicts on simulations, from measurements alone."""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.clauses import needed, program
from overtaking.analysis.logic.facts import group_text
from overtaking.analysis.logic.reasoning import MEMORY_MIB, TIMEOUT_S, Reasoner
from overtaking.analysis.logic.vocabulary import CODES, MAX_FRAME, RULE, VERDICT
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import NEVER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.logic.clauses import Needed
    from overtaking.analysis.logic.source import Group

CODES_DE = (
    *("A1", "A2", "A3", "A4", "O1", "O2", "O3", "O6", "O8", "O9", "O11", "O12", "O14", "O15"),
    *("O17", "V2", "F1", "S1"),
)
"""The German ones."""

PROGRAMS = {"pt": (("law.lp",), CODES), "de": (("law.lp", "law_de.lp"), CODES_DE)}
"""Files and rules by the name of a pack; the German program continues the Portuguese one."""

NO_VERDICT = 255
"""The program derives no verdict, or two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """Verdicts of the program; arrays have shape (simulation, rule of `PROGRAMS`).

    Attributes:
        verdict: `model.verdicts.Verdict`, or `NO_VERDICT`.
        first: First frame of a breach, `NEVER` without one.
    """

    verdict: NDArray[np.uint8]
    first: NDArray[np.int32]


@cache
def law(pack: str = "pt") -> Needed:
    """The program of a law, with the facts that it reads.

    Args:
        pack: A name of `PROGRAMS`.
    """
    clauses = tuple(clause for file in PROGRAMS[pack][0] for clause in program(file))
    return needed(clauses, [("verdict", (None,) * 3), ("illegal", (None,) * 2)])


atexit.register(law.cache_clear)  # Like the programs of `clauses`.


def lawyer(
    pack: str = "pt", *, timeout_s: float = TIMEOUT_S, memory_mib: int = MEMORY_MIB
) -> Reasoner:
    """A reasoner with the program of a law: a context, for `judged`.

    Args:
        pack: A name of `PROGRAMS`.
        timeout_s: Time limit for all groups together [s].
        memory_mib: Memory limit [MiB].
    """
    asked = (("verdict", 3), ("breach", 3))
    return Reasoner(law(pack).text, asked, timeout_s=timeout_s, memory_mib=memory_mib)


def judged(reasoner: Reasoner, group: Group, pack: str = "pt") -> Verdicts:
    """Verdicts of the law on a group.

    Args:
        reasoner: A `lawyer`.
        group: The simulations.
        pack: That of the lawyer.
    """
    rows = reasoner.rows(group_text(group, law(pack).demand, MAX_FRAME))
    place = {int(number): row for row, number in enumerate(group.numbers)}
    column = {code.lower(): index for index, code in enumerate(PROGRAMS[pack][1])}
    verdicts: dict[tuple[int, int], set[str]] = {}
    first = np.full((len(place), len(column)), NEVER)
    for number, rule, what in rows:
        if rule not in column:
            continue  # Of the law that this one continues.
        at = place[number], column[rule]
        if isinstance(what, int):  # The frame of a breach.
            first[at] = what if first[at] == NEVER else min(what, first[at])
        else:
            verdicts.setdefault(at, set()).add(what)
    verdict = np.full(first.shape, NO_VERDICT, np.uint8)
    for at, found in verdicts.items():
        if len(found) == 1:
            verdict[at] = VERDICT.names.index(found.pop())
    return Verdicts(verdict=verdict, first=first)


def title_of(rule: str) -> str:
    """Article and title of a rule by its name in the program."""
    rule_of_law = PORTUGAL.rule(CODES[RULE.names.index(rule)])
    return f"{rule_of_law.code}, {rule_of_law.title} ({rule_of_law.article})"
