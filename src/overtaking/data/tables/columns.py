"""How a column is named, and what its unit means.

A name ends in its unit, so that no file leaves a reader guessing. Integer columns are counts of a
step and carry the step in the name: `x_mm`, `heading_100urad`. Read through this package they come
back as SI numbers under the SI name: `x_m`, `heading_rad`.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.data.tables.arrow import missing_in, to_numpy

SUFFIXES = {
    "1": "",
    "%": "_percent",
    "m": "_m",
    "m^2": "_m2",
    "mm": "_mm",
    "mm/h": "_mmph",
    "s": "_s",
    "s^2": "_s2",
    "ms": "_ms",
    "m/s": "_mps",
    "mm/s": "_mmps",
    "m/s^2": "_mps2",
    "mm/s^2": "_mmps2",
    "rad": "_rad",
    "0.1 mrad": "_100urad",
    "rad/s": "_radps",
    "0.1 mrad/s": "_100uradps",
    "1/rad": "_per_rad",
    "kg": "_kg",
    "kg m^2": "_kgm2",
    "N s": "_newton_s",
    "W": "_w",
}
"""The ending of a column's name for each unit; `1` marks counts, numbers, names and yes or no."""

STEPS = {
    "mm": ("m", 1000),
    "ms": ("s", 1000),
    "mm/s": ("m/s", 1000),
    "mm/s^2": ("m/s^2", 1000),
    "0.1 mrad": ("rad", 10_000),
    "0.1 mrad/s": ("rad/s", 10_000),
}
"""The SI unit and the number of steps in it, for each unit of an integer column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Enumeration:
    """A column that names one of a few things.

    Attributes:
        names: What it can name, in the order of their codes in memory.
    """

    names: tuple[str, ...]

    @property
    def type(self) -> pa.DataType:
        """The column's type; Parquet gives dictionaries back with this index type."""
        return pa.dictionary(pa.int32(), pa.string())


def column(
    name: str,
    kind: pa.DataType | Enumeration,
    unit: str,
    description: str,
    *,
    nullable: bool = False,
    flags: Iterable[str] = (),
) -> pa.Field:
    """A field with its unit and meaning in its metadata.

    Args:
        name: The name, with the ending that belongs to the unit.
        kind: An Arrow type, or an enumeration, whose names are then listed in the metadata.
        unit: A key of `SUFFIXES`.
        description: One sentence.
        nullable: Whether the column may hold nulls.
        flags: Names of the bits of an integer column, from the lowest; empty where it has none.
    """
    if not name.endswith(SUFFIXES[unit]):
        raise ValueError(f"column {name}: expected an ending {SUFFIXES[unit]!r} for unit {unit!r}")
    metadata = {"unit": unit, "description": description}
    if isinstance(kind, Enumeration):
        metadata["names"] = json.dumps(kind.names)
    if names := list(flags):
        metadata["flags"] = json.dumps(names)
    type_ = kind.type if isinstance(kind, Enumeration) else kind
    return pa.field(name, type_, nullable=nullable, metadata=metadata)


def unit_of(field: pa.Field) -> str:
    """The unit of a column."""
    return field.metadata[b"unit"].decode()


def names_of(field: pa.Field) -> tuple[str, ...]:
    """The names that an enumeration column can hold, in the order of their codes; else empty."""
    return _listed(field, b"names")


def flags_of(field: pa.Field) -> tuple[str, ...]:
    """The names of the bits of a column, from the lowest; empty where it has none."""
    return _listed(field, b"flags")


def si_name(field: pa.Field) -> str:
    """The name under which a column comes back as an SI number."""
    unit = unit_of(field)
    if unit not in STEPS:
        return field.name
    return field.name.removesuffix(SUFFIXES[unit]) + SUFFIXES[STEPS[unit][0]]


def codes(values: pa.ChunkedArray | pa.Array, names: tuple[str, ...]) -> NDArray[np.int64]:
    """The codes of an enumeration column, -1 where it is null.

    The dictionary of a column may hold its names in any order, as other writers list those that
    occur; codes are those of the schema.
    """
    chunks = values.chunks if isinstance(values, pa.ChunkedArray) else [values]
    known = {name: code for code, name in enumerate(names)}
    parts = [np.empty(0, dtype=np.int64)]
    for chunk in chunks:
        meaning = np.array([known[name] for name in chunk.dictionary.to_pylist()] or [-1])
        missing = missing_in(chunk.indices)
        indices = np.where(missing, 0, to_numpy(chunk.indices))
        parts.append(np.where(missing, -1, meaning[indices]))
    return np.concatenate(parts)


def short_codes(chunk: pa.Array, names: tuple[str, ...]) -> NDArray[np.int8]:
    """The codes of an enumeration column of few names, as `codes`."""
    if chunk.dictionary.to_pylist() != list(names):
        return codes(chunk, names).astype(np.int8)
    found = to_numpy(chunk.indices).astype(np.int8)
    if chunk.null_count:
        found[missing_in(chunk.indices)] = -1
    return found


def _listed(field: pa.Field, key: bytes) -> tuple[str, ...]:
    text = (field.metadata or {}).get(key)
    return _read_list(text) if text else ()


@cache
def _read_list(text: bytes) -> tuple[str, ...]:
    """The names in a text of metadata; the same few are asked for with every column."""
    return tuple(json.loads(text))
