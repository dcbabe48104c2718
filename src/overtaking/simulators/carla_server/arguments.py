"""The arguments of calls: their types, and how a decoded value becomes one or is refused.

A kind is a function from a decoded value to ours. `kind_of` derives it from a type, so the types in
the signature of a call declare its arguments. `Annotated` names a kind of its own for a type.
"""

from collections.abc import Callable, Container
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

Kind = Callable[[Any], Any]
"""Turns a decoded value into ours; raises `ArgumentError`."""

MAX_SIZE = 1e9
"""Largest number accepted: metres, newtons, newton metres or percent."""

MIN_DELTA, MAX_DELTA = 0.001, 1.0
"""Shortest and longest tick [s]; a longer one would block the server."""


class ArgumentError(Exception):
    """The call does not take this argument; the client gets the message."""


def number(value: Any) -> float:
    """A finite number of reasonable size."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ArgumentError("a number")
    if not abs(value) <= MAX_SIZE:  # Also true for NaN.
        raise ArgumentError("a finite number")
    return float(value)


def whole(value: Any) -> int:
    """A whole number of 32 bits."""
    if isinstance(value, bool) or not isinstance(value, int) or not -(2**31) <= value < 2**32:
        raise ArgumentError("a whole number of 32 bits")
    return value


def unsigned(value: Any) -> int:
    """An id: a whole number of 32 bits that is not negative."""
    if whole(value) < 0:
        raise ArgumentError("a whole number that is not negative")
    return int(value)


def one_of(choices: Container[int]) -> Kind:
    """One of some whole numbers."""

    def read(value: Any) -> int:
        if unsigned(value) not in choices:
            raise ArgumentError("a number that stands for something")
        return int(value)

    return read


def yes_or_no(value: Any) -> bool:
    """A boolean."""
    if not isinstance(value, bool):
        raise ArgumentError("true or false")
    return value


def text(value: Any) -> str:
    """A text."""
    if not isinstance(value, str):
        raise ArgumentError("a text")
    return value


def record(make: Callable[..., Any], *kinds: Kind) -> Kind:
    """A fixed number of values, each of its kind."""

    def read(value: Any) -> Any:
        if not isinstance(value, list) or len(value) != len(kinds):
            raise ArgumentError(f"{len(kinds)} values")
        return make(*(kind(item) for kind, item in zip(kinds, value, strict=True)))

    return read


def listed(kind: Kind) -> Kind:
    """Any number of values of one kind."""

    def read(value: Any) -> Any:
        if not isinstance(value, list):
            raise ArgumentError("a list")
        return tuple(kind(item) for item in value)

    return read


def optional(kind: Kind) -> Kind:
    """A value or none: `[false]` or `[true, value]`."""

    def read(value: Any) -> Any:
        if value == [False]:
            return None
        if isinstance(value, list) and len(value) == 2 and value[0] is True:
            return kind(value[1])
        raise ArgumentError("an optional value")

    return read


_SIMPLE: dict[object, Kind] = {
    float: number,
    int: whole,
    bool: yes_or_no,
    str: text,
    Any: lambda value: value,  # Only for calls that ignore it.
}


def kind_of(hint: Any) -> Kind:
    """The kind that a type stands for.

    Args:
        hint: A simple type, a tuple of types, a `NamedTuple`, or `Annotated` with a kind.
    """
    if get_origin(hint) is Annotated:
        return hint.__metadata__[0]
    if get_origin(hint) is tuple:
        first, *others = get_args(hint)
        if others == [...]:
            return listed(kind_of(first))
        return record(lambda *values: values, *map(kind_of, (first, *others)))
    if hint in _SIMPLE:
        return _SIMPLE[hint]
    fields = get_type_hints(hint, include_extras=True)
    return record(hint, *map(kind_of, fields.values()))


def check(kinds: tuple[Kind, ...], values: list[Any]) -> list[Any]:
    """The arguments of a call, in our types.

    Raises:
        ArgumentError: Their number is wrong, or one is of another kind.
    """
    if len(values) != len(kinds):
        raise ArgumentError(f"expected {len(kinds)} arguments, got {len(values)}")
    read: list[Any] = []
    for place, (kind, value) in enumerate(zip(kinds, values, strict=True), 1):
        try:
            read.append(kind(value))
        except ArgumentError as error:
            raise ArgumentError(f"argument {place}: expected {error}") from None
    return read


def _clamped(low: float, high: float) -> Kind:
    return lambda value: min(max(number(value), low), high)


def _fixed_delta(value: Any) -> float | None:
    """Length of a tick [s]; none or zero leaves it to the server."""
    delta = optional(number)(value)
    if delta is None or delta == 0.0:
        return None
    if not MIN_DELTA <= delta <= MAX_DELTA:
        raise ArgumentError(f"a tick of {MIN_DELTA:g} to {MAX_DELTA:g} s")
    return float(delta)


Id = Annotated[int, unsigned]
Pedal = Annotated[float, _clamped(0.0, 1.0)]
Weather = Annotated[tuple[float, ...], kind_of(tuple[*[float] * 14])]
"""The fourteen numbers of `carla.WeatherParameters`, in its order."""


class Vector(NamedTuple):
    """Three components in CARLA's left-handed frame: x forward, y right, z up."""

    x: float
    y: float
    z: float


class Rotation(NamedTuple):
    """Angles as CARLA sends them [degrees]."""

    pitch: float
    yaw: float
    roll: float


class Transform(NamedTuple):
    """A pose: position and orientation."""

    location: Vector
    rotation: Rotation


class Control(NamedTuple):
    """`carla.VehicleControl`: pedals 0 to 1, steering -1 (left) to 1 (right)."""

    throttle: Pedal = 0.0
    steer: Annotated[float, _clamped(-1.0, 1.0)] = 0.0
    brake: Pedal = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


class Target(NamedTuple):
    """`carla.VehicleAckermannControl`: angle [rad], its speed [rad/s], m/s, m/s^2 and m/s^3.

    The steering angle is positive to the right. CARLA's controller does not use the jerk.
    """

    steer: float = 0.0
    steer_speed: float = 0.0
    speed: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0


class Gains(NamedTuple):
    """`carla.AckermannControllerSettings`, with CARLA's defaults."""

    speed_kp: float = 0.15
    speed_ki: float = 0.0
    speed_kd: float = 0.25
    accel_kp: float = 0.01
    accel_ki: float = 0.0
    accel_kd: float = 0.01


class Wheel(NamedTuple):
    """`carla.WheelPhysicsControl`, as it is sent; angles in degrees, radius in cm."""

    tire_friction: float
    damping_rate: float
    max_steer_angle: float
    radius: float
    max_brake_torque: float
    max_handbrake_torque: float
    lat_stiff_max_load: float
    lat_stiff_value: float
    long_stiff_value: float
    position: Vector


class Physics(NamedTuple):
    """`carla.VehiclePhysicsControl`, as it is sent; mass in kg, speeds in km/h."""

    torque_curve: tuple[tuple[float, float], ...]
    max_rpm: float
    moi: float
    damping_rate_full_throttle: float
    damping_rate_zero_throttle_clutch_engaged: float
    damping_rate_zero_throttle_clutch_disengaged: float
    use_gear_autobox: bool
    gear_switch_time: float
    clutch_strength: float
    final_ratio: float
    forward_gears: tuple[tuple[float, float, float], ...]
    mass: float
    drag_coefficient: float
    center_of_mass: Vector
    steering_curve: tuple[tuple[float, float], ...]
    wheels: tuple[Wheel, ...]
    use_sweep_wheel_collision: bool


class Attribute(NamedTuple):
    """The value that a client chose for an attribute of a blueprint."""

    name: str
    kind: Id
    value: str


class Description(NamedTuple):
    """An actor that a client wants to spawn."""

    uid: Id
    blueprint: str
    attributes: tuple[Attribute, ...]


class Settings(NamedTuple):
    """`carla.WorldSettings`, as it is sent; times in seconds, distances in metres."""

    synchronous: bool = False
    no_rendering: bool = False
    fixed_delta: Annotated[float | None, _fixed_delta] = None
    substepping: bool = True
    max_substep: float = 0.01
    max_substeps: int = 10
    max_culling: float = 0.0
    deterministic_ragdolls: bool = True
    tile_stream_distance: float = 3000.0
    actor_active_distance: float = 2000.0
    spectator_as_ego: bool = True
