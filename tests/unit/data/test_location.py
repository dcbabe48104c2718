"""Every location of a data set keeps the same promises, whatever it is made of."""

from __future__ import annotations

import pickle
import sys
import uuid
from typing import TYPE_CHECKING

import pytest

from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.data.location import Folder, Location, folder_of, location_of
from overtaking.data.store import Store

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(params=["folder", "file", "memory"])
def location(request: pytest.FixtureRequest, tmp_path: Path) -> Location:
    """An empty location of each kind."""
    where = {
        "folder": str(tmp_path / "data"),
        "file": (tmp_path / "data").as_uri(),
        "memory": f"memory://{uuid.uuid4()}/data",
    }
    made = location_of(where[request.param])
    assert made.names() == set()
    made.prepare(["labels"])
    return made


def put(location: Location, name: str, content: bytes) -> None:
    with location.staging() as staging:
        (staging / "x").write_bytes(content)
        location.put(staging / "x", name)


def read(location: Location, name: str) -> bytes:
    with location.open(name) as file:
        return file.read()


def test_what_was_put_is_found_under_its_name(location):
    assert not location.has("labels/part.parquet")
    put(location, "labels/part.parquet", b"one")
    assert location.has("labels/part.parquet")
    assert "labels" in location.names()
    assert read(location, "labels/part.parquet") == b"one"
    assert location.fetch("labels/part.parquet").read_bytes() == b"one"
    assert location.at("labels/part.parquet") == f"{location}/labels/part.parquet"
    assert location.name == "data"


def test_what_is_put_again_is_never_read_from_an_old_copy(location):
    put(location, "labels/part.parquet", b"one")
    assert location.fetch("labels/part.parquet").read_bytes() == b"one"
    put(location, "labels/part.parquet", b"two")
    assert location.fetch("labels/part.parquet").read_bytes() == b"two"
    location.put_text("dataset.json", "three")
    location.fetch("dataset.json")
    location.put_text("dataset.json", "four")
    assert location.fetch("dataset.json").read_bytes() == b"four"


def test_a_file_that_is_not_finished_is_nowhere_to_be_seen(location):
    class Killed(Exception):
        pass

    seen: list[Path] = []

    def write() -> None:
        with location.staging() as staging:
            (staging / "x").write_bytes(b"half")
            seen.append(staging)
            raise Killed

    with pytest.raises(Killed):
        write()
    assert not seen[0].exists()
    location.sweep()
    assert location.names() <= {"labels"}
    with pytest.raises(FileNotFoundError):
        location.fetch("x").read_bytes()


def test_another_process_finds_the_same_place(location):
    put(location, "labels/part.parquet", b"one")
    assert read(location_of(str(location.resolved())), "labels/part.parquet") == b"one"
    assert read(pickle.loads(pickle.dumps(location.resolved())), "labels/part.parquet") == b"one"


def test_a_store_lets_one_writer_be_the_first():
    location = Store(f"memory://{uuid.uuid4()}")
    location.put_text("dataset.json", "mine", is_first=True)
    with pytest.raises(FileExistsError):
        location.put_text("dataset.json", "yours", is_first=True)
    assert read(location, "dataset.json") == b"mine"


def test_a_file_in_the_place_of_a_folder_is_told_apart(tmp_path):
    (tmp_path / "data").write_text("precious")
    store = Store(f"memory://{uuid.uuid4()}")
    store.put_text("data", "precious")
    for location in (Folder(tmp_path / "data"), Store(f"{store}/data")):
        with pytest.raises(NotADirectoryError):
            location.names()


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
    with pytest.raises(ConfigError, match=rf"\A{url}: location: expected a folder, or a URL.*\Z"):
        location_of(url)


def test_a_store_whose_package_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(MissingExtraError, match=r"s3://b/data: fsspec, .* the extra \[cloud\]"):
        location_of("s3://b/data")


def test_what_needs_a_folder_says_so_to_a_url(tmp_path):
    with pytest.raises(ConfigError, match="expected a folder of this machine to label"):
        folder_of("memory://data", "label")
    assert folder_of(tmp_path, "label") == tmp_path
    assert folder_of(tmp_path.as_uri(), "label") == tmp_path
