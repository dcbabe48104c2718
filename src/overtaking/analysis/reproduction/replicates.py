"""Many sets as large as the paper's: one large run, cut into replicates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.validation.overtakes import flying
from overtaking.core.process_limits import ordered_map
from overtaking.data.plan import CHUNK_SIZE, runs
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.model.verdicts import OvertakeClass
from overtaking.scenarios.sampler import ScenarioSource

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.data.recipe import Simulator
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification

Array = NDArray[Any]

SIZE = 276
"""Simulations of a replicate: as many as the paper has."""

FEATURES = {
    "WT": "waiting_time",
    "OT": "overtaking_time",
    "NV": "num_vehicles",
    "SE": "ego_speed",
    "SP": "target_speed",
    "DSEP": "speed_difference",
    "D": "distance",
    "OLR": "left_occupancy",
    "PREC": "rain",
    "WIND": "wind",
    "FOG": "fog",
    "NIGHT": "night",
    "HORIZON": "low_sun",
}
"""Columns that are kept, by the paper's names, in SI; weather as shares, not percent."""

_PERCENT = ("PREC", "WIND", "FOG")
_OF_TARGET = ("SP", "DSEP", "D")


@dataclass(frozen=True, slots=True, kw_only=True)
class Replicates:
    """Sets of simulations; every array has shape (replicate, simulation).

    Attributes:
        classes: `OvertakeClass` under each policy, by its name.
        columns: `FEATURES` under the paper's reading; BEGUN: 1 where an attempt began; FLYING: 1
            for an overtake whose ego never slowed down to the speed of its target, 0 for another;
            NaN: nothing to measure.
    """

    classes: dict[str, Array]
    columns: dict[str, Array]

    @property
    def num_replicates(self) -> int:
        """How many sets there are."""
        return len(self.columns["SE"])


def replicates(
    spec: Specification,
    road: Road,
    seed: int,
    number: int,
    simulator: Simulator,
    step: Callable[[int], None] | None = None,
) -> Replicates:
    """Simulate and label sets of `SIZE` simulations.

    Args:
        spec: The specification.
        road: Its road.
        seed: Seed of the random numbers.
        number: Number of sets.
        simulator: The simulator.
        step: Called with the number of further simulations that are done.
    """
    total = number * SIZE

    def work(numbers: range) -> dict[str, Array]:
        index = np.arange(numbers.start, numbers.stop, dtype=np.uint64)
        return _kept(label(simulator.simulate(ScenarioSource(spec, road, seed).sample(index))))

    size = min(CHUNK_SIZE, simulator.chunk_size)
    parts: list[dict[str, Array]] = []
    for part in ordered_map(work, runs(0, total, size), simulator.threads):
        parts.append(part)
        if step is not None:
            step(len(part["SE"]))
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    shaped = {name: values.reshape(number, SIZE) for name, values in whole.items()}
    classes = {one.name: shaped.pop(one.name) for one in STORED_POLICIES}
    return Replicates(classes=classes, columns=shaped)


def _kept(labelled: LabelledTrajectories) -> dict[str, Array]:
    """The columns that are kept of a chunk: features, and classes by policy."""
    found = labelled.paper_features
    kept: dict[str, Array] = {
        name: np.asarray(getattr(found, field), np.float64) for name, field in FEATURES.items()
    }
    for name in _PERCENT:
        kept[name] = kept[name] / 100.0
    for name in _OF_TARGET:
        kept[name] = np.where(found.has_target, kept[name], np.nan)
    kept["BEGUN"] = labelled.events.has_attempt.astype(np.float64)
    at, is_flying = flying(labelled.trajectories, labelled.events)
    kept["FLYING"] = np.full(len(kept["SE"]), np.nan)
    kept["FLYING"][at] = is_flying
    for column, name in enumerate(labelled.labels.policies):
        kept[name] = labelled.labels.classes[:, column]
    return kept


def members(classes: Array, scope: str) -> Array:
    """Which simulations belong to a class by its title, or all."""
    for one in OvertakeClass:
        if one.title == scope:
            return classes == one
    return np.ones(classes.shape, bool)
