"""Files of tables as streams of bytes: compressed ones are decompressed up to a bound."""

from __future__ import annotations

import io
import lzma
import stat
import zipfile
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar, cast

import pyarrow as pa

from overtaking.recordings.reading_progress import open_counted
from overtaking.recordings.table_errors import refused, unreadable

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping
    from pathlib import Path

_T = TypeVar("_T")

MAX_BYTES = 1 << 31
"""Larger files are refused; the largest of highD has some 200 MB, NGSIM's of all sites 1.5 GB."""

_MAX_EXPANSION, _SMALL_BYTES = 100, 1 << 24
"""The content of a compressed file may take 100 times its size, and 16 MB in any case: without a
bound, a few bytes could fill the memory."""

COMPRESSED_SUFFIXES = (".gz", ".bz2", ".xz", ".zst", ".lz4")
"""Endings of the names of compressed files. They only serve to find files and to name recordings;
the first bytes of a file decide how it is decompressed."""

_MAGIC = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bz2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x04\x22\x4d\x18": "lz4",
}
_SAVE_AS_CSV = (
    "save the sheet as 'CSV UTF-8', or with pandas.read_excel(...).to_csv(..., index=False)"
)
_OTHER_FILES = {
    b"PK\x03\x04": ("a zip archive", "unpack it"),
    b"7z\xbc\xaf": ("a 7z archive", "unpack it"),
    b"Rar!": ("a RAR archive", "unpack it"),
    b"\xd0\xcf\x11\xe0": ("an Excel workbook (.xls)", _SAVE_AS_CSV),
    b"PAR1": ("a Parquet file", "end its name in .parquet"),
    b"ARROW1": ("an Arrow file", "end its name in .arrow"),
    b"\x89HDF": ("an HDF5 file", "write it with pandas.read_hdf(...).to_parquet(...)"),
    b"SQLite": ("an SQLite database", "write the table with pandas.read_sql(...).to_parquet(...)"),
    b"\x93NUMPY": ("a NumPy file", "write it as CSV or Parquet"),
}
"""What a file that is no text is, by its first bytes, and what the user can do."""

_LONGEST_MAGIC = 8  # At least as long as every key of `_MAGIC` and `_OTHER_FILES` [bytes].


def uncompressed_name(path: Path) -> str:
    """Name of a file without the ending of its compression, such as `.gz`."""
    return path.name.removesuffix(path.suffix) if is_compressed_name(path) else path.name


def is_compressed_name(path: Path) -> bool:
    """Whether the name of a file ends as those of compressed files do."""
    return path.suffix.lower() in COMPRESSED_SUFFIXES


def max_cell_bytes(path: Path) -> int:
    """Memory that the content of a compressed file may take [bytes]."""
    return min(max(_MAX_EXPANSION * path.stat().st_size, _SMALL_BYTES), MAX_BYTES)


@contextmanager
def open_bytes(path: Path) -> Generator[BinaryIO]:
    """The bytes of a file, decompressed where it is compressed.

    Args:
        path: A plain file of at most `MAX_BYTES`; compressed by gzip, bzip2, xz, Zstandard or LZ4,
            or not at all.

    Raises:
        ImportFormatError: The file is not readable, damaged, too large, or holds more bytes than
            its size allows; also while the caller reads from it.
    """
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            raise refused(path, "file", "a readable file", "no plain file")
        if about.st_size > MAX_BYTES:
            expected = f"at most {MAX_BYTES} bytes"
            raise refused(path, "file", expected, f"{about.st_size} bytes")
        with open_counted(path, "table") as file:
            first = file.read(_LONGEST_MAGIC)
            file.seek(0)
            if (other := _kind(first, _OTHER_FILES)) is not None:
                if first.startswith(b"PK") and _is_workbook(path):
                    other = "an Excel workbook (.xlsx)", _SAVE_AS_CSV
                raise refused(path, "file", "a table in text, compressed or not", *other)
            kind = _kind(first, _MAGIC)
            stream = file if kind is None else _BoundedStream(_decompressed(file, kind), path)
            yield cast("BinaryIO", stream)
    except (lzma.LZMAError, EOFError, OSError) as error:
        raise unreadable(path, "a readable file", error) from None


def _kind(first: bytes, kinds: Mapping[bytes, _T]) -> _T | None:
    """The kind of file that begins with some bytes, None if `kinds` does not list it."""
    return next((kind for magic, kind in kinds.items() if first.startswith(magic)), None)


def _is_workbook(path: Path) -> bool:
    """Whether a zip archive is a workbook of a spreadsheet."""
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.startswith("xl/") for name in archive.namelist())
    except (zipfile.BadZipFile, OSError, ValueError):
        return False


def _decompressed(file: BinaryIO, kind: str) -> BinaryIO:
    """The content of a compressed file."""
    if kind == "xz":  # Arrow has no decoder for it.
        return cast("BinaryIO", lzma.LZMAFile(file))
    return cast("BinaryIO", pa.CompressedInputStream(pa.PythonFile(file, mode="r"), kind))


class _BoundedStream(io.RawIOBase):
    """A stream that raises an error after more bytes than a file of that size may hold."""

    def __init__(self, source: BinaryIO, path: Path) -> None:
        super().__init__()
        self._source, self._path = source, path
        self._left = max_cell_bytes(path)

    def readable(self) -> bool:
        """Whether bytes can be read: always."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read into a buffer; returns the number of bytes, 0 at the end."""
        data = self._source.read(len(buffer))
        self._left -= len(data)
        if self._left < 0:
            most = max_cell_bytes(self._path) >> 20
            expected = f"at most {most} MB of text in a file of that size"
            raise refused(self._path, "file", expected, "more")
        buffer[: len(data)] = data
        return len(data)
