"""Columns that are attributes of a batch: what they are, and where their values lie."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.model.batch import Batch
from overtaking.tables.columns import SUFFIXES, Enumeration, column

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
        return self._picked(batch, self.path)

    def missing(self, batch: Batch, unknown: Collection[str]) -> Mask:
        """Where the column is null, of the shape of the values."""
        values = self.values(batch)
        if self.needs & frozenset(unknown):
            return np.ones(values.shape, np.bool_)
        absent = np.zeros(values.shape, np.bool_)
        if values.dtype.kind == "f":
            absent = ~np.isfinite(values)
        if not self.present:
            return absent
        return absent | (self._picked(batch, self.present) == 0)

    def _picked(self, batch: Batch, path: str) -> NDArray[Any]:
        found = attrgetter(path)(batch)
        return found if self.place is None or found.ndim == 1 else found[:, self.place]


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
