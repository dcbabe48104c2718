"""Futures of a simulation: the same up to an instant, other random numbers from there on."""

from dataclasses import dataclass, replace

import numpy as np

from overtaking.core.arrays import F32, U64
from overtaking.model.scenario import BranchOrigin, ForcedDecision, Intervention, Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.sim import engine
from overtaking.sim.branching import (
    apply_intervention,
    simulate_versions,
    versions_by_frame,
    with_final_conditions,
)

_APART = np.uint64(1 << 40)
"""Distance of the numbers by which two futures of a simulation are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Futures:
    """The simulation from an instant on, once for each future.

    Attributes:
        scenario: The scenarios, shape (future,).
        index: Numbers by which later decisions are drawn, (future,).
        judged: As in `world.step_parameters.Parameters`.
    """

    scenario: Scenario
    index: U64
    judged: F32 | None = None


def copies(world: BranchOrigin, frame: int, count: int) -> Futures:
    """Futures in which all are as they are; the first has the simulation's own numbers.

    Args:
        world: A simulation, and what is changed in it.
        frame: When they begin.
        count: How many.
    """
    scenario = world.scenario
    for one in world.interventions:
        scenario = apply_intervention(scenario, one) if one.frame <= frame else scenario
    many = scenario.select(np.zeros(count, np.int64))
    return Futures(
        scenario=many, index=many.scenario_index + _APART * np.arange(count, dtype=np.uint64)
    )


def started(world: BranchOrigin, frame: int, many: Futures) -> Trajectories:
    """Futures in which the ego stays in its lane until a frame, and then begins an overtake.

    Args:
        world: A simulation, and what is changed in it whatever the ego decides.
        frame: The frame.
        many: What the simulation is from there on, until the next change.
    """
    before = world.scenario.select(np.zeros(len(many.index), np.int64))
    stays = (Intervention(decision=ForcedDecision.STAY), *world.interventions)
    stages = [one for one in versions_by_frame(before, stays) if one.frame < frame]
    later = (one for one in world.interventions if one.frame > frame)
    starts = (Intervention(frame=frame, decision=ForcedDecision.PULL_OUT), *later)
    stages += [
        replace(one, scenario_index=many.index, judgement_errors=many.judged)
        for one in versions_by_frame(many.scenario, starts)
    ]
    # Places at the start are those before; what follows is judged by the people of the future.
    return with_final_conditions(
        simulate_versions(before, stages, engine.run), before, stages, world.interventions
    )
