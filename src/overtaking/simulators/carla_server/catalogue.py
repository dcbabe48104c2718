"""The blueprints that clients may spawn: CARLA's vehicles and props, triggers, and sensors."""

from functools import cache

from overtaking.knowledge.carla_catalogue import CarlaVehicle, carla_vehicles, props
from overtaking.knowledge.vehicle_classes import colours

COLLISION = "sensor.other.collision"
LANE_INVASION = "sensor.other.lane_invasion"
CAMERA = "sensor.camera.rgb"
SPECTATOR = "spectator"
FRICTION_TRIGGER = "static.trigger.friction"

WALKER, WALKER_CONTROLLER = "walker.pedestrian.0001", "controller.ai.walker"
"""Scripts look for these before they ask for no walker at all; they are listed, never spawned."""

SEMANTIC_TAGS = {"car": 14, "truck": 15, "bus": 16, "van": 14, "motorcycle": 18, "bicycle": 19}
"""CARLA's `CityObjectLabel` of each base type."""

DYNAMIC_TAG = 21
"""CARLA's `CityObjectLabel.Dynamic`, for objects whose place changes over time."""

MAX_PIXELS = 1920 * 1080
MIN_FOV_DEG, MAX_FOV_DEG = 5.0, 170.0


_BOOL, _INT, _FLOAT, _TEXT, _COLOUR = range(1, 6)  # `carla.ActorAttributeType`.
_ROLES = ("autopilot", "scenario", "ego_vehicle", "hero")


@cache
def definitions() -> list[list[object]]:
    """All blueprints as the answer to `get_actor_definitions`."""
    every = enumerate(catalogue().items(), 1)
    return [[uid, name, name.replace(".", ","), attributes] for uid, (name, attributes) in every]


@cache
def catalogue() -> dict[str, list[list[object]]]:
    """The attributes of every blueprint as clients want them, by its id."""
    front = _attribute("role_name", _TEXT, "front")
    vehicles = {name: _of_a_vehicle(blueprint) for name, blueprint in carla_vehicles().items()}
    prop = [_attribute("role_name", _TEXT, "prop")]
    return (
        vehicles
        | dict.fromkeys(props(), prop)
        | {
            WALKER: [
                _attribute("role_name", _TEXT, "pedestrian"),
                _attribute("generation", _INT, "2", may_change=False),
            ],
            WALKER_CONTROLLER: [_attribute("role_name", _TEXT, "default")],
            FRICTION_TRIGGER: [
                _attribute("role_name", _TEXT, "trigger"),
                _attribute("friction", _FLOAT, "3.5"),
                *(_attribute(name, _FLOAT, "1.0") for name in ("extent_x", "extent_y", "extent_z")),
            ],
            COLLISION: [front],
            LANE_INVASION: [front],
            CAMERA: [
                front,
                _attribute("image_size_x", _INT, "800"),
                _attribute("image_size_y", _INT, "600"),
                _attribute("fov", _FLOAT, "90.0"),
                _attribute("sensor_tick", _FLOAT, "0.0"),
            ],
        }
    )


def _attribute(name: str, kind: int, *options: str, may_change: bool = True) -> list[object]:
    """An attribute of a blueprint.

    Args:
        name: Its name.
        kind: Its type.
        *options: Values that are recommended, the default first.
        may_change: Whether a client may choose another.
    """
    return [name, kind, options[0], list(options) if may_change else [], may_change, False]


def _of_a_vehicle(one: CarlaVehicle) -> list[list[object]]:
    paints = (",".join(str(part) for part in paint.rgb) for paint in colours().values())
    fixed = {
        "object_type": (_TEXT, ""),
        "base_type": (_TEXT, one.base_type),
        "special_type": (_TEXT, ""),
        "number_of_wheels": (_INT, "2" if one.base_type in ("bicycle", "motorcycle") else "4"),
        "generation": (_INT, "2"),
        "has_lights": (_BOOL, "false" if one.base_type == "bicycle" else "true"),
    }
    return [
        _attribute("role_name", _TEXT, *_ROLES),
        _attribute("color", _COLOUR, *paints),
        _attribute("sticky_control", _BOOL, "true"),
        *(_attribute(name, *value, may_change=False) for name, value in fixed.items()),
    ]
