"""Bounded reading; atomic writing of files and folders."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from overtaking.core.errors import ConfigError
from overtaking.core.process_limits import asks_beyond_machine, refusal_of
from overtaking.core.representation import as_utf8

if TYPE_CHECKING:
    from collections.abc import Generator
    from io import BufferedIOBase, BufferedReader
    from pathlib import Path

    from overtaking.core.errors import OvertakingError


MISSING_FILE_ERRORS = (FileNotFoundError, IsADirectoryError, NotADirectoryError)
"""Errors of paths at which there is no file."""


def unreadable_error(
    error: BaseException, where: str, kind: type[OvertakingError]
) -> OvertakingError | None:
    """The error for a file that the system does not let this process read.

    Such a file may be intact: the message never advises to write it again.

    Args:
        error: Exception of the reader. Arrow sets `errno` only if the system refuses the file.
        where: The file.
        kind: Class of the error, unless the system lacks memory, threads or open files.

    Returns:
        The error; None if the file is missing or its content is the cause.
    """
    if asks_beyond_machine(error):
        return None
    if (refusal := refusal_of(error, where)) is not None:
        return refusal
    if (
        not isinstance(error, OSError)
        or error.errno is None
        or isinstance(error, MISSING_FILE_ERRORS)
    ):
        return None
    return kind(
        what="file",
        where=where,
        expected="a file that this process can read",
        got=error.strerror or str(error),
        next_step="check its permissions and its disk, and try again",
    )


def check_output_path(path: str | Path) -> None:
    """Refuse an output path that is not UTF-8, before anything is written.

    Arrow and other libraries write to names in UTF-8 only.

    Args:
        path: The path, or the URL of a store.

    Raises:
        ConfigError: A part of the absolute path has other bytes.
    """
    absolute = str(path)
    if "://" not in absolute:
        with suppress(OSError):  # The working directory no longer exists.
            absolute = os.path.abspath(path)  # noqa: PTH100 - `resolve` would follow links.
    if as_utf8(absolute) != absolute:
        raise ConfigError(
            what="output",
            where=absolute,
            expected="a name in UTF-8",
            got="other bytes",
            next_step="choose another name",
        )


def check_regular_file(path: Path) -> Path:
    """Refuse pipes and devices, because reading them might never end.

    Args:
        path: Path of a file or a folder.

    Returns:
        The path.

    Raises:
        FileNotFoundError: The path does not exist, or is a pipe or a device.
        OSError: The system does not tell its type.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise FileNotFoundError(errno.ENOENT, "a pipe or a device", str(path))
    return path


def open_regular_file(path: Path) -> BufferedReader:
    """Open a file for reading.

    Raises:
        OSError: The file cannot be opened, or is a pipe or a device.
    """
    return check_regular_file(path).open("rb")


def read_bounded(file: BufferedIOBase, max_bytes: int) -> bytes:
    """Read an open file of limited size.

    Args:
        file: The file. It is open already, because a store has files without a path.
        max_bytes: Largest size of the file [bytes].

    Raises:
        OSError: The file is larger, or cannot be read.
    """
    data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"a file of more than {max_bytes} bytes")
    return data


def read_toml(path: Path, max_bytes: int) -> dict[str, Any]:
    """Read a TOML file with or without a byte order mark.

    Some editors on Windows write that mark at the beginning of UTF-8 files; TOML forbids it.

    Args:
        path: The file.
        max_bytes: Largest size of the file [bytes].

    Raises:
        OSError: The file is larger, or cannot be read.
        ValueError: The content is not TOML in UTF-8.
        RecursionError: Its values are nested too deeply.
    """
    with open_regular_file(path) as file:
        return tomllib.loads(read_bounded(file, max_bytes).decode("utf-8-sig"))


@contextlib.contextmanager
def atomic_file(path: Path) -> Generator[Path]:
    """Replace a file only if the block succeeds: no reader ever sees a part of it.

    Args:
        path: The file; its folder exists.

    Yields:
        A path in the same folder, with the same suffix, for the block to write to.

    Raises:
        OSError: The file cannot be written. It names `path`, not the path of the block.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    partial = path.with_name(f".{path.stem}.{uuid4().hex[:8]}.partial{path.suffix}")
    try:
        yield partial
        with partial.open("rb+") as file:  # Windows flushes only files that are open for writing.
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        if error.filename in (None, str(partial)):  # Not a file that the block reads.
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file, or leave an earlier file of this name as it is.

    Args:
        path: The file; its folder exists.
        content: Its bytes.

    Raises:
        OSError: The file cannot be written.
    """
    with atomic_file(path) as partial:
        partial.write_bytes(content)


@contextlib.contextmanager
def atomic_folder(out: Path) -> Generator[Path]:
    """Make a folder that appears under its name only if the block succeeds.

    Args:
        out: The folder. It does not exist, or is empty.

    Yields:
        A folder beside `out` for the block to write to.

    Raises:
        ConfigError: The name is taken.
        OSError: The folder cannot be made or renamed.
    """
    check_folder_is_free(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = out.with_name(f".{out.name}.{uuid4().hex}.partial")
    folder.mkdir()
    try:
        yield folder
        if out.is_dir():
            out.rmdir()  # Windows does not replace an empty folder.
        folder.rename(out)
        fsync_folder(out.parent)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def check_folder_is_free(out: Path) -> None:
    """Refuse a path that exists, unless it is an empty folder.

    Raises:
        ConfigError: The path is a file, a link, or a folder with files.
    """
    if out.is_dir() and not any(out.iterdir()):
        return
    if out.exists() or out.is_symlink():
        raise ConfigError(
            what="folder",
            where=str(out),
            expected="a name that is free, or an empty folder",
            got=describe_place(out),
            next_step="choose another folder",
        )


def describe_place(path: Path) -> str:
    """A description of a path that exists but is not an empty folder, for a message."""
    if path.is_dir():
        return "a folder with something in it"
    return "a file" if path.exists() else "a symbolic link to nothing"


def write_new_file(path: Path, text: str) -> None:
    """Write a text to a new file and force it to the disk.

    Args:
        path: The file. It is in a folder that `atomic_folder` or a lock protects, so that it needs
            no temporary name.
        text: Its content.

    Raises:
        FileExistsError: The file exists.
        OSError: The file cannot be written.
    """
    with path.open("x", encoding="utf-8", newline="\n") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def fsync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk; on Windows do nothing."""
    if os.name == "nt":  # Windows cannot open folders.
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
