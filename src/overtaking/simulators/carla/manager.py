"""The study's way: CARLA's Traffic Managers at a third of the speed.

The study drove with two Traffic Managers, one for the ego and one for the others, and let the ego
change lanes with `force_lane_change`. That fails above 36 km/h, so everything drove at one third of
the speed, and the recording was converted: speeds by 3, accelerations by 9, time by a third. Here
every third tick is kept, so that positions, speeds and time agree again: dx / dt is the speed.

This file chooses what the study does not state: when the ego starts, and how strongly rain and
wind push.
"""

import math
import sys
from typing import Any

import numpy as np

from overtaking.core.random_numbers import Stream, philox_words, uniform_from_word
from overtaking.core.units import kmh_from_mps
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.state import State
from overtaking.simulators.carla.own import Sign, check_interval, note_contacts, take_over
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

_EVER = sys.maxsize
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
        self._given = step_parameters(scenario)
        self._p = self._given.vehicles
        self._state = State.at_start(self._given)
        self._recorder = Recorder(scenario, self._given)
        self._watch = Watch(settled=float(self._given.constants.settled_offset))
        self._end = int(self._given.simulation_table[0, 0])
        self._idle = int(self._given.simulation_table[1, 0])
        for slot, actor in stage.actors.items():
            manager = managers[min(slot, 1)]
            speed = scenario.drivers.desired_speed if slot == EGO_SLOT else scenario.start_speed
            actor.set_autopilot(True, manager.get_port())
            manager.auto_lane_change(actor, False)
            manager.set_desired_speed(actor, kmh_from_mps(float(speed[0, slot])) / SLOWER)
            manager.update_vehicle_lights(actor, True)

    def run(self, sign: Sign) -> Trajectories:
        """Push, tick, look; every third tick is a frame's."""
        ticks = step = 0
        while step <= self._end:
            reading = self._stage.tick()
            take_over(self._state, reading, self._stage.scenario, faster=SLOWER)
            step = ticks // SLOWER * SUBSTEPS
            self._notice(reading.frame, step)
            if ticks % SLOWER == 0 and step % self._given.steps_per_frame == 0:
                self._record(step)
            self._follow_stage(step)
            self._push(ticks)
            if float(self._state.motion.s[EGO_SLOT, 0]) > self._stage.end - _OUTLOOK:
                self._end = min(self._end, step)
            sign()
            ticks += 1
            step = ticks // SLOWER * SUBSTEPS
        return self._recorder.finish(self._state).replace(unknown=UNKNOWN)

    def _notice(self, frame: int, step: int) -> None:
        """Write down contacts; the ego's ends the simulation soon."""
        contacts, state = self._stage.contacts(frame), self._state
        state.end_step[:] = np.float32(self._end)
        note_contacts(state, self._given, contacts, step, faster=SLOWER)
        self._end = int(state.end_step[0])
        if state.motion.is_wreck[EGO_SLOT, 0] > 0:
            self._watch.crash()

    def _record(self, step: int) -> None:
        state = self._state
        state.overtake.stage[EGO_SLOT] = np.float32(self._watch.stage)
        active = np.float32(step) <= np.array([self._end], np.float32)
        self._recorder.record_frame(state, self._given, active, step // self._given.steps_per_frame)

    def _follow_stage(self, step: int) -> None:
        """See what the ego is doing, and ask for the next lane change where it is time."""
        if self._watch.stage is Stage.CRASHED:
            return
        before, sight = self._watch.stage, self._sight()
        stage = self._watch.look(sight)
        c = self._given.constants
        if stage is Stage.DONE and before is not Stage.DONE:
            self._end = min(self._end, step + round(float(c.after_overtake / c.step)))
        if stage is Stage.FOLLOW and not self._watch.attempted and step >= self._idle:
            self._end = min(self._end, step)
        ego, right_hand = (
            self._stage.actors[EGO_SLOT],
            self._stage.scenario.road.overtaking_sign > 0,
        )
        has_room = sight.lane < self._given.road.num_lanes - 1
        if stage is Stage.FOLLOW and sight.leader is not None and has_room:
            self._manager.force_lane_change(ego, not right_hand)
        if stage is Stage.PASS and self._watch.target in sight.passed:
            self._manager.force_lane_change(ego, right_hand)
        self._show(stage)

    def _show(self, stage: Stage) -> None:
        """The indicator of the ego, for the recording; lamps are the Traffic Manager's."""
        towards = {Stage.PULL_OUT: 1.0, Stage.RETURN: -1.0, Stage.ABORT: -1.0}
        self._state.controls.indicator[EGO_SLOT, 0] = towards.get(stage, 0.0)

    def _sight(self) -> Sight:
        """The state of the traffic from which the stage follows, at the speeds of the recording."""
        state, p, road = self._state, self._p, self._given.road
        valid = [slot for slot in self._stage.actors if slot != EGO_SLOT]
        s, d = state.motion.s[:, 0].tolist(), state.motion.d[:, 0].tolist()
        half = p.half_length[:, 0].tolist()
        lane = self._lane(d[EGO_SLOT])
        centre = 0.5 * float(road.boundaries[lane] + road.boundaries[lane + 1])
        front, rear = s[EGO_SLOT] + half[EGO_SLOT], s[EGO_SLOT] - half[EGO_SLOT]
        reach = front + far_sight(self._stage.scenario)
        ahead = [
            (s[k] - half[k], k)
            for k in valid
            if s[k] > s[EGO_SLOT] and s[k] - half[k] < reach and self._lane(d[k]) == lane
        ]
        psi, vx, vy = (
            float(x[EGO_SLOT, 0]) for x in (state.motion.heading, state.motion.vx, state.motion.vy)
        )
        return Sight(
            lane=lane,
            offset=d[EGO_SLOT] - centre,
            drift=vx * math.sin(psi) + vy * math.cos(psi),
            leader=min(ahead)[1] if ahead else None,
            passed=frozenset(k for k in valid if s[k] + half[k] < rear - CLEAR),
        )

    def _lane(self, d: float) -> int:
        borders = self._given.road.boundaries[1 : self._given.road.num_lanes]
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
            force = sign * strength * float(self._p.mass[slot, 0])
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
