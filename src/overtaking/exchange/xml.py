"""Reading XML of strangers: one top-level element at a time, bounded, and without entities.

A document is read with the standard library's expat, in pieces, and never as a whole tree: only
the wanted children of the root become `Element`s, one after the other. What a hostile document
could use against a reader is refused before it costs anything: document types and with them all
entities, compressed files, exotic encodings, and sizes beyond `Limits`. Nothing that a document
names is ever opened.
"""

import stat
import xml.parsers.expat as expat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from overtaking.core.errors import ImportFormatError
from overtaking.exchange.xml_element import Element, shown

_CHUNK_BYTES = 1 << 16
_ENCODINGS = frozenset(["utf-8", "utf-16", "us-ascii", "iso-8859-1"])  # What expat itself reads.
_PACKED = {b"\x1f\x8b": "gzip", b"PK": "zip", b"BZ": "bzip2", b"\xfd7": "xz"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Sizes beyond which a document is refused.

    The defaults are some twenty times what the largest map or recording tried needs.

    Attributes:
        file_bytes: Size of the file.
        token_bytes: Size of one tag, comment or processing instruction.
        depth: Elements open at the same time.
        elements: Elements in the file.
        kept_elements: Elements in one child of the root that is handed out.
        attributes: Attributes of one element.
        characters: Length of one attribute, or of the text of one element.
    """

    file_bytes: int = 1 << 26
    token_bytes: int = 1 << 20
    depth: int = 64
    elements: int = 2_000_000
    kept_elements: int = 250_000
    attributes: int = 64
    characters: int = 4096


Keep = Callable[[str, Mapping[str, str]], bool]


def elements(
    path: Path,
    *,
    root: str,
    keep: Keep,
    skip: frozenset[str] = frozenset(),
    text: bool = False,
    limits: Limits | None = None,
) -> Iterator[Element]:
    """The root of a document, without children, then each wanted child of the root, complete.

    The document is read while the elements are taken; only when the iterator has ended is it known
    to be well-formed to its end.

    Args:
        path: The file.
        root: Name that the root must have.
        keep: Says from name and attributes whether a child of the root is wanted.
        skip: Names of elements that are left out of the wanted children, with all inside them.
        text: Whether the text inside the elements is wanted.
        limits: Sizes that are refused.

    Raises:
        ImportFormatError: The file is missing, no such XML, or larger than the limits.
    """
    bounds = limits or Limits()
    builder = _Builder(
        file=shown(path.name, length=80), root=root, keep=keep, skip=skip, text=text, limits=bounds
    )
    total = 0
    with _opened(path, bounds) as stream:
        while chunk := stream.read(_CHUNK_BYTES):
            if total == 0:
                _check_start(builder, chunk)
            total += len(chunk)
            builder.feed(chunk, total)
            yield from builder.finished()
    builder.close()
    yield from builder.finished()


def _opened(path: Path, limits: Limits) -> BinaryIO:
    """The file, open, if it is a plain one of bounded size; a pipe or device is not touched."""

    def refused(what: str, expected: str, got: str) -> ImportFormatError:
        return ImportFormatError.of(
            where=shown(str(path), length=120),
            what=what,
            expected=expected,
            got=got,
            next_step="check the path",
        )

    if "\0" in str(path):
        raise refused("cannot be read", "a path", "one with a null character")
    try:
        status = path.stat()
        plain = stat.S_ISREG(status.st_mode)
        stream = path.open("rb") if plain and status.st_size <= limits.file_bytes else None
    except OSError as error:
        raise refused("cannot be read", "a readable file", error.strerror or "an error") from None
    if not plain:
        raise refused("is not a plain file", "an XML file", "a folder, pipe or device")
    if stream is None:
        size = f"{status.st_size} bytes"
        raise refused("is too large", f"at most {limits.file_bytes} bytes", size)
    return stream


def _check_start(builder: "_Builder", chunk: bytes) -> None:
    """Refuse compressed files by their first bytes."""
    for magic, kind in _PACKED.items():
        if chunk.startswith(magic):
            raise builder.error("is compressed", "plain XML", kind, "unpack it first")


class _Builder:
    """Expat's handlers: count, bound, and build the elements that are wanted."""

    def __init__(
        self,
        *,
        file: str,
        root: str,
        keep: Keep,
        skip: frozenset[str],
        text: bool,
        limits: Limits,
    ) -> None:
        self._file, self._root, self._keep, self._skip = file, root, keep, skip
        self._limits = limits
        self._depth = 0
        self._num_elements = 0
        self._num_kept = 0
        self._dropped_below: int | None = None  # Depth of the unwanted element that is open.
        self._stack: list[Element] = []
        self._finished: list[Element] = []
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.XmlDeclHandler = self._declaration
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.EntityDeclHandler = self._doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        if text:
            self._parser.CharacterDataHandler = self._text

    def error(self, what: str, expected: str, got: str, next_step: str) -> ImportFormatError:
        """An error at the place where the parser stands."""
        line = max(self._parser.CurrentLineNumber, 1)
        return ImportFormatError.of(
            where=f"{self._file}: line {line}",
            what=what,
            expected=expected,
            got=got,
            next_step=next_step,
        )

    def feed(self, chunk: bytes, total: int) -> None:
        """Parse the next piece of the file; `total` is the number of bytes up to its end."""
        if total > self._limits.file_bytes:  # The file may grow while it is read.
            raise self._too_large("file", self._limits.file_bytes, "bytes")
        self._parse(chunk, final=False)
        # Expat scans an unfinished token again with every piece: bound it, or a comment of
        # megabytes costs quadratic time.
        if total - max(self._parser.CurrentByteIndex, 0) > self._limits.token_bytes:
            raise self._too_large("tag or comment", self._limits.token_bytes, "bytes")

    def close(self) -> None:
        """Say that the file has ended."""
        self._parse(b"", final=True)

    def finished(self) -> list[Element]:
        """The elements that were completed since the last call."""
        done, self._finished = self._finished, []
        return done

    def _parse(self, chunk: bytes, *, final: bool) -> None:
        try:
            self._parser.Parse(chunk, final)
        except expat.ExpatError as error:
            raise ImportFormatError.of(
                where=f"{self._file}: line {error.lineno}",
                what=f"column {error.offset + 1}",
                expected="well-formed XML",
                got=expat.ErrorString(error.code),
                next_step="check that the file is complete and is XML",
            ) from None

    def _too_large(self, what: str, most: int, unit: str) -> ImportFormatError:
        return self.error(
            f"{what} is too large", f"at most {most} {unit}", "more", "use a smaller file"
        )

    def _declaration(self, version: str, encoding: str | None, standalone: int) -> None:
        del version, standalone
        if encoding is not None and encoding.lower() not in _ENCODINGS:
            raise self.error(
                "encoding",
                " or ".join(sorted(_ENCODINGS)),
                f'"{shown(encoding)}"',
                "save the file as UTF-8",
            )

    def _doctype(self, name: str, *rest: object) -> None:
        del name, rest
        raise self.error(
            "document type", "none: entities are refused", "<!DOCTYPE", "remove the declaration"
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._num_elements += 1
        self._check_sizes(attributes)
        if self._dropped_below is not None:
            return
        if self._depth == 1:
            self._check_root(name)
            self._finished.append(self._element(name, attributes))
            return
        wanted = self._keep(name, attributes) if self._depth == 2 else name not in self._skip
        if not wanted:
            self._dropped_below = self._depth
            return
        self._push(self._element(name, attributes))

    def _end(self, name: str) -> None:
        del name
        if self._dropped_below is None and self._depth > 1:
            done = self._stack.pop()
            if not self._stack:
                self._finished.append(done)
        elif self._dropped_below == self._depth:
            self._dropped_below = None
        self._depth -= 1

    def _text(self, data: str) -> None:
        if self._dropped_below is not None or not self._stack:
            return
        current = self._stack[-1]
        if len(current.text) + len(data) > self._limits.characters:
            raise self._too_large(
                f"text of <{shown(current.name)}>", self._limits.characters, "characters"
            )
        current.text += data

    def _element(self, name: str, attributes: dict[str, str]) -> Element:
        line = self._parser.CurrentLineNumber
        return Element(file=self._file, line=line, name=name, attributes=attributes)

    def _push(self, element: Element) -> None:
        """Put an element below the one that is open."""
        self._num_kept = self._num_kept + 1 if self._stack else 1
        if self._num_kept > self._limits.kept_elements:
            name = shown(self._stack[0].name)
            raise self._too_large(f"<{name}>", self._limits.kept_elements, "elements in it")
        if self._stack:
            self._stack[-1].children.append(element)
        self._stack.append(element)

    def _check_sizes(self, attributes: dict[str, str]) -> None:
        if self._depth > self._limits.depth:
            raise self._too_large("nesting", self._limits.depth, "elements deep")
        if self._num_elements > self._limits.elements:
            raise self._too_large("file", self._limits.elements, "elements")
        if len(attributes) > self._limits.attributes:
            raise self._too_large("tag", self._limits.attributes, "attributes")
        for value in attributes.values():
            if len(value) > self._limits.characters:
                raise self._too_large("attribute", self._limits.characters, "characters")

    def _check_root(self, name: str) -> None:
        if name != self._root:
            raise self.error(
                "root element", f"<{self._root}>", f"<{shown(name)}>", "choose another file"
            )
