"""Requests for columns of a table, with types, limits and units, built from a map of columns."""

from __future__ import annotations

import unicodedata
from dataclasses import replace
from typing import TYPE_CHECKING

from overtaking.recordings.column_map import RECORDING, TRACKS, UNITS, VEHICLES, ColumnMap
from overtaking.recordings.column_matching import name_key
from overtaking.recordings.column_request import NUMBER, TEXT, TIME, ColumnRequest
from overtaking.recordings.findings import Check, Consequence, Finding

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pyarrow as pa

SIZE_RANGES = {"length": (0.1, 50.0), "width": (0.1, 10.0)}
"""Least and largest plausible sizes of vehicles [m]."""

TEXT_QUANTITIES = frozenset({"type", "lane", "upper_lines", "lower_lines"})
"""Quantities with words as cells; all others but `vehicle` have numbers."""

# Larger numbers are no positions or frames, but cells of another column or damaged ones. Limits of
# positions are in the unit of the map.
_LIMITS = {"x": 1.0e8, "y": 1.0e8, "frame": 1.0e9}
_MAX_TIME = 1.0e13  # In the unit of the map: milliseconds since 1970 fit.
_MAX_DATE = 1.0e10  # Seconds since 1970, for units in which a date exceeds `_MAX_TIME`.


def with_choice(columns: ColumnMap, only: Mapping[str, str]) -> ColumnMap:
    """The map with further conditions on rows.

    Args:
        columns: The map.
        only: Required value of each column, in addition to those of the map. Values are brought
            into Unicode's form NFC, as the cells are, so that both compare equal.
    """
    values = {**columns.only, **only}
    composed = {name: unicodedata.normalize("NFC", value) for name, value in values.items()}
    return replace(columns, only=composed)


def meaningful_words(columns: ColumnMap) -> dict[str, frozenset[str]]:
    """Words of the map that are values even if they look like a missing cell, such as "NA".

    Returns:
        The words of each column that holds words, by the name of the column.
    """
    words: dict[str, frozenset[str]] = {}
    for name, column in columns.columns.items():
        if name in TEXT_QUANTITIES:
            lanes = columns.road.get("lanes", ()) if name == "lane" else ()
            kinds = columns.kinds if name == "type" else ()
            words[column.names[0]] = frozenset({*kinds, *map(str, lanes)})
    return words


def build_request(columns: ColumnMap, table: str, existing: Iterable[str] = ()) -> ColumnRequest:
    """Build the request for the columns of one table.

    Args:
        columns: The map.
        table: One of `column_map.TABLES`.
        existing: Names of the columns in the file. Columns of `ColumnMap.only`, and sizes that the
            map takes from the table of vehicles, are optional: the request has them if they exist.
    """
    types: dict[str, pa.DataType] = dict.fromkeys(columns.names(table), TEXT)
    limits: dict[str, float] = {}
    units: dict[str, str] = {}
    for name, column in columns.columns.items():
        if column.table == table and name not in TEXT_QUANTITIES and name != "vehicle":
            types |= dict.fromkeys(column.names, TIME if name == "time" else NUMBER)
        if column.table == table:
            limits |= dict.fromkeys(column.names, _LIMITS[name]) if name in _LIMITS else {}
            if name == "time":
                limits |= dict.fromkeys(column.names, max(_MAX_TIME, _MAX_DATE / column.factor))
            units |= dict.fromkeys(column.names, column.unit)
    if table in (TRACKS, VEHICLES):
        types[columns.columns["vehicle"].names[0]] = TEXT
    optional: dict[str, pa.DataType] = dict.fromkeys(columns.only, TEXT)
    if table == TRACKS:
        optional |= {
            column.names[0]: NUMBER
            for name, column in columns.columns.items()
            if name in SIZE_RANGES and column.table == VEHICLES
        }
    keys = set(map(name_key, existing))
    types |= {
        name: kind
        for name, kind in optional.items()
        if name_key(name) in keys and name not in types
    }
    time = columns.columns.get("time")
    return ColumnRequest(
        types=types,
        limits=limits,
        gaps=() if table == RECORDING else tuple(types),
        units=units,
        known_units=tuple(UNITS),
        time_unit=1.0 if time is None else time.factor,
        has_time_unit=time is not None and bool(time.unit),
        header=columns.header,
        thousands=columns.thousands,
    )


def thousands_findings(grouped: Mapping[str, str], num_rows: int) -> list[Finding]:
    """Report each column whose numbers may have separators of thousands.

    Args:
        grouped: An example cell of each such column, by the name of the column.
        num_rows: Number of rows of the table.
    """
    return [
        Finding(
            check=Check.NUMBER_FORMAT,
            consequence=Consequence.REPORTED,
            detail=(
                f"column {column}: {example} is read as a number with decimals, but all cells may "
                "be whole numbers with separators of thousands; state recording.thousands in the "
                'map of columns: ".", "," or "none"'
            ),
            rows=num_rows,
        )
        for column, example in grouped.items()
    ]
