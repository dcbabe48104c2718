"""The commands of a batch."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from overtaking.carla_server import answers, physics
from overtaking.carla_server.answers import Refused
from overtaking.carla_server.arguments import (
    ArgumentError,
    Control,
    Description,
    Kind,
    Transform,
    Vector,
    anything,
    check,
    control,
    description,
    listed,
    optional,
    text,
    transform,
    unsigned,
    vector,
    yes_or_no,
)
from overtaking.core.errors import OvertakingError

if TYPE_CHECKING:
    from overtaking.carla_server.answers import Answer
    from overtaking.carla_server.world import World

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
        case _:
            raise ArgumentError("a command that this server knows")


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


def apply(world: World, one: Command) -> Answer:
    """Do it; the id of the actor, or the reason why not."""
    try:
        actor = _spawn(world, *one.fields) if one.number == SPAWN else _do(world, one)
    except (Refused, OvertakingError) as error:
        return answers.refusal(str(error))
    return answers.value(actor)


def _do(world: World, one: Command) -> int:
    _KINDS[one.number][1](world, *one.fields)
    return one.fields[0] if isinstance(one.fields[0], int) else 0


def _spawn(
    world: World,
    wanted: Description,
    pose: Transform,
    parent: int | None,
    _: Any,
    __: Any,
    then: tuple[Command, ...],
) -> int:
    actor = world.spawn(wanted, pose, parent or 0).actor_id
    for one in then:
        # Inside, the actor is called 0: it had no id when the command was written.
        _do(world, one._replace(fields=(actor, *one.fields[1:])))
    return actor


def _destroy(world: World, actor: int) -> None:
    if not world.destroy(actor):
        raise Refused(f"there is no actor {actor}")


def _control(world: World, actor: int, wanted: Control) -> None:
    world.vehicle(actor).control = wanted


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
    """For what has no effect here, such as gravity or the server's own autopilot."""


_KINDS: dict[int, tuple[tuple[Kind, ...], Deed]] = {
    SPAWN: ((description, transform, optional(unsigned), anything, anything, _then), _nothing),
    1: ((unsigned,), _destroy),
    2: ((unsigned, control), _control),
    6: ((unsigned, transform), _place),
    8: ((unsigned, vector), _velocity),
    9: ((unsigned, vector), physics.set_turning),
    10: ((unsigned, vector), physics.push),
    11: ((unsigned, vector), physics.force),
    14: ((unsigned, yes_or_no), _moves),
    15: ((unsigned, yes_or_no), _nothing),
    16: ((unsigned, yes_or_no), _nothing),
    17: ((unsigned, yes_or_no), _nothing),
    18: ((unsigned, unsigned), _lights),
    19: ((unsigned, vector), _locate),
    20: ((text,), _nothing),
}
"""Fields of each command, and what it does; the numbers are the protocol's."""
