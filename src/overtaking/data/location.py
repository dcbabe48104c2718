"""The location of a data set: a folder, or a store that a URL names.

Files have names, such as `labels/part-00000.parquet`. What is put into a location appears whole or
not at all; unfinished files lie in a staging folder on a disk of this machine.
"""

import errno
import os
import shutil
import tempfile
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from io import BufferedIOBase
from pathlib import Path
from urllib.parse import urlsplit

from overtaking.core.errors import ConfigError
from overtaking.core.files import (
    check_output_path,
    check_regular_file,
    fsync_folder,
    open_regular_file,
    write_new_file,
)
from overtaking.core.representation import as_utf8
from overtaking.data import lock
from overtaking.data.store import Store

PARTIAL = ".partial"
"""Folder in a data set for unfinished files; files that remain there are ignored."""


class Folder:
    """A folder on a disk that this machine sees, its own or a shared one.

    Every method may raise `OSError`. `Store` has the same methods.
    """

    def __init__(self, path: Path) -> None:
        """Nothing is read or made yet.

        Args:
            path: Where.
        """
        self.path = path

    @property
    def name(self) -> str:
        """The last part of where it is, for people."""
        return as_utf8(self.path.resolve().name)

    def __str__(self) -> str:
        """Its path; `location_of` finds it again by that, on any machine that sees it."""
        return str(self.path)

    def resolved(self) -> "Folder":
        """The same, independent of the working directory."""
        return Folder(self.path.resolve())

    def at(self, name: str) -> str:
        """Path or URL of a file, for messages."""
        return str(self.path / name)

    def names(self) -> set[str]:
        """The files and folders at its top; none if it is not there.

        Raises:
            NotADirectoryError: There is a file instead, or a symbolic link whose target is missing.
        """
        if not self.path.exists():
            if self.path.is_symlink():
                raise NotADirectoryError(
                    errno.ENOTDIR, "a symbolic link to nothing", str(self.path)
                )
            return set()
        return {path.name for path in self.path.iterdir()}

    def has(self, name: str) -> bool:
        """Whether there is such a file."""
        return (self.path / name).exists()

    def open(self, name: str) -> BufferedIOBase:
        """A file, to be read once from its beginning."""
        return open_regular_file(self.path / name)

    def fetch(self, name: str) -> Path:
        """A file on a disk of this machine with the bytes of this one, to be read only."""
        return check_regular_file(self.path / name)

    def prepare(self, folders: Iterable[str]) -> None:
        """Make it, and some folders in it, where they are missing."""
        self.path.mkdir(parents=True, exist_ok=True)
        for name in folders:
            (self.path / name).mkdir(exist_ok=True)
        fsync_folder(self.path)

    @contextmanager
    def staging(self) -> Generator[Path]:
        """A new folder for files that are not finished, gone afterwards.

        Each writer has its own: one that was given up may go on for a while.
        """
        (self.path / PARTIAL).mkdir(exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f"{os.getpid()}-", dir=self.path / PARTIAL))
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def put(self, finished: Path, name: str) -> None:
        """Put a complete file from the staging folder where it belongs, whole."""
        target = self.path / name
        finished.replace(target)
        fsync_folder(target.parent)

    def put_text(self, name: str, text: str, *, is_first: bool = False) -> None:
        """Put a text into its place, whole.

        Raises:
            FileExistsError: It is to be the first of this name (`is_first`), and another writer of
                the store was faster. A folder has a lock instead.
        """
        del is_first
        with self.staging() as staging:
            unfinished = staging / name
            write_new_file(unfinished, text)
            self.put(unfinished, name)

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        (self.path / name).unlink(missing_ok=True)

    def sweep(self) -> None:
        """Remove unfinished files."""
        shutil.rmtree(self.path / PARTIAL, ignore_errors=True)

    @contextmanager
    def locked(self) -> Generator[None]:
        """Hold it for writing, by a lock of the operating system; it is prepared before.

        If the block fails, the folders that hold nothing are removed.
        """
        check_output_path(self.path)
        made = [one for one in (self.path, *self.path.parents) if not one.exists()]
        try:
            self.prepare([])
            with lock.locked(self.path):
                try:
                    yield
                except BaseException:
                    self._withdraw()
                    raise
        finally:
            _remove_empty(made)

    def _withdraw(self) -> None:
        """Remove the folders of tables that hold nothing, and the lock if nothing else is left."""
        with suppress(OSError):
            _remove_empty(one for one in self.path.iterdir() if one.is_dir())
            if self.names() == {lock.FILE_NAME}:
                (self.path / lock.FILE_NAME).unlink()


Location = Folder | Store
"""The location of one data set."""


def location_of(where: str | Path | Location) -> Location:
    """The location of a data set.

    Args:
        where: A folder, or the URL of one in a store, such as `s3://bucket/data`. (`file://` is a
            folder.)

    Raises:
        ConfigError: No store is known by such a URL.
        MissingExtraError: The extra `cloud`, or the package of this kind of store, is missing.
    """
    if isinstance(where, Path):
        return Folder(where)
    if not isinstance(where, str):
        return where
    if not is_url(where):
        return Folder(Path(where))
    parts = urlsplit(where)
    if parts.scheme != "file":
        return Store(where)
    from urllib.request import url2pathname  # It brings a client of HTTP along.

    return Folder(Path(url2pathname(parts.path)))


def is_url(where: str | Path) -> bool:
    """Whether something is the URL of a store, and not a path."""
    return isinstance(where, str) and "://" in where


def folder_of(where: str | Path, purpose: str) -> Path:
    """A folder or file on this machine, where nothing else will do.

    Args:
        where: The path or URL as it was given.
        purpose: What it is needed for, as in *a folder to ...*.

    Raises:
        ConfigError: It is in a store.
    """
    location = location_of(where) if is_url(where) else Folder(Path(where))
    if isinstance(location, Folder):
        return location.path
    raise ConfigError(
        what="location",
        where=str(where),
        expected=f"a folder of this machine to {purpose}",
        got="one in a store",
        next_step="choose a folder, and copy it from or to the store",
    )


def _remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of some folders that hold nothing."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
