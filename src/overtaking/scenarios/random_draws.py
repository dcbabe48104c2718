"""Random numbers of scenarios, and importance sampling.

A scenario is drawn from the seed of its data set and its *scenario index*, a 64-bit number. Each
purpose has a *stream* of random numbers of its own, for example the weather, or the lanes and
stations at the start (the *layout*). An additional draw for the weather therefore does not change
the layout. `SampleBlock` gives the samplers of this package their streams.

*Importance sampling* draws rare scenarios more often. A specification may have *components*, which
change the distributions of some random numbers; the *profile* is the specification without them.
`ProposalSampler` replaces the numbers of the profile and computes the weight by which each
simulation counts in statistics.

A *slot* is the position of a vehicle in the second axis of arrays, shape (simulation, vehicle).
`sort_columns` and `unsort_columns` order the vehicles of such arrays along the road; samplers use
them for the layout.

A scenario has the same bits on every machine. NumPy chooses an implementation of `exp` and `power`
by the CPU, and their last bits differ; `core.native` computes the same float32 bits everywhere.
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
"""A limit of a range: the same for all simulations, or an array."""

NumberTransform = Callable[[str, F32], F32]
"""Takes the name of a random number and its value in each simulation, uniform in (0, 1) or standard
normal, shape (simulation,); returns the values to use in its place. Samplers pass
`ProposalSampler.transform`, or `identity_transform` for no change."""

MAX_SIGMAS = np.float32(number("sampling.draws.max_sigmas"))
"""Normal numbers are limited to this many standard deviations on either side of zero, so that
vehicles and drivers are not too extreme. A choice in `knowledge/data/sampling.toml`: 2.5, which
limits 1.2 % of them."""


class RandomStream:
    """Successive random numbers of one stream; each method returns the next, for all simulations.

    The arrays have the shape of `scenario_index` broadcast against `stream`.
    """

    def __init__(self, seed: int, scenario_index: U64, stream: U32 | int) -> None:
        """Start at the first number.

        Args:
            seed: Seed of the data set, 0 <= seed < 2**64.
            scenario_index: Index of each scenario, any shape.
            stream: Number of a purpose, one of `core.random_numbers.Stream`. For a stream of each
                vehicle: an array that broadcasts against `scenario_index`, with the number of the
                purpose plus the slot of each vehicle.
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
        """The next standard normal number, without a limit.

        The Box-Muller method makes two from two uniform numbers; the next call returns the second.
        """
        if self._second_normal is not None:
            normal, self._second_normal = self._second_normal, None
            return normal
        normal, self._second_normal = box_muller(self._draws.uniform(), self._draws.uniform())
        return normal

    def integer(self, count: int) -> NDArray[np.int32]:
        """The next integer in [0, count), each equally likely.

        Args:
            count: Number of integers, at most 65536, because 16 random bits decide.
        """
        return self._draws.integer(count)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleBlock:
    """Simulations that are drawn together, with the source of their random numbers.

    Attributes:
        specification: The specification of the scenarios.
        road: The road, so long that no vehicle leaves it during a simulation.
        seed: Seed of the data set.
        scenario_index: Index of each scenario, shape (simulation,).
        proposal: Replaces the numbers that importance sampling may change. It collects the weights
            of these simulations, so each block needs its own instance (`from_indices` makes it).
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
        """A block before its first draw.

        Args:
            specification: The specification of the scenarios; importance sampling follows its
                section `[[proposal]]`.
            road: The road, so long that no vehicle leaves it during a simulation.
            seed: Seed of the data set, 0 <= seed < 2**64.
            scenario_index: Index of each scenario, shape (simulation,).
        """
        proposal = ProposalSampler(specification.proposal or (), seed, scenario_index)
        return cls(
            specification=specification,
            road=road,
            seed=seed,
            scenario_index=scenario_index,
            proposal=proposal,
        )

    def stream(self, stream: int) -> RandomStream:
        """A stream of numbers of shape (simulation,); each call begins it anew.

        Args:
            stream: Number of a purpose, such as `Stream.LAYOUT`.
        """
        return RandomStream(self.seed, self.scenario_index, stream)

    def slot_streams(self, stream: int, num_slots: int) -> RandomStream:
        """A stream for each vehicle slot; its numbers have shape (simulation, vehicle).

        So the first vehicles stay the same if a simulation gets more slots.

        Args:
            stream: `Stream.VEHICLE`, `Stream.DRIVER` or another purpose with a stream for each
                slot. The slot is added to its number. The numbers of purposes are 256 apart, and
                no scenario has more than 32 slots.
            num_slots: Number of slots.
        """
        slots = np.uint32(stream) + np.arange(num_slots, dtype=np.uint32)
        return RandomStream(self.seed, self.scenario_index[:, None], slots)


def truncate(normal: F32) -> F32:
    """Standard normal numbers, limited to `MAX_SIGMAS` on either side."""
    return clamp(normal, -MAX_SIGMAS, MAX_SIGMAS)


def scale_to_range(u: F32, low: Number, high: Number) -> F32:
    """Scale numbers from (0, 1) to [low, high].

    Args:
        u: Numbers in (0, 1), any shape.
        low: Smallest result, a number or an array of the same shape.
        high: Largest result, a number or an array of the same shape.
    """
    low32, high32 = np.asarray(low, np.float32), np.asarray(high, np.float32)
    # Clamped because rounding can carry the sum beyond a limit.
    return clamp(low32 + (high32 - low32) * u, low32, high32)


def choose_weighted(u: F32, weights: Sequence[float]) -> U8:
    """Choose a position in `weights` for each number.

    Args:
        u: Uniform numbers in (0, 1), any shape.
        weights: Weight of each position, not negative, not all zero; at most 255 positions.

    Returns:
        Positions, each as probable as its share of the weights; the shape of `u`.
    """
    # Not `sum(weights)`: since Python 3.12 it rounds differently.
    *partial_sums, total = itertools.accumulate(weights)
    # The position is the number of partial sums that u times the total reaches.
    position = np.zeros(u.shape, np.uint8)
    # Positions after the last positive weight are never chosen, so they need no comparison.
    last = max(index for index, weight in enumerate(weights) if weight > 0.0)
    for partial_sum in partial_sums[:last]:
        position += u >= np.float32(partial_sum / total)
    return position


def weights_of(weights: Mapping[str, float], order: Sequence[str]) -> list[float]:
    """Weights as a list, for `choose_weighted`.

    Args:
        weights: Weight by name, such as the vehicle classes of a specification.
        order: All names; those without a weight get zero.
    """
    return [weights.get(name, 0.0) for name in order]


def sort_columns(values: NDArray[T], order: IndexArray) -> list[NDArray[T]]:
    """Sort the vehicles of each simulation, and return one array for each rank.

    Samplers place and repair vehicles one after the other, a rank of all simulations at a time.

    Args:
        values: Values of the vehicles, shape (simulation, vehicle).
        order: Slots of the vehicles in sorted order, as `np.argsort` returns them, the same shape.

    Returns:
        For each rank from first to last, the values of the vehicles with that rank, an array of
        shape (simulation,), contiguous in memory for speed.
    """
    return list(np.ascontiguousarray(np.take_along_axis(values, order, axis=1).T))


def unsort_columns(columns: list[F32], order: IndexArray) -> F32:
    """Undo `sort_columns`: values of shape (simulation, vehicle), in the order of the slots.

    Args:
        columns: For each rank, the values of the vehicles with that rank, shape (simulation,).
        order: The `order` of `sort_columns`.
    """
    values = np.empty(order.shape, np.float32)
    np.put_along_axis(values, order, np.stack(columns, axis=1), axis=1)
    return values


def identity_transform(name: str, profile_number: F32) -> F32:
    """Return the number itself: a `NumberTransform` without effect.

    Args:
        name: Name of the number; it makes no difference.
        profile_number: The number as drawn.
    """
    del name
    return profile_number


class ProposalSampler:
    """Replaces random numbers by the proposal of a specification, and weighs each simulation.

    The *proposal* is a mixture: each simulation is drawn from component k with probability
    `share[k]`, and from the profile, without a change, with the remaining probability, which is
    positive (`Specification` refuses shares with a sum of 1). A component replaces each of its
    numbers independently; v is the number that replaces u or z:

        powers   v = u^a for a uniform number u, a > 0             density ratio v^(1/a - 1) / a
        parts    v uniform in a part (low, high) of (0, 1)         density ratio 1 / (high - low)
        shifts   v = z + d for a standard normal number z          density ratio exp(d v - d^2 / 2)

    A density ratio is the component's density over the profile's, at the value v. The weight of a
    simulation is the profile's density over the mixture's. Each number may be transformed only
    once, because each call multiplies the ratios. Numbers of several vehicles may have one name.

    Source:
        Owen and Zhou (2000), "Safe and effective importance sampling".
    """

    def __init__(self, components: Sequence[Component], seed: int, scenario_index: U64) -> None:
        """Decide which component each simulation is drawn from.

        Args:
            components: Components of the specification; without any, no number is replaced.
            seed: Seed of the data set.
            scenario_index: Index of each scenario, shape (simulation,).
        """
        num_simulations = len(scenario_index)
        # A component may have several *tempers*: weaker copies of itself, whose powers and shifts
        # change less, so that weights do not differ widely. The copies divide its share equally.
        self._components = tuple(
            copy for component in components for copy in component.at_each_temper()
        )
        # For each component, the simulations that are drawn from it, shape (simulation,).
        self._is_drawn_from: list[Mask] = []
        total_share = 0.0
        if self._components:
            u = RandomStream(seed, scenario_index, Stream.PROPOSAL).uniform()
            for component in self._components:
                low, total_share = total_share, total_share + component.share
                self._is_drawn_from.append((u >= np.float32(low)) & (u < np.float32(total_share)))
        self._profile_share = np.full(num_simulations, 1.0 - total_share)
        # For each component, the product of the ratios of all numbers so far, shape (simulation,).
        # float64, because products of many ratios leave the range of float32.
        self._density_ratios = [np.ones(num_simulations, np.float64) for _ in self._components]

    def transform(self, name: str, profile_number: F32) -> F32:
        """Replace a number of the profile by the number of the simulation's component.

        Args:
            name: Name of the number. Components change only numbers whose names are in
                `PROPOSAL_UNIFORMS` or `PROPOSAL_NORMALS` of `scenarios.specification`.
            profile_number: The number as the profile draws it: uniform in (0, 1), or standard
                normal, shape (simulation,). A normal number must not be truncated yet: the density
                ratio of a shift holds for the unlimited normal distribution.

        Returns:
            The numbers to use, the same shape.
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
        """The profile's density over the mixture's, for the numbers drawn so far, (simulation,).

        After the last number it is the sampling weight. A part of the mixture, 1 minus the sum of
        the shares, is drawn from the profile itself, so no weight exceeds the reciprocal of this
        part.
        """
        mixture_over_profile = self._profile_share
        for component, ratio in zip(self._components, self._density_ratios, strict=True):
            mixture_over_profile = mixture_over_profile + component.share * ratio
        return 1.0 / mixture_over_profile


def _transform_number(component: Component, name: str, profile_number: F32) -> F32:
    """The numbers as the component draws them, shape (simulation,)."""
    if name in component.powers:
        return power(profile_number, np.float32(component.powers[name]))
    if name in component.parts:
        return scale_to_range(profile_number, *component.parts[name])
    # Numbers that a component does not name stay as they are: shift 0, ratio 1.
    return profile_number + np.float32(component.shifts.get(name, 0.0))


def _density_ratio(component: Component, name: str, drawn: F32) -> F64:
    """The component's density over the profile's, at the drawn values, shape (simulation,)."""
    if name in component.powers:
        inverse = np.float32(1.0 / component.powers[name])
        ratio = inverse * power(drawn, inverse - np.float32(1.0))
    elif name in component.parts:
        low, high = (np.float32(limit) for limit in component.parts[name])
        is_inside = (drawn >= low) & (drawn <= high)
        ratio = np.where(is_inside, np.float32(1.0) / (high - low), np.float32(0.0))
    else:
        shift = np.float32(component.shifts.get(name, 0.0))
        ratio = exp(shift * (drawn - np.float32(0.5) * shift))
    return ratio.astype(np.float64)
