"""Columns of a table by the names that a map of columns gives them."""

from __future__ import annotations

import difflib
import re
import unicodedata
from typing import TYPE_CHECKING

from overtaking.recordings.messages import shown
from overtaking.recordings.table_errors import refused

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from overtaking.core.errors import ImportFormatError

_MAX_LISTED = 120  # Characters of the columns that a message lists.
_NAME_WITH_UNIT = re.compile(r"^(.*\S)\s*[\[(]([^\[\]()]*)[\])]$")
_NO_UNIT = frozenset({"", "-", "1"})

_UNIT_SPELLINGS = {
    "metre": "m", "metres": "m", "meter": "m", "meters": "m",
    "feet": "ft", "foot": "ft",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "µs": "us", "μs": "us",
    "mps": "m/s", "m*s^-1": "m/s", "ms^-1": "m/s", "m s^-1": "m/s", "kph": "km/h", "kmh": "km/h",
    "kmph": "km/h", "fps": "ft/s", "mi/h": "mph",
    "m/s/s": "m/s^2", "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s**2": "m/s^2", "m*s^-2": "m/s^2",
    "ms^-2": "m/s^2", "m s^-2": "m/s^2", "ft/s2": "ft/s^2", "ft/s²": "ft/s^2",
    "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "°/s": "deg/s", "hz": "1/s",
}  # fmt: skip
"""Other spellings of the units of `column_map.UNITS` in the headers of tables."""


def name_key(name: str) -> str:
    """A name without what does not count: blanks around it, capitals, forms of accents."""
    return unicodedata.normalize("NFC", name.strip()).casefold()


def unit_of_header(name: str, units: Iterable[str]) -> tuple[str, str] | None:
    """Name and unit of a header such as `x [m]` or `id [-]`; None without a known unit.

    Args:
        name: The header.
        units: The known units.
    """
    match = _NAME_WITH_UNIT.match(unicodedata.normalize("NFC", name.strip()))
    if match is None:
        return None
    spelling = match[2].strip()
    unit = _UNIT_SPELLINGS.get(spelling.casefold(), spelling)
    if unit in _NO_UNIT:
        return match[1], ""
    known = {candidate.casefold(): candidate for candidate in units}
    return (match[1], known[unit.casefold()]) if unit.casefold() in known else None


def match_columns(
    names: Sequence[str],
    requested: Iterable[str],
    where: str,
    *,
    units: Mapping[str, str] | None = None,
    known_units: Iterable[str] = (),
    index_names: Iterable[str] = (),
) -> dict[str, str]:
    """The name in a table of each requested column, by the requested name.

    A header of exactly the requested name comes first, then one that differs in capital letters,
    blanks around it or the form of its accents, then one that has a unit behind the name.

    Args:
        names: The columns of the table.
        requested: The columns to find.
        where: Name of the table in messages.
        units: Unit of some requested columns in the map of columns.
        known_units: Units that a header may have.
        index_names: Names of the index of a data frame.

    Raises:
        ImportFormatError: A column is missing, there are several of that name, or its header has
            another unit than the map.
    """
    name_in_table: dict[str, str] = {}
    key_of_name = [name_key(name) for name in names]
    headers = [unit_of_header(name, known_units) for name in names]
    for name in requested:
        key = name_key(name)
        matches = [column for column in names if column == name]
        matches = matches or [
            column for column, other in zip(names, key_of_name, strict=True) if other == key
        ]
        if not matches:
            with_unit = {
                column: header[1]
                for column, header in zip(names, headers, strict=True)
                if header is not None and name_key(header[0]) == key
            }
            unit = (units or {}).get(name, "")
            matches = [column for column, other in with_unit.items() if other in ("", unit)]
            if with_unit and not matches:
                raise _unit_error(where, name, unit, with_unit)
        if len(matches) != 1:
            raise _column_error(where, name, names, len(matches), list(index_names))
        name_in_table[name] = matches[0]
    return name_in_table


def _unit_error(
    where: str, name: str, unit: str, unit_in_table: Mapping[str, str]
) -> ImportFormatError:
    """The error for a column whose header has another unit than the map of columns."""
    column, other = next(iter(unit_in_table.items()))
    return refused(
        where,
        f"column {shown(column)}",
        f"the unit of the map of columns, {unit or 'none'}",
        other,
        f'correct the unit in the map: "{shown(name)} [{other}]"; if the header is wrong, name it '
        f'whole: "{shown(column)} [{unit or other}]"',
    )


def _column_error(
    where: str, name: str, names: Sequence[str], num_matches: int, index_names: list[str]
) -> ImportFormatError:
    """The error for a column that is missing, or that several columns could be."""
    got = f"{num_matches} of them" if num_matches else f"none among {_listed(names)}"
    if name_key(name) in map(name_key, index_names):
        step = f"{shown(name)} is in the index: call reset_index() on the data frame"
    else:
        step = "correct the map of columns"
        nearest = None if num_matches else _nearest(name, names)
        if nearest is not None:
            step += f"; the nearest column is {shown(nearest)}"
    return refused(where, "columns", f"a column {shown(name)}", got, step)


def _nearest(name: str, names: Sequence[str]) -> str | None:
    """The column whose name is most like another one; None if no name is like it."""
    key = name_key(name)
    name_of_key = {name_key(column): column for column in names}
    for other, column in name_of_key.items():
        if key in re.split(r"[^\w]|_", other) or other in re.split(r"[^\w]|_", key):
            return column
    nearest = difflib.get_close_matches(key, name_of_key, n=1)
    return name_of_key[nearest[0]] if nearest else None


def _listed(names: Sequence[str]) -> str:
    """The columns of a table, as many as a message has room for."""
    listed = ""
    for number, name in enumerate(names):
        if len(listed) + len(shown(name)) > _MAX_LISTED:
            return f"{listed} and {len(names) - number} more"
        listed += f", {shown(name)}" if listed else shown(name)
    return listed or "no columns"
