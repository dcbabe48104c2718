"""Facts, programs and answers of clingo, for tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.logic import facts as writing
from overtaking.analysis.logic.source import Group

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

Row = tuple[Any, ...]
ALL = writing.everything(with_law=True)


def group_of(case: Case) -> Group:
    """A case as a group of simulations without labels."""
    return Group(numbers=np.arange(case.signals.num_simulations), case=case)


def program_of(case: Case, *, every: int = writing.EVERY) -> str:
    """All facts of a case, as text."""
    shared = writing.shared_facts(case.trajectories, ALL)
    found = writing.facts(group_of(case), ALL, every=every)
    return (writing.text(shared) + writing.text(found)).decode()


def solved(text: str, *asked: str) -> dict[str, set[Row]]:
    """What a program without choices says.

    Args:
        text: Facts and rules.
        asked: Names of predicates; all of them if there is none.

    Returns:
        The arguments of the atoms by predicate.
    """
    import clingo

    complaints: list[str] = []
    control = clingo.Control(logger=lambda _, message: complaints.append(message))
    control.add("base", [], text)
    control.ground([("base", [])])
    assert [one for one in complaints if "does not occur" not in one] == []
    atoms = control.symbolic_atoms
    found: dict[str, set[Row]] = {}
    for name, arity, is_positive in atoms.signatures:
        if name in (asked or (name,)):
            for atom in atoms.by_signature(name, arity, is_positive):
                found.setdefault(name, set()).add(tuple(map(value, atom.symbol.arguments)))
    return found


def value(symbol: object) -> int | str:
    """A number or a constant of clingo as Python's."""
    import clingo

    assert isinstance(symbol, clingo.Symbol)
    return symbol.number if symbol.type is clingo.SymbolType.Number else str(symbol)
