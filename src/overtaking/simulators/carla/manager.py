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
from overtaking.simulators.carla.own import Sign, check_interval, motion_from_reading
from overtaking.simulators.carla.stage import CarlaStage
from overtaking.simulators.carla.world import TICK
from overtaking.simulators.sumo.stage import Sight, Watch
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import step_parameters

SLOWER = 3
"""Divisor of all speeds: 120 km/h become 40 km/h."""

SIGHT = 60.0
"""Distance ahead of its front in which the ego looks for a vehicle to overtake [m]; a choice."""

POOR_SIGHT = 30.0
"""The same under clouds or towards a low sun [m]; the study cuts the vision, not saying by what."""

CLOUDS_PERCENT = 60.0
"""Cloudiness above which the study cuts the vision."""

PUSH = 4.0
"""Sideways acceleration of a push at 100 % of rain or wind [m/s^2]; a choice."""

PUSH_INTERVAL = 2.0
"""Time on the server between two pushes, each one tick long [s]; a choice."""

CLEAR = 2.0
"""Behind the ego's rear by this much, the other one's front has been passed [m]; a choice."""

_OUTLOOK = 40.0


def run(stage: CarlaStage, sign: Sign, ports: list[int]) -> Trajectories:
    """Drive a scenario to its end.

    Args:
        stage: The world, set up at a third of the speed.
        sign: Called after every tick.
        ports: Free ports of this machine, for the two Traffic Managers.

    Raises:
        ConfigError: Frames are not whole ticks apart.
    """
    check_interval(stage.scenario)
    managers = [stage.client.get_trafficmanager(port) for port in ports]
    for manager in managers:
        manager.set_synchronous_mode(True)
        manager.set_random_device_seed(stage.scenario.seed & 0x7FFF_FFFF)
    found = _Drive(stage, managers).run(sign)
    for manager in managers:
        manager.shut_down()
    return found


class _Drive:
    """One simulation.

    Args:
        stage: The world, set up.
        managers: That of the ego, and that of the others.
    """

    def __init__(self, stage: CarlaStage, managers: list[Any]) -> None:
        """Hand the vehicles to the Traffic Managers."""
        self._stage, self._manager = stage, managers[0]
        scenario = stage.scenario
        self._params = step_parameters(scenario)
        self._vehicles = self._params.vehicles
        self._simulation = ExternallyMovedSimulation(scenario, self._params, TICK)
        self._watch = Watch(settled=float(self._params.constants.settled_offset))
        self._indicator = 0.0
        self._deadline_step = int(self._params.simulations.deadline_step[0])
        for slot, actor in stage.actors.items():
            manager = managers[min(slot, 1)]
            speed = scenario.drivers.desired_speed if slot == EGO_SLOT else scenario.start_speed
            actor.set_autopilot(True, manager.get_port())
            manager.auto_lane_change(actor, False)
            manager.set_desired_speed(actor, kmh_from_mps(float(speed[0, slot])) / SLOWER)
            manager.update_vehicle_lights(actor, True)

    def run(self, sign: Sign) -> Trajectories:
        """Tick, record every third tick, look and push, until the simulation ends."""
        simulation, stage, ticks, step = self._simulation, self._stage, 0, 0
        while step <= simulation.end_step:
            reading = stage.tick()
            motion = motion_from_reading(reading, stage.scenario, time_scale=SLOWER)
            step = ticks // SLOWER * SUBSTEPS
            simulation.note_contacts(stage.contacts(reading.frame), step, time_scale=SLOWER)
            if simulation.is_ego_wrecked:
                self._watch.crash()
            if ticks % SLOWER == 0 and step % self._params.steps_per_frame == 0:
                simulation.record(motion, self._watch.stage, self._indicator, step)
            self._follow_stage(motion, step)
            self._push(ticks)
            if float(motion.s[EGO_SLOT]) > stage.end - _OUTLOOK:
                self._end_by(step)
            sign()
            ticks += 1
            step = ticks // SLOWER * SUBSTEPS
        return simulation.finish().replace(unknown=UNKNOWN)

    def _end_by(self, step: int) -> None:
        """Let the simulation end at a step, if it does not end earlier."""
        self._simulation.end_at(min(self._simulation.end_step, step))

    def _follow_stage(self, motion: VehicleMotion, step: int) -> None:
        """Find the stage of the ego, and ask for the next lane change where it is time."""
        if self._watch.stage is Stage.CRASHED:
            return
        old_stage, sight = self._watch.stage, self._sight(motion)
        stage = self._watch.look(sight)
        constants = self._params.constants
        if stage is Stage.DONE and old_stage is not Stage.DONE:
            self._end_by(step + round(float(constants.after_overtake / constants.step)))
        is_idle = stage is Stage.FOLLOW and not self._watch.attempted
        if is_idle and step >= self._deadline_step:
            self._end_by(step)
        ego, right_hand = (
            self._stage.actors[EGO_SLOT],
            self._stage.scenario.road.overtaking_sign > 0,
        )
        has_lane = sight.lane < self._params.road.num_lanes - 1
        if stage is Stage.FOLLOW and sight.leader is not None and has_lane:
            self._manager.force_lane_change(ego, not right_hand)
        if stage is Stage.PASS and self._watch.target in sight.passed:
            self._manager.force_lane_change(ego, right_hand)
        # The indicator of the ego in the recording; the Traffic Manager switches the lamps.
        towards = {Stage.PULL_OUT: 1.0, Stage.RETURN: -1.0, Stage.ABORT: -1.0}
        self._indicator = towards.get(stage, 0.0)

    def _sight(self, motion: VehicleMotion) -> Sight:
        """The state of the traffic from which the stage follows, at the speeds of the recording."""
        road = self._params.road
        valid = [slot for slot in self._stage.actors if slot != EGO_SLOT]
        s, d = motion.s.tolist(), motion.d.tolist()
        half = self._vehicles.half_length[:, 0].tolist()
        lane = self._lane(d[EGO_SLOT])
        centre = 0.5 * float(road.boundaries[lane] + road.boundaries[lane + 1])
        front, rear = s[EGO_SLOT] + half[EGO_SLOT], s[EGO_SLOT] - half[EGO_SLOT]
        reach = front + far_sight(self._stage.scenario)
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
            passed=frozenset(k for k in valid if s[k] + half[k] < rear - CLEAR),
        )

    def _lane(self, d: float) -> int:
        borders = self._params.road.boundaries[1 : self._params.road.num_lanes]
        return int(np.searchsorted(borders, np.float32(d), side="right"))

    def _push(self, ticks: int) -> None:
        """Push all vehicles to one side by rain and wind, for one tick at a time."""
        strength = push_accel(self._stage.scenario)
        if strength == 0.0 or ticks % round(PUSH_INTERVAL / TICK):
            return
        scenario = self._stage.scenario
        draw = ticks // round(PUSH_INTERVAL / TICK)
        word = philox_words(scenario.seed, scenario.scenario_index, Stream.SIMULATOR, draw)[0]
        sign = 1.0 if float(uniform_from_word(word)[0]) < 0.5 else -1.0
        heading = scenario.road.heading
        for slot, actor in self._stage.actors.items():
            force = sign * strength * float(self._vehicles.mass[slot, 0])
            # CARLA's y points to the right.
            x, y = -force * math.sin(heading), -force * math.cos(heading)
            actor.add_force(self._stage.carla.Vector3D(x, y, 0.0))


UNKNOWN = frozenset({"percepts", "wheel_angle"})
"""What the Traffic Manager does not report: its beliefs and the angle of the front wheels."""


def far_sight(scenario: Scenario) -> float:
    """How far ahead the ego looks [m]."""
    clouds = float(scenario.weather.cloudiness[0]) > CLOUDS_PERCENT
    return POOR_SIGHT if clouds or bool(scenario.weather.low_sun[0]) else SIGHT


def push_accel(scenario: Scenario) -> float:
    """Sideways acceleration of a push on the server [m/s^2]: the larger of rain and wind."""
    worst = max(float(scenario.weather.rain[0]), float(scenario.weather.wind[0]))
    return PUSH * worst / 100.0
