"""The blueprints that clients may spawn: CARLA's vehicles, and the sensors that are offered."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cache

from overtaking.knowledge import colours
from overtaking.knowledge.blueprints import Blueprint, blueprints

COLLISION = "sensor.other.collision"
LANE_INVASION = "sensor.other.lane_invasion"
CAMERA = "sensor.camera.rgb"
SPECTATOR = "spectator"

WALKER, WALKER_CONTROLLER = "walker.pedestrian.0001", "controller.ai.walker"
"""Scripts look for these before they ask for no walker at all; they are listed, never spawned."""

SEMANTIC_TAGS = {"car": 14, "truck": 15, "bus": 16, "van": 14, "motorcycle": 18, "bicycle": 19}
"""CARLA's `CityObjectLabel` of each base type."""

MAX_PIXELS = 1920 * 1080
MIN_FOV_DEG, MAX_FOV_DEG = 5.0, 170.0


class AttributeType(IntEnum):
    """`carla.ActorAttributeType`."""

    BOOL = 1
    INT = 2
    FLOAT = 3
    STRING = 4
    COLOUR = 5


@dataclass(frozen=True, slots=True)
class Choice:
    """An attribute of a blueprint.

    Attributes:
        name: Its name.
        kind: Its type.
        options: Values that are recommended, the default first.
        may_change: Whether a client may choose another.
    """

    name: str
    kind: AttributeType
    options: tuple[str, ...]
    may_change: bool = True

    def layout(self) -> list[object]:
        """The attribute as a client wants it."""
        options = list(self.options) if self.may_change else []
        return [self.name, int(self.kind), self.options[0], options, self.may_change, False]


_ROLES = ("autopilot", "scenario", "ego_vehicle", "hero")


@cache
def definitions() -> list[list[object]]:
    """All blueprints as the answer to `get_actor_definitions`."""
    rows: list[list[object]] = []
    for uid, (name, choices) in enumerate(catalogue().items(), 1):
        tags = name.replace(".", ",")
        rows.append([uid, name, tags, [choice.layout() for choice in choices]])
    return rows


@cache
def catalogue() -> dict[str, tuple[Choice, ...]]:
    """The attributes of every blueprint, by its id."""
    front = Choice("role_name", AttributeType.STRING, ("front",))
    found = {name: _vehicle(one) for name, one in blueprints().items()}
    return found | {
        WALKER: (
            Choice("role_name", AttributeType.STRING, ("pedestrian",)),
            Choice("generation", AttributeType.INT, ("2",), may_change=False),
        ),
        WALKER_CONTROLLER: (Choice("role_name", AttributeType.STRING, ("default",)),),
        COLLISION: (front,),
        LANE_INVASION: (front,),
        CAMERA: (
            front,
            Choice("image_size_x", AttributeType.INT, ("800",)),
            Choice("image_size_y", AttributeType.INT, ("600",)),
            Choice("fov", AttributeType.FLOAT, ("90.0",)),
            Choice("sensor_tick", AttributeType.FLOAT, ("0.0",)),
        ),
    }


def _vehicle(one: Blueprint) -> tuple[Choice, ...]:
    paints = tuple(",".join(str(part) for part in paint.rgb) for paint in colours().values())
    wheels = "2" if one.base_type in ("bicycle", "motorcycle") else "4"
    lights = "false" if one.base_type == "bicycle" else "true"
    return (
        Choice("role_name", AttributeType.STRING, _ROLES),
        Choice("color", AttributeType.COLOUR, paints),
        Choice("sticky_control", AttributeType.BOOL, ("true",)),
        Choice("object_type", AttributeType.STRING, ("",), may_change=False),
        Choice("base_type", AttributeType.STRING, (one.base_type,), may_change=False),
        Choice("special_type", AttributeType.STRING, ("",), may_change=False),
        Choice("number_of_wheels", AttributeType.INT, (wheels,), may_change=False),
        Choice("generation", AttributeType.INT, ("2",), may_change=False),
        Choice("has_lights", AttributeType.BOOL, (lights,), may_change=False),
    )
