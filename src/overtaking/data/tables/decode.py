"""Tables for people: pandas, SI numbers, names instead of codes."""

import numpy as np
import pandas as pd
import pyarrow as pa

from overtaking.core.units import INTEGER_UNITS
from overtaking.data.tables.columns import codes, flags_of, names_of, si_name, unit_of


def decode(table: pa.Table) -> pd.DataFrame:
    """A table with SI numbers in its columns.

    Integer counts of a step become floats in the SI unit, NaN where they were null, and their names
    follow: `x_mm` becomes `x_m`. Enumerations become categories, flags one boolean column each,
    other integers with nulls pandas' nullable integers, and hashes hexadecimal text.

    Args:
        table: A table of one of the `SCHEMAS`.
    """
    columns: dict[str, pd.Series] = {}
    for field, values in zip(table.schema, table.columns, strict=True):
        if flags := flags_of(field):
            columns |= _bits(values, flags)
        else:
            columns[si_name(field)] = _column(values, field)
    return pd.DataFrame(columns)


def _column(values: pa.ChunkedArray, field: pa.Field) -> pd.Series:
    unit = unit_of(field)
    if unit in INTEGER_UNITS:
        # A division rounds correctly, so 123 mm is the double nearest to 0.123; a product need not.
        floats = values.to_numpy(zero_copy_only=False).astype(np.float64)
        return pd.Series(floats / INTEGER_UNITS[unit][1])
    if names := names_of(field):
        known = pd.CategoricalDtype(list(names))
        return pd.Series(pd.Categorical.from_codes(codes(values, names), dtype=known))
    if pa.types.is_fixed_size_binary(field.type):
        return pd.Series([value.hex() for value in values.to_pylist()], dtype="str")
    if field.nullable and (pa.types.is_integer(field.type) or pa.types.is_boolean(field.type)):
        return values.to_pandas(types_mapper=_NULLABLE.get)
    return values.to_pandas()


_NULLABLE = {
    pa.uint8(): pd.UInt8Dtype(),
    pa.int16(): pd.Int16Dtype(),
    pa.uint64(): pd.UInt64Dtype(),
    pa.bool_(): pd.BooleanDtype(),
}
"""Pandas types of nullable booleans, and of nullable integers that do not count steps."""


def _bits(values: pa.ChunkedArray, flags: tuple[str, ...]) -> dict[str, pd.Series]:
    """One boolean column for each bit."""
    if values.null_count == len(values) > 0:  # All are unknown.
        unknown = pd.Series(pd.array([pd.NA] * len(values), dtype="boolean"))
        return dict.fromkeys(flags, unknown)
    bits = values.to_numpy()
    return {name: pd.Series((bits >> index & 1).astype(bool)) for index, name in enumerate(flags)}
