"""What all frozen batches (struct of arrays) share."""

import dataclasses
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

B = TypeVar("B", bound="Batch")


class Batch:
    """Base of the frozen dataclasses whose array fields all lead with the `simulation` axis."""

    __slots__ = ()

    def select(self, simulations: NDArray[np.integer] | slice) -> Self:
        """The same batch, restricted to some simulations (an index array, a mask or a slice)."""
        changes = {}
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray | Batch):
                changes[field.name] = (
                    value[simulations]
                    if isinstance(value, np.ndarray)
                    else value.select(simulations)
                )
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed."""
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]


def concatenate(batches: list[B]) -> B:
    """Join batches along the simulation axis; what is not an array must be equal in all of them.

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
        elif any(value != values[0] for value in values):
            raise ValueError(f"concatenate: {field.name} differs between the batches")
    return dataclasses.replace(first, **changes)  # type: ignore[type-var]
