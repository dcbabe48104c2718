"""A test bench: vehicles on an endless plane, which a test steers instead of a driver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from overtaking.sim.reference import road_conditions, steering, vehicle_dynamics
from overtaking.sim.reference.state import State
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import StepParameters, VehicleParameters, step_parameters

from .worlds import Vehicle, scenario, wide_road

if TYPE_CHECKING:
    from overtaking.world.constants import ModelConstants
    from overtaking.world.weather_parameters import SimulationParameters

F64 = np.ndarray

LANE = 7
"""Its centre lies 3 m from d = 0, where float32 is finest."""

DECISION = 0.05
"""Time between two decisions, the longest step [s]."""

RECORDED = ("s", "d", "heading", "vx", "vy", "yaw_rate", "accel_lon", "accel_lat")

Action = Callable[["Bench", float], None]


@dataclass(slots=True, kw_only=True)
class Bench:
    """Vehicles of a batch, one in each simulation, and their state.

    Attributes:
        params: Parameters of the batch.
        state: Current state, arrays of shape (1, simulation).
        constants: Constants; their `step` may have been changed.
        vehicles: Vehicle parameters by name, as in `params`.
        simulations: Simulation parameters by name, as in `params`.
        updates_friction: Whether friction follows from the weather at each decision.
        updates_wind: Whether the wind follows from the weather at each decision.
    """

    params: StepParameters
    state: State
    constants: ModelConstants
    vehicles: VehicleParameters
    simulations: SimulationParameters
    updates_friction: bool
    updates_wind: bool

    def drive(self, duration: float, action: Action | None = None) -> dict[str, F64]:
        """Advance by `duration` seconds.

        Args:
            duration: Time to drive [s].
            action: Called before each step with the time of its middle since the start of this
                call; it moves the wheel and the pedals of the state.

        Returns:
            Times `t` of shape (step + 1,) and the fields of `RECORDED` of shape
            (step + 1, simulation), the start included.
        """
        step = float(self.constants.step)
        count = round(duration / step)
        decision = round(DECISION / step)
        rows = {name: [getattr(self.state.motion, name)[0].copy()] for name in RECORDED}
        for k in range(count):
            if k % decision == 0:
                self.decide()
            if action is not None:
                action(self, (k + 0.5) * step)
            self.move(self.state.controls.wheel_angle)
            for name, values in rows.items():
                values.append(getattr(self.state.motion, name)[0].copy())
        history = {name: np.array(values, np.float64) for name, values in rows.items()}
        return history | {"t": np.arange(count + 1) * step}

    def move(self, wheel: F64) -> None:
        """Advance all vehicles by one step with this wheel angle in the middle of the step."""
        vehicle_dynamics.advance_motion(self.state, self.params, wheel, self.constants.step)

    def steer(self, side_accel: F64) -> F64:
        """Let drivers steer for one step; return the wheel angle in the middle of the step."""
        return steering.steer(self.state, self.params, side_accel, self.constants.step)

    def drive_one(self, wheel: F64) -> dict[str, float]:
        """Advance all simulations by one step, and return the motion of the first."""
        self.move(wheel)
        return {name: float(getattr(self.state.motion, name)[0, 0]) for name in RECORDED}

    def hold(self, *, wheel: float | F64 = 0.0, accel: float | F64 = 0.0) -> None:
        """Set wheel angle and requested acceleration, one for all or one for each simulation."""
        zero = np.zeros_like(self.state.motion.s)
        self.state.controls.wheel_angle = zero + np.asarray(wheel, np.float32)
        self.state.controls.requested_accel = zero + np.asarray(accel, np.float32)

    def decide(self) -> None:
        """Update friction and wind, as the simulation does at a decision."""
        if self.updates_friction:
            road_conditions.update_friction(self.state, self.params)
        if self.updates_wind:
            road_conditions.update_wind(self.state, self.params)


def bench(
    *vehicles: Vehicle,
    friction: float | Sequence[float] | None = 0.9,
    sky: dict[str, float] | None = None,
    step: float = DECISION,
) -> Bench:
    """Put vehicles on the bench, straight ahead at their start speed.

    Args:
        vehicles: One for each simulation; their lanes do not matter.
        friction: Friction of each simulation; None for the friction in the weather at each
            decision.
        sky: Differences of the weather from a clear sky; with them the wind blows, without gusts.
        step: Time step [s].
    """
    world = scenario(
        *[[replace(one, lane=LANE)] for one in vehicles],
        road=wide_road(lanes=8, width=6.0),
        weather=sky,
        num_slots=1,
    )
    params = step_parameters(world, EnabledEffects(gusts=False, wake=False))
    # Stability control has a test of its own.
    constants = params.constants.replace(step=step, stability_threshold=1e9)
    state = State.at_start(params)
    if friction is not None:
        state.friction_and_wind.mu_left = state.motion.s * np.float32(0.0) + np.asarray(
            friction, np.float32
        )
        state.friction_and_wind.mu_right = state.friction_and_wind.mu_left.copy()
    return Bench(
        params=replace(params, constants=constants),
        state=state,
        constants=constants,
        vehicles=params.vehicles,
        simulations=params.simulations,
        updates_friction=friction is None,
        updates_wind=sky is not None,
    )
