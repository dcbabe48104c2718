"""Short representations of large objects: a line in a terminal, a small table in a notebook."""

import contextlib
import dataclasses
from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

_PLAIN = (str, int, float, Path)


class Summarized:
    """Base of dataclasses whose `repr` shall not show all that they hold."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Keep the short `repr`, where `dataclass` would write one of all fields."""
        super().__init_subclass__()
        cls.__repr__ = Summarized.__repr__

    def summary(self) -> Mapping[str, object]:
        """Names and values to show: fields with one value, and how many the others have."""
        found: dict[str, object] = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            with contextlib.suppress(
                AttributeError
            ):  # A field that is not computed yet is left out.
                value = object.__getattribute__(self, field.name)
                if isinstance(value, np.ndarray):  # All of them lead with this axis.
                    found.setdefault("simulations", len(value))
                elif isinstance(value, _PLAIN):
                    found[field.name] = value
                elif isinstance(value, tuple | list | dict | frozenset):
                    found[field.name] = len(value)
        return found

    def __repr__(self) -> str:
        """The summary in one line."""
        shown = ", ".join(f"{name}={value!r}" for name, value in self.summary().items())
        return f"{type(self).__name__}({shown})"

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        rows = "".join(
            f'<tr><th scope="row">{escape(name)}</th><td>{escape(str(value))}</td></tr>'
            for name, value in self.summary().items()
        )
        return f"<table><caption>{type(self).__name__}</caption><tbody>{rows}</tbody></table>"
