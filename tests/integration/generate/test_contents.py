"""A data set holds what was simulated, and says what it is."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import duckdb
import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.support.small import HORIZON, NUM_SIMULATIONS, generate

import overtaking as ot
from overtaking.api import simulator_registry
from overtaking.core.errors import ConfigError
from overtaking.data.tables.columns import names_of
from overtaking.data.tables.schemas import SCHEMAS

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.model.trajectories import Trajectories

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def runs() -> Trajectories:
    """The same simulations without any file."""
    scenarios = ot.sample(
        "pinto2023-physical", num_simulations=NUM_SIMULATIONS, seed=1, overrides=HORIZON
    )
    return ot.simulate(scenarios)


def assert_same(one, other, filled: np.ndarray) -> None:
    """Same structure, types and values of two batches; empty slots may look like anything."""
    for field in dataclasses.fields(one):
        ours, theirs = getattr(one, field.name), getattr(other, field.name)
        if isinstance(ours, np.ndarray):
            assert ours.dtype == theirs.dtype, field.name
            assert ours.shape == theirs.shape, field.name
            part = filled if ours.shape[:2] == filled.shape else ...
            assert np.array_equal(ours[part], theirs[part]), field.name
        elif dataclasses.is_dataclass(ours) and field.name != "road":
            assert_same(ours, theirs, filled)
        else:
            assert ours == theirs, field.name


def only(runs: Trajectories, simulation: int) -> Trajectories:
    """One simulation of a batch without the slots, frames and decisions that it did not need."""
    one = runs.select(np.array([simulation]))
    frames, decisions = int(one.num_frames[0]), int(one.percepts.valid.sum())
    filled = (slice(None), slice(int(one.scenario.num_vehicles[0])))

    def cut(batch, *place):
        return batch.replace(
            **{f.name: getattr(batch, f.name)[place] for f in dataclasses.fields(batch)}
        )

    world = one.scenario
    scenario = world.replace(
        vehicles=cut(world.vehicles, *filled),
        drivers=cut(world.drivers, *filled),
        start_s=world.start_s[filled],
        start_lane=world.start_lane[filled],
        start_speed=world.start_speed[filled],
    )
    return one.replace(
        scenario=scenario,
        contacts=cut(one.contacts, *filled),
        states=cut(one.states, *filled, slice(frames)),
        stage=one.stage[:, :frames],
        collided_with=one.collided_with[:, :frames],
        percepts=cut(one.percepts, slice(None), slice(decisions)),
    )


@pytest.mark.parametrize("simulation", range(NUM_SIMULATIONS))
def test_what_was_simulated_comes_back_from_the_files_bit_for_bit(simulation, data, runs):
    expected = only(runs, simulation)
    assert_same(data.trajectory(simulation), expected, expected.scenario.vehicles.valid)


@pytest.mark.parametrize("simulation", [0, 9, NUM_SIMULATIONS - 1])
def test_what_was_not_kept_is_simulated_again(simulation, data, summary):
    assert not (summary.path / "states").exists()
    assert summary.states(simulation).equals(data.states(simulation))
    assert summary.frames(simulation).equals(data.frames(simulation))
    again = summary.trajectory(simulation)
    assert np.array_equal(again.trace_hash, data.trajectory(simulation).trace_hash)


def test_a_data_set_is_a_sequence_of_simulations_whatever_it_kept(data, summary, runs):
    for source in (data, summary):
        hashes = [source[np.int64(number)].trace_hash[0] for number in range(len(source))]
        assert np.array_equal(hashes, runs.trace_hash)
        assert np.array_equal(source[-1].trace_hash[0], runs.trace_hash[-1])
        assert sum(1 for _ in source) == len(source)
        for number in (len(source), -len(source) - 1):
            with pytest.raises(IndexError, match="expected 0 to 19"):
                source[number]
        with pytest.raises(ConfigError, match="expected a whole number, got '4'"):
            source["4"]


def test_batches_give_every_simulation_once(data, summary, runs):
    for source in (data, summary):
        numbers, hashes = zip(*((n, t.trace_hash) for n, t in source.batches()), strict=True)
        assert np.concatenate(numbers).tolist() == list(range(NUM_SIMULATIONS))
        assert np.array_equal(np.concatenate(hashes), runs.trace_hash)


def test_a_summary_says_the_same_as_the_whole(data, summary):
    for table in ("simulations", "weather", "vehicles", "percepts"):
        assert summary.table(table).equals(data.table(table))


def test_the_same_recipe_gives_the_same_bytes_elsewhere(data, tmp_path: Path):
    other = generate(tmp_path / "elsewhere")
    assert other.content_hash == data.content_hash
    assert other.manifest.shards == data.manifest.shards


def test_a_simulation_is_the_same_in_a_data_set_of_any_size(data, tmp_path: Path):
    small = generate(tmp_path / "small", 3)
    assert small.states(2).equals(data.states(2))


@pytest.mark.parametrize("simulator", simulator_registry.MODEL_SIMULATORS)
def test_a_branch_without_a_change_is_the_simulation_itself(simulator: str, runs):
    again = ot.branch(runs.scenario, 7, simulator=simulator)
    assert np.array_equal(again.trace_hash, runs.trace_hash)


def test_a_branch_is_the_same_up_to_its_frame_and_another_after_it(runs):
    chosen = runs.select(np.flatnonzero(runs.num_frames > 15))
    still = chosen.scenario.weather
    storm = still.replace(wind=np.full_like(still.wind, 100.0))
    other = ot.branch(chosen.scenario, 7, weather=storm)
    valid = chosen.scenario.vehicles.valid
    before, after = (
        np.abs(other.states.x[:, :, part] - chosen.states.x[:, :, part])[valid]
        for part in (slice(8), slice(15, 16))
    )
    assert (before == 0).all()
    assert (after > 0).any()


def test_the_reference_writes_the_same_data_set(data, tmp_path: Path):
    readable = generate(tmp_path / "readable", simulator="reference")
    assert readable.content_hash == data.content_hash
    assert readable.manifest.identity.differences(data.manifest.identity) == ["simulator"]


def test_another_seed_is_another_data_set(data, tmp_path: Path):
    assert generate(tmp_path / "other", seed=2).content_hash != data.content_hash


def test_tables_come_as_pandas_in_si(data):
    simulations, vehicles = data.simulations(), data.vehicles()
    assert (
        simulations["simulation"].tolist() == list(range(NUM_SIMULATIONS)) == list(range(len(data)))
    )
    assert simulations["num_vehicles"].tolist() == vehicles.groupby("simulation").size().tolist()
    assert (vehicles.loc[vehicles["vehicle"] == 0, "role"] == "ego").all()
    assert set(simulations["weather"]) <= set(data.weather()["weather"])
    assert data.percepts()["leader_gap_m"].dtype == np.float64
    speed = data.states(4)["speed_mps"]
    assert speed.between(10, 60).all()  # 50 to 120 km/h, and not yet braked.


def test_anyone_can_group_tables_of_many_shards_by_any_of_their_names(tmp_path: Path):
    # Arrow refuses to where the parts of a column list other names.
    data = ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=40,
        seed=5,
        out=tmp_path / "data",
        shard_size=4,
        keep="features",
    )
    grouped = 0
    for name in data.kept_tables:
        table = pq.read_table(data.path / name)
        for field in filter(names_of, SCHEMAS[name]):
            column = table[field.name]
            assert {tuple(chunk.dictionary.to_pylist()) for chunk in column.chunks} == {
                names_of(field)
            }
            counts = table.group_by(field.name).aggregate([([], "count_all")])
            assert sum(counts["count_all"].to_pylist()) == table.num_rows
            assert counts.num_rows == len(set(column.to_pylist()))
            grouped += 1
    assert grouped >= 10


def test_frames_are_the_22_variables_of_the_paper(data, runs):
    frames = data.frames(4)
    assert len(frames.columns) == 22
    assert len(frames) == runs.num_frames[4]
    assert frames["time_s"].tolist() == [n / 20 for n in range(len(frames))]
    last = frames.iloc[-1]
    count = int(runs.scenario.num_vehicles[4])
    for name in ("dimensions_m", "positions_m", "speeds_mps", "directions_rad"):
        assert len(last[name]) == count
    at = (4, count - 1, len(frames) - 1)
    x, y, lane_id = last["positions_m"][-1]
    assert (x, y) == (runs.states.x[at] / 1000, runs.states.y[at] / 1000)
    assert lane_id == runs.road.lanes[runs.states.lane[at]].lane_id
    states = data.states(4)
    end = states[(states["vehicle"] == count - 1) & (states["frame"] == at[2])]
    norm = np.hypot(end["accel_lon_mps2"], end["accel_lat_mps2"]).item()
    assert last["accelerations_mps2"][-1] == norm


def test_the_folders_can_be_queried_by_anyone(data, runs):
    query = f"""
        select count(*), sum(x_mm::bigint)
        from '{data.path}/states/*.parquet' join '{data.path}/simulations/*.parquet'
        using (simulation) where profile = 'pinto2023-physical'
    """
    valid = runs.scenario.vehicles.valid[:, :, None] & runs.frame_mask[:, None, :]
    expected = (valid.sum(), runs.states.x[valid].astype(np.int64).sum())
    assert duckdb.connect().execute(query).fetchone() == expected


def test_the_manifest_says_how_to_make_it_again(data, tmp_path: Path):
    manifest = json.loads((data.path / "dataset.json").read_text())
    assert manifest["complete"]
    identity = manifest["identity"]
    assert (identity["profile"], identity["seed"]) == ("pinto2023-physical", 1)
    assert identity["spec"]["time"]["horizon_s"] == 1.0
    again = ot.generate_dataset(
        identity["spec"],
        num_simulations=identity["simulations"],
        seed=identity["seed"],
        out=tmp_path / "again",
        simulator=identity["simulator"],
        shard_size=identity["shard_size"],
    )
    assert again.content_hash == manifest["content_hash"]
    assert set(manifest["provenance"]) >= {"started", "finished", "package", "machine"}


def test_the_data_card_says_how_to_make_and_read_it_and_is_right(copy: Path):
    card = (copy / "README.md").read_text()
    code = [line[4:] for line in card.splitlines() if line.startswith("    ")]
    (query,) = (line.partition("   --")[0] for line in code if line.startswith("select"))
    python = "\n".join(line for line in code if not line.startswith("select"))
    # The card takes whole shards of the default size for granted, so their values are compared.
    check = (
        "again = overtaking.load_dataset('again'); assert again.states(17).equals(data.states(17))"
    )
    script = f"{python}\n{check}\nimport duckdb; assert duckdb.sql({query!r}).fetchall()"
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_data_card_explains_every_column(data, summary):
    for made in (data, summary):
        card = (made.path / "README.md").read_text()
        for name in made.manifest.identity.keep.tables:
            assert f"## {name}: {made.table(name).num_rows} rows" in card
            chapter = card.partition(f"## {name}:")[2].partition("## ")[0]
            assert re.findall(r"^\| `(\w+)`", chapter, re.MULTILINE) == SCHEMAS[name].names
    assert "## states" not in card


def test_progress_counts_every_simulation(tmp_path: Path):
    heard: list[tuple[int, int]] = []
    generate(tmp_path / "data", progress=lambda done, total: heard.append((done, total)))
    assert heard == [(done, NUM_SIMULATIONS) for done in (0, 8, 16, 20)]
