"""Numbers about vehicles, roads, weather, drivers and law, each with unit and source."""

from __future__ import annotations

from overtaking.knowledge.friction import FrictionTable, friction_table
from overtaking.knowledge.presets import Preset, presets
from overtaking.knowledge.quantity import Distribution, Quantity, Source
from overtaking.knowledge.reader import number, quantities, read_section, sources
from overtaking.knowledge.terms import Term, terms
from overtaking.knowledge.vehicles import (
    COLOUR_ORDER,
    VEHICLE_CLASS_ORDER,
    Colour,
    VehicleClass,
    colours,
    vehicle_classes,
)

__all__ = [
    "COLOUR_ORDER",
    "VEHICLE_CLASS_ORDER",
    "Colour",
    "Distribution",
    "FrictionTable",
    "Preset",
    "Quantity",
    "Source",
    "Term",
    "VehicleClass",
    "colours",
    "friction_table",
    "number",
    "presets",
    "quantities",
    "read_section",
    "sources",
    "terms",
    "vehicle_classes",
]
