"""Columns that are attributes of a batch: what they are, and where their values lie."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.data.tables.arrow import Masked
from overtaking.data.tables.columns import SUFFIXES, Enumeration, column
from overtaking.model.batch import Batch

FLOAT, DOUBLE, BOOL, BYTE = pa.float32(), pa.float64(), pa.bool_(), pa.uint8()

ENCOUNTER = (
    ("gap", "m", "Gap between the bumpers, negative alongside"),
    ("closing_speed", "m/s", "Speed at which that gap shrinks"),
    ("time_gap", "s", "Gap over the speed of the one behind; null if it stands"),
    ("ttc", "s", "Time to collision at constant speeds; null if never"),
    ("mttc", "s", "Time to collision at constant accelerations; null if never"),
    ("drac", "m/s^2", "Deceleration that just avoids a collision; null if none does"),
)
"""The attributes of `model.safety.Encounter`, with units and meanings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A column of a table that is made from a batch.

    Attributes:
        field: The column.
        path: Its attribute, dotted.
        place: Index on the attribute's last axis, None if it has no axis more than the table.
        present: Attribute that says where there is a value, dotted; empty if that is everywhere.
        needs: What must be known of a recording, names of `model.trajectory.UNKNOWNS`.
    """

    field: pa.Field
    path: str
    place: int | None = None
    present: str = ""
    needs: frozenset[str] = frozenset()

    def values(self, batch: Batch) -> NDArray[Any]:
        """The values; infinite ones are null in the table."""
        return _picked(batch, self.path, self.place)


def masked_columns(
    columns: Iterable[Measured],
    batch: Batch,
    unknown: Collection[str],
    rows: NDArray[np.int64] | None = None,
) -> dict[str, Masked]:
    """Some columns of a table, by name.

    Args:
        columns: Which.
        batch: Where their values lie.
        unknown: What is not known of a recording.
        rows: Places in the attributes, as if each were flat; None for all of them.
    """

    @cache
    def absent(path: str, place: int | None) -> Mask:
        return chosen(_picked(batch, path, place)) == 0

    def chosen(values: NDArray[Any]) -> NDArray[Any]:
        return values if rows is None else values.reshape(-1).take(rows)

    def masked(one: Measured) -> Masked:
        values = chosen(one.values(batch))
        if not one.needs.isdisjoint(unknown):
            return Masked(values, np.ones(values.shape, np.bool_))
        missing = absent(one.present, one.place) if one.present else None
        if values.dtype.kind == "f":
            infinite = ~np.isfinite(values)
            missing = infinite if missing is None else missing | infinite
        return Masked(values, np.zeros(values.shape, np.bool_) if missing is None else missing)

    return {one.field.name: masked(one) for one in columns}


def _picked(batch: Batch, path: str, place: int | None) -> NDArray[Any]:
    found = attrgetter(path)(batch)
    return found if place is None or found.ndim == 1 else found[:, place]


def measured(
    name: str,
    path: str,
    unit: str,
    description: str,
    *,
    kind: pa.DataType | Enumeration = FLOAT,
    place: int | None = None,
    present: str = "",
    needs: Sequence[str] = (),
) -> Measured:
    """A column with the ending of its unit; the other arguments are those of `Measured`."""
    field = column(name + SUFFIXES[unit], kind, unit, description, nullable=True)
    return Measured(field=field, path=path, place=place, present=present, needs=frozenset(needs))


def encounter(prefix: str, path: str, who: str) -> list[Measured]:
    """The columns of an encounter.

    Args:
        prefix: How their names begin.
        path: The encounter, dotted.
        who: Whom it is with.
    """
    return [
        measured(
            f"{prefix}_{name}",
            f"{path}.{name}",
            unit,
            f"{meaning}; {who}",
            present=f"{path}.valid",
        )
        for name, unit, meaning in ENCOUNTER
    ]
