"""CommonRoad's dynamic obstacles: the recorded vehicles of a scene."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from overtaking.core.arrays import F64, I64
from overtaking.recordings.messages import shown
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
        times: Time step of each state, ascending, shape (state,).
        states: Shape (state, quantity), columns as in `QUANTITIES`.
    """

    number: int
    kind: str
    length: float
    width: float
    times: I64
    states: F64


def is_dynamic(element: Element) -> bool:
    """Whether an element is an obstacle that moves, in the words of 2018b or 2020a."""
    if element.name == "dynamicObstacle":
        return True
    role = element.optional("role") if element.name == "obstacle" else None
    return role is not None and role.text == "dynamic"


class LeftOut(NamedTuple):
    """An obstacle that is no vehicle with a recorded path.

    Attributes:
        number: Its id.
        kind: Its type.
        reason: Why the vehicle is left out; None for an obstacle that is no vehicle or has no
            trajectory.
    """

    number: int
    kind: str
    reason: str | None


def read_obstacle(element: Element) -> Obstacle | LeftOut:
    """A vehicle from its element, or the reason why it is left out of the scene.

    An interval in place of a speed, direction or acceleration counts as not stated. An obstacle is
    left out if a position is an area, a time is an interval, or the shape has no known size.

    Raises:
        ImportFormatError: An element is missing, a value is no number or too large, or states are
            out of order; the message names line and element.
    """
    number, kind = element.integer("id"), element.required("type").text
    path = element.optional("trajectory")
    if kind not in VEHICLES or path is None:
        return LeftOut(number, kind, None)
    element.belongs_to(f"obstacle {number}")
    try:
        length, width = _size(element.optional("shape"))
        rows, times = _states(element.required("initialState"), path)
        states = np.array([[_quantity(row, name) for name in QUANTITIES] for row in rows])
    except _Uncertain as uncertain:
        return LeftOut(number, kind, f"{uncertain}")
    return Obstacle(
        number=number,
        kind=kind,
        length=length,
        width=width,
        times=np.array(times, np.int64),
        states=states,
    )


class _Uncertain(Exception):
    """A value of an obstacle that the format allows, but that is not exact, such as an area."""


def _states(initial: Element, path: Element) -> tuple[list[Element], list[int]]:
    """The states of a vehicle and their time steps, ascending.

    Some writers repeat the initial state as the first state of the trajectory.
    """
    rows = [initial]
    times = [_time(initial)]
    for row in path.all("state"):
        time = _time(row)
        if time == times[-1] and (len(rows) == 1 or _point(row) == _point(rows[-1])):
            continue
        if time <= times[-1]:
            raise row.error(
                "does not follow the state before it",
                f"time step {times[-1] + 1} or later",
                f"{time}",
            )
        rows.append(row)
        times.append(time)
    return rows, times


def _size(shape: Element | None) -> tuple[float, float]:
    """Length and width of a shape [m]."""
    if shape is None or len(shape.children) != 1:
        is_missing = shape is None or not shape.children
        raise _Uncertain("no shape" if is_missing else "several shapes")
    form = shape.children[0]
    if form.name == "rectangle":
        length, width = (form.required(name).value() for name in ("length", "width"))
    elif form.name == "circle":
        length = width = 2.0 * form.required("radius").value()
    elif form.name == "polygon":
        points = np.array(
            [[point.required(axis).value() for axis in ("x", "y")] for point in form.all("point")]
        )
        # The axes of the polygon are those of the vehicle, so that its extent is the size.
        length, width = map(float, np.ptp(points.reshape(-1, 2), axis=0)) if len(points) else (0, 0)
    else:
        raise _Uncertain(f"an unknown shape: {shown(form.name)}")
    if not 0.1 <= min(length, width) <= max(length, width) <= _MAX_SIZE:
        raise shape.error(
            "has no size of a vehicle", f"0.1 to {_MAX_SIZE:g} m", f"{length:g} by {width:g} m"
        )
    return length, width


def _time(state: Element) -> int:
    stated = state.required("time")
    exact = stated.optional("exact")
    if exact is None:
        raise _Uncertain(f"line {stated.line}: an interval of time")
    value = exact.value()
    if not (0.0 <= value <= _MAX_TIME and value == int(value)):
        raise stated.error("is no time step", f"a whole number from 0 to {_MAX_TIME}", f"{value:g}")
    return int(value)


def _point(state: Element) -> tuple[float, float]:
    """The position of a state [m]."""
    position = state.required("position")
    point = position.optional("point")
    if point is None:
        area = position.children[0].name if position.children else "nothing"
        raise _Uncertain(f"line {position.line}: a position that is an area: {shown(area)}")
    x, y = (point.required(axis).value() for axis in ("x", "y"))
    return x, y


def _quantity(state: Element, name: str) -> float:
    """One of `QUANTITIES`, NaN if it is not stated or stated as an interval."""
    if name in ("x", "y"):
        return _point(state)[QUANTITIES.index(name)]
    stated = state.optional(name)
    exact = None if stated is None else stated.optional("exact")
    if stated is None or exact is None:
        return float("nan")
    value = exact.value()
    if abs(value) > _LIMITS[name]:
        raise stated.error(
            "is not that of a vehicle", f"a size of at most {_LIMITS[name]:g}", f"{value:g}"
        )
    return value
