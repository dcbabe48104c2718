"""Random streams, choices, importance sampling, and the block of simulations drawn together.

A scenario has the same bits on every machine. NumPy chooses an implementation of `exp` and `power`
by the CPU, and their last bits differ; `core.native` computes the same bits everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U32, U64, IndexArray, Mask
from overtaking.core.native import PhiloxStream, box_muller, clamp, exp, power
from overtaking.core.random_numbers import Stream
from overtaking.knowledge.toml_reader import number

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Component, Specification

T = TypeVar("T", bound=np.generic)
Number: TypeAlias = float | np.floating[Any] | NDArray[np.float32]

NumberTransform = Callable[[str, F32], F32]
"""Replaces a named number, uniform in (0, 1) or standard normal, of each simulation."""

MAX_SIGMAS = np.float32(number("sampling.draws.max_sigmas"))
"""Normal numbers are limited to this many standard deviations on either side of zero (2.5, see
`knowledge/data/sampling.toml`)."""


class RandomStream:
    """Successive random numbers of one stream.

    Normal numbers come in pairs; the second of a pair is returned by the next call.
    """

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at the first number.

        Args:
            seed: Seed of the data set.
            scenario_index: Index of each scenario, any shape.
            stream: A `core.random_numbers.Stream`, plus slots that broadcast against
                `scenario_index`.
        """
        self._draws = PhiloxStream(seed, scenario_index, stream)
        self._second_normal: F32 | None = None

    def uniform(self) -> F32:
        """The next number in (0, 1)."""
        return self._draws.uniform()

    def normal(self) -> F32:
        """The next standard normal number, limited to `MAX_SIGMAS`."""
        return truncate(self.unbounded_normal())

    def unbounded_normal(self) -> F32:
        """The next standard normal number, without a limit."""
        if self._second_normal is not None:
            normal, self._second_normal = self._second_normal, None
            return normal
        normal, self._second_normal = box_muller(self._draws.uniform(), self._draws.uniform())
        return normal

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count)."""
        return self._draws.integer(count)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleBlock:
    """Simulations that are drawn together.

    Attributes:
        specification: The specification of the scenarios.
        road: The road, as long as the horizon needs.
        seed: Seed of the data set.
        scenario_index: Index of each scenario, shape (simulation,).
        proposal: Transforms the numbers that importance sampling may change. It accumulates density
            ratios, so each block needs its own instance.
    """

    specification: Specification
    road: Road
    seed: int
    scenario_index: U64
    proposal: ProposalSampler

    @classmethod
    def from_indices(
        cls, specification: Specification, road: Road, seed: int, scenario_index: U64
    ) -> SampleBlock:
        """A block with the proposal of its specification, before the first draw."""
        proposal = ProposalSampler(specification.proposal or (), seed, scenario_index)
        return cls(
            specification=specification,
            road=road,
            seed=seed,
            scenario_index=scenario_index,
            proposal=proposal,
        )

    def stream(self, stream: int) -> RandomStream:
        """A stream of random numbers of shape (simulation,), from its first draw."""
        return RandomStream(self.seed, self.scenario_index, stream)

    def slot_streams(self, stream: int, num_slots: int) -> RandomStream:
        """A stream for each slot; its numbers have the shape (simulation, vehicle).

        Args:
            stream: A `Stream` that its comment marks "+ slot". These are 0x100 apart, so up to 256
                slots do not reach the next one; a scenario has at most `MAX_VEHICLES`.
            num_slots: Number of slots.
        """
        slots = np.uint32(stream) + np.arange(num_slots, dtype=np.uint32)
        return RandomStream(self.seed, self.scenario_index[:, None], slots)


def truncate(normal: F32) -> F32:
    """Standard normal numbers, limited to `MAX_SIGMAS` on either side."""
    return clamp(normal, -MAX_SIGMAS, MAX_SIGMAS)


def scale_to_range(u: F32, low: Number, high: Number) -> F32:
    """Scale a number from (0, 1) to [low, high]."""
    low32, high32 = np.asarray(low, np.float32), np.asarray(high, np.float32)
    # Rounding can carry the sum beyond a limit.
    return clamp(low32 + (high32 - low32) * u, low32, high32)


def choose_weighted(u: F32, weights: Sequence[float]) -> U8:
    """Choose a position in `weights` for each number.

    Args:
        u: Uniform numbers in (0, 1), any shape.
        weights: Weight of each position, not negative, not all zero; at most 255 positions.

    Returns:
        Positions, each as probable as its share of the weights; the shape of `u`.
    """
    # Added one by one: since Python 3.12 `sum` rounds differently.
    *partial_sums, total = itertools.accumulate(weights)
    position = np.zeros(u.shape, np.uint8)
    # Positions after the last positive weight are never chosen, so they need no comparison.
    last = max(index for index, weight in enumerate(weights) if weight > 0.0)
    for partial_sum in partial_sums[:last]:
        position += u >= np.float32(partial_sum / total)
    return position


def weights_of(weights: Mapping[str, float], order: Sequence[str]) -> list[float]:
    """The weights of all names in `order`, zero for names that `weights` does not have."""
    return [weights.get(name, 0.0) for name in order]


def sort_columns(values: NDArray[T], order: IndexArray) -> list[NDArray[T]]:
    """Sort the entries of each row of an array (row, column), and return the columns.

    Args:
        values: Shape (row, column).
        order: Position in `values` of each sorted entry, the same shape.
    """
    return list(np.ascontiguousarray(np.take_along_axis(values, order, axis=1).T))


def unsort_columns(columns: list[F32], order: IndexArray) -> F32:
    """Undo `sort_columns`."""
    values = np.empty(order.shape, np.float32)
    np.put_along_axis(values, order, np.stack(columns, axis=1), axis=1)
    return values


def identity_transform(name: str, profile_number: F32) -> F32:
    """Return the number itself: a `NumberTransform` without effect."""
    del name
    return profile_number


class ProposalSampler:
    """Draws the numbers of scenarios from a proposal, and weighs each simulation.

    Stateful: one per block, numbers in a fixed order.

    Each simulation is drawn from component k with probability `share[k]`, and from the profile with
    the remaining probability; these simulations are the natural ones. A component transforms each
    of its numbers independently:

        powers   u^a of a uniform number u             density ratio v^(1/a - 1) / a
        parts    a uniform number between two limits   density ratio 1 / (high - low)
        shifts   z + d of a standard normal number z   density ratio exp(d v - d^2 / 2)

    A density ratio is the component's density over the profile's, at the value v. `truncate` limits
    normal numbers only after their transformation, so the ratio of a shift needs no term for it.

    Source:
        Owen and Zhou (2000), "Safe and effective importance sampling".
    """

    def __init__(self, components: Sequence[Component], seed: int, scenario_index: U64) -> None:
        """Decide which component each simulation is drawn from.

        Args:
            components: Components of the specification; without any, nothing is transformed.
            seed: Seed of the data set.
            scenario_index: Index of each scenario, shape (simulation,).
        """
        num_simulations = len(scenario_index)
        # Each temper scales the powers and shifts of a component; the copies divide its share
        # equally (see `Component.tempers`).
        self._components = tuple(
            copy for component in components for copy in component.at_each_temper()
        )
        self._is_drawn_from: list[Mask] = []
        total_share = 0.0
        if self._components:
            u = RandomStream(seed, scenario_index, Stream.PROPOSAL).uniform()
            for component in self._components:
                low, total_share = total_share, total_share + component.share
                self._is_drawn_from.append((u >= np.float32(low)) & (u < np.float32(total_share)))
        self._natural_share = np.full(num_simulations, 1.0 - total_share)
        self._density_ratios = [np.ones(num_simulations, np.float64) for _ in self._components]

    def transform(self, name: str, profile_number: F32) -> F32:
        """Replace a number of the profile by the number of the simulation's component.

        Args:
            name: Name of the number, one of `PROPOSAL_UNIFORMS` or `PROPOSAL_NORMALS` of
                `scenarios.specification`.
            profile_number: The number as the profile draws it: uniform in (0, 1), or standard
                normal without a limit, shape (simulation,).
        """
        if not any(component.changes(name) for component in self._components):
            return profile_number
        drawn = profile_number
        for component, is_drawn in zip(self._components, self._is_drawn_from, strict=True):
            drawn = np.where(is_drawn, _transform_number(component, name, profile_number), drawn)
        # The mixture could have drawn this value from each component, so each ratio is updated,
        # not only the ratio of the component drawn from (balance heuristic).
        for component, ratio in zip(self._components, self._density_ratios, strict=True):
            ratio *= _density_ratio(component, name, drawn)
        return drawn

    @property
    def weight_so_far(self) -> F64:
        """The profile's density over the mixture's, for the numbers drawn so far.

        Shape (simulation,). After the last number it is the sampling weight. The mixture's density
        is at least the natural share of the profile's, so no weight exceeds
        1 / (1 - sum of the shares).
        """
        mixture = self._natural_share
        for component, ratio in zip(self._components, self._density_ratios, strict=True):
            mixture = mixture + component.share * ratio
        return 1.0 / mixture


def _transform_number(component: Component, name: str, profile_number: F32) -> F32:
    """The number as the component draws it."""
    if name in component.powers:
        return power(profile_number, np.full_like(profile_number, component.powers[name]))
    if name in component.parts:
        return scale_to_range(profile_number, *component.parts[name])
    # Numbers that a component does not name stay as they are: shift 0, ratio 1.
    return profile_number + np.float32(component.shifts.get(name, 0.0))


def _density_ratio(component: Component, name: str, drawn: F32) -> F64:
    """The component's density over the profile's, at the drawn values."""
    if name in component.powers:
        inverse = np.float32(1.0 / component.powers[name])
        ratio = inverse * power(drawn, np.full_like(drawn, inverse - np.float32(1.0)))
    elif name in component.parts:
        low, high = (np.float32(limit) for limit in component.parts[name])
        is_inside = (drawn >= low) & (drawn <= high)
        ratio = np.where(is_inside, np.float32(1.0) / (high - low), np.float32(0.0))
    else:
        shift = np.float32(component.shifts.get(name, 0.0))
        ratio = exp(shift * (drawn - np.float32(0.5) * shift))
    # Products of many ratios leave the range of float32.
    return ratio.astype(np.float64)
