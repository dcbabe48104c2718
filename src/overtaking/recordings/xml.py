"""XML files of unknown origin, one child of the root at a time, in bounded memory.

The standard library's expat parses the file in pieces. Only the wanted children of the root become
`Element`s. A document type is refused before any entity in it is declared, and nothing that a
document names is opened. What expat does not bound itself is bounded here, see `Limits`.
"""

import stat
import xml.parsers.expat as expat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.messages import refused, shown
from overtaking.recordings.xml_element import WHITE_SPACE, Element

_CHUNK_BYTES = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Sizes beyond which a document is refused.

    The defaults are about twenty times what the largest map or recording tried needs.

    Attributes:
        file_bytes: Size of the file.
        token_bytes: Size of one tag, comment or processing instruction.
        names: Different names of elements and attributes.
        elements: Elements in the file.
        kept: Elements and attributes in one child of the root that is handed out.
        characters: Length of one attribute, or of the text of one element without white space at
            its ends.
    """

    file_bytes: int = 1 << 26
    token_bytes: int = 1 << 20
    names: int = 10_000
    elements: int = 2_000_000
    kept: int = 250_000
    characters: int = 4096


Keep = Callable[[str, Mapping[str, str]], bool]


def elements(
    path: Path,
    *,
    root: str,
    keep: Keep,
    skip: frozenset[str] = frozenset(),
    limits: Limits | None = None,
) -> Iterator[Element]:
    """The root of a document, without children, then each wanted child of the root, complete.

    The file is read as the iterator advances; it is known to be well-formed once the iterator ends.

    Args:
        path: The file.
        root: Name that the root must have.
        keep: Says from name and attributes whether a child of the root is wanted.
        skip: Names of elements that are left out of the wanted children, with all inside them.
        limits: Sizes that are refused.

    Raises:
        ImportFormatError: The file is missing, is not such XML, or exceeds the limits.
    """
    bounds = limits or Limits()
    builder = _Builder(shown(path.name, length=80), root, keep, skip, bounds)
    with _opened(path, bounds) as stream:
        while chunk := stream.read(_CHUNK_BYTES):
            builder.feed(chunk)
            yield from builder.finished()
    builder.parse(b"", final=True)
    yield from builder.finished()


def _opened(path: Path, limits: Limits) -> BinaryIO:
    """The file, open, if it is a plain one of bounded size; a pipe or device is not touched."""
    where, check = shown(str(path), length=120), "check the path"
    if "\0" in str(path):
        raise refused(where, "cannot be read", "a path", "one with a null character", check)
    try:
        status = path.stat()
        plain = stat.S_ISREG(status.st_mode)
        stream = path.open("rb") if plain and status.st_size <= limits.file_bytes else None
    except OSError as error:
        raise refused(
            where, "cannot be read", "a readable file", error.strerror or "an error", check
        ) from None
    if not plain:
        raise refused(
            where, "is not a plain file", "an XML file", "a folder, pipe or device", check
        )
    if stream is None:
        got, most = f"{status.st_size} bytes", f"at most {limits.file_bytes} bytes"
        raise refused(where, "is too large", most, got, check)
    return stream


class _Builder:
    """Expat's handlers: they count, refuse what exceeds the limits, and build `Element`s."""

    def __init__(
        self, file: str, root: str, keep: Keep, skip: frozenset[str], limits: Limits
    ) -> None:
        self._file, self._root, self._keep, self._skip = file, root, keep, skip
        self._limits = limits
        self._num_bytes = self._num_elements = self._num_kept = 0
        self._open: list[Element | None] = []  # None stands for an element that is not wanted.
        self._finished: list[Element] = []
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text

    def feed(self, chunk: bytes) -> None:
        """Parse the next piece of the file."""
        self._num_bytes += len(chunk)  # The file may grow while it is read.
        self._check_size("file", self._num_bytes, self._limits.file_bytes, "bytes")
        self.parse(chunk)
        # Expat before 2.6 scans an unfinished token again with every piece: quadratic time.
        unfinished = self._num_bytes - max(self._parser.CurrentByteIndex, 0)
        self._check_size("tag or comment", unfinished, self._limits.token_bytes, "bytes")
        self._check_size("file", len(self._parser.intern), self._limits.names, "names")

    def parse(self, chunk: bytes, *, final: bool = False) -> None:
        """Parse some bytes, and say whether they are the last."""
        try:
            self._parser.Parse(chunk, final)
        except ImportFormatError:
            raise
        except (expat.ExpatError, LookupError, ValueError) as error:
            # An encoding that Python does not know, or that has several bytes a character, is no
            # ExpatError.
            got = expat.ErrorString(error.code) if isinstance(error, expat.ExpatError) else error
            raise self._error(
                f"column {self._parser.ErrorColumnNumber + 1}",
                "well-formed XML",
                str(got),
                "check that the file is complete, not compressed, and UTF-8",
            ) from None

    def finished(self) -> list[Element]:
        """The elements that were completed since the last call."""
        done, self._finished = self._finished, []
        return done

    def _doctype(self, *declaration: object) -> None:
        del declaration
        raise self._error(
            "document type", "none: entities are refused", "<!DOCTYPE", "remove the declaration"
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._num_elements += 1
        self._check_size("file", self._num_elements, self._limits.elements, "elements")
        for value in attributes.values():
            self._check_size("attribute", len(value), self._limits.characters, "characters")
        parent = self._open[-1] if self._open else None
        if self._is_wanted(name, attributes, parent):
            line = self._parser.CurrentLineNumber
            element = Element(file=self._file, line=line, name=name, attributes=attributes)
            self._add(element, parent)
            self._open.append(element)
        else:
            self._open.append(None)

    def _is_wanted(self, name: str, attributes: dict[str, str], parent: Element | None) -> bool:
        if not self._open:
            if name != self._root:
                raise self._error(
                    "root element", f"<{self._root}>", f"<{shown(name)}>", "choose another file"
                )
            return True
        if len(self._open) == 1:
            return self._keep(name, attributes)
        return parent is not None and name not in self._skip

    def _add(self, element: Element, parent: Element | None) -> None:
        """Put an element where it belongs; the root stays without children."""
        if parent is None:
            self._finished.append(element)
            return
        if len(self._open) == 1:
            self._num_kept = 0
        else:
            parent.children.append(element)
        self._num_kept += 1 + len(element.attributes)
        what, unit = f"child of <{self._root}>", "elements and attributes"
        self._check_size(what, self._num_kept, self._limits.kept, unit)

    def _end(self, name: str) -> None:
        del name
        done = self._open.pop()
        if done is not None and len(self._open) == 1:
            self._finished.append(done)

    def _text(self, data: str) -> None:
        # White space between elements is layout: it neither counts nor stays.
        text = data.strip(WHITE_SPACE)
        current = self._open[-1]
        if not text or current is None or len(self._open) == 1:
            return
        size = len(current.text) + len(text)
        what = f"text of <{current.name}>"
        self._check_size(what, size, self._limits.characters, "characters")
        current.text += text

    def _check_size(self, what: str, size: int, most: int, unit: str) -> None:
        if size > most:
            raise self._error(
                f"{shown(what)} is too large",
                f"at most {most} {unit}",
                "more",
                "use a smaller file",
            )

    def _error(self, what: str, expected: str, got: str, next_step: str) -> ImportFormatError:
        """An error at the place where the parser stands."""
        line = max(self._parser.ErrorLineNumber, 1)
        return refused(f"{self._file}: line {line}", what, expected, got, next_step)
