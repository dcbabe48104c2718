"""Short forms of `FieldSpec` for fields of batches, and the list of fields in their help."""

import inspect
from collections.abc import Sequence
from typing import TypeVar

from overtaking.model.batch import Axes, AxisEnd, ColumnName, FieldSpec, batch_fields

Cls = TypeVar("Cls", bound=type)


def within(
    low: float,
    high: float | str,
    unit: str = "",
    meaning: str = "",
    *,
    axes: Axes | None = None,
    also: int | None = None,
    is_open: bool = False,
    column: str | None = "{}",
    needs: Sequence[str] = (),
    since: int = 1,
) -> FieldSpec:
    """Declaration of a field whose values have a range.

    Args:
        low: Smallest value.
        high: Largest value, or the name of an axis whose indices are meant.
        unit: Unit, empty for plain numbers.
        meaning: See `FieldSpec`.
        axes: See `FieldSpec`.
        also: One more value, which stands for "none".
        is_open: Whether the smallest value itself is excluded.
        column: See `meant`.
        needs: See `FieldSpec`.
        since: See `FieldSpec`.
    """
    return FieldSpec(
        meaning,
        unit or "1",
        low,
        AxisEnd(high) if isinstance(high, str) else high,
        low_is_open=is_open,
        missing=also,
        axes=axes,
        column=_column_name(column),
        needs=needs,
        since=since,
    )


def meant(
    meaning: str,
    unit: str = "1",
    *,
    column: str | None = "{}",
    present: str = "",
    needs: Sequence[str] = (),
    names: Sequence[str] = (),
    since: int = 1,
) -> FieldSpec:
    """Declaration of a field without a range, such as a flag or a derived measure.

    Args:
        meaning: See `FieldSpec`.
        unit: See `FieldSpec`.
        column: Name of its table column without the unit, in which `{}` stands for the name of the
            field; None for a field without a column.
        present: See `FieldSpec.null_unless`.
        needs: See `FieldSpec`.
        names: See `FieldSpec`.
        since: See `FieldSpec`.
    """
    return FieldSpec(
        meaning,
        unit,
        column=_column_name(column),
        null_unless=present,
        needs=needs,
        names=names,
        since=since,
    )


def along(*axes: str | int) -> FieldSpec:
    """Declaration of an array whose axes differ from its class's; a number is a fixed length."""
    return FieldSpec(axes=axes)


def _column_name(column: str | None) -> ColumnName | None:
    """A name in which `{}` stands for the name of the field, such as `ego_{}`."""
    if column is None:
        return None
    if column.endswith("{}"):
        return ColumnName(prefix=column.removesuffix("{}"))
    return ColumnName(column)


def documented(cls: Cls) -> Cls:
    """A dataclass whose docstring lists its fields, for `help` and notebooks."""
    lines = [
        f"    {name}: {field.spec.meaning}"
        f"{'' if field.spec.unit == '1' else f' [{field.spec.unit}]'}."
        for name, field in batch_fields(cls).items()
    ]
    if cls.__doc__:  # None under `python -OO`.
        # Python 3.13 removes the indentation of docstrings, earlier versions keep it.
        cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__), "", "Attributes:", *lines, ""])
    return cls
