"""Our drivers at the wheel of CARLA's vehicles, at true speed.

CARLA moves the vehicles; the drivers of the model see, decide and steer as in a simulation: the
same functions of `sim.reference`, 20 times a second, from the states that CARLA reports. Their
wishes become throttle, brake and steering.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from overtaking.core.arrays import F32, F64
from overtaking.core.errors import ConfigError
from overtaking.core.units import kmh_from_mps
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference import collisions, steering
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.simulation import decide
from overtaking.sim.reference.state import State
from overtaking.simulators.carla.stage import CarlaStage, Contact, Reading
from overtaking.simulators.carla.world import TICK
from overtaking.simulators.carla_server.motion import SteeringLimits
from overtaking.world.constants import SUBSTEPS, ModelConstants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.step_parameters import (
    SIMULATION_FIELDS,
    StepParameters,
    step_parameters,
)

TICK_MS = 50
SPEED_GAIN = 2.0
"""How fast an error of the speed is corrected [1/s]."""

MAX_PUSH = 3.0
"""Sideways acceleration up to which a push from outside is answered [m/s^2]."""

MAX_LAG = 1.0
"""The speed aimed at stays this near to the one driven, so that nothing winds up [m/s]."""

HARDEST = 15.0
"""No tyre gives more; accelerations beyond it are contacts, which are recorded apart [m/s^2]."""

_OUTLOOK = 40.0  # Before the road ends by this much the simulation does [m].

Sign = Callable[[], None]
"""Called after every tick, as a sign of life."""


def run(stage: CarlaStage, sign: Sign) -> Trajectories:
    """Drive a scenario to its end.

    Args:
        stage: The world, set up.
        sign: Called after every tick.

    Raises:
        ConfigError: Frames are not whole ticks apart.
    """
    return _Drive(stage).run(sign)


class _Drive:
    """One simulation.

    Args:
        stage: The world, set up.
    """

    def __init__(self, stage: CarlaStage) -> None:
        """Prepare the drivers."""
        scenario = stage.scenario
        check_interval(scenario)
        self._stage = stage
        self._given = still(step_parameters(scenario))
        self._p = self._given.vehicles
        self._q = self._given.simulations
        self._state = State.at_start(self._given)
        self._recorder = Recorder(scenario, self._given)
        self._steering = {slot: _steering(actor) for slot, actor in stage.actors.items()}
        self._pushed = np.zeros_like(self._state.motion.s)
        self._sideways = np.zeros_like(self._state.motion.s)
        self._aim = self._state.motion.vx[:, 0].astype(np.float64)

    def run(self, sign: Sign) -> Trajectories:
        """See, decide, steer, tick."""
        state, given, step = self._state, self._given, 0
        while np.float32(step) <= state.end_step[0]:
            reading = self._stage.tick()
            take_over(state, reading, self._stage.scenario)
            contacts = self._stage.contacts(reading.frame)
            note_contacts(state, given, contacts, step - SUBSTEPS)
            decide(state, given, step=step, recorder=self._recorder)
            if step % given.steps_per_frame == 0:
                active = np.float32(step) <= state.end_step
                self._recorder.record_frame(state, given, active, step // given.steps_per_frame)
            self._act(step)
            if float(state.motion.s[EGO_SLOT, 0]) > self._stage.end - _OUTLOOK:
                state.end_step[:] = np.float32(step)
            sign()
            step += SUBSTEPS
        return self._recorder.finish(state)

    def _act(self, step: int) -> None:
        """Set pedals, steering and lamps of every vehicle."""
        state, stage = self._state, self._stage
        number = step // self._given.steps_per_frame
        # A two-wheeler leans with the lag of the vehicle, which is the server's: within a tick.
        c = self._given.constants.replace(step=TICK, two_wheeler_lag=0.5 * TICK)
        state.controls.wind_trim = self._trim(c)
        params = dataclasses.replace(self._given, constants=c)
        steering.steer(state, params, self._q.max_lateral_accel, c.step)
        forces = self._forces()
        batch: list[Any] = []
        for slot, actor in stage.actors.items():
            control = self._control(slot, forces[slot])
            batch.append(stage.carla.command.ApplyVehicleControl(actor.id, control))
            stage.show(slot, int(self._recorder.states.lights[0, slot, number]))
        stage.client.apply_batch_sync(batch, False)

    def _trim(self, c: ModelConstants) -> F32:
        """Wheel angle, or lean, against what pushes all the time: wind, mostly [rad or m/s^2].

        In a simulation a driver knows the wind. Here the sideways acceleration that wheels do not
        explain is felt, with the same lag.
        """
        state, p = self._state, self._p
        _, sideways = state.road_velocity()
        # In a bend the road turns away from under the vehicle, which is no push.
        bend = state.motion.vx * state.motion.vx * state.road.curvature
        curve = p.wheelbase / np.maximum(state.motion.vx, c.slip_speed) ** 2 + p.understeer
        steered = np.where(
            p.two_wheeler > 0, state.controls.wheel_angle, state.controls.wheel_angle / curve
        )
        pushed = (sideways - self._sideways) / TICK + bend - steered
        self._sideways = sideways
        sound = np.clip(np.where(state.motion.is_wreck > 0, 0.0, pushed), -MAX_PUSH, MAX_PUSH)
        self._pushed = self._pushed + (sound - self._pushed) * (TICK / float(c.wind_lag))
        trim = -np.where(p.two_wheeler > 0, self._pushed, self._pushed * curve)
        return trim.astype(np.float32)

    def _forces(self) -> F64:
        """Force that each vehicle needs for what its driver wants [N]."""
        state, p = self._state, self._p
        speed = state.motion.vx[:, 0].astype(np.float64)
        accel = state.controls.requested_accel[:, 0].astype(np.float64)
        self._aim = np.clip(self._aim + accel * TICK, speed - MAX_LAG, speed + MAX_LAG)
        wanted = accel + SPEED_GAIN * (self._aim - speed)
        resistance = p.drag[:, 0] * speed * speed + p.rolling[:, 0]
        return p.mass[:, 0] * wanted + resistance

    def _control(self, slot: int, force: float) -> Any:
        """`carla.VehicleControl` of one vehicle; a wreck has its wheels locked."""
        carla, p, state = self._stage.carla, self._p, self._state
        if state.motion.is_wreck[slot, 0] > 0:
            return carla.VehicleControl(brake=1.0)
        speed = float(state.motion.vx[slot, 0])
        most = min(float(p.launch_force[slot, 0]), float(p.power[slot, 0]) / max(speed, 1.0))
        angle = self._stage.scenario.road.overtaking_sign * self._wheel_angle(slot, speed)
        # CARLA's steering is positive to the right.
        steer = -angle / float(self._steering[slot].angles(kmh_from_mps(speed)))
        return carla.VehicleControl(
            throttle=min(max(force / most, 0.0), 1.0),
            brake=min(max(-force / float(p.max_brake_force[slot, 0]), 0.0), 1.0),
            steer=min(max(steer, -1.0), 1.0),
        )

    def _wheel_angle(self, slot: int, speed: float) -> float:
        """Angle of the front wheels; for a two-wheeler the one of its curve [rad]."""
        wanted = float(self._state.controls.wheel_angle[slot, 0])
        if not self._p.two_wheeler[slot, 0]:
            return wanted
        return math.atan(wanted * float(self._p.wheelbase[slot, 0]) / max(speed, 3.0) ** 2)


def _steering(actor: Any) -> SteeringLimits:
    """Limits of the wheel angle, as the vehicle reports them."""
    physics = actor.get_physics_control()
    lock = max((wheel.max_steer_angle for wheel in physics.wheels), default=0.0) or 70.0
    curve = tuple((point.x, point.y) for point in physics.steering_curve)
    return SteeringLimits(math.radians(lock), curve or ((0.0, 1.0),))


def check_interval(scenario: Scenario) -> None:
    """Refuse frames that do not fall on ticks."""
    if scenario.frame_interval_ms % TICK_MS:
        raise ConfigError(
            what="frame_interval_ms",
            where="the simulator CARLA",
            expected=f"a multiple of {TICK_MS}, the length of its tick",
            got=scenario.frame_interval_ms,
            next_step=f"choose --frame-interval-ms {TICK_MS}",
        )


def take_over(state: State, reading: Reading, scenario: Scenario, *, faster: float = 1.0) -> None:
    """Copy CARLA's reading into the state, whose lateral axis points to the fast side.

    Who comes the other way is in the frame of its own direction there, turned by half a turn.

    Args:
        state: Of one simulation, changed in place.
        reading: The vehicles.
        scenario: A batch of one.
        faster: Factor by which time is to run faster than it did on the server.
    """
    side, v, a = scenario.road.overtaking_sign, faster, faster * faster
    filled = scenario.vehicles.valid[0]
    road = road_parameters(scenario.road)
    comes = scenario.start_lane[0] == scenario.road.num_lanes
    turned = np.remainder(reading.psi + math.tau, math.tau) - math.pi
    values = {
        "s": np.where(comes, float(road.length) - reading.s, reading.s),
        "d": np.where(comes, float(road.edge_sum) - side * reading.d, side * reading.d),
        "heading": side * np.where(comes, turned, reading.psi),
        "vx": v * reading.along,
        "vy": v * side * reading.left,
        "yaw_rate": v * side * reading.yaw_rate,
        "accel_lon": a * reading.accel,
        "accel_lat": a * side * reading.accel_left,
    }
    contact = np.hypot(reading.accel, reading.accel_left) > HARDEST
    values["accel_lon"], values["accel_lat"] = (
        np.where(contact, 0.0, values[name]) for name in ("accel_lon", "accel_lat")
    )
    for name, value in values.items():
        column = getattr(state.motion, name)
        column[filled, 0] = value[filled].astype(np.float32)


def note_contacts(
    state: State,
    params: StepParameters,
    contacts: list[Contact],
    step: int,
    faster: float = 1.0,
) -> None:
    """Write down the first contact of each vehicle, and make it a wreck.

    The speed of approach is what the impulse took away, m dv = J on either side, so that
    no velocity before the contact is needed: J (1/m1 + 1/m2) / (1 + e).
    """
    vehicles, constants = params.vehicles, params.constants
    sound = state.motion.is_wreck[EGO_SLOT].copy() == 0
    for one in contacts:
        if one.other < 0 or state.first_contact.partner[one.own, 0] >= 0:
            continue
        size = faster * math.hypot(*one.impulse)
        softness = float(vehicles.inverse_mass[one.own, 0] + vehicles.inverse_mass[one.other, 0])
        state.first_contact.partner[one.own, 0] = np.float32(one.other)
        state.first_contact.time[one.own, 0] = np.float32(step) * constants.step
        state.first_contact.impulse[one.own, 0] = np.float32(size)
        rebound = 1.0 + float(constants.restitution)
        state.first_contact.closing_speed[one.own, 0] = np.float32(size * softness / rebound)
        state.motion.is_wreck[one.own, 0] = np.float32(1.0)
    collisions.end_after_ego_accident(
        state, params, sound & (state.motion.is_wreck[EGO_SLOT] > 0), step
    )


def still(given: StepParameters) -> StepParameters:
    """The same parameters without wind: whether there is any, only the server knows."""
    simulation = given.simulation_table.copy()
    for name in ("wind_along", "wind_across"):
        simulation[SIMULATION_FIELDS.index(name)] = 0.0
    return dataclasses.replace(given, simulation_table=simulation)
