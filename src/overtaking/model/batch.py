"""What all frozen batches (struct of arrays) share."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.core.errors import ConfigError, NoSuchSimulationError
from overtaking.core.summary import Summarized

B = TypeVar("B", bound="Batch")


@dataclass(frozen=True, slots=True)
class Constraint:
    """What the fields of a batch must fulfil together.

    Attributes:
        field: Name of the field that is at fault.
        expected: What it should be, for people.
        broken: Where it is not, along the first axes of the batch.
        got: Values of the field, a shape that begins like that of `broken`.
    """

    field: str
    expected: str
    broken: Mask
    got: NDArray[Any]


class Batch(Summarized):
    """Base of the frozen dataclasses whose array fields all lead with the `simulation` axis.

    A field may also be another batch, or a tuple of them. What comes from outside is checked by
    `model.checks`, with `AXES`, `sizes` and `constraints`.
    """

    __slots__ = ()

    IS_DERIVED: ClassVar[bool] = False
    """Whether only this package makes it, from checked values."""

    AXES: ClassVar[tuple[str | int, ...]] = ("simulation",)
    """Axes of the fields that do not name their own."""

    @property
    def nbytes(self) -> int:
        """Bytes that its arrays take."""
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return sum(one.nbytes for one in values if isinstance(one, np.ndarray | Batch))

    def sizes(self) -> Mapping[str, int]:
        """Lengths of axes that no array of the batch has."""
        return {}

    def constraints(self) -> Iterable[Constraint]:
        """What its fields must fulfil together."""
        return ()

    def select(self, simulations: NDArray[np.integer] | NDArray[np.bool_] | slice) -> Self:
        """The same batch, restricted to some simulations.

        Args:
            simulations: Indices, a mask or a slice.

        Raises:
            NoSuchSimulationError: They are something else, or there is no such simulation.
        """
        try:
            if isinstance(simulations, slice) or np.ndim(simulations) == 1:
                return self._selected(simulations)
            problem: object = f"{simulations!r}"
        except (IndexError, TypeError, ValueError) as error:
            problem = error
        raise NoSuchSimulationError.of(
            what="simulations",
            where=f"{type(self).__name__}.select",
            expected="a slice, a mask or an array of their indices",
            got=str(problem),
            next_step="choose among the simulations of the batch",
        )

    def _selected(self, simulations: Any) -> Self:
        changes = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                changes[field.name] = value[simulations]
            elif isinstance(value, Batch):
                changes[field.name] = value.select(simulations)
            elif _are_batches(value):
                changes[field.name] = tuple(one.select(simulations) for one in value)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed.

        Raises:
            ConfigError: There is no such field.
        """
        known = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        for name in changes:
            if name not in known:
                where = f"{type(self).__name__}.replace"
                raise ConfigError.not_among("field", where, known, name)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]


class Delayed(Batch):
    """A batch some of whose fields are computed at their first use."""

    __slots__ = ("_later",)

    @classmethod
    def partly(cls, later: Mapping[str, Callable[[], Mapping[str, Any]]], **known: Any) -> Self:
        """A batch that knows some of its fields.

        Args:
            later: For each other field a function that works it out, perhaps with others.
            **known: Fields by name.
        """
        one = object.__new__(cls)
        for name, value in [*known.items(), ("_later", later)]:
            object.__setattr__(one, name, value)
        return one

    if not TYPE_CHECKING:  # Else any name would pass for a field.

        def __getattr__(self, name: str) -> Any:
            """Compute a field at its first use."""
            later = {} if name == "_later" else self._later
            if name not in later:
                raise AttributeError(name, name=name, obj=self)
            for each, value in later[name]().items():
                object.__setattr__(self, each, value)
            return object.__getattribute__(self, name)


def concatenate(batches: list[B]) -> B:
    """Join batches along the simulation axis; all other values must be equal in all of them.

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
                concatenate(list(ones)) for ones in zip(*values, strict=True)
            )
        elif any(value != values[0] for value in values):
            raise ValueError(f"concatenate: {field.name} differs between the batches")
    return dataclasses.replace(first, **changes)  # type: ignore[type-var]


def _are_batches(value: object) -> bool:
    """Whether a field holds several batches side by side."""
    return isinstance(value, tuple) and len(value) > 0 and isinstance(value[0], Batch)
