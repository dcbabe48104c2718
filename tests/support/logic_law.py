"""Verdicts of the law as a logic program, an oracle for the rules in Python.

The package has the Portuguese program only. The German one, `tests/reference/law/germany.lp`,
continues it.
"""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.fact_files import PROGRAM_FOLDER, pooled_facts
from overtaking.analysis.logic.programs import parse_rules, rules_needed_by
from overtaking.analysis.logic.reasoner import MEMORY_MIB, TIMEOUT_S, Reasoner
from overtaking.analysis.logic.vocabulary import MAX_FRAME, RULE_CODES, VERDICT
from overtaking.model.overtake_events import NEVER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.logic.programs import NeededRules
    from overtaking.analysis.logic.simulation_groups import SimulationGroup

GERMAN_PROGRAM = Path(__file__).parents[1] / "reference" / "law" / "germany.lp"

GERMAN_CODES = (
    *("A1", "A2", "A3", "A4", "O1", "O2", "O3", "O6", "O8", "O9", "O11", "O12", "O14", "O15"),
    *("O17", "V2", "F1", "S1"),
)
"""The German rules in `GERMAN_PROGRAM`."""

CODES = {"pt": RULE_CODES, "de": GERMAN_CODES}
"""The rules that are compared, by the name of a pack."""

PROGRAMS = {
    "pt": (PROGRAM_FOLDER / "law.lp",),
    "de": (PROGRAM_FOLDER / "law.lp", GERMAN_PROGRAM),
}
"""The files of each program, by the name of a pack."""

NO_VERDICT = 255
"""The program derives no verdict, or two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramVerdicts:
    """Verdicts of a program; arrays have shape (simulation, rule of `CODES`).

    Attributes:
        verdict: `Verdict`, or `NO_VERDICT`.
        first_frame: First frame of a breach, `NEVER` without a breach.
    """

    verdict: NDArray[np.uint8]
    first_frame: NDArray[np.int32]


@cache
def program_of_law(pack: str = "pt") -> NeededRules:
    """The program of a law, with the facts that it reads.

    Args:
        pack: A key of `PROGRAMS`.
    """
    text = "".join(path.read_text(encoding="utf-8") for path in PROGRAMS[pack])
    return rules_needed_by([("verdict", (None,) * 3), ("illegal", (None,) * 2)], parse_rules(text))


atexit.register(program_of_law.cache_clear)  # Before clingo, as in `programs`.


def law_reasoner(
    pack: str = "pt", *, timeout_s: float = TIMEOUT_S, memory_mib: int = MEMORY_MIB
) -> Reasoner:
    """A reasoner with the program of a law: a context manager, for `program_verdicts`.

    Args:
        pack: A key of `PROGRAMS`.
        timeout_s: Time limit for all groups together [s].
        memory_mib: Memory limit [MiB].
    """
    predicates = (("verdict", 3), ("breach", 3))
    program = program_of_law(pack).program
    return Reasoner(program, predicates, timeout_s=timeout_s, memory_mib=memory_mib)


def program_verdicts(
    reasoner: Reasoner, group: SimulationGroup, pack: str = "pt"
) -> ProgramVerdicts:
    """Verdicts of a program on a group of simulations.

    Args:
        reasoner: Made by `law_reasoner` for the same pack.
        group: The simulations.
        pack: A key of `PROGRAMS`.
    """
    facts = pooled_facts(group, program_of_law(pack).requested_facts, MAX_FRAME)
    row_of_id = {int(number): row for row, number in enumerate(group.simulation_ids)}
    column_of_rule = {code.lower(): column for column, code in enumerate(CODES[pack])}
    verdicts: dict[tuple[int, int], set[str]] = {}
    first_frame = np.full((len(row_of_id), len(column_of_rule)), NEVER)
    for number, rule, frame_or_verdict in reasoner.solve(facts):
        if rule not in column_of_rule:
            continue  # The German program derives Portuguese verdicts too.
        index = row_of_id[number], column_of_rule[rule]
        if isinstance(frame_or_verdict, int):  # An atom of `breach`.
            first_frame[index] = min(
                frame_or_verdict,
                frame_or_verdict if first_frame[index] == NEVER else first_frame[index],
            )
        else:
            verdicts.setdefault(index, set()).add(frame_or_verdict)
    verdict = np.full(first_frame.shape, NO_VERDICT, np.uint8)
    for index, names in verdicts.items():
        if len(names) == 1:
            verdict[index] = VERDICT.constants.index(names.pop())
    return ProgramVerdicts(verdict=verdict, first_frame=first_frame)
