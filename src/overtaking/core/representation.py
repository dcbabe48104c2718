"""Objects as JSON values, short `repr` of objects with large arrays, texts that UTF-8 can hold.

Results of public functions derive from `CompactRepr` or `ShownAsTable`, so that a Python shell
shows one line or a table instead of the values of all arrays, and a notebook shows HTML.
"""

import contextlib
import dataclasses
import math
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

_SURROGATE = re.compile("[\ud800-\udfff]")
"""The code points that Python strings may contain but UTF-8 may not."""


def format_count(number: int, noun: str) -> str:
    """Write a number with its noun, in the singular or the plural.

    Args:
        number: The number, 0 or more.
        noun: The noun in the singular; its plural must be the noun with an s.

    Examples:
        >>> format_count(1, "simulation"), format_count(1000, "simulation")
        ('1 simulation', '1,000 simulations')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def as_utf8(text: str) -> str:
    r"""Replace the characters that no file in UTF-8 can hold by escapes in ASCII.

    A file name on Linux may have bytes that are not UTF-8. Python stores such a byte, for instance
    0xE9, as a surrogate; it becomes the four characters `\xe9`.
    """
    return _SURROGATE.sub(_escape, text)


def _escape(surrogate: re.Match[str]) -> str:
    code = ord(surrogate.group())
    # For a byte of a file name, from 0x80 on, Python adds 0xDC00 (PEP 383). Other surrogates come
    # from faulty text and are shown with their own number.
    return f"\\x{code - 0xDC00:02x}" if 0xDC80 <= code <= 0xDCFF else f"\\u{code:04x}"


def json_values(value: Any) -> Any:
    """Convert a value to the types of JSON, also inside lists, tuples, mappings and dataclasses.

    Args:
        value: Any value.

    Returns:
        None, a bool, int, float, str, list or dict. Dataclasses become dicts by the names of their
        fields, arrays and tuples lists, bytes hexadecimal text. NaN and infinities become None,
        because JSON cannot write them. Values of other types, such as paths, become text.
    """
    # Not at the top of the module: `overtaking --help` needs this module but no arrays, and starts
    # faster without NumPy.
    import numpy as np

    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()  # Lists of Python's numbers; a NumPy scalar becomes one number.
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, bytes | bytearray | memoryview):
        return bytes(value).hex()
    if isinstance(value, Mapping):
        return {str(name): json_values(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    if dataclasses.is_dataclass(value):
        return {
            field.name: json_values(getattr(value, field.name))
            for field in dataclasses.fields(value)
        }
    return str(value)


MAX_SHOWN_ROWS = 60
"""Largest number of rows of a table on the screen, as in pandas."""

MAX_SHOWN_CHARACTERS = 50
"""Largest number of characters of a cell on the screen, as in pandas."""

_LINE_WIDTH = 100
"""Width of a table on the screen [characters]; further columns follow in a block below. Chosen."""

_VALUE_TYPES = (str, int, float, Path)
"""Types of fields that `CompactRepr.summary` shows as they are."""


class CompactRepr:
    """Base class of dataclasses whose `repr` shows `summary()` instead of all values."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Copy the inherited `repr` into each subclass.

        The decorator `dataclass` writes a `repr` of all fields unless the class itself has one.
        """
        super().__init_subclass__()
        if "__repr__" not in vars(cls):
            # Not simply `cls.__repr__`: another base class with a `repr` may come first.
            bases = [base for base in cls.__mro__ if issubclass(base, CompactRepr)]
            cls.__repr__ = next(base.__repr__ for base in bases if "__repr__" in vars(base))

    def summary(self) -> Mapping[str, object]:
        """Names and values to show; subclasses may return others.

        Returns:
            Numbers, texts and paths by the names of their fields, and the lengths of collections.
            "simulations" is the length of the arrays. Fields of other types are left out.
        """
        import numpy as np  # As in `json_values`.

        summary: dict[str, object] = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            # Some classes compute a field at its first use, in `__getattr__`. The method of
            # `object` does not call it, so a field that is not computed yet is left out.
            with contextlib.suppress(AttributeError):
                value = object.__getattribute__(self, field.name)
                if isinstance(value, np.ndarray):  # In results, the first axis is simulation.
                    summary.setdefault("simulations", len(value))
                elif isinstance(value, _VALUE_TYPES):
                    summary[field.name] = value
                elif isinstance(value, tuple | list | dict | frozenset):
                    summary[field.name] = len(value)
        return summary

    def __repr__(self) -> str:
        """The summary in one line."""
        entries = ", ".join(f"{name}={value!r}" for name, value in self.summary().items())
        return f"{type(self).__name__}({entries})"

    def _repr_html_(self) -> str:
        """The summary as a table in HTML; notebooks call this method."""
        rows = "".join(
            f'<tr><th scope="row">{escape(name)}</th><td>{escape(str(value))}</td></tr>'
            for name, value in self.summary().items()
        )
        return f"<table><caption>{type(self).__name__}</caption><tbody>{rows}</tbody></table>"


class ShownAsTable(CompactRepr):
    """Base class of dataclasses with rows, such as tables of results: `repr` shows the rows too."""

    __slots__ = ()

    def to_pandas(self) -> Any:
        """The rows as a DataFrame of pandas; each subclass defines it."""
        raise NotImplementedError

    def __repr__(self) -> str:
        """The summary in one line and, below, the first and last rows with all columns."""
        rows = self.to_pandas().to_string(
            max_rows=MAX_SHOWN_ROWS, max_colwidth=MAX_SHOWN_CHARACTERS, line_width=_LINE_WIDTH
        )
        return f"{super().__repr__()}\n{rows}"

    def _repr_html_(self) -> str:
        """The same in HTML; notebooks call this method."""
        # Unlike `to_string`, `to_html` cuts long cells by default.
        rows = self.to_pandas().to_html(max_rows=MAX_SHOWN_ROWS)
        return f"<p>{escape(super().__repr__())}</p>{rows}"
