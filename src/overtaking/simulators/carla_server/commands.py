"""Batches of commands: most are calls that exist by themselves as well (`protocol.COMMANDS`)."""

# No `from __future__ import annotations`: `call` reads the types when a function is declared.

from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, PlainValidator

from overtaking.core.errors import OvertakingError
from overtaking.simulators.carla_server.arguments import (
    ArgumentError,
    Description,
    Flag,
    Id,
    Transform,
    opened,
    read,
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
            return Command(number, read(COMMANDS[number].taken, fields))
        case [[int(number), list()]] if number in LACKING:
            return Command(number, ())
        case _:
            raise ArgumentError("a command of the protocol")


def _plain(value: Any) -> Command:
    """A command that follows a spawn; it may not spawn again."""
    match value:
        case [[int(number), _]] if number == SPAWN:
            raise ArgumentError("a command that does not spawn")
        case _:
            return command(value)


def _run(session: Session, one: Command) -> int:
    """Carry out a command; the id of its actor."""
    if one.number in LACKING:
        raise Refused(f"the headless server does not offer the command {LACKING[one.number]}")
    found = COMMANDS[one.number].run(session, one.fields)
    return found if one.number == SPAWN else one.fields[0]


def _spawn(
    session: Session,
    wanted: Description,
    pose: Transform,
    parent: Annotated[Id | None, BeforeValidator(opened)],
    _: Any,
    __: Any,
    then: Annotated[
        tuple[Annotated[Command, PlainValidator(_plain)], ...], Field(max_length=MAX_THEN)
    ],
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


def _set_autopilot(_: World, __: Id, ___: Flag) -> None:
    """Nothing: the client tells its Traffic Manager as well, and that one drives."""


def _set_lights(world: World, actor: Id, lights: Id) -> None:
    world.vehicle(actor).lights = lights


COMMANDS[SPAWN] = declared(_spawn)
COMMANDS[16] = declared(_set_autopilot)
COMMANDS[18] = declared(_set_lights)


@call(shape=BATCH)
def apply_batch(
    session: Session, commands: tuple[Annotated[Command, PlainValidator(command)], ...], ticks: Flag
) -> Answer:
    """Carry out several commands: the id of an actor or an error for each."""
    done: Answer = []
    for one in commands:
        try:
            done.append(RESULT.result(_run(session, one)))
        except (Refused, OvertakingError) as error:
            done.append(RESULT.error(str(error)))
            if one.number == SPAWN:  # Many clients do not look at the error.
                session.unseen.append(str(error))
    if ticks and session.world.settings.synchronous:
        session.world.tick()
    return done
