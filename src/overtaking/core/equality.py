"""Equality by content for objects that hold arrays, tables and NaN."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

_NUMBERS_WITH_NAN = "fcmM"
"""Kinds of NumPy dtypes with NaN or NaT: float, complex, timedelta, datetime."""


class ContentEquality:
    """Base of dataclasses that compare by `is_same_content`.

    An object is hashable if the values of all its fields are hashable. Arrays, tables, lists and
    dicts are not.
    """

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Copy the methods into each subclass, because `dataclass` replaces inherited ones."""
        super().__init_subclass__()
        for name in ("__eq__", "__hash__"):
            if name not in vars(cls):
                setattr(cls, name, getattr(cls, name))

    def __eq__(self, other: object, /) -> bool:
        """Whether the other object has the same class and content."""
        return is_same_content(self, other) if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        """A hash that equal objects share.

        Raises:
            TypeError: The value of a field is not hashable.
        """
        return _hash_content(self)


def is_same_content(first: Any, second: Any) -> bool:
    """Whether two values have the same content; NaN equals NaN.

    Dataclasses are compared field by field, not by their own `==`. Arrays and tables must have the
    same types and shapes.

    Args:
        first: A value of any type.
        second: The value to compare with.
    """
    if first is second:
        return True
    if _is_dataclass_object(first):
        return type(first) is type(second) and all(
            is_same_content(getattr(first, name), getattr(second, name))
            for name in _compared_fields(first)
        )
    if isinstance(first, np.ndarray):
        return isinstance(second, np.ndarray) and _is_same_array(first, second)
    if isinstance(first, Mapping):
        return isinstance(second, Mapping) and _is_same_mapping(first, second)
    if isinstance(first, list | tuple):
        kind = list if isinstance(first, list) else tuple
        return (
            isinstance(second, kind)
            and len(first) == len(second)
            and all(map(is_same_content, first, second))
        )
    # Tables of pandas, which this layer must not import, compare their content with `equals`.
    if hasattr(first, "equals"):
        return type(first) is type(second) and bool(first.equals(second))
    if isinstance(second, np.ndarray) or hasattr(second, "equals"):
        return False
    return _is_same_scalar(first, second)


def _is_same_scalar(first: Any, second: Any) -> bool:
    try:
        return bool(first == second) or (_is_nan(first) and _is_nan(second))
    except TypeError:  # Comparisons with the NA of pandas have no truth value.
        return False


def _is_same_array(first: np.ndarray[Any, Any], second: np.ndarray[Any, Any]) -> bool:
    if first.dtype != second.dtype or first.shape != second.shape:
        return False
    if first.dtype.names is not None:
        return all(_is_same_array(first[name], second[name]) for name in first.dtype.names)
    if first.dtype.kind == "O":
        return is_same_content(first.tolist(), second.tolist())
    return np.array_equal(first, second, equal_nan=first.dtype.kind in _NUMBERS_WITH_NAN)


def _is_same_mapping(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> bool:
    return first.keys() == second.keys() and all(
        is_same_content(value, second[key]) for key, value in first.items()
    )


def _hash_content(value: Any) -> int:
    if _is_dataclass_object(value):
        hashes = [_hash_content(getattr(value, name)) for name in _compared_fields(value)]
        return hash((type(value), *hashes))
    if isinstance(value, tuple):
        return hash(tuple(map(_hash_content, value)))
    number = hash(value)
    # Python hashes a NaN by its identity, but here all NaNs are equal and need the same hash.
    return 0 if _is_nan(value) else number


def _is_nan(value: Any) -> bool:
    """Whether a value is NaN or NaT: only these differ from themselves."""
    try:
        return bool(value != value)
    except TypeError:  # The NA of pandas.
        return False


def _is_dataclass_object(value: object) -> bool:
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def _compared_fields(value: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(value) if field.compare]
