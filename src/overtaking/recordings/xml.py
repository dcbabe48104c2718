"""XML files of unknown origin, one child of the root at a time, in bounded memory.

The standard library's expat parses the file in pieces. Only the wanted children of the root become
`Element`s, with typed access whose errors name the line. A document type is refused before any
entity in it is declared, and nothing that a document names is opened. What expat does not bound
itself is bounded here, see `Limits`.
"""

import math
import re
import stat
import xml.parsers.expat as expat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import quoteattr

from overtaking.core.errors import ImportFormatError
from overtaking.core.files import unreadable_error
from overtaking.recordings.messages import refused, shown

# xs:double without INF and NaN; Python's own float() would also take "1_0", "infinity" and the
# digits of other scripts.
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
WHITE_SPACE = " \t\r\n"
"""What XML calls white space."""

_UNWRITABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What no XML 1.0 document may hold, however it is escaped (section 2.2)."""

_MAX_NUMBER_CHARACTERS = 64
MAX_MAGNITUDE = 1.0e8
"""Larger numbers are refused: no metre, radian or second on Earth needs them."""


@dataclass(slots=True, kw_only=True)
class Element:
    """An element of a document, with what is needed to say where it stands.

    Attributes:
        file: Name of the file, and of what in it the element belongs to, for messages.
        line: Line of its start tag, from 1.
        name: Tag.
        attributes: Attributes by name.
        children: Child elements in the order of the document.
        text: Characters directly inside it, without white space at its ends.
    """

    file: str
    line: int
    name: str
    attributes: Mapping[str, str]
    children: "list[Element]" = field(default_factory=list)
    text: str = ""

    def error(
        self, what: str, expected: str, got: str, next_step: str = "repair the file"
    ) -> ImportFormatError:
        """An error that names the file, the line and this element."""
        where = f"{self.file}: line {self.line}"
        return refused(where, f"<{shown(self.name)}> {what}", expected, got, next_step)

    def belongs_to(self, owner: str) -> None:
        """Name in all messages of this element and those below it what they are part of."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            element.file = f"{element.file}: {owner}"
            waiting += element.children

    def all(self, name: str) -> "list[Element]":
        """Every child of that name."""
        return [child for child in self.children if child.name == name]

    def optional(self, name: str) -> "Element | None":
        """The only child of that name, or None; ImportFormatError if there are several."""
        found = self.all(name)
        if len(found) > 1:
            raise found[1].error("is there twice", f"at most one in <{self.name}>", str(len(found)))
        return found[0] if found else None

    def required(self, name: str) -> "Element":
        """The only child of that name; ImportFormatError if there is none or several."""
        found = self.optional(name)
        if found is None:
            raise self.error("is incomplete", f"a <{name}> in it", "none")
        return found

    def attribute(self, name: str, *, default: str | None = None) -> str:
        """An attribute as text; ImportFormatError if it is missing and has no default."""
        value = self.attributes.get(name, default)
        if value is None:
            raise self.error("is incomplete", f"an attribute {name}", "none")
        return value

    def number(self, name: str, *, default: float | None = None) -> float:
        """An attribute as a finite number; ImportFormatError if it is none."""
        if default is not None and name not in self.attributes:
            return default
        return self.parse_number(self.attribute(name), what=f"attribute {name}")

    def integer(self, name: str) -> int:
        """An attribute as an integer of at most nine digits; ImportFormatError if it is none."""
        text = self.attribute(name).strip(WHITE_SPACE)
        if not re.fullmatch(r"[+-]?[0-9]{1,9}", text):
            raise self._no_number(f"attribute {name}", "an integer", text)
        return int(text)

    def value(self) -> float:
        """The text of this element as a finite number; ImportFormatError if it is none."""
        return self.parse_number(self.text, what="text")

    def parse_number(self, text: str, *, what: str) -> float:
        """A text of this element as a finite number; ImportFormatError if it is none."""
        stripped = text.strip(WHITE_SPACE)
        if len(stripped) > _MAX_NUMBER_CHARACTERS or not _NUMBER.fullmatch(stripped):
            raise self._no_number(what, "a finite number", text)
        value = float(stripped)
        if not math.isfinite(value) or abs(value) > MAX_MAGNITUDE:
            raise self._no_number(what, f"a number of size at most {MAX_MAGNITUDE:g}", text)
        return value

    def _no_number(self, what: str, expected: str, got: str) -> ImportFormatError:
        return self.error(what, expected, f'"{shown(got)}"')


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
        refusal = unreadable_error(error, where, ImportFormatError)
        reason = error.strerror or "an error"
        raise refusal or refused(
            where, "cannot be read", "a readable file", reason, check
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


def quoted(text: str) -> str:
    """Text as the value of an attribute, in quotes; U+FFFD for what XML cannot hold."""
    return quoteattr(_UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", text))
