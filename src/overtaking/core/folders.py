"""Folders that appear with all their files, or not at all."""

import contextlib
import os
import shutil
from collections.abc import Generator
from pathlib import Path
from uuid import uuid4

from overtaking.core.errors import ConfigError


@contextlib.contextmanager
def whole_folder(out: Path) -> Generator[Path]:
    """A folder beside `out` that takes its name if the block succeeds, and goes away if not.

    Args:
        out: The name; it must be free, or that of an empty folder.

    Raises:
        ConfigError: Something is there.
        OSError: The folder cannot be made or renamed.
    """
    refuse_strangers(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = out.with_name(f".{out.name}.{uuid4().hex}.partial")
    folder.mkdir()
    try:
        yield folder
        if out.is_dir():
            out.rmdir()  # An empty one; Windows does not replace it.
        folder.rename(out)
        sync_folder(out.parent)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def refuse_strangers(out: Path) -> None:
    """Refuse a place where something is.

    Raises:
        ConfigError: It is not free.
    """
    if out.is_dir() and not any(out.iterdir()):
        return
    if out.exists() or out.is_symlink():
        raise ConfigError.of(
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


def put_file(path: Path, text: str) -> None:
    """Write a text and force it to the disk.

    Raises:
        OSError: It cannot be written.
    """
    with path.open("x", encoding="utf-8", newline="\n") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk, where the system knows how to."""
    if os.name == "nt":  # Windows cannot open folders.
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
