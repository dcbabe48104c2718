"""Recordings as facts: integers in columns, and the text of them in either language."""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from overtaking.analysis.logic.ego import ego_facts
from overtaking.analysis.logic.scene import (
    Columns,
    cast_facts,
    course_facts,
    event_facts,
    motion_facts,
    road_facts,
)
from overtaking.analysis.logic.vocabulary import FACTS, PLACE, PLACES, POLICY, Predicate
from overtaking.core.errors import SchemaError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from overtaking.model.labels import Case
    from overtaking.model.road import Road

I64 = NDArray[np.int64]
Pattern = tuple[str | None, ...]
"""The constants that arguments must be, None where they may be anything."""

BY_NAME = {one.name: one for one in FACTS}
EVERY = 10
"""Positions are written every so many frames, unless asked otherwise."""

_POOLED = 100
"""Facts in a statement."""

_BY_MOTION = frozenset(["frame", "next", "position", "speed"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """Which facts are asked for.

    Attributes:
        patterns: For each predicate that is asked for, its arguments in every place where it is.
    """

    patterns: Mapping[str, frozenset[Pattern]]

    def __contains__(self, name: str) -> bool:
        """Whether a predicate is asked for."""
        return name in self.patterns

    @property
    def places(self) -> frozenset[str]:
        """The places around the ego that are asked for in every frame."""
        asked: set[str] = set()
        for name in ("spacing", "forced_braking"):
            for pattern in self.patterns.get(name, ()):
                place = pattern[1]
                asked |= set(PLACES) if place is None else {place} & set(PLACE.names)
        return frozenset(asked)

    def allows(self, predicate: Predicate, columns: Columns) -> NDArray[np.bool_]:
        """Which facts of a predicate match a pattern; only constants are looked at."""
        allowed = np.zeros(len(columns[0]), np.bool_)
        for pattern in self.patterns[predicate.name]:
            matches = np.ones(len(allowed), np.bool_)
            for column, constant, (_, kind) in zip(
                columns, pattern, predicate.arguments, strict=True
            ):
                if constant is not None and kind.names:
                    code = kind.names.index(constant) if constant in kind.names else -1
                    matches &= column == code
            allowed |= matches
        return allowed


def everything(*, with_law: bool) -> Demand:
    """All facts; those that only the law reads too, if asked for."""
    return Demand(
        patterns={
            one.name: frozenset([(None,) * len(one.arguments)])
            for one in FACTS
            if with_law or not one.is_of_law
        }
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Classes:
    """What the labels of some simulations say.

    Attributes:
        classes: `OvertakeClass`, shape (simulation, policy).
        outcome: `Outcome`, shape (simulation,).
    """

    classes: NDArray[np.integer]
    outcome: NDArray[np.integer]


def shared_facts(
    road: Road, unknown: frozenset[str], interval_ms: int, demand: Demand
) -> dict[str, Columns]:
    """What holds for every simulation of a data set."""
    return _ordered(road_facts(road, unknown, interval_ms), demand)


def facts(
    case: Case,
    numbers: NDArray[np.integer],
    demand: Demand,
    *,
    every: int = EVERY,
    labels: Classes | None = None,
) -> dict[str, Columns]:
    """The facts of a batch of recordings.

    Args:
        case: The recordings.
        numbers: Their numbers, shape (simulation,).
        demand: Which facts are asked for.
        every: Every how many frames positions are written; frames in which lanes, order or events
            change are written too.
        labels: Their classes, for the facts `class` and `outcome`.

    Returns:
        For each predicate the columns of its arguments; constants as their codes.
    """
    which = np.asarray(numbers, np.int64)
    found = cast_facts(case, which) | event_facts(case, which)
    if any(name in demand for name in ("present", "lane", "indicator", "neighbour")):
        found |= course_facts(case, which)
    if any(name in demand for name in _BY_MOTION):
        found |= motion_facts(case, which, every)
    if labels is not None:
        found |= _label_facts(which, labels)
    found |= ego_facts(case, which, set(demand.patterns), demand.places)
    return _ordered(found, demand)


def _label_facts(numbers: I64, labels: Classes) -> dict[str, Columns]:
    policies = len(POLICY.names)
    return {
        "class": (
            np.repeat(numbers, policies),
            np.tile(np.arange(policies), len(numbers)),
            labels.classes.reshape(-1),
        ),
        "outcome": (numbers, labels.outcome),
    }


def _ordered(found: dict[str, Columns], demand: Demand) -> dict[str, Columns]:
    """The facts that are asked for, in the order of the vocabulary."""
    chosen: dict[str, Columns] = {}
    for one in FACTS:
        if one.name in demand and one.name in found:
            columns = found[one.name]
            allowed = demand.allows(one, columns)
            chosen[one.name] = tuple(column[allowed] for column in columns)
    return chosen


def num_facts(found: Mapping[str, Columns]) -> int:
    """How many facts there are."""
    return sum(len(columns[0]) for columns in found.values())


def text(found: Mapping[str, Columns]) -> bytes:
    """Facts as lines that clingo and Prolog both read.

    Raises:
        SchemaError: A value is outside the range of its type, so that sums of it could wrap.
    """
    parts: list[bytes] = []
    for name, columns in found.items():
        joined = _arguments(BY_NAME[name], columns, f"{name}(", ").\n")
        parts.append(joined.buffers()[2].to_pybytes() if len(joined) else b"")
    return b"".join(parts)


def pooled_text(found: Mapping[str, Columns]) -> bytes:
    """The same for clingo alone, with many facts in a statement, which it reads faster.

    Raises:
        SchemaError: A value is outside the range of its type.
    """
    lines: list[str] = []
    for name, columns in found.items():
        rows = _arguments(BY_NAME[name], columns, "", "").to_pylist()
        parts = (rows[first : first + _POOLED] for first in range(0, len(rows), _POOLED))
        lines += [f"{name}({';'.join(part)})." for part in parts]
    return "\n".join(lines).encode()


def _arguments(predicate: Predicate, columns: Columns, before: str, after: str) -> Any:
    """The arguments of all facts of one predicate, with something before and after each."""
    parts: list[object] = [before]
    for place, (column, (name, kind)) in enumerate(zip(columns, predicate.arguments, strict=True)):
        if place:
            parts.append(",")
        if kind.names:
            names = pa.array(kind.names, pa.large_string())
            parts.append(names.take(pa.array(column.astype(np.int64))))
            continue
        if len(column) and (column.min() < kind.low or column.max() > kind.high):
            raise _out_of_range(predicate, name, column, kind.low, kind.high)
        parts.append(pc.cast(pa.array(column), pa.large_string()))
    parts.append(after)
    return pc.binary_join_element_wise(*_as_large(parts), pa.scalar("", pa.large_string()))


def _as_large(parts: list[object]) -> list[object]:
    return [pa.scalar(one, pa.large_string()) if isinstance(one, str) else one for one in parts]


def _out_of_range(
    predicate: Predicate, argument: str, column: NDArray[np.integer], low: int, high: int
) -> SchemaError:
    wrong = column[(column < low) | (column > high)][0]
    return SchemaError.of(
        what=f"argument {argument} of {predicate.head}",
        where="facts",
        expected=f"{low} to {high}, so that no sum leaves 32 bits",
        got=int(wrong),
        next_step="leave that simulation out",
    )
