"""Faults that only a table can show are found wherever they are, with vehicle and time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from tests.support.recordings import OVERTAKE, states

from overtaking.recordings.column_map import column_map
from overtaking.recordings.findings import Check
from overtaking.recordings.track_table import track_rows_from_table

if TYPE_CHECKING:
    from collections.abc import Callable

MAP: dict[str, Any] = {
    "columns": {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [mm]",
        "y": "y [m]",
        "length": "length [m]",
        "width": "width [m]",
        "speed": "v [m/s]",
        "type": "kind",
    },
    "types": {"car": ["car"], "truck": ["truck"]},
}


class Fault(NamedTuple):
    """A fault in a table.

    Attributes:
        table: The table with the fault.
        check: The check that finds it.
        column: The column that the finding names.
        vehicle: Name of the vehicle; None for the whole file.
        first_time: Time of its first row [s]; None for the whole file.
    """

    table: pd.DataFrame
    check: Check
    column: str
    vehicle: str | None = None
    first_time: float | None = None


def healthy_table() -> pd.DataFrame:
    movers = [replace(mover, s=mover.s + 100.0) for mover in OVERTAKE]
    table = pd.DataFrame(states(movers))[["id", "t", "x", "y", "length", "width", "kind"]]
    table.loc[table.id == 9, "kind"] = "truck"
    return table.assign(x=(table.x * 1000.0).round(1), v=25.0).sort_values(["t", "id"])


def some_rows(rng: np.random.Generator, table: pd.DataFrame, most: int) -> pd.Index[int]:
    """Up to a number of adjacent rows of one vehicle."""
    rows = table.index[table.id == rng.choice(table.id.unique())]
    count = int(rng.integers(1, most + 1))
    first = int(rng.integers(0, len(rows) - count))
    return rows[first : first + count]


def missing_cells(column: str) -> Callable[[np.random.Generator, pd.DataFrame], Fault]:
    def inject(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
        rows = some_rows(rng, table, 20)
        vehicle, time = str(table.id[rows[0]]), float(table.t[rows[0]])
        cells = table[column].astype(object)
        cells[rows] = None
        changed = table.assign(**{column: cells})
        return Fault(
            changed if column == "kind" else changed.astype({column: float}),
            Check.MISSING_CELLS,
            column,
            None if column == "id" else vehicle,
            None if column == "t" else time,
        )

    return inject


def other_kind(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    rows = some_rows(rng, table, 100)
    vehicle, time = str(table.id[rows[0]]), float(table.t[rows[0]])
    table = table.copy()
    table.loc[rows, "kind"] = "car" if vehicle == "9" else "truck"
    return Fault(table, Check.KINDS, "kind", vehicle, time)


def wrapped_clock(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    period = float(rng.choice([86_400.0, 3_600.0]))
    before = float(rng.uniform(0.1, table.t.max() - 0.1))
    wrapped = table.assign(t=((table.t + period - before) % period).round(3))
    first = float(wrapped.t[table.t >= before].min())
    wrapped = wrapped.sample(frac=1.0, random_state=int(rng.integers(100)))
    return Fault(wrapped, Check.TIME, "t", None, first)


def row_too_late(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    table = table.sort_values(["id", "t"])
    rows = np.flatnonzero(table.id == rng.choice(table.id.unique()))
    place = int(rng.choice(rows[:-20]))
    order = np.arange(len(table))
    later = place + int(rng.integers(1, 15))
    order = np.concatenate(
        [order[:place], order[place + 1 : later + 1], [place], order[later + 1 :]]
    )
    vehicle, time = str(table.id.iloc[place]), float(table.t.iloc[place])
    return Fault(table.iloc[order], Check.TIME, "t", vehicle, time)


def similar_ids(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    number = str(rng.integers(1, 10**6))
    other = str(rng.choice([f"0{number}", f"{number[0]}_{number[1:]}", f" {number}", f"{number} "]))
    first, second = rng.permutation(table.id.unique())[:2]
    ids = table.id.map(str).where(table.id != first, number).where(table.id != second, other)
    return Fault(table.assign(id=ids), Check.IDENTITY, "id")


def thousands(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    x = (table.x + rng.uniform(0.0, 1e4)).round().astype(int) % 999_999
    return Fault(
        table.assign(x=x.map(lambda value: f"{value:,}".replace(",", "."))),
        Check.NUMBER_FORMAT,
        "x",
    )


def repeated_rows(rng: np.random.Generator, table: pd.DataFrame) -> Fault:
    rows = some_rows(rng, table, 20)
    changed = pd.concat([table, table.loc[rows]]).sample(frac=1.0, random_state=1)
    vehicle, time = str(table.id[rows[0]]), float(table.t[rows[0]])
    return Fault(changed, Check.DUPLICATE_ROWS, "", vehicle, time)


INJECTIONS: dict[str, Callable[[np.random.Generator, pd.DataFrame], Fault]] = {
    **{f"missing {column}": missing_cells(column) for column in ("id", "t", "x", "y", "kind", "v")},
    "other kind": other_kind,
    "wrapped clock": wrapped_clock,
    "row too late": row_too_late,
    "similar ids": similar_ids,
    "thousands": thousands,
    "repeated rows": repeated_rows,
}


@pytest.mark.parametrize("name", INJECTIONS)
def test_a_fault_is_found_wherever_it_is(name):
    table, columns = healthy_table(), column_map(MAP)
    for seed in range(20):
        fault = INJECTIONS[name](np.random.default_rng(seed), table)
        findings = [
            finding
            for finding in track_rows_from_table(fault.table, columns).findings
            if finding.check is fault.check
        ]
        assert findings, seed
        finding = findings[0]
        assert finding.vehicle == fault.vehicle
        assert finding.first_time_s == pytest.approx(fault.first_time, abs=0.1)
        assert not fault.column or f"column {fault.column}" in finding.detail


def test_a_healthy_table_has_no_findings():
    assert not track_rows_from_table(healthy_table(), column_map(MAP)).findings
