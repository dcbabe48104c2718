"""Drivers of the model in vehicles that another simulator, such as CARLA, moves.

The drivers perceive, decide and steer as in a simulation that the engine moves, 20 times a second,
and the same quantities are recorded. The compiled engine computes them; `sim.reference` has the
formulas. A tick is one advance of the other simulator and the interval of decisions, a step the
time step of the engine (10 ms), a frame a recorded instant, a slot the number of a vehicle in the
simulation.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from overtaking import _core
from overtaking.core.arrays import F32, U8, Buffers, Mask
from overtaking.core.native import simd_level
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.sim.engine import allocate_outputs, engine_inputs, to_trajectories
from overtaking.world.step_parameters import StepParameters


class VehicleMotion(NamedTuple):
    """Motion of all vehicles after a tick, each array of shape (slot,).

    The values of each vehicle are in the frame of its own direction of travel: stations increase
    ahead, lateral positions towards the overtaking side. Values of empty slots are ignored.

    Attributes:
        s, d: Station and lateral position of the centre [m].
        heading: Angle to the road, positive towards the overtaking side [rad].
        vx, vy: Velocity ahead and to the overtaking side, in the axes of the vehicle [m/s].
        yaw_rate: Yaw rate, positive towards the overtaking side [rad/s].
        accel_lon, accel_lat: Acceleration ahead and to the overtaking side, in the axes of the
            vehicle [m/s^2].
    """

    s: F32
    d: F32
    heading: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    accel_lon: F32
    accel_lat: F32


class VehicleContact(NamedTuple):
    """One event of a collision sensor of the other simulator.

    Attributes:
        slot: Slot of the vehicle with the sensor.
        other_slot: Slot of the other vehicle; -1 for other objects.
        tick: Number of the tick of the other simulator.
        impulse: Impulse on the vehicle, along the road and to its left [N s]; only its size counts.
    """

    slot: int
    other_slot: int
    tick: int
    impulse: tuple[float, float]


class DriverOutput(NamedTuple):
    """Requests of the drivers to their vehicles after a decision, each array of shape (slot,).

    Attributes:
        requested_accel: Requested acceleration [m/s^2].
        wheel_angle: Angle of the front wheels before `steer` turns them in this tick, positive to
            the overtaking side [rad]. A two-wheeler leans instead: the lateral acceleration that
            its lean balances [m/s^2].
        curvature: Curvature of a path that keeps the vehicle's present lateral position along the
            road, positive to the overtaking side [1/m].
        lateral_speed: Velocity across the road, towards the overtaking side [m/s].
        is_wreck: Whether the vehicle has collided or left the road.
        lights: Bits of `Lights` in the last recorded frame.
        end_step: Last step of the simulation.
    """

    requested_accel: F32
    wheel_angle: F32
    curvature: F32
    lateral_speed: F32
    is_wreck: Mask
    lights: U8
    end_step: int


class ExternallyMovedSimulation:
    """One simulation with the drivers of the model, whose vehicles another simulator moves.

    Args:
        scenario: A batch of one scenario.
        params: Its parameters.
        tick: Time between two decisions [s]; each call of `steer` turns the wheels for this time.
        level: SIMD level; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU does not have it.
    """

    def __init__(
        self, scenario: Scenario, params: StepParameters, tick: float, level: str | None = None
    ) -> None:
        """Allocate the memory of the recording; no driver has decided yet."""
        self._scenario, self._params = scenario, params
        self._outputs = allocate_outputs(scenario, params, Buffers())
        self._simulation = _core.ExternallyMovedSimulation(
            engine_inputs(params),
            tick=tick,
            frames=self._outputs["stage"].shape[1],
            # Flat views, into which the engine writes the recording.
            outputs={name: array.reshape(-1) for name, array in self._outputs.items()},
            level=simd_level(level),
        )

    @property
    def end_step(self) -> int:
        """Last step of the simulation."""
        return self._simulation.end_step()

    @property
    def is_ego_wrecked(self) -> bool:
        """Whether the ego has collided or left the road."""
        return self._simulation.is_ego_wrecked()

    def record_contacts(
        self, contacts: Sequence[VehicleContact], step: int, time_scale: float = 1.0
    ) -> None:
        """Record the first contact of each vehicle with another vehicle, and make it a wreck.

        A contact of the ego ends the simulation after `time.after_collision` of `model.toml`. The
        closing speed v follows from the impulse J = (1 + e) v / (1 / m1 + 1 / m2) of a central
        impact, with the coefficient of restitution e and the masses m1 and m2, because the other
        simulator does not report the velocities before the contact.

        Args:
            contacts: Contacts in the order of their ticks. Contacts with other objects, such as
                guard rails, are ignored.
            step: Number of the step of the contacts; may be before the first decision.
            time_scale: Ratio of a duration in the other simulator to the same duration in the
                recording. Speeds, and so impulses, are larger in the recording by this ratio.

        Source:
            Newton's law of restitution, as in `sim.reference.collisions`.
        """
        # Parameters have shape (slot, simulation); the batch has one simulation.
        constants, inverse_mass = self._params.constants, self._params.vehicles.inverse_mass[:, 0]
        restitution_factor = 1.0 + float(constants.restitution)
        time = float(np.float32(step) * constants.step)  # [s], in float32 as in the engine.
        contact_rows: list[tuple[int, int, float, float, float]] = []
        for contact in contacts:
            if contact.other_slot < 0:
                continue
            slot, other_slot = contact.slot, contact.other_slot
            sum_of_inverse_masses = float(inverse_mass[slot] + inverse_mass[other_slot])
            impulse = time_scale * math.hypot(*contact.impulse)
            closing_speed = impulse * sum_of_inverse_masses / restitution_factor
            contact_rows.append((slot, other_slot, time, impulse, closing_speed))
        self._simulation.record_contacts(contact_rows, step)

    def decide(self, motion: VehicleMotion, step: int) -> DriverOutput:
        """Let all drivers decide on the motion of this tick, and record a frame if one is due.

        Args:
            motion: Motion of all vehicles.
            step: Number of the step, a multiple of the steps between decisions (`SUBSTEPS`).
        """
        table, lights, end_step = self._simulation.decide(np.stack(motion), step)
        requested_accel, wheel_angle, curvature, lateral_speed, is_wreck = table
        return DriverOutput(
            requested_accel=requested_accel,
            wheel_angle=wheel_angle,
            curvature=curvature,
            lateral_speed=lateral_speed,
            is_wreck=is_wreck > 0.0,
            lights=lights,
            end_step=end_step,
        )

    def steer(self, wind_trim: F32) -> F32:
        """Turn the front wheels for one tick.

        Args:
            wind_trim: Part of the wheel angle [rad], or of the lateral acceleration of a
                two-wheeler [m/s^2], that compensates crosswind, shape (slot,). It replaces the part
                for the wind of the scenario, because the other simulator applies its own wind.

        Returns:
            Wheel angle [rad], or lateral acceleration of a two-wheeler [m/s^2], shape (slot,).
        """
        return self._simulation.steer(wind_trim)

    def record(
        self, motion: VehicleMotion, ego_stage: Stage, ego_indicator: float, step: int
    ) -> None:
        """Record a frame in which the other simulator's drivers drive all vehicles.

        Args:
            motion: Motion of all vehicles.
            ego_stage: Stage of the ego's overtake.
            ego_indicator: 1 towards the overtaking side, -1 towards the kerb side, 0 off.
            step: Number of the step, a multiple of the steps between frames.
        """
        self._simulation.record(np.stack(motion), float(ego_stage), ego_indicator, step)

    def end_at(self, step: int) -> None:
        """Set the last step of the simulation.

        Args:
            step: Number of the step.
        """
        self._simulation.end_at(step)

    def finish(self) -> Trajectories:
        """Complete the recording and return it; call this once."""
        self._simulation.finish()
        return to_trajectories(self._scenario, self._outputs)
