"""Draws from where more happens, and knows by how much more often that is.

A simulation is drawn with probability `share` from the proposal's bent distributions and otherwise
from the profile's own, so it has the density (1 - share) p + share q, and its weight is p over that
(Owen and Zhou 2000, "Safe and effective importance sampling"). Weights never exceed
1 / (1 - share), so the effective sample size is at least (1 - share) n, whatever is bent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.elementary import F32, power
from overtaking.core.philox import U64, Stream
from overtaking.scenarios.noise import Noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.scenarios.schema_flow import Proposal


Bend = Callable[[str, F32], F32]
"""Draws a named number in (0, 1) from where more happens; each name is asked for once."""


def as_met(name: str, u: F32) -> F32:
    """Bends nothing."""
    del name
    return u


class Bending:
    """The uniform numbers of a batch, bent where the proposal says so; used once for each name."""

    def __init__(self, spec: Proposal | None, seed: int, index: U64) -> None:
        """Decide which simulations are drawn from the bent distributions.

        Args:
            spec: What the specification says; None bends nothing.
            seed: Seed of the data set.
            index: Simulation numbers, shape (simulation,).
        """
        self._powers = spec.powers if spec else {}
        self._share = spec.share if spec else 0.0
        drawn = Noise(seed, index, Stream.PROPOSAL).uniform() if spec else np.ones(len(index))
        self._bent = drawn < np.float32(self._share)
        self._density = np.ones(len(index), np.float64)

    def __call__(self, name: str, u: F32) -> F32:
        """The number to use in place of `u`, shape (simulation,)."""
        if name not in self._powers:
            return u
        exponent = self._powers[name]
        v = np.where(self._bent, power(u, np.full_like(u, exponent)), u)
        inverse = np.float32(1.0 / exponent)
        density = inverse * power(v, np.full_like(v, inverse - np.float32(1.0)))
        self._density = self._density * density.astype(np.float64)
        return v

    @property
    def weight(self) -> NDArray[np.float64]:
        """Profile's density over the one that was drawn from, shape (simulation,)."""
        return 1.0 / ((1.0 - self._share) + self._share * self._density)
