"""Futures of a simulation: the same up to an instant, other random numbers from there on."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32
from overtaking.core.philox import U64
from overtaking.model.decision import Decision
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.sim import engine
from overtaking.sim.branch import Version, run_versions

_APART = np.uint64(1 << 40)
"""Distance of the numbers by which two futures of a simulation are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Futures:
    """What a simulation is from an instant on, once for each future.

    Attributes:
        scenario: The scenarios, shape (future,).
        index: Numbers by which later decisions are drawn, (future,).
        judged: As in `world.parameters.Parameters`.
    """

    scenario: Scenario
    index: U64
    judged: F32 | None = None


def copies(scenario: Scenario, count: int) -> Futures:
    """Futures in which all are as they are; the first has the simulation's own numbers.

    Args:
        scenario: A batch of one.
        count: How many.
    """
    many = scenario.select(np.zeros(count, np.int64))
    return Futures(scenario=many, index=many.index + _APART * np.arange(count, dtype=np.uint64))


def started(scenario: Scenario, frame: int, many: Futures) -> Trajectories:
    """Futures in which the ego stays in its lane until a frame, and then begins an overtake.

    Args:
        scenario: A batch of one.
        frame: The frame.
        many: What the simulation is from there on.
    """
    before = scenario.select(np.zeros(len(many.index), np.int64))
    stays = Version(frame=0, scenario=before, decision=Decision.STAY)
    goes = Version(
        frame=frame,
        scenario=many.scenario,
        decision=Decision.PULL_OUT,
        index=many.index,
        judged=many.judged,
    )
    found = run_versions(before, [stays, goes], engine.run)
    # Places at the start are those before; what follows is judged by the people of the future.
    return found.replace(scenario=before.replace(drivers=many.scenario.drivers))
