"""Every place of a data set keeps the same promises, whatever it is made of."""

from __future__ import annotations

import pickle
import sys
import uuid
from typing import TYPE_CHECKING

import pytest

from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.data.place import Folder, Place, folder_of, place_of
from overtaking.data.store import Store

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(params=["folder", "file", "memory"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Place:
    """An empty place of each kind."""
    where = {
        "folder": str(tmp_path / "data"),
        "file": (tmp_path / "data").as_uri(),
        "memory": f"memory://{uuid.uuid4()}/data",
    }
    made = place_of(where[request.param])
    assert made.names() == set()
    made.prepare(["labels"])
    return made


def put(place: Place, name: str, content: bytes) -> None:
    with place.staging() as staging:
        (staging / "x").write_bytes(content)
        place.put(staging / "x", name)


def read(place: Place, name: str) -> bytes:
    with place.open(name) as file:
        return file.read()


def test_what_was_put_is_found_under_its_name(place):
    assert not place.has("labels/part.parquet")
    put(place, "labels/part.parquet", b"one")
    assert place.has("labels/part.parquet")
    assert "labels" in place.names()
    assert read(place, "labels/part.parquet") == b"one"
    assert place.fetch("labels/part.parquet").read_bytes() == b"one"
    assert place.at("labels/part.parquet") == f"{place}/labels/part.parquet"
    assert place.name == "data"


def test_what_is_put_again_is_never_read_from_an_old_copy(place):
    put(place, "labels/part.parquet", b"one")
    assert place.fetch("labels/part.parquet").read_bytes() == b"one"
    put(place, "labels/part.parquet", b"two")
    assert place.fetch("labels/part.parquet").read_bytes() == b"two"
    place.put_text("dataset.json", "three")
    place.fetch("dataset.json")
    place.put_text("dataset.json", "four")
    assert place.fetch("dataset.json").read_bytes() == b"four"


def test_a_file_that_is_not_finished_is_nowhere_to_be_seen(place):
    class Killed(Exception):
        pass

    seen: list[Path] = []

    def write() -> None:
        with place.staging() as staging:
            (staging / "x").write_bytes(b"half")
            seen.append(staging)
            raise Killed

    with pytest.raises(Killed):
        write()
    assert not seen[0].exists()
    place.sweep()
    assert place.names() <= {"labels"}
    with pytest.raises(FileNotFoundError):
        place.fetch("x").read_bytes()


def test_another_process_finds_the_same_place(place):
    put(place, "labels/part.parquet", b"one")
    assert read(place_of(str(place.resolved())), "labels/part.parquet") == b"one"
    assert read(pickle.loads(pickle.dumps(place.resolved())), "labels/part.parquet") == b"one"


def test_a_store_lets_one_writer_be_the_first():
    place = Store(f"memory://{uuid.uuid4()}")
    place.put_text("dataset.json", "mine", is_first=True)
    with pytest.raises(FileExistsError):
        place.put_text("dataset.json", "yours", is_first=True)
    assert read(place, "dataset.json") == b"mine"


def test_a_file_in_the_place_of_a_folder_is_told_apart(tmp_path):
    (tmp_path / "data").write_text("precious")
    store = Store(f"memory://{uuid.uuid4()}")
    store.put_text("data", "precious")
    for place in (Folder(tmp_path / "data"), Store(f"{store}/data")):
        with pytest.raises(NotADirectoryError):
            place.names()


def test_what_a_store_has_to_say_comes_as_an_error_of_the_system(monkeypatch):
    store = Store("memory://somewhere")

    class NoCredentialsError(Exception):
        pass

    def refuse(*_: object, **__: object) -> None:
        raise NoCredentialsError("who are you?")

    monkeypatch.setattr(type(store._files), "pipe_file", refuse)
    with pytest.raises(OSError, match=r"NoCredentialsError: who are you\?"):
        store.put_text("dataset.json", "mine")


@pytest.mark.parametrize("url", ["nope://bucket/data", "http2://data"])
def test_a_url_that_nobody_knows_is_refused_in_one_line(url):
    with pytest.raises(ConfigError, match=rf"\A{url}: place: expected a folder, or a URL.*\Z"):
        place_of(url)


def test_a_store_whose_package_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(MissingExtraError, match=r"s3://b/data: fsspec, .* the extra \[cloud\]"):
        place_of("s3://b/data")


def test_what_needs_a_folder_says_so_to_a_url(tmp_path):
    with pytest.raises(ConfigError, match="expected a folder of this machine to label"):
        folder_of("memory://data", "label")
    assert folder_of(tmp_path, "label") == tmp_path
    assert folder_of(tmp_path.as_uri(), "label") == tmp_path
