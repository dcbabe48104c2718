"""How a call is declared: its name, the arguments it takes, and what it does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from overtaking.simulators.carla_server.answers import Answer, refusal, void_refusal

if TYPE_CHECKING:
    from overtaking.simulators.carla_server.arguments import Kind
    from overtaking.simulators.carla_server.world import World

VERSION = "0.9.16"
"""The version of CARLA whose clients are served."""

Body = Callable[..., Answer]
Refuse = Callable[[str], Answer]


@dataclass(slots=True)
class Session:
    """What a call may look at.

    Attributes:
        world: The state of the server.
        managers: Address of each Traffic Manager that runs in a client, by port.
        own_managers: Ports of those that came over this connection.
        unseen: What was refused without the client being able to see it, until the server says it.
    """

    world: World
    managers: dict[int, str]
    own_managers: set[int] = field(default_factory=set)
    unseen: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Call:
    """One call: the arguments it takes, what it does, and the shape of its errors."""

    arguments: tuple[Kind, ...]
    body: Body
    refuse: Refuse = refusal


CALLS: dict[str, Call] = {}

SLOW = frozenset(("copy_opendrive_to_file",))
"""Calls that may take seconds and touch nothing that others use; they run in a thread."""


LACKING_VOID = frozenset(
    (
        "apply_color_texture_to_objects", "apply_float_color_texture_to_objects", "enable_gbuffers",
        "load_map_layer", "set_actor_collisions", "set_ignored_vehicles", "unload_map_layer",
    )
)  # fmt: skip
"""Calls that are not offered, that clients wait for, and whose errors have the shape of `void`."""


def refuse_unknown(name: str) -> Answer:
    """The answer to a call that is not offered, in the shape that the client reads."""
    text = f"{name}: the headless server does not offer this call"
    return (void_refusal if name in LACKING_VOID else refusal)(text)


def call(*arguments: Kind, void: bool = False, refuse: Refuse = refusal) -> Callable[[Body], Body]:
    """Declare a call under the name of its function.

    Args:
        arguments: The kinds of its arguments.
        void: Whether it only does something; then an error has another shape.
        refuse: Makes an error of a message where it is not `void`.
    """

    def declare(body: Body) -> Body:
        CALLS[body.__name__] = Call(arguments, body, void_refusal if void else refuse)
        return body

    return declare
