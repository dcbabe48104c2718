"""Types of the values of a specification, and error messages for wrong values.

`specification` and `traffic_specification` declare the sections of a specification, a TOML file, as
Pydantic models. Their fields have the types at the end of this module, such as `SpeedRange`. A type
is a Python type with limits and with *checks*: functions that return the value, or raise
`specification_error`. `config_error` converts an error of Pydantic to the one-line error that users
see.

Two sections have several models, and their key `mode` names the model. `[weather]` always has this
key; `[traffic]` lacks it for placed traffic (a few vehicles in a short zone).
"""

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

KnownKeys: TypeAlias = "Callable[[tuple[str, ...], str | None], tuple[str, ...]]"
"""Function that returns the keys of a section, such as `specification.known_keys`.

Its arguments are the path of the section and its mode; a section without modes has the mode None.
"""

_ERROR_TYPE = "specification"
"""Type of the errors of our own checks, beside the types of Pydantic."""


def specification_error(
    expected: str, next_step: str, *, key: str | None = None, got: object = None
) -> PydanticCustomError:
    """The error that a check raises; `config_error` makes the user's message of it.

    Args:
        expected: Description of a valid value.
        next_step: The reader's next step, as an imperative.
        key: The wrong key inside the section, if the check is about a whole section; None if it is
            about a single value.
        got: The wrong value; None for the value that was checked.
    """
    context = {"expected": expected, "next_step": next_step, "key": key, "got": got}
    return PydanticCustomError(_ERROR_TYPE, "{expected}", context)


def name_check(kind: str, names: Callable[[], tuple[str, ...]]) -> Callable[[str], str]:
    """A check that a text is a known name.

    Args:
        kind: Kind of the name for the message, such as "road".
        names: Function that returns the known names. It is called at each check: files with
            names are read together with the first specification, not at import.
    """

    def check_name(name: str) -> str:
        if name in names():
            return name
        raise specification_error(f"a known {kind}", suggestion(name, names()), got=name)

    return check_name


def config_error(error: ValidationError, where: str, known_keys: KnownKeys) -> ConfigError:
    """The error for users, about one of Pydantic's findings.

    A misspelt key leads to two findings, an unknown and a missing key. The unknown key shows the
    mistake, so it is preferred; otherwise the error describes the first finding.

    Args:
        error: The error that Pydantic raised.
        where: File that was read, or name of the profile, which is a specification of the package.
        known_keys: Returns the keys of a section, from which the error suggests the most similar.
    """
    findings = error.errors(include_url=False)
    unknown_keys = (finding for finding in findings if finding["type"] == "extra_forbidden")
    finding = next(unknown_keys, findings[0])
    path, mode = _path_and_mode(finding)
    expected, got, next_step = _explain(finding, path, lambda: known_keys(tuple(path[:-1]), mode))
    key = finding.get("ctx", {}).get("key")
    name = ".".join([*path, key] if key else path)
    return ConfigError(what=name, where=where, expected=expected, got=got, next_step=next_step)


def _path_and_mode(finding: ErrorDetails) -> tuple[list[str], str | None]:
    """The parts of the dotted key that a finding is about, and the mode of its section.

    Only `[weather]` and `[traffic]` have a mode, "placed" for traffic without one; other sections
    get None. Pydantic puts the mode after the section, as in `("traffic", "flow", "lanes", 0)`. For
    the key of a table Pydantic adds "[key]", which is no part of a dotted key.
    """
    path = [str(part) for part in finding["loc"] if part != "[key]"]
    if path[:1] in (["weather"], ["traffic"]) and len(path) > 1:
        return path[:1] + path[2:], path[1]
    return path, None


# Modes of `[weather]`, the only section with errors about its mode (`union_tag` below): `[traffic]`
# with a wrong mode is read as placed traffic, in which `mode` is an unknown key.
_MODE = 'mode = "presets" or mode = "independent"'

# Descriptions of a valid value, by Pydantic's type of error.
_EXPECTED_BY_TYPE = {
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
    """Expected value, wrong value and next step of one finding.

    Args:
        finding: One of Pydantic's findings.
        path: Parts of the dotted key that it is about.
        keys: Returns the keys that the section of the path may have.
    """
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == _ERROR_TYPE:
        got = _format_value(finding["input"]) if context["got"] is None else context["got"]
        return context["expected"], got, context["next_step"]
    if kind == "extra_forbidden":
        return "a known key", repr(path[-1]), suggestion(path[-1], keys())
    if kind == "union_tag_not_found":
        # The input is the table of the section: perhaps one of its keys is a misspelt `mode`.
        # Without such a key, `_EXPECTED_BY_TYPE` describes the error below.
        similar = difflib.get_close_matches("mode", map(str, finding["input"]), n=1)
        if similar:
            return f"the key mode, {_MODE}", f"the key {similar[0]}", "did you mean mode?"
    if kind == "missing":
        return "a value", "nothing", "add the key"
    if kind in ("too_short", "too_long"):
        number = context["min_length" if kind == "too_short" else "max_length"]
        return f"{number} values", _format_value(finding["input"]), "correct the list"
    expected = _EXPECTED_BY_TYPE.get(kind) or finding["msg"].removeprefix("Input should be ")
    return expected, _format_value(finding["input"]), "correct the value"


def suggestion(name: str, choices: Iterable[str]) -> str:
    """The next step after an unknown name: the most similar name, or a choice of all names.

    Args:
        name: The unknown name; capitals make no difference.
        choices: The known names.
    """
    by_lower = {candidate.lower(): candidate for candidate in choices}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1)
    if close:
        return f"did you mean {by_lower[close[0]]}?"
    return f"choose from {', '.join(by_lower.values())}"


def _format_value(value: object) -> str:
    """A value as a user writes it: a list in brackets, though the models hold it as a tuple."""
    return repr(list(cast("tuple[object, ...]", value)) if isinstance(value, tuple) else value)


# Limits of values. They are choices.
MAX_HORIZON_S = 600.0
"""Longest duration of a simulation [s]."""

MAX_SPEED_KMH = 250.0
"""Largest speed that a specification may state [km/h]."""

MIN_GAP_M = 3.0
"""Smallest value of `starts.min_gap_m`, the smallest gap between two vehicles of a lane at the
start [m]. It exceeds the 2 m that must remain after a driver brakes for the vehicle ahead
(`safe_start.CLEARANCE`), so a vehicle at this gap is safe at its leader's speed."""

TWO_WHEELERS = ("MC", "B")
"""Vehicle types that the ego never has: motorcycle and bicycle. The ego has four wheels, as in the
study of Pinto, Dutra and Fonseca (2023): a choice."""

MIN_VEHICLES = 2
"""Fewest vehicles: the ego, whose overtaking is studied, and a vehicle to overtake."""


def check_ascending(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    """Refuse a range whose first value is above its second.

    Like all checks below, it returns a valid value unchanged.
    """
    if pair[0] > pair[1]:
        raise specification_error("a range from low to high", f"write [{pair[1]:g}, {pair[0]:g}]")
    return pair


def equal_weights(value: Any) -> Any:
    """Replace a name, or a list of names, by a table with the weight 1 for each name.

    Other values, such as a table of weights, stay; Pydantic checks them.
    """
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
    """Refuse motorcycles and bicycles as vehicle types of the ego."""
    two_wheelers = sorted(name for name in TWO_WHEELERS if weights.get(name, 0.0) > 0.0)
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
    """Refuse an interval of recorded frames that is not a multiple of the simulation's time step.

    Both are in milliseconds.
    """
    if interval_ms % STEP_MS:
        nearest = max(STEP_MS, round(interval_ms / STEP_MS) * STEP_MS)
        raise specification_error(f"a multiple of {STEP_MS}", f"use {nearest}")
    return interval_ms


# Numbers, each with its limits. Limits without a name are choices.
Percent = Annotated[float, Field(ge=0.0, le=100.0)]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]  # World x or y [m].
Position = Annotated[float, Field(ge=0.0, le=MAX_LENGTH)]  # Distance along a road [m].
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Duration = Annotated[float, Field(ge=0.01, le=MAX_HORIZON_S)]  # At least a time step, 10 ms [s].
Factor = Annotated[float, Field(ge=0.01, le=100.0)]
Density = Annotated[float, Field(ge=0.1, le=250.0)]  # Vehicles per kilometre and lane.
SpeedKmh = Annotated[float, Field(gt=0.0, le=MAX_SPEED_KMH)]
Count = Annotated[int, Field(ge=MIN_VEHICLES, le=MAX_VEHICLES)]  # Vehicles, the ego included.
LaneNumber = Annotated[int, Field(ge=0, lt=MAX_LANES)]  # 0 is the slowest lane.

# Ranges from a smallest to a largest value.
WorldRange = Annotated[tuple[Coordinate, Coordinate], AfterValidator(check_ascending)]
RoadRange = Annotated[tuple[Position, Position], AfterValidator(check_ascending)]
SpeedRange = Annotated[tuple[SpeedKmh, SpeedKmh], AfterValidator(check_ascending)]
PercentRange = Annotated[tuple[Percent, Percent], AfterValidator(check_ascending)]

AltitudeDeg = Annotated[float, Field(ge=-90.0, le=90.0)]  # Height of the sun [degrees].
Weight = Annotated[float, Field(ge=0.0, le=1e6)]  # Relative frequency.

# Names that the files of `knowledge/data` define. Users know a vehicle class as a vehicle type.
TypeName = Annotated[str, AfterValidator(name_check("vehicle type", lambda: VEHICLE_CLASS_NAMES))]
ColourName = Annotated[str, AfterValidator(name_check("colour", lambda: COLOUR_NAMES))]

PresetName = Annotated[
    str, AfterValidator(name_check("weather preset", lambda: tuple(weather_presets())))
]
RoadName = Annotated[str, AfterValidator(name_check("road", lambda: ROAD_NAMES))]
PopulationName = Annotated[str, AfterValidator(name_check("population", population_names))]

# Weights by name. A file may write one name, or a list of names with equal weights.
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
    """Base of the models of all sections, which are frozen.

    Unknown keys, values of another type, infinite numbers and NaN are errors. Ranges are tuples;
    `profiles.load_specification` makes them of the lists of a file before it calls the models.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
