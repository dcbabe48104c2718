"""The tables of the literature as plain values, with the references that they cite."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from overtaking.analysis.literature import reading
from overtaking.analysis.literature.own import own_row
from overtaking.analysis.literature.records import DrivingDataset
from overtaking.analysis.literature.selection import doubts, select
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from overtaking.data.load import Dataset

TABLES = ("systems", "datasets", "factors", "studies")
"""What there is."""


def answer(
    table: str,
    *,
    wanted: Collection[str] = (),
    own: Dataset | None = None,
    is_corrected: bool = True,
) -> dict[str, Any]:
    """One of the tables.

    Args:
        table: One of `TABLES`.
        wanted: What a data set must have, words out of `selection.WORDS`.
        own: A data set of one's own to put below the others, whatever is wanted.
        is_corrected: Whether corrections are applied; if not, values are as printed.

    Returns:
        `rows`, and `references` with the citation of each id that a row names.

    Raises:
        ConfigError: There is no such table, or no such thing can be wanted.
    """
    if table not in TABLES:
        raise ConfigError.of(
            what="table",
            where="literature",
            expected=f"one of {', '.join(TABLES)}",
            got=table,
            next_step="choose one of them",
        )
    if table == "datasets":
        rows: list[Any] = select(reading.datasets(is_corrected=is_corrected).values(), wanted)
        rows += [own_row(own)] if own is not None else []
    elif table == "systems":
        rows = list(reading.systems(is_corrected=is_corrected).values())
    else:
        rows = list((reading.factors() if table == "factors" else reading.studies()).values())
    return {"rows": [_values(row) for row in rows], "references": _references(rows)}


def _values(row: Any) -> dict[str, Any]:
    """A record by the names of its fields, with what is doubtful about a data set."""
    values = dataclasses.asdict(row)
    return values | {"doubts": doubts(row)} if isinstance(row, DrivingDataset) else values


def _references(rows: Iterable[Any]) -> dict[str, str]:
    """What the rows cite, by id."""
    cited: set[str] = set()
    for row in rows:
        cited |= {row.source, getattr(row, "reference", row.source)}
        cited |= {one.source for one in getattr(row, "corrections", ())}
    return {id_: one.citation for id_, one in reading.references().items() if id_ in cited}
