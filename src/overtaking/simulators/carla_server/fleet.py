"""The vehicles of the headless server, moved by the dynamics of our model.

Vehicles live in the frame of the road (`GroundFrame`): s along it, d to its left, heading
anticlockwise. On a road of ours that is the road's own frame, so films, puddles and the shelter of
lorries are where they are in a simulation. On another map it is the map's, water lies as on a
single lane and no vehicle shelters another.
"""

import dataclasses
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32
from overtaking.core.float32_math import ZERO
from overtaking.core.units import kmh_from_mps
from overtaking.model.pedal_controls import PedalControls
from overtaking.sim.pedal_driving import (
    ContactBodies,
    DrivenVehicles,
    PedalDriving,
    driven_vehicles_at_start,
)
from overtaking.simulators.carla_server.arguments import Control
from overtaking.simulators.carla_server.bodies import Body, Nature, scenario_of
from overtaking.simulators.carla_server.motion import (
    LEVELS_APART,
    ContactImpulse,
    GroundFrame,
    Obstacle,
    PlanarMotion,
    SteeringLimits,
    VehicleDynamics,
    boxes_overlap,
    rotate,
)
from overtaking.world.step_parameters import StepParameters, step_parameters

MAX_STEP_TIME = 0.05
"""Longest step of the dynamics, as in a simulation [s]."""

HAND_BRAKE = 0.6
"""Part of the brakes that the hand brake has."""

REVERSE_ACCEL = 2.0
"""Acceleration in reverse at full throttle [m/s^2]."""

MAX_REVERSE_SPEED = 8.0
"""Fastest reverse [m/s]."""

CLEARANCE = 0.2
"""Height of obstacles over which vehicles drive without contact [m]; our choice."""

# Two vehicles may touch in a tick if they are nearer than a margin [m] plus the distance by which
# they approach. An acceleration [m/s^2] may make them approach faster. Both numbers are choices.
_CONTACT_MARGIN = 0.5
_MAX_APPROACH_ACCEL = 20.0
_NO_CONTROL = Control()
_DEFAULT_STEERING = SteeringLimits()
_SLIDING_DECEL = 5.0  # Deceleration of a sliding prop, friction 0.5 [m/s^2].
_MIN_FRICTION_FACTOR = 0.01  # Without any friction the tyre model has no stiffness to divide by.
# Rows of `DrivenVehicles` and of `ContactBodies`: s, d, heading, vx, vy and yaw_rate come first in
# both. A contact changes all six.
_PUSHED = slice(0, 6)
_PLACED = slice(0, 3)


@dataclass(slots=True)
class FleetVehicle:
    """Properties of a vehicle of the fleet, beside its state in the table of driven vehicles.

    Attributes:
        body: Parameters of the body.
        row: Its column in the table of driven vehicles.
        steering: Limits of its wheel angle.
        height: Height of the ground under it [m]; vehicles on different levels never touch.
        has_physics: Whether physics moves it, or only `Fleet.place`.
        reverse_speed: Speed in reverse [m/s].
        held_velocity: Velocity ahead and to the left that it keeps; None lets pedals decide [m/s].
        force: Force on it during the next tick, along and across the ground [N].
        torque: Torque on it during the next tick, anticlockwise [N m].
    """

    body: Body
    row: int = 0
    steering: SteeringLimits = _DEFAULT_STEERING
    height: float = 0.0
    has_physics: bool = True
    reverse_speed: float = 0.0
    held_velocity: tuple[float, float] | None = None
    force: tuple[float, float] = (0.0, 0.0)
    torque: float = 0.0


class Fleet:
    """All vehicles, in the order in which they were added.

    Args:
        ground: What they stand on.
        weather: The fourteen numbers of `carla.WeatherParameters`.
        nature: What they leave open.
    """

    def __init__(self, ground: GroundFrame, weather: Sequence[float], nature: Nature) -> None:
        """Start without vehicles."""
        self._ground, self._weather, self._nature = ground, tuple(weather), nature
        self._vehicles: dict[int, FleetVehicle] = {}
        self._obstacles: dict[int, Obstacle] = {}
        self._moved: dict[int, PlanarMotion] = {}
        self._decision = 0
        self._table = driven_vehicles_at_start(0)
        self._pedal_driving: tuple[float, PedalDriving] | None = None

    def __contains__(self, vehicle: int) -> bool:
        """Whether this vehicle exists."""
        return vehicle in self._vehicles

    def __getitem__(self, vehicle: int) -> FleetVehicle:
        """Record of a vehicle."""
        return self._vehicles[vehicle]

    def add(self, vehicle: int, body: Body, motion: PlanarMotion) -> None:
        """Put a vehicle on the ground."""
        self._vehicles[vehicle] = FleetVehicle(body, len(self._vehicles))
        self._rebuild_parameters(len(self._vehicles) - 1)
        self.place(vehicle, motion)
        self.set_velocity(vehicle, motion.v_s, motion.v_d)

    def remove(self, vehicle: int) -> None:
        """Take a vehicle away."""
        del self._vehicles[vehicle]
        self._rebuild_parameters()

    def set_obstacle(self, actor: int, obstacle: Obstacle) -> None:
        """Add or replace the obstacle of an actor; it is ignored if lower than `CLEARANCE`."""
        if obstacle.high - obstacle.low >= CLEARANCE:
            self._obstacles[actor] = obstacle

    def moved_obstacles(self) -> Mapping[int, PlanarMotion]:
        """Motion of each obstacle that moved in the last tick, by the id of its actor."""
        return self._moved

    def remove_obstacle(self, actor: int) -> None:
        """Remove the obstacle of an actor, if there is fleet_vehicle."""
        self._obstacles.pop(actor, None)

    def set_body(self, vehicle: int, body: Body, steering: SteeringLimits) -> None:
        """Change the numbers of a vehicle, and how far its wheels turn."""
        self[vehicle].body, self[vehicle].steering = body, steering
        self._rebuild_parameters()

    def set_weather(self, weather: Sequence[float]) -> None:
        """Change the weather for all."""
        self._weather = tuple(weather)
        self._rebuild_parameters()

    def set_weather_defaults(self, nature: Nature) -> None:
        """Change what the weather leaves open."""
        self._nature = nature
        self._rebuild_parameters()

    def place(self, vehicle: int, motion: PlanarMotion) -> None:
        """Put a vehicle elsewhere; it keeps its velocity along its axes."""
        self._table[_PLACED, self[vehicle].row] = motion.s, motion.d, motion.heading

    def set_velocity(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle a velocity in the ground's frame [m/s]."""
        fleet_vehicle, driven = self[vehicle], self._driven
        row = fleet_vehicle.row
        forward, left = rotate(along, across, -self._heading(fleet_vehicle))
        fleet_vehicle.reverse_speed = max(-forward, 0.0)
        driven.vx[row] = max(forward, 0.0)
        driven.vy[row] = left if forward >= 0.0 else 0.0
        if along == across == 0.0:
            driven.yaw_rate[row] = driven.accel_lon[row] = driven.accel_lat[row] = 0.0

    def set_yaw_rate(self, vehicle: int, yaw_rate: float) -> None:
        """Give a vehicle a yaw rate, anticlockwise [rad/s]."""
        self._driven.yaw_rate[self[vehicle].row] = yaw_rate

    def push(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle an impulse in the ground's frame [N s]."""
        now, mass = self.motion(vehicle), self[vehicle].body["mass"]
        self.set_velocity(vehicle, now.v_s + along / mass, now.v_d + across / mass)

    def force(self, vehicle: int, along: float, across: float) -> None:
        """Let a force in the ground's frame act on a vehicle during the next tick [N]."""
        old = self[vehicle].force
        self[vehicle].force = (old[0] + along, old[1] + across)

    def spin(self, vehicle: int, impulse: float) -> None:
        """Give a vehicle an angular impulse, anticlockwise [kg m^2/s]."""
        fleet_vehicle = self[vehicle]
        gain = impulse / fleet_vehicle.body["yaw_inertia"]
        self._driven.yaw_rate[fleet_vehicle.row] += gain

    def motion(self, vehicle: int) -> PlanarMotion:
        """Where a vehicle is and how it moves."""
        return self.motions()[vehicle]

    def dynamics(self, vehicle: int) -> VehicleDynamics:
        """What the model knows of a vehicle."""
        row, driven, body = self[vehicle].row, self._driven, self[vehicle].body
        columns = (
            driven.vx, driven.vy, driven.yaw_rate, driven.wheel_angle, driven.accel_lon,
            driven.accel_lat, driven.mu_left, driven.mu_right,
        )  # fmt: skip
        dynamics = VehicleDynamics(*(float(column[row]) for column in columns))
        if not body["two_wheeler"]:
            return dynamics
        # The model gives a two-wheeler a lateral acceleration in place of a wheel angle.
        curve = dynamics.wheel_angle * body["wheelbase"]
        return dynamics._replace(wheel_angle=math.atan2(curve, max(dynamics.vx, 1.0) ** 2))

    def motions(self) -> dict[int, PlanarMotion]:
        """Where every vehicle is and how it moves."""
        if not self._vehicles:
            return {}
        rows = self._table[_PUSHED].T.tolist()
        motions: dict[int, PlanarMotion] = {}
        for vehicle, fleet_vehicle in self._vehicles.items():
            s, d, psi, vx, vy, r = rows[fleet_vehicle.row]
            velocity = rotate(vx - fleet_vehicle.reverse_speed, vy, psi)
            motions[vehicle] = PlanarMotion(s, d, math.remainder(psi, math.tau), *velocity, r)
        return motions

    def is_free(self, body: Body, motion: PlanarMotion, height: float) -> bool:
        """Whether no vehicle or obstacle is in the place of a new vehicle at some height [m]."""
        return not any(
            abs(self[vehicle].height - height) < LEVELS_APART
            and boxes_overlap(body, motion, self[vehicle].body, at)
            for vehicle, at in self.motions().items()
        ) and not any(
            _is_level(body, height, obstacle)
            and boxes_overlap(body, motion, _sides(obstacle), obstacle.motion)
            for obstacle in self._obstacles.values()
        )

    def advance(
        self,
        duration: float,
        controls: Mapping[int, Control],
        friction_factors: Mapping[int, float] = MappingProxyType({}),
    ) -> list[ContactImpulse]:
        """Move every vehicle.

        Args:
            duration: Length of the tick [s].
            controls: Pedals and steering of each vehicle.
            friction_factors: Factors on the friction, 0 to 1, by vehicle; 1 for vehicles left out.

        Returns:
            The contacts.
        """
        self._moved = {}
        if not self._vehicles:
            self._slide(duration)
            return []
        count = max(1, math.ceil(duration / MAX_STEP_TIME - 1e-9))
        pedal_driving = self._pedal_driving_for(duration, count)
        pedal_driving.update_weather(self._table, self._decision)
        self._decision += 1
        self._set_friction(friction_factors)
        self._add_forces(duration)
        self._apply_held_velocities()
        pedals = self._controls(controls)
        pairs = self._near_pairs(duration)
        obstacles = self._near_obstacles(duration)
        touches: list[ContactImpulse] = []
        if pairs or obstacles:
            for _ in range(count):
                touches += self._collide(pedal_driving, pedals, pairs, obstacles)
        else:
            self._drive(pedal_driving, pedals, count)
        self._drive_in_reverse(duration, controls)
        self._slide(duration)
        self._apply_held_velocities()
        for fleet_vehicle in self._vehicles.values():
            fleet_vehicle.force, fleet_vehicle.torque = (0.0, 0.0), 0.0
        return touches

    @property
    def _driven(self) -> DrivenVehicles:
        """State of the vehicles by field; writing to a field changes the table."""
        return DrivenVehicles(*self._table)

    def _heading(self, fleet_vehicle: FleetVehicle) -> float:
        """Heading in the ground's frame, anticlockwise [rad]."""
        return float(self._driven.heading[fleet_vehicle.row])

    def _rebuild_parameters(self, num_old: int | None = None) -> None:
        """Work out the parameters again, and carry what moves over to the new rows.

        Args:
            num_old: Number of vehicles, the first ones, that have moved before; None for all.
        """
        if not self._vehicles:
            return
        vehicles = list(self._vehicles.values())
        bodies = [fleet_vehicle.body for fleet_vehicle in vehicles]
        params = step_parameters(
            scenario_of(self._ground.road, bodies, self._weather, self._nature)
        )
        self._params: StepParameters = params
        self._vehicle_params = params.vehicles
        if not self._ground.shelters_wind:
            self._vehicle_params.shelters_wind[:] = ZERO
        self._pedal_driving = None
        table = driven_vehicles_at_start(len(vehicles))
        old = [fleet_vehicle.row for fleet_vehicle in vehicles[:num_old]]
        table[:, : len(old)] = self._table[:, old]
        for row, fleet_vehicle in enumerate(vehicles):
            fleet_vehicle.row = row
        self._table = table

    def _pedal_driving_for(self, duration: float, count: int) -> PedalDriving:
        """Moves the vehicles by a tick of `count` steps; kept while ticks are as long."""
        if self._pedal_driving is None or self._pedal_driving[0] != duration:
            c = self._params.constants.replace(step=duration / count, decision=duration)
            params = dataclasses.replace(self._params, constants=c)
            self._pedal_driving = duration, PedalDriving(params)
        return self._pedal_driving[1]

    def _add_forces(self, duration: float) -> None:
        """Add what pushes from outside: sideways like the wind, lengthwise as a change of speed."""
        driven = self._driven
        for vehicle, fleet_vehicle in self._vehicles.items():
            if fleet_vehicle.force == (0.0, 0.0) and fleet_vehicle.torque == 0.0:
                continue
            forward, left = rotate(*fleet_vehicle.force, -self._heading(fleet_vehicle))
            driven.wind_force[fleet_vehicle.row] += np.float32(left)
            gain = forward * duration / fleet_vehicle.body["mass"]
            driven.vx[fleet_vehicle.row] = max(float(driven.vx[fleet_vehicle.row]) + gain, 0.0)
            self.spin(vehicle, fleet_vehicle.torque * duration)

    def _set_friction(self, factors: Mapping[int, float]) -> None:
        """Exchange the friction of the two sides for oncoming vehicles, and apply the factors.

        The weather model computes `mu_fast` for the side with the larger `d`. The vehicle model
        takes that for the left side, but it is the right side of an oncoming vehicle.
        """
        driven = self._driven
        is_oncoming = np.cos(driven.heading) < 0.0
        driven.mu_left[:], driven.mu_right[:] = (
            np.where(is_oncoming, driven.mu_right, driven.mu_left),
            np.where(is_oncoming, driven.mu_left, driven.mu_right),
        )
        for vehicle, factor in factors.items():
            row = self[vehicle].row
            for friction in (driven.mu_left, driven.mu_right):
                friction[row] *= np.float32(max(factor, _MIN_FRICTION_FACTOR))

    def _apply_held_velocities(self) -> None:
        """Set the velocities that are kept; friction takes something of them in each tick."""
        for vehicle, fleet_vehicle in self._vehicles.items():
            if fleet_vehicle.held_velocity:
                self.set_velocity(
                    vehicle, *rotate(*fleet_vehicle.held_velocity, self._heading(fleet_vehicle))
                )

    def _controls(self, controls: Mapping[int, Control]) -> PedalControls:
        """Throttle, brake and requested wheel angle of each vehicle."""
        in_order = [controls.get(vehicle, _NO_CONTROL) for vehicle in self._vehicles]
        throttle = [0.0 if control.reverse else control.throttle for control in in_order]
        # Forward motion ends under full braking before the reverse gear engages.
        brake = [
            1.0 if control.reverse else min(control.brake + HAND_BRAKE * control.hand_brake, 1.0)
            for control in in_order
        ]
        speeds = kmh_from_mps(self._driven.vx)
        lock = _DEFAULT_STEERING.angles(speeds)
        for fleet_vehicle in self._vehicles.values():
            if fleet_vehicle.steering is not _DEFAULT_STEERING:
                row = fleet_vehicle.row
                lock[row] = fleet_vehicle.steering.angles(speeds[row])
        # CARLA's steering is positive to the right.
        angle = -lock * np.array([control.steer for control in in_order])
        return PedalControls(*(np.asarray(row, np.float32) for row in (throttle, brake, angle)))

    def _drive(self, pedal_driving: PedalDriving, pedals: PedalControls, steps: int) -> None:
        """Let physics move the vehicles, except those that only `place` moves."""
        with self._placed():
            pedal_driving.drive(self._table, pedals, steps)

    @contextmanager
    def _placed(self) -> Generator[None]:
        """Keep vehicles where they are that only `place` moves."""
        still = [
            fleet_vehicle.row
            for fleet_vehicle in self._vehicles.values()
            if not fleet_vehicle.has_physics
        ]
        held = self._table[_PLACED, still].copy()
        yield
        self._table[_PLACED, still] = held

    def _near_pairs(self, duration: float) -> list[tuple[int, int]]:
        """Rows of vehicles that may touch before the next tick: near along and across the ground.

        Most pass each other in lanes of their own, and those need no look at their contacts.
        """
        if len(self._vehicles) < 2:
            return []
        driven, p = self._driven, self._vehicle_params
        sine, cosine = np.sin(driven.heading), np.cos(driven.heading)
        half_length, half_width = p.half_length[:, 0], p.half_width[:, 0]
        turned = duration * np.abs(driven.yaw_rate) * half_length
        nearer = _CONTACT_MARGIN + 0.5 * _MAX_APPROACH_ACCEL * duration * duration
        high = np.array(
            [fleet_vehicle.height for fleet_vehicle in self._vehicles.values()], np.float32
        )
        close = _distances(high) < LEVELS_APART
        for place, length, width, speed in (
            (driven.s, cosine, sine, driven.vx * cosine - driven.vy * sine),
            (driven.d, sine, cosine, driven.vx * sine + driven.vy * cosine),
        ):
            reach = half_length * np.abs(length) + half_width * np.abs(width) + turned
            closing = duration * _distances(speed)
            close &= _distances(place) < np.add.outer(reach, reach) + closing + nearer
        return [(i, j) for i, j in np.argwhere(close).tolist() if i < j]

    def _near_obstacles(self, duration: float) -> list[tuple[int, int]]:
        """Pairs of a vehicle's row and the id of an obstacle that it may touch in this tick."""
        if not self._obstacles:
            return []
        driven, p = self._driven, self._vehicle_params
        speed = np.hypot(driven.vx, driven.vy)[:, None]
        reach = np.hypot(p.half_length, p.half_width) + duration * speed
        reach += _CONTACT_MARGIN + 0.5 * _MAX_APPROACH_ACCEL * duration * duration
        obstacles = list(self._obstacles.values())
        centres = np.array([(obstacle.motion.s, obstacle.motion.d) for obstacle in obstacles])
        radii = np.array([0.5 * math.hypot(box.length, box.width) for box in obstacles])
        distances = np.hypot(driven.s[:, None] - centres[:, 0], driven.d[:, None] - centres[:, 1])
        vehicles, ids = list(self._vehicles.values()), list(self._obstacles)
        return [
            (row, ids[k])
            for row, k in np.argwhere(distances < reach + radii).tolist()
            if _is_level(vehicles[row].body, vehicles[row].height, obstacles[k])
        ]

    def _collide(
        self,
        pedal_driving: PedalDriving,
        controls: PedalControls,
        pairs: list[tuple[int, int]],
        near_obstacles: list[tuple[int, int]],
    ) -> list[ContactImpulse]:
        """Advance by one step with exchange of momentum in contacts.

        Unlike in a simulation, vehicles can drive on after a contact. The obstacles follow the
        vehicles in the table of bodies, so that contacts with both are found alike.
        """
        count = len(self._vehicles)
        old_positions = self._table[:2].copy()
        self._drive(pedal_driving, controls, 1)
        obstacles = list(dict.fromkeys(obstacle for _, obstacle in near_obstacles))
        row_of = {obstacle: row for row, obstacle in enumerate(obstacles, count)}
        ids = [*self._vehicles, *obstacles]
        pairs = [*pairs, *((row, row_of[obstacle]) for row, obstacle in near_obstacles)]
        old_momentum = {
            row: self._momentum(self[ids[row]]) for pair in pairs for row in pair if row < count
        }
        bodies = self._with_obstacles([self._obstacles[obstacle] for obstacle in obstacles])
        # Obstacles have not moved during the step.
        old_positions = np.hstack([old_positions, bodies[:2, count:]])
        with self._placed():
            partners = pedal_driving.resolve_contacts(bodies, old_positions, pairs)
            self._table[_PUSHED] = bodies[_PUSHED, :count]
        self._take_pushed(obstacles, bodies[:, count:])
        touches: list[ContactImpulse] = []
        for row, (along, across) in old_momentum.items():
            partner = int(partners[row])
            if partner >= 0:
                new = self._momentum(self[ids[row]])
                gain = (new[0] - along, new[1] - across)
                touches.append(ContactImpulse(ids[row], ids[partner], *gain))
        return touches

    def _with_obstacles(self, obstacles: list[Obstacle]) -> NDArray[np.float32]:
        """The table of `ContactBodies` of all vehicles, then of some obstacles."""
        p, count = self._vehicle_params, len(self._vehicles)
        table = np.empty((len(ContactBodies._fields), count + len(obstacles)), np.float32)
        table[_PUSHED, :count] = self._table[_PUSHED]
        shapes = (p.half_length, p.half_width, p.inverse_mass, p.inverse_inertia)
        table[_PUSHED.stop :, :count] = np.hstack(shapes).T
        for column, obstacle in enumerate(obstacles, count):
            motion = obstacle.motion
            body = ContactBodies(*table[:, column : column + 1])
            body.s[:], body.d[:], body.heading[:] = motion.s, motion.d, motion.heading
            body.vx[:], body.vy[:] = rotate(motion.v_s, motion.v_d, -motion.heading)
            body.yaw_rate[:] = motion.yaw_rate
            body.half_length[:], body.half_width[:] = 0.5 * obstacle.length, 0.5 * obstacle.width
            body.inverse_mass[:] = 1.0 / obstacle.mass
            body.inverse_inertia[:] = 1.0 / obstacle.yaw_inertia
        return table

    def _take_pushed(self, obstacles: list[int], bodies: NDArray[np.float32]) -> None:
        """Store the motion of obstacles after a contact; fixed ones keep theirs."""
        for actor, column in zip(obstacles, bodies[_PUSHED].T.tolist(), strict=True):
            obstacle = self._obstacles[actor]
            if math.isfinite(obstacle.mass):
                s, d, psi, vx, vy, r = column
                motion = PlanarMotion(s, d, psi, *rotate(vx, vy, psi), r)
                self._obstacles[actor] = dataclasses.replace(obstacle, motion=motion)

    def _slide(self, duration: float) -> None:
        """Move obstacles that were pushed; friction slows travel and rotation by the same share."""
        for actor, obstacle in self._obstacles.items():
            if not _is_moving(obstacle):
                continue
            motion = obstacle.motion
            speed = math.hypot(motion.v_s, motion.v_d)
            loss = _SLIDING_DECEL * duration
            share = max(speed - loss, 0.0) / speed if speed else 0.0
            mean = 0.5 * (1.0 + share) * duration
            moved = self._moved[actor] = PlanarMotion(
                motion.s + mean * motion.v_s,
                motion.d + mean * motion.v_d,
                motion.heading + mean * motion.yaw_rate,
                share * motion.v_s,
                share * motion.v_d,
                share * motion.yaw_rate,
            )
            self._obstacles[actor] = dataclasses.replace(obstacle, motion=moved)

    def _momentum(self, fleet_vehicle: FleetVehicle) -> tuple[float, float]:
        """Momentum of a vehicle in the ground's frame [N s]."""
        vx, vy = (
            float(self._driven.vx[fleet_vehicle.row]),
            float(self._driven.vy[fleet_vehicle.row]),
        )
        along, across = rotate(vx, vy, self._heading(fleet_vehicle))
        return fleet_vehicle.body["mass"] * along, fleet_vehicle.body["mass"] * across

    def _drive_in_reverse(self, duration: float, controls: Mapping[int, Control]) -> None:
        """Drive backwards: slowly, on the circle that the front wheels give, without slip."""
        driven = self._driven
        for vehicle, fleet_vehicle in self._vehicles.items():
            control, row = controls.get(vehicle, _NO_CONTROL), fleet_vehicle.row
            wants = control.reverse and float(driven.vx[row]) == 0.0
            push = REVERSE_ACCEL * control.throttle if wants else 0.0
            braking = fleet_vehicle.body["peak_decel"] * max(control.brake, control.hand_brake)
            speed = max(fleet_vehicle.reverse_speed + duration * (push - braking), 0.0)
            if not control.reverse and control.throttle > 0.0:
                speed = 0.0
            speed = fleet_vehicle.reverse_speed = min(speed, MAX_REVERSE_SPEED)
            if speed == 0.0 or not fleet_vehicle.has_physics:
                continue
            psi, angle = self._heading(fleet_vehicle), float(driven.wheel_angle[row])
            driven.vx[row] = driven.vy[row] = 0.0
            along, across = rotate(speed * duration, 0.0, psi)
            driven.s[row] -= np.float32(along)
            driven.d[row] -= np.float32(across)
            turn = -speed * math.tan(angle) / fleet_vehicle.body["wheelbase"]
            driven.heading[row] += np.float32(turn * duration)


def _is_moving(obstacle: Obstacle) -> bool:
    return any((obstacle.motion.v_s, obstacle.motion.v_d, obstacle.motion.yaw_rate))


def _is_level(body: Body, height: float, obstacle: Obstacle) -> bool:
    """Whether an obstacle reaches above a vehicle's ground clearance and begins below its roof."""
    return obstacle.low < height + body["height"] and obstacle.high > height + CLEARANCE


def _sides(obstacle: Obstacle) -> Mapping[str, float]:
    return {"length": obstacle.length, "width": obstacle.width}


def _distances(values: F32) -> F32:
    """Absolute difference of each value from each, shape (vehicle, vehicle)."""
    return np.abs(np.subtract.outer(values, values))
