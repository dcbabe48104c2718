"""How often the examination finds injected faults, and that it finds none in clean recordings.

A fault that another reader can have is one more function in `FAULTS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.recordings import pinto2023
from overtaking.recordings.column_map import column_map
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.commonroad_write import scenario_id, write_commonroad
from overtaking.recordings.findings import Check
from overtaking.recordings.gaps import MAX_GAP_S
from overtaking.recordings.highd import read_highd
from overtaking.recordings.highd_write import write_highd
from overtaking.recordings.motion_check import (
    MAX_ACCELERATION,
    MAX_DEVIATION_ACROSS,
    MAX_DEVIATION_ALONG,
)
from overtaking.recordings.pinto2023_import import read_pinto2023
from overtaking.recordings.tables import read_table, recording_of
from overtaking.recordings.track_table import track_rows_from_table

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.random import Generator

    from overtaking.model.trajectories import Trajectories

PROFILES = ("pinto2023-physical", "motorway", "rural")
SEED = 20
NUM_TOGETHER = 5  # Simulations of a table.
PAUSE_S = 500.0  # From the start of one to that of the next, more than the longest takes [s].
MIN_RATE = 0.99
COLUMNS = column_map(
    {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [m]",
        "y": "y [m]",
        "length": "length [m]",
        "width": "width [m]",
    }
)


@cache
def simulations(profile: str, count: int, seed: int = SEED) -> Trajectories:
    """Simulations, some of which end with a collision or beside the road."""
    return ot.simulate(ot.sample(profile, num_simulations=count, seed=seed))


def table_of(run: Trajectories, simulations: range) -> pd.DataFrame:
    """A table of the vehicles of some simulations, one after the other.

    A single one has too few vehicles to tell the course of the road.
    """
    parts = [_table_of_one(run, number % len(run.num_frames)) for number in simulations]
    shifted = [
        part.assign(id=part.id + 100 * number, t=part.t + PAUSE_S * number)
        for number, part in enumerate(parts)
    ]
    return pd.concat(shifted, ignore_index=True)


def _table_of_one(run: Trajectories, simulation: int) -> pd.DataFrame:
    bodies, states = run.scenario.vehicles, run.states
    slot, frame = np.nonzero(run.state_mask[simulation])
    return pd.DataFrame(
        {
            "id": slot + 1,
            "t": np.asarray(run.time_ms)[frame] * 1e-3,
            "x": states.x[simulation, slot, frame] * 1e-3,
            "y": states.y[simulation, slot, frame] * 1e-3,
            "length": bodies.length[simulation, slot].astype(np.float64),
            "width": bodies.width[simulation, slot].astype(np.float64),
        }
    )


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A table with a fault.

    Attributes:
        table: The table.
        check: The check that finds the fault.
        vehicles: Names of the vehicles that may be named.
        first_time: Time of the first row that it concerns [s].
    """

    table: pd.DataFrame
    check: Check
    vehicles: frozenset[str]
    first_time: float


def _rows_of_a_vehicle(table: pd.DataFrame, random: Generator) -> pd.DataFrame:
    """The rows of a random vehicle with at least 5 s of them."""
    count = table.groupby("id").t.transform("size")
    vehicle = random.choice(table.id[count >= 50].unique())
    return table[table.id == vehicle]


def _row_away(table: pd.DataFrame, random: Generator, *, is_along: bool) -> Fault:
    rows = _rows_of_a_vehicle(table, random)
    place = int(random.integers(1, len(rows) - 1))
    interval = float(rows.t.iloc[1] - rows.t.iloc[0])
    limit = MAX_DEVIATION_ALONG if is_along else MAX_DEVIATION_ACROSS
    limit += 0.5 * MAX_ACCELERATION * interval**2
    size = random.uniform(2.0, 10.0) * limit * random.choice([-1.0, 1.0])
    low, high = max(place - 10, 0), min(place + 10, len(rows) - 1)
    way = rows[["x", "y"]].iloc[high] - rows[["x", "y"]].iloc[low]
    heading = np.arctan2(way.y, way.x) + (0.0 if is_along else 0.5 * np.pi)
    changed = table.copy()
    changed.loc[rows.index[place], "x"] += size * np.cos(heading)
    changed.loc[rows.index[place], "y"] += size * np.sin(heading)
    return Fault(
        table=changed,
        check=Check.MOTION,
        vehicles=frozenset({str(rows.id.iloc[0])}),
        first_time=float(rows.t.iloc[place]),
    )


def row_away_along(table: pd.DataFrame, random: Generator) -> Fault:
    return _row_away(table, random, is_along=True)


def row_away_across(table: pd.DataFrame, random: Generator) -> Fault:
    return _row_away(table, random, is_along=False)


def _rows_left_out(table: pd.DataFrame, random: Generator, num_missing: int) -> Fault:
    rows = _rows_of_a_vehicle(table, random)
    place = int(random.integers(1, max(2, len(rows) - num_missing - 1)))
    missing = rows.index[place : min(place + num_missing, len(rows) - 1)]
    return Fault(
        table=table.drop(missing),
        check=Check.GAPS,
        vehicles=frozenset({str(rows.id.iloc[0])}),
        first_time=float(rows.t.iloc[place]),
    )


def short_gap(table: pd.DataFrame, random: Generator) -> Fault:
    return _rows_left_out(table, random, int(random.integers(1, 5)))


def long_gap(table: pd.DataFrame, random: Generator) -> Fault:
    interval = float(np.diff(np.unique(table.t))[0])
    return _rows_left_out(table, random, round(random.uniform(2.0, 10.0) * MAX_GAP_S / interval))


def second_id(table: pd.DataFrame, random: Generator) -> Fault:
    rows = _rows_of_a_vehicle(table, random)
    begin = int(random.integers(0, len(rows) // 2))
    end = int(random.integers(begin + 20, len(rows) + 1))
    ghost = rows.iloc[begin:end].assign(id=9999)
    ghost["x"] += random.uniform(-0.3, 0.3) * ghost.width
    ghost["y"] += random.uniform(-0.3, 0.3) * ghost.width
    return Fault(
        table=pd.concat([table, ghost], ignore_index=True),
        check=Check.DUPLICATE_VEHICLES,
        vehicles=frozenset({"9999"}),
        first_time=float(ghost.t.iloc[0]),
    )


def exchanged_sizes(table: pd.DataFrame, random: Generator) -> Fault:
    rows = _rows_of_a_vehicle(table, random)
    changed = table.copy()
    changed.loc[rows.index, ["length", "width"]] = rows[["width", "length"]].to_numpy()
    return Fault(
        table=changed,
        check=Check.SIZES,
        vehicles=frozenset({str(rows.id.iloc[0])}),
        first_time=float(rows.t.iloc[0]),
    )


def slower_vehicle(table: pd.DataFrame, random: Generator) -> Fault:
    rows = _rows_of_a_vehicle(table, random)
    step = int(random.integers(2, 6))
    dropped = rows.index[np.arange(len(rows)) % step != 0]
    return Fault(
        table=table.drop(dropped),
        check=Check.FRAME_RATE,
        vehicles=frozenset({str(rows.id.iloc[0])}),
        first_time=float(rows.t.iloc[1]),
    )


FAULTS: tuple[Callable[[pd.DataFrame, Generator], Fault], ...] = (
    row_away_along,
    row_away_across,
    short_gap,
    long_gap,
    second_id,
    exchanged_sizes,
    slower_vehicle,
)


def is_found(fault: Fault, run: Trajectories) -> bool:
    """Whether the examination names check, vehicle and time of a fault."""
    rows = track_rows_from_table(fault.table, COLUMNS)
    recording = recording_of(rows, COLUMNS, "test", road=run.road)
    interval = recording.frame_interval_ms * 1e-3
    return any(
        finding.check is fault.check
        and finding.vehicle in fault.vehicles
        and finding.first_time_s is not None
        and abs(finding.first_time_s - fault.first_time) <= interval + 1e-6
        for finding in recording.findings
    )


def missed_faults(inject: Callable[[pd.DataFrame, Generator], Fault], count: int) -> list[int]:
    """Numbers of the faults that the examination does not find."""
    random = np.random.default_rng(SEED)
    missed: list[int] = []
    for number in range(count):
        run = simulations(PROFILES[number % len(PROFILES)], 20)
        first = int(random.integers(20))
        fault = inject(table_of(run, range(first, first + NUM_TOGETHER)), random)
        if not is_found(fault, run):
            missed.append(number)
    return missed


@pytest.mark.ci
@pytest.mark.parametrize("inject", FAULTS)
def test_injected_faults_are_found(inject):
    assert missed_faults(inject, 6) == []


@pytest.mark.soak
@pytest.mark.parametrize("inject", FAULTS)
def test_99_of_100_injected_faults_are_found(inject):
    assert len(missed_faults(inject, 200)) <= (1.0 - MIN_RATE) * 200


def false_findings(profile: str, count: int, folder: Path) -> list[str]:
    """Findings of the examination in clean simulations, written in five formats."""
    run = simulations(profile, count, SEED + 1)
    found: list[str] = []
    for simulation in range(count):
        part = run.select(slice(simulation, simulation + 1))
        numbers = np.array([simulation])
        write_commonroad(part, numbers, folder)
        recordings = [read_commonroad(folder / f"{scenario_id(simulation)}.xml")]
        if profile != "rural":  # highD has motorways only.
            write_highd(part, numbers, folder)
            recordings.append(read_highd(max(folder.glob("*_tracks.csv"))))
        table = table_of(run, range(simulation, simulation + NUM_TOGETHER))
        table.to_csv(folder / "table.csv", index=False)
        table.to_parquet(folder / "table.parquet", index=False)
        recordings += [
            read_table(folder / f"table.{suffix}", COLUMNS, road=run.road)
            for suffix in ("csv", "parquet")
        ]
        found += [
            f"{recording.name}, simulation {simulation}: {finding}"
            for recording in recordings
            for finding in recording.findings
        ]
    if profile == "rural":  # The paper's table has no oncoming lane.
        return found
    pinto2023.write_table([pinto2023.to_table(run)], folder / "paper.parquet")
    paper = read_pinto2023(folder / "paper.parquet", road=run.road)
    return found + [f"pinto2023: {finding}" for finding in paper.recording.findings]


@pytest.mark.ci
@pytest.mark.parametrize("profile", PROFILES)
def test_clean_recordings_have_no_findings(profile, tmp_path):
    assert false_findings(profile, 2, tmp_path) == []


@pytest.mark.soak
@pytest.mark.parametrize("profile", PROFILES)
def test_2000_clean_recordings_have_no_findings(profile, tmp_path):
    # Five formats of two profiles and three of rural: 2,080 recordings.
    assert false_findings(profile, 160, tmp_path) == []
