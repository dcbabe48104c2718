"""CARLA's vehicles and props: names, bounding boxes, and the physics of the vehicles."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from overtaking.knowledge.reader import read_sections


@dataclass(frozen=True, slots=True, kw_only=True)
class Blueprint:
    """One vehicle of CARLA's catalogue.

    Attributes:
        blueprint: Its id, such as "vehicle.audi.a2".
        base_type: CARLA's own word for what it is: car, truck, van, bus, motorcycle or bicycle.
        vehicle_class: Class of `vehicle_classes` whose physics it gets.
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    base_type: str
    vehicle_class: str
    size: tuple[float, float, float]


@cache
def blueprints() -> Mapping[str, Blueprint]:
    """The vehicles by id, in alphabetical order."""
    found = read_sections(Blueprint, "blueprints.toml").values()
    return MappingProxyType({one.blueprint: one for one in found})


@dataclass(frozen=True, slots=True, kw_only=True)
class PropBlueprint:
    """One prop of CARLA's catalogue, such as a traffic cone.

    Attributes:
        blueprint: Its id, such as "static.prop.trafficcone01".
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    size: tuple[float, float, float]


@cache
def props() -> Mapping[str, PropBlueprint]:
    """The props by id, in alphabetical order."""
    sections = read_sections(PropBlueprint, "props.toml").values()
    return MappingProxyType({prop.blueprint: prop for prop in sections})
