"""Value types of a specification, and messages about wrong ones."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.knowledge.vehicle_classes import COLOUR_NAMES, VEHICLE_CLASS_NAMES
from overtaking.model.known_roads import ROAD_NAMES
from overtaking.model.road import MAX_COORDINATE, MAX_LANES, MAX_LENGTH
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.driver_sampling import population_names
from overtaking.world.constants import STEP_MS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

Keys: TypeAlias = "Callable[[tuple[str, ...], str | None], tuple[str, ...]]"
_OURS = "specification"


def specification_error(
    expected: str, next_step: str, *, key: str | None = None, got: object = None
) -> PydanticCustomError:
    """An error of one of our own checks.

    Args:
        expected: The kind of value that is right.
        next_step: The reader's next step, as an imperative.
        key: Key inside the section, where the check is about a whole section.
        got: The wrong value, if it is not the checked one.
    """
    context = {"expected": expected, "next_step": next_step, "key": key, "got": got}
    return PydanticCustomError(_OURS, "{expected}", context)


def name_check(kind: str, names: Callable[[], tuple[str, ...]]) -> Callable[[str], str]:
    """A check that a text is one of `names()`."""

    def check(name: str) -> str:
        if name in names():
            return name
        raise specification_error(f"a known {kind}", suggestion(name, names()), got=name)

    return check


def config_error(error: ValidationError, where: str, keys: Keys) -> ConfigError:
    """Make a `ConfigError` from one finding of a validation: an unknown key, else the first one.

    A misspelt key leads to two findings, an unknown and a missing key. The unknown one names the
    mistake.

    Args:
        error: The error that Pydantic raised.
        where: The file or profile that was read.
        keys: Gives the known keys of a section, named by its path, and the weather's mode.
    """
    findings = error.errors(include_url=False)
    unknown = (finding for finding in findings if finding["type"] == "extra_forbidden")
    first = next(unknown, findings[0])
    path, mode = _path(first)
    expected, got, next_step = _explain(first, path, lambda: keys(tuple(path[:-1]), mode))
    key = first.get("ctx", {}).get("key")
    name = ".".join([*path, key] if key else path)
    return ConfigError(what=name, where=where, expected=expected, got=got, next_step=next_step)


def _path(finding: ErrorDetails) -> tuple[list[str], str | None]:
    """The key path of a finding, and the mode of the weather or traffic if it lies there.

    Pydantic names the mode after the section, and marks the keys of a mapping.
    """
    path = [str(part) for part in finding["loc"] if part != "[key]"]
    if path[:1] in (["weather"], ["traffic"]) and len(path) > 1:
        return path[:1] + path[2:], path[1]
    return path, None


_MODE = 'mode = "presets" or mode = "independent"'

_TYPES = {
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "a text in quotes",
    "bool_type": "true or false",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "tuple_type": "a list",
    "finite_number": "a finite number",
    "union_tag_not_found": _MODE,
    "union_tag_invalid": _MODE,
}


def _explain(
    finding: ErrorDetails, path: list[str], keys: Callable[[], tuple[str, ...]]
) -> tuple[str, object, str]:
    """Expected, got and next step of one finding."""
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == _OURS:
        got = _format_value(finding["input"]) if context["got"] is None else context["got"]
        return context["expected"], got, context["next_step"]
    if kind == "extra_forbidden":
        return "a known key", repr(path[-1]), suggestion(path[-1], keys())
    if kind == "union_tag_not_found":
        similar = difflib.get_close_matches("mode", map(str, finding["input"]), n=1)
        if similar:
            return f"the key mode, {_MODE}", f"the key {similar[0]}", "did you mean mode?"
    if kind == "missing":
        return "a value", "nothing", "add the key"
    if kind in ("too_short", "too_long"):
        number = context["min_length" if kind == "too_short" else "max_length"]
        return f"{number} values", _format_value(finding["input"]), "correct the list"
    expected = _TYPES.get(kind) or finding["msg"].removeprefix("Input should be ")
    return expected, _format_value(finding["input"]), "correct the value"


def suggestion(name: str, choices: Iterable[str]) -> str:
    """The next step after an unknown name: the most similar name, or all names."""
    by_lower = {candidate.lower(): candidate for candidate in choices}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1)
    if close:
        return f"did you mean {by_lower[close[0]]}?"
    return f"choose from {', '.join(by_lower.values())}"


def _format_value(value: object) -> str:
    return repr(list(cast("tuple[object, ...]", value)) if isinstance(value, tuple) else value)


MAX_HORIZON_S = 600.0
MAX_SPEED_KMH = 250.0
MIN_GAP_M = 3.0
MIN_VEHICLES = 2  # The ego and the one that it might overtake.


def check_ascending(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    """Refuse a range that runs downwards."""
    if pair[0] > pair[1]:
        raise specification_error("a range from low to high", f"write [{pair[1]:g}, {pair[0]:g}]")
    return pair


def equal_weights(value: Any) -> Any:
    """A name or a list of names stands for equal weights."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple):
        return names
    for name in cast("list[Any]", names):
        if not isinstance(name, str):
            raise specification_error("names, or names with weights", "quote the names")
    return dict.fromkeys(cast("list[str]", names), 1.0)


def check_some_weight(weights: dict[str, float]) -> dict[str, float]:
    """Refuse weights that are all zero."""
    if not sum(weights.values()) > 0.0:
        raise specification_error("a weight above zero", "give at least one of them a weight")
    return weights


def check_four_wheels(weights: dict[str, float]) -> dict[str, float]:
    """Refuse a two-wheeler as the ego."""
    two_wheelers = sorted({"MC", "B"} & {name for name, weight in weights.items() if weight > 0.0})
    if two_wheelers:
        raise specification_error(
            "vehicles with four wheels", f"leave {' and '.join(two_wheelers)} out"
        )
    return weights


def check_distinct(lanes: tuple[int, ...]) -> tuple[int, ...]:
    """Refuse a lane that is named twice."""
    if len(set(lanes)) < len(lanes):
        raise specification_error("each lane once", "leave out the repeated one")
    return lanes


def check_on_clock(interval_ms: int) -> int:
    """Refuse frames between two steps."""
    if interval_ms % STEP_MS:
        nearest = max(STEP_MS, round(interval_ms / STEP_MS) * STEP_MS)
        raise specification_error(f"a multiple of {STEP_MS}", f"use {nearest}")
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
WorldRange = Annotated[tuple[Coordinate, Coordinate], AfterValidator(check_ascending)]
RoadRange = Annotated[tuple[Position, Position], AfterValidator(check_ascending)]
SpeedRange = Annotated[tuple[SpeedKmh, SpeedKmh], AfterValidator(check_ascending)]
PercentRange = Annotated[tuple[Percent, Percent], AfterValidator(check_ascending)]
AltitudeDeg = Annotated[float, Field(ge=-90.0, le=90.0)]
Weight = Annotated[float, Field(ge=0.0, le=1e6)]
TypeName = Annotated[str, AfterValidator(name_check("vehicle type", lambda: VEHICLE_CLASS_NAMES))]
ColourName = Annotated[str, AfterValidator(name_check("colour", lambda: COLOUR_NAMES))]

PresetName = Annotated[
    str, AfterValidator(name_check("weather preset", lambda: tuple(weather_presets())))
]
RoadName = Annotated[str, AfterValidator(name_check("road", lambda: ROAD_NAMES))]
PopulationName = Annotated[str, AfterValidator(name_check("population", population_names))]

Types = Annotated[
    dict[TypeName, Weight], BeforeValidator(equal_weights), AfterValidator(check_some_weight)
]

Colours = Annotated[
    dict[ColourName, Weight], BeforeValidator(equal_weights), AfterValidator(check_some_weight)
]

Presets = Annotated[
    dict[PresetName, Weight], BeforeValidator(equal_weights), AfterValidator(check_some_weight)
]


class Section(BaseModel):
    """A section: unknown keys, values of another type and infinite numbers are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
