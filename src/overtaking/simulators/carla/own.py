"""Drivers of the model at the wheel of CARLA's vehicles, at true speed.

CARLA moves the vehicles. The drivers see, decide and steer as in a simulation of our own, 20 times
a second, from the states that CARLA reports. Their requests become throttle, brake and steering.
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
from overtaking.sim.external_motion import (
    DriverOutput,
    ExternallyMovedSimulation,
    VehicleMotion,
)
from overtaking.simulators.carla.stage import CarlaScene, MotionReading
from overtaking.simulators.carla.world import TICK
from overtaking.simulators.carla_server.motion import SteeringLimits
from overtaking.world.constants import SUBSTEPS, ModelConstants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.step_parameters import (
    SIMULATION_FIELDS,
    StepParameters,
    VehicleParameters,
    step_parameters,
)

TICK_MS = 50
SPEED_GAIN = 2.0
"""How fast an error of the speed is corrected [1/s]."""

MAX_CROSSWIND_ACCEL = 3.0
"""Lateral acceleration up to which drivers answer a push from outside [m/s^2]."""

MAX_SPEED_ERROR = 1.0
"""Largest difference of target speed and speed: a larger one would grow while a vehicle cannot
follow, and then overshoot [m/s]."""

MAX_TYRE_ACCEL = 15.0
"""No tyre gives more; accelerations beyond it are contacts, which are recorded apart [m/s^2]."""

_ROAD_END_MARGIN = 40.0  # The simulation ends so far before the end of the road [m].

HeartbeatCallback = Callable[[], None]
"""Called after every tick, as a sign of life."""


def run_model_drivers(scene: CarlaScene, send_heartbeat: HeartbeatCallback) -> Trajectories:
    """Drive a scenario to its end.

    Args:
        scene: The world, set up.
        send_heartbeat: Called after every tick.

    Raises:
        ConfigError: Frames are not whole ticks apart.
    """
    return ModelDriversRun(scene).run(send_heartbeat)


class ModelDriversRun:
    """One simulation.

    Args:
        scene: The world, set up.
    """

    def __init__(self, scene: CarlaScene) -> None:
        """Prepare the drivers."""
        scenario = scene.scenario
        check_frame_interval(scenario)
        self._scene = scene
        params = _without_wind(step_parameters(scenario))
        self._vehicles = params.vehicles
        self._simulation = ExternallyMovedSimulation(scenario, params, TICK)
        self._crosswind = CrosswindEstimator(params.vehicles, params.constants)
        self._steering = {slot: _steering_limits(actor) for slot, actor in scene.actors.items()}
        self._target_speed = params.vehicles.start_speed[:, 0].astype(np.float64)

    def run(self, send_heartbeat: HeartbeatCallback) -> Trajectories:
        """Read, decide, steer, tick, until the simulation ends."""
        simulation, scene, step = self._simulation, self._scene, 0
        while step <= simulation.end_step:
            reading = scene.tick()
            motion = motion_from_reading(reading, scene.scenario)
            # The sensors may not have reported all contacts of this tick yet.
            simulation.record_contacts(scene.contacts(reading.tick), step - SUBSTEPS)
            self._act(motion, simulation.decide(motion, step))
            if float(motion.s[EGO_SLOT]) > scene.road_end - _ROAD_END_MARGIN:
                simulation.end_at(step)
            send_heartbeat()
            step += SUBSTEPS
        return simulation.finish()

    def _act(self, motion: VehicleMotion, output: DriverOutput) -> None:
        """Set pedals, steering and lamps of every vehicle."""
        scene = self._scene
        wheel_angle = self._simulation.steer(self._crosswind.update(motion, output, TICK))
        forces = self._forces(motion, output)
        batch: list[Any] = []
        for slot, actor in scene.actors.items():
            if output.is_wreck[slot]:
                control = scene.carla.VehicleControl(brake=1.0)  # Its wheels are locked.
            else:
                speed, angle = float(motion.vx[slot]), float(wheel_angle[slot])
                control = self._control(slot, forces[slot], speed, angle)
            batch.append(scene.carla.command.ApplyVehicleControl(actor.id, control))
            scene.set_lights(slot, int(output.lights[slot]))
        scene.client.apply_batch_sync(batch, False)

    def _forces(self, motion: VehicleMotion, output: DriverOutput) -> F64:
        """Force that each vehicle needs for the acceleration that its driver requests [N]."""
        vehicles = self._vehicles
        speed = motion.vx.astype(np.float64)
        accel = output.requested_accel.astype(np.float64)
        self._target_speed = np.clip(
            self._target_speed + accel * TICK, speed - MAX_SPEED_ERROR, speed + MAX_SPEED_ERROR
        )
        corrected = accel + SPEED_GAIN * (self._target_speed - speed)
        resistance = vehicles.drag[:, 0] * speed * speed + vehicles.rolling[:, 0]
        return vehicles.mass[:, 0] * corrected + resistance

    def _control(self, slot: int, force: float, speed: float, wheel_angle: float) -> Any:
        """`carla.VehicleControl` of one vehicle.

        Args:
            slot: Slot of the vehicle.
            force: Force along the vehicle [N].
            speed: Its speed [m/s].
            wheel_angle: Angle of the front wheels [rad], or lateral acceleration of a two-wheeler
                [m/s^2], positive to the overtaking side.
        """
        vehicles = self._vehicles
        engine_force = min(
            float(vehicles.launch_force[slot, 0]), float(vehicles.power[slot, 0]) / max(speed, 1.0)
        )
        if vehicles.two_wheeler[slot, 0]:
            # The angle of the curve with this lateral acceleration.
            wheelbase = float(vehicles.wheelbase[slot, 0])
            wheel_angle = math.atan(wheel_angle * wheelbase / max(speed, 3.0) ** 2)
        angle = self._scene.scenario.road.overtaking_sign * wheel_angle
        # CARLA's steering is positive to the right.
        steer = -angle / float(self._steering[slot].angles(kmh_from_mps(speed)))
        return self._scene.carla.VehicleControl(
            throttle=min(max(force / engine_force, 0.0), 1.0),
            brake=min(max(-force / float(vehicles.max_brake_force[slot, 0]), 0.0), 1.0),
            steer=min(max(steer, -1.0), 1.0),
        )


class CrosswindEstimator:
    """Estimates the lateral push on vehicles, and the steering that holds against it.

    In our own simulations a driver knows the wind. CARLA reports none, so here a driver feels the
    lateral acceleration that the wheel angle does not explain, with the lag `wind_lag` of drivers
    in wind. `update` is called once for each tick.

    Args:
        vehicles: Parameters of the vehicles, arrays of shape (slot, 1).
        constants: Constants of the model.
    """

    def __init__(self, vehicles: VehicleParameters, constants: ModelConstants) -> None:
        """Start without any push."""
        self._wheelbase, self._understeer = vehicles.wheelbase[:, 0], vehicles.understeer[:, 0]
        self._is_two_wheeler = vehicles.two_wheeler[:, 0] > 0
        self._constants = constants
        self._push = np.zeros_like(self._wheelbase)
        self._lateral_speed = np.zeros_like(self._wheelbase)

    def update(self, motion: VehicleMotion, output: DriverOutput, tick: float) -> F32:
        """Update the estimate by one tick, and return the trim against the push.

        Args:
            motion: Motion of the vehicles.
            output: Wheel angles of the last tick, curvature of the road, and wrecks.
            tick: Length of the tick [s].

        Returns:
            Wheel angle to add [rad]; for two-wheelers, lateral acceleration [m/s^2].
        """
        constants = self._constants
        # In a bend, keeping the lane takes the acceleration v^2 * curvature without any push.
        accel_in_bend = motion.vx * motion.vx * output.curvature
        # Single-track model in steady cornering: angle = lateral acceleration * (l / v^2 + K).
        # The bound on the speed keeps the angle finite at rest.
        angle_per_accel = (
            self._wheelbase / np.maximum(motion.vx, constants.slip_speed) ** 2 + self._understeer
        )
        # For two-wheelers `wheel_angle` is the lean, as a lateral acceleration.
        steered = np.where(
            self._is_two_wheeler, output.wheel_angle, output.wheel_angle / angle_per_accel
        )
        change = (output.lateral_speed - self._lateral_speed) / tick
        self._lateral_speed = output.lateral_speed
        unexplained = change + accel_in_bend - steered
        # A contact is no wind: wrecks feel nothing, and no vehicle feels more than the bound.
        measured = np.clip(
            np.where(output.is_wreck, 0.0, unexplained), -MAX_CROSSWIND_ACCEL, MAX_CROSSWIND_ACCEL
        )
        self._push = self._push + (measured - self._push) * (tick / float(constants.wind_lag))
        wind_trim = -np.where(self._is_two_wheeler, self._push, self._push * angle_per_accel)
        return wind_trim.astype(np.float32)


def _steering_limits(actor: Any) -> SteeringLimits:
    """Limits of the wheel angle, as the vehicle reports them."""
    physics = actor.get_physics_control()
    lock = max((wheel.max_steer_angle for wheel in physics.wheels), default=0.0) or 70.0
    curve = tuple((point.x, point.y) for point in physics.steering_curve)
    return SteeringLimits(math.radians(lock), curve or ((0.0, 1.0),))


def check_frame_interval(scenario: Scenario) -> None:
    """Refuse frames that do not fall on ticks."""
    if scenario.frame_interval_ms % TICK_MS:
        raise ConfigError(
            what="frame_interval_ms",
            where="the simulator CARLA",
            expected=f"a multiple of {TICK_MS}, the length of its tick",
            got=scenario.frame_interval_ms,
            next_step=f"choose --frame-interval-ms {TICK_MS}",
        )


def motion_from_reading(
    reading: MotionReading, scenario: Scenario, *, time_scale: float = 1.0
) -> VehicleMotion:
    """CARLA's reading as motion in the frames of the model.

    The lateral axis of the model points to the overtaking side. Oncoming vehicles are in the frame
    of their own direction, which is turned by half a turn.

    Args:
        reading: The vehicles.
        scenario: A batch of one.
        time_scale: Factor by which time runs faster than it did on the server.
    """
    side, filled = scenario.road.overtaking_sign, scenario.vehicles.valid[0]
    v, a = time_scale, time_scale * time_scale
    road = road_parameters(scenario.road)
    is_oncoming = scenario.start_lane[0] == scenario.road.num_lanes
    turned = np.remainder(reading.heading + math.tau, math.tau) - math.pi
    is_contact = np.hypot(reading.accel_lon, reading.accel_lat) > MAX_TYRE_ACCEL

    def column(values: F64) -> F32:
        return np.where(filled, values, 0.0).astype(np.float32)

    return VehicleMotion(
        s=column(np.where(is_oncoming, float(road.length) - reading.s, reading.s)),
        d=column(np.where(is_oncoming, float(road.edge_sum) - side * reading.d, side * reading.d)),
        heading=column(side * np.where(is_oncoming, turned, reading.heading)),
        vx=column(v * reading.vx),
        vy=column(v * side * reading.vy),
        yaw_rate=column(v * side * reading.yaw_rate),
        accel_lon=column(np.where(is_contact, 0.0, a * reading.accel_lon)),
        accel_lat=column(np.where(is_contact, 0.0, a * side * reading.accel_lat)),
    )


def _without_wind(params: StepParameters) -> StepParameters:
    """The same parameters without wind: whether there is any, only the server knows."""
    simulation_table = params.simulation_table.copy()
    for name in ("wind_along", "wind_across"):
        simulation_table[SIMULATION_FIELDS.index(name)] = 0.0
    return dataclasses.replace(params, simulation_table=simulation_table)
