"""Batches: frozen dataclasses that hold many simulations as arrays, and declarations of fields.

The first axis of every array is the simulation. The other models of this package (scenarios,
recorded trajectories, events, features) are subclasses of `Batch`. Each field is annotated with an
array type of `core.arrays`, which states the dtype (`F32` is float32), and with a `FieldSpec`,
which states meaning, unit and range:

    speed: Annotated[F32, FieldSpec("Speed of the vehicle", "m/s", 0.0, 150.0)]

`batch_fields` reads these declarations. When a user passes a batch to a public function,
`model.checks` compares its values with them. `data.tables` derives the columns of tables from them.
"""

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
from overtaking.model.import_report import join_findings

BatchT = TypeVar("BatchT", bound="Batch")

Axes = tuple[str | int, ...]
"""Axes of an array in order: a name, such as "simulation", or a fixed length."""

_ARRAY_ORIGINS = (np.ndarray, get_origin(NDArray[Any]))
"""Results of `get_origin` for array annotations. The result for `NDArray[…]` depends on the version
of NumPy, so the second entry asks the installed version."""


@dataclass(frozen=True, slots=True)
class AxisEnd:
    """The upper limit of a field that holds indices: the length of an axis less one.

    Attributes:
        axis: Name of an axis of an array in the batch, or a key of `Batch.axis_lengths`.
    """

    axis: str


@dataclass(frozen=True, slots=True)
class ColumnName:
    """Name of the table column of a field; the table adds the unit, as in `ego_speed_mps`.

    If the field holds a batch, the columns of that batch begin with the name and "_".

    Attributes:
        name: The name; if empty, it is the name of the field.
        prefix: Text before the name, such as "ego_".
    """

    name: str = ""
    prefix: str = ""

    def for_field(self, field_name: str) -> str:
        """The name of the column of a field, without the unit."""
        return self.prefix + (self.name or field_name)


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """Declaration of a field of a batch, and of the table column that is written from it.

    Attributes:
        meaning: A phrase without unit and full stop.
        unit: Unit; "1" for plain numbers, codes and flags. For integers that count steps, the step:
            "mm" or "0.1 mrad".
        low: Smallest value.
        high: Largest value.
        low_is_open: Whether `low` itself is excluded.
        missing: An integer outside the range that stands for "no value", such as -1 for an event
            that did not happen; null in tables. None if every value must be in the range.
        axes: Axes of the array; None for the axes of its class (`Batch.AXES`).
        column: Name of the column; None for a field that is not written.
        null_unless: Dotted path of another field, the condition of this column. The column is null
            where that field is missing: equal to the value that it declares as `missing`, or false
            or 0 if it declares no such value. A path that begins with a dot starts at the batch of
            this field (".has_oncoming"). Any other path starts at the batch whose rows the table
            holds ("leader.encounter.valid"). Empty if the column has no condition.
        needs: Properties of the traffic, such as "weather", without which this value is unknown.
            The column is null for recordings of real traffic that do not state all of them;
            `model.trajectories.UNKNOWNS` has all names.
        names: Of a field with codes, or of a boolean field, the name of each value from 0 on.
        flags: Of an integer field with one flag per bit, the names of its bits, from the lowest.
        is_key: Whether the column is part of the primary key of its table.
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

    def __repr__(self) -> str:
        """The declared values alone, because `help` shows it in signatures of public functions."""
        values = [(entry, getattr(self, entry.name)) for entry in dataclasses.fields(self)]
        declared = (f"{entry.name}={value!r}" for entry, value in values if value != entry.default)
        return f"FieldSpec({', '.join(declared)})"

    @property
    def is_bounded(self) -> bool:
        """Whether a range is declared, against which values are checked."""
        return self.low != -math.inf or self.high != math.inf

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value.

        Raises:
            TypeError: The largest value is an `AxisEnd`, known only with a batch.
        """
        if isinstance(self.high, AxisEnd):
            raise TypeError(f"the largest value depends on the axis {self.high.axis}")
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class BatchField:
    """A field of a batch with all that its annotation and the defaults of its class declare.

    Attributes:
        name: Name of the field.
        spec: Its `FieldSpec`; the default `FieldSpec()` if the annotation has no metadata.
        axes: Axes of the array: of the `FieldSpec`, or, if it states no axes, of the class.
        dtype: The dtype of an array; None if the field holds no array.
        type: Its type without an outer `Annotated`. Members of a union, as in `F32 | None`, stay
            `Annotated`.
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
        """Whether it is an array of booleans; `FieldSpec.flags` are bits of integers instead."""
        return self.dtype == np.bool_

    @property
    def is_optional(self) -> bool:
        """Whether it may be None."""
        return NoneType in union_members(self.type)


@cache
def batch_fields(cls: type) -> Mapping[str, BatchField]:
    """The fields of a dataclass by name, in their order, as their annotations declare them.

    Fields with `compare=False` are left out. The only one is `Trajectories.import_findings`, the
    faults that a reader found in a recording of real traffic. No check and no table of simulations
    reads it.

    Args:
        cls: A subclass of `Batch`, or another dataclass. The result is cached for it.

    Raises:
        TypeError: The annotation of an array states no dtype, as a bare `NDArray` does.
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
    """A field, or a parameter of a public function, as its annotation declares it.

    `model.checks` calls it for the parameters.

    Args:
        name: Name of the field or parameter.
        annotation: Its annotation, a type or `Annotated` with a `FieldSpec`.
        axes: Default axes, for an array whose `FieldSpec` states none.
    """
    specs = (item for item in _metadata(annotation) if isinstance(item, FieldSpec))
    spec = next(specs, FieldSpec())
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
    """The type of an annotation, without an outer `Annotated`."""
    return annotation.__origin__ if get_origin(annotation) is Annotated else annotation


def union_members(annotation: Any) -> tuple[Any, ...]:
    """The members of a union, such as `F32 | None`; of any other annotation, itself alone."""
    is_union = get_origin(annotation) in (Union, UnionType)
    return get_args(annotation) if is_union else (annotation,)


def _metadata(annotation: Any) -> Iterator[object]:
    """The metadata of an annotation, then of the members of its union.

    `F32` is itself `Annotated` with a dtype, so `Annotated[F32 | None, FieldSpec(…)]` has metadata
    on two levels: the `FieldSpec` outside and the dtype inside the union.
    """
    # The outer level comes first, because its `FieldSpec` overrides one of a member.
    if get_origin(annotation) is Annotated:
        yield from annotation.__metadata__
    for member in union_members(without_metadata(annotation)):
        if get_origin(member) is Annotated:
            yield from member.__metadata__


@dataclass(frozen=True, slots=True)
class Constraint:
    """A condition that the range of a single field cannot state, evaluated for one batch.

    Attributes:
        field: Name of the field that an error message names.
        expected: The expected values in words, for the message.
        broken: Mask of the elements that break the condition, along the first axes of the field:
            shape (simulation,) or (simulation, vehicle), or () for the batch as a whole.
        values: Values of the field, of which the message shows the first broken one; its shape
            begins with the shape of `broken`.
    """

    field: str
    expected: str
    broken: Mask
    values: NDArray[Any]


class Batch(CompactRepr, ContentEquality):
    """Base of frozen dataclasses whose arrays all have `simulation` as their first axis.

    A field may also be another batch or a tuple of batches, for the same simulations, or a value
    that all simulations share, such as the road. `model.checks` checks batches of users; subclasses
    extend its checks by `axis_lengths` and `constraints`.

    `==` compares the content of arrays, and `repr` shows a summary of them. A subclass needs no
    `eq=False` for this: the two base classes copy `__eq__`, `__hash__` and `__repr__` into each new
    subclass, and the decorator `dataclass` keeps methods that a class has itself.
    """

    __slots__ = ()

    IS_INTERNAL: ClassVar[bool] = False
    """Whether only this package creates it, from checked values, so that it needs no check."""

    AXES: ClassVar[Axes] = ("simulation",)
    """Axes of the fields whose `FieldSpec` names none; subclasses add axes, such as "vehicle"."""

    @property
    def nbytes(self) -> int:
        """Size of its arrays and nested batches [bytes].

        Tuples of batches are left out. The only caller, `sample`, asks for the size of drawn
        scenarios, which hold no such tuple.
        """
        # "type: ignore" here and below: `Batch` itself is no dataclass, but all subclasses are.
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return sum(value.nbytes for value in values if isinstance(value, np.ndarray | Batch))

    def axis_lengths(self) -> Mapping[str, int]:
        """Lengths that an `AxisEnd` refers to but no array has, such as the number of lanes."""
        return {}

    def constraints(self) -> Iterable[Constraint]:
        """Conditions on the values beyond the ranges of single fields."""
        return ()

    def equals(self, batch: object) -> bool:
        """Whether another batch has the same class and the same content; NaN equals NaN.

        For most batches `==` does the same; an `IdentityBatch` has another `==`.
        """
        return is_same_content(self, batch)

    def select(self, simulations: NDArray[np.integer] | NDArray[np.bool_] | slice) -> Self:
        """A batch of some of its simulations.

        Args:
            simulations: Indices, shape (selected,), which may repeat and have any order; a mask,
                shape (simulation,); or a slice.

        Raises:
            NoSuchSimulationError: The argument is neither a slice nor one-dimensional, its elements
                are neither integers nor booleans, an index is out of range, or the mask has another
                length.
        """
        # NumPy finds the invalid indices; its message becomes a part of this one.
        problem: object = repr(simulations)
        try:
            if isinstance(simulations, slice) or np.ndim(simulations) == 1:
                return self._select(simulations)
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
        selected = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                selected[field.name] = value[simulations]
            elif isinstance(value, Batch):
                selected[field.name] = value.select(simulations)
            elif _are_batches(value):
                selected[field.name] = tuple(part.select(simulations) for part in value)
        return dataclasses.replace(self, **selected)  # type: ignore[type-var]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed.

        Args:
            **changes: New values by field name. They are not checked here but by the public
                function that gets the copy.

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
    """A batch that equals only itself: `==` is `is`, and `equals` compares the content.

    `cached_per_batch` keeps results in a dictionary whose keys are batches, so they need a hash.
    Other batches are not hashable, because `==` compares their arrays. The two methods below are
    copied into subclasses, as `Batch` explains.
    """

    __slots__ = ()

    __eq__ = object.__eq__
    __hash__ = object.__hash__


class Delayed(Batch):
    """A batch some of whose fields are computed at their first use.

    Time series (`model.ego_signals`) are such batches: their arrays are large, and most callers
    read few of them.
    """

    __slots__ = ("_later",)

    @classmethod
    def partly(cls, later: Mapping[str, Callable[[], Mapping[str, Any]]], **known: Any) -> Self:
        """A batch with the values of some fields, and functions that compute the others.

        Args:
            later: For the name of each other field, a function without arguments. It returns a
                mapping from field names to values. Fields that are computed together have the same
                function, whose mapping holds all of them; it runs at the first use of any.
            **known: Values of fields by name.
        """
        # `__init__` would demand all fields, and a frozen dataclass refuses plain assignments.
        batch = object.__new__(cls)
        for name, value in [*known.items(), ("_later", later)]:
            object.__setattr__(batch, name, value)
        return batch

    if not TYPE_CHECKING:  # With `__getattr__`, type checkers would accept any name as a field.

        def __getattr__(self, name: str) -> Any:
            """Compute a field at its first use.

            Python calls this method only for attributes that have no value yet.
            """
            # A batch that `__init__` made has no attribute `_later`. Python then calls this method
            # for `_later` itself, which must raise the error below instead of calling itself.
            later = {} if name == "_later" else self._later
            if name not in later:
                raise AttributeError(name, name=name, obj=self)
            for field_name, value in later[name]().items():
                object.__setattr__(self, field_name, value)
            return object.__getattribute__(self, name)


def concatenate(batches: list[BatchT]) -> BatchT:
    """Join batches along the simulation axis.

    Args:
        batches: One or more batches of the same class, whose arrays agree in all axes but the
            first. A field is an array in all of them or in none. Values that all simulations of a
            batch share, such as the road, must be equal in all batches.

    Returns:
        The joined batch. Its `import_findings`, the faults found in the source of recorded traffic,
        come from all batches; a finding that several batches have appears once.

    Raises:
        ValueError: The list is empty, a shared value differs, or arrays do not fit.
    """
    if not batches:
        raise ValueError("concatenate: expected at least one batch, got none")
    first = batches[0]
    joined = {}
    for field in dataclasses.fields(first):  # type: ignore[arg-type]
        values = [getattr(batch, field.name) for batch in batches]
        if isinstance(values[0], np.ndarray):
            joined[field.name] = np.concatenate(values)
        elif isinstance(values[0], Batch):
            joined[field.name] = concatenate(values)
        elif _are_batches(values[0]):
            joined[field.name] = tuple(
                concatenate(list(parts)) for parts in zip(*values, strict=True)
            )
        elif not field.compare:  # `Trajectories.import_findings`, a tuple of findings.
            joined[field.name] = join_findings(values)
        elif not all(is_same_content(value, values[0]) for value in values):
            raise ValueError(f"concatenate: {field.name} differs between the batches")
    return dataclasses.replace(first, **joined)  # type: ignore[type-var]


def _are_batches(value: object) -> bool:
    """Whether a value is a tuple of one or more batches."""
    return isinstance(value, tuple) and len(value) > 0 and isinstance(value[0], Batch)


IdentityT = TypeVar("IdentityT", bound=IdentityBatch)
ResultT = TypeVar("ResultT")


def cached_per_batch(function: Callable[[IdentityT], ResultT]) -> Callable[[IdentityT], ResultT]:
    """Decorate a function of a batch so that it computes once for each batch object.

    A result is released together with its batch, to which the cache holds a weak reference. All
    callers share the result, so they must not change its arrays.

    Args:
        function: A function whose only argument is a batch. The class of the batch must have
            `weakref_slot=True`, because objects with slots have no weak references otherwise.
    """
    results: WeakKeyDictionary[IdentityT, ResultT] = WeakKeyDictionary()

    @wraps(function)
    def cached_function(batch: IdentityT) -> ResultT:
        if batch not in results:
            results[batch] = function(batch)
        return results[batch]

    return cached_function


ClassT = TypeVar("ClassT", bound=type)


def with_field_docs(cls: ClassT) -> ClassT:
    """Decorate a dataclass: append meaning and unit of each field to its docstring.

    `help` and notebooks then list the fields without a second description beside `FieldSpec`.

    Args:
        cls: The dataclass, which is changed and returned.
    """
    lines = [
        f"    {name}: {field.spec.meaning}"
        f"{'' if field.spec.unit == '1' else f' [{field.spec.unit}]'}."
        for name, field in batch_fields(cls).items()
    ]
    if cls.__doc__:  # None under `python -OO`.
        # Python 3.13 removes the indentation of docstrings, earlier versions keep it.
        cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__), "", "Attributes:", *lines, ""])
    return cls
