"""Checks input once, at the door: fields of batches, arguments of public functions."""

import inspect
import types
from collections.abc import Callable, Iterator
from functools import cache, wraps
from typing import Annotated, Any, NoReturn, ParamSpec, TypeVar, get_args, get_origin
from typing import get_type_hints as type_hints

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError
from overtaking.model import values
from overtaking.model.batch import Batch
from overtaking.model.values import Axes, Declaration, Range

P = ParamSpec("P")
T = TypeVar("T")


def check(one: Any, where: str, name: str = "") -> None:
    """Hold a dataclass, and the batches in it, to the types, axes and ranges that they declare.

    Args:
        one: A batch, or another dataclass.
        where: The function or object that needs it, for the message.
        name: Name of the argument, empty where fields are named alone.

    Raises:
        ConfigError: A field holds something else; the message names the first place.
    """
    door = _Door(where)
    door.check_types(one, name)
    door.check_values(one, name)


def checked(function: Callable[P, T]) -> Callable[P, T]:
    """The function, with its arguments held to their annotations before it begins.

    Iterables are handed on as tuples, because some can be read only once.

    Raises:
        ConfigError: An argument is something else.
    """
    signature = inspect.signature(function)
    where = function.__qualname__.lstrip("_")

    @cache
    def hints() -> dict[str, Any]:
        found = {
            name: one.annotation
            for name, one in signature.parameters.items()
            if one.annotation is not one.empty and one.kind is not one.VAR_KEYWORD
        }
        # Not of the function itself: what it returns may be imported for type checkers alone.
        asked = types.SimpleNamespace(__annotations__=found)
        spaces = getattr(function, "__globals__", {})
        return type_hints(asked, globalns=spaces, include_extras=True)

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        given = signature.bind(*args, **kwargs)
        for name, hint in hints().items():
            if name in given.arguments:
                given.arguments[name] = argument(given.arguments[name], hint, where, name)
        return function(*given.args, **given.kwargs)

    return called


def argument(value: Any, hint: Any, where: str, name: str) -> Any:
    """One argument, held to its annotation.

    Args:
        value: The argument.
        hint: Its annotation.
        where: The function.
        name: The parameter.

    Returns:
        The argument, or a tuple of the items of an iterable.

    Raises:
        ConfigError: It is something else.
    """
    taken = _Door(where).plain(value, hint, name)
    if isinstance(taken, Batch) and not taken.IS_DERIVED:
        check(taken, where, name)
    return taken


class _Door:
    """The checks of one call."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._sizes: dict[str | int, tuple[int, str]] = {}  # Length, and the field that has it.

    def check_types(self, one: Any, name: str) -> None:
        """Refuse fields of another type, dtype or shape."""
        for field, value, path in _fields(one, name):
            if field.dtype is not None and not (field.is_optional and value is None):
                self._check_array(value, field, path)
                continue
            self.plain(value, field.type, path)
            if isinstance(value, Batch):
                self.check_types(value, path)
            elif field.range is not None:
                self._check_number(value, field.range, path)
        if isinstance(one, Batch):
            self._sizes |= {axis: (size, "road") for axis, size in one.sizes().items()}

    def check_values(self, one: Any, name: str) -> None:
        """Refuse arrays with a value out of range, and batches that break a constraint."""
        if not isinstance(one, Batch):
            return
        for field, value, path in _fields(one, name):
            if isinstance(value, Batch):
                self.check_values(value, path)
            elif isinstance(value, np.ndarray) and field.range is not None:
                self._check_range(value, field, field.range, path)
        for demand in one.constraints():
            if np.any(demand.broken):
                index = _first(demand.broken)
                axes = values.declarations(type(one))[demand.field].axes
                got = _at(index, demand.got[index], axes)
                self._refuse(_path(name, demand.field), demand.expected, got)

    def plain(self, value: Any, hint: Any, name: str) -> Any:
        """A value of an annotated type; iterables become tuples."""
        extras: list[Range] = []
        if get_origin(hint) is Annotated:
            hint, *extras = get_args(hint)
        taken = values.taken(value, hint)
        if taken is values.REFUSED:
            self._refuse(name, values.expected(hint), values.shown(value))
        for allowed in extras:
            self._check_number(value, allowed, name)
        return taken

    def _check_number(self, value: Any, allowed: Range, name: str) -> None:
        high = self._high(allowed)
        if value is not None and allowed.outside(value, high):
            self._refuse(name, allowed.described(high), values.number(value))

    def _check_array(self, value: Any, field: Declaration, name: str) -> None:
        axes = ", ".join(str(axis) for axis in field.axes)
        expected = f"an array of {field.dtype} with the axes ({axes})"
        if type(value) not in (np.ndarray, np.memmap) or value.dtype != field.dtype:
            self._refuse(name, expected, values.shown(value))
        if value.ndim != len(field.axes):
            self._refuse(name, expected, f"the shape {value.shape}")
        for axis, size in zip(field.axes, value.shape, strict=True):
            default = (axis, "") if isinstance(axis, int) else (size, name)
            length, by = self._sizes.setdefault(axis, default)
            if size != length:
                end = f", as {by} has" if by else ""
                self._refuse(name, f"length {length} along {axis}{end}", size)

    def _check_range(
        self, array: NDArray[Any], field: Declaration, allowed: Range, name: str
    ) -> None:
        high = self._high(allowed)
        if not allowed.holds_all(array, high):
            index = _first(allowed.outside(array, high))
            self._refuse(name, allowed.described(high), _at(index, array[index], field.axes))

    def _high(self, allowed: Range) -> float:
        return self._sizes[allowed.high][0] - 1 if isinstance(allowed.high, str) else allowed.high

    def _refuse(self, what: str, expected: str, got: object) -> NoReturn:
        raise ConfigError.of(
            what=what, where=self._where, expected=expected, got=got, next_step="correct it"
        )


def _fields(one: Any, name: str) -> Iterator[tuple[Declaration, Any, str]]:
    """The fields of a dataclass: what they declare, what they hold, and where they are."""
    for field, declared in values.declarations(type(one)).items():
        yield declared, getattr(one, field), _path(name, field)


def _path(name: str, field: str) -> str:
    return f"{name}.{field}" if name else field


def _first(wrong: NDArray[np.bool_]) -> tuple[int, ...]:
    """The first place of an array that is true."""
    return tuple(int(i) for i in np.unravel_index(int(wrong.argmax()), wrong.shape))


def _at(index: tuple[int, ...], value: Any, axes: Axes) -> str:
    """A value and its place, such as `-5 in simulation 3, vehicle 2`."""
    names = [axis if isinstance(axis, str) else "entry" for axis in axes]
    text = ", ".join(f"{name} {i}" for name, i in zip(names, index, strict=False))
    return f"{values.number(value)} in {text}" if text else values.number(value)
