"""Random streams, choices, importance sampling."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, U32, U64, Mask
from overtaking.core.native import PhiloxStream, box_muller, clamp, exp, power
from overtaking.core.random_numbers import Stream
from overtaking.knowledge.toml_reader import number

if TYPE_CHECKING:
    from overtaking.scenarios.specification import Component, Proposal

T = TypeVar("T", bound=np.generic)
Number: TypeAlias = float | np.floating[Any] | NDArray[np.float32]

MAX_SIGMAS = np.float32(number("sampling.toml", "draws.max_sigmas"))
"""Normal numbers are cut off at this many standard deviations."""


class RandomStream:
    """Successive random numbers of one stream, of which none of a pair is thrown away."""

    def __init__(self, seed: int, index: U64, stream: U32 | int) -> None:
        """Start at the first draw.

        Args:
            seed: Seed of the data set.
            index: Simulation numbers, any shape.
            stream: `core.random_numbers.Stream`, plus slots that broadcast against `index`.
        """
        self._draws = PhiloxStream(seed, index, stream)
        self._spare: F32 | None = None

    def uniform(self) -> F32:
        """The next number in (0, 1)."""
        return self._draws.uniform()

    def normal(self) -> F32:
        """The next standard normal number, cut off at `REACH`."""
        return truncate(self.unbounded_normal())

    def unbounded_normal(self) -> F32:
        """The next standard normal number, as far out as it may be."""
        if self._spare is not None:
            number, self._spare = self._spare, None
            return number
        first, self._spare = box_muller(self._draws.uniform(), self._draws.uniform())
        return first

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count)."""
        return self._draws.integer(count)


def truncate(normal: F32) -> F32:
    """Normal numbers, those beyond `REACH` at it."""
    return clamp(normal, -MAX_SIGMAS, MAX_SIGMAS)


def scale_to_range(u: F32, low: Number, high: Number) -> F32:
    """A number in (0, 1) as one in [low, high]."""
    low32, high32 = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return clamp(low32 + (high32 - low32) * u, low32, high32)


def choose_weighted(u: F32, weights: Sequence[float]) -> U8:
    """Numbers in (0, 1) as positions in `weights`, each as likely as its weight says.

    Args:
        u: Any shape.
        weights: Not negative, not all zero; at most 255.
    """
    # Added one by one: since Python 3.12 `sum` rounds differently.
    *below, total = itertools.accumulate(weights)
    chosen = np.zeros(u.shape, np.uint8)
    last = max(index for index, weight in enumerate(weights) if weight > 0.0)
    for reached in below[:last]:
        chosen += u >= np.float32(reached / total)
    return chosen


def weights_of(given: Mapping[str, float], order: Sequence[str]) -> list[float]:
    """The weights of all names in `order`, zero for those that are not given."""
    return [given.get(name, 0.0) for name in order]


def sort_columns(values: NDArray[T], order: NDArray[np.intp]) -> list[NDArray[T]]:
    """The columns of an array (row, column), those of each row in the given order."""
    return list(np.ascontiguousarray(np.take_along_axis(values, order, axis=1).T))


def unsort_columns(columns: list[F32], order: NDArray[np.intp]) -> F32:
    """The inverse of `in_order`."""
    values = np.empty(order.shape, np.float32)
    np.put_along_axis(values, order, np.stack(columns, axis=1), axis=1)
    return values


NumberTransform = Callable[[str, F32], F32]
"""Draws a named number, uniform in (0, 1) or standard normal, from where more happens."""


def untransformed(name: str, u: F32) -> F32:
    """Bends nothing."""
    del name
    return u


class ProposalSampler:
    """Numbers of a batch, drawn as each simulation's component says, independent of each other.

    Uniform numbers that a component has a power for become u^power, of density v^(1/power - 1) /
    power; those with a part come from there, of density one over its width; standard normal ones
    with a shift become z + shift, whose density over the plain one is exp(shift v - shift^2 / 2).
    """

    def __init__(self, spec: Proposal | None, seed: int, index: U64) -> None:
        """Decide which simulations are drawn from which component.

        Args:
            spec: What the specification says; None bends nothing.
            seed: Seed of the data set.
            index: Simulation numbers, shape (simulation,).
        """
        self._components = tuple(each for one in spec or () for each in one.tempered())
        drawn = (
            RandomStream(seed, index, Stream.PROPOSAL).uniform() if spec else np.ones(len(index))
        )
        self._taken: list[Mask] = []
        below = 0.0
        for one in self._components:
            above = below + one.share
            self._taken.append((drawn >= np.float32(below)) & (drawn < np.float32(above)))
            below = above
        self._natural = np.full(len(index), 1.0 - below)
        self._densities = [np.ones(len(index), np.float64) for _ in self._components]

    def transform(self, name: str, number: F32) -> F32:
        """The number to use in place of `number`, shape (simulation,)."""
        if not any(name in kind for one in self._components for kind in changes(one)):
            return number
        drawn = number
        for one, taken in zip(self._components, self._taken, strict=True):
            drawn = np.where(taken, _transformed(one, name, number), drawn)
        for one, density in zip(self._components, self._densities, strict=True):
            density *= _density_ratio(one, name, drawn)
        return drawn

    @property
    def weight_so_far(self) -> NDArray[np.float64]:
        """Profile's density over the one that was drawn from, shape (simulation,)."""
        drawn_from = self._natural
        for one, density in zip(self._components, self._densities, strict=True):
            drawn_from = drawn_from + one.share * density
        return 1.0 / drawn_from


def changes(component: Component) -> tuple[Mapping[str, object], ...]:
    """Powers, parts and shifts of a component, each by the name of its quantity."""
    return component.powers, component.parts, component.shifts


def _transformed(component: Component, name: str, number: F32) -> F32:
    """The number as the component draws it."""
    if name in component.powers:
        return power(number, np.full_like(number, component.powers[name]))
    if name in component.parts:
        return scale_to_range(number, *component.parts[name])
    return number + np.float32(component.shifts.get(name, 0.0))


def _density_ratio(component: Component, name: str, drawn: F32) -> NDArray[np.float64]:
    """Density of the component over that of the profile at the drawn values."""
    if name in component.powers:
        inverse = np.float32(1.0 / component.powers[name])
        density = inverse * power(drawn, np.full_like(drawn, inverse - np.float32(1.0)))
    elif name in component.parts:
        low, high = (np.float32(end) for end in component.parts[name])
        inside = (drawn >= low) & (drawn <= high)
        density = np.where(inside, np.float32(1.0) / (high - low), np.float32(0.0))
    else:
        shift = np.float32(component.shifts.get(name, 0.0))
        density = exp(shift * (drawn - np.float32(0.5) * shift))
    return density.astype(np.float64)
