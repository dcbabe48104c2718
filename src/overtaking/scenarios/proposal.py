"""Draws from where more happens, and knows by how much more often that is.

A simulation is drawn from one of the proposal's components k with probability share_k, and else
from the profile's own distributions, so it has the density (1 - sum share_k) p + sum share_k q_k,
and its weight is p over that (Owen and Zhou 2000, "Safe and effective importance sampling"),
whichever it was drawn from. Weights never exceed 1 / (1 - sum share_k), so the effective sample
size is at least that part of n, whatever is bent.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U64, Mask
from overtaking.core.compiled import exp, power
from overtaking.core.philox import Stream
from overtaking.scenarios.noise import Noise, spread
from overtaking.scenarios.schema_flow import Component, Proposal

Bend = Callable[[str, F32], F32]
"""Draws a named number, uniform in (0, 1) or standard normal, from where more happens."""


def as_met(name: str, u: F32) -> F32:
    """Bends nothing."""
    del name
    return u


class Bending:
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
        drawn = Noise(seed, index, Stream.PROPOSAL).uniform() if spec else np.ones(len(index))
        self._taken: list[Mask] = []
        below = 0.0
        for one in self._components:
            above = below + one.share
            self._taken.append((drawn >= np.float32(below)) & (drawn < np.float32(above)))
            below = above
        self._natural = np.full(len(index), 1.0 - below)
        self._densities = [np.ones(len(index), np.float64) for _ in self._components]

    def __call__(self, name: str, number: F32) -> F32:
        """The number to use in place of `number`, shape (simulation,)."""
        if not any(name in kind for one in self._components for kind in _kinds(one)):
            return number
        drawn = number
        for one, taken in zip(self._components, self._taken, strict=True):
            drawn = np.where(taken, _moved(one, name, number), drawn)
        for one, density in zip(self._components, self._densities, strict=True):
            density *= _density(one, name, drawn)
        return drawn

    @property
    def weight(self) -> NDArray[np.float64]:
        """Profile's density over the one that was drawn from, shape (simulation,)."""
        drawn_from = self._natural
        for one, density in zip(self._components, self._densities, strict=True):
            drawn_from = drawn_from + one.share * density
        return 1.0 / drawn_from


def _kinds(component: Component) -> tuple[Mapping[str, object], ...]:
    return component.powers, component.parts, component.shifts


def _moved(component: Component, name: str, number: F32) -> F32:
    """The number as the component draws it."""
    if name in component.powers:
        return power(number, np.full_like(number, component.powers[name]))
    if name in component.parts:
        return spread(number, *component.parts[name])
    return number + np.float32(component.shifts.get(name, 0.0))


def _density(component: Component, name: str, drawn: F32) -> NDArray[np.float64]:
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
