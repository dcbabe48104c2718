"""Batches: dataclasses of arrays with declared fields."""

import dataclasses
import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cache, wraps
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
)
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.core.equality import ContentEquality, is_same_content
from overtaking.core.errors import ConfigError, NoSuchSimulationError
from overtaking.core.representation import CompactRepr
from overtaking.model.import_report import joined_findings

B = TypeVar("B", bound="Batch")

Axes = tuple[str | int, ...]
"""Names of the axes of an array; a number is a fixed length."""

_ARRAY_ORIGINS = (np.ndarray, get_origin(NDArray[Any]))
"""Origin of `NDArray[…]` at run time, by version of NumPy; see `core.arrays`."""


@dataclass(frozen=True, slots=True)
class AxisEnd:
    """An upper limit: the last index of an axis, which is its length less one."""

    axis: str


@dataclass(frozen=True, slots=True)
class ColumnName:
    """Name of a table column, without its unit; for a nested batch, the prefix of its columns.

    Attributes:
        name: The name; empty for the name of the field.
        prefix: Text before the name, such as "ego_".
    """

    name: str = ""
    prefix: str = ""

    def for_field(self, field_name: str) -> str:
        """The name for a field."""
        return self.prefix + (self.name or field_name)


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """Declaration of a field of a batch, and of the table column that is written from it.

    Attributes:
        meaning: A phrase without unit and full stop.
        unit: Unit; "1" for plain numbers, codes and flags.
        low: Smallest value.
        high: Largest value.
        low_is_open: Whether `low` itself is excluded.
        missing: One value outside the range that stands for "none"; null in tables.
        axes: Axes of the array; the axes of its class (`Batch.AXES`) if left out.
        column: Name of the column; None for a field that is not written.
        null_unless: Path of the flag or count that says where there is a value: from the outermost
            batch, or from this one if it begins with a dot. The column is null where that flag is
            false, that count 0, or that field has its `missing` value.
        needs: Properties that a recording must state, in `model.trajectories.UNKNOWNS`.
        names: Names of the codes of an enumeration.
        flags: Names of the bits, from the lowest.
        is_key: Whether the column identifies a row.
    """

    meaning: str = ""
    unit: str = "1"
    low: float = -math.inf
    high: float | AxisEnd = math.inf
    _: KW_ONLY
    low_is_open: bool = False
    missing: int | None = None
    axes: Axes | None = None
    column: ColumnName | None = ColumnName()
    null_unless: str = ""
    needs: Sequence[str] = ()
    names: Sequence[str] = ()
    flags: Sequence[str] = ()
    is_key: bool = False

    @property
    def is_bounded(self) -> bool:
        """Whether values are checked against a range; every range has a finite end."""
        return self.low > -math.inf or self.high != math.inf

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value, if the largest one is a number.

        Raises:
            TypeError: The largest value depends on the length of an axis.
        """
        if isinstance(self.high, AxisEnd):
            raise TypeError(f"the largest value depends on the axis {self.high.axis}")
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class BatchField:
    """A field of a batch: its declaration, completed by the defaults of its class.

    Attributes:
        name: Name of the field.
        spec: Its declaration.
        axes: Axes of the array.
        dtype: The dtype of an array; None for anything else.
        type: Its type, without the metadata of `Annotated`.
        column: Name of its column, without the unit; None if it is not written.
    """

    name: str
    spec: FieldSpec
    axes: Axes
    dtype: np.dtype[Any] | None
    type: Any
    column: str | None

    @property
    def is_flag(self) -> bool:
        """Whether its values are yes or no."""
        return self.dtype == np.bool_

    @property
    def is_optional(self) -> bool:
        """Whether it may be None."""
        return NoneType in union_members(self.type)


@cache
def batch_fields(cls: type) -> Mapping[str, BatchField]:
    """The declared fields of a dataclass by name, in their order.

    Fields that comparisons leave out (`compare=False`) are remarks, not declared fields.

    Raises:
        TypeError: A field is an array without a dtype.
    """
    axes = getattr(cls, "AXES", ())
    declared = {
        field.name: field_from_annotation(field.name, field.type, axes)
        for field in dataclasses.fields(cls)
        if field.compare
    }
    for name, field in declared.items():
        origins = {get_origin(member) for member in union_members(field.type)}
        if field.dtype is None and not origins.isdisjoint(_ARRAY_ORIGINS):
            raise TypeError(f"{cls.__name__}.{name}: expected an array type of core.arrays")
    return declared


def field_from_annotation(name: str, annotation: Any, axes: Axes = ()) -> BatchField:
    """A field, or a parameter of a function, as its annotation declares it.

    Args:
        name: Name of the field or parameter.
        annotation: Its annotation, a type or `Annotated` with a `FieldSpec`.
        axes: Axes of an array whose `FieldSpec` states none.
    """
    metadata = tuple(_metadata(annotation))
    spec = next((item for item in metadata if isinstance(item, FieldSpec)), FieldSpec())
    return BatchField(
        name=name,
        spec=spec,
        axes=axes if spec.axes is None else spec.axes,
        dtype=declared_dtype(annotation),
        type=without_metadata(annotation),
        column=None if spec.column is None else spec.column.for_field(name),
    )


def declared_dtype(annotation: Any) -> np.dtype[Any] | None:
    """The dtype that an array type of `core.arrays` declares; None for any other annotation."""
    return next((item for item in _metadata(annotation) if isinstance(item, np.dtype)), None)


def without_metadata(annotation: Any) -> Any:
    """The type of an annotation, without `Annotated`."""
    return annotation.__origin__ if get_origin(annotation) is Annotated else annotation


def union_members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, or the type itself."""
    is_union = get_origin(annotation) in (Union, UnionType)
    return get_args(annotation) if is_union else (annotation,)


def _metadata(annotation: Any) -> Iterator[object]:
    """The metadata of an annotation, then of the members of its union."""
    # The outer `FieldSpec` comes first because it overrides the inner ones, as in
    # `Annotated[F32 | None, FieldSpec(…)]`. Python itself joins the metadata of nested `Annotated`.
    if get_origin(annotation) is Annotated:
        yield from annotation.__metadata__
    for member in union_members(without_metadata(annotation)):
        if get_origin(member) is Annotated:
            yield from member.__metadata__


@dataclass(frozen=True, slots=True)
class Constraint:
    """A condition that several fields of a batch must fulfil together.

    Attributes:
        field: Name of the field that an error message names.
        expected: The expected values, in words.
        broken: Mask of the values that break the condition, along the first axes of the batch.
        values: Values of the field; its shape begins with the shape of `broken`.
    """

    field: str
    expected: str
    broken: Mask
    values: NDArray[Any]


class Batch(CompactRepr, ContentEquality):
    """Base of the frozen dataclasses whose array fields all lead with the `simulation` axis.

    A field may also be another batch, or a tuple of batches. `model.checks` checks batches of
    users against `AXES`, `axis_lengths` and `constraints`.
    """

    __slots__ = ()

    IS_INTERNAL: ClassVar[bool] = False
    """Whether only this package creates it, from checked values, so that it needs no check."""

    AXES: ClassVar[tuple[str | int, ...]] = ("simulation",)
    """Axes of the fields whose `FieldSpec` names none."""

    @property
    def nbytes(self) -> int:
        """Size of its arrays, and of the arrays of nested batches [bytes]."""
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return sum(value.nbytes for value in values if isinstance(value, np.ndarray | Batch))

    def axis_lengths(self) -> Mapping[str, int]:
        """Lengths of axes that ranges refer to and no array of the batch has, by name."""
        return {}

    def constraints(self) -> Iterable[Constraint]:
        """Conditions that its fields must fulfil together."""
        return ()

    def equals(self, batch: object) -> bool:
        """Whether another batch has the same class and the same content; NaN equals NaN."""
        return is_same_content(self, batch)

    def select(self, simulations: NDArray[np.integer] | NDArray[np.bool_] | slice) -> Self:
        """The same batch, restricted to some simulations.

        Args:
            simulations: Indices, a mask or a slice.

        Raises:
            NoSuchSimulationError: The argument is of another type, or an index is out of range.
        """
        try:
            if isinstance(simulations, slice) or np.ndim(simulations) == 1:
                return self._select(simulations)
            problem: object = f"{simulations!r}"
        except (IndexError, TypeError, ValueError) as error:
            problem = error
        raise NoSuchSimulationError(
            what="simulations",
            where=f"{type(self).__name__}.select",
            expected="a slice, a mask or an array of their indices",
            got=str(problem),
            next_step="choose among the simulations of the batch",
        )

    def _select(self, simulations: Any) -> Self:
        changes = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                changes[field.name] = value[simulations]
            elif isinstance(value, Batch):
                changes[field.name] = value.select(simulations)
            elif _are_batches(value):
                changes[field.name] = tuple(part.select(simulations) for part in value)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed.

        Raises:
            ConfigError: There is no such field.
        """
        field_names = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        for name in changes:
            if name not in field_names:
                where = f"{type(self).__name__}.replace"
                raise ConfigError.unknown_choice(
                    what="field", where=where, choices=field_names, got=name
                )
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]


class IdentityBatch(Batch):
    """A batch that equals no other object, so that `cached_per_batch` can store results by it.

    `equals` compares the content.
    """

    __slots__ = ()

    __eq__ = object.__eq__
    __hash__ = object.__hash__


class Delayed(Batch):
    """A batch some of whose fields are computed at their first use."""

    __slots__ = ("_later",)

    @classmethod
    def partly(cls, later: Mapping[str, Callable[[], Mapping[str, Any]]], **known: Any) -> Self:
        """A batch with the values of some fields, and functions that compute the others.

        Args:
            later: For each other field a function that returns its value, and perhaps the values of
                more fields, by name.
            **known: Values of fields by name.
        """
        batch = object.__new__(cls)
        for name, value in [*known.items(), ("_later", later)]:
            object.__setattr__(batch, name, value)
        return batch

    if not TYPE_CHECKING:  # Type checkers would accept any name as a field.

        def __getattr__(self, name: str) -> Any:
            """Compute a field at its first use."""
            later = {} if name == "_later" else self._later
            if name not in later:
                raise AttributeError(name, name=name, obj=self)
            for field_name, value in later[name]().items():
                object.__setattr__(self, field_name, value)
            return object.__getattribute__(self, name)


def concatenate(batches: list[B]) -> B:
    """Join batches along the simulation axis; all other values must be equal in all of them.

    Import reports are joined too; a finding that several of them have appears once.

    Raises:
        ValueError: The list is empty or a shared value differs.
    """
    if not batches:
        raise ValueError("concatenate: expected at least one batch, got none")
    first = batches[0]
    changes = {}
    for field in dataclasses.fields(first):  # type: ignore[arg-type]
        values = [getattr(batch, field.name) for batch in batches]
        if isinstance(values[0], np.ndarray):
            changes[field.name] = np.concatenate(values)
        elif isinstance(values[0], Batch):
            changes[field.name] = concatenate(values)
        elif _are_batches(values[0]):
            changes[field.name] = tuple(
                concatenate(list(parts)) for parts in zip(*values, strict=True)
            )
        elif not field.compare:
            changes[field.name] = joined_findings(values)
        elif not all(is_same_content(value, values[0]) for value in values):
            raise ValueError(f"concatenate: {field.name} differs between the batches")
    return dataclasses.replace(first, **changes)  # type: ignore[type-var]


def _are_batches(value: object) -> bool:
    """Whether a value is a tuple of one or more batches."""
    return isinstance(value, tuple) and len(value) > 0 and isinstance(value[0], Batch)


IdentityT = TypeVar("IdentityT", bound=IdentityBatch)
T = TypeVar("T")


def cached_per_batch(function: Callable[[IdentityT], T]) -> Callable[[IdentityT], T]:
    """The function, with its result for a batch stored as long as the batch exists.

    All callers share the result; its arrays must not be changed.
    """
    results: WeakKeyDictionary[IdentityT, T] = WeakKeyDictionary()

    @wraps(function)
    def cached_function(batch: IdentityT) -> T:
        if batch not in results:
            results[batch] = function(batch)
        return results[batch]

    return cached_function


Cls = TypeVar("Cls", bound=type)


def with_field_docs(cls: Cls) -> Cls:
    """A dataclass whose docstring lists its fields, for `help` and notebooks."""
    lines = [
        f"    {name}: {field.spec.meaning}"
        f"{'' if field.spec.unit == '1' else f' [{field.spec.unit}]'}."
        for name, field in batch_fields(cls).items()
    ]
    if cls.__doc__:  # None under `python -OO`.
        # Python 3.13 removes the indentation of docstrings, earlier versions keep it.
        cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__), "", "Attributes:", *lines, ""])
    return cls
