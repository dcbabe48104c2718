"""The answer to a query as values for JSON, and as CSV."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from overtaking.analysis.database.query import Answer


def values_of(answer: Answer) -> dict[str, Any]:
    """The answer as plain values; what JSON cannot hold becomes text or null."""
    return {
        "columns": list(answer.columns),
        "rows": [[_plain(cell) for cell in row] for row in answer.rows],
        "is_cut": answer.is_cut,
    }


def csv_of(answer: Answer) -> str:
    """The answer as CSV with a header; nothing stands for null."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(answer.columns)
    writer.writerows([_plain(cell) for cell in row] for row in answer.rows)
    return text.getvalue()


def _plain(cell: Any) -> Any:
    """A value that JSON has."""
    if cell is None or isinstance(cell, bool | int | str):
        return cell
    if isinstance(cell, float):
        return cell if math.isfinite(cell) else None
    if isinstance(cell, bytes | bytearray | memoryview):
        return bytes(cell).hex()
    if isinstance(cell, list | tuple):
        return [_plain(one) for one in cell]
    if isinstance(cell, dict):
        return {str(name): _plain(one) for name, one in cell.items()}
    return str(cell)
