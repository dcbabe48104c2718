"""The types of the values in a specification, and what each of them refuses."""

from __future__ import annotations

from typing import Annotated, Any, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from overtaking.knowledge import COLOUR_ORDER, VEHICLE_CLASS_ORDER, presets
from overtaking.knowledge.roads import ROAD_NAMES
from overtaking.model.road import MAX_COORDINATE, MAX_LANES, MAX_LENGTH
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.complaints import complaint, known_name
from overtaking.scenarios.populations import population_names

STEP_MS = 10
"""Frames lie on the steps of the simulation."""

MAX_HORIZON_S = 600.0
MAX_SPEED_KMH = 250.0
MIN_GAP_M = 3.0
MIN_VEHICLES = 2  # The ego and the one that it might overtake.


def ordered(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    """Refuse a range that runs downwards."""
    if pair[0] > pair[1]:
        raise complaint("a range from low to high", f"write [{pair[1]:g}, {pair[0]:g}]")
    return pair


def shares(value: Any) -> Any:
    """A name or a list of names stands for equal weights."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple):
        return names
    for name in cast("list[Any]", names):
        if not isinstance(name, str):
            raise complaint("names, or names with weights", "quote the names")
    return dict.fromkeys(cast("list[str]", names), 1.0)


def drawable(weights: dict[str, float]) -> dict[str, float]:
    """Refuse weights that are all zero."""
    if not sum(weights.values()) > 0.0:
        raise complaint("a weight above zero", "give at least one of them a weight")
    return weights


def ego_type(weights: dict[str, float]) -> dict[str, float]:
    """Refuse a two-wheeler as the ego."""
    two_wheelers = sorted({"MC", "B"} & {name for name, weight in weights.items() if weight > 0.0})
    if two_wheelers:
        raise complaint("vehicles with four wheels", f"leave {' and '.join(two_wheelers)} out")
    return weights


def different(lanes: tuple[int, ...]) -> tuple[int, ...]:
    """Refuse a lane that is named twice."""
    if len(set(lanes)) < len(lanes):
        raise complaint("each lane once", "leave out the repeated one")
    return lanes


def multiple(interval_ms: int) -> int:
    """Refuse frames between two steps."""
    if interval_ms % STEP_MS:
        nearest = max(STEP_MS, round(interval_ms / STEP_MS) * STEP_MS)
        raise complaint(f"a multiple of {STEP_MS}", f"use {nearest}")
    return interval_ms


Percent = Annotated[float, Field(ge=0.0, le=100.0)]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Position = Annotated[float, Field(ge=0.0, le=MAX_LENGTH)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Duration = Annotated[float, Field(ge=0.01, le=MAX_HORIZON_S)]
Factor = Annotated[float, Field(ge=0.01, le=100.0)]
Density = Annotated[float, Field(ge=0.1, le=250.0)]
SpeedKmh = Annotated[float, Field(gt=0.0, le=MAX_SPEED_KMH)]
Count = Annotated[int, Field(ge=MIN_VEHICLES, le=MAX_VEHICLES)]
LaneNumber = Annotated[int, Field(ge=0, lt=MAX_LANES)]
WorldRange = Annotated[tuple[Coordinate, Coordinate], AfterValidator(ordered)]
RoadRange = Annotated[tuple[Position, Position], AfterValidator(ordered)]
SpeedRange = Annotated[tuple[SpeedKmh, SpeedKmh], AfterValidator(ordered)]
PercentRange = Annotated[tuple[Percent, Percent], AfterValidator(ordered)]
AltitudeDeg = Annotated[float, Field(ge=-90.0, le=90.0)]
Weight = Annotated[float, Field(ge=0.0, le=1e6)]
TypeName = Annotated[str, AfterValidator(known_name("vehicle type", lambda: VEHICLE_CLASS_ORDER))]
ColourName = Annotated[str, AfterValidator(known_name("colour", lambda: COLOUR_ORDER))]
PresetName = Annotated[str, AfterValidator(known_name("weather preset", lambda: tuple(presets())))]
RoadName = Annotated[str, AfterValidator(known_name("road", lambda: ROAD_NAMES))]
PopulationName = Annotated[str, AfterValidator(known_name("population", population_names))]
Types = Annotated[dict[TypeName, Weight], BeforeValidator(shares), AfterValidator(drawable)]
Colours = Annotated[dict[ColourName, Weight], BeforeValidator(shares), AfterValidator(drawable)]
Presets = Annotated[dict[PresetName, Weight], BeforeValidator(shares), AfterValidator(drawable)]


class Section(BaseModel):
    """What all sections share: nothing unknown, nothing converted, nothing infinite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
