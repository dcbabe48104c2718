"""The study's way: CARLA's Traffic Managers at a third of the speed.

The study drove with two Traffic Managers, one for the ego and one for the others, and let the ego
change lanes with `force_lane_change`. That fails above 36 km/h, so everything drove at one third of
the speed, and the recording was converted: speeds by 3, accelerations by 9, time by a third. Here
every third tick is kept, so that positions, speeds and time agree again: dx / dt is the speed.

This file chooses what the study does not state: when the ego starts, and how strongly rain and
wind push.
"""

import math
from typing import Any

import numpy as np

from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.core.units import kmh_from_mps
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.external_motion import ExternallyMovedSimulation, VehicleMotion
from overtaking.simulators.carla.own import (
    HeartbeatCallback,
    check_frame_interval,
    motion_from_reading,
)
from overtaking.simulators.carla.stage import CarlaScene
from overtaking.simulators.carla.world import TICK
from overtaking.simulators.sumo.stage import Sight, Watch
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import step_parameters

TIME_SCALE = 3
"""Divisor of all speeds: 120 km/h become 40 km/h."""

STUDY_LEADER_RANGE = 60.0
"""Distance ahead of its front in which the ego looks for a vehicle to overtake [m]; a choice."""

STUDY_LEADER_RANGE_POOR_SIGHT = 30.0
"""The same under clouds or towards a low sun [m]; the study cuts the vision, not saying by what."""

CLOUDS_PERCENT = 60.0
"""Cloudiness above which the study cuts the vision."""

WEATHER_PUSH_ACCEL = 4.0
"""Sideways acceleration of a push at 100 % of rain or wind [m/s^2]; a choice."""

PUSH_INTERVAL = 2.0
"""Time on the server between two pushes, each one tick long [s]; a choice."""

PASSED_MARGIN = 2.0
"""Behind the ego's rear by this much, the other one's front has been passed [m]; a choice."""

_ROAD_END_MARGIN = 40.0  # The simulation ends so far before the end of the road [m].


def run_study(
    scene: CarlaScene, send_heartbeat: HeartbeatCallback, ports: list[int]
) -> Trajectories:
    """Drive a scenario to its end.

    Args:
        scene: The world, set up at a third of the speed.
        send_heartbeat: Called after every tick.
        ports: Free ports of this machine, for the two Traffic Managers.

    Raises:
        ConfigError: Frames are not whole ticks apart.
    """
    check_frame_interval(scene.scenario)
    managers = [scene.client.get_trafficmanager(port) for port in ports]
    for manager in managers:
        manager.set_synchronous_mode(True)
        manager.set_random_device_seed(scene.scenario.seed & 0x7FFF_FFFF)
    found = StudyRun(scene, managers).run(send_heartbeat)
    for manager in managers:
        manager.shut_down()
    return found


class StudyRun:
    """One simulation.

    Args:
        scene: The world, set up.
        managers: That of the ego, and that of the others.
    """

    def __init__(self, scene: CarlaScene, managers: list[Any]) -> None:
        """Hand the vehicles to the Traffic Managers."""
        self._scene, self._manager = scene, managers[0]
        scenario = scene.scenario
        self._params = step_parameters(scenario)
        self._vehicles = self._params.vehicles
        self._simulation = ExternallyMovedSimulation(scenario, self._params, TICK)
        self._stage_tracker = Watch(settled=float(self._params.constants.settled_offset))
        self._indicator = 0.0
        self._deadline_step = int(self._params.simulations.deadline_step[0])
        for slot, actor in scene.actors.items():
            manager = managers[min(slot, 1)]
            speed = scenario.drivers.desired_speed if slot == EGO_SLOT else scenario.start_speed
            actor.set_autopilot(True, manager.get_port())
            manager.auto_lane_change(actor, False)
            manager.set_desired_speed(actor, kmh_from_mps(float(speed[0, slot])) / TIME_SCALE)
            manager.update_vehicle_lights(actor, True)

    def run(self, send_heartbeat: HeartbeatCallback) -> Trajectories:
        """Tick, record every third tick, look and push, until the simulation ends."""
        simulation, scene, ticks, step = self._simulation, self._scene, 0, 0
        while step <= simulation.end_step:
            reading = scene.tick()
            motion = motion_from_reading(reading, scene.scenario, time_scale=TIME_SCALE)
            step = ticks // TIME_SCALE * SUBSTEPS
            simulation.record_contacts(scene.contacts(reading.tick), step, time_scale=TIME_SCALE)
            if simulation.is_ego_wrecked:
                self._stage_tracker.crash()
            if ticks % TIME_SCALE == 0 and step % self._params.steps_per_frame == 0:
                simulation.record(motion, self._stage_tracker.stage, self._indicator, step)
            self._follow_stage(motion, step)
            self._push(ticks)
            if float(motion.s[EGO_SLOT]) > scene.road_end - _ROAD_END_MARGIN:
                self._end_by(step)
            send_heartbeat()
            ticks += 1
            step = ticks // TIME_SCALE * SUBSTEPS
        return simulation.finish().replace(unknown=UNKNOWN)

    def _end_by(self, step: int) -> None:
        """Let the simulation end at a step, if it does not end earlier."""
        self._simulation.end_at(min(self._simulation.end_step, step))

    def _follow_stage(self, motion: VehicleMotion, step: int) -> None:
        """Find the stage of the ego, and ask for the next lane change where it is time."""
        if self._stage_tracker.stage is Stage.CRASHED:
            return
        old_stage, sight = self._stage_tracker.stage, self._sight(motion)
        stage = self._stage_tracker.look(sight)
        constants = self._params.constants
        if stage is Stage.DONE and old_stage is not Stage.DONE:
            self._end_by(step + round(float(constants.after_overtake / constants.step)))
        is_idle = stage is Stage.FOLLOW and not self._stage_tracker.attempted
        if is_idle and step >= self._deadline_step:
            self._end_by(step)
        ego, right_hand = (
            self._scene.actors[EGO_SLOT],
            self._scene.scenario.road.overtaking_sign > 0,
        )
        has_lane = sight.lane < self._params.road.num_lanes - 1
        if stage is Stage.FOLLOW and sight.leader is not None and has_lane:
            self._manager.force_lane_change(ego, not right_hand)
        if stage is Stage.PASS and self._stage_tracker.target in sight.passed:
            self._manager.force_lane_change(ego, right_hand)
        # The indicator of the ego in the recording; the Traffic Manager switches the lamps.
        towards = {Stage.PULL_OUT: 1.0, Stage.RETURN: -1.0, Stage.ABORT: -1.0}
        self._indicator = towards.get(stage, 0.0)

    def _sight(self, motion: VehicleMotion) -> Sight:
        """The state of the traffic from which the stage follows, at the speeds of the recording."""
        road = self._params.road
        valid = [slot for slot in self._scene.actors if slot != EGO_SLOT]
        s, d = motion.s.tolist(), motion.d.tolist()
        half = self._vehicles.half_length[:, 0].tolist()
        lane = self._lane(d[EGO_SLOT])
        centre = 0.5 * float(road.boundaries[lane] + road.boundaries[lane + 1])
        front, rear = s[EGO_SLOT] + half[EGO_SLOT], s[EGO_SLOT] - half[EGO_SLOT]
        reach = front + leader_range(self._scene.scenario)
        ahead = [
            (s[k] - half[k], k)
            for k in valid
            if s[k] > s[EGO_SLOT] and s[k] - half[k] < reach and self._lane(d[k]) == lane
        ]
        psi, vx, vy = (float(row[EGO_SLOT]) for row in (motion.heading, motion.vx, motion.vy))
        return Sight(
            lane=lane,
            offset=d[EGO_SLOT] - centre,
            drift=vx * math.sin(psi) + vy * math.cos(psi),
            leader=min(ahead)[1] if ahead else None,
            passed=frozenset(k for k in valid if s[k] + half[k] < rear - PASSED_MARGIN),
        )

    def _lane(self, d: float) -> int:
        borders = self._params.road.boundaries[1 : self._params.road.num_lanes]
        return int(np.searchsorted(borders, np.float32(d), side="right"))

    def _push(self, ticks: int) -> None:
        """Push all vehicles to one side by rain and wind, for one tick at a time."""
        strength = push_accel(self._scene.scenario)
        if strength == 0.0 or ticks % round(PUSH_INTERVAL / TICK):
            return
        scenario = self._scene.scenario
        draw = ticks // round(PUSH_INTERVAL / TICK)
        word = philox_words(scenario.seed, scenario.scenario_index, Stream.SIMULATOR, draw)[0]
        sign = 1.0 if float(uniform_from_word(word)[0]) < 0.5 else -1.0
        heading = scenario.road.heading
        for slot, actor in self._scene.actors.items():
            force = sign * strength * float(self._vehicles.mass[slot, 0])
            # CARLA's y points to the right.
            x, y = -force * math.sin(heading), -force * math.cos(heading)
            actor.add_force(self._scene.carla.Vector3D(x, y, 0.0))


UNKNOWN = frozenset({"percepts", "wheel_angle"})
"""What the Traffic Manager does not report: its beliefs and the angle of the front wheels."""


def leader_range(scenario: Scenario) -> float:
    """How far ahead the ego looks [m]."""
    has_clouds = float(scenario.weather.cloudiness[0]) > CLOUDS_PERCENT
    has_poor_sight = has_clouds or bool(scenario.weather.low_sun[0])
    return STUDY_LEADER_RANGE_POOR_SIGHT if has_poor_sight else STUDY_LEADER_RANGE


def push_accel(scenario: Scenario) -> float:
    """Sideways acceleration of a push on the server [m/s^2]: the larger of rain and wind."""
    worst = max(float(scenario.weather.rain[0]), float(scenario.weather.wind[0]))
    return WEATHER_PUSH_ACCEL * worst / 100.0
