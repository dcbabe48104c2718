"""A data set in a store is the one that a folder would have, and is completed like it."""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING

import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data import generate as generating
from overtaking.data.balance import ClassBalance
from overtaking.data.store import Store

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci

NUM_SIMULATIONS = 20
SETTINGS = {
    "overrides": {"time.horizon_s": 0.5, "time.attempt_deadline_s": 0.5},
    "shard_size": 8,
    "keep": "features",
}


def generate(out: str | Path, seed: int = 1, **changes) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=NUM_SIMULATIONS,
        seed=seed,
        out=out,
        **{**SETTINGS, **changes},
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return generate(tmp_path_factory.mktemp("folder") / "data")


@pytest.fixture
def url() -> str:
    return f"memory://{uuid.uuid4()}/data"


def assert_same(stored: ot.Dataset, folder: ot.Dataset) -> None:
    """Every file has the bytes that it has in the folder, and there are no others."""
    stored.verify()
    assert stored.manifest.shards == folder.manifest.shards
    store = Store(stored.where)
    names = {path.relative_to(folder.path).as_posix() for path in folder.path.rglob("*.*")}
    found = {path.removeprefix(store._root + "/") for path in store._files.find(store._root)}
    assert found == names - {".lock"}
    for name in found - {"dataset.json"}:
        with store.open(name) as file:
            assert file.read() == (folder.path / name).read_bytes()


def test_a_store_holds_the_bytes_of_a_folder(url, folder):
    stored = generate(url)
    assert repr(stored) == (
        f"Dataset(where='{url}', profile='pinto2023-physical', simulations=20, keep='features')"
    )
    assert_same(stored, folder)


def test_a_data_set_in_a_store_is_read_like_any_other(url, folder, tmp_path):
    generate(url)
    stored = ot.load_dataset(url)
    assert stored.features().equals(folder.features())
    assert (stored[3].trace_hash == folder[3].trace_hash).all()
    assert stored.states(7).equals(folder.states(7))
    rows = [ot.export_dataset(data, tmp_path / f"{data.name}.csv") for data in (stored, folder)]
    assert rows[0] == rows[1]
    answer = ot.sql(stored, "select count(*) from labels where policy = 'paper'")
    assert answer.rows == [(NUM_SIMULATIONS,)]


@pytest.mark.parametrize("after", [8, 16])
def test_what_a_store_has_is_kept_when_work_goes_on(after, url, folder):
    class Stopped(BaseException):
        pass

    def stop(done: int, total: int) -> None:
        if done == after:
            raise Stopped

    with pytest.raises(Stopped):
        generate(url, progress=stop)
    with pytest.raises(DatasetError, match="expected one that is complete"):
        ot.load_dataset(url)
    told: list[int] = []
    assert_same(ot.resume_dataset(url, progress=lambda done, _: told.append(done)), folder)
    assert told[:2] == [0, 8]  # A shard that is there counts at once.


@pytest.mark.parametrize("name", ["labels/part-00001.parquet", "simulations/part-00000.parquet"])
@pytest.mark.parametrize("damage", [b"", b"PAR1 half of it", None])
def test_damage_in_a_store_is_noticed_and_healed(name, damage, url, folder):
    files = Store(url)._files
    stored = generate(url)
    key = f"{Store(url)._root}/{name}"
    files.rm_file(key) if damage is None else files.pipe_file(key, damage)
    with pytest.raises(DatasetError, match=f"{url}/{name}.*--resume --out {url}"):
        ot.load_dataset(stored.where).verify()
    assert_same(ot.resume_dataset(url), folder)


def test_two_processes_do_not_begin_two_data_sets_in_one_store(url, monkeypatch):
    begun = generating._begun

    def late(*arguments, **options):
        found = begun(*arguments, **options)
        Store(url).put_text("dataset.json", "of another")  # After the look, before the claim.
        return found

    monkeypatch.setattr(generating, "_begun", late)
    with pytest.raises(DatasetError, match="expected no other process that begins one"):
        generate(url)
    with Store(url).open("dataset.json") as file:
        assert file.read() == b"of another"


def test_a_store_with_something_else_is_left_alone(url):
    Store(url).put_text("thesis.txt", "precious")
    with pytest.raises(DatasetError, match=r"got a folder with thesis.txt; choose another"):
        generate(url)
    assert Store(url).names() == {"thesis.txt"}


def test_another_data_set_in_a_store_is_refused(url):
    generate(url)
    with pytest.raises(DatasetError, match="got one that is complete"):
        generate(url)
    with pytest.raises(DatasetError, match="seed of the data set: expected 2, got 1"):
        generate(url, seed=2, resume=True)


def test_a_balanced_data_set_in_a_store_is_the_same(url, tmp_path):
    balance = ClassBalance(candidates=400, allows_missing=True)
    stored, folder = (generate(out, balance=balance) for out in (url, tmp_path / "data"))
    assert stored.manifest.balance == folder.manifest.balance
    assert_same(stored, folder)


def test_what_writes_beside_the_data_asks_for_a_folder(url, tmp_path):
    stored = generate(url)
    for refused in (
        lambda: ot.relabel_dataset(url),
        lambda: ot.write_report(stored),
        lambda: ot.export_dataset(stored, "memory://elsewhere/table.csv"),
    ):
        with pytest.raises(ConfigError, match="expected a folder of this machine to"):
            refused()
