"""The actors of an episode: vehicles, props, triggers, sensors and the spectator."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from overtaking.simulators.carla_server.ackermann import Ackermann
from overtaking.simulators.carla_server.arguments import (
    Control,
    Description,
    Gains,
    Rotation,
    Target,
    Transform,
    Vector,
)
from overtaking.simulators.carla_server.bodies import Body
from overtaking.simulators.carla_server.catalogue import (
    DYNAMIC_TAG,
    MAX_FOV_DEG,
    MAX_PIXELS,
    MIN_FOV_DEG,
)
from overtaking.simulators.carla_server.motion import rotate
from overtaking.simulators.carla_server.protocol import Refused

ORIGIN = Vector(0.0, 0.0, 0.0)
UPRIGHT = Rotation(0.0, 0.0, 0.0)


@dataclass(slots=True, kw_only=True)
class Actor:
    """Something with a pose.

    Attributes:
        actor_id: Its number in the episode.
        description: The blueprint and attributes that the client sent.
        pose: Its pose, relative to the parent if it has one.
        parent: Actor that it is attached to, 0 for none.
        stream: Where its data go, None if it has none.
    """

    actor_id: int
    description: Description
    pose: Transform
    parent: int = 0
    stream: int | None = None

    @property
    def blueprint(self) -> str:
        """Id of its blueprint."""
        return self.description.blueprint

    def attribute(self, name: str, default: str) -> str:
        """The value chosen for an attribute."""
        return next((a.value for a in self.description.attributes if a.name == name), default)

    def number_attribute(self, name: str, default: str) -> float:
        """The value chosen for an attribute, as a number.

        Raises:
            Refused: The value is not a finite number.
        """
        text = self.attribute(name, default)
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise Refused(f"{self.blueprint}: expected a number for {name}, got {text[:40]!r}")
        return number


@dataclass(slots=True, kw_only=True)
class Vehicle(Actor):
    """An actor that drives; its pose is kept up to date from the fleet.

    Attributes:
        body: Its numbers, as our model names them.
        tag: CARLA's semantic tag.
        control: Pedals and steering.
        lights: `carla.VehicleLightState`.
        velocity: In CARLA's frame [m/s].
        acceleration: Over the last tick, contacts included [m/s^2].
        turning: Yaw rate, clockwise seen from above [degrees/s].
        ackermann: The controller that sets pedals and steering, None where the client does.
        gains: Of that controller, kept while it is off.
    """

    body: Body
    tag: int
    control: Control = field(default_factory=Control)
    lights: int = 0
    velocity: Vector = ORIGIN
    acceleration: Vector = ORIGIN
    turning: float = 0.0
    ackermann: Ackermann | None = None
    gains: Gains = field(default_factory=Gains)

    @property
    def forward_speed(self) -> float:
        """Speed along its axis, negative backwards [m/s]."""
        yaw = math.radians(self.pose.rotation.yaw)
        return rotate(self.velocity.x, self.velocity.y, -yaw)[0]

    def drive(self, control: Control) -> None:
        """Set pedals and steering, until the client or its controller sets others."""
        self.control, self.ackermann = control, None

    def make_for(self, target: Target) -> None:
        """Let the Ackermann controller make for a speed and a wheel angle."""
        if self.ackermann is None:
            self.ackermann = Ackermann(target)
        self.ackermann.target = target

    @property
    def extent(self) -> Vector:
        """Half sizes of its bounding box [m]."""
        return Vector(*(0.5 * self.body[name] for name in ("length", "width", "height")))


_PROP_DENSITY = 30.0
"""Mass of a prop over the volume of its bounding box [kg/m^3]. CARLA states no masses; with this
value a refuse container of 3.4 m^3 has 100 kg and a street barrier 14 kg."""


@dataclass(slots=True, kw_only=True)
class Prop(Actor):
    """An object that is no vehicle, such as a traffic cone or a container.

    Attributes:
        size: Length, width and height [m].
        tag: CARLA's semantic tag.
        has_physics: Whether it moves when a vehicle hits it.
    """

    size: tuple[float, float, float]
    tag: int = DYNAMIC_TAG
    has_physics: bool = False

    @property
    def mass(self) -> float:
        """Mass [kg]; infinite for a prop without physics, which no impact moves."""
        return _PROP_DENSITY * math.prod(self.size) if self.has_physics else math.inf

    @property
    def extent(self) -> Vector:
        """Half sizes of its bounding box [m]."""
        return Vector(*(0.5 * side for side in self.size))


_CM_PER_M = 100.0


@dataclass(slots=True, kw_only=True)
class FrictionTrigger(Actor):
    """A box that changes the friction under vehicles.

    Attributes:
        friction: Friction of CARLA's tyres in the box; 3.5 is the usual value.
        extent: Half sizes of the box, whose centre is the location of the pose [m].

    Raises:
        Refused: An attribute is no number, the friction is negative or a size is not positive.
    """

    friction: float = 0.0
    extent: Vector = ORIGIN

    def __post_init__(self) -> None:
        """Read the attributes; CARLA's extents are in centimetres."""
        self.friction = self.number_attribute("friction", "3.5")
        self.extent = Vector(
            *(self.number_attribute(f"extent_{axis}", "1.0") / _CM_PER_M for axis in "xyz")
        )
        if self.friction < 0.0 or min(self.extent) <= 0.0:
            raise Refused(f"{self.blueprint}: expected friction >= 0 and extents > 0")


@dataclass(slots=True, kw_only=True)
class Camera(Actor):
    """A camera; `Refused` if its attributes ask for pictures that cannot be.

    Attributes:
        width, height: Size of its pictures [pixels].
        fov_deg: Horizontal field of view [degrees].
        interval: Least time between two pictures [s].
        due: Time of the next one [s].
    """

    width: int = 0
    height: int = 0
    fov_deg: float = 0.0
    interval: float = 0.0
    due: float = 0.0

    def __post_init__(self) -> None:
        """Read the attributes."""
        self.width = int(self.number_attribute("image_size_x", "800"))
        self.height = int(self.number_attribute("image_size_y", "600"))
        self.fov_deg = self.number_attribute("fov", "90")
        self.interval = self.number_attribute("sensor_tick", "0")
        if min(self.width, self.height) <= 0 or self.width * self.height > MAX_PIXELS:
            raise Refused(f"the picture has no pixels, or more than {MAX_PIXELS}")
        if not MIN_FOV_DEG <= self.fov_deg <= MAX_FOV_DEG or self.interval < 0.0:
            raise Refused("the field of view or the interval of the camera is out of range")


def attached(parent: Transform, relative: Transform) -> Transform:
    """The pose of an attached actor; pitch and roll are added, as both are small."""
    ahead, aside, up = relative.location
    x, y = rotate(ahead, aside, math.radians(parent.rotation.yaw))
    base = parent.location
    rotation = Rotation(*(a + b for a, b in zip(parent.rotation, relative.rotation, strict=True)))
    return Transform(Vector(base.x + x, base.y + y, base.z + up), rotation)


def world_pose(actor: Actor, actors: Mapping[int, Actor]) -> Transform:
    """Where an actor is in the world."""
    parent = actors.get(actor.parent)
    return attached(world_pose(parent, actors), actor.pose) if parent else actor.pose


EMPTY_BOX: list[object] = [ORIGIN, ORIGIN, UPRIGHT, 0]
"""The box that CARLA gives for an actor that is gone."""


def bounding_box(actor: Actor) -> list[object]:
    """The box of an actor as clients want it: centre, half sizes, rotation, id."""
    if isinstance(actor, FrictionTrigger):
        return [ORIGIN, actor.extent, UPRIGHT, actor.actor_id]
    extent = actor.extent if isinstance(actor, Vehicle | Prop) else ORIGIN
    return [Vector(0.0, 0.0, extent.z), extent, UPRIGHT, actor.actor_id]
