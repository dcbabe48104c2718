"""Declarations of facts: each stands at the function that measures the fact.

A fact is a predicate with values, such as `event(7,attempt,120)`. A declaration has the predicate,
its meaning, and the types of its arguments. The function returns one column of integers for each
argument. The integer of a constant is its code: its position in the list of constants of its type.
Files list facts in the order of the declarations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic.fact_source import FactSource
from overtaking.analysis.logic.vocabulary import ArgumentType, Predicate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

FactColumns = tuple[NDArray[np.integer], ...]
"""A column for each argument of one predicate, with a row for each fact; constants as codes."""


def no_facts(num_arguments: int) -> FactColumns:
    """Columns without rows."""
    return (np.zeros(0, np.int64),) * num_arguments


def concatenate_facts(parts: Sequence[FactColumns], num_arguments: int) -> FactColumns:
    """The facts of several parts, which may be empty."""
    if not parts:
        return no_facts(num_arguments)
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))


FactMeasurement = Callable[[FactSource], FactColumns]
"""Function from the recordings of some simulations to the columns of one predicate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact(Predicate):
    """A predicate of facts.

    Attributes:
        measure: Returns the columns of its arguments.
        required_input: Property without which a recording has no facts of the predicate, such as
            `weather`: one of `UNKNOWNS` (`model.trajectories`), the properties that may be
            unknown. None if every recording has all properties that the predicate needs.
    """

    measure: FactMeasurement
    required_input: str | None = None


def fact(
    facts: dict[str, Fact],
    name: str,
    meaning: str,
    *,
    required_input: str | None = None,
    unused_constants: Mapping[str, tuple[str, ...]] | None = None,
    **arguments: ArgumentType,
) -> Callable[[FactMeasurement], FactMeasurement]:
    """Declare the predicate whose facts the decorated function measures.

    Args:
        facts: The group that the predicate joins.
        name: Name of the predicate.
        meaning: Its statement about its arguments, for lists and headers of files.
        required_input: As in `Fact`.
        unused_constants: By label of an argument, constants of its type that no fact has; a query
            with one of them is an error.
        arguments: Type of each argument, by its label, in the order of the columns.
    """

    def add(measure: FactMeasurement) -> FactMeasurement:
        facts[name] = Fact(
            name=name,
            meaning=meaning,
            arguments=arguments,
            unused_constants=unused_constants or {},
            measure=measure,
            required_input=required_input,
        )
        return measure

    return add


def measure_facts(facts: Iterable[Fact], source: FactSource) -> dict[str, FactColumns]:
    """The columns of each predicate whose input the recordings have."""
    unknown = source.trajectories.unknown
    return {fact.name: fact.measure(source) for fact in facts if fact.required_input not in unknown}
