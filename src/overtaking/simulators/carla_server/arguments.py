"""The arguments of calls: their types, and how decoded values become them or are refused.

The types in the signature of a call declare its arguments, and pydantic checks them. Numbers, texts
and booleans are never converted into each other; a list becomes the tuple that a type asks for.
"""

from types import GenericAlias
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

MAX_SIZE = 1e9
"""Largest number accepted: metres, newtons, newton metres or percent."""

MIN_DELTA, MAX_DELTA = 0.001, 1.0
"""Shortest and longest tick [s]; a longer one would block the server."""

Number = Annotated[float, Field(strict=True, ge=-MAX_SIZE, le=MAX_SIZE, allow_inf_nan=False)]
Whole = Annotated[int, Field(strict=True, ge=-(2**31), lt=2**32)]
Id = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
Flag = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(strict=True)]
Weather = Annotated[tuple[Number, ...], Field(min_length=14, max_length=14)]
"""The fourteen numbers of `carla.WeatherParameters`, in its order."""


class ArgumentError(ValueError):
    """The call does not take this argument; the client gets the message."""


def reader(hints: list[Any]) -> TypeAdapter[tuple[Any, ...]]:
    """What turns the decoded arguments of a call into values of these types."""
    kinds: Any = GenericAlias(tuple, tuple(_complete(hint) for hint in hints))
    return TypeAdapter(kinds)


def read(taken: TypeAdapter[tuple[Any, ...]], values: list[Any]) -> tuple[Any, ...]:
    """The arguments of a call, in our types.

    Raises:
        ArgumentError: Their number is wrong, or one is of another type.
    """
    try:
        return taken.validate_python(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        index = ".".join(str(k + 1) for k in first["loc"] if isinstance(k, int))
        what = f"argument {index}" if index else "arguments"
        raise ArgumentError(f"{what}: {first['msg'].removeprefix('Value error, ')}") from None


def _complete(hint: Any) -> Any:
    """A type without its defaults: clients send all fields of a record."""
    if not hasattr(hint, "_fields"):
        return hint

    def whole(value: Any) -> Any:
        if not isinstance(value, list) or len(value) != len(hint._fields):
            raise ArgumentError(f"expected {len(hint._fields)} values")
        return value

    return Annotated[hint, BeforeValidator(whole)]


def opened(value: Any) -> Any:
    """What an optional value holds: `[false]` is None, `[true, value]` the value."""
    match value:
        case [False]:
            return None
        case [True, held] if held is not None:
            return held
        case _:
            raise ArgumentError("expected an optional value")


def _fixed_delta(delta: float | None) -> float | None:
    """Length of a tick [s]; none or zero leaves it to the server."""
    if delta and not MIN_DELTA <= delta <= MAX_DELTA:
        raise ArgumentError(f"expected a tick of {MIN_DELTA:g} to {MAX_DELTA:g} s")
    return delta or None


Pedal = Annotated[Number, AfterValidator(lambda value: min(max(value, 0.0), 1.0))]
Steer = Annotated[Number, AfterValidator(lambda value: min(max(value, -1.0), 1.0))]
Delta = Annotated[Number | None, BeforeValidator(opened), AfterValidator(_fixed_delta)]


class Vector(NamedTuple):
    """Three components in CARLA's left-handed frame: x forward, y right, z up."""

    x: Number
    y: Number
    z: Number


class Rotation(NamedTuple):
    """Angles as CARLA sends them [degrees]."""

    pitch: Number
    yaw: Number
    roll: Number


class Transform(NamedTuple):
    """A pose: position and orientation."""

    location: Vector
    rotation: Rotation


class Control(NamedTuple):
    """`carla.VehicleControl`: pedals 0 to 1, steering -1 (left) to 1 (right)."""

    throttle: Pedal = 0.0
    steer: Steer = 0.0
    brake: Pedal = 0.0
    hand_brake: Flag = False
    reverse: Flag = False
    manual_gear_shift: Flag = False
    gear: Whole = 0


class Target(NamedTuple):
    """`carla.VehicleAckermannControl`: angle [rad], its speed [rad/s], m/s, m/s^2 and m/s^3.

    The steering angle is positive to the right. CARLA's controller does not use the jerk.
    """

    steer: Number = 0.0
    steer_speed: Number = 0.0
    speed: Number = 0.0
    acceleration: Number = 0.0
    jerk: Number = 0.0


class Gains(NamedTuple):
    """`carla.AckermannControllerSettings`, with CARLA's defaults."""

    speed_kp: Number = 0.15
    speed_ki: Number = 0.0
    speed_kd: Number = 0.25
    accel_kp: Number = 0.01
    accel_ki: Number = 0.0
    accel_kd: Number = 0.01


class Wheel(NamedTuple):
    """`carla.WheelPhysicsControl`, as it is sent; angles in degrees, radius in cm."""

    tire_friction: Number
    damping_rate: Number
    max_steer_angle: Number
    radius: Number
    max_brake_torque: Number
    max_handbrake_torque: Number
    lat_stiff_max_load: Number
    lat_stiff_value: Number
    long_stiff_value: Number
    position: Vector


class Physics(NamedTuple):
    """`carla.VehiclePhysicsControl`, as it is sent; mass in kg, speeds in km/h."""

    torque_curve: tuple[tuple[Number, Number], ...]
    max_rpm: Number
    moi: Number
    damping_rate_full_throttle: Number
    damping_rate_zero_throttle_clutch_engaged: Number
    damping_rate_zero_throttle_clutch_disengaged: Number
    use_gear_autobox: Flag
    gear_switch_time: Number
    clutch_strength: Number
    final_ratio: Number
    forward_gears: tuple[tuple[Number, Number, Number], ...]
    mass: Number
    drag_coefficient: Number
    center_of_mass: Vector
    steering_curve: tuple[tuple[Number, Number], ...]
    wheels: tuple[Wheel, ...]
    use_sweep_wheel_collision: Flag


class Attribute(NamedTuple):
    """The value that a client chose for an attribute of a blueprint."""

    name: Text
    kind: Id
    value: Text


class Description(NamedTuple):
    """An actor that a client wants to spawn."""

    uid: Id
    blueprint: Text
    attributes: tuple[Attribute, ...]


class Settings(NamedTuple):
    """`carla.WorldSettings`, as it is sent; times in seconds, distances in metres."""

    synchronous: Flag = False
    no_rendering: Flag = False
    fixed_delta: Delta = None
    substepping: Flag = True
    max_substep: Number = 0.01
    max_substeps: Whole = 10
    max_culling: Number = 0.0
    deterministic_ragdolls: Flag = True
    tile_stream_distance: Number = 3000.0
    actor_active_distance: Number = 2000.0
    spectator_as_ego: Flag = True
