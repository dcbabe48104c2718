"""The state of the server: one episode with its map, weather, actors and time."""

import math
import re
from collections.abc import Iterator, Sequence
from time import monotonic, sleep

from overtaking.core.units import kmh_from_mps
from overtaking.knowledge.carla_catalogue import carla_vehicles, props, weather_presets
from overtaking.simulators.carla_server import catalogue, snapshot
from overtaking.simulators.carla_server.ackermann import Seen
from overtaking.simulators.carla_server.actors import (
    ORIGIN,
    UPRIGHT,
    Actor,
    Camera,
    FrictionTrigger,
    Prop,
    Vehicle,
    bounding_box,
    world_pose,
)
from overtaking.simulators.carla_server.arguments import Description, Settings, Transform, Vector
from overtaking.simulators.carla_server.bodies import Nature, body_of
from overtaking.simulators.carla_server.fleet import Fleet
from overtaking.simulators.carla_server.maps import Atlas
from overtaking.simulators.carla_server.motion import (
    ContactImpulse,
    Obstacle,
    PlanarMotion,
    boxes_overlap,
)
from overtaking.simulators.carla_server.pictures import PictureThread, Shot
from overtaking.simulators.carla_server.protocol import Refused
from overtaking.simulators.carla_server.snapshot import SensorType
from overtaking.simulators.carla_server.streams import Streams

FREE_RUNNING_DELTA = 0.05
"""Length of a tick without a fixed one [s]."""

SCENARIO_NAME = re.compile(r"overtaking\.scenario (\d{1,20}) (\d{1,20}) (-?\d\.\d{1,12})")
"""Role name of an actor with what CARLA's weather has no field for."""

MAX_ACTORS = 500
_FIRST_ID = 20


class World:
    """One server's state.

    Args:
        atlas: The maps; the first one is loaded.
        streams: Where sensors send to.
        seed: Seed of gusts and puddles.
    """

    def __init__(self, atlas: Atlas, streams: Streams, seed: int) -> None:
        """Begin the first episode."""
        self.atlas, self.map, self._seed = atlas, atlas.first, seed
        self.streams = streams
        self.pictures = PictureThread(streams.send)
        self.world_stream = streams.open()
        self.settings = Settings()
        self.episode = 0
        self.frame = 0
        self._begin()

    @property
    def delta(self) -> float:
        """Length of the next tick [s]."""
        return self.settings.fixed_delta or FREE_RUNNING_DELTA

    @property
    def vehicles(self) -> Iterator[Vehicle]:
        """All vehicles."""
        return (actor for actor in self.actors.values() if isinstance(actor, Vehicle))

    def load(self, name: str, *, reset_settings: bool) -> None:
        """Begin a new episode.

        Args:
            name: Of the map, with or without folders; empty for the loaded one.
            reset_settings: Whether clients find the settings of a new server.

        Raises:
            ConfigError: There is no such map.
        """
        short = name.rsplit("/", 1)[-1]
        if short and short != self.map.name:
            self.map = self.atlas.find(short)
        for actor in list(self.actors.values()):
            if actor.stream is not None:
                self.streams.close(actor.stream)
        if reset_settings:
            self.settings = Settings()
        self._begin()

    def _begin(self) -> None:
        """Empty the world; gusts begin anew, so that an episode can be repeated."""
        self.episode += 1
        self.time = 0.0
        self.weather: Sequence[float] = tuple(
            weather_presets()["ClearNoon"].carla_fields().values()
        )
        self.fleet = Fleet(self.map.ground, self.weather, Nature(self._seed))
        self.actors: dict[int, Actor] = {}
        self._next_id = _FIRST_ID
        above = Transform(Vector(0.0, 0.0, 50.0), UPRIGHT)
        self.spectator = self._enter(
            Actor(
                actor_id=self._take_id(),
                description=Description(0, catalogue.SPECTATOR, ()),
                pose=above,
            )
        )

    def _take_id(self) -> int:
        self._next_id += 1
        return self._next_id

    def _enter(self, actor: Actor) -> Actor:
        self.actors[actor.actor_id] = actor
        return actor

    # --- actors ---

    def actor(self, actor_id: int) -> Actor:
        """An actor by id; `Refused` if there is none."""
        if actor_id not in self.actors:
            raise Refused(f"there is no actor {actor_id}")
        return self.actors[actor_id]

    def vehicle(self, actor_id: int) -> Vehicle:
        """A vehicle by id; `Refused` if there is none."""
        actor = self.actor(actor_id)
        if not isinstance(actor, Vehicle):
            raise Refused(f"actor {actor_id} is no vehicle")
        return actor

    def spawn(self, wanted: Description, pose: Transform, parent: int = 0) -> Actor:
        """Put a new actor into the world.

        Raises:
            Refused: There is no such blueprint or parent, no room, or no more actors are taken.
        """
        self._check_spawn(wanted, parent)
        for attribute in wanted.attributes:
            self._take_nature(attribute.value if attribute.name == "role_name" else "")
        if wanted.blueprint in carla_vehicles():
            actor: Actor = self._new_vehicle(wanted, pose)
        elif wanted.blueprint in props():
            actor = self._new_prop(wanted, pose, parent)
        elif wanted.blueprint == catalogue.FRICTION_TRIGGER:
            actor = FrictionTrigger(
                actor_id=self._take_id(), description=wanted, pose=pose, parent=parent
            )
        else:
            actor = self._new_sensor(wanted, pose, parent)
        return self._enter(actor)

    def _check_spawn(self, description: Description, parent: int) -> None:
        """Check a request to spawn an actor, apart from its pose.

        Raises:
            Refused: There is no such blueprint or parent, or no more actors are taken.
        """
        if description.blueprint not in catalogue.catalogue():
            raise Refused(f"this headless server has no blueprint {description.blueprint}")
        if description.blueprint in (catalogue.WALKER, catalogue.WALKER_CONTROLLER):
            raise Refused("this headless server has no walkers")
        if len(self.actors) >= MAX_ACTORS:
            raise Refused(f"this headless server takes at most {MAX_ACTORS} actors")
        if parent:
            self.actor(parent)

    def _new_vehicle(self, wanted: Description, pose: Transform) -> Vehicle:
        body, motion = body_of(wanted.blueprint), self.map.motion(pose)
        if not self.fleet.is_free(body, motion, pose.location.z):
            raise Refused("Spawn failed because of collision at spawn position")
        actor_id = self._take_id()
        self.fleet.add(actor_id, body, motion)
        self.fleet[actor_id].height = pose.location.z
        tag = catalogue.SEMANTIC_TAGS[carla_vehicles()[wanted.blueprint].base_type]
        return Vehicle(actor_id=actor_id, description=wanted, pose=pose, body=body, tag=tag)

    def _new_prop(self, description: Description, pose: Transform, parent: int) -> Prop:
        size = props()[description.blueprint].size
        prop = Prop(
            actor_id=self._take_id(), description=description, pose=pose, parent=parent, size=size
        )
        if not parent:
            # A vehicle in the same place is no reason to refuse: ScenarioRunner first spawns all
            # props of a scenario at one place, and moves them when it needs them.
            self.fleet.set_obstacle(prop.actor_id, self._obstacle(prop))
        return prop

    def _obstacle(self, prop: Prop) -> Obstacle:
        """The box with which vehicles collide, for a prop without a parent."""
        length, width, height = prop.size
        low = prop.pose.location.z
        motion = self.map.motion(prop.pose)
        return Obstacle(length, width, low, low + height, motion, prop.mass)

    def _new_sensor(self, wanted: Description, pose: Transform, parent: int) -> Actor:
        kind = Camera if wanted.blueprint == catalogue.CAMERA else Actor
        sensor = kind(actor_id=self._take_id(), description=wanted, pose=pose, parent=parent)
        sensor.stream = self.streams.open()
        return sensor

    def destroy(self, actor_id: int) -> bool:
        """Take an actor away with all that is attached to it; whether it was there."""
        actor = self.actors.get(actor_id)
        if actor is None or actor is self.spectator:
            return False
        for child in [one for one in self.actors.values() if one.parent == actor_id]:
            self.destroy(child.actor_id)
        del self.actors[actor_id]
        if actor.stream is not None:
            self.streams.close(actor.stream)
        self.fleet.remove_obstacle(actor_id)
        if actor_id in self.fleet:
            self.fleet.remove(actor_id)
        return True

    def place_actor(self, actor_id: int, pose: Transform) -> None:
        """Put an actor elsewhere."""
        actor = self.actor(actor_id)
        actor.pose = pose
        if actor_id in self.fleet:
            self.fleet.place(actor_id, self.map.motion(pose))
            self.fleet[actor_id].height = pose.location.z
        if isinstance(actor, Prop) and not actor.parent:
            self.fleet.set_obstacle(actor_id, self._obstacle(actor))

    def set_prop_physics(self, prop: Prop, *, has_physics: bool) -> None:
        """Choose whether a prop moves when a vehicle hits it; a moving prop stops."""
        prop.has_physics = has_physics
        if not prop.parent:
            self.fleet.set_obstacle(prop.actor_id, self._obstacle(prop))

    def friction_of(self, vehicle: Vehicle) -> float | None:
        """The smallest friction of all triggers that a vehicle touches; None if it touches none."""
        return min(
            (
                actor.friction
                for actor in self.actors.values()
                if isinstance(actor, FrictionTrigger) and self._touches(vehicle, actor)
            ),
            default=None,
        )

    def _touches(self, vehicle: Vehicle, trigger: FrictionTrigger) -> bool:
        """Whether any part of a vehicle is in the box of a trigger."""
        pose = world_pose(trigger, self.actors)
        bottom = vehicle.pose.location.z
        if (
            not -trigger.extent.z - vehicle.body["height"]
            <= bottom - pose.location.z
            <= trigger.extent.z
        ):
            return False
        sides = {"length": 2.0 * trigger.extent.x, "width": 2.0 * trigger.extent.y}
        return boxes_overlap(vehicle.body, _in_plane(vehicle.pose), sides, _in_plane(pose))

    def set_velocity(self, actor_id: int, velocity: Vector) -> None:
        """Give a vehicle a velocity [m/s]."""
        vehicle = self.vehicle(actor_id)
        self.fleet.set_velocity(actor_id, *self.map.to_ground(velocity))
        vehicle.velocity = velocity

    def set_weather(self, values: Sequence[float]) -> None:
        """Change the weather."""
        self.weather = values
        self.fleet.set_weather(values)

    def _take_nature(self, name: str) -> None:
        """Take what CARLA's weather leaves open from the role name of an actor.

        `overtaking.scenario SEED NUMBER WIND_DIRECTION` sets the seed of gusts and puddles, and the
        direction of the wind, anticlockwise from the direction of travel [rad]. A real server takes
        it for a role name like any other.
        """
        match = SCENARIO_NAME.fullmatch(name)
        if match is None:
            return
        seed, number, direction = int(match[1]), int(match[2]), float(match[3])
        if seed < 2**64 and number < 2**64 and abs(direction) <= math.tau:
            self.fleet.set_weather_defaults(Nature(seed, number, direction))

    def layout(self, actor: Actor) -> list[object]:
        """An actor as clients want it."""
        tags = bytes((actor.tag,)) if isinstance(actor, Vehicle | Prop) else b""
        stream = b"" if actor.stream is None else self.streams.token(actor.stream)
        box = bounding_box(actor)
        return [actor.actor_id, actor.parent, actor.description, box, tags, stream]

    # --- time ---

    def tick(self, *, pace: float = 0.0) -> None:
        """Simulate one tick and send its data to all listeners.

        Args:
            pace: Shortest time from now until the data are sent [s].
        """
        begin, delta = monotonic(), self.delta
        self.frame += 1
        self.time += delta
        self._steer_by_controllers(delta)
        controls = {one.actor_id: one.control for one in self.vehicles}
        touches = self.fleet.advance(delta, controls, self._friction_factors())
        self._follow_fleet(delta)
        # Two milliseconds at most, which an event loop cannot wait for as exactly.
        sleep(max(begin + pace - monotonic(), 0.0))
        self._tell_contacts(touches)
        self._tell_world(delta)
        self._take_pictures()

    def _friction_factors(self) -> dict[int, float]:
        """Factors on the friction under the vehicles in triggers, by vehicle.

        The factor is the friction of the trigger, at most 1: a usual road is 3.5 in CARLA and 1 as
        OpenSCENARIO's `frictionScaleFactor`, and both must change nothing.
        """
        if not any(isinstance(actor, FrictionTrigger) for actor in self.actors.values()):
            return {}
        frictions = {vehicle.actor_id: self.friction_of(vehicle) for vehicle in self.vehicles}
        return {
            vehicle: min(friction, 1.0)
            for vehicle, friction in frictions.items()
            if friction is not None
        }

    def _steer_by_controllers(self, delta: float) -> None:
        """Let Ackermann controllers set pedals and steering."""
        for one in self.vehicles:
            if one.ackermann is not None:
                lock = self.fleet[one.actor_id].steering.lock
                seen = Seen(one.forward_speed, one.control.steer, lock)
                one.control = one.ackermann.control(seen, one.gains, delta)

    def _follow_fleet(self, delta: float) -> None:
        """Bring the poses of all vehicles and props up to date."""
        for actor_id, motion in self.fleet.moved_obstacles().items():
            prop, height = self.actors[actor_id], self.actors[actor_id].pose.location.z
            pose = self.map.pose(motion, height)
            prop.pose = pose._replace(location=pose.location._replace(z=height))
        for actor_id, motion in self.fleet.motions().items():
            vehicle = self.vehicle(actor_id)
            if not self.fleet[actor_id].has_physics:
                vehicle.acceleration = ORIGIN
                continue
            new = self.map.to_world(motion.v_s, motion.v_d)
            old = vehicle.velocity
            vehicle.acceleration = Vector(*((b - a) / delta for a, b in zip(old, new, strict=True)))
            vehicle.velocity = new
            vehicle.turning = -math.degrees(motion.yaw_rate)
            vehicle.pose = self.map.pose(motion, vehicle.pose.location.z)
            self.fleet[actor_id].height = vehicle.pose.location.z

    def _tell_contacts(self, touches: Sequence[ContactImpulse]) -> None:
        """One event a tick for each pair, with the sum of its impulses."""
        totals: dict[tuple[int, int], Vector] = {}
        for touch in touches:
            pair = (touch.own, touch.other)
            gain = self.map.to_world(touch.impulse_s, touch.impulse_d)
            old = totals.get(pair, ORIGIN)
            totals[pair] = Vector(*(a + b for a, b in zip(old, gain, strict=True)))
        for (own, other), impulse in totals.items():
            for sensor in list(self.actors.values()):
                if sensor.blueprint == catalogue.COLLISION and sensor.parent == own:
                    pair = (self.layout(self.actors[own]), self.layout(self.actors[other]))
                    body = snapshot.collision(*pair, impulse)
                    self._send(sensor, SensorType.COLLISION, body)

    def _tell_world(self, delta: float) -> None:
        poses = ((one, world_pose(one, self.actors)) for one in self.actors.values())
        states = (
            snapshot.state(one, pose, kmh_from_mps(self.map.limit(pose))) for one, pose in poses
        )
        body = snapshot.world(self.episode, self.time, delta, states)
        at = Transform(ORIGIN, UPRIGHT)
        head = snapshot.header(SensorType.WORLD, self.frame, self.time, at)
        self.streams.send(self.world_stream, head + body)

    def _send(self, sensor: Actor, kind: SensorType, body: bytes) -> None:
        pose = world_pose(sensor, self.actors)
        head = snapshot.header(kind, self.frame, self.time, pose)
        if sensor.stream is not None:
            self.streams.send(sensor.stream, head + body)

    def _take_pictures(self) -> None:
        """Draw for every camera that is due, has a listener and has no unfinished picture."""
        if self.settings.no_rendering:
            return
        shots: list[Shot] = []
        for camera in self.actors.values():
            if not isinstance(camera, Camera) or camera.stream is None:
                continue
            if self.time < camera.due - 1e-6 or not self.streams.is_heard(camera.stream):
                continue
            if self.pictures.is_drawing(camera.stream):
                continue  # In asynchronous mode a slow camera skips pictures.
            camera.due = self.time + camera.interval
            pose = world_pose(camera, self.actors)
            header = snapshot.header(SensorType.CAMERA, self.frame, self.time, pose)
            size = (camera.width, camera.height)
            shots.append(Shot(camera.stream, header, pose, size, camera.fov_deg))
        if shots:
            bodies = [actor for actor in self.actors.values() if isinstance(actor, Vehicle | Prop)]
            self.pictures.draw(shots, self.map, bodies, self.weather)


def _in_plane(pose: Transform) -> PlanarMotion:
    """A pose on the plane of the map, at rest; y points to the left, unlike CARLA's."""
    x, y, _ = pose.location
    return PlanarMotion(x, -y, -math.radians(pose.rotation.yaw), 0.0, 0.0, 0.0)
