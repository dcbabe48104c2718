"""Declarations of fields: range, axes, unit and meaning. Types of values, and words for messages.

A field of a dataclass is declared once, in its annotation (`Annotated[F32, within(0.0, 1.0)]`, or
`meant`, or `along`). An argument of a function states its range there (`Annotated[int, Range(0,
9)]`). `model.checks` checks both. Specifications, table columns and reference pages read
`declarations`.
"""

import inspect
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

Cls = TypeVar("Cls", bound=type)

Axes = tuple[str | int, ...]

REFUSED = object()
"""What `taken` gives for a value of another type."""

_PLAIN: dict[Any, tuple[Any, str]] = {
    int: (Integral, "a whole number"),
    float: (Real, "a number"),
    bool: (bool | np.bool_, "True or False"),
    str: (str, "a text"),
    Path: (Path, "a path"),
    types.NoneType: (types.NoneType, "None"),
}
"""Required type of a plain value, and its name in messages."""


@dataclass(frozen=True, slots=True)
class Range:
    """The values that a number, or every number of an array, may have.

    Attributes:
        low: Smallest value.
        high: Largest value, or the name of an axis whose indices are meant.
        unit: Unit, empty for plain numbers.
        also: One more value, which stands for nothing.
        is_open: Whether the smallest value itself is left out.
    """

    low: float
    high: float | str
    unit: str = ""
    also: int | None = None
    is_open: bool = False

    def described(self, high: float) -> str:
        """The range in words."""
        # The unit of a step begins with a number.
        unit = f"{' steps of' if self.unit[0].isdigit() else ''} {self.unit}" if self.unit else ""
        if high == math.inf:
            return f"{number(self.low)}{unit} or more"
        if self.is_open:
            return f"more than {number(self.low)} and at most {number(high)}{unit}"
        end = "" if self.also is None else f", or {self.also}"
        return f"{number(self.low)} to {number(high)}{unit}{end}"

    def outside(self, values: Any, high: float) -> Any:
        """Which values are not in the range, in the shape of `values`; NaN is in none."""
        above = values > self.low if self.is_open else values >= self.low
        inside = above & (values <= high)
        return np.logical_not(inside if self.also is None else inside | (values == self.also))

    def holds_all(self, values: NDArray[Any], high: float) -> bool:
        """Whether every value is in the range."""
        if self.also is not None or self.is_open:
            return not self.outside(values, high).any()
        return not values.size or bool(self.low <= values.min() and values.max() <= high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Declaration:
    """What a field of a dataclass declares with `within`, `meant` or `along`.

    Attributes:
        meaning: What the field is, a phrase without unit or full stop; empty if not stated.
        unit: Unit, `1` for plain numbers and flags.
        range: Range of its values, if it has one.
        axes: Axes of an array; those of its class (`Batch.AXES`) if left out.
        column: Name of its table column without the unit, or what the columns of a nested batch
            begin with; None for a field without a column.
        present: Path of the field that says where there is a value: from the outermost batch, or
            from this one if it begins with a dot. Empty if there is a value everywhere.
        needs: What must be known of a recording, names of `model.trajectory.UNKNOWNS`.
        names: Names of its codes, if it is an enumeration.
        since: Version of the tables that its column came with.
        type: Its annotated type.
        dtype: The dtype of an array, None for anything else.
    """

    meaning: str = ""
    unit: str = "1"
    range: Range | None = None
    axes: Axes = ()
    column: str | None = "{}"
    present: str = ""
    needs: Sequence[str] = ()
    names: Sequence[str] = ()
    since: int = 1
    type: Any = None
    dtype: np.dtype[Any] | None = None

    @property
    def is_flag(self) -> bool:
        """Whether its values are yes or no."""
        return self.dtype == np.bool_

    @property
    def is_optional(self) -> bool:
        """Whether it may be None."""
        return types.NoneType in choices(self.type)


def within(
    low: float,
    high: float | str,
    unit: str = "",
    meaning: str = "",
    *,
    axes: Axes = (),
    also: int | None = None,
    is_open: bool = False,
    column: str | None = "{}",
    needs: Sequence[str] = (),
    since: int = 1,
) -> Declaration:
    """Declaration of a field whose values have a range.

    Args:
        low: Smallest value.
        high: Largest value, or the name of an axis whose indices are meant.
        unit: Unit, empty for plain numbers.
        meaning: See `Declaration`.
        axes: See `Declaration`.
        also: One more value, which stands for nothing.
        is_open: Whether the smallest value itself is left out.
        column: See `meant`.
        needs: See `Declaration`.
        since: See `Declaration`.
    """
    return Declaration(
        meaning=meaning,
        unit=unit or "1",
        range=Range(low, high, unit, also, is_open),
        axes=axes,
        column=column,
        needs=needs,
        since=since,
    )


def meant(
    meaning: str,
    unit: str = "1",
    *,
    column: str | None = "{}",
    present: str = "",
    needs: Sequence[str] = (),
    names: Sequence[str] = (),
    since: int = 1,
) -> Declaration:
    """Declaration of a field without a range, such as a flag or a derived measure.

    Args:
        meaning: See `Declaration`.
        unit: See `Declaration`.
        column: See `Declaration`; `{}` stands for the name of the field.
        present: See `Declaration`.
        needs: See `Declaration`.
        names: See `Declaration`.
        since: See `Declaration`.
    """
    return Declaration(
        meaning=meaning,
        unit=unit,
        column=column,
        present=present,
        needs=needs,
        names=names,
        since=since,
    )


def along(*axes: str | int) -> Declaration:
    """Declaration of an array whose axes are not those of its class; a number is a fixed length."""
    return Declaration(axes=axes)


@cache
def declarations(cls: type) -> dict[str, Declaration]:
    """What each field of a dataclass declares, by its name, in their order."""
    return {field.name: _declaration(cls, field) for field in fields(cls)}


def _declaration(cls: type, field: Field[Any]) -> Declaration:
    """What a field declares, with the defaults of its class filled in."""
    metadata, dtype = tuple(_metadata(field.type)), dtype_of(field.type)
    if dtype is None and "ndarray" in repr(without_metadata(field.type)).lower():
        raise TypeError(f"{cls.__name__}.{field.name}: expected an array type of core.arrays")
    declared = next((item for item in metadata if isinstance(item, Declaration)), Declaration())
    return replace(
        declared,
        type=without_metadata(field.type),
        dtype=dtype,
        column=declared.column and declared.column.format(field.name),
        axes=declared.axes or getattr(cls, "AXES", ()),
    )


def _metadata(annotation: Any) -> Iterator[object]:
    """What `Annotated` attaches to an annotation, then to the members of its union."""
    # Nested `Annotated` need no search, because Python joins their metadata.
    if get_origin(annotation) is Annotated:
        yield from annotation.__metadata__
    for member in choices(without_metadata(annotation)):
        if get_origin(member) is Annotated:
            yield from member.__metadata__


def without_metadata(annotation: Any) -> Any:
    """The type that an annotation names."""
    return annotation.__origin__ if get_origin(annotation) is Annotated else annotation


def dtype_of(annotation: Any) -> np.dtype[Any] | None:
    """The dtype that an array type of `core.arrays` declares; None for any other annotation."""
    return next((item for item in _metadata(annotation) if isinstance(item, np.dtype)), None)


def documented(cls: Cls) -> Cls:
    """A dataclass whose docstring lists its declarations, for `help` and notebooks."""
    lines = [
        f"    {name}: {one.meaning}{'' if one.unit == '1' else f' [{one.unit}]'}."
        for name, one in declarations(cls).items()
    ]
    if cls.__doc__:  # None under `python -OO`.
        # Python 3.13 removes the indentation of docstrings, earlier versions keep it.
        cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__), "", "Attributes:", *lines, ""])
    return cls


def choices(hint: Any) -> tuple[Any, ...]:
    """The members of a union, or the type itself."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def taken(value: Any, hint: Any) -> Any:
    """A value of an annotated type, or `REFUSED`; what an iterable gives becomes a tuple."""
    if len(several := choices(hint)) > 1:
        found = (taken(value, one) for one in several)
        return next((one for one in found if one is not REFUSED), REFUSED)
    if (dtype := dtype_of(hint)) is not None:
        return value if isinstance(value, np.ndarray) and value.dtype == dtype else REFUSED
    hint = without_metadata(hint)
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if hint in _PLAIN:
        return value if _is_plain(value, hint) else REFUSED
    if hint is Any or (origin is Callable and callable(value)):
        return value
    if isinstance(value, str) or not isinstance(value, origin):
        return REFUSED
    if inner and issubclass(origin, Mapping):
        return value if all(taken(key, inner[0]) is not REFUSED for key in value) else REFUSED
    return _elements(value, inner) if inner else value


def _is_plain(value: Any, hint: Any) -> bool:
    """Whether a value is a number, text, path, flag or None."""
    if isinstance(value, bool | np.bool_):
        return hint is bool
    if isinstance(value, str | Path) and "\0" in str(value):  # No file has such a name.
        return False
    return isinstance(value, _PLAIN[hint][0])


def _elements(value: Iterable[Any], inner: tuple[Any, ...]) -> Any:
    """What an iterable gives; in a tuple of fixed length each element has a type of its own."""
    try:
        given = tuple(value)
    except TypeError:  # An array without axes.
        return REFUSED
    hints = inner if len(inner) > 1 and inner[-1] is not Ellipsis else inner[:1] * len(given)
    if len(hints) != len(given):
        return REFUSED
    found = tuple(taken(one, hint) for one, hint in zip(given, hints, strict=True))
    return REFUSED if any(one is REFUSED for one in found) else found


def expected(hint: Any) -> str:
    """An annotation in words."""
    if len(several := choices(hint)) > 1:
        *others, last = dict.fromkeys(expected(one) for one in several)
        return f"{', '.join(others)} or {last}" if others else last
    if (dtype := dtype_of(hint)) is not None:
        return f"an array of {dtype}"
    hint = without_metadata(hint)
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][1]
    if origin is Callable:
        return "a function"
    if inner and issubclass(origin, Mapping):
        return f"a {origin.__name__} whose keys are each {expected(inner[0])}"
    if inner and issubclass(origin, Iterable):
        return f"several values, each of them {expected(inner[0])}"
    return f"a {origin.__name__}"


def shown(value: Any) -> str:
    """A short description of any value."""
    if isinstance(value, np.ndarray):
        return f"a {type(value).__name__} of {value.dtype} with the shape {value.shape}"
    if value is None or isinstance(value, str | Path | Real):
        return repr(value)
    return f"a {type(value).__name__}"


def number(value: Any) -> str:
    """A number, short; anything else as it is."""
    is_whole = isinstance(value, Integral) or not isinstance(value, Real)
    return str(value) if is_whole else f"{value:g}"
