"""Batches of commands: most are calls that exist by themselves as well (`protocol.COMMANDS`)."""

# No `from __future__ import annotations`: `call` reads the types when a function is declared.

from typing import Annotated, Any, NamedTuple

from overtaking.core.errors import OvertakingError
from overtaking.simulators.carla_server.arguments import (
    ArgumentError,
    Description,
    Id,
    Transform,
    check,
    kind_of,
    listed,
    optional,
)
from overtaking.simulators.carla_server.protocol import (
    BATCH,
    COMMANDS,
    RESULT,
    Answer,
    Refused,
    Session,
    call,
    declared,
)
from overtaking.simulators.carla_server.world import World

SPAWN = 0
MAX_THEN = 16
"""Most commands that one spawn may bring with it."""

LACKING = {
    4: "ApplyWalkerControl",
    7: "ApplyWalkerState",
    17: "ShowDebugTelemetry",
    20: "ConsoleCommand",
    21: "SetTrafficLightState",
}
"""Commands that are refused one by one, so that the others of their batch are done."""


class Command(NamedTuple):
    """A command of a batch: its number in the protocol and its fields."""

    number: int
    fields: tuple[Any, ...]


def command(value: Any) -> Command:
    """A command in our types: `[[number, [fields]]]`."""
    match value:
        case [[int(number), [*fields]]] if number in COMMANDS:
            return Command(number, tuple(check(COMMANDS[number].kinds, fields)))
        case [[int(number), list()]] if number in LACKING:
            return Command(number, ())
        case _:
            raise ArgumentError("a command of the protocol")


def _plain(value: Any) -> Command:
    match value:
        case [[int(number), _]] if number == SPAWN:
            raise ArgumentError("a command that does not spawn")
        case _:
            return command(value)


def _then(value: Any) -> tuple[Command, ...]:
    """The commands that follow a spawn; none of them may spawn again."""
    found = listed(_plain)(value)
    if len(found) > MAX_THEN:
        raise ArgumentError(f"at most {MAX_THEN} commands after a spawn")
    return found


def _run(session: Session, one: Command) -> int:
    """Carry out a command; the id of its actor."""
    if one.number in LACKING:
        raise Refused(f"the headless server does not offer the command {LACKING[one.number]}")
    found = COMMANDS[one.number].run(session, list(one.fields))
    return found if one.number == SPAWN else one.fields[0]


def _spawn(
    session: Session,
    wanted: Description,
    pose: Transform,
    parent: Annotated[int | None, optional(kind_of(Id))],
    _: Any,
    __: Any,
    then: Annotated[tuple[Command, ...], _then],
) -> int:
    actor = session.world.spawn(wanted, pose, parent or 0).actor_id
    for one in then:
        try:
            # Inside, the actor is called 0: it had no id when the command was written.
            _run(session, one._replace(fields=(actor, *one.fields[1:])))
        except Refused as error:
            # The actor exists, so its id is the answer, as in CARLA.
            session.unseen.append(str(error))
    return actor


def _set_autopilot(_: World, __: Id, ___: bool) -> None:
    """Nothing: the client tells its Traffic Manager as well, and that one drives."""


def _set_lights(world: World, actor: Id, lights: Id) -> None:
    world.vehicle(actor).lights = lights


COMMANDS[SPAWN] = declared(_spawn)
COMMANDS[16] = declared(_set_autopilot)
COMMANDS[18] = declared(_set_lights)


@call(shape=BATCH)
def apply_batch(
    session: Session, commands: tuple[Annotated[Command, command], ...], ticks: bool
) -> Answer:
    """Carry out several commands: the id of an actor or an error for each."""
    done: Answer = []
    for one in commands:
        try:
            done.append(RESULT.result(_run(session, one)))
        except (Refused, OvertakingError) as error:
            done.append(RESULT.error(str(error)))
    if ticks and session.world.settings.synchronous:
        session.world.tick()
    return done
