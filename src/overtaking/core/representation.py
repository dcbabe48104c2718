"""Objects as JSON values, one-line representations, counts in words."""

import contextlib
import dataclasses
import math
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

_SURROGATE = re.compile("[\ud800-\udfff]")


def format_count(number: int, noun: str) -> str:
    """A number with its noun.

    Args:
        number: The number.
        noun: The noun in the singular; its plural ends in s.

    Examples:
        >>> format_count(1, "simulation"), format_count(1000, "simulation")
        ('1 simulation', '1,000 simulations')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def as_utf8(text: str) -> str:
    r"""A text that UTF-8 can hold: bytes of a file name that are not UTF-8 become `\xe9`.

    Python keeps such bytes of a name as surrogates, which no file in UTF-8 can hold.
    """
    return _SURROGATE.sub(_escape, text)


def _escape(surrogate: re.Match[str]) -> str:
    code = ord(surrogate.group())
    # Python adds 0xDC00 to the byte (PEP 383).
    return f"\\x{code - 0xDC00:02x}" if 0xDC80 <= code <= 0xDCFF else f"\\u{code:04x}"


def json_values(value: Any) -> Any:
    """A value as JSON has it.

    Args:
        value: Dataclasses become objects with the names of their fields; arrays and tuples become
            lists; bytes become hexadecimal text; NaN and infinities become null; anything else that
            JSON does not have becomes text.
    """
    # Not at the top of the module: the help of commands, which prints no arrays, loads no NumPy.
    import numpy as np

    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
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
_LINE_WIDTH = 100  # Wider tables continue below.
_PLAIN = (str, int, float, Path)


class CompactRepr:
    """Base of dataclasses whose `repr` is a summary, because their arrays are large."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Keep the `repr` of a summarized base, where `dataclass` would write one of all fields."""
        super().__init_subclass__()
        if "__repr__" not in vars(cls):
            summarized = [base for base in cls.__mro__ if issubclass(base, CompactRepr)]
            cls.__repr__ = next(base.__repr__ for base in summarized if "__repr__" in vars(base))

    def summary(self) -> Mapping[str, object]:
        """Names and values to show: a number or a text as it is, of a collection its length."""
        import numpy as np  # As in `json_values`.

        summary: dict[str, object] = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            with contextlib.suppress(
                AttributeError
            ):  # A field that is not computed yet is left out.
                value = object.__getattribute__(self, field.name)
                if isinstance(value, np.ndarray):  # The first axis of all arrays is simulation.
                    summary.setdefault("simulations", len(value))
                elif isinstance(value, _PLAIN):
                    summary[field.name] = value
                elif isinstance(value, tuple | list | dict | frozenset):
                    summary[field.name] = len(value)
        return summary

    def __repr__(self) -> str:
        """The summary in one line."""
        entries = ", ".join(f"{name}={value!r}" for name, value in self.summary().items())
        return f"{type(self).__name__}({entries})"

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        rows = "".join(
            f'<tr><th scope="row">{escape(name)}</th><td>{escape(str(value))}</td></tr>'
            for name, value in self.summary().items()
        )
        return f"<table><caption>{type(self).__name__}</caption><tbody>{rows}</tbody></table>"


class ShownAsTable(CompactRepr):
    """Base of dataclasses that show their rows below the summary."""

    __slots__ = ()

    def to_pandas(self) -> Any:
        """The rows as a DataFrame."""
        raise NotImplementedError

    def __repr__(self) -> str:
        """The summary in one line, and the first and last rows with all columns."""
        rows = self.to_pandas().to_string(
            max_rows=MAX_SHOWN_ROWS, max_colwidth=MAX_SHOWN_CHARACTERS, line_width=_LINE_WIDTH
        )
        return f"{super().__repr__()}\n{rows}"

    def _repr_html_(self) -> str:
        """The same for notebooks."""
        rows = self.to_pandas().to_html(max_rows=MAX_SHOWN_ROWS)
        return f"<p>{escape(super().__repr__())}</p>{rows}"
