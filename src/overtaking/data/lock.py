"""One writer per folder, by a lock of the operating system that ends with its process."""

import errno
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from overtaking.core.errors import LockedError

FILE_NAME = ".lock"

NO_LOCK_VARIABLE = "OVERTAKING_NO_LOCK"
"""Environment variable; if it is 1, folders are written without a lock."""

_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""Errors of file systems without locks, such as some network and FUSE file systems."""

_FAR = 1 << 20
"""Windows forbids all others to read locked bytes, so the locked byte lies behind the text."""


@contextmanager
def locked(folder: Path) -> Generator[None]:
    """Hold a folder for writing.

    The lock file stays behind: a file that is deleted can be locked twice. No lock is taken if
    `NO_LOCK_VARIABLE` is 1 in the environment; then the user must not start two writers.

    Args:
        folder: An existing folder.

    Raises:
        LockedError: Another process holds the folder, which the message names; or the file system
            has no locks.
        OSError: The lock file cannot be written.
    """
    if os.environ.get(NO_LOCK_VARIABLE) == "1":
        yield
        return
    handle = os.open(folder / FILE_NAME, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            is_acquired = _acquire(handle)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            raise _no_locks(folder, error) from None
        if not is_acquired:
            raise _held(folder, handle)
        os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_SET)
        os.write(handle, f"{os.getpid()}\n".encode())
        try:
            yield
        finally:
            # A full disk or an interruption must not hide what went wrong before.
            with suppress(OSError):
                os.ftruncate(handle, 0)
    finally:
        os.close(handle)


def _held(folder: Path, handle: int) -> LockedError:
    os.lseek(handle, 0, os.SEEK_SET)
    holder = os.read(handle, 32).decode(errors="replace").strip()
    return LockedError(
        what="data set",
        where=str(folder),
        expected="no other process that writes it",
        got=f"process {holder}" if holder else "another process",
        next_step="wait until it is done, or choose another folder",
    )


def _no_locks(folder: Path, error: OSError) -> LockedError:
    return LockedError(
        what="data set",
        where=str(folder),
        expected="a file system with locks, which keep a second writer out",
        got=error.strerror or str(error),
        next_step=f"choose a folder on another file system, or set {NO_LOCK_VARIABLE}=1 and let "
        "one process write at a time",
    )


if sys.platform == "win32":
    import msvcrt

    def _acquire(handle: int) -> bool:
        """Try to lock an open file; the system unlocks it when the file is closed."""
        os.lseek(handle, _FAR, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def _acquire(handle: int) -> bool:
        """Try to lock an open file; the system unlocks it when the file is closed."""
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
