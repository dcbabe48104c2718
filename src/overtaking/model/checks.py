"""Checks of the values that users pass in: arguments of public functions, and batches.

A batch is a dataclass of arrays over many simulations (`model.batch`). Its fields, and the
parameters of public functions, declare type, dtype, axes and range in their annotations, such as
`Annotated[F32, FieldSpec("Speed", "m/s", 0.0, 150.0)]`. The functions here compare values with
these declarations. Public functions have the decorator `check_arguments`. An invalid value raises a
`ConfigError` of one line, such as "simulate: scenario.start_speed: expected 0 to 150 m/s, got nan
in simulation 1, vehicle 0".
"""

import inspect
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, wraps
from numbers import Integral, Real
from pathlib import Path
from typing import (
    Any,
    ParamSpec,
    SupportsIndex,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.core.errors import ConfigError, whole_number
from overtaking.core.files import check_output_path
from overtaking.core.notebook import PROGRESS, show_progress
from overtaking.core.process_limits import check_address_space, explain_refusals
from overtaking.model.batch import (
    Axes,
    AxisEnd,
    Batch,
    BatchField,
    FieldSpec,
    batch_fields,
    declared_dtype,
    field_from_annotation,
    union_members,
    without_metadata,
)

P = ParamSpec("P")
ResultT = TypeVar("ResultT")

OUTPUT = "out"
"""Parameter of functions that write: the path of a file or folder, or the URL of a folder. It must
be UTF-8, because libraries that write files accept no other names."""

_NO_MATCH = object()
"""Result of `_convert` for a value that is not of the annotated type. It is not None, because None
can be a valid value."""

_PLAIN_TYPES: dict[Any, tuple[Any, str]] = {
    int: (SupportsIndex, "a whole number"),  # For messages; `_convert` tests with `whole_number`.
    float: (Real, "a number"),
    bool: (bool | np.bool_, "True or False"),
    str: (str, "a text"),
    Path: (Path, "a path"),
    types.NoneType: (types.NoneType, "None"),
}
"""By annotated type: the type that a value must be an instance of, and its name in messages. The
wider types also accept NumPy's numbers."""


def check_batch(batch: Any, where: str, name: str = "") -> None:
    """Check a dataclass, and the batches in it, against the declarations of their fields.

    The check does not look into tuples. In a dataclass that is no batch, such as a road, it checks
    only the types and ranges of the fields; dataclasses in the fields, such as the lanes of a road,
    check themselves.

    Args:
        batch: A batch, or another dataclass.
        where: The function or object that takes it, for the message.
        name: Name of the argument, with which the message begins the path of a field; if empty,
            the path begins with the field.

    Raises:
        ConfigError: A value is not of its declared type, dtype or shape, is out of range or breaks
            a constraint. The message names the first such field and, in an array, the first such
            element.
    """
    checker = _BatchChecker(where)
    # Structure first: the end of a range may be the length of an axis, which a later field can set,
    # and constraints need arrays of matching shapes.
    checker.check_structure(batch, name)
    checker.check_values(batch, name)


def check_arguments(function: Callable[P, ResultT]) -> Callable[P, ResultT]:
    """Decorate a function so that each call first checks its arguments against their annotations.

    The function receives integers as Python's integers, because NumPy's integers overflow, and
    iterables as tuples, because some can be read only once. If it has a parameter `progress`, a
    notebook shows its progress.

    Args:
        function: A function. Default values, parameters without an annotation, and `**kwargs` are
            not checked.

    Returns:
        The function with checks. It raises `ConfigError` if an argument is of another type or out
        of range, `SystemLimitError` if the system refuses memory, threads or open files, and
        Python's `TypeError` for missing or unknown arguments.
    """
    signature = inspect.signature(function)
    # A public function may pass its options to a private `_name`: messages then omit the "_".
    where = function.__qualname__.lstrip("_")

    @cache  # The first call resolves annotations, when all types of the module are defined.
    def annotations_by_name() -> dict[str, Any]:
        annotations = {
            name: parameter.annotation
            for name, parameter in signature.parameters.items()
            if parameter.annotation is not parameter.empty
            and parameter.kind is not parameter.VAR_KEYWORD
        }
        # Not `get_type_hints(function)`: it would also resolve the type of the result, which some
        # modules import for type checkers only.
        holder = types.SimpleNamespace(__annotations__=annotations)
        namespace = getattr(function, "__globals__", {})  # Only Python functions have it.
        return get_type_hints(holder, globalns=namespace, include_extras=True)

    @wraps(function)
    def checked_function(*args: P.args, **kwargs: P.kwargs) -> ResultT:
        bound = signature.bind(*args, **kwargs)
        # Raises `SystemLimitError` if the memory is too small for libraries and threads; otherwise
        # compiled code would end the process.
        check_address_space(where)
        for name, annotation in annotations_by_name().items():
            if name in bound.arguments:
                argument = bound.arguments[name]
                bound.arguments[name] = check_argument(argument, annotation, where, name)
        with explain_refusals(where):  # Errors of the system become `SystemLimitError`.
            return function(*bound.args, **bound.kwargs)

    # `show_progress` passes a callback that writes to the notebook if the caller passes none.
    return show_progress(checked_function) if PROGRESS in signature.parameters else checked_function


def check_argument(value: Any, annotation: Any, where: str, name: str) -> Any:
    """Check an argument against its annotation.

    Args:
        value: The argument.
        annotation: The annotation of the parameter, with a `FieldSpec` if it has a range.
        where: Name of the function, for the message.
        name: Name of the parameter; for `OUTPUT` the path is checked, too.

    Returns:
        The argument. Integers are Python's, and iterables are tuples, because some can be read
        only once.

    Raises:
        ConfigError: The argument is of another type or out of range, a batch breaks its
            declarations, or an output path is not UTF-8.
    """
    checked_value = _BatchChecker(where).check_value(
        field_from_annotation(name, annotation), value, name
    )
    if name == OUTPUT and isinstance(checked_value, str | Path):
        check_output_path(checked_value)  # Its message names the path instead of the function.
    # Only this package makes internal batches, from checked values.
    if isinstance(checked_value, Batch) and not checked_value.IS_INTERNAL:
        check_batch(checked_value, where, name)
    return checked_value


class _BatchChecker:
    """Checks one argument.

    All arrays in a batch and in its nested batches must agree on the length of each axis, such as
    the number of simulations.

    In its methods `path` is the dotted path of a field in messages, such as
    "scenario.weather.rain".
    """

    def __init__(self, where: str) -> None:
        """Begin without known lengths of axes.

        Args:
            where: The function or object that takes the argument, for messages.
        """
        self._where = where
        # Length of each axis, and the path of the field that set it: the first array with that
        # axis. The path is empty for an axis whose declaration is its length.
        self._axis_lengths: dict[str | int, tuple[int, str]] = {}

    def check_structure(self, batch: Any, path: str) -> None:
        """Refuse fields of another type, dtype or shape, and plain values out of range."""
        for field, value, field_path in _fields_of(batch, path):
            if field.dtype is None:
                self.check_value(field, value, field_path)
            elif not (field.is_optional and value is None):
                self._check_array(field, value, field_path)
            if isinstance(value, Batch):
                self.check_structure(value, field_path)
        if isinstance(batch, Batch):
            # Axes that no array has, such as the lanes of a road: ranges of indices refer to them.
            self._axis_lengths |= {axis: (size, "") for axis, size in batch.axis_lengths().items()}

    def check_values(self, batch: Any, path: str) -> None:
        """Refuse arrays with a value out of range, and batches that break a constraint.

        `check_structure` must have accepted the batch. It has also checked single numbers,
        so a dataclass that is no batch needs no further check.
        """
        if not isinstance(batch, Batch):
            return
        for field, value, field_path in _fields_of(batch, path):
            if isinstance(value, Batch):
                self.check_values(value, field_path)
            elif isinstance(value, np.ndarray) and field.spec.is_bounded:
                self._check_range(field, value, field_path)
        for constraint in batch.constraints():
            if np.any(constraint.broken):
                index = _first_true(constraint.broken)
                axes = batch_fields(type(batch))[constraint.field].axes
                element = _describe_element(constraint.values[index], index, axes)
                raise self._error(_join(path, constraint.field), constraint.expected, element)

    def check_value(self, field: BatchField, value: Any, path: str) -> Any:
        """Refuse a value of another type, or a number out of its range.

        For an array that is itself an argument of a function, the method checks only the dtype: no
        such argument declares a range.

        Returns:
            The value. Integers are Python's, and iterables are tuples.
        """
        converted = _convert(value, field.type)
        if converted is _NO_MATCH:
            raise self._error(path, _describe_type(field.type), _describe_value(value))
        if field.spec.is_bounded and converted is not None:
            high = self._upper_limit(field)
            if not _is_in_range(field.spec, high, converted):
                number_text = _format_number(converted)
                raise self._error(path, _describe_range(field.spec, high), number_text)
        return converted

    def _check_array(self, field: BatchField, value: Any, path: str) -> None:
        """Refuse a value that is no array of the declared dtype, axes and lengths."""
        expected = f"an array of {field.dtype} with the axes ({', '.join(map(str, field.axes))})"
        # Other subclasses are refused, because matrices and masked arrays compute differently.
        if type(value) not in (np.ndarray, np.memmap) or value.dtype != field.dtype:
            raise self._error(path, expected, _describe_value(value))
        if value.ndim != len(field.axes):
            raise self._error(path, expected, f"the shape {value.shape}")
        for axis, size in zip(field.axes, value.shape, strict=True):
            # An axis that is a number has that length. The first array with a named axis sets the
            # length of this axis for all arrays that follow.
            default = (axis, "") if isinstance(axis, int) else (size, path)
            length, set_by = self._axis_lengths.setdefault(axis, default)
            if size != length:
                reason = f", as {set_by} has" if set_by else ""
                raise self._error(path, f"length {length} along {axis}{reason}", size)

    def _check_range(self, field: BatchField, values: NDArray[Any], path: str) -> None:
        """Refuse an array with a value out of range; the message names the first one."""
        high = self._upper_limit(field)
        if not _all_in_range(field.spec, high, values):
            index = _first_true(~_is_in_range(field.spec, high, values))
            element = _describe_element(values[index], index, field.axes)
            raise self._error(path, _describe_range(field.spec, high), element)

    def _upper_limit(self, field: BatchField) -> float:
        """The largest value; for the indices of an axis, its length less one.

        `check_structure` has stored the lengths of all axes that a batch declares.
        """
        high = field.spec.high
        return self._axis_lengths[high.axis][0] - 1 if isinstance(high, AxisEnd) else high

    def _error(self, what: str, expected: str, got: object) -> ConfigError:
        return ConfigError(what=what, where=self._where, expected=expected, got=got)


def _fields_of(batch: Any, path: str) -> Iterator[tuple[BatchField, Any, str]]:
    """Each declared field, its value, and its path, such as `scenario.weather.rain`."""
    for name, field in batch_fields(type(batch)).items():
        yield field, getattr(batch, name), _join(path, name)


def _is_in_range(spec: FieldSpec, high: float, values: Any) -> Any:
    """Whether each value is in the range, or is the declared value for "no value".

    Args:
        spec: The declaration, with the lower limit.
        high: The upper limit; an `AxisEnd` is already replaced by its number.
        values: A number or an array of any shape.

    Returns:
        A bool or a mask of the same shape; False for NaN.
    """
    is_above = values > spec.low if spec.low_is_open else values >= spec.low
    is_inside = is_above & (values <= high)
    return is_inside if spec.missing is None else is_inside | (values == spec.missing)


def _all_in_range(spec: FieldSpec, high: float, values: NDArray[Any]) -> bool:
    """Whether `_is_in_range` holds for every value of an array, computed faster."""
    if spec.missing is None and not spec.low_is_open:
        # Two reductions and no mask; most arrays, among them all large ones, take this path. With a
        # NaN both results are NaN, and no comparison with NaN is true.
        return not values.size or bool(spec.low <= values.min() and values.max() <= high)
    return bool(np.all(_is_in_range(spec, high, values)))


def _describe_range(spec: FieldSpec, high: float) -> str:
    """The range in words, such as `0 to 60 s`, or `-31416 to 31416 steps of 0.1 mrad`."""
    if spec.unit == "1":
        unit = ""
    elif spec.unit.startswith("0."):  # "0 to 5 0.1 mrad" would be unreadable.
        unit = f" steps of {spec.unit}"
    else:
        unit = f" {spec.unit}"
    # No field combines an open lower limit with `missing`, or with an infinite upper limit.
    if high == math.inf:
        return f"{_format_number(spec.low)}{unit} or more"
    if spec.low_is_open:
        return f"more than {_format_number(spec.low)} and at most {_format_number(high)}{unit}"
    alternative = "" if spec.missing is None else f", or {spec.missing}"
    return f"{_format_number(spec.low)} to {_format_number(high)}{unit}{alternative}"


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _first_true(mask: Mask) -> tuple[int, ...]:
    """The index of the first true element, one number per axis."""
    return tuple(int(i) for i in np.unravel_index(int(mask.argmax()), mask.shape))


def _describe_element(value: Any, index: tuple[int, ...], axes: Axes) -> str:
    """A value and its place, such as `-5 in simulation 3, vehicle 2`."""
    names = [axis if isinstance(axis, str) else "entry" for axis in axes]
    # A mask of broken values may have fewer axes than the field.
    place = ", ".join(f"{name} {i}" for name, i in zip(names, index, strict=False))
    return f"{_format_number(value)} in {place}" if place else _format_number(value)


def _convert(value: Any, annotation: Any) -> Any:
    """Compare a value with an annotation, and make integers Python's and iterables tuples.

    Args:
        value: Any value.
        annotation: A type, a union, an array type of `core.arrays`, `Annotated`, or a generic type
            such as `Sequence[str]`.

    Returns:
        The converted value, or `_NO_MATCH` if the value is not of the annotated type.
    """
    if len(members := union_members(annotation)) > 1:
        results = (_convert(value, member) for member in members)
        return next((result for result in results if result is not _NO_MATCH), _NO_MATCH)
    if (dtype := declared_dtype(annotation)) is not None:
        return value if isinstance(value, np.ndarray) and value.dtype == dtype else _NO_MATCH
    plain_type = without_metadata(annotation)
    # For `Sequence[str]` the origin is `Sequence`, and the only element type is `str`.
    origin, element_types = get_origin(plain_type) or plain_type, get_args(plain_type)
    if plain_type is int:
        return _NO_MATCH if (number := whole_number(value)) is None else number
    if plain_type in _PLAIN_TYPES:
        return value if _is_plain(value, plain_type) else _NO_MATCH
    if plain_type is Any or (origin is Callable and callable(value)):
        return value
    # A text is an iterable of texts, but a text for a list of names is a mistake of the caller.
    if isinstance(value, str) or not isinstance(value, origin):
        return _NO_MATCH
    if element_types and issubclass(origin, Mapping):
        # The valid values of a mapping depend on the key, so the called function checks them.
        key_type = element_types[0]
        has_keys = all(_convert(key, key_type) is not _NO_MATCH for key in value)
        return value if has_keys else _NO_MATCH
    return _convert_elements(value, element_types) if element_types else value


def _is_plain(value: Any, plain_type: Any) -> bool:
    """Whether a value is of a type in `_PLAIN_TYPES`."""
    if isinstance(value, bool | np.bool_):  # Python's booleans are integers, too.
        return plain_type is bool
    # The system refuses file names with a null character; in other texts it is a mistake.
    if isinstance(value, str | Path) and "\0" in str(value):
        return False
    return isinstance(value, _PLAIN_TYPES[plain_type][0])


def _convert_elements(value: Iterable[Any], type_arguments: tuple[Any, ...]) -> Any:
    """The elements of an iterable as a tuple, or `_NO_MATCH` if an element has another type.

    Args:
        value: The iterable.
        type_arguments: The types in the brackets of its annotation: one type for all elements, as
            in `Sequence[str]` and `tuple[str, ...]`, or a type for each, as in `tuple[str, int]`.
    """
    try:
        elements = tuple(value)
    except TypeError:  # An array without axes.
        return _NO_MATCH
    has_fixed_length = len(type_arguments) > 1 and type_arguments[-1] is not Ellipsis
    element_types = type_arguments if has_fixed_length else type_arguments[:1] * len(elements)
    if len(element_types) != len(elements):
        return _NO_MATCH
    results = tuple(
        _convert(element, element_type)
        for element, element_type in zip(elements, element_types, strict=True)
    )
    return _NO_MATCH if any(result is _NO_MATCH for result in results) else results


def _describe_type(annotation: Any) -> str:
    """An annotation in words, such as "a text, a path or None"."""
    if len(members := union_members(annotation)) > 1:
        # `dict.fromkeys` removes repetitions and keeps the order.
        *others, last = dict.fromkeys(_describe_type(member) for member in members)
        return f"{', '.join(others)} or {last}" if others else last
    if (dtype := declared_dtype(annotation)) is not None:
        return f"an array of {dtype}"
    plain_type = without_metadata(annotation)
    origin, element_types = get_origin(plain_type) or plain_type, get_args(plain_type)
    if plain_type in _PLAIN_TYPES:
        return _PLAIN_TYPES[plain_type][1]
    if origin is Callable:
        return "a function"
    if element_types and issubclass(origin, Mapping):
        return f"a {origin.__name__} whose keys are each {_describe_type(element_types[0])}"
    if element_types and issubclass(origin, Iterable):
        return f"several values, each of them {_describe_type(element_types[0])}"
    return f"a {origin.__name__}"


def _describe_value(value: Any) -> str:
    """The received value in words: dtype and shape of an array, otherwise the value or its type."""
    if isinstance(value, np.ndarray):
        return f"a {type(value).__name__} of {value.dtype} with the shape {value.shape}"
    if value is None or isinstance(value, str | Path | Real):
        return repr(value)
    return f"a {type(value).__name__}"


def _format_number(value: Any) -> str:
    """A number with at most six significant digits; integers, texts and flags in full."""
    is_whole = isinstance(value, Integral) or not isinstance(value, Real)
    return str(value) if is_whole else f"{value:g}"
