"""Vehicles of one simulation that a program drives by pedals and wheel angles, tick by tick.

The server that imitates CARLA moves its vehicles with this module. A tick is one advance of the
server; it has several steps of the compiled engine, which computes the motion and the contacts.
`sim.reference.pedal_driving` and `sim.reference.collisions` give the same bits and have the
formulas.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking import _core
from overtaking.core.arrays import F32
from overtaking.core.native import simd_level
from overtaking.model.pedal_controls import WHEEL_RATE, PedalControls
from overtaking.sim.engine import engine_inputs
from overtaking.world.step_parameters import StepParameters


class DrivenVehicles(NamedTuple):
    """State of the vehicles, the rows of a table of shape (field, vehicle).

    `DrivenVehicles(*table)` gives names to the rows of a table. Rows have shape (vehicle,) and are
    views: a value that is written to a row is in the table. Positions are on a plane ground with a
    fixed axis `s`, velocities and accelerations in the axes of each vehicle, angles anticlockwise.

    Attributes:
        s, d: Position of the centre along the axis and to its left [m].
        heading: Heading against the axis of `s` [rad].
        vx, vy: Velocity ahead and to the left [m/s].
        yaw_rate: Yaw rate [rad/s].
        wheel_angle: Angle of the front wheels [rad], or lateral acceleration of a two-wheeler
            [m/s^2].
        requested_accel: Acceleration that pedals, air and rolling resistance ask for [m/s^2].
        accel_lon, accel_lat: Mean acceleration over the last step ahead and to the left [m/s^2].
        gust: Random process of the wind, of unit variance [1].
        distance_error, speed_error, lane_wander: Random processes of a driver of the model [1].
            These vehicles have no such driver, but the engine draws all random processes together.
        mu_left, mu_right: Friction coefficient under the wheels of either side [1].
        wind_force: Lateral force of the wind [N].
        wind_moment: Yaw moment of the wind [N m].
        tail_wind: Wind along the heading, positive from behind [m/s].
    """

    s: F32
    d: F32
    heading: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    wheel_angle: F32
    requested_accel: F32
    accel_lon: F32
    accel_lat: F32
    gust: F32
    distance_error: F32
    speed_error: F32
    lane_wander: F32
    mu_left: F32
    mu_right: F32
    wind_force: F32
    wind_moment: F32
    tail_wind: F32


class ContactBodies(NamedTuple):
    """Rectangles that may touch: the rows of a table of shape (field, body).

    Attributes:
        s, d: Position of the centre along the axis of the ground and to its left [m].
        heading: Heading against the axis of `s`, anticlockwise [rad].
        vx, vy: Velocity ahead and to the left, in the axes of the body [m/s].
        yaw_rate: Yaw rate, anticlockwise [rad/s].
        half_length, half_width: Half the sides [m].
        inverse_mass: One over the mass, 0 for a body that no impulse moves [1/kg].
        inverse_inertia: One over the moment of inertia about the vertical [1/(kg m^2)].
    """

    s: F32
    d: F32
    heading: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    half_length: F32
    half_width: F32
    inverse_mass: F32
    inverse_inertia: F32


_FRICTION_AT_START = 0.8  # As in both simulators. `update_weather` overwrites it in each tick.


def driven_vehicles_at_start(num_vehicles: int) -> NDArray[np.float32]:
    """The table of vehicles that stand at the origin.

    Args:
        num_vehicles: Number of vehicles.

    Returns:
        Rows of `DrivenVehicles`, shape (field, vehicle).
    """
    table = np.zeros((len(DrivenVehicles._fields), num_vehicles), np.float32)
    vehicles = DrivenVehicles(*table)
    vehicles.mu_left[:] = vehicles.mu_right[:] = _FRICTION_AT_START
    return table


class PedalDriving:
    """Moves vehicles by their pedals and wheel angles, and finds their contacts.

    The engine has `_core.MAX_VEHICLES` slots, so more vehicles move in groups of that size. A truck
    shelters only the vehicles of its own group from the wind.

    Args:
        params: Parameters of a batch of one simulation. Its constants `step` and `decision` are the
            lengths of a step and of a tick [s].
        level: SIMD level; None for `OVERTAKING_SIMD` or the best of this CPU.

    Raises:
        ConfigError: The SIMD level is unknown, or this CPU does not have it.
    """

    def __init__(self, params: StepParameters, level: str | None = None) -> None:
        """Pass the parameters to the engine, once for all calls."""
        checked_level = simd_level(level)
        num_vehicles = params.vehicle_table.shape[1]
        self._groups: list[tuple[slice, _core.PedalDriving]] = []
        for group_index, first in enumerate(range(0, num_vehicles, _core.MAX_VEHICLES)):
            group = slice(first, min(first + _core.MAX_VEHICLES, num_vehicles))
            # Random numbers depend on scenario index and slot, and the slots of each group start at
            # 0. With its own index each group has its own gusts. Indices of sampled scenarios are
            # far below 2^32, so no other scenario has this index.
            scenario_index = params.scenario_index + np.uint64(group_index << 32)
            params_of_group = dataclasses.replace(
                params,
                vehicle_table=params.vehicle_table[:, group],
                scenario_index=scenario_index,
            )
            driving = _core.PedalDriving(engine_inputs(params_of_group), checked_level)
            self._groups.append((group, driving))

    def update_weather(self, table: NDArray[np.float32], decision_index: int) -> None:
        """Write gusts, friction and wind of a tick into a table of vehicles.

        Args:
            table: Rows of `DrivenVehicles`, shape (field, vehicle), changed in place.
            decision_index: Number of the tick, which the random numbers depend on.
        """
        for group, driving in self._groups:
            # The engine takes only contiguous arrays, so the group is copied and written back.
            part = np.ascontiguousarray(table[:, group])
            driving.update_weather(part, decision_index)
            table[:, group] = part

    def drive(self, table: NDArray[np.float32], controls: PedalControls, num_steps: int) -> None:
        """Move all vehicles by some steps, without detection of contacts.

        Args:
            table: Rows of `DrivenVehicles`, shape (field, vehicle), changed in place.
            controls: Pedals and steering, which hold for all steps.
            num_steps: Number of steps, each as long as the constant `step`.
        """
        control_table = np.stack(
            [controls.throttle, controls.brake, controls.wheel_angle], dtype=np.float32
        )
        for group, driving in self._groups:
            part = np.ascontiguousarray(table[:, group])
            part_of_controls = np.ascontiguousarray(control_table[:, group])
            driving.drive(part, part_of_controls, float(WHEEL_RATE), num_steps)
            table[:, group] = part

    def resolve_contacts(
        self,
        bodies: NDArray[np.float32],
        old_positions: NDArray[np.float32],
        pairs: Sequence[tuple[int, int]],
    ) -> NDArray[np.int32]:
        """Exchange momentum between the bodies of each pair that touched during the last step.

        Args:
            bodies: Rows of `ContactBodies` after the step, shape (field, body). Motion after a
                contact is written in place.
            old_positions: `s` and `d` before the step [m], shape (2, body).
            pairs: Columns of two bodies that may have touched, in the order of resolution.

        Returns:
            Column of the first body that each body touched during the step, -1 without a contact,
            (body,).

        Source:
            Formulas and their sources: `sim.reference.collisions.resolve_contacts`.
        """
        pair_table = np.array(pairs, np.uint32).reshape(-1, 2)
        # The engine reads only `bodies` here, so any group can resolve the contacts of all groups.
        _, driving = self._groups[0]
        return driving.resolve_contacts(bodies, old_positions, pair_table)
