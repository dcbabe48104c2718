"""A batch that another driver takes from decision to decision, on either engine."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.elementary import F32, Mask
from overtaking.sim.engine import road_values
from overtaking.sim.reference.stepper import Stepper as ReferenceStepper
from overtaking.world.compiled import chosen_level, constant_values
from overtaking.world.parameters import Parameters


class Stepper(Protocol):
    """A batch that waits at every decision for orders; both engines give the same bits.

    A simulation that ends is observed once more, after the step in which it has ended.
    """

    def begin(self) -> tuple[F32, Mask]:
        """What is observed at first: numbers of shape (simulation, `WIDTH`), and who runs."""
        ...

    def step(self, values: NDArray[np.int32], decisions: int) -> tuple[F32, Mask]:
        """What is observed after some decisions with the same orders.

        Args:
            values: Steps of each number of the action, shape (simulation, `MOST_PARTS`).
            decisions: How many, one at least.
        """
        ...


def stepper(
    given: Parameters,
    kind: str | None,
    *,
    is_true: bool,
    simulator: str = "engine",
    level: str | None = None,
) -> Stepper:
    """A batch before its first decision.

    Args:
        given: Its parameters.
        kind: A name in `model.actions.KINDS`; None where the model's own driver decides.
        is_true: Whether the truth is observed, not what the ego believes.
        simulator: `engine` or `reference`.
        level: SIMD level of the engine; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU lacks it.
    """
    if simulator == "reference":
        return ReferenceStepper(given, kind, is_true=is_true)
    return _core.Stepper(batch_values(given), kind, is_true, chosen_level(level))


def batch_values(given: Parameters) -> dict[str, Any]:
    """A batch as the compiled stepper takes it, at first and in place of simulations."""
    return {
        "vehicle": given.vehicle.reshape(-1),
        "simulation": given.simulation.reshape(-1),
        "index": given.index,
        "slots": given.vehicle.shape[1],
        "seed": given.seed,
        "record_every": given.record_every,
        "road": road_values(given),
        "constants": constant_values(given.constants),
    }
