"""Facts as text: which are asked for, lines of either language, and the header of a file."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from overtaking.analysis.logic import vocabulary as words
from overtaking.analysis.logic.recorded import Columns, group_columns, road_columns
from overtaking.core.errors import SchemaError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from overtaking.analysis.logic.source import Group
    from overtaking.model.trajectories import Trajectories

Pattern = tuple[str | None, ...]
"""The constants that arguments must be; None: any value."""

EVERY = 10
"""Default interval between written positions [frames]."""

LANGUAGES = {"asp": ".lp", "prolog": ".pl"}
"""The languages of facts, and the endings of their files."""

_POOLED = 100
"""Facts in a statement."""

_TEXT = pa.large_string()


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """Which facts are asked for.

    Attributes:
        patterns: For each predicate, the patterns of arguments that are asked for.
    """

    patterns: Mapping[str, frozenset[Pattern]]

    @property
    def neighbours(self) -> frozenset[str]:
        """The neighbours of the ego that are asked for in every frame."""
        patterns = [*self.patterns.get("spacing", ()), *self.patterns.get("forced_braking", ())]
        asked = {pattern[1] for pattern in patterns}
        return frozenset(one for one in words.PLACE.names if None in asked or one in asked)

    def chosen(self, found: Mapping[str, Columns]) -> dict[str, Columns]:
        """The facts that match a pattern, in the order of the vocabulary."""
        chosen: dict[str, Columns] = {}
        for one in words.FACTS:
            if one.name in found:
                allowed = self._allows(one, found[one.name])
                chosen[one.name] = tuple(column[allowed] for column in found[one.name])
        return chosen

    def _allows(self, predicate: words.Predicate, columns: Columns) -> NDArray[np.bool_]:
        """Which facts of a predicate match a pattern; only constants are compared."""
        allowed = np.zeros(len(columns[0]), np.bool_)
        for pattern in self.patterns[predicate.name]:
            matches = np.ones(len(allowed), np.bool_)
            for column, constant, (_, of) in zip(
                columns, pattern, predicate.arguments, strict=True
            ):
                if constant is not None and of.names:
                    code = of.names.index(constant) if constant in of.names else -1
                    matches &= column == code
            allowed |= matches
        return allowed


def everything(*, with_law: bool) -> Demand:
    """All facts; the measurements that only the law reads on request."""
    asked = words.FACTS if with_law else (*words.ROAD_FACTS, *words.RECORDED)
    return Demand(patterns={one.name: frozenset([(None,) * len(one.arguments)]) for one in asked})


def shared_facts(recorded: Trajectories, demand: Demand) -> dict[str, Columns]:
    """The facts that every simulation of a data set shares."""
    found = road_columns(recorded)
    return demand.chosen({name: found[name] for name in found if name in demand.patterns})


def facts(group: Group, demand: Demand, *, every: int = EVERY) -> dict[str, Columns]:
    """The facts of a group of simulations.

    Args:
        group: The simulations.
        demand: Which facts are asked for.
        every: Interval between written positions [frames]; frames in which lanes, order or events
            change are written too.

    Returns:
        For each predicate the columns of its arguments; constants as their codes.
    """
    asked = (*words.RECORDED, *words.MEASURED)
    names = [one.name for one in asked if one.name in demand.patterns]
    return demand.chosen(group_columns(group, names, every=every, neighbours=demand.neighbours))


def num_facts(found: Mapping[str, Columns]) -> int:
    """Number of facts."""
    return sum(len(columns[0]) for columns in found.values())


def text(found: Mapping[str, Columns]) -> bytes:
    """Facts as lines that clingo and Prolog both read.

    Raises:
        SchemaError: A value is outside the range of its type, so that sums of it could wrap.
    """
    parts: list[bytes] = []
    for name, columns in found.items():
        joined = _arguments(words.BY_NAME[name], columns, f"{name}(", ").\n")
        parts.append(joined.buffers()[2].to_pybytes() if len(joined) else b"")
    return b"".join(parts)


def group_text(group: Group, demand: Demand, every: int) -> bytes:
    """The facts of a group and its road for clingo, which reads pools faster than single facts.

    Raises:
        SchemaError: A value is outside the range of its type.
    """
    lines: list[str] = []
    found = shared_facts(group.case.trajectories, demand) | facts(group, demand, every=every)
    for name, columns in found.items():
        rows = _arguments(words.BY_NAME[name], columns, "", "").to_pylist()
        parts = (rows[first : first + _POOLED] for first in range(0, len(rows), _POOLED))
        lines += [f"{name}({';'.join(part)})." for part in parts]
    return "\n".join(lines).encode()


def _arguments(predicate: words.Predicate, columns: Columns, before: str, after: str) -> Any:
    """The arguments of all facts of one predicate, with something before and after each."""
    parts: list[Any] = []
    for column, (name, of) in zip(columns, predicate.arguments, strict=True):
        parts.append(pa.scalar("," if parts else before, _TEXT))
        if of.names:
            parts.append(pa.array(of.names, _TEXT).take(pa.array(column.astype(np.int64))))
        else:
            _check_range(predicate, name, of, column)
            parts.append(pc.cast(pa.array(column), _TEXT))
    return pc.binary_join_element_wise(*parts, pa.scalar(after, _TEXT), pa.scalar("", _TEXT))


def _check_range(
    predicate: words.Predicate, argument: str, of: words.Type, column: NDArray[np.integer]
) -> None:
    wrong = column[(column < of.low) | (column > of.high)]
    if len(wrong):
        raise SchemaError(
            what=f"argument {argument} of {predicate.head}",
            where="facts",
            expected=f"{of.low} to {of.high}, so that no sum leaves {words.INT_BITS} bits",
            got=int(wrong[0]),
            next_step="leave that simulation out",
        )


def header(title: str, demand: Demand, language: str) -> str:
    """The beginning of a file of facts: predicates with types, units and ranges of arguments.

    Args:
        title: One line on where the facts come from.
        demand: Which facts follow.
        language: One of `LANGUAGES`.
    """
    predicates = [one for name, one in words.BY_NAME.items() if name in demand.patterns]
    types = {of.name: of for one in predicates for _, of in one.arguments}
    lines = [f"% {title}", "%", "% Every argument is an integer or a constant:", "%"]
    for of in types.values():
        values = " ".join(of.names) or f"{of.low}..{of.high}"
        lines.append(f"%     {of.name:<10} {of.about}: {values}")
    lines += ["%", f"% Sums and products are meant for integers of {words.INT_BITS} bits.", ""]
    for one in predicates:
        names = ", ".join(of.name for _, of in one.arguments)
        lines += [f"% {one.head}: {one.about}", f"%: {one.name}({names})"]
        lines += _declared(one, language)
    return "\n".join(lines) + "\n\n"


def _declared(predicate: words.Predicate, language: str) -> list[str]:
    """Declarations by which a predicate without facts is empty, not an error."""
    name, arity = predicate.signature
    if language == "asp":
        return [f"#defined {name}/{arity}."]
    return [f":- {how}({name}/{arity})." for how in ("multifile", "dynamic", "discontiguous")]
