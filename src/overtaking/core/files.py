"""Reading of files up to a size, and writing that leaves complete files and folders only.

All packages that read or write files use these functions. Files under a fixed name, such as a
report, go through `atomic_file` or `write_atomically`; folders with many files, such as data sets,
through `atomic_folder`, and the files in them through `write_new_file`.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import tomllib
from contextlib import suppress
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
"""Errors at the opening of a path that is not a file."""


def unreadable_error(
    error: BaseException, where: str, kind: type[OvertakingError]
) -> OvertakingError | None:
    """Translate an exception from reading a file if the system did not let this process read it.

    A file that cannot be read may be intact, so the message advises to try again, and not to
    replace the file.

    Args:
        error: The exception.
        where: The file.
        kind: Class of the error if permissions or the disk are the cause. If the system lacks
            memory, threads or open files, the error is a `SystemLimitError`.

    Returns:
        The error to raise instead; None if the file is missing or if its content is the cause.
    """
    if asks_beyond_machine(error):  # A damaged file states a size that no machine can allocate.
        return None
    if (refusal := refusal_of(error, where)) is not None:  # Memory, threads or open files.
        return refusal
    if not isinstance(error, OSError) or isinstance(error, MISSING_FILE_ERRORS):
        return None
    if error.errno is None:  # From Arrow, which reads Parquet files: the file is damaged.
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

    Linux permits any bytes in a name, but Arrow and other libraries write to names in UTF-8 only.

    Args:
        path: The path, or the URL of a store of files, such as `s3://bucket/folder`.

    Raises:
        ConfigError: The absolute path contains bytes that are not UTF-8.
    """
    absolute = str(path)
    if "://" not in absolute:
        with suppress(OSError):  # Without a working directory, the path is checked as it is.
            # `resolve` would check the target of a link instead of its name.
            absolute = os.path.abspath(path)  # noqa: PTH100
    if as_utf8(absolute) != absolute:  # It replaces bytes that are not UTF-8 by the text `\xe9`.
        raise ConfigError(
            what="output",
            where=absolute,
            expected="a name in UTF-8",
            got="other bytes",
            next_step="choose another name",
        )


def check_regular_file(path: Path) -> Path:
    """Refuse pipes and devices, because reading them might never end.

    A folder passes, because the error at its opening is clearer.

    Args:
        path: Path of a file or a folder.

    Returns:
        The same path.

    Raises:
        FileNotFoundError: The path does not exist, or is a pipe or a device, which callers report
            like a missing file.
        OSError: The type of the path cannot be read.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise FileNotFoundError(errno.ENOENT, "a pipe or a device", str(path))
    return path


def open_regular_file(path: Path) -> BufferedReader:
    """Open a file for reading bytes, after `check_regular_file`.

    Args:
        path: The file.

    Raises:
        OSError: The file cannot be opened, or is a pipe or a device.
    """
    return check_regular_file(path).open("rb")


def read_bounded(file: BufferedIOBase, max_bytes: int) -> bytes:
    """Read an open file if it is not too large.

    Args:
        file: The file, at its beginning. Files in remote stores have no path to open.
        max_bytes: Largest size of the file [bytes].

    Raises:
        OSError: The file is larger than `max_bytes`, or cannot be read.
    """
    data = file.read(max_bytes + 1)  # The last byte shows that the file is too large.
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"a file of more than {max_bytes} bytes")
    return data


def read_toml(path: Path, max_bytes: int) -> dict[str, Any]:
    """Read a TOML file of limited size.

    Args:
        path: The file.
        max_bytes: Largest size of the file [bytes].

    Raises:
        OSError: The file is larger than `max_bytes`, or cannot be read.
        ValueError: The content is not TOML in UTF-8.
        RecursionError: Its values are nested too deeply.
    """
    with open_regular_file(path) as file:
        # TOML forbids a byte order mark, but editors on Windows write one; "utf-8-sig" skips it.
        return tomllib.loads(read_bounded(file, max_bytes).decode("utf-8-sig"))


@contextlib.contextmanager
def atomic_file(path: Path) -> Generator[Path]:
    """Replace a file only if the block of `with` succeeds, so that no reader sees a part of it.

    Args:
        path: The file to write or replace; its folder exists.

    Yields:
        Path of a temporary file, which the block writes. It is in the same folder, because a rename
        to another disk is a copy, and has the same suffix, from which libraries infer the format.

    Raises:
        OSError: The file cannot be written. The error names `path`, not the temporary file.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    partial = _unique_neighbour(path, path.stem, path.suffix)
    try:
        yield partial
        # First force the content to the disk: after a power failure, the new name must not belong
        # to an empty file. Windows flushes only files that are open for writing.
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        # Errors of `os.fsync` name no file, so any error without a name counts as one of `path`. An
        # error about another file, such as an input that the block reads, stays as it is.
        if error.filename in (None, str(partial)):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise
    finally:
        partial.unlink(missing_ok=True)  # After success the file has its final name.


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file whole, or leave an earlier file of this name as it is; see `atomic_file`.

    Args:
        path: The file; its folder exists.
        content: The bytes of the file.

    Raises:
        OSError: The file cannot be written.
    """
    with atomic_file(path) as partial:
        partial.write_bytes(content)


@contextlib.contextmanager
def atomic_folder(out: Path) -> Generator[Path]:
    """Make a folder that appears under its name only if the block of `with` succeeds.

    Args:
        out: The folder to make. It does not exist, or is an empty folder or a link to one; the
            link then stays and leads to the new folder.

    Yields:
        A temporary folder beside `out`, which the block fills. It is deleted if the block fails.

    Raises:
        ConfigError: `out` is a file, a link to nothing, or a folder with files.
        OSError: The folder cannot be made or renamed.
    """
    check_folder_is_free(out)
    if out.is_symlink():  # `rmdir` below would refuse the link, after all the work of the block.
        out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = _unique_neighbour(out, out.name)
    folder.mkdir()
    try:
        yield folder
        if out.is_dir():
            out.rmdir()  # Windows does not replace an empty folder.
        fsync_folder(folder)  # The names of its files.
        folder.rename(out)
        fsync_folder(out.parent)  # Its new name.
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # After success the folder has its final name.


def _unique_neighbour(path: Path, name: str, suffix: str = "") -> Path:
    """A temporary path in the same folder, hidden by its dot.

    It is unique, because several processes may write the same path. Chosen: 8 digits keep the name
    short, because names have at most 255 bytes.
    """
    return path.with_name(f".{name}.{uuid4().hex[:8]}.partial{suffix}")


def check_folder_is_free(out: Path) -> None:
    """Refuse a path that exists, unless it is an empty folder or a link to one.

    Args:
        out: The path of a folder to make.

    Raises:
        ConfigError: The path is a file, a link to nothing, or a folder with files.
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
    """Write a text to a new file in UTF-8 and force it to the disk.

    The file has its final name from the start, because most callers write into a folder that no
    other process reads yet, such as one of `atomic_folder`.

    Args:
        path: The file; its folder exists.
        text: The content of the file. On every system, its lines end as in the text.

    Raises:
        FileExistsError: The file exists.
        OSError: The file cannot be written.
    """
    with path.open("x", encoding="utf-8", newline="\n") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def fsync_folder(folder: Path) -> None:
    """Force the names of the files in a folder to the disk, after a file was made or renamed.

    Without it, a power failure can undo the new name although the file is on the disk.
    `atomic_file` takes this risk, because the earlier file, if any, is complete as well.

    Args:
        folder: The folder of that file.
    """
    if os.name == "nt":  # Windows cannot open folders, so it keeps this risk.
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
