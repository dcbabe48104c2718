"""The two limits of CARLA's Traffic Manager that the study met, measured.

Above some speed a forced lane change does not happen, and for some time after one another is
ignored. Both are faults of the client's own code, so they are the same on every server.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from overtaking.core.equality import ContentEquality
from overtaking.core.units import mps_from_kmh
from overtaking.model.known_roads import known_road
from overtaking.model.road import Road
from overtaking.simulators.carla.world import TICK, fresh_world, leave

SPEEDS_KMH = (20.0, 30.0, 34.0, 36.0, 38.0, 40.0, 42.0, 50.0)
"""Speeds at which a lane change is asked for."""

TRIALS = 4
"""Vehicles that try at each speed, each at another place between two waypoints."""

AGAIN_AT_KMH = 30.0
"""Speed at which a second lane change is asked for."""

BLUEPRINT = "vehicle.tesla.model3"
_START, _SPACING = 30.0, 41.25  # Waypoints of the Traffic Manager lie 5 m apart [m].
_LANE = 2
_SETTLING, _WATCHING = 2.0, 5.0  # Before lane changes are asked for, and after [s].
_LONGEST_WAIT = 25.0
_SIDEWAYS = 0.25  # Lateral speed from which a vehicle is changing lanes [m/s].


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits(ContentEquality):
    """Measured limits.

    Attributes:
        speeds_kmh: Speeds at which a lane change was asked for.
        changed: How many of `trials` vehicles changed lanes, by speed.
        trials: Vehicles a speed.
        again_after: Time from one lane change until another is accepted, none if it never was [s].
    """

    speeds_kmh: tuple[float, ...]
    changed: tuple[int, ...]
    trials: int
    again_after: float | None


def measure(carla: Any, client: Any, send_heartbeat: Callable[[], None], *, port: int) -> Limits:
    """Measure both limits.

    Args:
        carla: The module.
        client: A connected client.
        send_heartbeat: Called after every tick.
        port: A free port of this machine, for a Traffic Manager.
    """
    road = known_road("town06")
    world = fresh_world(client, road)
    manager = client.get_trafficmanager(port)
    manager.set_synchronous_mode(True)
    manager.set_random_device_seed(1)
    track = _Track(carla, world, manager, road, send_heartbeat)
    try:
        changed = tuple(track.changes_at(speed) for speed in SPEEDS_KMH)
        again = track.again_after(AGAIN_AT_KMH)
    finally:
        manager.shut_down()
        leave(world, [], [])
    return Limits(speeds_kmh=SPEEDS_KMH, changed=changed, trials=TRIALS, again_after=again)


@dataclass(slots=True)
class _Track:
    """The road of the study with a Traffic Manager on it."""

    carla: Any
    world: Any
    manager: Any
    road: Road
    send_heartbeat: Callable[[], None]

    def changes_at(self, speed_kmh: float) -> int:
        """The number of vehicles that change lanes on command."""
        cars = [self._car(_START + k * _SPACING, speed_kmh) for k in range(TRIALS)]
        self._pass(_SETTLING)
        for car in cars:
            self.manager.force_lane_change(car, True)
        self._pass(_WATCHING)
        border = float(self.road.lane_boundaries[_LANE])
        changed = sum(self._across(car) < border for car in cars)
        self._clear(cars)
        return changed

    def again_after(self, speed_kmh: float) -> float | None:
        """Time from one lane change until another begins that is asked for all the time [s]."""
        car = self._car(_START, speed_kmh)
        self._pass(_SETTLING)
        self.manager.force_lane_change(car, True)
        self._pass(_WATCHING)
        waited: float | None = None
        for tick in range(round((_LONGEST_WAIT - _WATCHING) / TICK)):
            self.manager.force_lane_change(car, False)
            self._pass(TICK)
            # CARLA's y points to the right: a return to the left has a negative speed.
            velocity = car.get_velocity()
            heading = self.road.heading
            leftwards = -velocity.y * math.cos(heading) - velocity.x * math.sin(heading)
            if leftwards > _SIDEWAYS:
                waited = _WATCHING + (tick + 1) * TICK
                break
        self._clear([car])
        return waited

    def _car(self, s: float, speed_kmh: float) -> Any:
        """A vehicle that drives at a speed under the Traffic Manager."""
        carla, road = self.carla, self.road
        x, y = (float(value) for value in road.to_world(s, road.lane_centres[_LANE]))
        place = carla.Transform(
            carla.Location(x, -y, 0.3), carla.Rotation(yaw=-math.degrees(road.heading))
        )
        blueprint = self.world.get_blueprint_library().find(BLUEPRINT)
        car = self.world.spawn_actor(blueprint, place)
        car.set_target_velocity(carla.Vector3D(x=mps_from_kmh(speed_kmh)))
        car.set_autopilot(True, self.manager.get_port())
        self.manager.auto_lane_change(car, False)
        self.manager.set_desired_speed(car, speed_kmh)
        self.manager.ignore_vehicles_percentage(car, 100.0)
        return car

    def _across(self, car: Any) -> float:
        """Where a vehicle is across the road [m]."""
        where = car.get_location()
        return float(self.road.to_road(where.x, -where.y)[1])

    def _pass(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.world.tick()
            self.send_heartbeat()

    def _clear(self, cars: list[Any]) -> None:
        for car in cars:
            car.set_autopilot(False, self.manager.get_port())
            car.destroy()
        self._pass(2.0 * TICK)
