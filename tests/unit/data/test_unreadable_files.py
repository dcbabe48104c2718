"""Files that the system does not let a process read are neither called damaged nor replaced."""

from __future__ import annotations

import errno
import os
from io import BytesIO
from typing import TYPE_CHECKING

import pyarrow as pa
import pytest

import overtaking as ot
from overtaking.core.errors import DatasetError, OvertakingError, SystemLimitError
from overtaking.data import shards
from overtaking.data.tables import files

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

CAUSES = [
    (PermissionError(errno.EACCES, "Permission denied"), DatasetError),
    (OSError(errno.EIO, "Input/output error"), DatasetError),
    (OSError(errno.EMFILE, "Too many open files"), SystemLimitError),
    (pa.ArrowMemoryError("malloc of size 4096 failed"), SystemLimitError),
    (pa.ArrowException("Failed to launch worker thread: no"), SystemLimitError),
]


@pytest.fixture
def dataset(tmp_path: Path) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=2, seed=1, out=tmp_path / "data"
    )


def failing(error: Exception) -> Callable[..., object]:
    def fail(*_: object, **__: object) -> object:
        raise error

    return fail


def check_message(error: OvertakingError) -> None:
    text = str(error)
    assert "restore" not in text
    assert "--resume" not in text
    assert "generate the data set again" not in text


@pytest.mark.parametrize(("cause", "kind"), CAUSES)
def test_a_table_that_cannot_be_read(dataset, monkeypatch, cause, kind):
    data = ot.load_dataset(dataset.path)
    monkeypatch.setattr(files, "_open_parquet", failing(cause))
    with pytest.raises(kind) as caught:
        data.features()
    check_message(caught.value)


@pytest.mark.parametrize(("cause", "kind"), CAUSES[:3])
def test_a_checksum_that_cannot_be_made(dataset, monkeypatch, cause, kind):
    data = ot.load_dataset(dataset.path)
    monkeypatch.setattr(shards, "is_intact", failing(cause))
    with pytest.raises(kind) as caught:
        data.verify()
    check_message(caught.value)


@pytest.mark.parametrize(("cause", "kind"), CAUSES)
def test_a_resumed_run_does_not_replace_it(dataset, monkeypatch, cause, kind):
    before = {path: path.stat().st_mtime_ns for path in dataset.path.rglob("*.parquet")}
    monkeypatch.setattr(files, "_open_parquet", failing(cause))
    with pytest.raises(kind) as caught:
        ot.resume_dataset(dataset.path)
    check_message(caught.value)
    assert {path: path.stat().st_mtime_ns for path in dataset.path.rglob("*.parquet")} == before


def test_a_damaged_file_is_still_called_damaged(dataset):
    path = next(dataset.path.glob("features/*.parquet"))
    path.write_bytes(path.read_bytes()[:-40] + bytes(40))
    with pytest.raises(DatasetError, match=r"expected the bytes that were written.*--resume"):
        ot.load_dataset(dataset.path).features()


def test_a_missing_file_is_not_intact_and_an_unreadable_one_raises():
    facts = files.FileFacts(rows=0, size_bytes=0, sha256="", content="")
    missing = FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    assert not shards.is_intact(failing(missing), facts)
    assert not shards.is_intact(lambda: BytesIO(b"other"), facts)
    with pytest.raises(PermissionError):
        shards.is_intact(failing(PermissionError(errno.EACCES, os.strerror(errno.EACCES))), facts)
