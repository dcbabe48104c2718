"""The pages and answers of the server, each by its path."""

from __future__ import annotations

import asyncio
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from overtaking.core.errors import NoSuchSimulationError, OvertakingError
from overtaking.show.server.guard import SESSION, Guard, Keys
from overtaking.show.server.library import FAULT
from overtaking.show.server.wanted import Branch, Futures, Query, Rows, Token, asked
from overtaking.show.view.page import shell

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request as AnyRequest

    from overtaking.show.server.library import Library

    Request = AnyRequest[Any]

MOST_BYTES = 16_384
"""Of the body of a request."""

RETRY_AFTER_S = 1
"""Time after which the page repeats a request that was refused because a queue is full [s]."""

_DIGITS = re.compile(r"[0-9]{1,15}", re.ASCII)
_CLOSED = "the connection was closed before the request was answered"
_USED = "this address has been used: go on in the browser that used it, or start the command again"


def app(library: Library, hosts: tuple[str, ...], keys: Keys) -> Starlette:
    """The application.

    Args:
        library: What it tells of.
        hosts: The addresses that are listened on, with the port.
        keys: Who is let in.
    """
    answers = _Answers(library, keys)
    get, post = ["GET"], ["POST"]
    routes = [
        Route("/", _page, methods=get),
        Route("/viewer.js", _built("viewer.js", "text/javascript"), methods=get),
        Route("/viewer.css", _built("viewer.css", "text/css"), methods=get),
        Route(SESSION, answers.session, methods=post),
        Route("/api/start", answers.start, methods=get),
        Route("/api/rows", answers.rows, methods=post),
        Route("/api/sql", answers.sql, methods=post),
        Route("/api/runs/{number}", answers.run, methods=get),
        Route("/api/runs/{number}/beliefs", answers.beliefs, methods=get),
        Route("/api/runs/{number}/thumbnail", answers.thumbnail, methods=get),
        Route("/api/runs/{number}/branches", answers.branch, methods=post),
        Route("/api/runs/{number}/fan", answers.fan, methods=post),
    ]
    return Starlette(
        routes=routes,
        middleware=[Middleware(Guard, hosts=hosts, keys=keys)],
        exception_handlers={
            HTTPException: _refused,
            OvertakingError: _wrong,
            Exception: _failed,
        },
    )


class RequestQueue:
    """A queue of the requests of one kind, of which a few are computed at a time.

    Each kind has a queue of its own, so that slow requests delay no requests of another kind.
    All queues together compute fewer requests than Starlette has threads (40).

    Args:
        kind: Plural noun for the error message, such as "queries".
        max_running: Requests that are computed at a time.
        max_queued: Requests that are computed or wait; further ones are refused with status 429.
    """

    def __init__(self, kind: str, *, max_running: int, max_queued: int) -> None:
        """Start empty."""
        self._kind, self._max_queued = kind, max_queued
        self._running, self._num_queued = asyncio.Semaphore(max_running), 0

    async def answer(
        self, request: Request, function: Callable[..., dict[str, Any]], *arguments: Any
    ) -> Response:
        """The answer of a function to a request, computed in a thread.

        Raises:
            HTTPException: The queue is full, or the client has closed the connection.
        """
        if self._num_queued >= self._max_queued:
            reason = f"{self._max_queued} {self._kind} run or wait already: ask again in a moment"
            raise HTTPException(429, reason, {"Retry-After": str(RETRY_AFTER_S)})
        self._num_queued += 1
        try:
            async with self._running:
                if await request.is_disconnected():
                    raise HTTPException(408, _CLOSED)
                return JSONResponse(await run_in_threadpool(function, *arguments))
        finally:
            self._num_queued -= 1


class _Answers:
    """The answer of each path."""

    def __init__(self, library: Library, keys: Keys) -> None:
        self._library, self._keys = library, keys
        self._lists = RequestQueue("lists", max_running=4, max_queued=32)
        self._queries = RequestQueue("queries", max_running=1, max_queued=8)
        self._runs = RequestQueue("simulations", max_running=4, max_queued=64)
        self._branches = RequestQueue("branches and fans", max_running=4, max_queued=16)

    async def session(self, request: Request) -> Response:
        key = self._keys.exchange(asked(Token, await _body(request)).token)
        if key is None:
            raise HTTPException(401, _USED)
        answer = JSONResponse({})
        answer.set_cookie(self._keys.cookie, key, httponly=True, samesite="strict")
        return answer

    async def start(self, _: Request) -> Response:
        return JSONResponse(self._library.start())

    async def rows(self, request: Request) -> Response:
        rows = asked(Rows, await _body(request))
        queue = self._queries if rows.sql else self._lists
        return await queue.answer(request, self._library.rows, rows)

    async def sql(self, request: Request) -> Response:
        text = asked(Query, await _body(request)).sql
        return await self._queries.answer(request, self._library.sql, text)

    async def run(self, request: Request) -> Response:
        return await self._runs.answer(request, self._library.run, _number(request))

    async def beliefs(self, request: Request) -> Response:
        return await self._runs.answer(request, self._library.beliefs, _number(request))

    async def thumbnail(self, request: Request) -> Response:
        return await self._runs.answer(request, self._library.thumbnail, _number(request))

    async def branch(self, request: Request) -> Response:
        number, changes = _number(request), asked(Branch, await _body(request))
        return await self._branches.answer(request, self._library.branch, number, changes)

    async def fan(self, request: Request) -> Response:
        number, futures = _number(request), asked(Futures, await _body(request))
        return await self._branches.answer(request, self._library.fan, number, futures)


async def _body(request: Request) -> bytes:
    """The body of a request, if it is small."""
    body = b""
    try:
        async for part in request.stream():
            body += part
            if len(body) > MOST_BYTES:
                raise HTTPException(413, f"a request has {MOST_BYTES} bytes at most")
    except ClientDisconnect:
        raise HTTPException(408, _CLOSED) from None
    return body


def _number(request: Request) -> int:
    """The number of a simulation in a path."""
    text = request.path_params["number"]
    if not _DIGITS.fullmatch(text):
        raise HTTPException(404, "no such simulation")
    return int(text)


async def _page(_: Request) -> Response:
    return HTMLResponse(shell())


def _built(name: str, kind: str) -> Callable[[Request], Response]:
    content = files("overtaking.show.view").joinpath(name).read_bytes()
    return lambda _: Response(content, media_type=kind)


async def _refused(_: Request, error: Exception) -> Response:
    is_known = isinstance(error, HTTPException)
    status, detail = (error.status_code, error.detail) if is_known else (500, FAULT)
    return JSONResponse({"error": detail}, status, error.headers if is_known else None)


async def _wrong(_: Request, error: Exception) -> Response:
    return JSONResponse(
        {"error": str(error)}, 404 if isinstance(error, NoSuchSimulationError) else 400
    )


async def _failed(_: Request, __: Exception) -> Response:
    return JSONResponse({"error": FAULT}, 500)
