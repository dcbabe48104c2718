"""A balanced data set has equal numbers of each class, and gives back the natural shares."""

from __future__ import annotations

import dataclasses
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import overtaking as ot
from overtaking.api import simulator_registry
from overtaking.cli import making
from overtaking.cli.options import Balancing
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data import balance_scan
from overtaking.data import generate as writing
from overtaking.data.balance import MAX_CANDIDATES, ClassBalance
from overtaking.data.balance_scan import FILE_NAME, Selection
from overtaking.data.card import README_NAME as CARD
from overtaking.data.location import Folder
from overtaking.data.manifest import FILE_NAME as MANIFEST
from overtaking.data.manifest import BalanceRecord
from overtaking.data.recipe import Keep, Recipe
from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification

NUM_SIMULATIONS = 22
QUOTAS = (5, 5, 4, 4, 4)
SEED = 3
SHARD_SIZE = 8
SETTINGS = {"keep": "features", "shard_size": SHARD_SIZE}
BALANCE = ClassBalance()

GENERATE = f"""
import sys
import overtaking as ot
from overtaking.data.balance import ClassBalance
held, after = sys.argv[2], int(sys.argv[3])
def teller(phase):
    def tell(done, total):
        print(phase, done, flush=True)
        if phase == held and done > after:
            sys.stdin.read()
    return tell
ot.generate_dataset("pinto2023-physical", num_simulations={NUM_SIMULATIONS}, seed={SEED},
             out=sys.argv[1], balance=ClassBalance(), progress=teller("simulations"),
             on_candidates=teller("candidates"), **{SETTINGS!r})
"""


def generate(out: Path, balance: ClassBalance = BALANCE, **changes) -> ot.Dataset:
    settings = {**SETTINGS, **changes}
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=NUM_SIMULATIONS,
        seed=SEED,
        out=out,
        balance=balance,
        **settings,
    )


def record_of(data: ot.Dataset) -> BalanceRecord:
    """What became of its cells."""
    assert data.manifest.balance is not None
    return data.manifest.balance


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return generate(tmp_path_factory.mktemp("balanced") / "data")


@pytest.fixture(scope="module")
def candidates(data, tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    """The candidates of that data set, all of them, as an ordinary one."""
    found = record_of(data)
    out = tmp_path_factory.mktemp("candidates") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=found.candidates, seed=SEED, out=out, keep="features"
    )


@pytest.fixture
def copy(data: ot.Dataset, tmp_path: Path) -> Path:
    """A copy of the data set, to be damaged."""
    return shutil.copytree(data.path, tmp_path / "data")


def assert_same(one: ot.Dataset, other: ot.Dataset) -> None:
    """The same files with the same bytes; only the manifest says when and where."""
    files = {path.relative_to(one.path) for path in one.path.rglob("*")}
    assert files == {path.relative_to(other.path) for path in other.path.rglob("*")}
    for file in files:
        if (one.path / file).is_file() and file != Path(MANIFEST):
            assert (one.path / file).read_bytes() == (other.path / file).read_bytes(), file
    known, again = (each.manifest.model_dump(exclude={"provenance"}) for each in (one, other))
    assert known == again


def test_every_class_has_its_quota(data):
    counts = data.features()["CLASS"].value_counts()
    assert tuple(counts[name] for name in BALANCE.cells) == QUOTAS
    assert len(data) == NUM_SIMULATIONS
    assert data.simulations()["simulation"].tolist() == list(range(NUM_SIMULATIONS))


def test_it_holds_the_first_candidates_of_each_class(data, candidates):
    natural = candidates.features()["CLASS"]
    first = [
        natural.index[natural == name][:n] for name, n in zip(BALANCE.cells, QUOTAS, strict=True)
    ]
    expected = sorted(np.concatenate(first).tolist())
    assert data.simulations()["scenario_index"].tolist() == expected
    hashes = candidates.simulations()["trace_hash"]
    assert data.simulations()["trace_hash"].tolist() == hashes[expected].tolist()


def test_weighted_class_shares_are_those_of_the_candidates(data, candidates):
    natural = candidates.features()["CLASS"].value_counts(normalize=True)
    features = data.features()
    weighted = features.groupby("CLASS")["weight"].sum() / features["weight"].sum()
    assert features["weight"].mean() == pytest.approx(1.0, rel=1e-14)
    assert features["weight"].nunique() > 1
    for name in BALANCE.cells:
        assert weighted[name] == pytest.approx(natural[name], rel=1e-14), name
    assert (data.simulations()["weight"] == 1.0).all(), "that of the sampling stays what it is"


def test_statistics_count_by_the_weights(data, candidates):
    natural = candidates.features()["CLASS"].value_counts(normalize=True)
    for row in ot.dataset_statistics(data, weighted=True).classes.records():
        assert row["count"] in QUOTAS
        assert row["share"] == pytest.approx(natural[row["class"]])


def test_the_manifest_and_the_card_say_what_became_of_each_class(data, candidates):
    natural = candidates.features()["CLASS"].value_counts()
    found = record_of(data)
    for name, quota in zip(BALANCE.cells, QUOTAS, strict=True):
        cell = found.cells[name]
        assert (cell.quota, cell.kept, cell.seen) == (quota, quota, natural[name])
        row = f"| {name} | {quota} | {natural[name]} | {quota} | {cell.weight:.6g} |"
        assert row in (data.path / CARD).read_text()
    assert (found.missing, found.outside) == (0, 0)


@pytest.mark.ci
def test_day_and_night_are_cells_of_their_own(tmp_path):
    both = generate(tmp_path / "data", ClassBalance(by=("class", "day-night")))
    counts = both.features()[["CLASS", "DN"]].value_counts()
    assert len(counts) == 10
    assert set(counts) == {2, 3}


def test_candidates_without_a_quota_are_counted_and_not_kept(tmp_path):
    strict = generate(tmp_path / "data", ClassBalance(policy="default"))
    assert set(strict.features("default")["CLASS"]) == set(BALANCE.cells)
    assert record_of(strict).outside > 0


@pytest.mark.ci
@pytest.mark.parametrize(("chunk_size", "threads"), [(7, 1), (64, 3), (512, 2)])
def test_batches_and_threads_change_nothing(chunk_size, threads, data, tmp_path):
    engine = dataclasses.replace(
        simulator_registry.get_simulator("engine"), chunk_size=chunk_size, threads=threads
    )
    profile = load_specification("pinto2023-physical")
    recipe = Recipe(
        spec=profile,
        road=known_road(profile.road),
        seed=SEED,
        num_simulations=NUM_SIMULATIONS,
        keep=Keep.FEATURES,
        shard_size=SHARD_SIZE,
        balance=BALANCE,
    )
    other = writing.generate(recipe, Folder(tmp_path / "data"), engine)
    assert other.content_hash == data.content_hash
    assert (other.path / FILE_NAME).read_bytes() == (data.path / FILE_NAME).read_bytes()
    assert other.manifest.balance == data.manifest.balance


@pytest.mark.ci
@pytest.mark.parametrize(
    ("by", "phase", "after", "remembered"),
    [
        (signal.SIGKILL, "candidates", 22, 22),
        (signal.SIGTERM, "candidates", 44, 44),
        (signal.SIGKILL, "simulations", 8, None),
    ],
)
def test_what_was_ended_is_resumed_to_the_same_bytes(by, phase, after, remembered, data, tmp_path):
    out = tmp_path / "data"
    process = subprocess.Popen(
        [sys.executable, "-c", GENERATE, str(out), phase, str(after)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for line in process.stdout:
        name, done = line.split()
        if name == phase and int(done) > after:
            break
    process.send_signal(by)
    _, said = process.communicate(timeout=60)
    assert process.returncode != 0
    if by == signal.SIGTERM:
        assert "--resume" in said.splitlines()[-1]
    looked: list[int] = []
    assert_same(ot.resume_dataset(out, on_candidates=lambda n, _: looked.append(n)), data)
    assert looked[0] == (remembered or record_of(data).candidates)


def test_a_repaired_data_set_needs_no_second_search(data, copy):
    (copy / "labels" / "part-00001.parquet").unlink()
    looked: list[int] = []
    repaired = ot.resume_dataset(copy, on_candidates=lambda done, _: looked.append(done))
    assert looked == [record_of(data).candidates]
    assert_same(repaired, data)


@pytest.mark.parametrize(
    "text", ["", "{", '{"key": 1}', lambda known: known.replace('"index":[0', '"index":[1')]
)
def test_a_damaged_plan_is_made_again(text, data, copy):
    file = copy / FILE_NAME
    file.write_text(text if isinstance(text, str) else text(file.read_text()))
    assert file.read_bytes() != (data.path / FILE_NAME).read_bytes()
    assert_same(ot.resume_dataset(copy), data)


def test_a_plan_longer_than_its_simulations_can_be_is_not_read(data, copy):
    file = copy / FILE_NAME
    file.write_text(file.read_text() + " " * 2_000)
    (copy / "labels" / "part-00001.parquet").unlink()
    looked: list[int] = []
    assert_same(ot.resume_dataset(copy, on_candidates=lambda done, _: looked.append(done)), data)
    assert looked[0] == 0


def test_the_longest_plan_is_read(tmp_path):
    wanted, high = np.full(10, 1_000), MAX_CANDIDATES - 1
    text = balance_scan._Remembered(
        key="f" * 64,
        candidates=high,
        seen=[high] * 10,
        index=[high - k for k in range(10_000)],
        cell=[9] * 10_000,
    )
    path = tmp_path / FILE_NAME
    path.write_text(text.sealed().model_dump_json() + "\n")
    selection = Selection(wanted)
    balance_scan._read(Folder(tmp_path), "f" * 64, high, selection)
    assert selection.candidates == high


def test_labelling_anew_keeps_the_weights(data, copy):
    assert ot.relabel_dataset(copy).content_hash == data.content_hash


def test_a_class_that_is_too_rare_is_named_and_nothing_is_written(tmp_path):
    with pytest.raises(DatasetError, match="cell Success_L: expected 4 simulations of it") as error:
        generate(tmp_path / "data", ClassBalance(policy="strict", candidates=300))
    assert "among 300 candidates, got " in str(error.value)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.rglob("*.parquet"))
    with pytest.raises(DatasetError, match="one that is not finished"):
        ot.load_dataset(tmp_path / "data")


def test_looking_further_goes_on_where_it_stopped(data, tmp_path):
    out = tmp_path / "data"
    with pytest.raises(DatasetError, match="among 20 candidates"):
        generate(out, ClassBalance(candidates=20))
    looked: list[int] = []
    usual = ClassBalance(candidates=data.manifest.identity.balance.candidates)
    complete = generate(out, usual, resume=True, on_candidates=lambda n, _: looked.append(n))
    assert looked[0] == 20
    assert_same(complete, data)


def test_a_smaller_number_of_candidates_is_another_data_set(tmp_path):
    with pytest.raises(DatasetError, match="among 20 candidates"):
        generate(tmp_path / "data", ClassBalance(candidates=20))
    with pytest.raises(DatasetError, match=r"balance of the data set: expected .* 10 candidates"):
        generate(tmp_path / "data", ClassBalance(candidates=10), resume=True)


def test_fewer_simulations_are_written_if_that_is_allowed(tmp_path):
    short = generate(tmp_path / "data", ClassBalance(candidates=20, allows_missing=True))
    found = record_of(short)
    assert len(short) == NUM_SIMULATIONS - found.missing == len(short.features())
    assert 0 < found.missing < NUM_SIMULATIONS
    assert f"{found.missing}\nsimulations are missing" in (short.path / CARD).read_text()
    assert short.features()["weight"].mean() == pytest.approx(1.0)
    again = short.manifest.identity
    repeated = generate(tmp_path / "again", again.balance)
    assert_same(repeated, short)


@pytest.mark.ci
def test_the_command_line_tells_what_is_missing(workdir):
    words = ["generate", "-n", "10", "--balance", "--balance-candidates", "10", "--json"]
    command = [sys.executable, "-m", "overtaking", *words, "--out", "few"]
    failed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert failed.returncode == 2
    assert failed.stderr.count("\n") == 1
    assert "--allow-missing" in failed.stderr
    done = subprocess.run(
        [*command, "--resume", "--allow-missing"], capture_output=True, text=True, check=True
    )
    balance = json.loads(done.stdout)["balance"]
    assert balance["wanted"] == 10
    assert balance["missing"] == 10 - json.loads(done.stdout)["simulations"] > 0


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ({"by": "class"}, "--balance-by"),
        ({"policy": "strict"}, "--policy"),
        ({"candidates": 20}, "--balance-candidates"),
        ({"allows_missing": True}, "--allow-missing"),
    ],
)
def test_words_about_the_balance_need_the_balance(words, named):
    with pytest.raises(ConfigError, match=f"{named}: expected --balance beside it"):
        making.balance(Balancing(**words))
    assert making.balance(Balancing()) is None


def test_words_become_a_balance():
    words = {"by": "class, day-night", "policy": "strict", "candidates": 20, "allows_missing": True}
    assert making.balance(Balancing(balance=True, **words)) == ClassBalance(
        by=("class", "day-night"), policy="strict", candidates=20, allows_missing=True
    )
    assert making.balance(Balancing(balance=True)) == ClassBalance()
