"""One scenario on a CARLA server: the world is set up, ticked and read."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.road import Lane, Road, RoadMark
from overtaking.model.scenario import Scenario
from overtaking.sim.external_motion import VehicleContact
from overtaking.simulators.carla.world import (
    TICK,
    Lamps,
    SimulationLostError,
    blueprint_of,
    fresh_world,
    leave,
    nature,
    set_weather,
)

SPAWN_HEIGHTS = (0.3, 0.6, 1.2)
"""Heights at which a spawn is tried, one after the other [m]."""

# A waypoint farther than this from a lane of ours lies on another road [m].
_MAX_LANE_DISTANCE = 0.5
_PROBE_SPACING = 10.0  # Distance between the points at which the road is looked up on the map [m].


@dataclass(frozen=True, slots=True)
class MotionReading:
    """All vehicles after a tick, on the road, lateral axis to the left; arrays of shape (slot,).

    Attributes:
        tick: Number of the tick.
        s, d: Centre of the bounding box [m].
        heading: Heading against the road, anticlockwise [rad].
        vx, vy: Velocity in the axes of the vehicle [m/s].
        yaw_rate: Yaw rate, anticlockwise [rad/s].
        accel_lon, accel_lat: Acceleration in the axes of the vehicle [m/s^2].
    """

    tick: int
    s: F64
    d: F64
    heading: F64
    vx: F64
    vy: F64
    yaw_rate: F64
    accel_lon: F64
    accel_lat: F64


@dataclass(slots=True)
class CarlaScene:
    """A world with the vehicles of one scenario in it.

    Attributes:
        carla: The module.
        client: A connected client.
        scenario: A batch of one, with road and bodies as CARLA reports them.
        world: The world.
        actors: Vehicles by slot.
        road_end: Station at which the straight road ends [m].
    """

    carla: Any
    client: Any
    scenario: Scenario
    world: Any
    actors: dict[int, Any]
    road_end: float
    _sensors: list[Any] = field(default_factory=list)
    _events: list[VehicleContact] = field(default_factory=list)
    _offsets: dict[int, tuple[float, float]] = field(default_factory=dict)
    _lamps: Lamps = field(init=False)

    def __post_init__(self) -> None:
        """Know no lamp yet."""
        self._lamps = Lamps(self.carla, self.actors)

    @classmethod
    def set_up(
        cls, carla: Any, client: Any, scenario: Scenario, *, time_scale: float = 1.0
    ) -> "CarlaScene":
        """A fresh world with map, weather and vehicles, which have their speeds.

        Args:
            carla: The module.
            client: A connected client.
            scenario: A batch of one.
            time_scale: Factor by which all speeds are divided.

        Raises:
            ConfigError: The server has no map with this road.
            SimulationLostError: A vehicle could not be put where it starts.
        """
        world = fresh_world(client, scenario.road)
        set_weather(carla, world, scenario)
        road, end = _road_there(carla, world.get_map(), scenario.road)
        stage = cls(carla, client, scenario.replace(road=road), world, {}, end)
        speeds = scenario.start_speed[0] / time_scale
        for slot in np.flatnonzero(scenario.vehicles.valid[0]).tolist():
            stage._spawn(slot, float(speeds[slot]))
        stage._read_bounding_boxes()
        stage._attach_collision_sensors()
        world.tick()
        for slot, actor in stage.actors.items():
            actor.set_target_velocity(stage.velocity(slot, float(speeds[slot])))
        return stage

    @property
    def _name(self) -> str:
        return f"simulation {int(self.scenario.scenario_index[0])}"

    def is_oncoming(self, slot: int) -> bool:
        """Whether a vehicle starts in the lane of oncoming traffic."""
        return int(self.scenario.start_lane[0, slot]) == self.scenario.road.num_lanes

    def heading(self, slot: int) -> float:
        """Direction in which a vehicle starts, anticlockwise [rad]."""
        start = float(self.scenario.start_s[0, slot])
        turn = math.pi if self.is_oncoming(slot) else 0.0
        return float(self.scenario.road.heading_at(start)) + turn

    def velocity(self, slot: int, speed: float) -> Any:
        """A velocity of a vehicle the way that it starts [m/s]."""
        heading = self.heading(slot)
        return self.carla.Vector3D(speed * math.cos(heading), -speed * math.sin(heading), 0.0)

    def tick(self) -> MotionReading:
        """Simulate one tick and read all vehicles."""
        self.world.tick()
        return self._read(self.world.get_snapshot())

    def contacts(self, before_tick: int) -> list[VehicleContact]:
        """The events of the collision sensors before a tick, in order; each is returned once.

        Sensors report from threads of their own, so the events of the last tick may be incomplete.
        """
        earlier = sorted(
            (contact for contact in self._events if contact.tick < before_tick),
            key=lambda contact: (contact.tick, contact.slot, contact.other_slot),
        )
        self._events[:] = [contact for contact in self._events if contact.tick >= before_tick]
        return earlier

    def set_lights(self, slot: int, lights: int) -> None:
        """Switch the lamps of a vehicle to our `Lights` bits."""
        self._lamps.switch(slot, lights)

    def tear_down(self) -> None:
        """Remove all actors and let the server run freely, as before."""
        leave(self.world, self._sensors, list(self.actors.values()))

    def _spawn(self, slot: int, speed: float) -> None:
        """Put a vehicle one tick before where it starts."""
        scenario, carla = self.scenario, self.carla
        blueprint = blueprint_of(self.world, scenario, slot)
        blueprint.set_attribute("role_name", "hero" if slot == 0 else "scenario")
        road, lane = scenario.road, int(scenario.start_lane[0, slot])
        before = -speed * TICK if self.is_oncoming(slot) else speed * TICK
        s = float(scenario.start_s[0, slot]) - before
        x, y = (float(value) for value in road.to_world(s, _all_centres(road)[lane]))
        ground = float(road.height_at(s))
        turned = carla.Rotation(yaw=-math.degrees(self.heading(slot)))
        for height in SPAWN_HEIGHTS:
            place = carla.Transform(carla.Location(x, -y, ground + height), turned)
            actor = self.world.try_spawn_actor(blueprint, place)
            if actor is not None:
                self.actors[slot] = actor
                return
        what, room = f"vehicle {slot} ({blueprint.id})", f"room at x = {x:.1f} m, y = {-y:.1f} m"
        raise SimulationLostError.because(self._name, what, room, "a refusal of the server")

    def _read_bounding_boxes(self) -> None:
        """Take length, width and height from the bounding boxes."""
        sizes = {
            name: getattr(self.scenario.vehicles, name).copy()
            for name in ("length", "width", "height")
        }
        for slot, actor in self.actors.items():
            box = actor.bounding_box
            self._offsets[slot] = (box.location.x, -box.location.y)
            for name, half in zip(sizes, (box.extent.x, box.extent.y, box.extent.z), strict=True):
                sizes[name][0, slot] = 2.0 * half
        self.scenario = self.scenario.replace(vehicles=self.scenario.vehicles.replace(**sizes))

    def _attach_collision_sensors(self) -> None:
        """Attach a collision sensor to every vehicle."""
        blueprint = self.world.get_blueprint_library().find("sensor.other.collision")
        blueprint.set_attribute("role_name", nature(self.scenario))
        slots = {actor.id: slot for slot, actor in self.actors.items()}
        heading = self.scenario.road.heading
        cosine, sine = math.cos(heading), math.sin(heading)

        def note(event: Any) -> None:
            x, y = event.normal_impulse.x, -event.normal_impulse.y
            push = (x * cosine + y * sine, y * cosine - x * sine)
            own, other = slots[event.actor.id], slots.get(event.other_actor.id, -1)
            self._events.append(VehicleContact(own, other, event.frame, push))

        for slot in self.actors:
            sensor = self.world.spawn_actor(
                blueprint, self.carla.Transform(), attach_to=self.actors[slot]
            )
            sensor.listen(note)
            self._sensors.append(sensor)

    def _read(self, snapshot: Any) -> MotionReading:
        """Every vehicle of a snapshot, in the road's frame."""
        rows = np.zeros((self.scenario.num_slots, 8))
        for slot, actor in self.actors.items():
            seen = snapshot.find(actor.id)
            if seen is None:
                what = f"vehicle {slot}"
                raise SimulationLostError.because(self._name, what, "to be in the snapshot", "gone")
            rows[slot] = self._row(seen, self._offsets.get(slot, (0.0, 0.0)))
        return MotionReading(snapshot.frame, *rows.T)

    def _row(self, seen: Any, offset: tuple[float, float]) -> list[float]:
        """One vehicle: place of its centre, heading, and motion in its own axes."""
        road, pose = self.scenario.road, seen.get_transform()
        yaw = -math.radians(pose.rotation.yaw)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        x = pose.location.x + cosine * offset[0] - sine * offset[1]
        y = -pose.location.y + sine * offset[0] + cosine * offset[1]
        s, d = (float(value) for value in road.to_road(x, y))
        row = [s, d, math.remainder(yaw - float(road.heading_at(s)), math.tau)]
        for vector in (seen.get_velocity(), seen.get_acceleration()):
            ahead, aside = vector.x, -vector.y
            row += [ahead * cosine + aside * sine, aside * cosine - ahead * sine]
        turning = -math.radians(seen.get_angular_velocity().z)
        return [*row[:5], turning, *row[5:]]


def _road_there(carla: Any, place: Any, road: Road) -> tuple[Road, float]:
    """The road with lanes as the map has them, and the station at which it ends.

    Raises:
        ConfigError: The map has no lane where ours is.
    """
    middle = 0.5 * min(road.length, 600.0)
    lanes = tuple(
        _lane_there(carla, place, road, lane, middle, float(d))
        for lane, d in zip(road.lanes, road.lane_centres, strict=True)
    )
    beyond = road.overtaking_side_neighbour
    if beyond is not None and road.is_two_way:
        d = float(_all_centres(road)[-1])
        found = _lane_there(carla, place, road, beyond, middle, d)
        # Its drivers look the other way: their left is the right of the road.
        turned = {"left_mark": found.right_mark, "right_mark": found.left_mark}
        road = dataclasses.replace(
            road, overtaking_side_neighbour=dataclasses.replace(found, **turned)
        )
    end, last = 0.0, float(road.lane_centres[0])
    while end + _PROBE_SPACING <= road.length and _waypoint(
        carla, place, road, end + _PROBE_SPACING, last
    ):
        end += _PROBE_SPACING
    return dataclasses.replace(road, lanes=lanes), end


def _all_centres(road: Road) -> list[float]:
    """`d` of the middle of each lane, that of oncoming traffic last [m]."""
    beyond, edge = road.overtaking_side_neighbour, float(road.lane_boundaries[-1])
    other = [edge + road.overtaking_sign * 0.5 * beyond.width] if beyond is not None else []
    return [*map(float, road.lane_centres), *(other if road.is_two_way else [])]


def _lane_there(carla: Any, place: Any, road: Road, lane: Lane, s: float, d: float) -> Lane:
    """Width, id and marks of a lane as waypoints tell them."""
    found = _waypoint(carla, place, road, s, d)
    if found is None:
        raise ConfigError(
            what=f"lane {lane.lane_id} of road {road.name}",
            where=f"map {place.name}",
            expected=f"a lane at s = {s:.0f} m, d = {d:.2f} m",
            got="none",
            next_step="load the map that the scenario is meant for",
        )
    left, right = (
        RoadMark(str(mark.type)) for mark in (found.left_lane_marking, found.right_lane_marking)
    )
    return dataclasses.replace(
        lane,
        lane_id=found.lane_id,
        width=round(float(found.lane_width), 3),
        left_mark=left,
        right_mark=right,
    )


def _waypoint(carla: Any, place: Any, road: Road, s: float, d: float) -> Any:
    """The waypoint at a point of our road, None if the map has no lane there."""
    x, y = (float(value) for value in road.to_world(s, d))
    point = carla.Location(x, -y, float(road.height_at(s)))
    found = place.get_waypoint(point, project_to_road=True)
    if found is None:
        return None
    there = found.transform.location
    return found if math.hypot(there.x - x, there.y + y) < _MAX_LANE_DISTANCE else None
