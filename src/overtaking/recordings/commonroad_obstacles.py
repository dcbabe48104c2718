"""CommonRoad's dynamic obstacles: the recorded vehicles of a scene."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.recordings.xml import Element

VEHICLES = frozenset(
    {"car", "truck", "bus", "motorcycle", "bicycle", "priorityVehicle", "taxi", "unknown"}
)
"""Types of obstacles that are vehicles; pedestrians, trains and the like are left out."""

QUANTITIES = ("x", "y", "orientation", "velocity", "acceleration", "yawRate")
"""Columns of `Obstacle.states` after the time; NaN where the file does not say."""

_LIMITS = {"velocity": 150.0, "acceleration": 100.0, "yawRate": 100.0, "orientation": 1000.0}
_MAX_TIME = 1_000_000
_MAX_SIZE = 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A recorded vehicle.

    Attributes:
        number: Its id.
        kind: Its type.
        length: [m].
        width: [m].
        first: Time step of its first state.
        states: One row for each step from there on, columns as in `QUANTITIES`.
    """

    number: int
    kind: str
    length: float
    width: float
    first: int
    states: F64


def is_dynamic(element: Element) -> bool:
    """Whether an element is an obstacle that moves, in the words of 2018b or 2020a."""
    if element.name == "dynamicObstacle":
        return True
    role = element.optional("role") if element.name == "obstacle" else None
    return role is not None and role.text == "dynamic"


def obstacle(element: Element) -> Obstacle | None:
    """A vehicle from its element; None for what is no vehicle or has no recorded path.

    Raises:
        ImportFormatError: Something is missing, no number, too large or twice; the message names
            line and element.
    """
    kind = element.required("type").text
    path = element.optional("trajectory")
    if kind not in VEHICLES or path is None:
        return None
    number = element.integer("id")
    element.belongs_to(f"obstacle {number}")
    rows = [element.required("initialState"), *path.all("state")]
    length, width = _size(element.required("shape"))
    times = np.array([_time(row) for row in rows])
    _check_times(rows, times)
    states = np.array([[_quantity(row, name) for name in QUANTITIES] for row in rows])
    return Obstacle(
        number=number,
        kind=kind,
        length=length,
        width=width,
        first=int(times[0]),
        states=states,
    )


def _size(shape: Element) -> tuple[float, float]:
    """Length and width of a shape."""
    circle, rectangle = shape.optional("circle"), shape.optional("rectangle")
    if rectangle is not None:
        sides = [rectangle.required(name) for name in ("length", "width")]
        length, width = (side.value() for side in sides)
    elif circle is not None:
        length = width = 2.0 * circle.required("radius").value()
    else:
        raise shape.error(
            "is not known",
            "a rectangle or a circle",
            shape.children[0].name if shape.children else "nothing",
            "give the obstacle a rectangle",
        )
    if not 0.1 <= min(length, width) <= max(length, width) <= _MAX_SIZE:
        raise shape.error(
            "has no size of a vehicle", f"0.1 to {_MAX_SIZE:g} m", f"{length:g} by {width:g} m"
        )
    return length, width


def _exact(element: Element) -> float:
    """The value of a quantity that may also be given as an interval, which is refused."""
    return element.required("exact").value()


def _time(state: Element) -> int:
    given = state.required("time")
    value = _exact(given)
    if not (0.0 <= value <= _MAX_TIME and value == int(value)):
        raise given.error("is no time step", f"a whole number from 0 to {_MAX_TIME}", f"{value:g}")
    return int(value)


def _check_times(rows: list[Element], times: NDArray[np.int64]) -> None:
    """Refuse steps that are missing, twice or out of order."""
    wrong = np.flatnonzero(np.diff(times) != 1)
    if len(wrong):
        place = int(wrong[0]) + 1
        raise rows[place].error(
            "does not follow the state before it",
            f"time step {times[place - 1] + 1}",
            str(times[place]),
        )


def _quantity(state: Element, name: str) -> float:
    """One of `QUANTITIES`, NaN if it is not given."""
    if name in ("x", "y"):
        return state.required("position").required("point").required(name).value()
    given = state.optional(name)
    if given is None:
        return float("nan")
    value = _exact(given)
    if abs(value) > _LIMITS[name]:
        raise given.error(
            "is not that of a vehicle", f"a size of at most {_LIMITS[name]:g}", f"{value:g}"
        )
    return value
