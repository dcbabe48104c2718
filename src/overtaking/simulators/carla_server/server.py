"""The two sockets of the server: calls and answers, and streams."""

import asyncio
import contextlib
import math
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from overtaking.core.errors import ConfigError
from overtaking.simulators.carla_server import protocol
from overtaking.simulators.carla_server.calls import CALLS
from overtaking.simulators.carla_server.connections import Connection, Connections, CrowdedError
from overtaking.simulators.carla_server.maps import Atlas
from overtaking.simulators.carla_server.protocol import Session
from overtaking.simulators.carla_server.streams import SETTLING_TIME, Streams
from overtaking.simulators.carla_server.wire import Budget, Decoder, ProtocolError, encode
from overtaking.simulators.carla_server.world import World

MESSAGE_TIMEOUT = 30.0
"""Longest time from the first byte of a message to its last [s]."""

ANSWER_TIMEOUT = 60.0
"""Longest wait for a client to read an answer that exceeds the write buffer [s]."""

SILENCE = 10.0
"""A synchronous client with Traffic Managers that is silent this long is reported [s]."""

MAX_COMPLAINTS = 1000
"""Bad messages that are logged one by one, so that a client cannot fill a disk."""

MAX_TOLD, MAX_TOLD_CHARACTERS = 20, 200
"""Logged calls without effect of each client, and longest log line."""

LOADING_TIME = 0.1
"""From the last snapshot before a new episode to the answer to the call that began it [s].

On a real server loading takes seconds. The client of 0.9.16 relies on that: it drops its old
episode when the answer comes. If a thread of its pool is in the callback of a snapshot then, that
thread drops it later, and with it the stream of the new episode, which has the same number. The
client dies of signal 11 or 6. So no snapshot is sent either until it asks for the new episode.
"""

_READ_BYTES = 1 << 14
_CALL, _ANSWER = 0, 1

Log = Callable[[str], None]


@dataclass(slots=True)
class Server:
    """A running server.

    Attributes:
        world: Its state.
        log: Receives lines about what happens.
    """

    world: World
    log: Log
    managers: dict[int, str] = field(default_factory=dict)
    connections: Connections = field(init=False)
    _budget: Budget = field(default_factory=Budget)
    _last_call: float = 0.0
    _complaints: int = 0
    _loader: Connection | None = None
    _still_until: float = 0.0

    def __post_init__(self) -> None:
        """Start without connections."""
        self.connections = Connections(self._complain)

    async def serve_calls(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer the calls of one connection until it ends or sends what no client sends.

        At most one answer is produced beyond the few kilobytes that a connection buffers. Until the
        client reads it no further call is answered.
        """
        session = Session(self.world, self.managers)
        decoder = Decoder(self._budget)
        try:
            _at_once(writer)
            with self.connections.enter(writer) as connection:
                await self._answer_calls(reader, connection, session, decoder)
        except CrowdedError as error:
            self._complain(f"a client was turned away: {error}")
        except ProtocolError as error:
            self._complain(f"a connection was dropped: it sent {error}")
        except TimeoutError:
            self._complain(
                f"a connection was dropped: within {MESSAGE_TIMEOUT:g} s it did not complete a"
                f" message, or within {ANSWER_TIMEOUT:g} s it did not read an answer"
            )
            writer.transport.abort()
        except ConnectionError:
            pass
        finally:
            decoder.close()
            for port in session.own_managers:
                self.managers.pop(port, None)
            writer.close()

    async def _answer_calls(
        self,
        reader: asyncio.StreamReader,
        connection: Connection,
        session: Session,
        decoder: Decoder,
    ) -> None:
        """Answer calls until the client closes the connection.

        Raises:
            TimeoutError: The client did not complete a message, or did not read an answer.
        """
        deadline: float | None = None  # For the rest of a message that has arrived in part.
        while data := await _read(reader, deadline):
            for message in decoder.feed(data):
                deadline = None
                connection.note_call()
                connection.writer.write(await self._answer(session, connection, message))
                async with asyncio.timeout(ANSWER_TIMEOUT):
                    await connection.writer.drain()
            if deadline is None and not decoder.is_empty:
                deadline = asyncio.get_running_loop().time() + MESSAGE_TIMEOUT
            if len(data) == _READ_BYTES:
                await asyncio.sleep(0)  # Other connections get their turn.

    async def _answer(self, session: Session, connection: Connection, message: Any) -> bytes:
        """The answer to one message."""
        number, is_async, name, parameters = _opened(message)
        self._last_call = asyncio.get_running_loop().time()
        if _is_tick(name, parameters):
            await self.world.streams.settle()
            await self.world.pictures.wait()
        wanted = CALLS.get(name)
        if wanted is None:
            answer = protocol.refuse_unknown(name)
        elif name in protocol.SLOW:
            answer = await asyncio.to_thread(wanted.answer, session, name, parameters)
        elif name == "load_new_episode":
            answer = await self._load(session, connection, parameters)
        else:
            answer = wanted.answer(session, name, parameters)
        if name == "get_episode_info" and self._loader is connection:
            self._loader = None
        if is_async:
            session.unseen += protocol.errors(answer)
        for error in session.unseen:
            self._tell_unseen(connection, name, error)
        session.unseen.clear()
        return encode([_ANSWER, number, None, answer])

    async def _load(self, session: Session, connection: Connection, parameters: list[Any]) -> Any:
        """Begin an episode; free time stands still until its client asks for the new one."""
        loop = asyncio.get_running_loop()
        self._loader, self._still_until = connection, math.inf
        try:
            await asyncio.sleep(LOADING_TIME)
            return CALLS["load_new_episode"].answer(session, "load_new_episode", parameters)
        finally:
            self._still_until = loop.time() + SETTLING_TIME

    def _tell_unseen(self, connection: Connection, name: str, error: str) -> None:
        """Log once for each client a call whose error it cannot see.

        The genuine client discards the answers to many of its calls, so its user sees nothing.
        """
        text = (error if error.startswith(name) else f"{name}: {error}")[:MAX_TOLD_CHARACTERS]
        if text not in connection.told and len(connection.told) < MAX_TOLD:
            connection.told.add(text)
            self._complain(
                f"client {connection.name} may not see that a call had no effect: {text}"
            )

    def _complain(self, text: str) -> None:
        """Log a bad message, unless there were too many."""
        self._complaints += 1
        if self._complaints <= MAX_COMPLAINTS:
            self.log(text)
        if self._complaints == MAX_COMPLAINTS:
            self.log("there were many bad messages; no more are told")

    async def run_free(self) -> None:
        """Tick in real time while no client ticks."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            due = max(due + self.world.delta, loop.time() - self.world.delta)
            await asyncio.sleep(max(due - loop.time(), 0.001))
            is_loading = self._loader is not None and loop.time() < self._still_until
            if not self.world.settings.synchronous and not is_loading:
                self.world.tick()

    async def watch(self) -> None:
        """Log once that a client has fallen silent in the middle of its ticks."""
        loop = asyncio.get_running_loop()
        told = False
        while True:
            await asyncio.sleep(0.5 * SILENCE)
            silent = loop.time() - self._last_call > SILENCE
            waiting = silent and bool(self.managers) and self.world.settings.synchronous
            if waiting and not told:
                self.log(
                    f"no call for {SILENCE:g} s after frame {self.world.frame} although a Traffic"
                    " Manager runs: the client is busy, paused, or its Traffic Manager has missed"
                    " a wake-up (a fault of the 0.9.16 client); in that case end the client"
                )
            told = waiting


async def _read(reader: asyncio.StreamReader, deadline: float | None) -> bytes:
    """The next bytes of a connection, empty at its end.

    Raises:
        TimeoutError: No bytes arrived before the deadline.
    """
    async with asyncio.timeout_at(deadline):
        return await reader.read(_READ_BYTES)


def _is_tick(name: str, parameters: list[Any]) -> bool:
    """Whether a call advances the simulation; for a batch the last parameter asks for a tick."""
    return name == "tick_cue" or (name == "apply_batch" and parameters[-1:] == [True])


def _opened(message: Any) -> tuple[int, bool, str, list[Any]]:
    """Number of a call, whether the client throws its answer away, its name and arguments."""
    match message:
        case [0, int(number), str(name), [[bool(is_async)], *parameters]] if number >= 0:
            return number, is_async, name, parameters
        case _:
            raise ProtocolError("a message that is no call")


def _at_once(writer: asyncio.StreamWriter) -> None:
    """Send small answers without waiting for more, and notice when the other machine is gone."""
    plug = writer.get_extra_info("socket")
    if plug is not None:
        plug.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        plug.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)


async def serve(
    atlas: Atlas,
    *,
    host: str,
    port: int,
    seed: int,
    ready: Callable[[int, int], None],
    log: Log,
) -> None:
    """Serve until cancelled.

    Args:
        atlas: The maps; the first one is loaded.
        host: Address to listen on.
        port: For calls; streams get the next one. 0 lets the system choose both.
        seed: Seed of gusts and puddles.
        ready: Called with both ports when clients may come.
        log: Called with a line when something happens that a person may want to know.

    Raises:
        ConfigError: A port is taken, or the address is not one of this machine.
    """
    streams = Streams(log)
    server = Server(World(atlas, streams, seed), log)

    async def listen_to_stream(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        _at_once(writer)
        await streams.serve(reader, writer)

    answering = await _listen(server.serve_calls, host, port)
    port = answering.sockets[0].getsockname()[1]
    pushes = await _listen(listen_to_stream, host, 0 if port == 0 else port + 1, fallback=True)
    streams.port = pushes.sockets[0].getsockname()[1]
    async with answering, pushes:
        ready(port, streams.port)
        try:
            await asyncio.gather(server.run_free(), server.watch())
        finally:
            server.world.pictures.close()


async def _listen(
    serve_one: Callable[..., Any], host: str, port: int, *, fallback: bool = False
) -> asyncio.Server:
    """A listening socket; with `fallback` on any port where this one is taken."""

    async def until_ended(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # When the server ends, Python 3.11 prints a traceback of each connection that is cancelled.
        with contextlib.suppress(asyncio.CancelledError):
            await serve_one(reader, writer)

    if fallback:
        with contextlib.suppress(OSError):
            return await asyncio.start_server(until_ended, host, port)
        port = 0
    try:
        return await asyncio.start_server(until_ended, host, port)
    except (OSError, OverflowError) as error:
        raise ConfigError(
            what="address",
            where=f"{host}:{port}",
            expected="a free port of this machine",
            got=str(error),
            next_step="stop what uses it, or choose another with --port",
        ) from None
