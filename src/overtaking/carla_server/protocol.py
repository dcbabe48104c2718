"""How a call is declared: its name, the arguments it takes, and what it does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from overtaking.carla_server.answers import Answer

if TYPE_CHECKING:
    from overtaking.carla_server.arguments import Kind
    from overtaking.carla_server.world import World

VERSION = "0.9.16"
"""The version of CARLA whose clients are served."""

Body = Callable[..., Answer]


@dataclass(slots=True)
class Session:
    """What a call may look at.

    Attributes:
        world: The state of the server.
        managers: Address of each Traffic Manager that runs in a client, by port.
        own_managers: Ports of those that came over this connection.
    """

    world: World
    managers: dict[int, str]
    own_managers: set[int] = field(default_factory=set)


@dataclass(frozen=True, slots=True)
class Call:
    """One call: the arguments it takes, and what it does."""

    arguments: tuple[Kind, ...]
    body: Body
    is_void: bool = False


CALLS: dict[str, Call] = {}

SLOW = frozenset(("copy_opendrive_to_file",))
"""Calls that may take seconds and touch nothing that others use; they run in a thread."""


def call(*arguments: Kind, void: bool = False) -> Callable[[Body], Body]:
    """Declare a call under the name of its function.

    Args:
        arguments: The kinds of its arguments.
        void: Whether it only does something; then an error has another shape.
    """

    def declare(body: Body) -> Body:
        CALLS[body.__name__] = Call(arguments, body, void)
        return body

    return declare
