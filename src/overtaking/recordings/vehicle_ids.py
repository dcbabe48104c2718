"""Vehicles of a recording: their names, and the vehicle of each row of its tables."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from overtaking.recordings.array_table import MISSING, TextColumn
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.messages import shown
from overtaking.recordings.table_csv import MISSING_WORDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from overtaking.core.arrays import I64

# At most 18 digits, which fit a 64-bit integer; ids with more digits are compared as texts.
_WHOLE_NUMBER = re.compile(r"(0|-?[1-9][0-9]{0,17})(?:\.0*)?")


class VehicleIds(NamedTuple):
    """Names of the vehicles of a recording, and the vehicle of each row.

    Attributes:
        names: Name of each vehicle, shape (vehicle,). Numbers are in ascending order, texts in
            alphabetical order.
        vehicles: For each table, the index of the vehicle of each row, `MISSING` for an empty cell.
    """

    names: NDArray[np.object_]
    vehicles: tuple[I64, ...]


def identify_vehicles(columns: Sequence[TextColumn]) -> VehicleIds:
    """Collect the vehicles of a recording from the columns of ids of its tables.

    Ids are numbers if all of them are whole numbers without leading zeros or underscores. They may
    end in ".0", as pandas writes numbers of a column with missing cells. Otherwise ids are texts:
    "07" and "7" are two vehicles. Blanks around ids are ignored, unless two ids differ only in
    blanks.

    Args:
        columns: The column of ids of each table.
    """
    texts = {text for column in columns for text in column.texts.tolist()}
    texts = {text for text in texts if text.strip() not in MISSING_WORDS}
    name_of_text = {text: text.strip() for text in texts}
    if len({*name_of_text.values()}) < len(texts):
        name_of_text = {text: text for text in texts}
    numbers = {text: _WHOLE_NUMBER.fullmatch(name) for text, name in name_of_text.items()}
    names: list[str]
    if all(numbers.values()):
        name_of_text = {text: match[1] for text, match in numbers.items() if match is not None}
        names = sorted({*name_of_text.values()}, key=int)
    else:
        names = sorted({*name_of_text.values()})
    index_of_name = {name: index for index, name in enumerate(names)}
    vehicles: list[I64] = []
    for column in columns:
        index_of_text = [
            index_of_name[name_of_text[text]] if text in name_of_text else MISSING
            for text in column.texts.tolist()
        ]
        # `MISSING` is -1 and selects the last element.
        vehicles.append(np.array([*index_of_text, MISSING], np.int64)[column.code])
    return VehicleIds(np.array(names, np.object_), tuple(vehicles))


def compare_names(column: str, names: Iterable[str], num_rows: int) -> list[Finding]:
    """Report names that may be one number in several spellings, such as "7", "07" and "7.0".

    Args:
        column: The column of ids.
        names: Name of each vehicle.
        num_rows: Number of rows of the recording.
    """
    spellings: dict[str, list[str]] = {}
    for name in names:
        digits = re.sub(r"[\s_]|\.0*$", "", name)
        if digits.isascii() and digits.isdigit():
            spellings.setdefault(digits.lstrip("0"), []).append(name)
    similar = [spelling for spelling in spellings.values() if len(spelling) > 1]
    if not similar:
        return []
    examples = " and ".join(f'"{shown(name)}"' for name in similar[0][:2])
    detail = (
        f"column {column}: ids are compared as texts, so {examples} are different vehicles; "
        f"{len(similar)} such cases"
    )
    return [
        Finding(
            check=Check.IDENTITY, consequence=Consequence.CORRECTED, detail=detail, rows=num_rows
        )
    ]
