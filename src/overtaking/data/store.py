"""A location in a store that a URL names: S3, Google Cloud, Azure, memory, or another of fsspec.

Object stores show an object when all of it is there, so nothing has to be renamed. They cannot be
locked: see `Store.put_text`, and ADR 21.
"""

import os
import shutil
import tempfile
import weakref
from collections.abc import Generator, Iterable
from contextlib import AbstractContextManager, contextmanager, nullcontext
from io import BufferedIOBase
from pathlib import Path
from typing import Any

from overtaking.core.errors import ConfigError, MissingExtraError


class Store:
    """A part of a store; see `location.Folder` for what each method promises."""

    def __init__(self, url: str) -> None:
        """Nothing is read or made yet.

        Args:
            url: Where.

        Raises:
            ConfigError: No store is known by such a URL.
            MissingExtraError: A package is missing that is needed for it.
        """
        self._url = url.rstrip("/")
        self._files, self._root = _reached(self._url)
        self._copies: Path | None = None

    @property
    def name(self) -> str:
        """The last part of the URL."""
        return self._url.rpartition("/")[2]

    def __str__(self) -> str:
        """Its URL."""
        return self._url

    def resolved(self) -> "Store":
        """A URL is always whole."""
        return self

    def at(self, name: str) -> str:
        """The URL of an object."""
        return f"{self._url}/{name}"

    def names(self) -> set[str]:
        """The first parts of the names of its objects."""
        with self._asked() as files:
            try:
                found: list[str] = files.ls(self._root, detail=False)
            except FileNotFoundError:
                return set()
            if files.isfile(self._root):
                raise NotADirectoryError(str(self))
        return {path.rstrip("/").rpartition("/")[2] for path in found}

    def has(self, name: str) -> bool:
        """Whether there is such an object."""
        with self._asked() as files:
            return bool(files.exists(self._key(name)))

    def open(self, name: str) -> BufferedIOBase:
        """An object, read piece by piece."""
        with self._asked() as files:
            return files.open(self._key(name), "rb")

    def fetch(self, name: str) -> Path:
        """A copy that lives as long as this location is in use."""
        if self._copies is None:
            self._copies = Path(tempfile.mkdtemp(prefix="overtaking-"))
            weakref.finalize(self, shutil.rmtree, self._copies, ignore_errors=True)
        copy = self._copies / name
        if not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            arriving = copy.with_name(f"{copy.name}.{os.urandom(4).hex()}")
            with self._asked() as files:
                files.get_file(self._key(name), str(arriving))
            arriving.replace(copy)
        return copy

    def prepare(self, folders: Iterable[str]) -> None:
        """Do nothing: stores have no folders."""

    @contextmanager
    def staging(self) -> Generator[Path]:
        """A folder on this machine."""
        with tempfile.TemporaryDirectory(prefix="overtaking-") as folder:
            yield Path(folder)

    def put(self, finished: Path, name: str) -> None:
        """Send a file; the store shows it when all of it has arrived."""
        with self._asked() as files:
            files.put_file(str(finished), self._key(name))
        self._forget(name)

    def put_text(self, name: str, text: str, *, is_first: bool = False) -> None:
        """Send a text; of two writers the store accepts the first, if it can."""
        with self._asked() as files:
            mode = "create" if is_first else "overwrite"
            files.pipe_file(self._key(name), text.encode(), mode=mode)
        self._forget(name)

    def remove(self, name: str) -> None:
        """Delete an object."""
        with self._asked() as files:
            if self.has(name):
                files.rm_file(self._key(name))
        self._forget(name)

    def sweep(self) -> None:
        """Do nothing: unfinished files are never in the store."""

    def locked(self) -> AbstractContextManager[None]:
        """Do nothing: a store cannot be held."""
        return nullcontext()

    @contextmanager
    def _asked(self) -> Generator[Any]:
        """The file system as it is now; the many errors of stores and networks become `OSError`."""
        try:
            self._files.invalidate_cache()
            yield self._files
        except (OSError, MemoryError):
            raise
        except Exception as error:
            raise OSError(f"{type(error).__name__}: {error}") from error

    def _key(self, name: str) -> str:
        return f"{self._root}/{name}"

    def _forget(self, name: str) -> None:
        """Forget fetched copies of replaced files."""
        if self._copies is not None:
            (self._copies / name).unlink(missing_ok=True)


def _reached(url: str) -> tuple[Any, str]:
    """The file system of a store, and the path of a URL in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise MissingExtraError.for_extra(
            "cloud", what="fsspec, which reaches stores", where=url
        ) from None
    try:
        files, root = url_to_fs(url)
    except ImportError as error:
        raise MissingExtraError(
            what="store",
            where=url,
            expected="the packages that reach it",
            got=f"none: {error}",
            next_step="install the package of that store",
        ) from None
    except Exception as error:
        raise ConfigError(
            what="location",
            where=url,
            expected="a folder, or a URL such as s3://bucket/data",
            got=str(error),
            next_step="see docs/how-to/generate-at-scale.md for stores that are known",
        ) from None
    return files, str(root).rstrip("/")
