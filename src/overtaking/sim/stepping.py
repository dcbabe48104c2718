"""A batch that another driver takes from decision to decision, on either engine."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.native import simd_level
from overtaking.sim.engine import road_values
from overtaking.sim.reference.stepper import SteppedObservation
from overtaking.sim.reference.stepper import Stepper as ReferenceStepper
from overtaking.world.constants import engine_constants
from overtaking.world.step_parameters import StepParameters


class Stepper(Protocol):
    """A batch that waits at every decision for orders; both engines give the same bits.

    The last observation of a simulation is the one at its end, even if an order was to hold longer.
    """

    def begin(self) -> SteppedObservation:
        """The observations at the start."""
        ...

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """Carry out the same orders for some decisions.

        Args:
            values: Steps of each number of the action, shape (simulation, `MAX_ACTION_PARTS`).
            decisions: How many, one at least.
        """
        ...


def stepper(
    given: StepParameters,
    kind: str | None,
    *,
    is_true: bool,
    simulator: str = "engine",
    level: str | None = None,
) -> Stepper:
    """A batch before its first decision.

    Args:
        given: Its parameters.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        is_true: Whether the truth is observed, not what the ego believes.
        simulator: `engine` or `reference`.
        level: SIMD level of the engine; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU lacks it.
    """
    if simulator == "reference":
        return ReferenceStepper(given, kind, is_true=is_true)
    return Renewable(given, kind, is_true=is_true, level=level)


class Renewable:
    """The compiled stepper, in whose rows new simulations can begin while others go on.

    Args:
        given: Parameters of a batch.
        kind: A name in `model.driver_interface.ACTION_KINDS`; None where the model's own driver
            decides.
        is_true: Whether the truth is observed, not what the ego believes.
        level: As in `stepper`.
    """

    def __init__(
        self, given: StepParameters, kind: str | None, *, is_true: bool, level: str | None = None
    ) -> None:
        """Stand before the first decision."""
        self._batch = _core.Stepper(_values(given), kind, is_true, simd_level(level))

    def begin(self) -> SteppedObservation:
        """As `Stepper.begin`."""
        return SteppedObservation(*self._batch.begin())

    def step(self, values: NDArray[np.int32], decisions: int) -> SteppedObservation:
        """As `Stepper.step`."""
        return SteppedObservation(*self._batch.step(values, decisions))

    def renew(self, rows: NDArray[np.int64], parameters: StepParameters) -> SteppedObservation:
        """Begin new simulations in some rows.

        Args:
            rows: The rows in which they begin, each once.
            parameters: Their parameters: on the same road, with the same seed and number of slots.

        Returns:
            The observations at their start, shape (row, `OBSERVATION_SIZE`).
        """
        return SteppedObservation(*self._batch.renew(rows, _values(parameters)))


def _values(given: StepParameters) -> dict[str, Any]:
    """A batch as the compiled stepper takes it."""
    return {
        "vehicle": given.vehicle_table.reshape(-1),
        "simulation": given.simulation_table.reshape(-1),
        "index": given.scenario_index,
        "slots": given.vehicle_table.shape[1],
        "seed": given.seed,
        "steps_per_frame": given.steps_per_frame,
        "road": road_values(given),
        "constants": engine_constants(given.constants),
    }
