"""One tick of vehicles under pedal and wheel control, as in a CARLA server.

The compiled engine computes the tick if it has enough slots for the vehicles, else the reference.
Both give the same bits; `sim.reference.pedal_driving` documents the model.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.native import simd_level
from overtaking.sim.engine import road_values
from overtaking.sim.reference import pedal_driving as reference
from overtaking.sim.reference.pedal_driving import TABLE_FIELDS, WHEEL_RATE, PedalControls
from overtaking.sim.reference.state import State
from overtaking.world.constants import ModelConstants, engine_constants
from overtaking.world.step_parameters import StepParameters


class PedalDriving(Protocol):
    """Moves the vehicles of one simulation from tick to tick, by pedals and wheel angles."""

    @property
    def constants(self) -> ModelConstants:
        """Constants of the model, with the lengths of step and tick."""
        ...

    def weather(self, state: State, decision: int) -> None:
        """Update gusts, friction and wind for the tick with the number `decision`."""
        ...

    def drive(self, state: State, controls: PedalControls, steps: int) -> None:
        """Move all vehicles by some steps, without detection of collisions."""
        ...


def pedal_driving(params: StepParameters) -> PedalDriving:
    """The engine for one simulation, or the reference if the engine has too few slots for it.

    Args:
        params: Parameters of a batch of one simulation, with the lengths of step and tick among the
            constants.
    """
    is_small = params.vehicle_table.shape[1] <= _core.MAX_VEHICLES
    return EnginePedalDriving(params) if is_small else ReferencePedalDriving(params)


class ReferencePedalDriving:
    """Pedal driving by the reference, for any number of vehicles.

    Args:
        params: As in `pedal_driving`.
    """

    def __init__(self, params: StepParameters) -> None:
        """Keep the parameters."""
        self.constants, self._params = params.constants, params

    def weather(self, state: State, decision: int) -> None:
        """See `PedalDriving`."""
        reference.update_weather(state, self._params, decision)

    def drive(self, state: State, controls: PedalControls, steps: int) -> None:
        """See `PedalDriving`."""
        reference.drive(state, self._params, controls, steps)


class EnginePedalDriving:
    """Pedal driving by the compiled engine.

    Args:
        params: As in `pedal_driving`, with no more vehicles than the engine has slots.
        level: SIMD level; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU lacks it.
    """

    def __init__(self, params: StepParameters, level: str | None = None) -> None:
        """Convert the parameters once to the flat arrays that the engine takes at every tick."""
        self.constants = params.constants
        self._level = simd_level(level)
        self._inputs: dict[str, Any] = {
            "vehicle": np.ascontiguousarray(params.vehicle_table, np.float32).reshape(-1),
            "simulation": np.ascontiguousarray(params.simulation_table, np.float32).reshape(-1),
            "scenario_index": params.scenario_index,
            "num_slots": params.vehicle_table.shape[1],
            "seed": params.seed,
            "road": road_values(params),
            "constants": engine_constants(params.constants),
        }

    def weather(self, state: State, decision: int) -> None:
        """See `PedalDriving`."""
        table = _to_table(state)
        _core.weather_driven(self._inputs, table, decision, self._level)
        _write_to_state(state, table)

    def drive(self, state: State, controls: PedalControls, steps: int) -> None:
        """See `PedalDriving`."""
        table = _to_table(state)
        rows = [controls.throttle, controls.brake, controls.wheel_angle]
        control_table = np.concatenate([row.reshape(1, -1) for row in rows]).astype(np.float32)
        _core.drive(self._inputs, table, control_table, float(WHEEL_RATE), steps, self._level)
        _write_to_state(state, table)


def _to_table(state: State) -> NDArray[np.float32]:
    """A copy of the fields `TABLE_FIELDS` of a state, shape (field, vehicle).

    The engine changes the table in place.
    """
    columns = [getattr(getattr(state, group), name) for group, name in TABLE_FIELDS]
    return np.concatenate(columns, axis=1).T.copy()


def _write_to_state(state: State, table: NDArray[np.float32]) -> None:
    """Write the rows of a table of shape (field, vehicle) into the fields of a state."""
    for (group, name), row in zip(TABLE_FIELDS, table[:, :, None], strict=True):
        setattr(getattr(state, group), name, row)
