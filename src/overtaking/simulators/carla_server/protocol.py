"""The table of calls: arguments, function, and how the client reads the answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

from overtaking.core.errors import OvertakingError
from overtaking.simulators.carla_server.arguments import ArgumentError, read, reader

if TYPE_CHECKING:
    from pydantic import TypeAdapter

    from overtaking.simulators.carla_server.world import World

VERSION = "0.9.16"
"""The version of CARLA whose clients are served."""

Answer = list[Any]
Body = Callable[..., Any]


class Refused(Exception):
    """The server refuses what a client asked for; the client gets the message."""


class Shape(NamedTuple):
    """How the client reads an answer: functions that wrap a result and the message of an error."""

    result: Callable[[Any], Answer]
    error: Callable[[str], Answer]


RESULT = Shape(lambda result: [[1, result]], lambda message: [[0, [message]]])
NO_RESULT = Shape(lambda _: [[False]], lambda message: [[True, [message]]])
BATCH = Shape(lambda results: results, lambda message: [RESULT.error(message)])


@dataclass(slots=True)
class Session:
    """The connection that a call came over.

    Attributes:
        world: The state of the server.
        managers: Address of each Traffic Manager that runs in a client, by port.
        own_managers: Ports of those that this client runs.
        unseen: Errors that the client may not see; the server logs and removes them.
    """

    world: World
    managers: dict[int, str]
    own_managers: set[int] = field(default_factory=set)
    unseen: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Call:
    """One call.

    Attributes:
        body: Carries it out. Its first argument is the session or the world, the others are those
            of the client.
        taken: Reads the client's arguments.
        shape: Shape of its answers.
        needs_session: Whether the first argument is the session.
    """

    body: Body
    taken: TypeAdapter[tuple[Any, ...]]
    shape: Shape
    needs_session: bool = False

    def run(self, session: Session, arguments: tuple[Any, ...]) -> Any:
        """Its result; the arguments are checked already."""
        return self.body(session if self.needs_session else session.world, *arguments)

    def answer(self, session: Session, name: str, values: list[Any]) -> Answer:
        """The answer to arguments as they were decoded."""
        try:
            return self.shape.result(self.run(session, read(self.taken, values)))
        except ArgumentError as error:
            return self.shape.error(f"{name}: {error}")
        except (Refused, OvertakingError) as error:
            return self.shape.error(str(error))


CALLS: dict[str, Call] = {}
"""Every call that is offered, by name."""

COMMANDS: dict[int, Call] = {}
"""The calls that a batch may contain as well, by their number there."""

SLOW = frozenset(("cast_ray", "copy_opendrive_to_file", "project_point"))
"""Calls that may take long and change no state; they run in a thread."""

LACKING_VOID = frozenset(
    (
        "apply_color_texture_to_objects", "apply_float_color_texture_to_objects", "enable_gbuffers",
        "load_map_layer", "set_actor_collisions", "set_ignored_vehicles", "unload_map_layer",
    )
)  # fmt: skip
"""Calls without result that are not offered, and whose answers clients wait for."""


def declared(body: Body, shape: Shape | None = None) -> Call:
    """A call from a function: the types of its arguments, and whether it has a result.

    Args:
        body: Its first argument, `world` or `session`, comes from the server.
        shape: Shape of its answers, where a result alone does not tell.
    """
    hints = get_type_hints(body, include_extras=True)
    has_result = hints.pop("return") is not type(None)
    first, *arguments = hints
    return Call(
        body=body,
        taken=reader([hints[name] for name in arguments]),
        shape=shape or (RESULT if has_result else NO_RESULT),
        needs_session=first == "session",
    )


def call(*, command: int | None = None, shape: Shape | None = None) -> Callable[[Body], Body]:
    """Declare a call under the name of a function, see `declared`.

    Args:
        command: Its number in a batch, if it may be part of one.
        shape: Shape of its answers, where a result alone does not tell.
    """

    def declare(body: Body) -> Body:
        made = CALLS[body.__name__] = declared(body, shape)
        if command is not None:
            COMMANDS[command] = made
        return body

    return declare


def refuse_unknown(name: str) -> Answer:
    """The answer to a call that is not offered, in the shape that the client reads."""
    shape = NO_RESULT if name in LACKING_VOID else RESULT
    return shape.error(f"{name}: the headless server does not offer this call")


def errors(answer: Answer) -> list[str]:
    """The error in an answer, or all those in the answer to a batch."""
    match answer:
        case [[0 | True, [str(message)]]]:
            return [message]
        case [[int(), *_]]:
            return []
        case _:
            return [message for one in answer for message in errors(one)]
