"""The vehicles of the headless server, moved by the dynamics of our model.

Vehicles live in the frame of the road (`Ground`): s along it, d to its left, heading
anticlockwise. On a road of ours that is the road's own frame, so films, puddles and the shelter of
lorries are where they are in a simulation. On another map it is the map's, water lies as on a
single lane and no vehicle shelters another.
"""

from __future__ import annotations

import dataclasses
import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.units import kmh_from_mps
from overtaking.sim.driven import Mover, mover
from overtaking.sim.reference import collisions
from overtaking.sim.reference.driven import MOVING, Controls
from overtaking.sim.reference.state import NOBODY, State, initial_state
from overtaking.simulators.carla_server.arguments import Control
from overtaking.simulators.carla_server.bodies import Body, Nature, scenario_of
from overtaking.simulators.carla_server.motion import (
    LEVELS_APART,
    Driven,
    Ground,
    Motion,
    Touch,
    overlap,
)
from overtaking.simulators.carla_server.steering import Steering
from overtaking.world.parameters import Parameters, parameters

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence

    from overtaking.core.elementary import F32

LONGEST_STEP = 0.05
"""Longest step of the dynamics, as in a simulation [s]."""

HAND_BRAKE = 0.6
"""Part of the brakes that the hand brake has."""

BACKWARDS_ACCEL = 2.0
"""Acceleration in reverse at full throttle [m/s^2]."""

BACKWARDS_SPEED = 8.0
"""Fastest reverse [m/s]."""

_NEAR = 0.5  # Closer than this plus what they approach in a tick, two vehicles may touch [m].
_HARDEST = 20.0  # How fast their approach may grow meanwhile [m/s^2].
_FOREVER = np.float32(1e9)
_ZERO = np.float32(0.0)
_NO_CONTROL = Control()
_DRIVEN = ("vx", "vy", "r", "wheel", "a_lon", "a_lat", "mu_fast", "mu_slow")


class Fleet:
    """All vehicles, in the order in which they were added.

    Args:
        ground: What they stand on.
        weather: The fourteen numbers of `carla.WeatherParameters`.
        nature: What they leave open.

    Attributes:
        heights: Heights of the vehicles [m]; those on different levels never touch.
    """

    def __init__(self, ground: Ground, weather: Sequence[float], nature: Nature) -> None:
        """Start without vehicles."""
        self._ground, self._weather, self._nature = ground, tuple(weather), nature
        self._ids: list[int] = []
        self._bodies: list[Body] = []
        self._decision = 0
        self._rows: dict[int, int] = {}
        self._backwards: dict[int, float] = {}
        self._still: set[int] = set()
        self._forces: dict[int, tuple[float, float]] = {}
        self._torques: dict[int, float] = {}
        self._held: dict[int, tuple[float, float]] = {}
        self.heights: dict[int, float] = {}
        self._steering: dict[int, Steering] = {}
        self._movers: dict[float, Mover] = {}

    def __contains__(self, vehicle: int) -> bool:
        """Whether this vehicle exists."""
        return vehicle in self._rows

    def body(self, vehicle: int) -> Body:
        """The numbers of a vehicle."""
        return self._bodies[self._rows[vehicle]]

    def add(self, vehicle: int, body: Body, motion: Motion) -> None:
        """Put a vehicle on the ground."""
        self._ids.append(vehicle)
        self._bodies.append(body)
        self._prepare()
        self.place(vehicle, motion)
        self.set_velocity(vehicle, motion.along, motion.across)

    def remove(self, vehicle: int) -> None:
        """Take a vehicle away."""
        row = self._rows[vehicle]
        del self._ids[row], self._bodies[row]
        self._still.discard(vehicle)
        for kept in (self._backwards, self._forces, self._torques, self._held, self._steering):
            kept.pop(vehicle, None)
        self.heights.pop(vehicle, None)
        self._prepare()

    def set_body(self, vehicle: int, body: Body, steering: Steering) -> None:
        """Change the numbers of a vehicle, and how far its wheels turn."""
        self._bodies[self._rows[vehicle]] = body
        self._steering[vehicle] = steering
        self._prepare()

    def steering(self, vehicle: int) -> Steering:
        """How far the wheels of a vehicle turn."""
        return self._steering.get(vehicle, Steering())

    def set_weather(self, weather: Sequence[float]) -> None:
        """Change the weather for all."""
        self._weather = tuple(weather)
        self._prepare()

    def set_nature(self, nature: Nature) -> None:
        """Change what the weather leaves open."""
        self._nature = nature
        self._prepare()

    def set_moves(self, vehicle: int, *, moves: bool) -> None:
        """Set whether physics moves a vehicle, or only `place`."""
        (self._still.discard if moves else self._still.add)(vehicle)

    def moves(self, vehicle: int) -> bool:
        """Whether physics moves a vehicle."""
        return vehicle not in self._still

    def place(self, vehicle: int, motion: Motion) -> None:
        """Put a vehicle elsewhere; it keeps its velocity along its axes."""
        row, state = self._rows[vehicle], self._state
        for name in ("s", "d", "psi"):
            getattr(state, name)[row] = getattr(motion, name)

    def set_velocity(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle a velocity in the ground's frame [m/s]."""
        row, state = self._rows[vehicle], self._state
        cosine, sine = math.cos(float(state.psi[row, 0])), math.sin(float(state.psi[row, 0]))
        forward, left = along * cosine + across * sine, across * cosine - along * sine
        self._backwards[vehicle] = max(-forward, 0.0)
        state.vx[row], state.vy[row] = max(forward, 0.0), left if forward >= 0.0 else 0.0
        if along == across == 0.0:
            state.r[row] = state.a_lon[row] = state.a_lat[row] = 0.0

    def set_yaw_rate(self, vehicle: int, yaw_rate: float) -> None:
        """Give a vehicle a yaw rate, anticlockwise [rad/s]."""
        self._state.r[self._rows[vehicle]] = yaw_rate

    def push(self, vehicle: int, along: float, across: float) -> None:
        """Give a vehicle an impulse in the ground's frame [N s]."""
        now, mass = self.motion(vehicle), self.body(vehicle)["mass"]
        self.set_velocity(vehicle, now.along + along / mass, now.across + across / mass)

    def force(self, vehicle: int, along: float, across: float) -> None:
        """Let a force in the ground's frame act on a vehicle during the next tick [N]."""
        old = self._forces.get(vehicle, (0.0, 0.0))
        self._forces[vehicle] = (old[0] + along, old[1] + across)

    def spin(self, vehicle: int, impulse: float) -> None:
        """Give a vehicle an angular impulse, anticlockwise [kg m^2/s]."""
        self._state.r[self._rows[vehicle]] += impulse / self.body(vehicle)["yaw_inertia"]

    def twist(self, vehicle: int, torque: float) -> None:
        """Let a torque act on a vehicle during the next tick, anticlockwise [N m]."""
        self._torques[vehicle] = self._torques.get(vehicle, 0.0) + torque

    def hold_velocity(self, vehicle: int, forward: float, left: float) -> None:
        """Keep a velocity in the vehicle's axes until `release_velocity` [m/s]."""
        self._held[vehicle] = (forward, left)

    def release_velocity(self, vehicle: int) -> None:
        """Leave the velocity to pedals and forces again."""
        self._held.pop(vehicle, None)

    def motion(self, vehicle: int) -> Motion:
        """Where a vehicle is and how it moves."""
        return self.motions()[vehicle]

    def driven(self, vehicle: int) -> Driven:
        """What the model knows of a vehicle."""
        row, state = self._rows[vehicle], self._state
        found = Driven(*(float(getattr(state, name)[row, 0]) for name in _DRIVEN))
        body = self.body(vehicle)
        if not body["two_wheeler"]:
            return found
        curve = found.angle * body["wheelbase"]  # Its wheel stands for lateral acceleration.
        return found._replace(angle=math.atan2(curve, max(found.vx, 1.0) ** 2))

    def motions(self) -> dict[int, Motion]:
        """Where every vehicle is and how it moves."""
        if not self._ids:
            return {}
        state = self._state
        columns = (state.s, state.d, state.psi, state.vx, state.vy, state.r)
        rows = np.stack([column[:, 0] for column in columns], axis=1).tolist()
        found: dict[int, Motion] = {}
        for vehicle, (s, d, psi, vx, vy, r) in zip(self._ids, rows, strict=True):
            forward = vx - self._backwards.get(vehicle, 0.0)
            cosine, sine = math.cos(psi), math.sin(psi)
            along, across = forward * cosine - vy * sine, forward * sine + vy * cosine
            found[vehicle] = Motion(s, d, math.remainder(psi, math.tau), along, across, r)
        return found

    def is_free(self, body: Body, motion: Motion, height: float) -> bool:
        """Whether no vehicle is in the place of a new one at some height [m]."""
        return not any(
            abs(self.heights.get(vehicle, 0.0) - height) < LEVELS_APART
            and overlap(body, motion, self.body(vehicle), at)
            for vehicle, at in self.motions().items()
        )

    def advance(self, duration: float, controls: Mapping[int, Control]) -> list[Touch]:
        """Move every vehicle.

        Args:
            duration: Length of the tick [s].
            controls: Pedals and steering of each vehicle.

        Returns:
            The contacts.
        """
        if not self._ids:
            return []
        count = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        mover = self._mover(duration, count)
        mover.weather(self._state, self._decision)
        self._decision += 1
        self._add_forces(duration)
        self._hold()
        wanted = self._wanted(controls)
        pairs = self._near_pairs(duration)
        touches: list[Touch] = []
        if pairs:
            for _ in range(count):
                touches += self._collide(mover, wanted, pairs)
        else:
            self._drive(mover, wanted, count)
        self._roll_back(duration, controls)
        self._hold()
        self._forces.clear()
        self._torques.clear()
        return touches

    def _prepare(self) -> None:
        """Work out the parameters again, and carry what moves over to the new rows."""
        old = {vehicle: row for vehicle, row in self._rows.items() if vehicle in self._ids}
        self._rows = {vehicle: row for row, vehicle in enumerate(self._ids)}
        if not self._ids:
            return
        given = parameters(
            scenario_of(self._ground.road, self._bodies, self._weather, self._nature)
        )
        self._given: Parameters = given
        self._fields = given.of_vehicles
        if not self._ground.shelters:
            self._fields.shelters[:] = _ZERO
        self._movers.clear()
        state = initial_state(given)
        state.end_step[:] = _FOREVER
        for vehicle, row in old.items():
            for name in MOVING:
                getattr(state, name)[self._rows[vehicle]] = getattr(self._state, name)[row]
        self._state: State = state

    def _mover(self, duration: float, count: int) -> Mover:
        """What moves the vehicles by a tick of `count` steps, kept for the next one."""
        if duration not in self._movers:
            self._movers.clear()
            c = self._given.constants.replace(step=duration / count, decision=duration)
            self._movers[duration] = mover(dataclasses.replace(self._given, constants=c))
        return self._movers[duration]

    def _add_forces(self, duration: float) -> None:
        """Add what pushes from outside: sideways like the wind, lengthwise as a change of speed."""
        state = self._state
        for vehicle, (along, across) in self._forces.items():
            row = self._rows[vehicle]
            cosine, sine = math.cos(float(state.psi[row, 0])), math.sin(float(state.psi[row, 0]))
            state.wind_force[row] += np.float32(across * cosine - along * sine)
            change = (along * cosine + across * sine) * duration
            state.vx[row] = max(float(state.vx[row, 0]) + change / self.body(vehicle)["mass"], 0.0)

        for vehicle, torque in self._torques.items():
            self.spin(vehicle, torque * duration)

    def _hold(self) -> None:
        """Set the velocities that are kept; friction takes something of them in each tick."""
        for vehicle, (forward, left) in self._held.items():
            psi = float(self._state.psi[self._rows[vehicle], 0])
            cosine, sine = math.cos(psi), math.sin(psi)
            along, across = forward * cosine - left * sine, forward * sine + left * cosine
            self.set_velocity(vehicle, along, across)

    def _wanted(self, controls: Mapping[int, Control]) -> Controls:
        """Throttle, brake and wanted wheel angle of each vehicle."""
        wanted = [controls.get(vehicle, _NO_CONTROL) for vehicle in self._ids]
        throttle = [0.0 if one.reverse else one.throttle for one in wanted]
        brake = [min(one.brake + HAND_BRAKE * one.hand_brake, 1.0) for one in wanted]
        # Forward motion ends under full braking before the reverse gear engages.
        brake = [1.0 if one.reverse else b for one, b in zip(wanted, brake, strict=True)]
        speeds = kmh_from_mps(self._state.vx[:, 0])
        lock = Steering().angles(speeds)
        for vehicle, own in self._steering.items():
            row = self._rows[vehicle]
            lock[row] = own.angles(speeds[row])
        # CARLA's steering is positive to the right.
        angle = -lock * np.array([one.steer for one in wanted])
        return Controls(_column(throttle), _column(brake), _column(angle))

    def _drive(self, mover: Mover, wanted: Controls, steps: int) -> None:
        """Let physics move the vehicles, except those that only `place` moves."""
        with self._placed():
            mover.drive(self._state, wanted, steps)

    @contextmanager
    def _placed(self) -> Generator[None]:
        """Keep vehicles where they are that only `place` moves."""
        state = self._state
        still = [self._rows[vehicle] for vehicle in self._ids if vehicle in self._still]
        held = {name: getattr(state, name)[still].copy() for name in ("s", "d", "psi")}
        yield
        for name, value in held.items():
            getattr(state, name)[still] = value

    def _near_pairs(self, duration: float) -> list[tuple[int, int]]:
        """Rows of vehicles that may touch before the next tick: near along and across the ground.

        Most pass each other in lanes of their own, and those need no look at their contacts.
        """
        if len(self._ids) < 2:
            return []
        state, p = self._state, self._fields
        sine, cosine = np.sin(state.psi), np.cos(state.psi)
        turned = duration * np.abs(state.r) * p.half_length
        nearer = _NEAR + 0.5 * _HARDEST * duration * duration
        high = _column([self.heights.get(vehicle, 0.0) for vehicle in self._ids])
        close = np.abs(high - high.T) < LEVELS_APART
        for place, length, width, speed in (
            (state.s, cosine, sine, state.vx * cosine - state.vy * sine),
            (state.d, sine, cosine, state.vx * sine + state.vy * cosine),
        ):
            reach = p.half_length * np.abs(length) + p.half_width * np.abs(width) + turned
            closing = duration * np.abs(speed - speed.T)
            close &= np.abs(place - place.T) < reach + reach.T + closing + nearer
        return [(i, j) for i, j in np.argwhere(close).tolist() if i < j]

    def _collide(self, mover: Mover, wanted: Controls, pairs: list[tuple[int, int]]) -> list[Touch]:
        """One step with exchange of momentum; unlike in a simulation, vehicles drive on."""
        state = self._state
        before = (state.s.copy(), state.d.copy())
        self._drive(mover, wanted, 1)
        state.contact_partner[:] = NOBODY
        was = {row: self._momentum(row) for pair in pairs for row in pair}
        every = {pair: np.ones(1, np.bool_) for pair in pairs}
        with self._placed():
            c = mover.constants
            collisions.collide(state, c, self._fields, every, before, 0, c.step)
        state.crashed[:] = _ZERO
        touches: list[Touch] = []
        for row, (along, across) in was.items():
            partner = int(state.contact_partner[row, 0])
            if partner >= 0:
                new = self._momentum(row)
                gain = (new[0] - along, new[1] - across)
                touches.append(Touch(self._ids[row], self._ids[partner], *gain))
        return touches

    def _momentum(self, row: int) -> tuple[float, float]:
        """Momentum of a vehicle in the ground's frame [N s]."""
        state, mass = self._state, self._bodies[row]["mass"]
        psi, vx, vy = (float(x[row, 0]) for x in (state.psi, state.vx, state.vy))
        cosine, sine = math.cos(psi), math.sin(psi)
        return mass * (vx * cosine - vy * sine), mass * (vx * sine + vy * cosine)

    def _roll_back(self, duration: float, controls: Mapping[int, Control]) -> None:
        """Drive backwards: slowly, on the circle that the front wheels give, without slip."""
        state = self._state
        for vehicle, row in self._rows.items():
            control, speed = controls.get(vehicle, _NO_CONTROL), self._backwards.get(vehicle, 0.0)
            wants = control.reverse and float(state.vx[row, 0]) == 0.0
            push = BACKWARDS_ACCEL * control.throttle if wants else 0.0
            braking = self.body(vehicle)["peak_decel"] * max(control.brake, control.hand_brake)
            speed = max(speed + duration * (push - braking), 0.0)
            if not control.reverse and control.throttle > 0.0:
                speed = 0.0
            speed = self._backwards[vehicle] = min(speed, BACKWARDS_SPEED)
            if speed == 0.0 or vehicle in self._still:
                continue
            psi, angle = float(state.psi[row, 0]), float(state.wheel[row, 0])
            state.vx[row] = state.vy[row] = 0.0
            state.s[row] -= np.float32(speed * duration * math.cos(psi))
            state.d[row] -= np.float32(speed * duration * math.sin(psi))
            turn = -speed * math.tan(angle) / self.body(vehicle)["wheelbase"]
            state.psi[row] += np.float32(turn * duration)


def _column(values: Any) -> F32:
    return np.asarray(values, np.float32)[:, None]
