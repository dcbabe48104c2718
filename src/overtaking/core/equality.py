"""Equality by content for objects that hold arrays, tables and NaN.

Results of public functions are dataclasses with NumPy arrays and DataFrames of pandas. The `==`
that `dataclass` writes fails for them, because `==` of two arrays is an array, and it finds two NaN
different. A result inherits `==` and `hash` from `ContentEquality` instead.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

_DTYPE_KINDS_WITH_NAN = "fcmM"
"""Values of `dtype.kind` of arrays that can hold NaN: float, complex, timedelta and datetime. The
NaN of the last two is NaT (not a time). With `equal_nan`, `numpy.array_equal` raises an error for
other kinds, such as text."""


class ContentEquality:
    """Base class of dataclasses whose `==` compares with `is_same_content`.

    As with any dataclass, a field that is declared with `field(compare=False)` does not count. An
    object is hashable if the values of its fields are hashable. Arrays, tables, lists and dicts are
    not.
    """

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Copy `__eq__` and `__hash__` into each subclass.

        The decorator `dataclass` writes its own methods in place of inherited ones, but keeps those
        that the class itself defines. With its own `__eq__`, a class needs its own `__hash__`:
        otherwise `dataclass` sets that to None, or writes another one if the class is frozen.
        """
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
    """Whether two values have the same content; NaN equals NaN, except in Arrow tables.

    Dataclasses need the same class and are compared field by field, not by their own `==`. Arrays
    and tables need the same dtypes and shapes. The order of keys in a mapping does not count. A
    list never equals a tuple, but a named tuple equals a tuple of the same values.

    Args:
        first: A value of any type.
        second: The value to compare with.
    """
    if first is second:
        return True
    if _is_dataclass_object(first):
        return type(first) is type(second) and all(
            is_same_content(getattr(first, name), getattr(second, name))
            for name in _compared_field_names(first)
        )
    if isinstance(first, np.ndarray):
        return isinstance(second, np.ndarray) and _is_same_array(first, second)
    if isinstance(first, Mapping):
        return isinstance(second, Mapping) and _is_same_mapping(first, second)
    if isinstance(first, list | tuple):
        return (
            isinstance(second, list if isinstance(first, list) else tuple)
            and len(first) == len(second)
            and all(map(is_same_content, first, second))
        )
    # DataFrames, Series and Arrow tables compare their content with the method `equals`; with the
    # method of Arrow, NaN differs from NaN. A check of their classes would load pandas and pyarrow,
    # also in calls that need neither.
    if hasattr(first, "equals"):
        return type(first) is type(second) and bool(first.equals(second))
    # The first value is of another type, such as a number, a text or a set. Its `==` with an array
    # or a table would not be True or False.
    if isinstance(second, np.ndarray) or hasattr(second, "equals"):
        return False
    return _is_equal_or_both_nan(first, second)


def _is_equal_or_both_nan(first: Any, second: Any) -> bool:
    try:
        return bool(first == second) or (_is_nan(first) and _is_nan(second))
    except TypeError:  # `==` with the missing value `pandas.NA` is neither true nor false.
        return False


def _is_same_array(first: np.ndarray[Any, Any], second: np.ndarray[Any, Any]) -> bool:
    if first.dtype != second.dtype or first.shape != second.shape:
        return False
    if first.dtype.names is not None:  # A structured array: compare its columns.
        return all(_is_same_array(first[name], second[name]) for name in first.dtype.names)
    if first.dtype.kind == "O":  # Its elements are any Python objects.
        return is_same_content(first.tolist(), second.tolist())
    return np.array_equal(first, second, equal_nan=first.dtype.kind in _DTYPE_KINDS_WITH_NAN)


def _is_same_mapping(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> bool:
    return first.keys() == second.keys() and all(
        is_same_content(value, second[key]) for key, value in first.items()
    )


def _hash_content(value: Any) -> int:
    """A hash that is equal for two values of which `is_same_content` is true."""
    if _is_dataclass_object(value):
        hashes = [_hash_content(getattr(value, name)) for name in _compared_field_names(value)]
        return hash((type(value), *hashes))
    if isinstance(value, tuple):
        return hash(tuple(map(_hash_content, value)))
    # First, so that an array or table raises TypeError here; `_is_nan` would fail differently.
    python_hash = hash(value)
    # Python hashes a NaN by its identity, but here all NaN are equal and need the same hash.
    return 0 if _is_nan(value) else python_hash


def _is_nan(value: Any) -> bool:
    """Whether a value is NaN or NaT, the only values that differ from themselves."""
    try:
        return bool(value != value)
    except TypeError:  # `pandas.NA`, as in `_is_equal_or_both_nan`.
        return False


def _is_dataclass_object(value: object) -> bool:
    """Whether a value is an object of a dataclass; `is_dataclass` accepts the class as well."""
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def _compared_field_names(value: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(value) if field.compare]
