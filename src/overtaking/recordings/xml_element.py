"""One element of an XML document, with typed access whose errors name the line."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.messages import refused, shown

# xs:double without INF and NaN; Python's own float() would also take "1_0", "infinity" and the
# digits of other scripts.
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
WHITE_SPACE = " \t\r\n"
"""What XML calls white space."""

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
