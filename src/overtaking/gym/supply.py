"""Scenarios for environments that begin new ones all the time, drawn many at a time."""

import dataclasses
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking import scenarios
from overtaking.model.batch import concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.world.parameters import Parameters, parameters

AHEAD = 256
"""Scenarios that are drawn at a time, if each environment has one at least ahead of it."""

Place = tuple["Piece", int]
"""A scenario: one of a piece."""


class Piece:
    """Scenarios that were drawn together, with their parameters."""

    def __init__(self, scenario: Scenario) -> None:
        """Work out the parameters."""
        self.scenario, self.given = scenario, parameters(scenario)


class Supply:
    """The scenarios of a number of environments.

    Episode k of environment i has the number first + i + k n: which scenarios an environment sees
    depends on nothing else.

    Args:
        spec: What to sample.
        road: Where.
        count: Environments, n.
        first: Number of the first scenario.
    """

    def __init__(self, spec: scenarios.Spec, road: Road, *, count: int, first: int) -> None:
        """Have drawn nothing yet."""
        self._spec, self._road, self._count, self._first = spec, road, count, first
        self.begin(0)

    def begin(self, seed: int) -> None:
        """Start again from the first episodes, with a seed."""
        self.seed = seed
        self._next = np.zeros(self._count, np.uint64)
        self._ready = [deque[Place]() for _ in range(self._count)]
        self._ahead = 1

    def take(self, rows: NDArray[np.int64]) -> list[Place]:
        """The next scenario of some environments."""
        if not all(self._ready[row] for row in rows):
            self._draw()
        return [self._ready[row].popleft() for row in rows]

    def _draw(self) -> None:
        """Draw ahead for all; first one scenario each, then twice as many at a time."""
        lacking = [self._ahead - len(ready) for ready in self._ready]
        rows = np.repeat(np.arange(self._count), np.maximum(lacking, 0))
        count = np.uint64(self._count)
        numbers = np.empty(len(rows), np.uint64)
        for place, row in enumerate(rows):
            numbers[place] = np.uint64(self._first + row) + self._next[row] * count
            self._next[row] += np.uint64(1)
        piece = Piece(scenarios.sample(self._spec, self._road, self.seed, numbers))
        for place, row in enumerate(rows):
            self._ready[row].append((piece, place))
        self._ahead = min(2 * self._ahead, max(1, AHEAD // self._count))


def given_of(places: list[Place]) -> Parameters:
    """The parameters of scenarios of one or several pieces, as a batch."""
    pieces, rows, back = _sorted(places)

    def joined(name: str) -> NDArray[Any]:
        """An array of the parameters, simulations last."""
        arrays = [getattr(one.given, name)[..., row] for one, row in zip(pieces, rows, strict=True)]
        return np.ascontiguousarray(np.concatenate(arrays, axis=-1)[..., back])

    names = ("vehicle", "simulation", "index")
    return dataclasses.replace(pieces[0].given, **{name: joined(name) for name in names})


def scenario_of(places: list[Place]) -> Scenario:
    """Scenarios of one or several pieces as a batch."""
    pieces, rows, back = _sorted(places)
    parts = [one.scenario.select(row) for one, row in zip(pieces, rows, strict=True)]
    return concatenate(parts).select(back)


def _sorted(
    places: list[Place],
) -> tuple[list[Piece], list[NDArray[np.int64]], NDArray[np.int64]]:
    """The pieces, which scenarios of each, and the way back to the order of `places`."""
    pieces = list(dict.fromkeys(piece for piece, _ in places))
    chosen = [[k for k, (one, _) in enumerate(places) if one is piece] for piece in pieces]
    rows = [np.array([places[k][1] for k in mine]) for mine in chosen]
    return pieces, rows, np.argsort([k for mine in chosen for k in mine])
