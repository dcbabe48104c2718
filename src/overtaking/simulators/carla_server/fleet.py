"""The vehicles of the headless server, moved by the dynamics of our model.

Vehicles live in the frame of the road (`Ground`): s along it, d to its left, heading
anticlockwise. On a road of ours that is the road's own frame, so films, puddles and the shelter of
lorries are where they are in a simulation. On another map it is the map's, water lies as on a
single lane and no vehicle shelters another.
"""

import dataclasses
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import ZERO
from overtaking.core.units import kmh_from_mps
from overtaking.sim.pedal_driving import PedalDriving, pedal_driving
from overtaking.sim.reference import collisions
from overtaking.sim.reference.pedal_driving import TABLE_FIELDS, PedalControls
from overtaking.sim.reference.state import NO_SLOT, FirstContact, State
from overtaking.simulators.carla_server.arguments import Control
from overtaking.simulators.carla_server.bodies import Body, Nature, scenario_of
from overtaking.simulators.carla_server.motion import (
    LEVELS_APART,
    Driven,
    Ground,
    Motion,
    Obstacle,
    Steering,
    Touch,
    overlap,
    turned,
)
from overtaking.world.step_parameters import StepParameters, step_parameters

LONGEST_STEP = 0.05
"""Longest step of the dynamics, as in a simulation [s]."""

HAND_BRAKE = 0.6
"""Part of the brakes that the hand brake has."""

BACKWARDS_ACCEL = 2.0
"""Acceleration in reverse at full throttle [m/s^2]."""

BACKWARDS_SPEED = 8.0
"""Fastest reverse [m/s]."""

CLEARANCE = 0.2
"""Height of obstacles over which vehicles drive without contact [m]; our choice."""

_NEAR = 0.5  # Closer than this plus what they approach in a tick, two vehicles may touch [m].
_HARDEST = 20.0  # How fast their approach may grow meanwhile [m/s^2].
_FOREVER = np.float32(1e9)
_NO_CONTROL = Control()
_USUAL = Steering()
_SLIDING_DECEL = 5.0  # Deceleration of a sliding prop, friction 0.5 [m/s^2].
_MIN_FRICTION_FACTOR = 0.01  # Without any friction the tyre model has no stiffness to divide by.
_PUSHED = ("s", "d", "heading", "vx", "vy", "yaw_rate")  # Fields of `Motion` that contacts change.
_PLACED = ("s", "d", "heading")


@dataclass(slots=True)
class FleetVehicle:
    """What the fleet keeps of one vehicle beside the state of the model.

    Attributes:
        body: Its numbers.
        row: Where it is in the state.
        steering: How far its front wheels turn.
        height: Of the ground under it [m]; vehicles on different levels never touch.
        moves: Whether physics moves it, or only `Fleet.place`.
        backwards: Speed in reverse [m/s].
        held: Velocity forwards and to the left that it keeps, None where pedals decide [m/s].
        force: Acts during the next tick, along and across the ground [N].
        torque: Acts during the next tick, anticlockwise [N m].
    """

    body: Body
    row: int = 0
    steering: Steering = _USUAL
    height: float = 0.0
    moves: bool = True
    backwards: float = 0.0
    held: tuple[float, float] | None = None
    force: tuple[float, float] = (0.0, 0.0)
    torque: float = 0.0


class Fleet:
    """All vehicles, in the order in which they were added.

    Args:
        ground: What they stand on.
        weather: The fourteen numbers of `carla.WeatherParameters`.
        nature: What they leave open.
    """

    def __init__(self, ground: Ground, weather: Sequence[float], nature: Nature) -> None:
        """Start without vehicles."""
        self._ground, self._weather, self._nature = ground, tuple(weather), nature
        self._vehicles: dict[int, FleetVehicle] = {}
        self._obstacles: dict[int, Obstacle] = {}
        self._moved: dict[int, Motion] = {}
        self._decision = 0
        self._movers: dict[float, PedalDriving] = {}

    def __contains__(self, vehicle: int) -> bool:
        """Whether this vehicle exists."""
        return vehicle in self._vehicles

    def __getitem__(self, vehicle: int) -> FleetVehicle:
        """Record of a vehicle."""
        return self._vehicles[vehicle]

    def add(self, vehicle: int, body: Body, motion: Motion) -> None:
        """Put a vehicle on the ground."""
        self._vehicles[vehicle] = FleetVehicle(body, len(self._vehicles))
        self._prepare(len(self._vehicles) - 1)
        self.place(vehicle, motion)
        self.set_velocity(vehicle, motion.along, motion.across)

    def remove(self, vehicle: int) -> None:
        """Take a vehicle away."""
        del self._vehicles[vehicle]
        self._prepare()

    def set_obstacle(self, actor: int, obstacle: Obstacle) -> None:
        """Add or replace the obstacle of an actor; it is ignored if lower than `CLEARANCE`."""
        if obstacle.high - obstacle.low >= CLEARANCE:
            self._obstacles[actor] = obstacle

    def moved_obstacles(self) -> Mapping[int, Motion]:
        """Motion of each obstacle that moved in the last tick, by the id of its actor."""
        return self._moved

    def remove_obstacle(self, actor: int) -> None:
        """Remove the obstacle of an actor, if there is one."""
        self._obstacles.pop(actor, None)

    def set_body(self, vehicle: int, body: Body, steering: Steering) -> None:
        """Change the numbers of a vehicle, and how far its wheels turn."""
        self[vehicle].body, self[vehicle].steering = body, steering
        self._prepare()

    def set_weather(self, weather: Sequence[float]) -> None:
        """Change the weather for all."""
        self._weather = tuple(weather)
        self._prepare()

    def set_nature(self, nature: Nature) -> None:
        """Change what the weather leaves open."""
        self._nature = nature
        self._prepare()

    def place(self, vehicle: int, motion: Motion) -> None:
        """Put a vehicle elsewhere; it keeps its velocity along its axes."""
        row, placed = self[vehicle].row, self._state.motion
        placed.s[row], placed.d[row], placed.heading[row] = motion.s, motion.d, motion.psi

    def set_velocity(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle a velocity in the ground's frame [m/s]."""
        one, state = self[vehicle], self._state
        row = one.row
        forward, left = turned(along, across, -self._psi(one))
        one.backwards = max(-forward, 0.0)
        state.motion.vx[row], state.motion.vy[row] = (
            max(forward, 0.0),
            left if forward >= 0.0 else 0.0,
        )
        if along == across == 0.0:
            state.motion.yaw_rate[row] = state.motion.accel_lon[row] = state.motion.accel_lat[
                row
            ] = 0.0

    def set_yaw_rate(self, vehicle: int, yaw_rate: float) -> None:
        """Give a vehicle a yaw rate, anticlockwise [rad/s]."""
        self._state.motion.yaw_rate[self[vehicle].row] = yaw_rate

    def push(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle an impulse in the ground's frame [N s]."""
        now, mass = self.motion(vehicle), self[vehicle].body["mass"]
        self.set_velocity(vehicle, now.along + along / mass, now.across + across / mass)

    def force(self, vehicle: int, along: float, across: float) -> None:
        """Let a force in the ground's frame act on a vehicle during the next tick [N]."""
        old = self[vehicle].force
        self[vehicle].force = (old[0] + along, old[1] + across)

    def spin(self, vehicle: int, impulse: float) -> None:
        """Give a vehicle an angular impulse, anticlockwise [kg m^2/s]."""
        one = self[vehicle]
        self._state.motion.yaw_rate[one.row] += impulse / one.body["yaw_inertia"]

    def motion(self, vehicle: int) -> Motion:
        """Where a vehicle is and how it moves."""
        return self.motions()[vehicle]

    def driven(self, vehicle: int) -> Driven:
        """What the model knows of a vehicle."""
        row, state, body = self[vehicle].row, self._state, self[vehicle].body
        motion, friction = state.motion, state.friction_and_wind
        columns = (
            motion.vx, motion.vy, motion.yaw_rate, state.controls.wheel_angle, motion.accel_lon,
            motion.accel_lat, friction.mu_left, friction.mu_right,
        )  # fmt: skip
        found = Driven(*(float(column[row, 0]) for column in columns))
        if not body["two_wheeler"]:
            return found
        curve = found.angle * body["wheelbase"]  # Its wheel stands for lateral acceleration.
        return found._replace(angle=math.atan2(curve, max(found.vx, 1.0) ** 2))

    def motions(self) -> dict[int, Motion]:
        """Where every vehicle is and how it moves."""
        if not self._vehicles:
            return {}
        state = self._state
        columns = (
            state.motion.s,
            state.motion.d,
            state.motion.heading,
            state.motion.vx,
            state.motion.vy,
            state.motion.yaw_rate,
        )
        rows = np.stack([column[:, 0] for column in columns], axis=1).tolist()
        found: dict[int, Motion] = {}
        for vehicle, one in self._vehicles.items():
            s, d, psi, vx, vy, r = rows[one.row]
            velocity = turned(vx - one.backwards, vy, psi)
            found[vehicle] = Motion(s, d, math.remainder(psi, math.tau), *velocity, r)
        return found

    def is_free(self, body: Body, motion: Motion, height: float) -> bool:
        """Whether no vehicle or obstacle is in the place of a new vehicle at some height [m]."""
        return not any(
            abs(self[vehicle].height - height) < LEVELS_APART
            and overlap(body, motion, self[vehicle].body, at)
            for vehicle, at in self.motions().items()
        ) and not any(
            _is_level(body, height, obstacle)
            and overlap(body, motion, _sides(obstacle), obstacle.motion)
            for obstacle in self._obstacles.values()
        )

    def advance(
        self,
        duration: float,
        controls: Mapping[int, Control],
        friction_factors: Mapping[int, float] = MappingProxyType({}),
    ) -> list[Touch]:
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
        count = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        mover = self._mover(duration, count)
        mover.weather(self._state, self._decision)
        self._decision += 1
        self._set_friction(friction_factors)
        self._add_forces(duration)
        self._hold()
        wanted = self._wanted(controls)
        pairs = self._near_pairs(duration)
        obstacles = self._near_obstacles(duration)
        touches: list[Touch] = []
        if pairs or obstacles:
            for _ in range(count):
                touches += self._collide(mover, wanted, pairs, obstacles)
        else:
            self._drive(mover, wanted, count)
        self._roll_back(duration, controls)
        self._slide(duration)
        self._hold()
        for one in self._vehicles.values():
            one.force, one.torque = (0.0, 0.0), 0.0
        return touches

    def _psi(self, one: FleetVehicle) -> float:
        """Heading in the ground's frame, anticlockwise [rad]."""
        return float(self._state.motion.heading[one.row, 0])

    def _prepare(self, num_old: int | None = None) -> None:
        """Work out the parameters again, and carry what moves over to the new rows.

        Args:
            num_old: Number of vehicles, the first ones, that have moved before; None for all.
        """
        if not self._vehicles:
            return
        vehicles = list(self._vehicles.values())
        bodies = [one.body for one in vehicles]
        given = step_parameters(scenario_of(self._ground.road, bodies, self._weather, self._nature))
        self._given: StepParameters = given
        self._fields = given.vehicles
        if not self._ground.shelters:
            self._fields.shelters_wind[:] = ZERO
        self._movers.clear()
        state = State.at_start(given)
        state.end_step[:] = _FOREVER
        old = [one.row for one in vehicles[:num_old]]
        for group, name in TABLE_FIELDS if old else ():
            kept = getattr(getattr(self._state, group), name)[old]
            getattr(getattr(state, group), name)[: len(old)] = kept
        for row, one in enumerate(vehicles):
            one.row = row
        self._state: State = state

    def _mover(self, duration: float, count: int) -> PedalDriving:
        """What moves the vehicles by a tick of `count` steps, kept for the next one."""
        if duration not in self._movers:
            self._movers.clear()
            c = self._given.constants.replace(step=duration / count, decision=duration)
            self._movers[duration] = pedal_driving(dataclasses.replace(self._given, constants=c))
        return self._movers[duration]

    def _add_forces(self, duration: float) -> None:
        """Add what pushes from outside: sideways like the wind, lengthwise as a change of speed."""
        state = self._state
        for vehicle, one in self._vehicles.items():
            if one.force == (0.0, 0.0) and one.torque == 0.0:
                continue
            forward, left = turned(*one.force, -self._psi(one))
            state.friction_and_wind.wind_force[one.row] += np.float32(left)
            gain = forward * duration / one.body["mass"]
            state.motion.vx[one.row] = max(float(state.motion.vx[one.row, 0]) + gain, 0.0)
            self.spin(vehicle, one.torque * duration)

    def _set_friction(self, factors: Mapping[int, float]) -> None:
        """Exchange the friction of the two sides for oncoming vehicles, and apply the factors.

        The weather model computes `mu_fast` for the side with the larger `d`. The vehicle model
        takes that for the left side, but it is the right side of an oncoming vehicle.
        """
        state = self._state
        is_oncoming = np.cos(state.motion.heading) < 0.0
        state.friction_and_wind.mu_left, state.friction_and_wind.mu_right = (
            np.where(
                is_oncoming, state.friction_and_wind.mu_right, state.friction_and_wind.mu_left
            ),
            np.where(
                is_oncoming, state.friction_and_wind.mu_left, state.friction_and_wind.mu_right
            ),
        )
        for vehicle, factor in factors.items():
            row = self[vehicle].row
            for friction in (state.friction_and_wind.mu_left, state.friction_and_wind.mu_right):
                friction[row] *= np.float32(max(factor, _MIN_FRICTION_FACTOR))

    def _hold(self) -> None:
        """Set the velocities that are kept; friction takes something of them in each tick."""
        for vehicle, one in self._vehicles.items():
            if one.held:
                self.set_velocity(vehicle, *turned(*one.held, self._psi(one)))

    def _wanted(self, controls: Mapping[int, Control]) -> PedalControls:
        """Throttle, brake and wanted wheel angle of each vehicle."""
        wanted = [controls.get(vehicle, _NO_CONTROL) for vehicle in self._vehicles]
        throttle = [0.0 if one.reverse else one.throttle for one in wanted]
        brake = [min(one.brake + HAND_BRAKE * one.hand_brake, 1.0) for one in wanted]
        # Forward motion ends under full braking before the reverse gear engages.
        brake = [1.0 if one.reverse else b for one, b in zip(wanted, brake, strict=True)]
        speeds = kmh_from_mps(self._state.motion.vx[:, 0])
        lock = _USUAL.angles(speeds)
        for one in self._vehicles.values():
            if one.steering is not _USUAL:
                lock[one.row] = one.steering.angles(speeds[one.row])
        # CARLA's steering is positive to the right.
        angle = -lock * np.array([one.steer for one in wanted])
        return PedalControls(_column(throttle), _column(brake), _column(angle))

    def _drive(self, mover: PedalDriving, wanted: PedalControls, steps: int) -> None:
        """Let physics move the vehicles, except those that only `place` moves."""
        with self._placed():
            mover.drive(self._state, wanted, steps)

    @contextmanager
    def _placed(self) -> Generator[None]:
        """Keep vehicles where they are that only `place` moves."""
        state = self._state
        still = [one.row for one in self._vehicles.values() if not one.moves]
        held = {name: getattr(state.motion, name)[still].copy() for name in _PLACED}
        yield
        for name, value in held.items():
            getattr(state.motion, name)[still] = value

    def _near_pairs(self, duration: float) -> list[tuple[int, int]]:
        """Rows of vehicles that may touch before the next tick: near along and across the ground.

        Most pass each other in lanes of their own, and those need no look at their contacts.
        """
        if len(self._vehicles) < 2:
            return []
        state, p = self._state, self._fields
        sine, cosine = np.sin(state.motion.heading), np.cos(state.motion.heading)
        turned = duration * np.abs(state.motion.yaw_rate) * p.half_length
        nearer = _NEAR + 0.5 * _HARDEST * duration * duration
        high = _column([one.height for one in self._vehicles.values()])
        close = np.abs(high - high.T) < LEVELS_APART
        for place, length, width, speed in (
            (state.motion.s, cosine, sine, state.motion.vx * cosine - state.motion.vy * sine),
            (state.motion.d, sine, cosine, state.motion.vx * sine + state.motion.vy * cosine),
        ):
            reach = p.half_length * np.abs(length) + p.half_width * np.abs(width) + turned
            closing = duration * np.abs(speed - speed.T)
            close &= np.abs(place - place.T) < reach + reach.T + closing + nearer
        return [(i, j) for i, j in np.argwhere(close).tolist() if i < j]

    def _near_obstacles(self, duration: float) -> list[tuple[int, int]]:
        """Pairs of a vehicle's row and the id of an obstacle that it may touch in this tick."""
        if not self._obstacles:
            return []
        state, p = self._state, self._fields
        speed = np.hypot(state.motion.vx, state.motion.vy)
        reach = np.hypot(p.half_length, p.half_width) + duration * speed
        reach += _NEAR + 0.5 * _HARDEST * duration * duration
        obstacles = list(self._obstacles.values())
        centres = np.array([(obstacle.motion.s, obstacle.motion.d) for obstacle in obstacles])
        radii = np.array([0.5 * math.hypot(box.length, box.width) for box in obstacles])
        distances = np.hypot(state.motion.s - centres[:, 0], state.motion.d - centres[:, 1])
        vehicles, ids = list(self._vehicles.values()), list(self._obstacles)
        return [
            (row, ids[k])
            for row, k in np.argwhere(distances < reach + radii).tolist()
            if _is_level(vehicles[row].body, vehicles[row].height, obstacles[k])
        ]

    def _collide(
        self,
        mover: PedalDriving,
        controls: PedalControls,
        pairs: list[tuple[int, int]],
        near_obstacles: list[tuple[int, int]],
    ) -> list[Touch]:
        """Advance by one step with exchange of momentum in contacts.

        Unlike in a simulation, vehicles can drive on after a contact. The rows of obstacles follow
        the rows of vehicles, so that the model finds contacts with both alike.
        """
        state, count = self._state, len(self._vehicles)
        before = (state.motion.s.copy(), state.motion.d.copy())
        self._drive(mover, controls, 1)
        obstacles = list(dict.fromkeys(obstacle for _, obstacle in near_obstacles))
        row_of = {obstacle: row for row, obstacle in enumerate(obstacles, count)}
        ids = [*self._vehicles, *obstacles]
        pairs = [*pairs, *((row, row_of[obstacle]) for row, obstacle in near_obstacles)]
        old_momentum = {
            row: self._momentum(self[ids[row]]) for pair in pairs for row in pair if row < count
        }
        bodies = self._with_obstacles([self._obstacles[obstacle] for obstacle in obstacles])
        places = (
            np.concatenate([before[0], bodies.state.motion.s[count:]]),
            np.concatenate([before[1], bodies.state.motion.d[count:]]),
        )
        in_simulation = {pair: np.ones(1, np.bool_) for pair in pairs}
        with self._placed():
            params = dataclasses.replace(
                self._given, constants=mover.constants, local_vehicles=bodies.fields
            )
            collisions.resolve_contacts(
                bodies.state, params, in_simulation, places, 0, mover.constants.step
            )
            for name in _PUSHED:
                getattr(state.motion, name)[:] = getattr(bodies.state.motion, name)[:count]
        self._take_pushed(obstacles, bodies)
        touches: list[Touch] = []
        for row, (along, across) in old_momentum.items():
            partner = int(bodies.state.first_contact.partner[row, 0])
            if partner >= 0:
                new = self._momentum(self[ids[row]])
                gain = (new[0] - along, new[1] - across)
                touches.append(Touch(ids[row], ids[partner], *gain))
        return touches

    def _with_obstacles(self, obstacles: list[Obstacle]) -> "_Bodies":
        """State and parameters of all vehicles, then of some obstacles."""
        motions = [obstacle.motion for obstacle in obstacles]
        speeds = [turned(motion.along, motion.across, -motion.psi) for motion in motions]
        motion_columns = {
            "s": [motion.s for motion in motions],
            "d": [motion.d for motion in motions],
            "heading": [motion.psi for motion in motions],
            "vx": [speed[0] for speed in speeds],
            "vy": [speed[1] for speed in speeds],
            "yaw_rate": [motion.yaw_rate for motion in motions],
        }
        parameters = {
            "half_length": [0.5 * obstacle.length for obstacle in obstacles],
            "half_width": [0.5 * obstacle.width for obstacle in obstacles],
            "travel_sign": [1.0] * len(obstacles),
            "inverse_mass": [1.0 / obstacle.mass for obstacle in obstacles],
            "inverse_inertia": [1.0 / obstacle.yaw_inertia for obstacle in obstacles],
        }

        def column(source: object, name: str, values: dict[str, list[float]]) -> F32:
            return np.concatenate([getattr(source, name), _column(values[name])])

        rows = len(self._vehicles) + len(obstacles)
        zeros = np.zeros((rows, 1), np.float32)
        state = SimpleNamespace(
            motion=SimpleNamespace(
                **{name: column(self._state.motion, name, motion_columns) for name in _PUSHED},
                is_wreck=zeros.copy(),
            ),
            overtake=SimpleNamespace(stage=zeros.copy()),
            first_contact=FirstContact(
                partner=zeros + NO_SLOT,
                time=zeros.copy(),
                impulse=zeros.copy(),
                closing_speed=zeros.copy(),
            ),
            end_step=self._state.end_step,
        )
        fields = SimpleNamespace(
            **{name: column(self._fields, name, parameters) for name in parameters}
        )
        return _Bodies(state, fields)

    def _take_pushed(self, obstacles: list[int], bodies: "_Bodies") -> None:
        """Store the motion of obstacles after a contact; fixed ones keep theirs."""
        for row, actor in enumerate(obstacles, len(self._vehicles)):
            obstacle = self._obstacles[actor]
            if math.isfinite(obstacle.mass):
                s, d, psi, vx, vy, r = (
                    float(getattr(bodies.state.motion, name)[row, 0]) for name in _PUSHED
                )
                motion = Motion(s, d, psi, *turned(vx, vy, psi), r)
                self._obstacles[actor] = dataclasses.replace(obstacle, motion=motion)

    def _slide(self, duration: float) -> None:
        """Move obstacles that were pushed; friction slows travel and rotation by the same share."""
        for actor, obstacle in self._obstacles.items():
            if not _is_moving(obstacle):
                continue
            motion = obstacle.motion
            speed = math.hypot(motion.along, motion.across)
            loss = _SLIDING_DECEL * duration
            share = max(speed - loss, 0.0) / speed if speed else 0.0
            mean = 0.5 * (1.0 + share) * duration
            moved = self._moved[actor] = Motion(
                motion.s + mean * motion.along,
                motion.d + mean * motion.across,
                motion.psi + mean * motion.yaw_rate,
                share * motion.along,
                share * motion.across,
                share * motion.yaw_rate,
            )
            self._obstacles[actor] = dataclasses.replace(obstacle, motion=moved)

    def _momentum(self, one: FleetVehicle) -> tuple[float, float]:
        """Momentum of a vehicle in the ground's frame [N s]."""
        vx, vy = (
            float(speed[one.row, 0]) for speed in (self._state.motion.vx, self._state.motion.vy)
        )
        along, across = turned(vx, vy, self._psi(one))
        return one.body["mass"] * along, one.body["mass"] * across

    def _roll_back(self, duration: float, controls: Mapping[int, Control]) -> None:
        """Drive backwards: slowly, on the circle that the front wheels give, without slip."""
        state = self._state
        for vehicle, one in self._vehicles.items():
            control, row = controls.get(vehicle, _NO_CONTROL), one.row
            wants = control.reverse and float(state.motion.vx[row, 0]) == 0.0
            push = BACKWARDS_ACCEL * control.throttle if wants else 0.0
            braking = one.body["peak_decel"] * max(control.brake, control.hand_brake)
            speed = max(one.backwards + duration * (push - braking), 0.0)
            if not control.reverse and control.throttle > 0.0:
                speed = 0.0
            speed = one.backwards = min(speed, BACKWARDS_SPEED)
            if speed == 0.0 or not one.moves:
                continue
            psi, angle = self._psi(one), float(state.controls.wheel_angle[row, 0])
            state.motion.vx[row] = state.motion.vy[row] = 0.0
            along, across = turned(speed * duration, 0.0, psi)
            state.motion.s[row] -= np.float32(along)
            state.motion.d[row] -= np.float32(across)
            turn = -speed * math.tan(angle) / one.body["wheelbase"]
            state.motion.heading[row] += np.float32(turn * duration)


class _Bodies(NamedTuple):
    """State and parameters of vehicles and obstacles, with the columns that `collisions` reads."""

    state: Any
    fields: Any


def _is_moving(obstacle: Obstacle) -> bool:
    return any((obstacle.motion.along, obstacle.motion.across, obstacle.motion.yaw_rate))


def _is_level(body: Body, height: float, obstacle: Obstacle) -> bool:
    """Whether an obstacle reaches above a vehicle's ground clearance and begins below its roof."""
    return obstacle.low < height + body["height"] and obstacle.high > height + CLEARANCE


def _sides(obstacle: Obstacle) -> Mapping[str, float]:
    return {"length": obstacle.length, "width": obstacle.width}


def _column(values: Any) -> F32:
    return np.asarray(values, np.float32)[:, None]
