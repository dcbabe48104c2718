"""The commands of a batch."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from overtaking.core.errors import OvertakingError
from overtaking.simulators.carla_server import answers, physics
from overtaking.simulators.carla_server.answers import Refused
from overtaking.simulators.carla_server.arguments import (
    ArgumentError,
    Control,
    Description,
    Kind,
    Target,
    Transform,
    Vector,
    ackermann_target,
    anything,
    check,
    control,
    description,
    listed,
    optional,
    physics_control,
    transform,
    unsigned,
    vector,
    yes_or_no,
)

if TYPE_CHECKING:
    from overtaking.simulators.carla_server.answers import Answer
    from overtaking.simulators.carla_server.protocol import Session
    from overtaking.simulators.carla_server.world import World

SPAWN = 0
MAX_THEN = 16
"""Most commands that one spawn may bring with it."""


class Command(NamedTuple):
    """A command of a batch: its number in the protocol and its fields."""

    number: int
    fields: tuple[Any, ...]


Deed = Callable[..., object]


def command(value: Any) -> Command:
    """A command in our types: `[[number, [fields]]]`."""
    match value:
        case [[int(number), [*fields]]] if number in _KINDS:
            return Command(number, tuple(check(_KINDS[number][0], fields)))
        case [[int(number), list()]] if number in LACKING:
            return Command(number, ())
        case _:
            raise ArgumentError("a command of the protocol")


def _then(value: Any) -> tuple[Command, ...]:
    """What a spawn brings with it; none of it may spawn again."""
    found = listed(_plain)(value)
    if len(found) > MAX_THEN:
        raise ArgumentError(f"at most {MAX_THEN} commands after a spawn")
    return found


def _plain(value: Any) -> Command:
    one = command(value) if not _is_spawn(value) else None
    if one is None:
        raise ArgumentError("a command that does not spawn")
    return one


def _is_spawn(value: Any) -> bool:
    match value:
        case [[int(number), _]]:
            return number == SPAWN
        case _:
            return False


def apply(session: Session, one: Command) -> Answer:
    """Do it; the id of the actor, or the reason why not."""
    try:
        actor = _spawn(session, *one.fields) if one.number == SPAWN else _do(session.world, one)
    except (Refused, OvertakingError) as error:
        return answers.refusal(str(error))
    return answers.value(actor)


def _do(world: World, one: Command) -> int:
    if one.number in LACKING:
        raise Refused(f"the headless server does not offer the command {LACKING[one.number]}")
    _KINDS[one.number][1](world, *one.fields)
    return one.fields[0] if isinstance(one.fields[0], int) else 0


def _spawn(
    session: Session,
    wanted: Description,
    pose: Transform,
    parent: int | None,
    _: Any,
    __: Any,
    then: tuple[Command, ...],
) -> int:
    actor = session.world.spawn(wanted, pose, parent or 0).actor_id
    for one in then:
        try:
            # Inside, the actor is called 0: it had no id when the command was written.
            _do(session.world, one._replace(fields=(actor, *one.fields[1:])))
        except Refused as error:
            # The actor is there, so its id is the answer, as in CARLA.
            session.unseen.append(str(error))
    return actor


def _destroy(world: World, actor: int) -> None:
    if not world.destroy(actor):
        raise Refused(f"there is no actor {actor}")


def _control(world: World, actor: int, wanted: Control) -> None:
    world.vehicle(actor).drive(wanted)


def _make_for(world: World, actor: int, wanted: Target) -> None:
    world.vehicle(actor).make_for(wanted)


def _place(world: World, actor: int, pose: Transform) -> None:
    world.place_actor(actor, pose)


def _locate(world: World, actor: int, location: Vector) -> None:
    world.place_actor(actor, world.actor(actor).pose._replace(location=location))


def _velocity(world: World, actor: int, velocity: Vector) -> None:
    world.set_velocity(actor, velocity)


def _moves(world: World, actor: int, moves: bool) -> None:
    world.fleet.set_moves(world.vehicle(actor).actor_id, moves=moves)


def _lights(world: World, actor: int, lights: int) -> None:
    world.vehicle(actor).lights = lights


def _nothing(*_: Any) -> None:
    """For the autopilot: the client tells its Traffic Manager as well, and that one drives."""


_KINDS: dict[int, tuple[tuple[Kind, ...], Deed]] = {
    SPAWN: ((description, transform, optional(unsigned), anything, anything, _then), _nothing),
    1: ((unsigned,), _destroy),
    2: ((unsigned, control), _control),
    3: ((unsigned, ackermann_target), _make_for),
    5: ((unsigned, physics_control), physics.apply_physics_control),
    6: ((unsigned, transform), _place),
    8: ((unsigned, vector), _velocity),
    9: ((unsigned, vector), physics.set_turning),
    10: ((unsigned, vector), physics.push),
    11: ((unsigned, vector), physics.force),
    12: ((unsigned, vector), physics.spin),
    13: ((unsigned, vector), physics.twist),
    14: ((unsigned, yes_or_no), _moves),
    15: ((unsigned, yes_or_no), physics.set_gravity),
    16: ((unsigned, yes_or_no), _nothing),
    18: ((unsigned, unsigned), _lights),
    19: ((unsigned, vector), _locate),
}
"""Fields of each command, and what it does; the numbers are the protocol's."""

LACKING = {
    4: "ApplyWalkerControl",
    7: "ApplyWalkerState",
    17: "ShowDebugTelemetry",
    20: "ConsoleCommand",
    21: "SetTrafficLightState",
}
"""Commands that are refused one by one, so that the others of their batch are done."""
