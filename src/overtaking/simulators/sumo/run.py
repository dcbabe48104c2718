"""Scenarios on Eclipse SUMO: `simulate`, with SUMO's own drivers in our vehicles on our road.

SUMO runs inside this process (libsumo), anew for each simulation, so that what a simulation gives
depends on nothing but its scenario: not on the batch, nor on what ran before.
"""

import bisect
import math
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.core.random_numbers import Stream, philox_words
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import NO_VEHICLE, Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.simulators.sumo.library import library, library_version, running
from overtaking.simulators.sumo.network import lateral_borders, length_before, length_for, network
from overtaking.simulators.sumo.recording import RAW, UNKNOWN, Recording, Run
from overtaking.simulators.sumo.stage import Sight, Watch
from overtaking.simulators.sumo.traffic import (
    Traffic,
    following_factor,
    oncoming,
    routes,
    speed_factor,
)
from overtaking.world.constants import model_constants
from overtaking.world.road_parameters import (
    RoadParameters,
    allowed_speed,
    check_one_direction,
    has_two_directions,
    road_parameters,
)

__all__ = ["CHUNK_SIZE", "SHARD_SIZE", "UNKNOWN", "simulate", "step_ms", "version"]

CHUNK_SIZE = 32
"""Simulations to ask for at a time, so that a second or so passes between two signs of life."""

SHARD_SIZE = 256
"""Largest number of simulations lost by an interruption: about ten seconds of work."""

LARGEST_STEP_MS = 50
"""The EIDM is made for steps of 0.05 to 0.5 s; our own drivers decide as often [ms]."""

LATERAL_RESOLUTION = 0.5
"""Width of the strips in which SL2015 looks for room: less than a bicycle [m]."""

_ADAPTER = "1"
"""Changes whenever this package asks SUMO for something else."""


def version() -> str:
    """What identifies the results: how SUMO is asked, and which SUMO answers."""
    return f"{_ADAPTER}+libsumo{library_version()}"


def simulate(scenario: Scenario) -> Trajectories:
    """Simulate a batch on SUMO.

    Args:
        scenario: A batch of scenarios.

    Returns:
        The recorded simulations; `unknown` names what SUMO lacks.

    Raises:
        MissingExtraError: libsumo is not installed.
        ConfigError: libsumo is in use by others in this process, or refuses the scenario; or others
            come the other way on a road that is not one equally wide lane for each direction.
    """
    if not has_two_directions(scenario.road):
        check_one_direction(scenario, "SUMO")
    library()  # A missing package is reported before any work.
    interval = scenario.frame_interval_ms
    ends = np.floor(scenario.horizon.astype(np.float64) * 1000.0 / interval + 1e-6)
    frames = int(ends.max()) + 1 if scenario.num_simulations else 0
    recording, traffic = Recording(scenario, frames), Traffic.of(scenario)
    with tempfile.TemporaryDirectory(prefix="overtaking-sumo-") as folder:
        for row in range(scenario.num_simulations):
            recording.put(row, _run(traffic, row, int(ends[row]), Path(folder)))
    return recording.finish()


def step_ms(frame_interval_ms: int) -> int:
    """SUMO's step for frames that far apart: the longest that divides it, at most 50 ms [ms]."""
    candidates = range(min(frame_interval_ms, LARGEST_STEP_MS), 0, -1)
    return next(step for step in candidates if frame_interval_ms % step == 0)


def _run(traffic: Traffic, row: int, last_frame: int, folder: Path) -> Run:
    """One simulation from its first frame to its last."""
    scenario = traffic.scenario
    valid = scenario.vehicles.valid[row]
    ahead = length_for(float(scenario.start_s[row][valid].max()), float(scenario.horizon[row]))
    net, demand = folder / "road.net.xml", folder / "traffic.rou.xml"
    before = length_before(scenario.road, float(scenario.horizon[row]))
    roads = network(scenario.road, ahead, traffic.friction[row].tolist(), before)
    net.write_text(roads, encoding="utf-8")
    demand.write_text(routes(traffic, row, ahead, before), encoding="utf-8")
    with running(_options(scenario, row, net, demand)) as sumo:
        return _Simulation(traffic, row, sumo).run(last_frame)


def _options(scenario: Scenario, row: int, net: Path, demand: Path) -> list[str]:
    word = int(
        philox_words(scenario.seed, scenario.scenario_index[row : row + 1], Stream.SIMULATOR, 0)[0][
            0
        ]
    )
    given = {
        "net-file": net,
        "route-files": demand,
        "step-length": step_ms(scenario.frame_interval_ms) / 1000.0,
        "lateral-resolution": LATERAL_RESOLUTION,
        "seed": word >> 1,  # SUMO takes 31 bits.
        "collision.action": "warn",  # Reported, and no vehicle is removed.
        "collision.mingap-factor": 0,
        "time-to-teleport": -1,
        "xml-validation": "never",
        "xml-validation.net": "never",
        "no-step-log": "true",
        "no-warnings": "true",
        "duration-log.disable": "true",
    }
    return [word for name, value in given.items() for word in (f"--{name}", str(value))]


class _Simulation:
    """A simulation that SUMO has loaded.

    Args:
        traffic: The batch.
        row: Row of the simulation in it.
        sumo: The module `libsumo`.
    """

    def __init__(self, traffic: Traffic, row: int, sumo: Any) -> None:
        """Begin."""
        road, vehicles = traffic.scenario.road, traffic.scenario.vehicles
        slots = np.flatnonzero(vehicles.valid[row]).tolist()
        self.traffic, self.row, self.sumo = traffic, row, sumo
        self.names = {slot: str(slot) for slot in slots}  # SUMO's.
        self.length = {slot: float(vehicles.length[row, slot]) for slot in slots}
        # Lateral axis towards the fast side.
        self.borders = lateral_borders(road)
        self.centres = [0.5 * (low + high) for low, high in pairwise(self.borders)]
        self.comes = set(np.flatnonzero(oncoming(traffic.scenario, row)).tolist())
        has_limits = road.course is not None and road.course.speed_limit_spans
        self.limits = road_parameters(road) if has_limits else None
        self.lanes: dict[int, int] = {}
        self.watch = Watch(settled=float(model_constants().settled_offset))
        self.contacts: dict[int, tuple[int, int, float]] = {}

    @property
    def scenario(self) -> Scenario:
        """The batch."""
        return self.traffic.scenario

    def run(self, last_frame: int) -> Run:
        """Step to the end; frame 0 is SUMO's state after the step that inserts the vehicles."""
        interval = self.scenario.frame_interval_ms
        step = step_ms(interval)
        raw = np.zeros((len(RAW), self.scenario.num_slots, last_frame + 1))
        stage = np.zeros(last_frame + 1, np.uint8)
        partner = np.full(last_frame + 1, NO_VEHICLE)
        frame, end, time_ms = 0, last_frame * interval, 0
        while time_ms <= end:
            self.sumo.simulationStep()
            seen = self._read()
            self._adapt(seen)
            self._notice_contacts(time_ms)
            end = min(end, self._end(seen, time_ms))
            if time_ms % interval == 0:
                frame = time_ms // interval
                for slot, values in seen.items():
                    raw[:, slot, frame] = values
                stage[frame] = self.watch.stage
                partner[frame] = self.contacts.get(EGO_SLOT, (NO_VEHICLE,))[0]
            time_ms += step
        count = frame + 1
        return Run(
            raw=raw[:, :, :count],
            stage=stage[:count],
            collided_with=partner[:count],
            contacts=self.contacts,
        )

    def _read(self) -> dict[int, tuple[float, ...]]:
        """What `RAW` names, by slot."""
        vehicle = self.sumo.vehicle
        if vehicle.getIDCount() != len(self.names):
            raise self._lost()
        return {slot: _state(vehicle, name) for slot, name in self.names.items()}

    def _adapt(self, seen: dict[int, tuple[float, ...]]) -> None:
        """Set the desired speed of each vehicle at first, in each new lane and by limits."""
        for slot, (front, d, speed, *_) in seen.items():
            lane = self._lane(d)
            if self.limits is not None:
                factor = self._by_limits(self.limits, slot, lane, (front, speed))
            elif self.lanes.get(slot) != lane:
                factor = speed_factor(self.traffic, self.row, slot, lane)
            else:
                continue
            self.lanes[slot] = lane
            self.sumo.vehicle.setSpeedFactor(self.names[slot], factor)

    def _by_limits(
        self, road: RoadParameters, slot: int, lane: int, at: tuple[float, float]
    ) -> float:
        """Speed factor of a vehicle where the limit changes along the road.

        Args:
            road: The road.
            slot: Slot of the vehicle.
            lane: Its lane.
            at: Where its front is [m], and how fast it is [m/s].
        """
        (front, speed), comes, half = at, slot in self.comes, 0.5 * self.length[slot]
        s = float(road.length) - (front + half) if comes else front - half
        places = np.array([s, s + speed * float(model_constants().decision)], np.float32)
        allowed = allowed_speed(model_constants(), road, places, np.full(2, comes))
        traffic, row = self.traffic, self.row
        now, soon = (speed_factor(traffic, row, slot, lane, one) for one in allowed)
        return following_factor(traffic, row, slot, speed, now, soon)

    def _notice_contacts(self, time_ms: int) -> None:
        for hit in self.sumo.simulation.getCollisions():
            one, other = int(hit.collider), int(hit.victim)
            theirs = -hit.victimSpeed if self._are_opposed(one, other) else hit.victimSpeed
            closing = max(hit.colliderSpeed - theirs, 0.0)
            self.contacts.setdefault(one, (other, time_ms, closing))
            self.contacts.setdefault(other, (one, time_ms, closing))

    def _are_opposed(self, one: int, other: int) -> bool:
        """Whether two vehicles drive in opposite directions."""
        return (one in self.comes) != (other in self.comes)

    def _end(self, seen: dict[int, tuple[float, ...]], time_ms: int) -> int:
        """End of the simulation as known now [ms]."""
        before = self.watch.stage
        if before is Stage.CRASHED:
            return time_ms + _EVER
        if EGO_SLOT in self.contacts:
            self.watch.crash()
            return time_ms + _milliseconds(model_constants().after_collision)
        stage = self.watch.look(self._sight(seen))
        if stage is Stage.DONE and before is not Stage.DONE:
            return time_ms + _milliseconds(model_constants().after_overtake)
        idle = stage is Stage.FOLLOW and not self.watch.attempted
        late = time_ms >= _milliseconds(self.scenario.attempt_deadline[self.row])
        return time_ms if idle and late else time_ms + _EVER

    def _sight(self, seen: dict[int, tuple[float, ...]]) -> Sight:
        """The state of the traffic from which the stage of the ego follows."""
        front, d, _, drift, *_ = seen[EGO_SLOT]
        lane, rear = self._lane(d), front - self.length[EGO_SLOT]
        reach = front + float(model_constants().sight_range)
        ahead = [
            (other[0] - self.length[slot], slot)
            for slot, other in seen.items()
            if front < other[0] < reach and self._lane(other[1]) == lane and slot not in self.comes
        ]
        return Sight(
            lane=lane,
            offset=d - self.centres[lane],
            drift=drift,
            leader=min(ahead)[1] if ahead else None,
            passed=frozenset(
                slot for slot, other in seen.items() if other[0] < rear and slot not in self.comes
            ),
        )

    def _lane(self, d: float) -> int:
        """Lane that a point lies in; SUMO's vehicles never leave the road."""
        return min(max(bisect.bisect_right(self.borders, d) - 1, 0), len(self.centres) - 1)

    def _lost(self) -> ConfigError:
        there = set(self.sumo.vehicle.getIDList())
        return ConfigError(
            what=f"simulation {int(self.scenario.scenario_index[self.row])}",
            where=f"SUMO {library_version()}",
            expected=f"{len(self.names)} vehicles",
            got=f"{len(there)}: without {sorted(set(self.names.values()) - there)}",
            next_step="report it with the profile and the seed",
        )


_EVER = 10**9
"""Longer than any simulation [ms]."""


def _state(vehicle: Any, name: str) -> tuple[float, ...]:
    front, d = vehicle.getPosition(name)
    return (
        front,
        d,
        vehicle.getSpeed(name),
        vehicle.getLateralSpeed(name),
        vehicle.getAcceleration(name),
        vehicle.getAngle(name),
        vehicle.getSignals(name),
    )


def _milliseconds(seconds: Any) -> int:
    return math.floor(float(seconds) * 1000.0 + 0.5)
