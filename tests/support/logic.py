"""Facts, programs and answers of clingo, for tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.logic.fact_files import (
    DEFAULT_FRAME_STEP,
    all_facts,
    fact_lines,
    measure_road_facts,
    measure_simulation_facts,
)
from overtaking.analysis.logic.simulation_groups import SimulationGroup

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

Row = tuple[Any, ...]
ALL_FACTS = all_facts(with_law=True)


def group_of(case: Case) -> SimulationGroup:
    """A case as a group of simulations without labels."""
    return SimulationGroup(simulation_ids=np.arange(case.signals.num_simulations), case=case)


def facts_text(case: Case, *, frame_step: int = DEFAULT_FRAME_STEP) -> str:
    """All facts of a case, as text."""
    group = group_of(case)
    columns = measure_road_facts(group, ALL_FACTS)
    columns |= measure_simulation_facts(group, ALL_FACTS, frame_step=frame_step)
    return fact_lines(columns).decode()


def solve(program: str, *predicates: str) -> dict[str, set[Row]]:
    """The atoms that follow from a program without choices.

    Args:
        program: Facts and rules.
        predicates: Names of predicates; without names all of them.

    Returns:
        The arguments of the atoms by predicate.
    """
    import clingo

    messages: list[str] = []
    control = clingo.Control(logger=lambda _, message: messages.append(message))
    control.add("base", [], program)
    control.ground([("base", [])])
    assert [message for message in messages if "does not occur" not in message] == []
    atoms = control.symbolic_atoms
    rows: dict[str, set[Row]] = {}
    for name, arity, is_positive in atoms.signatures:
        if name in (predicates or (name,)):
            for atom in atoms.by_signature(name, arity, is_positive):
                rows.setdefault(name, set()).add(tuple(map(_plain_value, atom.symbol.arguments)))
    return rows


def _plain_value(symbol: object) -> int | str:
    """A number or a constant of clingo as a value of Python."""
    import clingo

    assert isinstance(symbol, clingo.Symbol)
    return symbol.number if symbol.type is clingo.SymbolType.Number else str(symbol)
