"""How often the examination finds injected faults, and that it finds none in clean recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.simulated_tables import MAP, PROFILES, SEED, simulate_profile, table_of
from tests.support.table_faults import FAULTS, inject_faults

from overtaking.recordings import pinto2023
from overtaking.recordings.column_map import column_map
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.commonroad_write import scenario_id, write_commonroad
from overtaking.recordings.highd import read_highd
from overtaking.recordings.highd_write import write_highd
from overtaking.recordings.pinto2023_import import read_pinto2023
from overtaking.recordings.tables import read_table, recording_of
from overtaking.recordings.track_table import track_rows_from_table

if TYPE_CHECKING:
    from pathlib import Path

NUM_TOGETHER = 5  # Simulations of a clean table.
MIN_RATE = 0.99
COLUMNS = column_map(MAP)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_clean_table_has_no_findings(profile):
    run = simulate_profile(profile, 20)
    rows = track_rows_from_table(table_of(run, range(NUM_TOGETHER)), COLUMNS)
    assert recording_of(rows, COLUMNS, "test", road=run.road).findings == ()


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_in_each_profile(name):
    assert all(map(all, inject_faults(name, len(PROFILES))))


@pytest.mark.ci
@pytest.mark.parametrize("name", FAULTS)
def test_injected_faults_are_found(name):
    assert all(map(all, inject_faults(name, 12)))


@pytest.mark.soak
@pytest.mark.parametrize("name", FAULTS)
def test_99_of_100_injected_faults_are_found(name, record_property):
    results = inject_faults(name, 200)
    counts = np.sum(results, axis=0).tolist()
    record_property("found, vehicle or column right, first time right", counts)
    assert min(counts) >= MIN_RATE * len(results), counts


def false_findings(profile: str, count: int, folder: Path) -> list[str]:
    """Findings of the examination in clean simulations, written in five formats."""
    run = simulate_profile(profile, count, SEED + 1)
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
